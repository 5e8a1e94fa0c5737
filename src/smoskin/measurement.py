"""What a person measures on a bench to calibrate a skin: a table of touches, and its CSV file.

Decides the columns and their units; hides the conversion and the checks. A row is one touch on
a cell's top vertex, held still: the force by the gauge, how far the stage pushed, and what the
chips read, if they were read. A row without a cell is the untouched skin.
"""

import csv
import hashlib
import io
import os
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Bools, Floats, Ints, frozen
from smoskin.errors import ArgumentError, RecordingError
from smoskin.records import Reading
from smoskin.units import SI_PER_SUFFIX, from_si, to_si

_CELL: Final = ("cell_n", "cell_m")
_FORCE: Final = ("force_x_N", "force_y_N", "force_z_N")
_DEPTH: Final = "displacement_z_mm"
_WARMTH: Final = "temperature_degC"
_HELD: Final = ("from_s", "until_s")
_REFERENCE: Final = 25.0
"""degC of a table without temperatures."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchTable:
    """Touches with known force and depth; T rows, S chips.

    Raises
    ------
    ArgumentError
        If shapes disagree, a force or depth is not finite, a row pulls at the skin or an
        untouched row has a force.
    """

    cell: Ints
    """(T, 2): (n, m) from 0; -1 where nothing touches."""
    force: Floats
    """(T, 3), N, that the toucher exerts on the skin; pressing is negative z."""
    depth: Floats
    """(T,), m: how far the stage pushed the vertex down."""
    field: Floats
    """(T, S, 3), T, in each chip's own axes; NaN where a chip was not read."""
    temperature: Floats
    """(T, S), degC, as each chip reports it; chips of one board differ by degrees."""
    held: Floats
    """(T, 2), s: from when until when the touch was held still, on the readings' clock; NaN
    where that is not known."""

    def __init__(
        self,
        *,
        cell: ArrayLike,
        force: ArrayLike,
        depth: ArrayLike,
        field: ArrayLike,
        temperature: ArrayLike,
        held: ArrayLike | None = None,
    ) -> None:
        cells = np.array(cell, dtype=np.int64)
        if cells.ndim != 2 or cells.shape[1] != 2:
            raise ArgumentError(f"cell must have shape (T, 2); got {cells.shape}")
        cells.setflags(write=False)
        rows = len(cells)
        object.__setattr__(self, "cell", cells)
        object.__setattr__(self, "force", frozen("force", force, (rows, 3)))
        object.__setattr__(self, "depth", frozen("depth", depth, (rows,)))
        object.__setattr__(self, "field", frozen("field", field, (rows, None, 3)))
        object.__setattr__(self, "temperature", self._warmth(temperature))
        times = np.full((rows, 2), np.nan) if held is None else held
        object.__setattr__(self, "held", frozen("held", times, (rows, 2)))
        for name, bad, rule in (
            ("force", ~np.isfinite(self.force).all(axis=1), "be finite"),
            ("depth", ~np.isfinite(self.depth), "be finite"),
            ("temperature", ~np.isfinite(self.temperature).all(axis=1), "be finite"),
            ("force", self.force[:, 2] > 0, "press: z must not be positive"),
            ("depth", self.depth < 0, "press: a pushed vertex has a displacement z below zero"),
            ("force", ~self.touched & self.force.any(axis=1), "be zero where no cell is touched"),
        ):
            if bad.any():
                row = int(np.argmax(bad))
                raise ArgumentError(
                    f"{name} must {rule}; got {getattr(self, name)[row]} in row {row + 1}"
                )

    def _warmth(self, temperature: ArrayLike) -> Floats:
        """Of every chip, from that or from one for all of them, (T,)."""
        shape = self.field.shape[:2]
        given = np.asarray(temperature, dtype=np.float64)
        if given.shape == shape[:1] or not shape[1]:
            given = np.broadcast_to(given.reshape(shape[0], -1)[:, :1], shape)
        return frozen("temperature", given, shape)

    @property
    def touched(self) -> Bools:
        """(T,): whether anything touches the skin."""
        return np.asarray((self.cell >= 0).all(axis=1))

    def rows(self, chosen: Bools | Ints) -> "TouchTable":
        """The table of these rows alone."""
        return TouchTable(
            cell=self.cell[chosen],
            force=self.force[chosen],
            depth=self.depth[chosen],
            field=self.field[chosen],
            temperature=self.temperature[chosen],
            held=self.held[chosen],
        )

    def with_readings(self, readings: Iterable[Reading]) -> "TouchTable":
        """The table with the mean of the good readings made while each touch was held.

        Raises
        ------
        ArgumentError
            If a touch says not when it was held, or no reading of it has all chips good.
        """
        good = [one for one in readings if not one.flags.any() and np.isfinite(one.field).all()]
        times = np.array([one.time for one in good])
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
            known = np.isfinite(reported)
            mean = np.where(known, reported, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
            before = self.temperature[row] if self.temperature.shape[1] else _REFERENCE
            degrees.append(np.where(known.any(axis=0), mean, before))
        return TouchTable(
            cell=self.cell, force=self.force, depth=self.depth,
            field=np.array(fields), temperature=np.array(degrees), held=self.held,
        )  # fmt: skip


def write_touches(path: str | os.PathLike[str], table: TouchTable) -> None:
    """Write a table as CSV; `read_touches` reads the same numbers back."""
    chips = table.field.shape[1]
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*_CELL, *_FORCE, _DEPTH, *_chip_columns(chips), *_chip_warmths(chips)])
        for k, touched in enumerate(table.touched):
            cell = [str(int(index) + 1) if touched else "" for index in table.cell[k]]
            force = [_written(value, "N") for value in table.force[k]]
            field = [_written(value, "uT") for value in table.field[k].ravel()]
            writer.writerow(
                [*cell, *force, _written(0.0 - table.depth[k], "mm"), *field,
                 *(_written(degrees, "degC") for degrees in table.temperature[k])]
            )  # fmt: skip


def read_touches(path: str | os.PathLike[str]) -> tuple[TouchTable, str]:
    """The table of a CSV file, and the file's SHA-256.

    The columns `cell_n`, `cell_m` (from 1; empty for the untouched skin), `force_x_N`,
    `force_y_N`, `force_z_N` and `displacement_z_mm` (both below zero for a press) must be there;
    `from_s` with `until_s` (when the touch was held, on the clock of a recording) and, for each
    chip from 1, `chip1_Bx_uT`, `chip1_By_uT`, `chip1_Bz_uT` and `chip1_temperature_degC` may be.
    `temperature_degC` stands for all chips that do not report their own.

    Raises
    ------
    RecordingError
        If the file cannot be read, a column is missing or unknown, or a value is no number;
        the message names the row and the column.
    """
    where = os.fspath(path)
    try:
        raw = Path(path).read_bytes()
        lines = list(csv.reader(io.StringIO(raw.decode("utf-8-sig"))))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{where}: must be a readable CSV file ({error})") from error
    if len(lines) < 2:
        raise RecordingError(f"{where}: must hold a header and at least one row")
    header = [name.strip() for name in lines[0]]
    chips = sum(name.startswith("chip") and "_B" in name for name in header) // 3
    optional = (_WARMTH, *_HELD, *_chip_warmths(chips))
    known = [*_CELL, *_FORCE, _DEPTH, *_chip_columns(chips), *optional]
    for name in header:
        if name not in known or header.count(name) > 1:
            raise RecordingError(f"{where}: column {name!r} is unknown or occurs twice; "
                                 f"valid: {', '.join(known)}")  # fmt: skip
    for name in known:
        if name not in header and name not in optional:
            raise RecordingError(f"{where}: column {name!r} is missing")

    columns: dict[str, list[float]] = {name: [] for name in header}
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(header):
            raise RecordingError(
                f"{where}: line {number} must have {len(header)} values; got {len(line)}"
            )
        for name, text in zip(header, line, strict=True):
            columns[name].append(_read(f"{where}: line {number}", name, text.strip()))
    rows = len(lines) - 1
    field = np.full((rows, chips, 3), np.nan)
    for column, name in enumerate(_chip_columns(chips)):
        field[:, column // 3, column % 3] = columns[name]
    warmth = np.full((rows, chips), np.array(columns.get(_WARMTH, [_REFERENCE]))[:, None])
    for s, name in enumerate(_chip_warmths(chips)):
        own = np.array(columns.get(name, np.full(rows, np.nan)))
        warmth[:, s] = np.where(np.isfinite(own), own, warmth[:, s])
    cell = np.nan_to_num(np.array([columns[name] for name in _CELL]).T)
    try:
        table = TouchTable(
            cell=cell.astype(np.int64) - 1,
            force=np.array([columns[name] for name in _FORCE]).T,
            depth=0.0 - np.array(columns[_DEPTH]),
            field=field,
            temperature=warmth,
            held=np.array([columns.get(name, np.full(rows, np.nan)) for name in _HELD]).T,
        )
    except ArgumentError as error:
        raise RecordingError(f"{where}: {error}") from error
    return table, hashlib.sha256(raw).hexdigest()


def _chip_columns(chips: int) -> list[str]:
    return [f"chip{s}_B{axis}_uT" for s in range(1, chips + 1) for axis in "xyz"]


def _chip_warmths(chips: int) -> list[str]:
    return [f"chip{s}_{_WARMTH}" for s in range(1, chips + 1)]


def _written(value: float, suffix: str) -> str:
    """A number in the suffix's unit; empty where there is none."""
    return str(from_si(float(value), suffix)) if np.isfinite(value) else ""


def _read(where: str, name: str, text: str) -> float:
    """One value in SI; NaN for an empty cell, reading or temperature."""
    if not text and (name in _CELL or name.startswith("chip")):
        return np.nan
    try:
        number = Decimal(text)
    except InvalidOperation as error:
        raise RecordingError(f"{where}, column {name}: must be a number; got {text!r}") from error
    if name in _CELL:
        if number < 1 or number != int(number):
            raise RecordingError(
                f"{where}, column {name}: must be a whole number from 1; got {text!r}"
            )
        return float(number)
    suffix = next(s for s in sorted(SI_PER_SUFFIX, key=len) if name.endswith(f"_{s}"))
    return to_si(number, suffix)
