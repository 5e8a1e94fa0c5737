"""Recordings as tables that any program opens, CSV and HDF5, and readings of CSV as recordings.

Decides the columns: SI units, their names and those of chips and contacts as in a recording's
topics, and every number to its last bit.
"""

import csv
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, RecordingError, require
from smoskin.outputs import check_output, read_text, write_output
from smoskin.records import Reading
from smoskin.service.recorder import Recorder
from smoskin.service.recording import Recording, open_recording

_PARTS: Final[dict[str, tuple[str, ...]]] = {
    "field_T": ("x_T", "y_T", "z_T"),
    "temperature_degC": ("temperature_degC",),
    "flags": ("flags",),
    "position_m": ("x_m", "y_m"),
    "force_N": ("Fx_N", "Fy_N", "Fz_N"),
}
"""Names of a column's parts in CSV, for each chip or contact."""
_LARGEST: Final = 1 << 30
"""Bytes of a table that is read, at most."""


def columns_of(recording: Recording) -> dict[str, NDArray[Any]]:
    """A recording's N readings of S chips and their estimates of up to C contacts, by name.

    These are ``time_s``, (N,), ``field_T``, (N, S, 3), ``temperature_degC`` and ``flags``, (N, S),
    ``status``, (N,), empty where nothing was estimated, ``position_m``, (N, C, 2), ``force_N``,
    (N, C, 3), and ``covariance``, (N, C, 5, 5), NaN where there is no contact.
    """
    rows = list(recording)
    readings, estimates = [row[0] for row in rows], [row[1] for row in rows]
    contacts = [() if estimate is None else estimate.contacts for estimate in estimates]
    most = max(map(len, contacts), default=0)
    position, force = np.full((len(rows), most, 2), np.nan), np.full((len(rows), most, 3), np.nan)
    covariance = np.full((len(rows), most, 5, 5), np.nan)
    for row, (found, estimate) in enumerate(zip(contacts, estimates, strict=True)):
        for place, contact in enumerate(found):
            position[row, place], force[row, place] = contact.position, contact.force
        if estimate is not None:
            covariance[row, : len(found)] = estimate.covariance
    chips = recording.description.chips
    return {
        "time_s": np.array([reading.time for reading in readings]),
        "field_T": np.reshape([reading.field for reading in readings], (-1, chips, 3)),
        "temperature_degC": np.reshape([r.temperature for r in readings], (-1, chips)),
        "flags": np.reshape([r.flags for r in readings], (-1, chips)).astype(np.int64),
        "status": np.array([e.status.name if e is not None else "" for e in estimates], dtype=str),
        "position_m": position,
        "force_N": force,
        "covariance": covariance,
    }


@typed
def export_recording(
    source: str | os.PathLike[str], out: str | os.PathLike[str], *, force: bool = False
) -> int:
    """Write a recording as a table, .csv or .h5 by the name's end; how many readings it has.

    Both hold `columns_of`; in CSV they are columns such as ``chip0_x_T`` and ``contact0_Fz_N``,
    without the covariance. HDF5 also has the description and the design as attributes.

    Raises
    ------
    ArgumentError
        If the name ends otherwise.
    FileError
        If the table cannot be written, or exists and is not to be replaced by `force`.
    RecordingError
        If the recording cannot be read.
    MissingExtraError
        If the library of recordings, or for .h5 that of HDF5, is not installed.
    """
    target = check_output(out, force=force)
    if target.suffix not in (".csv", ".h5"):
        raise ArgumentError(f"out must end in .csv or .h5; got {target.name!r}")
    recording = open_recording(source)
    columns = columns_of(recording)
    if target.suffix == ".csv":
        write_output(target, lambda part: _write_csv(part, columns))
    else:
        require("a table in HDF5", "data", "h5py")
        write_output(target, lambda part: _write_hdf5(part, columns, recording))
    return len(columns["time_s"])


@typed
def import_readings(
    source: str | os.PathLike[str],
    design: SkinDesign,
    out: str | os.PathLike[str],
    *,
    force: bool = False,
) -> int:
    """Write a recording (MCAP) of the readings in a CSV table; how many there are.

    Needed are the columns ``time_s`` and ``chip0_x_T``, ``chip0_y_T``, ``chip0_z_T`` and so on for
    each chip of the design; ``chip0_temperature_degC`` and ``chip0_flags`` may be there, any other
    column is left out. Fields that are empty or NaN are missing.

    Raises
    ------
    FileError
        If the recording cannot be written, or exists and is not to be replaced by `force`.
    RecordingError
        If the table cannot be read; the message names the line.
    MissingExtraError
        If the library of recordings is not installed.
    """
    target = check_output(out, force=force)
    count = 0

    def record(part: Path) -> None:
        nonlocal count
        part.unlink()
        with Recorder(part, design, on_failure=lambda sentence: None) as recorder:
            for reading in _csv_readings(source, len(design.halls)):
                recorder.write(reading)
                count += 1
        if recorder.failure:
            raise RecordingError(recorder.failure)

    write_output(target, record)
    return count


def _write_csv(part: Path, columns: dict[str, NDArray[Any]]) -> None:
    names, flat = ["time_s"], [columns["time_s"].tolist()]

    def add(item: str, *keys: str) -> None:
        for place in range(columns[keys[0]].shape[1]):
            for key in keys:
                values = columns[key][:, place]
                names.extend(f"{item}{place}_{end}" for end in _PARTS[key])
                flat.extend(values.reshape(len(values), -1).T.tolist())

    add("chip", "field_T", "temperature_degC", "flags")
    names.append("status")
    flat.append(columns["status"].tolist())
    add("contact", "position_m", "force_N")
    with open(part, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*flat, strict=True))


def _write_hdf5(part: Path, columns: dict[str, NDArray[Any]], recording: Recording) -> None:
    import h5py

    with h5py.File(part, "w") as file:
        for name, values in columns.items():
            text = h5py.string_dtype() if name == "status" else None
            file.create_dataset(name, data=values.astype(object) if text else values, dtype=text)
        told = recording.description
        file.attrs.update(
            design=told.design,
            design_hash=told.design_hash,
            document=recording.document,
            start=told.start,
            smoskin=told.version,
        )


def _csv_readings(path: str | os.PathLike[str], chips: int) -> Iterator[Reading]:
    """Readings of so many chips in a table."""
    rows = csv.DictReader(io.StringIO(read_text(path, _LARGEST, RecordingError), newline=""))
    try:
        names = rows.fieldnames or ()
        fields = (f"chip{k}_{end}" for k in range(chips) for end in _PARTS["field_T"])
        absent = [name for name in ("time_s", *fields) if name not in names]
        if absent:
            raise ArgumentError(f"there must be a column {absent[0]} for the design's chips")
        for row in rows:
            if None in row or None in row.values():
                raise ArgumentError("it must have as many columns as the first line")
            yield _reading(row, chips)
    except (TypeError, ValueError, csv.Error) as error:
        raise RecordingError(f"{path}, line {rows.line_num}: {error}") from error


def _reading(row: dict[str, str], chips: int) -> Reading:
    """The reading of a row."""

    def numbers(end: str) -> list[float]:
        return [float(row.get(f"chip{k}_{end}") or "nan") for k in range(chips)]

    return Reading(
        time=float(row["time_s"]),
        field=np.transpose([numbers(end) for end in _PARTS["field_T"]]),
        temperature=numbers("temperature_degC"),
        flags=[int(row.get(f"chip{k}_flags") or 0) for k in range(chips)],
    )
