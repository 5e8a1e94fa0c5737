"""What `smoskin learn --past` reads, and what `learn` draws: recordings as courses, and misses.

Decides which readings are rests, from which fields count, and where force and place are known.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from smoskin.arrays import Bools, Floats
from smoskin.errors import RecordingError
from smoskin.outputs import read_text
from smoskin.sensing.learned.courses import FORCES, Course
from smoskin.sensing.learned.gaussian_process import Output
from smoskin.service.exchange import columns_of
from smoskin.service.kept import RIG_PARTS
from smoskin.service.recording import open_recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LARGEST: Final = 1 << 30
"""Bytes of a table that is read, at most."""
_DRAWN: Final = 1000
"""Touches or readings that are drawn, at most."""
_LIGHT: Final = 0.02
"""Share of the largest force below which a skin that has not been pressed yet is at rest."""


def read_course(path: Path) -> Course:
    """The course of a rig's recording (MCAP), or of a table (CSV) as `smoskin convert` writes it.

    A table has ``time_s``, ``chip0_x_T`` and so on for each chip, and ``gauge_Fz_N``;
    ``gauge_Fx_N``, ``gauge_Fy_N``, ``touch_x_m``, ``touch_y_m`` and ``phase`` may be there. Fields
    count from the last readings of the phase ``rest``, or, where none is named, from the mean of
    those before the first force. Readings without a field, or of a time that does not rise, are
    left out.

    Raises
    ------
    RecordingError
        If the file cannot be read, has no force, or nothing is read before the first of it.
    """
    columns = _columns_of_table(path) if path.suffix == ".csv" else _columns_of_mcap(path)
    time, field, force = columns["time_s"], columns["field_T"], columns["gauge_N"]
    rising = time > np.maximum.accumulate(np.concatenate([[-np.inf], time[:-1]]))
    good = rising & np.isfinite(field).all(axis=(1, 2))
    time, field, force = time[good], field[good], force[good]
    known = np.isfinite(force).all(axis=1)
    if not known.any():
        raise RecordingError(f"{path}: there must be forces of a gauge to learn from; got none")
    rest = _at_rest(columns["phase"][good], np.abs(np.where(known[:, None], force, 0.0)))
    if not rest.any():
        raise RecordingError(f"{path}: it must begin with readings of the untouched skin")
    first = int(np.flatnonzero(rest)[0])
    field = _less_rest(field, rest)
    return Course(
        time=time[first:],
        field=field[first:],
        position=columns["touch_position_m"][good][first:],
        force=force[first:],
    )


def missed_figure(outputs: Sequence[Output], true: Floats, error: Floats) -> "Figure":
    """Draw what was missed of held-out touches or readings, (N, O) each, SI.

    Places have an arrow to where they were found, ten times as long; forces their error each.
    """
    from matplotlib.figure import Figure

    from smoskin.plots import BLUE, GREY, RED, lay_out, styled

    drawn = np.linspace(0, len(true) - 1, min(len(true), _DRAWN)).astype(int)
    true, error = true[drawn], error[drawn]
    forces = [k for k, output in enumerate(outputs) if output in FORCES]
    placed = Output.X in outputs
    with styled():
        figure = Figure(figsize=(4.2 * (placed + len(forces)), 3.8), layout="constrained")
        axes = list(np.atleast_1d(figure.subplots(1, placed + len(forces))))
        if placed:
            x, y = 1e3 * true[:, :2].T
            at = axes.pop(0)
            at.plot(x, y, ".", color=BLUE, markersize=2)
            at.quiver(
                x, y, *(1e4 * error[:, :2].T), color=RED, angles="xy", scale_units="xy", scale=1
            )
            at.set(xlabel="x (mm)", ylabel="y (mm)", title="held out, missed 10 x")
            at.set_aspect("equal")
        for k, at in zip(forces, axes, strict=True):
            name = outputs[k].name.capitalize()
            at.axhline(0.0, color=GREY, linewidth=0.6)
            at.plot(true[:, k], error[:, k], ".", color=BLUE, markersize=2)
            at.set(xlabel=f"{name} (N)", ylabel="missed (N)", title=f"{name}, held out")
        lay_out(figure)
    return figure


def _at_rest(phase: NDArray[Any], force: Floats) -> Bools:
    """Which of N readings are of the untouched skin."""
    if (phase == "rest").any():
        return np.asarray(phase == "rest")
    pressed = force.max(axis=1) > _LIGHT * force.max()
    return np.asarray(np.cumsum(pressed) == 0)


def _less_rest(field: Floats, rest: Bools) -> Floats:
    """Fields (N, S, 3) less the mean of the stretch of rest before, or around, each."""
    begins = rest & ~np.concatenate([[False], rest[:-1]])
    number = np.maximum(np.cumsum(begins) - 1, 0)
    means = np.stack([field[rest & (number == k)].mean(axis=0) for k in range(number[-1] + 1)])
    return np.asarray(field - means[number])


def _columns_of_mcap(path: Path) -> dict[str, NDArray[Any]]:
    """Columns of a rig's recording; the gauge says nothing where there was none."""
    columns = columns_of(open_recording(path))
    rows = len(columns["time_s"])
    columns.setdefault("gauge_N", np.full((rows, 3), np.nan))
    columns.setdefault("touch_position_m", np.full((rows, 2), np.nan))
    columns.setdefault("phase", np.full(rows, ""))
    return columns


def _columns_of_table(path: Path) -> dict[str, NDArray[Any]]:
    """The same of a table."""
    rows = csv.DictReader(io.StringIO(read_text(path, _LARGEST, RecordingError), newline=""))
    names = list(rows.fieldnames or ())
    chips = sum(name.startswith("chip") and name.endswith("_x_T") for name in names)
    fields = [f"chip{k}_{axis}_T" for k in range(chips) for axis in "xyz"]
    absent = [name for name in ("time_s", "gauge_Fz_N", *fields) if name not in names]
    if absent or not chips:
        raise RecordingError(f"{path}: there must be a column {(absent or ['chip0_x_T'])[0]}")
    numbers: list[list[float]] = []
    phases: list[str] = []
    numeric = ("time_s", *fields, *RIG_PARTS["gauge_N"], *RIG_PARTS["touch_position_m"][:2])
    usual = {name: "0" for name in RIG_PARTS["gauge_N"] if name not in names}
    try:
        for row in rows:
            if None in row or None in row.values():
                raise ValueError("it must have as many columns as the first line")
            numbers.append([float((usual | row).get(name) or "nan") for name in numeric])
            phases.append(row.get("phase") or "")
    except (ValueError, csv.Error) as error:
        raise RecordingError(f"{path}, line {rows.line_num}: {error}") from error
    if not numbers:
        raise RecordingError(f"{path}: it must have readings; got none")
    table = np.array(numbers)
    return {
        "time_s": table[:, 0],
        "field_T": table[:, 1 : 1 + 3 * chips].reshape(-1, chips, 3),
        "gauge_N": table[:, 1 + 3 * chips : 4 + 3 * chips],
        "touch_position_m": table[:, 4 + 3 * chips :],
        "phase": np.array(phases),
    }
