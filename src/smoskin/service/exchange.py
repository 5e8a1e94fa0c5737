"""Recordings as tables that any program opens, CSV and HDF5, and readings of CSV as recordings.

Decides the columns: SI units, their names and those of chips and contacts as in a recording's
topics, and every number to its last bit; and what of a recording robot learning gets in a frame.
"""

import csv
import io
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, FileError, RecordingError, require
from smoskin.outputs import check_output, read_text, write_output
from smoskin.records import Reading
from smoskin.service.kept import RIG_PARTS, rig_columns
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
_LEROBOT_INFO: Final = "meta/info.json"
_LEROBOT_DATA: Final = "data/chunk-000/file-000.parquet"
_LEROBOT_EPISODES: Final = "meta/episodes/chunk-000/file-000.parquet"
_LEROBOT_FILES: Final = frozenset(
    (_LEROBOT_INFO, _LEROBOT_DATA, _LEROBOT_EPISODES, "meta/stats.json", "meta/tasks.parquet")
)


def columns_of(recording: Recording) -> dict[str, NDArray[Any]]:
    """A recording's N readings of S chips and their estimates of up to C contacts, by name.

    These are ``time_s``, (N,), ``field_T``, (N, S, 3), ``temperature_degC`` and ``flags``, (N, S),
    ``status``, (N,), empty where nothing was estimated, ``position_m``, (N, C, 2), ``force_N``,
    (N, C, 3), and ``covariance``, (N, C, 5, 5), NaN where there is no contact. A rig's recording
    also has `smoskin.service.kept.rig_columns`.
    """
    rows = list(recording)
    readings, estimates = [row[0] for row in rows], [row[1] for row in rows]
    contacts = [() if estimate is None else estimate.contacts for estimate in estimates]
    most = max(map(len, contacts), default=0)
    position, force = np.full((len(rows), most, 2), np.nan), np.full((len(rows), most, 3), np.nan)
    covariance = np.full((len(rows), most, 5, 5), np.nan)
    for row, (touches, estimate) in enumerate(zip(contacts, estimates, strict=True)):
        for place, contact in enumerate(touches):
            position[row, place], force[row, place] = contact.position, contact.force
        if estimate is not None:
            covariance[row, : len(touches)] = estimate.covariance
    chips = recording.description.chips
    times = np.array([reading.time for reading in readings])
    return {
        "time_s": times,
        "field_T": np.reshape([reading.field for reading in readings], (-1, chips, 3)),
        "temperature_degC": np.reshape([r.temperature for r in readings], (-1, chips)),
        "flags": np.reshape([r.flags for r in readings], (-1, chips)).astype(np.int64),
        "status": np.array([e.status.name if e is not None else "" for e in estimates], dtype=str),
        "position_m": position,
        "force_N": force,
        "covariance": covariance,
    } | rig_columns(recording.path, times)


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
    for name in ("touch", "phase", *RIG_PARTS):
        if name in columns:
            kept = columns[name].reshape(len(columns[name]), -1)
            names.extend(RIG_PARTS.get(name, (name,)))
            flat.extend(kept.T.tolist())
    with open(part, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*flat, strict=True))


def _write_hdf5(part: Path, columns: dict[str, NDArray[Any]], recording: Recording) -> None:
    import h5py

    with h5py.File(part, "w") as file:
        for name, values in columns.items():
            text = h5py.string_dtype() if values.dtype.kind == "U" else None
            file.create_dataset(name, data=values.astype(object) if text else values, dtype=text)
        description = recording.description
        file.attrs.update(
            design=description.design,
            design_hash=description.design_hash,
            document=recording.document,
            start=description.start,
            smoskin=description.version,
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


@typed
def export_lerobot(
    source: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    rate: int = 30,
    window: int = 4,
    task: str = "touch",
    force: bool = False,
) -> int:
    """Write a recording as a data set of LeRobot's format v3.0, one episode; how many frames.

    Frame k is at k / `rate` s after the first moment at which each chip has given a field and
    `window` readings are there. It has the latest `window` readings, the oldest first, as one
    vector ``observation.tactile.field`` (T; chip by chip, x, y, z); for the latest of them
    ``temperature`` (degC), ``missing``, 1 for a chip without a field, whose last one stands there,
    and ``age``, s since that reading; and for its contacts ``contact``, 1 where there is one,
    ``position`` (m) and ``force`` (N), zero where there is none. Of a rig it has ``touch``, 1
    while one is held, ``touch_position``, ``touch_force``, ``gauge`` and ``stage``. There is no
    action: that is the robot's.

    Raises
    ------
    ArgumentError
        If rate or window is below 1 or the task is empty.
    FileError
        If the folder cannot be written, or holds anything and is not to be replaced by `force`.
    RecordingError
        If the recording cannot be read, its times do not rise, or it gives no frame.
    MissingExtraError
        If the library of recordings or pyarrow is not installed.
    """
    for name, value in (("rate", rate), ("window", window)):
        if value < 1:
            raise ArgumentError(f"{name} must be at least 1; got {value}")
    if not task.strip():
        raise ArgumentError("task must be a sentence; got nothing")
    require("a LeRobot data set", "lerobot", "pyarrow")
    recording = open_recording(source)
    features, named = _frames(columns_of(recording), rate, window)
    folder = _emptied(Path(out), force)
    count = len(features["timestamp"])
    stats = {name: _stats(values) for name, values in features.items()}
    info = {
        "codebase_version": "v3.0",
        "robot_type": recording.description.design,
        "total_episodes": 1,
        "total_frames": count,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate,
        "splits": {"train": "0:1"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": {
            name: {"dtype": str(values.dtype), "shape": [values.shape[1]], "names": named.get(name)}
            for name, values in features.items()
        },
    }
    _write_parquets(folder, features, stats, task)
    write_output(folder / "meta/stats.json", json.dumps(stats, indent=4).encode())
    write_output(folder / _LEROBOT_INFO, json.dumps(info, indent=4).encode())
    return count


def _emptied(folder: Path, force: bool) -> Path:
    """The folder of a data set, in which there is none yet."""
    check_output(folder, folder=True)
    inside = {str(p.relative_to(folder)) for p in folder.rglob("*") if not p.is_dir()}
    if inside and not force:
        raise FileError(f"{folder} is not empty; choose another name or --force (force=True)")
    if inside - _LEROBOT_FILES:
        raise FileError(f"{folder} holds what is not replaced: {min(inside - _LEROBOT_FILES)}")
    for name in sorted(_LEROBOT_FILES):
        (folder / name).unlink(missing_ok=True)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    return folder


def _held(values: NDArray[Any]) -> NDArray[Any]:
    """Values (N, ...) in whose rows a NaN is what was there before, where anything was."""
    rows = np.arange(len(values)).reshape(-1, *[1] * (values.ndim - 1))
    last = np.maximum.accumulate(np.where(np.isnan(values), 0, rows), axis=0)
    return np.take_along_axis(values, last, axis=0)


def _frames(
    columns: dict[str, NDArray[Any]], rate: int, window: int
) -> tuple[dict[str, NDArray[Any]], dict[str, list[str]]]:
    """Features of K frames, (K, width), and the names of their parts."""
    time, field = columns["time_s"], columns["field_T"]
    if np.any(np.diff(time) <= 0):
        raise RecordingError("the times of a recording's readings must rise for frames of one rate")
    held, chips = _held(field), field.shape[1]
    whole = np.flatnonzero(np.isfinite(held).all(axis=(1, 2)))
    if len(whole) == 0 or whole[0] + window > len(time):
        raise RecordingError(f"a frame must have {window} readings of every chip; none has")
    start = time[whole[0] + window - 1]
    count = int((time[-1] - start) * rate + 1e-6) + 1
    moment = start + np.arange(count) / rate
    latest = np.searchsorted(time, moment + 1e-9, side="right") - 1
    rows = latest[:, None] + np.arange(1 - window, 1)
    tactile = {
        "field": held[rows],
        "missing": np.isnan(field[latest]).any(axis=2),
        "age": np.maximum(moment - time[latest], 0.0),
    }
    parts = [f"chip{k}_{end}" for k in range(chips) for end in _PARTS["field_T"]]
    named = {
        "field": [f"reading{n}_{part}" for n in range(1 - window, 1) for part in parts],
        "missing": [f"chip{k}" for k in range(chips)],
        "age": ["age_s"],
    }
    temperature = _held(columns["temperature_degC"])[latest]
    if np.isfinite(temperature).all():
        tactile["temperature"] = temperature
        named["temperature"] = [f"chip{k}_temperature_degC" for k in range(chips)]
    contacts = range(columns["force_N"].shape[1])
    if contacts:
        tactile["contact"] = np.isfinite(columns["force_N"][latest]).all(axis=2)
        named["contact"] = [f"contact{c}" for c in contacts]
        for name in ("position_m", "force_N"):
            tactile[name[:-2]] = np.nan_to_num(columns[name][latest])
            named[name[:-2]] = [f"contact{c}_{end}" for c in contacts for end in _PARTS[name]]
    _add_rig(columns, latest, tactile, named)
    frame, nothing = np.arange(count)[:, None], np.zeros((count, 1), np.int64)
    features = {
        f"observation.tactile.{name}": values.reshape(count, -1).astype(np.float32)
        for name, values in tactile.items()
    } | {
        "timestamp": (frame / rate).astype(np.float32),
        "frame_index": frame,
        "episode_index": nothing,
        "index": frame,
        "task_index": nothing,
    }
    return features, {f"observation.tactile.{name}": names for name, names in named.items()}


def _add_rig(
    columns: dict[str, NDArray[Any]],
    latest: NDArray[Any],
    tactile: dict[str, NDArray[Any]],
    named: dict[str, list[str]],
) -> None:
    """Add what a rig says in frames whose latest readings these are, and the names of its parts."""
    for column in [column for column in RIG_PARTS if column in columns]:
        name = column.rpartition("_")[0]
        # A stage stands where it stood; a touch that is not held is none.
        values = columns[column] if name.startswith("touch") else _held(columns[column])
        tactile[name], named[name] = np.nan_to_num(values[latest]), list(RIG_PARTS[column])
    if "touch" in columns:
        tactile["touch"], named["touch"] = columns["touch"][latest] >= 0, ["held"]


def _stats(values: NDArray[Any]) -> dict[str, list[float]]:
    """Statistics of a feature, (K, width), that LeRobot normalises by."""
    exact = values.astype(float)
    quantiles = {
        f"q{p:02d}": np.quantile(exact, p / 100, axis=0).tolist() for p in (1, 10, 50, 90, 99)
    }
    return {
        "min": values.min(axis=0).tolist(),
        "max": values.max(axis=0).tolist(),
        "mean": exact.mean(axis=0).tolist(),
        "std": exact.std(axis=0).tolist(),
        "count": [len(values)],
        **quantiles,
    }


def _write_parquets(
    folder: Path,
    features: dict[str, NDArray[Any]],
    stats: dict[str, dict[str, list[float]]],
    task: str,
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    def write(name: str, table: Any) -> None:
        write_output(folder / name, lambda part: pq.write_table(table, part))

    flat = {
        # A feature of one part is a number in LeRobot's tables.
        name: values[:, 0]
        if values.shape[1] == 1
        else pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])
        for name, values in features.items()
    }
    write(_LEROBOT_DATA, pa.table(flat))
    episode: dict[str, Any] = {
        "episode_index": 0,
        "tasks": [task],
        "length": len(features["timestamp"]),
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": 0,
        "dataset_to_index": len(features["timestamp"]),
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }
    for name, numbers in stats.items():
        episode |= {f"stats/{name}/{kind}": values for kind, values in numbers.items()}
    write(_LEROBOT_EPISODES, pa.table({name: [value] for name, value in episode.items()}))
    # The task is pandas' index of that table, which is told in its metadata.
    kinds = (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    about = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [
            {"name": n, "field_name": n, "pandas_type": p, "numpy_type": t, "metadata": None}
            for n, p, t in kinds
        ],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.0.0",
    }
    tasks = pa.table({"task_index": [0], "task": [task]})
    write("meta/tasks.parquet", tasks.replace_schema_metadata({"pandas": json.dumps(about)}))
