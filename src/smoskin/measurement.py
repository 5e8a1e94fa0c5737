"""Touches of known place and force that a person or a bench has made, and their one CSV file.

Decides the columns and their units; hides the conversion and the checks. A row is one touch held
still, with what the chips read then or from when until when it was held while a recording ran. A
row without a place is the untouched skin; one that says neither what the chips read nor when it was
held has not been made yet, so that the same file is a plan to print and the same filled in.
"""

import csv
import hashlib
import io
import math
import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from decimal import Decimal, InvalidOperation
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Bools, Floats, Ints, assign, floats, freeze
from smoskin.errors import ArgumentError, RecordingError
from smoskin.outputs import TEXT_LIMIT, read_input, write_output
from smoskin.records import Contact, HeldTouch, Reading
from smoskin.units import SI_PER_SUFFIX, from_si, to_si

_PLACE: Final = ("x_mm", "y_mm")
_FORCE: Final = ("force_x_N", "force_y_N", "force_z_N")
_DEPTH: Final = "displacement_z_mm"
_HELD: Final = ("from_s", "until_s")
_DEGREES: Final = "temperature_degC"
_CELL: Final = ("cell_n", "cell_m")
_LARGEST: Final = 1e12
"""Largest number of a cell, SI; seconds since 1970 are some 2e9."""
_APART: Final = 60.0
"""s put between rows that do not say when they were made."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchTable:
    """Touches with known place and force; T rows, S chips.

    It raises an `ArgumentError` if shapes disagree, a touch does not press, or an untouched row has
    a force.
    """

    position: Floats
    """(T, 2), m, in the skin's frame; NaN where nothing touches."""
    force: Floats
    """(T, 3), N, that the toucher exerts on the skin; pressing is negative z. Zero where nothing
    touches."""
    depth: Floats
    """(T,), m: how far the stage pushed the skin down; NaN where that was not measured."""
    field: Floats
    """(T, S, 3), T, in each chip's own axes; NaN where a chip was not read."""
    temperature: Floats
    """(T, S), degC, as each chip reports it; NaN where it does not."""
    held: Floats
    """(T, 2), s: from when until when the touch was held still, on the clock of a recording; NaN
    where that is not known."""

    def __init__(
        self,
        *,
        position: ArrayLike,
        force: ArrayLike,
        field: ArrayLike,
        depth: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
        held: ArrayLike | None = None,
    ) -> None:
        where, read = floats("position", position, (2,)), floats("field", field, (None, 3))
        rows, chips = len(where), read.shape[-2]
        degrees = floats("temperature", np.nan if temperature is None else temperature)
        if degrees.ndim == 0:
            degrees = np.full((rows, chips), degrees)
        elif degrees.ndim == 1:  # one thermometer stands for all chips
            degrees = np.repeat(degrees[:, None], chips, axis=1)
        assign(
            self,
            position=where,
            force=force,
            field=read,
            depth=np.full(rows, np.nan) if depth is None else depth,
            temperature=degrees,
            held=np.full((rows, 2), np.nan) if held is None else held,
        )
        freeze(
            self,
            position=(rows, 2),
            force=(rows, 3),
            field=(rows, chips, 3),
            depth=(rows,),
            temperature=(rows, chips),
            held=(rows, 2),
        )
        self._check()

    def _check(self) -> None:
        """Raise on the first row that is no touch and not the untouched skin."""
        placed, timed = np.isfinite(self.position), np.isfinite(self.held)
        untimely = timed.any(axis=1) & ~(self.held[:, 0] <= self.held[:, 1])
        rules = (
            ("position", placed.any(axis=1) != placed.all(axis=1), "have both coordinates or none"),
            ("force", ~np.isfinite(self.force).all(axis=1), "be finite"),
            ("force", self.touched & ~(self.force[:, 2] < 0), "press: z must be below zero"),
            ("force", ~self.touched & self.force.any(axis=1), "be zero where nothing touches"),
            ("depth", ~self.touched & (self.depth > 0), "be none where nothing touches"),
            ("depth", self.depth < 0, "press: a pushed skin has a displacement z below zero"),
            ("held", untimely, "end with a time that is not before its beginning"),
        )
        for name, bad, rule in rules:
            if bad.any():
                row = int(np.argmax(bad))
                raise ArgumentError(
                    f"{name} must {rule}; got {getattr(self, name)[row]} in row {row + 1}"
                )

    @property
    def touched(self) -> Bools:
        """Whether anything touches the skin, (T,)."""
        return np.asarray(np.isfinite(self.position).all(axis=1))

    @property
    def made(self) -> Bools:
        """Whether the row says what the chips read or when it was held, (T,)."""
        read = np.isfinite(self.field).any(axis=(1, 2))
        return np.asarray(read | np.isfinite(self.held).all(axis=1))

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """All touches, in the order of their rows."""
        rows = np.flatnonzero(self.touched)
        return tuple(Contact(position=self.position[k], force=self.force[k]) for k in rows)

    def rows(self, chosen: Bools | Ints) -> "TouchTable":
        """The table of these rows alone."""
        return TouchTable(**{part.name: getattr(self, part.name)[chosen] for part in fields(self)})

    def with_readings(self, readings: Iterable[Reading]) -> "TouchTable":
        """The table with the mean of the good readings made while each touch was held.

        `ArgumentError` names a row that says not when, or of which no reading has all chips good.
        """
        good = [r for r in readings if not r.flags.any() and np.isfinite(r.field).all()]
        times = np.array([reading.time for reading in good])
        fields, degrees = [], []
        for row, (begin, end) in enumerate(self.held):
            chosen = np.flatnonzero((times >= begin) & (times <= end))
            if not len(chosen):
                raise ArgumentError(
                    f"readings must hold good ones from {begin:g} to {end:g} s, when row {row + 1} "
                    "was held; got none"
                )
            fields.append(np.mean([good[k].field for k in chosen], axis=0))
            reported = np.array([good[k].temperature for k in chosen])
            there = np.isfinite(reported)
            mean = np.where(there, reported, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
            degrees.append(np.where(there.any(axis=0), mean, np.nan))
        return replace(self, field=np.array(fields), temperature=np.array(degrees))

    def held_touches(self, readings: Iterable[Reading] | None = None) -> tuple[HeldTouch, ...]:
        """The touches that have been made, each with the rest before it and its readings.

        Rows say when they were held on the clock of the readings. Without those each row is one
        reading, of a touch held for long enough to have settled. It raises an `ArgumentError` if no
        row has been made, no row of the untouched skin stands before the first touch, rows do not
        follow each other in time, or there are no readings when one was held.
        """
        timed, readings = self._timed() if readings is None else (self, readings)
        made = np.flatnonzero(timed.made)
        if not len(made):
            raise ArgumentError("touches must have been made; no row has been filled in")
        if np.isnan(timed.held[made]).any():
            raise ArgumentError("from_s and until_s must say when each row was held")
        ordered = sorted(readings, key=lambda reading: reading.time)
        times = np.array([reading.time for reading in ordered])
        touches: list[HeldTouch] = []
        rest: tuple[float, float] | None = None
        reached = -np.inf
        for k in made.tolist():
            begin, end = timed.held[k].tolist()
            _check_order(k + 1, (begin, end), reached, times)
            if not self.touched[k]:
                rest, reached = (begin, end), max(reached, begin)
                continue
            if rest is None or begin < rest[1]:
                raise ArgumentError(
                    f"row {k + 1} must come after a row of the untouched skin, without a place"
                )
            contact = Contact(position=self.position[k], force=self.force[k])
            since = times > touches[-1].held[1] if touches else times >= rest[0]
            seen = tuple(ordered[i] for i in np.flatnonzero(since & (times <= end)))
            touches.append(HeldTouch(contact=contact, readings=seen, rest=rest, held=(begin, end)))
            reached = end
        return tuple(touches)

    def _timed(self) -> "tuple[TouchTable, list[Reading]]":
        """The same rows a minute apart, and what those that were read say as readings then."""
        read: Bools = np.asarray(np.isfinite(self.field).any(axis=(1, 2)))
        times = np.where(read, _APART * np.arange(len(read)), np.nan)
        readings = [
            Reading(time=times[k], field=self.field[k], temperature=self.temperature[k])
            for k in np.flatnonzero(read)
        ]
        return replace(self, held=np.stack([times, times], axis=1)), readings


def _check_order(row: int, held: tuple[float, float], reached: float, times: Floats) -> None:
    """Raise unless a row was held after the one before it, and there are readings of then."""
    begin, end = held
    if not ((times >= begin) & (times <= end)).any():
        raise ArgumentError(
            f"readings must hold some from {begin:g} to {end:g} s, when row {row} was held; got "
            "none"
        )
    if begin < reached:
        raise ArgumentError(f"row {row} must be held after the row before it")


def write_touches(path: str | os.PathLike[str], table: TouchTable) -> None:
    """Write a table as CSV; `read_touches` reads the same numbers back."""
    names = [*_PLACE, *_FORCE, _DEPTH, *_HELD, *_chip_columns(table.field.shape[1])]
    chips = np.concatenate([table.field, table.temperature[..., None]], axis=-1)
    force = np.where(table.touched[:, None], table.force, np.nan)
    values = np.column_stack(
        [table.position, force, -table.depth, table.held, chips.reshape(len(force), -1)]
    )
    file = io.StringIO(newline="")
    writer = csv.writer(file)
    writer.writerow(names)
    for row in values:
        writer.writerow(
            str(from_si(float(value) + 0.0, _suffix(name))) if np.isfinite(value) else ""
            for value, name in zip(row, names, strict=True)
        )
    write_output(path, file.getvalue().encode())


def read_touches(path: str | os.PathLike[str]) -> tuple[TouchTable, str]:
    """The table of a CSV file, and the file's SHA-256.

    The columns `x_mm`, `y_mm` (empty for the untouched skin), `force_x_N`, `force_y_N` and
    `force_z_N` (below zero for a press) must be there; `displacement_z_mm` (below zero likewise),
    `from_s` with `until_s` (when the touch was held, on the clock of a recording) and, for each
    chip from 1, `chip1_Bx_uT`, `chip1_By_uT`, `chip1_Bz_uT` and `chip1_temperature_degC` may be.
    `temperature_degC` stands for all chips that do not report their own. It raises a
    `RecordingError` if the file cannot be read, a column is missing or unknown, or a value is no
    number; the message names the line and the column.
    """
    where, raw = os.fspath(path), read_input(path, TEXT_LIMIT, RecordingError)
    try:
        lines = list(csv.reader(io.StringIO(raw.decode("utf-8-sig"))))
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{where}: must be a readable CSV file ({error})") from error
    if len(lines) < 2:
        raise RecordingError(f"{where}: must hold a header and at least one row")
    header = [name.strip() for name in lines[0]]
    chips = _check_header(where, header)
    columns = {name: np.full(len(lines) - 1, np.nan) for name in header}
    for row, line in enumerate(lines[1:]):
        if len(line) != len(header):
            raise RecordingError(
                f"{where}: line {row + 2} must have {len(header)} values; got {len(line)}"
            )
        for name, text in zip(header, line, strict=True):
            columns[name][row] = _read(f"{where}: line {row + 2}", name, text.strip())
    try:
        return _table(columns, chips, len(lines) - 1), hashlib.sha256(raw).hexdigest()
    except ArgumentError as error:
        raise RecordingError(f"{where}: {error}") from error


def _table(columns: dict[str, Floats], chips: int, rows: int) -> TouchTable:
    """The table of columns in SI; those that are not there hold nothing."""
    nothing = np.full(rows, np.nan)
    read = np.array([columns.get(name, nothing) for name in _chip_columns(chips)])
    read = read.reshape(chips, 4, rows).transpose(2, 0, 1)
    common = columns.get(_DEGREES, nothing)[:, None]
    position = np.array([columns[name] for name in _PLACE]).T
    force = np.array([columns[name] for name in _FORCE]).T
    untouched = np.isnan(position).all(axis=1) & np.isnan(force).any(axis=1)
    return TouchTable(
        position=position,
        force=np.where(untouched[:, None], np.nan_to_num(force), force),
        depth=-columns.get(_DEPTH, nothing),
        field=read[..., :3],
        temperature=np.where(np.isfinite(read[..., 3]), read[..., 3], common),
        held=np.array([columns.get(name, nothing) for name in _HELD]).T,
    )


def _check_header(where: str, header: list[str]) -> int:
    """How many chips a header names; raises on columns that are missing or unknown."""
    if any(name in header for name in _CELL):
        raise RecordingError(
            f"{where}: columns cell_n and cell_m are of an older version; replace them by x_mm and "
            "y_mm, the place of the cell's top vertex"
        )
    chips = sum(name.startswith("chip") and "_B" in name for name in header) // 3
    needed = (*_PLACE, *_FORCE, *(n for n in _chip_columns(chips) if not n.endswith(_DEGREES)))
    valid = (*_PLACE, *_FORCE, _DEPTH, *_HELD, _DEGREES, *_chip_columns(chips))
    for name in header:
        if name not in valid or header.count(name) > 1:
            raise RecordingError(
                f"{where}: column {name!r} is unknown or occurs twice; valid: {', '.join(valid)}"
            )
    for name in needed:
        if name not in header:
            raise RecordingError(f"{where}: column {name!r} is missing")
    return chips


def _chip_columns(chips: int) -> list[str]:
    """Columns of so many chips."""
    return [
        f"chip{s}_{what}"
        for s in range(1, chips + 1)
        for what in ("Bx_uT", "By_uT", "Bz_uT", _DEGREES)
    ]


def _suffix(name: str) -> str:
    """Unit suffix of a column."""
    return next(s for s in sorted(SI_PER_SUFFIX, key=len) if name.endswith(f"_{s}"))


def _read(where: str, name: str, text: str) -> float:
    """One value in SI; NaN where there is none."""
    if not text:
        return np.nan
    try:
        # Decimal also reads 1_0 and the digits of other scripts, which no instrument writes.
        number = Decimal(text if text.isascii() and "_" not in text else "no number")
    except InvalidOperation as error:
        raise RecordingError(f"{where}, column {name}: must be a number; got {text!r}") from error
    value = math.inf
    if number.is_finite():
        with suppress(ArithmeticError):
            value = to_si(number, _suffix(name))
    if not abs(value) <= _LARGEST:
        raise RecordingError(f"{where}, column {name}: must be a finite number; got {text!r}")
    return value
