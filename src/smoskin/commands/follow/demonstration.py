"""The demonstration of Figure S13 on a simulated arm: what was pressed, and what the arm did.

A made skin, calibrated by a rig, is carried by the arm, so that its weight and the Earth's field
turn with it. Before each touch the arm goes back by itself, disarmed, and is armed at rest. All
that is promised of the arm is judged here: `judged` decides what counts as kept.
"""

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.calibrate import calibrate
from smoskin.commands.follow.script import Press, scripted_presses
from smoskin.commands.follow.stage import Moment, Stage
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, require
from smoskin.outputs import check_output
from smoskin.records import Pose
from smoskin.robot.follow import State
from smoskin.robot.law import Limits
from smoskin.robot.reasons import Reason
from smoskin.robot.simulated import SimulatedArm
from smoskin.roles import Estimator
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.service.recorder import Recorder
from smoskin.twin.carried import CarriedSkin
from smoskin.twin.rig import VirtualRig
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table

BELOW, ABOVE = 0.40, 0.60
"""Forces up to which the arm must stand and from which it must move, N."""
_FALLEN: Final = 0.02
"""Time after a force has fallen below in which the arm may still be asked to move, s."""
_REACTION: Final = 0.1
"""Time after a force has risen above in which it may still stand, s."""
_STEADY: Final = 0.15
"""Time after the arm was asked to move from which its direction counts, s."""
_OFF: Final = 10.0
"""Largest angle between force and velocity, degrees."""
_EXACT: Final = 1.02
"""Ratio up to which measured speeds are within a limit: drives swing a little."""
_ROUNDED: Final = 1e-9
"""Share by which what is asked may exceed a limit for rounding alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedTouch:
    """One touch of the script, and what the arm did."""

    x_mm: float
    y_mm: float
    largest_N: float
    """Largest true force."""
    moved_mm: float
    """Way of the touched place."""
    began_N: float | None
    """True force at which the arm was first asked to move; None where it never was."""
    direction_error_deg: float | None
    """Largest angle between the true force and the measured velocity."""
    moved_below: bool
    """Whether it was asked to move below 0.40 N."""
    still_above: bool
    """Whether it stood above 0.60 N."""
    stop_ms: float
    """Longest time from the fall of the force below 0.40 N until it was asked to stand."""
    fault: str
    """Name of the fault that stopped the arm; empty where there was none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowSummary:
    """The demonstration in a few numbers."""

    touches: int
    moved_below_0_40_N: int
    still_above_0_60_N: int
    direction_error_deg_max: float | None
    limit_violations: int
    faults: int
    stop_ms_max: float
    rate_hz: float
    """Readings a second that this machine could turn to commands."""

    @property
    def kept(self) -> bool:
        """Whether everything promised was kept."""
        off = self.direction_error_deg_max
        broken = (
            self.moved_below_0_40_N + self.still_above_0_60_N + self.limit_violations + self.faults
        )
        in_time = self.stop_ms_max <= 1e3 * _FALLEN
        return self.touches > 0 and broken == 0 and in_time and off is not None and off <= _OFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Demonstration:
    """What the demonstration showed."""

    touches: tuple[FollowedTouch, ...]
    summary: FollowSummary
    exceeded: dict[str, int] = field(default_factory=dict)
    """How often each limit was exceeded, by its name."""
    asked_hz: float = 0.0
    """Readings a second that were played."""
    not_recorded: str = ""
    """Sentence about why the recording is not whole; empty where it is, or none was asked for."""

    @property
    def broken(self) -> tuple[str, ...]:
        """Sentences about what was not kept, beside the numbers of the summary."""
        words = ", ".join(f"{name} {count}" for name, count in self.exceeded.items() if count)
        able, asked, sentences = self.summary.rate_hz, self.asked_hz, []
        if words:
            sentences.append(f"Limits were exceeded, each so often: {words}.")
        if able < asked:
            sentences.append(f"This machine can only turn {able:g} of {asked:g} readings a second.")
        if self.not_recorded:
            sentences.append(f"{self.not_recorded}.")
        return tuple(sentences)

    @property
    def kept(self) -> bool:
        """Whether everything promised and asked for was kept."""
        return self.summary.kept and not self.broken

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines: touches, summary, and sentences about what is broken."""
        touches = [asdict(touch) for touch in self.touches]
        return {"touches": touches, "summary": asdict(self.summary), "broken": list(self.broken)}

    def tables(self) -> "list[Table]":
        """Every touch with what the arm did."""
        from rich.table import Table

        table = Table(title="Touches and the arm")
        for heading in (
            "at (mm)",
            "up to (N)",
            "moved from (N)",
            "by (mm)",
            "off (degrees)",
            "broken",
        ):
            table.add_column(heading, justify="right")
        for touch in self.touches:
            words = [
                *["moved by too little"] * touch.moved_below,
                *["stood under too much"] * touch.still_above,
                *[touch.fault] * bool(touch.fault),
            ]
            began, off = touch.began_N, touch.direction_error_deg
            table.add_row(
                f"{touch.x_mm:.0f}, {touch.y_mm:.0f}",
                f"{touch.largest_N:.2f}",
                "" if began is None else f"{began:.2f}",
                f"{touch.moved_mm:.0f}",
                "" if off is None else f"{off:.1f}",
                ", ".join(words),
                style="red" if words else "",
            )
        return [table]


def demonstrate(
    design: SkinDesign,
    *,
    seed: int = 0,
    rate: float = 100.0,
    calibration_touches: int = 15,
    table: ResponseTable | None = None,
    arm: Callable[[SkinDesign, Callable[[], float]], SimulatedArm] = SimulatedArm,
    limits: Limits | None = None,
    record: str | os.PathLike[str] | None = None,
    force: bool = False,
    say: Callable[[str], object] = lambda sentence: None,
    watch: Callable[[Stage, Moment], object] = lambda stage, moment: None,
) -> Demonstration:
    """Play the script on a made skin that a simulated arm carries, and judge what the arm did.

    Parameters
    ----------
    design : SkinDesign
    seed : int
        Seed of the made skin and of all noise.
    rate : float
        Readings a second, 50 to 500 Hz.
    calibration_touches : int
        Touches of the rig that calibrates the skin.
    table : ResponseTable, optional
        Table of the design; by default the one that comes with the package.
    arm : callable
        Function of design and clock that makes the arm.
    limits : Limits, optional
        What the arm may do.
    record, force : path and bool
        A new MCAP file for readings, estimates, the calibrated table and the arm; with `force` it
        may replace another. Where it cannot be written any more, the demonstration goes on.
    say, watch : callable
        Functions called with sentences about what is done, and with every moment.

    Raises
    ------
    ArgumentError
        If the rate is out of its range, or the skin reads as touched when nobody touches.
    ModelError
        If there is no table of the design, or the arm's model cannot be read.
    FileError, RecordingError
        If there is such a file already, or it cannot be made.
    MissingExtraError
        If the extras ``robot``, ``twin`` and ``learned`` are not installed, or, to record,
        ``recording``.
    """
    if not 50.0 <= rate <= 500.0:
        raise ArgumentError(f"rate must be from 50 to 500 Hz; got {rate}")
    if record is not None:
        require("recording", "recording", "mcap", "rosbags")
        check_output(record, force=force)
    say("A workshop makes a skin, and a rig calibrates it.")
    known = load_response_table(design.name) if table is None else table
    twin = Twin(design, seed=seed, manufactured=True)
    rig = VirtualRig(twin, seed=seed)
    done = calibrate(known, rig, design=design, count=calibration_touches)
    skin = CarriedSkin(twin, seed=seed)
    with ExitStack() as stack:
        recorder = None
        if record is not None:
            recorder = stack.enter_context(_recorder(Path(record), design, done.table, say))
        stage = Stage(
            lambda clock: arm(design, clock),
            skin,
            partial(_posed, design, done.table),
            rate=rate,
            limits=limits,
            recorder=recorder,
        )
        say("The arm swings untouched, so that what its pose changes is known.")
        stage.swing(lambda moment: watch(stage, moment))
        presses = scripted_presses(design)
        for number, press in enumerate(presses):
            x, y = 1e3 * press.place
            say(f"Touch {number + 1} of {len(presses)}, at ({x:.0f}, {y:.0f}) mm.")
            stage.play(press, number, lambda moment: watch(stage, moment))
    able = len(stage.moments) / stage.busy
    demonstration = judged(stage.moments, presses, limits or Limits(), able)
    return replace(
        demonstration, asked_hz=rate, not_recorded="" if recorder is None else recorder.failure
    )


def _posed(design: SkinDesign, table: ResponseTable, pose: Callable[[], Pose]) -> Estimator:
    """What reads the calibrated skin, and is told how the arm holds it."""
    bayes = ZeroFirst(BayesEstimator(design, table))
    bayes.carried_by(pose)
    return bayes


def _recorder(
    path: Path, design: SkinDesign, table: ResponseTable, say: Callable[[str], object]
) -> Recorder:
    """What records the demonstration, with the table by which its skin is read."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "skin.table"
        table.save(file)
        attached = {file.name: file.read_bytes()}
    path.unlink(missing_ok=True)  # it may be replaced, or there would have been an error before
    return Recorder(path, design, attachments=attached, on_failure=say)


def judged(
    moments: Sequence[Moment], presses: Sequence[Press], limits: Limits, rate: float
) -> Demonstration:
    """What every touch and the whole came to."""
    touches = tuple(
        _judged([m for m in moments if m.press == number], press)
        for number, press in enumerate(presses)
    )
    offs = [t.direction_error_deg for t in touches if t.direction_error_deg is not None]
    exceeded = _exceeded(moments, touches, limits)
    faults = [moment.command.state is State.FAULT for moment in moments]
    return Demonstration(
        touches=touches,
        summary=FollowSummary(
            touches=len(touches),
            moved_below_0_40_N=sum(touch.moved_below for touch in touches),
            still_above_0_60_N=sum(touch.still_above for touch in touches),
            direction_error_deg_max=max(offs, default=None),
            limit_violations=sum(exceeded.values()),
            faults=int(np.count_nonzero(np.diff([False, *faults]) & np.array(faults))),
            stop_ms_max=max((touch.stop_ms for touch in touches), default=0.0),
            rate_hz=round(rate, 1),
        ),
        exceeded=exceeded,
    )


def _exceeded(
    moments: Sequence[Moment], touches: Sequence[FollowedTouch], limits: Limits
) -> dict[str, int]:
    """How often each limit was exceeded while the arm was armed, by its name."""
    armed = [moment for moment in moments if moment.press >= 0]
    outside = [
        moment.height < limits.floor
        or (moment.force > 0.0 and not (limits.low <= moment.place).all())
        or (moment.force > 0.0 and not (moment.place <= limits.high).all())
        for moment in armed
    ]
    most = (1.0 + _ROUNDED) * limits.acceleration
    return {
        "speed": sum(moment.fastest > _EXACT * limits.speed for moment in armed),
        "acceleration": sum(moment.gain > most for moment in armed),
        "way": sum(touch.moved_mm > 1e3 * limits.distance for touch in touches),
        "time": sum(last > limits.duration for last in _moved_for(armed)),
        "joint range": sum(moment.room < 0.0 for moment in armed),
        "workspace": sum(outside),
    }


def _moved_for(moments: Sequence[Moment]) -> list[float]:
    """Seconds from first to last move of each touch, until it is let go."""
    spans: list[tuple[float, float]] = []
    touch, before = -1, 0.0
    for moment in moments:
        if moment.press != touch or before == 0.0:
            spans.append((np.inf, -np.inf))
        touch, before = moment.press, moment.force
        if moment.command.speeds.any():
            first, _ = spans[-1]
            spans[-1] = min(first, moment.time), moment.time
    return [last - first for first, last in spans]


def _judged(moments: Sequence[Moment], press: Press) -> FollowedTouch:
    """What one touch came to."""
    times = np.array([moment.time for moment in moments])
    force = np.array([moment.force for moment in moments])
    moving = np.array([bool(moment.command.speeds.any()) for moment in moments])
    ended = (Reason.DISTANCE, Reason.DURATION)
    excused = np.array([moment.command.reason in ended for moment in moments])
    below, above = _held_for(times, force <= BELOW), _held_for(times, force >= ABOVE)
    steady = _held_for(times, moving) >= _STEADY
    angles = np.array([moment.angle for moment in moments])[steady]
    step = np.diff(times, append=times[-1])
    began = force[moving.argmax()] if moving.any() else None
    late = below[moving & (below >= 0.0)]
    rising = moving & ~np.append(False, moving[:-1]) & (force <= BELOW)
    return FollowedTouch(
        x_mm=round(1e3 * press.place[0], 1),
        y_mm=round(1e3 * press.place[1], 1),
        largest_N=round(float(force.max()), 3),
        moved_mm=round(1e3 * float(step @ [moment.speed for moment in moments]), 2),
        began_N=None if began is None else round(float(began), 3),
        direction_error_deg=round(float(np.nanmax(angles)), 2)
        if np.isfinite(angles).any()
        else None,
        moved_below=bool(rising.any() or (late > _FALLEN).any()),
        still_above=bool((~moving & ~excused & (above > _REACTION)).any()),
        stop_ms=round(1e3 * float(late.max(initial=0.0)), 1),
        fault=next((m.command.reason.name for m in moments if m.command.reason.fault), ""),
    )


def _held_for(times: Floats, true: Any) -> Floats:
    """Seconds for which something has been true at each time, (T,); -1 where it is not."""
    held, since = np.full(len(times), -1.0), 0.0
    for k, holds in enumerate(true):
        since = times[k] if holds and (k == 0 or not true[k - 1]) else since
        held[k] = times[k] - since if holds else -1.0
    return held
