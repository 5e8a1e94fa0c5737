"""Records as tables of plain values, both ways: what TOML and JSON files of this package hold.

Decides how a record is written (a key is the field's name and its unit, such as ``radius_mm``; a
record inside is a table, several of them an array of tables; one of several types names its kind)
and what is refused when it is read:
unknown and missing keys, values of another kind, numbers that are not finite. Hides the conversion
from and to SI, which loses no digit where numbers are decimals.
"""

import difflib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from decimal import Decimal
from types import UnionType
from typing import (
    Any,
    Final,
    Literal,
    NoReturn,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from smoskin.errors import MissingExtraError, SmoskinError
from smoskin.units import SI_PER_SUFFIX, from_si, to_si

Origins = Mapping[str, Mapping[str, str]]
"""Origin and reason of values, by the dotted path of their field, such as ``cell.panel_a``."""

_R = TypeVar("_R")
_TEXT: Final = 2**18
"""Characters of a TOML document."""
_LINE: Final = 1000
"""Characters of a line of it."""
_KINDS: Final = {int: "a whole number", float: "a number", str: "text"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """Form in which records of one family are written.

    Fields of a record that do not count when records are compared are not written, nor is a field
    that holds None.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Disc:
    ...     radius: float
    >>> form = Form(units={"radius": "mm"}, error=SmoskinError)
    >>> form.table(Disc(0.0015)), form.record(Disc, {"radius_mm": 1.5})
    ({'radius_mm': 1.5}, Disc(radius=0.0015))
    """

    units: Mapping[str, str]
    """Unit suffix of each field that has one, or the record's field that names its unit."""
    error: type[SmoskinError]
    """Error raised for a document that does not fit."""
    inline: tuple[str, ...] = ()
    """Fields that hold a record whose keys stand in the table of their owner."""
    gaps: bool = False
    """Whether NaN and infinity may stand for a number that is not known."""
    number: type[Decimal] | type[float] = field(default=float)
    """Type of the written numbers that have a unit; decimals keep TOML files short."""

    def table(self, record: Any, origins: Origins | None = None, path: str = "") -> dict[str, Any]:
        """The table of a record; `record` makes an equal record of it.

        Values with `origins` are written as tables of value, origin and reason; `path` is the
        record's among them, with a dot at its end.
        """
        table: dict[str, Any] = {}
        hints = get_type_hints(type(record))
        for part in _parts(type(record)):
            where, value = path + part.name, getattr(record, part.name)
            if part.name in self.inline:
                table |= self.table(value, origins, path)
                continue
            if value is None:
                continue
            suffix = self._suffix(part.name, lambda name: getattr(record, name))
            plain = self._plain(value, suffix, origins, where)
            if is_dataclass(value) and len(_choices(hints[part.name])) > 1:
                plain = {"kind": type(value).__name__.lower(), **plain}
            if origins and where in origins:
                plain = {"value": plain, **origins[where]}
            table[self._key(type(record), part.name)] = plain
        return table

    def record(
        self,
        kind: type[_R],
        table: Any,
        origins: dict[str, dict[str, str]] | None = None,
        path: str = "",
    ) -> _R:
        """The record of this dataclass that a table describes, its numbers of any type.

        `origins` is filled with those of values that name theirs; without it they may not. `path`
        is the record's, for messages, with a dot at its end.

        Raises
        ------
        SmoskinError
            Of the type `error`, naming the key and what would be valid, in at most 300 characters.
        """
        self._check_keys(path[:-1], table, self._keys(kind), self._keys(kind, required=True))
        hints, values = get_type_hints(kind), {}
        for part in _parts(kind):
            where, hint, key = path + part.name, hints[part.name], self._key(kind, part.name)
            if part.name in self.inline:
                mine = {name: table[name] for name in self._keys(hint) if name in table}
                values[part.name] = self.record(hint, mine, origins, path)
            elif key in table:
                value = table[key]
                if origins is not None and isinstance(value, dict) and not _is_record(hint):
                    self._check_keys(
                        where, value, ["value", "origin", "reason"], ["value", "origin"]
                    )
                    why = self._value(str, value.get("reason", ""), None, f"{where}.reason", None)
                    origins[where] = {"origin": value["origin"], "reason": why}
                    value = value["value"]
                suffix = self._suffix(part.name, table.get)
                values[part.name] = self._value(hint, value, suffix, where, origins)
        try:
            return kind(**values)
        except (SmoskinError, TypeError) as error:
            own = isinstance(error, self.error)
            self._refuse(f"{error}" if own else f"{path[:-1] or 'document'}: {error}", error)

    def parse_toml(self, text: str) -> dict[str, Any]:
        """The tables of a TOML document, its numbers as decimals."""
        longest = max(map(len, text.splitlines()), default=0)
        if longest > _LINE or len(text) > _TEXT:  # what nests deeply takes minutes
            self._refuse(
                f"a document must have at most {_TEXT:,} characters and {_LINE:,} a line; got "
                f"{len(text):,} and {longest:,}"
            )
        try:
            return tomllib.loads(text, parse_float=Decimal)
        except (ValueError, ArithmeticError, RecursionError) as error:
            self._refuse(f"not a TOML document: {error}", error)

    def _refuse(self, message: str, cause: Exception | None = None) -> NoReturn:
        """Raise the form's error."""
        raise self.error(message) from cause

    def _suffix(self, name: str, value_of: Any) -> str | None:
        """Unit suffix of a field, which another field of its record may name."""
        suffix = self.units.get(name)
        if suffix is None or suffix in SI_PER_SUFFIX:
            return suffix
        named = value_of(suffix)
        if named not in SI_PER_SUFFIX:
            self._refuse(f"{suffix} must be one of {', '.join(SI_PER_SUFFIX)}; got {named!r}")
        return str(named)

    def _key(self, kind: type[Any], name: str) -> str:
        """Key of a field."""
        suffix = self.units.get(name)
        return name if suffix is None or suffix not in SI_PER_SUFFIX else f"{name}_{suffix}"

    def _keys(self, kind: type[Any], *, required: bool = False) -> list[str]:
        """Keys of a record's table, or those that must be there."""
        keys, hints = [], get_type_hints(kind)
        for part in _parts(kind):
            if part.name in self.inline:
                keys += self._keys(hints[part.name], required=required)
            elif not required or (part.default is MISSING and part.default_factory is MISSING):
                keys.append(self._key(kind, part.name))
        return keys

    def _check_keys(self, path: str, table: Any, known: list[str], required: list[str]) -> None:
        """Refuse what is no table, or has unknown or missing keys."""
        where = f"{path}: " if path else ""
        if not isinstance(table, Mapping):
            self._refuse(f"{path or 'document'} must be a table; got {table!r}")
        for key in table:
            if key not in known:
                near = difflib.get_close_matches(key, known, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else "."
                self._refuse(f"{where}unknown key {key!r}{hint} Valid: {', '.join(known)}")
        for key in required:
            if key not in table:
                self._refuse(f"{where}missing key {key!r}")

    def _plain(self, value: Any, suffix: str | None, origins: Origins | None, path: str) -> Any:
        """A value as it is written."""
        if is_dataclass(value):
            return self.table(value, origins, f"{path}.")
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if isinstance(value, list | tuple):
            return [
                self._plain(part, suffix, origins, f"{path}.{index}")
                for index, part in enumerate(value)
            ]
        if suffix is None or not math.isfinite(value):
            return value
        return self.number(from_si(value, suffix))

    def _value(
        self,
        hint: Any,
        value: Any,
        suffix: str | None,
        path: str,
        origins: dict[str, dict[str, str]] | None,
    ) -> Any:
        """A value of a field of this type, in SI."""
        origin, args = get_origin(hint), get_args(hint)
        if origin in (Union, UnionType):
            choices = _choices(hint)
            if len(choices) == 1:
                return self._value(choices[0], value, suffix, path, origins)
            named = {kind.__name__.lower(): kind for kind in choices}
            if not isinstance(value, Mapping) or value.get("kind") not in named:
                self._refuse(f"{path} must be a table with a kind of {', '.join(named)}")
            hint = named[value["kind"]]
            value = {key: part for key, part in value.items() if key != "kind"}
        if is_dataclass(hint):
            return self.record(cast("type[Any]", hint), value, origins, f"{path}.")
        if origin in (tuple, np.ndarray):
            rows = list(value) if isinstance(value, list | tuple) else []
            if origin is np.ndarray:
                args = ((hint if rows and isinstance(rows[0], list) else float), ...)
            kinds = args[:1] * len(rows) if args[-1] is ... else args
            if not isinstance(value, list | tuple) or len(kinds) != len(rows):
                count = "" if args[-1] is ... else f" of {len(args)} values"
                self._refuse(f"{path} must be a list{count}; got {value!r}")
            return tuple(
                self._value(kind, part, suffix, f"{path}.{index}", origins)
                for index, (kind, part) in enumerate(zip(kinds, rows, strict=True))
            )
        if origin is Literal:
            hint = type(args[0])
        return self._number_or_text(hint, value, suffix, path)

    def _number_or_text(self, hint: Any, value: Any, suffix: str | None, path: str) -> Any:
        """One number, in SI, or text."""
        wanted: Any = (int, float, Decimal) if hint is float else hint
        if not isinstance(value, wanted) or isinstance(value, bool):
            unit = f" of {suffix}" if suffix else ""
            self._refuse(f"{path} must be {_KINDS[hint]}{unit}; got {value!r}")
        if hint is not float:
            return value
        try:
            number = to_si(value, suffix) if suffix and math.isfinite(value) else float(value)
        except ArithmeticError:
            number = math.inf
        if not math.isfinite(number) and not (self.gaps and not math.isfinite(value)):
            self._refuse(f"{path} must be finite; got {value}")
        return number


def format_toml(document: Mapping[str, Any], purpose: str) -> str:
    """The text of a TOML document; the purpose, such as ``"writing a design"``, is for the message.

    Raises
    ------
    MissingExtraError
        If the TOML writer is not installed.
    """
    try:
        import tomli_w
    except ImportError as error:
        raise MissingExtraError(purpose, "cli") from error
    return tomli_w.dumps(document)


def _parts(kind: type[Any]) -> list[Field[Any]]:
    """Fields of a record that are written."""
    return [part for part in fields(kind) if part.compare]


def _choices(hint: Any) -> list[Any]:
    """Types of the values that a field can hold but for None."""
    return [kind for kind in get_args(hint) or (hint,) if kind is not type(None)]


def _is_record(hint: Any) -> bool:
    """Whether a field of this type is written as a table."""
    return any(is_dataclass(kind) for kind in (hint, *get_args(hint)))
