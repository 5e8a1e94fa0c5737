"""Skin designs as TOML documents, both ways, every value with its unit and its provenance.

A value is either plain (``radius_mm = 1.5``) or a table that says where it comes from
(``radius_mm = {value = 1.5, origin = "assumed", reason = "..."}``). Decides the units of a design's
keys; how records become documents is `smoskin.documents`'s.
"""

import logging
import os
from collections.abc import Iterator
from dataclasses import asdict, fields, is_dataclass, replace
from decimal import Decimal
from importlib import resources
from typing import Any, Final

from smoskin.design.skin import Provenance, SkinDesign
from smoskin.documents import Form, format_toml
from smoskin.errors import DesignError
from smoskin.outputs import path_text, read_text

_LARGEST: Final = 2**20
"""Largest document that is read, bytes."""

_LOG: Final = logging.getLogger(__name__)
_FORM: Final = Form(
    units={
        "panel_a": "mm",
        "panel_b": "mm",
        "sector_angle": "deg",
        "fold_angle": "deg",
        "radius": "mm",
        "height": "mm",
        "gap": "mm",
        "thickness": "mm",
        "sensing_height": "mm",
        "clearance": "mm",
        "held_height": "mm",
        "play": "mm",
        "vertex_hole": "mm",
        "skin_radius": "mm",
        "far_radius": "mm",
        "remanence": "A_per_m",
        "folding_correction_x": "N",
        "folding_correction_y": "N",
    },
    error=DesignError,
    number=Decimal,
)


def shipped_designs() -> tuple[str, ...]:
    """Names of the designs that come with the package."""
    folder = resources.files("smoskin.design")
    return tuple(sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml")))


def shipped_design(content_hash: str) -> SkinDesign:
    """The shipped design of this content hash; raises `DesignError` where there is none."""
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
    given = path_text(name_or_path)
    if given in shipped_designs():
        source = resources.files("smoskin.design").joinpath(f"{given}.toml")
        return parse_design(source.read_text(encoding="utf-8"))
    if not os.path.exists(given):
        raise DesignError(
            f"design must be the name of a shipped design ({', '.join(shipped_designs())}) or the "
            f"path of a TOML document; got {given!r}"
        )
    text = read_text(given, _LARGEST, DesignError)
    try:
        design = parse_design(text)
    except DesignError as error:
        raise DesignError(f"{given}: {error}") from error
    _LOG.info("read design %r (%s) from %s", design.name, design.content_hash[:12], given)
    return design


def parse_design(text: str) -> SkinDesign:
    """The design that a TOML document describes.

    Raises
    ------
    DesignError
        If the document is not TOML, has unknown or missing keys, or describes what cannot
        be built; the message names the key and what would be valid.
    """
    origins: dict[str, dict[str, str]] = {}
    design = _FORM.record(SkinDesign, _FORM.parse_toml(text), origins)
    provenance = {path: Provenance(**why) for path, why in origins.items()}  # type: ignore[arg-type]
    return replace(design, provenance=provenance)


def format_design(design: SkinDesign) -> str:
    """The TOML document of a design; `parse_design` reads the same design back.

    Raises
    ------
    MissingExtraError
        If the TOML writer is not installed.
    """
    origins = {path: asdict(why) for path, why in design.provenance.items()}
    return format_toml(_FORM.table(design, origins), "writing a design")


def design_values(design: SkinDesign) -> list[tuple[str, str, str | int | float]]:
    """Every value of a design as its document writes it: field path, key, value.

    Examples
    --------
    >>> design_values(read_design("planar"))[2]
    ('cell.panel_a', 'panel_a_mm', 15.5334)
    """
    return list(_values(design, ""))


def _values(part: Any, path: str) -> Iterator[tuple[str, str, str | int | float]]:
    """The values of a part and of the parts in it."""
    for field, (key, plain) in zip(fields(part), _FORM.table(part).items(), strict=False):
        where, value = f"{path}{field.name}", getattr(part, field.name)
        if is_dataclass(value):
            yield from _values(value, f"{where}.")
        elif isinstance(plain, list) and isinstance(plain[0], dict):
            for index, each in enumerate(value):
                yield from _values(each, f"{where}.{index}.")
        elif isinstance(plain, list):
            yield where, key, (" x " if key == "cells" else ", ").join(map(str, plain))
        else:
            yield where, key, float(plain) if isinstance(plain, Decimal) else plain
