"""Recordings that others made, read from the layouts that they published them in.

Decides how two layouts become arrays in SI: the folders of the eFlesh characterisation, and files
of one and two touches on a grid of cells. Which runs there are, how rows of several files pair up
in time, and which marks mean "no reading". Hides the files; a file that is cut short, of another
width or not numeric is an error that names the line, never a guess.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from smoskin.arrays import Bools, Floats, Ints, freeze
from smoskin.errors import RecordingError

EFLESH_SETS: Final = ("spatial_resolution", "normal_force", "shear_force")
"""Sets of the eFlesh characterisation, each a folder of runs."""

_GRAM_FORCE: Final = 9.81e-3
_NO_LOAD: Final = -1.0
_MOST_UNPAIRED: Final = 0.05
"""Share of rows that may lack a partner in another file before the run is refused."""
_TOUCH_FILES: Final = ("position_*.csv", "multi_touch_*.csv")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProbeRun:
    """One run of a probe over a sensor, its files paired up row by row."""

    set: str
    """One of `EFLESH_SETS`."""
    name: str
    """The run's folder."""
    time: Floats
    """(T,), s, unix time, increasing."""
    field: Floats
    """(T, S, 3), T, as read."""
    field_rezeroed: Floats
    """(T, S, 3), T, less the zero that was taken anew before each press or cycle."""
    position: Floats
    """(T, 3), m, of the probe in the robot's frame."""
    load: Floats
    """(T,), N; NaN where the file has no reading."""
    unpaired: int
    """Rows left out because another file has none near them in time."""

    def __post_init__(self) -> None:
        field = (*np.shape(self.field)[:2], 3)
        freeze(self, time=field[:1], field=field, field_rezeroed=field)
        freeze(self, position=(field[0], 3), load=field[:1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchRun:
    """One file of touches held on known cells of a grid."""

    name: str
    """The file's, without its ending."""
    time: Floats
    """(T,), s, unix time, not decreasing."""
    field: Floats
    """(T, S, 3), T, less a zero that was taken before the run."""
    load: Floats
    """(T,), N, of all touches together; pressing is positive."""
    cells: Floats
    """(T, C, 2): column and row of each of the C touches, as the file counts them."""
    dropouts: int
    """Rows left out because every chip read nothing but zeros."""

    def __post_init__(self) -> None:
        rows, chips = np.shape(self.field)[:2]
        freeze(self, time=(rows,), field=(rows, chips, 3), load=(rows,), cells=(rows, None, 2))


def read_recordings(
    directory: Path | str,
) -> tuple[tuple[ProbeRun, ...], tuple[TouchRun, ...]]:
    """All recordings under a folder, of whatever known layout.

    Parameters
    ----------
    directory : Path or str
        As `read_eflesh` or `read_touches` takes it.

    Returns
    -------
    tuple of ProbeRun, tuple of TouchRun
        Not both empty.

    Raises
    ------
    RecordingError
        If there is none, or a file cannot be believed.
    """
    touches = read_touches(directory)
    if touches and _eflesh_folder(Path(directory)) is None:
        return (), touches
    return read_eflesh(directory), touches


def read_eflesh(directory: Path | str) -> tuple[ProbeRun, ...]:
    """All runs of the eFlesh characterisation under a folder.

    Parameters
    ----------
    directory : Path or str
        The repository's folder, its `characterization` or its `datasets`. Sets may be absent.

    Returns
    -------
    tuple of ProbeRun
        In the order of `EFLESH_SETS`, then by name.

    Raises
    ------
    RecordingError
        If there is no set, a set has no run, or a file cannot be believed.

    Notes
    -----
    Source: arXiv:2506.09994, public data of its characterisation.
    """
    place = _eflesh_folder(Path(directory))
    if place is None:
        raise RecordingError(
            f"directory must hold one of {', '.join(EFLESH_SETS)}, or be a folder above them "
            "(eflesh, characterization or datasets), or hold files of touches "
            f"({' and '.join(_TOUCH_FILES)}); got {directory}"
        )
    sets = [place / name for name in EFLESH_SETS if (place / name).is_dir()]
    runs = [sorted(path for path in folder.glob("*_probe") if path.is_dir()) for folder in sets]
    for folder, result in zip(sets, runs, strict=True):
        if not result:
            raise RecordingError(f"{folder}: a set must hold folders named *_probe; it has none")
    return tuple(_read_run(path) for result in runs for path in result)


def read_touches(directory: Path | str) -> tuple[TouchRun, ...]:
    """All files of touches on a grid of cells under a folder.

    Parameters
    ----------
    directory : Path or str
        Files `position_*.csv` (one touch) and `multi_touch_*.csv` are looked for in it and in
        all folders below it.

    Returns
    -------
    tuple of TouchRun
        In the order of their paths; empty if there is none.

    Raises
    ------
    RecordingError
        If a file cannot be believed.

    Notes
    -----
    A file opens with the names of its columns: `timestamp` in s, `fz` in N with pressing
    negative, `mag0_x` to `mag<n>_z` in uT, and cells in `x_pos` and `y_pos` or, for several
    touches, `pos1_x`, `pos1_y`, `pos2_x`, and so on. Further columns are not used.
    """
    root = Path(directory)
    return tuple(
        _read_touch_run(path)
        for path in sorted(path for pattern in _TOUCH_FILES for path in root.rglob(pattern))
    )


def _eflesh_folder(root: Path) -> Path | None:
    """The folder at or below a root that holds sets of the eFlesh characterisation."""
    for place in (root, root / "datasets", root / "characterization" / "datasets"):
        if any((place / name).is_dir() for name in EFLESH_SETS):
            return place
    return None


def _read_touch_run(path: Path) -> TouchRun:
    """One file of touches, its dropouts left out."""
    lines = _lines(path)
    names = [name.strip().lower() for name in lines[0].removeprefix("\ufeff").split(",")]
    if len(set(names)) != len(names):
        raise RecordingError(f"{path}:1: the names of columns must differ; got {lines[0]!r}")
    chips = _counted(names, r"mag(\d+)_[xyz]", first=0)
    touches = _counted(names, r"pos(\d+)_[xy]", first=1)
    cells = [f"pos{k + 1}_{axis}" for k in range(touches) for axis in "xy"] or ["x_pos", "y_pos"]
    fields = [f"mag{chip}_{axis}" for chip in range(chips) for axis in "xyz"] or ["mag0_x"]
    wanted = ["timestamp", "fz", *cells, *fields]
    absent = [name for name in wanted if name not in names]
    if absent:
        raise RecordingError(f"{path}:1: the header must name {', '.join(absent)}")
    table = _numbers(path, lines, header=1, time=names.index("timestamp"))
    table = table[:, [names.index(name) for name in wanted]]
    read = table[:, len(wanted) - len(fields) :]
    kept = (read != 0).any(axis=1)
    if not kept.any():
        raise RecordingError(f"{path}: a run must have readings; every row is zeros")
    table, read = table[kept], read[kept]
    return TouchRun(
        name=path.stem,
        time=table[:, 0],
        field=read.reshape(len(read), -1, 3) * 1e-6,
        load=-table[:, 1],
        cells=table[:, 2 : 2 + len(cells)].reshape(len(table), -1, 2),
        dropouts=int((~kept).sum()),
    )


def _counted(names: Sequence[str], pattern: str, *, first: int) -> int:
    """How many things columns speak of whose names carry a running number from the first."""
    numbers = [int(match[1]) for name in names if (match := re.fullmatch(pattern, name))]
    return max(numbers, default=first - 1) - first + 1


def _read_run(folder: Path) -> ProbeRun:
    """One run, its three files paired up on the sensor's times."""
    files = [folder / f"{name}.csv" for name in ("sensor", "sensor_post_baselines", "states")]
    sensor, rezeroed, states = (_numbers(path, _lines(path)) for path in files)
    for path, table in zip(files[:2], (sensor, rezeroed), strict=True):
        if table.shape[1] < 4 or table.shape[1] % 3 != 1:
            raise RecordingError(
                f"{path}:1: a row must hold a time and three values a chip; "
                f"got {table.shape[1]} columns"
            )
    if sensor.shape[1] != rezeroed.shape[1]:
        raise RecordingError(
            f"{files[1]}:1: a row must have {sensor.shape[1]} columns, as sensor.csv has; "
            f"got {rezeroed.shape[1]}"
        )
    if states.shape[1] not in (4, 5):
        raise RecordingError(
            f"{files[2]}:1: a row must hold time, x, y, z and perhaps the load; "
            f"got {states.shape[1]} columns"
        )
    keep = np.ones(len(sensor), dtype=bool)
    partners = []
    for path, table in zip(files[1:], (rezeroed, states), strict=True):
        rows, near = _pair(sensor[:, 0], table[:, 0], files[0], path)
        partners.append(rows)
        keep &= near
    zeroed, state = (
        table[rows[keep]] for table, rows in zip((rezeroed, states), partners, strict=True)
    )
    raw = sensor[keep]
    load = np.full(len(raw), np.nan)
    if states.shape[1] == 5:
        load = np.where(state[:, 4] == _NO_LOAD, np.nan, state[:, 4] * _GRAM_FORCE)
    return ProbeRun(
        set=folder.parent.name,
        name=folder.name,
        time=raw[:, 0],
        field=raw[:, 1:].reshape(len(raw), -1, 3) * 1e-6,
        field_rezeroed=zeroed[:, 1:].reshape(len(raw), -1, 3) * 1e-6,
        position=state[:, 1:4] * 1e-3,
        load=load,
        unpaired=int(max(len(sensor), len(states), len(rezeroed)) - len(raw)),
    )


def _pair(time: Floats, other: Floats, path: Path, other_path: Path) -> tuple[Ints, Bools]:
    """Row of the other file for each time, and whether it is near enough to belong to it."""
    # Half an interval: a row whose partner is missing must not borrow its neighbour's.
    reach = 0.5 * float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    if len(time) == len(other):
        rows = np.arange(len(time), dtype=np.int64)
    else:
        after = np.clip(np.searchsorted(other, time), 1, max(len(other) - 1, 1))
        after = np.minimum(after, len(other) - 1)
        before = np.maximum(after - 1, 0)
        rows = np.where(time - other[before] <= other[after] - time, before, after).astype(np.int64)
    near = np.abs(other[rows] - time) <= reach
    longer = max(len(time), len(other))
    if near.sum() < (1 - _MOST_UNPAIRED) * longer:
        raise RecordingError(
            f"{other_path}: its {len(other)} rows must pair up in time with the {len(time)} of "
            f"{path.name}; only {int(near.sum())} lie within {reach:.3g} s of each other: "
            "one of the two is cut short or belongs to another run"
        )
    return rows, near


def _lines(path: Path) -> list[str]:
    """The lines of a text file that is whole."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise RecordingError(f"{path}: a run must have this file; it is missing") from error
    except UnicodeDecodeError as error:
        bad_line = bytes(error.object[: error.start]).count(b"\n") + 1
        raise RecordingError(f"{path}:{bad_line}: not a text file of numbers") from error
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    lines = text.split("\n")
    if lines.pop() != "":
        raise RecordingError(
            f"{path}:{len(lines) + 1}: the last line must end in a line break; "
            "the file is cut short"
        )
    if not lines:
        raise RecordingError(f"{path}: must hold rows of numbers; it is empty")
    return lines


def _numbers(path: Path, lines: Sequence[str], *, header: int = 0, time: int = 0) -> Floats:
    """Rows of numbers after so many lines of header, with time in one of the columns."""
    rows: list[list[float]] = []
    columns = lines[0].count(",") + 1
    for number, line in enumerate(lines[header:], start=header + 1):
        try:
            row = [float(cell) for cell in line.split(",")]
        except ValueError as error:
            raise RecordingError(f"{path}:{number}: {error}") from error
        if len(row) != columns:
            raise RecordingError(
                f"{path}:{number}: a row must have {columns} columns, as line 1 has; got {len(row)}"
            )
        rows.append(row)
    if not rows:
        raise RecordingError(f"{path}: must hold rows of numbers; it has none")
    table = np.array(rows)
    faulty = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(faulty):
        raise RecordingError(f"{path}:{faulty[0] + header + 1}: numbers must be finite")
    back = np.flatnonzero(np.diff(table[:, time]) < 0)
    if len(back):
        raise RecordingError(f"{path}:{back[0] + header + 2}: time must not run backwards")
    return table
