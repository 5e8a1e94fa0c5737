"""Calibration of a skin by a few touches: a rig makes them one by one, or a person by a sheet.

Decides how many touches are made, which are left out and replaced (those under which a chip reaches
the end of its range), and what is said meanwhile: where to touch next and how far off a located
touch would still be. What comes out is the response table of the very skin, for `smoskin run`.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, RecordingError
from smoskin.feasibility import load_design
from smoskin.magnetics import mlx90393
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, HeldTouch, Status
from smoskin.roles import Rig
from smoskin.sensing.response.calibrate import (
    LabelledTouches,
    Target,
    TouchPlanner,
    calibrate_touches,
    expected_error,
)
from smoskin.sensing.response.judgement import Judgement, judge_touches
from smoskin.sensing.response.labels import Label, Labeller, labelled_touches
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.service.kept import recorded_touches, rig_of
from smoskin.service.recording import open_recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

Touches = Rig | str | os.PathLike[str] | TouchTable | Sequence[HeldTouch]
"""Origin of touches: a rig that makes them, the CSV file of a person who has made them or its
table, or touches that have been made and held already."""

DEFAULT_COUNT: Final = 15
"""Touches of a calibration unless another number is asked for."""
PLACE_SPREAD: Final = 0.5e-3
"""Standard deviation of places that a person writes down, m."""
FORCE_SPREAD: Final = 0.01
"""Standard deviation of forces that a person reads off a gauge, N."""
_PATIENCE: Final = 30.0
"""Time that a rig may take for a touch, s."""
_TRIES: Final = 2
"""Ratio of the touches made at most to those that are asked for."""
_REST_EVERY: Final = 10
"""Touches of a plan after which the untouched skin is read again."""
_ROUNDED: Final = 1e-4
"""Distance by which a place on the rim may lie off it, m: sheets round."""
_MILESTONES: Final = (0, 1, 2, 5, 10, 15, 30, 60, 120, 240)
"""Numbers of touches after which people are told the expected error."""


class TouchStep(NamedTuple):
    """One touch that a rig has made."""

    number: int
    """Usable touches so far."""
    asked: int
    """Usable touches that are asked for."""
    contact: Contact
    """The touch, as the rig reports it."""
    status: Status | None
    """Why the touch cannot be used; None where it can."""
    error: float
    """Expected distance of a located touch from its true place now, m; root mean square."""
    following: Target | None
    """The touch to make next; None after the last."""

    @property
    def sentence(self) -> str:
        """What has been done and what comes next."""
        millimetres = f"{1e3 * self.error:.2f} mm (expected of straight touches)"
        state = f"touch {self.number} of {self.asked}: located to {millimetres}"
        if self.status is not None:
            state = f"left out ({self.status.name.lower()}); {state}"
        if self.following is None:
            return state
        (x, y), (fx, fy, fz) = 1e3 * self.following.position, self.following.force
        return f"{state}; next ({x:.0f}, {y:.0f}) mm with ({fx:g}, {fy:g}, {fz:g}) N"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchCalibration:
    """A skin's own response table and the touches that it rests on."""

    table: ResponseTable
    """The response table of this very skin; its modes are what the touches left open."""
    labels: tuple[Label, ...]
    """All touches that were made, those left out included."""
    errors: tuple[float, ...]
    """Expected distance of a located touch from its true place, m, before the first touch and after
    each that was used; root mean square over the skin, of touches of 0.5 N that are known to be
    straight."""
    expected: tuple[float, float]
    """The same by the skin's own table, whose misfit the touches have told: of touches known to be
    straight, and of those that may drag, as the estimator takes them by default."""
    judgement: Judgement
    """What the touches tell of each other."""

    @property
    def used(self) -> int:
        """How many touches the table rests on."""
        return len(self.errors) - 1

    def save(self, path: Path | str) -> None:
        """Write the table to a file; `MissingExtraError` if `safetensors` is not installed."""
        self.table.save(path)

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        return {
            "design_hash": self.table.design_hash,
            "touches": self.used,
            "left_out": len(self.labels) - self.used,
            "expected_error_mm": [round(1e3 * error, 4) for error in self.errors],
            "expected_now_mm": {
                name: round(1e3 * error, 4)
                for name, error in zip(("straight", "with_drag"), self.expected, strict=True)
            },
            **self.judgement.as_json(),
            "misfit_uT_per_N": (np.sqrt(np.diag(self.table.misfit)) * 1e6).round(3).tolist(),
            "made": [
                {
                    "x_mm": round(1e3 * float(label.contact.position[0]), 3),
                    "y_mm": round(1e3 * float(label.contact.position[1]), 3),
                    "force_N": label.contact.force.round(4).tolist(),
                    "left_out": None if label.status is None else label.status.name,
                }
                for label in self.labels
            ],
        }

    def figure(self, design: SkinDesign) -> "Figure":
        """Draw where the other touches locate each one, and what each chip misses."""
        from smoskin.plots import draw_judgement

        places = [label.contact.position for label in self.labels if label.status is None]
        residual = self.judgement.residual
        missed = {
            f"signals of chip {s + 1} of the table": residual[:, 3 * s : 3 * s + 3]
            for s in range(residual.shape[1] // 3)
        }
        title = "located by the other touches"
        return draw_judgement(design, np.array(places), self.judgement.errors[:, :2], missed, title)

    def tables(self) -> "list[Table]":
        """How the expected error fell, and what is true of it, for people."""
        from rich.table import Table

        shown = Table(title="Calibration by touches")
        for name in ("touches", "a straight touch is expected to be off by"):
            shown.add_column(name, justify="right")
        for count in sorted({*(c for c in _MILESTONES if c < self.used), self.used}):
            shown.add_row(str(count), f"{1e3 * self.errors[count]:.2f} mm")
        if lost := len(self.labels) - self.used:
            shown.caption = f"{lost} touches were left out: a chip could not read them."
        judged = Table(title="How good it is")
        for name in ("root mean square error", "place", "normal force"):
            judged.add_column(name, justify="left" if "error" in name else "right")
        straight, dragged = (f"{1e3 * error:.2f} mm" for error in self.expected)
        judged.add_row("expected, 0.5 N known to be straight", straight, "")
        judged.add_row("expected, 0.5 N that may drag (as `smoskin run` takes it)", dragged, "")
        place, force = 1e3 * self.judgement.place_error, 1e3 * self.judgement.force_error
        judged.add_row(
            "met: each touch located by the others", f"{place:.2f} mm", f"{force:.1f} mN"
        )
        return [shown, judged]


@typed
def calibrate(
    table: ResponseTable,
    touches: Touches,
    *,
    design: SkinDesign | str = "planar",
    count: int = DEFAULT_COUNT,
    until: float = 0.0,
    force: float = 0.8,
    drag: float = 0.3,
    recording: str | os.PathLike[str] | None = None,
    place_spread: float | None = None,
    force_spread: float | None = None,
    accept_bad_fit: bool = False,
    progress: Callable[[TouchStep], None] = lambda step: None,
) -> TouchCalibration:
    """The response table of one skin, from a few touches on it.

    Parameters
    ----------
    table : ResponseTable
        Table of the skin's design; or of the skin, to calibrate it further.
    touches : Rig, path, TouchTable or sequence of HeldTouch
        Rig with the skin on it, which is left open; CSV file of touches made by hand
        (`smoskin.measurement.read_touches`), or what it holds; or touches that have been held on
        rubber that creeps, in the order of time, or the recording (.mcap) in which they are.
    design : SkinDesign or str, optional
        Design of the skin, or what `smoskin.load_design` takes for it.
    count, until : int and float
        Usable touches that a rig makes, fewer if a located touch is expected to be no further off
        than so many metres.
    force, drag : float
        Largest normal and sideways force of a rig, N; no drag for one that presses straight.
    recording : path, optional
        MCAP file with the chips' readings, where a CSV file says only when each touch was held;
        creep is undone then. Without it each touch of the file was held until it settled.
    place_spread, force_spread : float, optional
        Standard deviations of reported places, m, and forces, N, along each axis; the rig's own
        by default, as its recording tells them too, else 0.5 mm and 10 mN.
    accept_bad_fit : bool, optional
        Whether a table is made of touches that fit no skin of the design; the calibration's
        judgement tells what is wrong with them.
    progress : callable, optional
        Function that is told of each touch of a rig.

    Raises
    ------
    CalibrationError
        If the touches fit no skin of the design, or a wrong unit, sign, order or origin explains
        them far better; it is named.
    ModelError
        If the table belongs to another design.
    SourceError
        If the rig does not answer in time.
    RecordingError
        If the file or the recording cannot be read, or they do not fit each other.
    ArgumentError
        If a number is out of its range, a recording comes without a file, or no touch can be used.
    """
    skin = load_design(design) if isinstance(design, str) else design
    usual = _usual_spreads(touches)
    place = usual[0] if place_spread is None else place_spread
    press = usual[1] if force_spread is None else force_spread
    planner = _planner(skin, table, count, until, force, drag, place, press)
    if isinstance(touches, str | os.PathLike) and Path(touches).suffix == ".mcap":
        touches = recorded_touches(touches, some=True)
    by_sheet = isinstance(touches, str | os.PathLike | TouchTable)
    if recording is not None and not by_sheet:
        raise ArgumentError("recording must come with the path of a CSV file of touches")
    settled = by_sheet and recording is None
    labeller = Labeller(skin, None if settled else elastomer_prony(skin.columns.material))
    rows: list[int] | None = None
    if isinstance(touches, Rig):
        labels, errors = _by_rig(touches, planner, labeller, count, until, progress)
    else:
        if isinstance(touches, str | os.PathLike | TouchTable):
            touches, rows = _of_table(touches, skin, recording)
        labels, errors = _by_hand(touches, planner, labeller)
    if rows is not None:
        rows = [row for row, label in zip(rows, labels, strict=True) if label.status is None]
    undone, loops = labeller.unlooped(labels)
    given = labelled_touches(
        undone, table.chips, place_spread=place, force_spread=press, loops=loops
    )
    own, judgement = _own_table(skin, table, given, rows, accept_bad_fit=accept_bad_fit)
    noise = signal_noise(skin, table.chips)
    return TouchCalibration(
        table=own,
        labels=tuple(labels),
        errors=tuple(errors),
        expected=(expected_error(own, noise, drag_spread=0.0), expected_error(own, noise)),
        judgement=judgement,
    )


def _usual_spreads(touches: object) -> tuple[float, float]:
    """Standard deviations of places, m, and forces, N: a rig's own, or those of a hand."""
    if isinstance(touches, Rig):
        return touches.place_spread, touches.force_spread
    if isinstance(touches, str | os.PathLike) and Path(touches).suffix == ".mcap":
        rig = rig_of(touches)
        return rig.get("place_spread", PLACE_SPREAD), rig.get("force_spread", FORCE_SPREAD)
    return PLACE_SPREAD, FORCE_SPREAD


def _own_table(
    design: SkinDesign,
    table: ResponseTable,
    touches: LabelledTouches,
    rows: list[int] | None,
    *,
    accept_bad_fit: bool,
) -> tuple[ResponseTable, Judgement]:
    """The table of the skin that touches were made on, and what they tell of each other."""
    noise = signal_noise(design, table.chips)
    turns = mlx90393.rotations(design.halls)[list(table.chips)]
    judgement = judge_touches(table, touches, noise, turns=turns, rows=rows)
    if not accept_bad_fit:
        judgement.check()
    return calibrate_touches(table, touches, noise), judgement


def plan_by_hand(
    design: SkinDesign,
    table: ResponseTable,
    *,
    count: int = DEFAULT_COUNT,
    until: float = 0.0,
    force: float = 0.8,
    drag: float = 0.0,
    made: Sequence[Contact] = (),
    place_spread: float = PLACE_SPREAD,
    force_spread: float = FORCE_SPREAD,
) -> list[Target]:
    """The touches that a person shall make after those made already, as `calibrate` asks a rig.

    Raises
    ------
    ModelError
        If the table belongs to another design.
    ArgumentError
        If a number is out of its range.
    """
    planner = _planner(design, table, count, until, force, drag, place_spread, force_spread)
    for contact in made:
        planner.made(contact.position, contact.force)
    return planner.plan(count, until)


def write_plan(path: Path | str, design: SkinDesign, targets: Sequence[Target]) -> None:
    """Write touches to make as a sheet to fill in, the untouched skin before every ten of them."""
    untouched = Target(np.full(2, np.nan), np.zeros(3), np.nan)
    rows: list[Target] = []
    for number, target in enumerate(targets):
        rows += [untouched, target] if number % _REST_EVERY == 0 else [target]
    table = TouchTable(
        position=np.reshape([row.position.round(5) for row in rows], (-1, 2)),
        force=np.reshape([row.force for row in rows], (-1, 3)),
        field=np.full((len(rows), len(design.halls), 3), np.nan),
    )
    write_touches(path, table)


def _of_table(
    touches: str | os.PathLike[str] | TouchTable,
    design: SkinDesign,
    recording: str | os.PathLike[str] | None,
) -> tuple[tuple[HeldTouch, ...], list[int]]:
    """The touches of a file or table, read there or in a recording, and the rows they stand in."""
    if not isinstance(touches, TouchTable):
        try:
            return _of_table(read_touches(touches)[0], design, recording)
        except ArgumentError as error:
            raise RecordingError(f"{os.fspath(touches)}: {error}") from error
    place, extent = touches.position, geometry(design).extent
    off = touches.touched & ~((place >= -_ROUNDED) & (place <= extent + _ROUNDED)).all(axis=1)
    if off.any():
        raise ArgumentError(f"row {int(np.argmax(off)) + 1} must lie on the skin")
    chips = len(design.halls)
    if recording is None and touches.field.shape[1] != chips:
        raise ArgumentError(f"touches must be read by {chips} chips; got {touches.field.shape[1]}")
    readings = None if recording is None else open_recording(recording).readings()
    rows = np.flatnonzero(touches.touched & touches.made) + 1
    return touches.held_touches(readings), rows.tolist()


def _by_rig(
    rig: Rig,
    planner: TouchPlanner,
    labeller: Labeller,
    count: int,
    until: float,
    progress: Callable[[TouchStep], None],
) -> tuple[list[Label], list[float]]:
    """Labels of the touches that a rig makes as planned, and the expected errors between them."""
    labels: list[Label] = []
    errors = [planner.error]
    target: Target | None = planner.next()
    while target is not None:
        contact = Contact(position=target.position, force=target.force)
        label = labeller.label(rig.press(contact, _PATIENCE))
        labels.append(label)
        if label.status is None:
            planner.made(label.contact.position, label.contact.force)
            errors.append(planner.error)
        else:
            planner.bar(target)
        enough = len(errors) > count or errors[-1] <= until
        over = enough or len(labels) >= _TRIES * count or planner.exhausted
        target = None if over else planner.next()
        progress(
            TouchStep(
                number=len(errors) - 1,
                asked=count,
                contact=label.contact,
                status=label.status,
                error=errors[-1],
                following=target,
            )
        )
    return labels, errors


def _by_hand(
    touches: Sequence[HeldTouch], planner: TouchPlanner, labeller: Labeller
) -> tuple[list[Label], list[float]]:
    """Labels of touches that have been made, and the expected errors between them."""
    labels = [labeller.label(touch) for touch in touches]
    errors = [planner.error]
    for label in labels:
        if label.status is None:
            planner.made(label.contact.position, label.contact.force)
            errors.append(planner.error)
    return labels, errors


def _planner(
    design: SkinDesign,
    table: ResponseTable,
    count: int,
    until: float,
    force: float,
    drag: float,
    place_spread: float,
    force_spread: float,
) -> TouchPlanner:
    """The planner of touches on a skin of this design, whose table it must be."""
    if count < 1 or not force > 0 or not min(drag, until) >= 0:
        raise ArgumentError(
            f"count and force must be positive, drag and until >= 0; got {count}, {force} N, "
            f"{drag} N and {until} m"
        )
    design.check_own("table", table.design_hash)
    return TouchPlanner(
        table,
        signal_noise(design, table.chips),
        force=force,
        drag=drag,
        place_spread=place_spread,
        force_spread=force_spread,
    )
