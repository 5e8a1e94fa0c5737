"""Skin designs as TOML documents, both ways, every value with its unit and its provenance.

A value is either plain (``radius_mm = 1.5``) or a table that says where it comes from
(``radius_mm = {value = 1.5, origin = "assumed", reason = "..."}``). Unknown keys are refused
with what would be valid.
"""

import difflib
import os
import tomllib
from collections.abc import Mapping
from dataclasses import fields
from decimal import Decimal
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from smoskin.design.skin import (
    Board,
    Coefficients,
    Columns,
    Creases,
    Frame,
    HallSetting,
    HallSite,
    Magnet,
    MiuraCell,
    Panels,
    Provenance,
    ShearLayer,
    SkinDesign,
)
from smoskin.errors import DesignError, MissingExtraError
from smoskin.units import from_si, to_si

_SECTIONS: Final = MappingProxyType(
    {
        "cell": MiuraCell,
        "creases": Creases,
        "panels": Panels,
        "columns": Columns,
        "frame": Frame,
        "board": Board,
        "shear_layer": ShearLayer,
        "hall_setting": HallSetting,
        "coefficients": Coefficients,
    }
)
_LISTS: Final = MappingProxyType({"magnets": Magnet, "halls": HallSite})

#: Unit suffix of each field that has one; the document's key is ``field_suffix``.
_SUFFIXES: Final = MappingProxyType(
    {
        "panel_a": "mm",
        "panel_b": "mm",
        "sector_angle": "deg",
        "fold_angle": "deg",
        "radius": "mm",
        "height": "mm",
        "gap": "mm",
        "thickness": "mm",
        "sensing_height": "mm",
        "stiffness": "N_per_mm",
        "remanence": "A_per_m",
        "folding_correction_x": "N",
        "folding_correction_y": "N",
    }
)


def shipped_designs() -> tuple[str, ...]:
    """Names of the designs that come with the package."""
    folder = resources.files("smoskin.design")
    return tuple(sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml")))


def shipped_design(content_hash: str) -> SkinDesign:
    """The design with this content hash among those that come with the package.

    Raises
    ------
    DesignError
        If there is none.
    """
    for name in shipped_designs():
        if (design := read_design(name)).content_hash == content_hash:
            return design
    raise DesignError(
        f"design must be given: {content_hash[:12]} is none of those that come with the package "
        f"({', '.join(shipped_designs())})"
    )


def read_design(name_or_path: str | os.PathLike[str]) -> SkinDesign:
    """A design shipped with the package, by name, or any TOML document, by path.

    Raises
    ------
    DesignError
        If there is no such design, or the document does not describe a skin.
    """
    given = os.fspath(name_or_path)
    if given in shipped_designs():
        source = resources.files("smoskin.design").joinpath(f"{given}.toml")
        return parse_design(source.read_text(encoding="utf-8"))
    try:
        text = Path(given).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        known = ", ".join(shipped_designs())
        raise DesignError(
            f"design must be the name of a shipped design ({known}) or the path of a TOML "
            f"document; got {given!r} ({error})"
        ) from error
    try:
        return parse_design(text)
    except DesignError as error:
        raise DesignError(f"{given}: {error}") from error


def parse_design(text: str) -> SkinDesign:
    """The design that a TOML document describes.

    Raises
    ------
    DesignError
        If the document is not TOML, has unknown or missing keys, or describes what cannot
        be built; the message names the key and what would be valid.
    """
    try:
        document = tomllib.loads(text, parse_float=Decimal)
    except tomllib.TOMLDecodeError as error:
        raise DesignError(f"not a TOML document: {error}") from error
    provenance: dict[str, Provenance] = {}
    _refuse_unknown("", document, ["name", "cells", *_SECTIONS, *_LISTS])
    values: dict[str, Any] = {
        key: _part(key, cls, document.pop(key), provenance) for key, cls in _SECTIONS.items()
    }
    for key, cls in _LISTS.items():
        entries = document.pop(key)
        if not isinstance(entries, list):
            raise DesignError(f"{key} must be an array of tables, written [[{key}]]")
        values[key] = tuple(
            _part(f"{key}.{index}", cls, entry, provenance) for index, entry in enumerate(entries)
        )
    for key, value in document.items():
        values[key] = _value(key, value, provenance)
    if not isinstance(values["name"], str):
        raise DesignError(f"name must be a string; got {values['name']!r}")
    cells = values["cells"]
    if not (isinstance(cells, tuple) and [type(n) for n in cells] == [int, int]):
        raise DesignError(f"cells must be two whole numbers such as [6, 6]; got {cells!r}")
    return SkinDesign(**values, provenance=provenance)


def format_design(design: SkinDesign) -> str:
    """The TOML document of a design; `parse_design` reads the same design back.

    Raises
    ------
    MissingExtraError
        If the TOML writer is not installed.
    """
    try:
        import tomli_w
    except ImportError as error:
        raise MissingExtraError("writing a design", "cli") from error
    document: dict[str, Any] = {
        "name": design.name,
        "cells": _written("cells", "cells", design.cells, design.provenance)[1],
    }
    for key in _SECTIONS:
        document[key] = _table(key, getattr(design, key), design.provenance)
    for key in _LISTS:
        document[key] = [
            _table(f"{key}.{index}", entry, design.provenance)
            for index, entry in enumerate(getattr(design, key))
        ]
    return tomli_w.dumps(document)


def design_values(design: SkinDesign) -> list[tuple[str, str, str | int | float]]:
    """Every value of a design as its document writes it: field path, key, value.

    Examples
    --------
    >>> design_values(read_design("planar"))[2]
    ('cell.panel_a', 'panel_a_mm', 15.5334)
    """
    rows: list[tuple[str, str, str | int | float]] = [("name", "name", design.name)]
    rows.append(("cells", "cells", " x ".join(map(str, design.cells))))
    parts = [(key, getattr(design, key)) for key in _SECTIONS]
    for key in _LISTS:
        parts += [(f"{key}.{index}", one) for index, one in enumerate(getattr(design, key))]
    for path, part in parts:
        for one in fields(part):
            where = f"{path}.{one.name}"
            key, value = _written(where, one.name, getattr(part, one.name), {})
            if isinstance(value, list):
                value = ", ".join(map(str, value))
            rows.append((where, key, float(value) if isinstance(value, Decimal) else value))
    return rows


def _part(path: str, cls: type[Any], table: Any, provenance: dict[str, Provenance]) -> Any:
    """One record from its table."""
    if not isinstance(table, dict):
        raise DesignError(f"{path} must be a table; got {table!r}")
    keys = {_key(one.name): one.name for one in fields(cls)}
    required = [_key(one.name) for one in fields(cls) if one.name != "polarity"]
    _refuse_unknown(path, table, list(keys), required)
    values = {
        keys[key]: _value(f"{path}.{keys[key]}", value, provenance) for key, value in table.items()
    }
    try:
        return cls(**values)
    except TypeError as error:
        raise DesignError(f"{path}: a value is of the wrong kind ({error})") from error


def _key(name: str) -> str:
    return f"{name}_{_SUFFIXES[name]}" if name in _SUFFIXES else name


def _value(path: str, value: Any, provenance: dict[str, Provenance]) -> Any:
    """One value in SI, noting its provenance."""
    if isinstance(value, dict):
        _refuse_unknown(path, value, ["value", "origin", "reason"], ["value", "origin"])
        provenance[path] = Provenance(origin=value["origin"], reason=value.get("reason", ""))
        value = value["value"]
    name = path.rpartition(".")[2]
    suffix = _SUFFIXES.get(name)
    many = isinstance(value, list)
    out = []
    for one in value if many else [value]:
        number = isinstance(one, Decimal | int) and not isinstance(one, bool)
        if suffix is not None and not number:
            raise DesignError(f"{path} must be a number of {suffix}; got {one!r}")
        out.append(to_si(one, suffix) if suffix else float(one) if type(one) is Decimal else one)
    return tuple(out) if many else out[0]


def _refuse_unknown(
    path: str, table: Mapping[str, Any], known: list[str], required: list[str] | None = None
) -> None:
    where = f"{path}: " if path else ""
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise DesignError(f"{where}unknown key {key!r}{hint} Valid: {', '.join(known)}")
    for key in known if required is None else required:
        if key not in table:
            raise DesignError(f"{where}missing key {key!r}")


def _table(path: str, part: Any, provenance: Mapping[str, Provenance]) -> dict[str, Any]:
    """One record as its table."""
    return dict(
        _written(f"{path}.{one.name}", one.name, getattr(part, one.name), provenance)
        for one in fields(part)
    )


def _written(
    path: str, name: str, value: Any, provenance: Mapping[str, Provenance]
) -> tuple[str, Any]:
    """The document's key and value of one field."""
    suffix = _SUFFIXES.get(name)
    if suffix is not None:
        value = (
            [from_si(one, suffix) for one in value]
            if isinstance(value, tuple)
            else from_si(value, suffix)
        )
    elif isinstance(value, tuple):
        value = list(value)
    known = provenance.get(path)
    if known is not None:
        value = {"value": value, "origin": known.origin, "reason": known.reason}
    return _key(name), value
