"""The sheet of touches that a person makes at a bench: a plan to print, and the same filled in.

Decides its columns, which are those of `smoskin.measurement` with places in millimetres instead
of cells, and how rows become held touches: a row without a place is the untouched skin, a row that
says neither what the chips read nor when it was held has not been made. Readings stand in the sheet
or in a recording.
"""

import csv
import io
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import RecordingError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, HeldTouch, Reading
from smoskin.sensing.response.calibrate import Target
from smoskin.units import from_si, to_si

_PLACE: Final = ("x_mm", "y_mm")
_FORCE: Final = ("force_x_N", "force_y_N", "force_z_N")
_HELD: Final = ("from_s", "until_s")
_REST_EVERY: Final = 10
"""Touches of a plan after which the untouched skin is read again."""
_ROUNDED: Final = 1e-5
"""m by which a place on the rim may lie off it: sheets round."""
_APART: Final = 60.0
"""s put between rows that do not say when they were made."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    """One line that has been filled in."""

    line: int
    contact: Contact | None
    """None for the untouched skin."""
    held: tuple[float, float] | None
    field: Floats
    """(S, 3), T; NaN where the line does not say."""
    temperature: Floats
    """(S,), degC; NaN likewise."""


def write_plan(path: str | os.PathLike[str], design: SkinDesign, targets: Sequence[Target]) -> None:
    """Write a plan: the untouched skin first and after every ten touches, the rest to be filled."""
    header = [*_PLACE, *_FORCE, *_HELD, *_chip_columns(len(design.halls))]
    empty = [""] * (len(header) - len(_PLACE) - len(_FORCE))
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        for number, target in enumerate(targets):
            if number % _REST_EVERY == 0:
                writer.writerow(["", "", "0", "0", "0", *empty])
            place = [f"{1e3 * value:.2f}" for value in target.position]
            force = [str(from_si(float(value), "N")) for value in target.force]
            writer.writerow([*place, *force, *empty])


def read_held_touches(
    path: str | os.PathLike[str], design: SkinDesign, readings: Iterable[Reading] | None = None
) -> tuple[HeldTouch, ...]:
    """The touches of a sheet that have been made.

    Parameters
    ----------
    path : path
        CSV with the columns that `write_plan` writes; those of the chips may be missing where
        there are readings, `from_s` and `until_s` where there are none.
    design : SkinDesign
        Of the skin that was touched.
    readings : iterable of Reading, optional
        On whose clock the sheet says when each touch was held. Without them the sheet says what
        the chips read, of touches held for long enough to have settled.

    Raises
    ------
    RecordingError
        If the sheet cannot be read, a value is no number, a touch lies off the skin or does not
        press, no row before the first touch is of the untouched skin, or there are no readings
        when a row says that it was held; the message names the line.
    """
    where = os.fspath(path)
    filled = _HELD if readings is not None else _fields(len(design.halls))
    rows = _read_rows(where, design, filled, needed=filled)
    if readings is None:
        rows, said = _timed(rows)
    else:
        said = sorted(readings, key=lambda one: one.time)
    times = np.array([one.time for one in said])
    rest: tuple[float, float] | None = None
    reached = -np.inf
    touches: list[HeldTouch] = []
    for row in rows:
        assert row.held is not None, "rows without a time have been given one or left out"
        begin, end = row.held
        if not ((times >= begin) & (times <= end)).any():
            raise RecordingError(
                f"{where}: line {row.line}: there must be readings from {begin:g} to {end:g} s"
            )
        if row.contact is None:
            rest = row.held
            continue
        if rest is None:
            raise RecordingError(
                f"{where}: line {row.line}: a row of the untouched skin, without a place, must "
                "stand before the first touch"
            )
        if begin < rest[1] or begin < reached:
            raise RecordingError(f"{where}: line {row.line}: must be held after the line before it")
        since = np.flatnonzero((times > reached) & (times <= end))
        if not touches:
            since = since[times[since] >= rest[0]]
        touches.append(
            HeldTouch(
                contact=row.contact,
                readings=tuple(said[k] for k in since),
                rest=rest,
                held=row.held,
            )
        )
        reached = end
    return tuple(touches)


def read_contacts(path: str | os.PathLike[str], design: SkinDesign) -> tuple[Contact, ...]:
    """The touches of a sheet that have been made, read or timed, without what they say.

    Raises
    ------
    RecordingError
        As `read_held_touches`.
    """
    rows = _read_rows(os.fspath(path), design, (*_HELD, *_fields(len(design.halls))), needed=())
    return tuple(row.contact for row in rows if row.contact is not None)


def _timed(rows: list[_Row]) -> tuple[list[_Row], list[Reading]]:
    """Rows at times of their own, and their fields as readings then."""
    timed, said = [], []
    for number, row in enumerate(rows):
        time = _APART * number
        timed.append(
            _Row(line=row.line, contact=row.contact, held=(time, time), field=row.field,
                 temperature=row.temperature)
        )  # fmt: skip
        said.append(Reading(time=time, field=row.field, temperature=row.temperature))
    return timed, said


def _read_rows(
    where: str, design: SkinDesign, filled: Sequence[str], *, needed: Sequence[str]
) -> list[_Row]:
    """The lines that have been filled in, in any of these columns; some of them must be there."""
    try:
        text = Path(where).read_text(encoding="utf-8-sig")
        lines = list(csv.reader(io.StringIO(text)))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{where}: must be a readable CSV file ({error})") from error
    if len(lines) < 2:
        raise RecordingError(f"{where}: must hold a header and at least one row")
    chips = len(design.halls)
    header = [name.strip() for name in lines[0]]
    known = [*_PLACE, *_FORCE, *_HELD, *_chip_columns(chips)]
    for name in header:
        if name not in known or header.count(name) > 1:
            raise RecordingError(
                f"{where}: column {name!r} is unknown or occurs twice; valid: {', '.join(known)}"
            )
    for name in (*_PLACE, *_FORCE, *needed):
        if name not in header:
            raise RecordingError(f"{where}: column {name!r} is missing")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(header):
            raise RecordingError(
                f"{where}: line {number} must have {len(header)} values; got {len(line)}"
            )
        values = {
            name: _read(f"{where}: line {number}", name, text.strip())
            for name, text in zip(header, line, strict=True)
        }
        if not np.isfinite([values.get(name, np.nan) for name in filled]).any():
            continue
        rows.append(_row(where, number, values, design))
    if not rows:
        raise RecordingError(f"{where}: no row has been filled in")
    return rows


def _row(where: str, line: int, values: dict[str, float], design: SkinDesign) -> _Row:
    """One line, checked."""
    place, force = (np.array([values[name] for name in names]) for names in (_PLACE, _FORCE))
    contact = None
    if np.isfinite(place).any():
        if not ((place >= -_ROUNDED) & (place <= geometry(design).extent + _ROUNDED)).all():
            raise RecordingError(f"{where}: line {line}: the touch must lie on the skin")
        if not (np.isfinite(force).all() and force[2] < 0):
            raise RecordingError(f"{where}: line {line}: the touch must press, force_z_N < 0")
        contact = Contact(position=place, force=force)
    begin, end = (values.get(name, np.nan) for name in _HELD)
    if not begin <= end and np.isfinite([begin, end]).any():
        raise RecordingError(f"{where}: line {line}: until_s must be there, and not before from_s")
    held = (begin, end) if np.isfinite(begin) else None
    field = np.array([[values.get(f"chip{s}_B{axis}_uT", np.nan) for axis in "xyz"]
                      for s in range(1, len(design.halls) + 1)])  # fmt: skip
    warmth = np.array([values.get(f"chip{s}_temperature_degC", np.nan)
                       for s in range(1, len(design.halls) + 1)])  # fmt: skip
    return _Row(line=line, contact=contact, held=held, field=field, temperature=warmth)


def _fields(chips: int) -> list[str]:
    """Columns of what the chips read."""
    return [name for name in _chip_columns(chips) if name.endswith("_uT")]


def _chip_columns(chips: int) -> list[str]:
    """As in `smoskin.measurement`."""
    return [
        f"chip{s}_{what}"
        for s in range(1, chips + 1)
        for what in ("Bx_uT", "By_uT", "Bz_uT", "temperature_degC")
    ]


def _read(where: str, name: str, text: str) -> float:
    """One value in SI; NaN for an empty cell."""
    if not text:
        return float("nan")
    try:
        number = Decimal(text)
    except InvalidOperation as error:
        raise RecordingError(f"{where}, column {name}: must be a number; got {text!r}") from error
    return to_si(number, name.rpartition("_")[2])
