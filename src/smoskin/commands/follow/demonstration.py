"""The demonstration of Figure S13 on a simulated arm: what was pressed, and what the arm did.

A made skin, calibrated by a rig, is carried by the arm, so that its weight and the Earth's field
turn with it. Before each touch the arm goes back by itself, disarmed, and is armed at rest. Time is
the simulation's: nothing depends on how busy the machine is, except the rate that is told.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.calibrate import calibrate
from smoskin.commands.follow.script import Press, scripted_presses
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Pose
from smoskin.robot import law
from smoskin.robot.chain import Carriage
from smoskin.robot.follow import Command, Follow, Seen, State
from smoskin.robot.law import Limits
from smoskin.robot.reasons import Reason
from smoskin.robot.simulated import SimulatedArm
from smoskin.roles import Estimator
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.twin.carried import CarriedSkin
from smoskin.twin.rig import VirtualRig
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table

BELOW, ABOVE = 0.40, 0.60
"""Forces up to which the arm must stand and from which it must move, N."""
_REST: Final = 0.8
"""Time at rest before and after a touch, s."""
_SWING, _SWUNG = 2.0, 0.25
"""Time, s, and farthest turn, rad, of each joint to and fro before the first touch."""
_BACK: Final = 0.3
"""Speed of the joints on the way back, rad/s."""
_FALLEN: Final = 0.02
"""Time after a force has fallen below in which the arm may still be asked to move, s."""
_REACTION: Final = 0.1
"""Time after a force has risen above in which it may still stand, s."""
_STEADY: Final = 0.15
"""Time after the arm was asked to move from which its direction counts, s."""
_MOVES: Final = 5e-3
"""Speed from which it has a direction, m/s."""
_OFF: Final = 10.0
"""Largest angle between force and velocity, degrees."""
_EXACT: Final = 1.02
"""Ratio up to which measured speeds are within a limit: drives swing a little."""


class Moment(NamedTuple):
    """One reading of the demonstration, and what came of it."""

    time: float
    """s."""
    press: int
    """Number of the touch; -1 between touches."""
    force: float
    """N: true size of the force."""
    command: Command
    angle: float
    """degrees: between the true force and the measured velocity of the touched place; NaN where
    the place hardly moves."""
    speed: float
    """m/s: measured, of the touched place."""
    fastest: float
    """m/s: measured, of the arm's fastest part."""
    place: Floats
    """(3,), m: touched place in the room."""
    push: Floats
    """(3,), N: true force in the room."""


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

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines: ``{"touches": [...], "summary": {...}}``."""
        return asdict(self)

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
            "fault",
        ):
            table.add_column(heading, justify="right")
        for touch in self.touches:
            broken = touch.moved_below or touch.still_above
            began, off = touch.began_N, touch.direction_error_deg
            table.add_row(
                f"{touch.x_mm:.0f}, {touch.y_mm:.0f}",
                f"{touch.largest_N:.2f}",
                "" if began is None else f"{began:.2f}",
                f"{touch.moved_mm:.0f}",
                "" if off is None else f"{off:.1f}",
                touch.fault,
                style="red" if broken else "",
            )
        return [table]


class Stage:
    """A skin on a simulated arm, its estimator, and what follows; one step a reading."""

    def __init__(
        self,
        arm: Callable[[Callable[[], float]], SimulatedArm],
        skin: CarriedSkin,
        estimator: Callable[[Callable[[], Pose]], Estimator],
        *,
        rate: float = 100.0,
        limits: Limits | None = None,
    ) -> None:
        self._now = 0.0
        self.arm = arm(lambda: self._now)
        self._design = skin.twin.design
        self.follow = Follow(self.arm.chain, self._design, limits)
        self._limits = Limits() if limits is None else limits
        self._skin, self._carriage = skin, Carriage(self.arm.chain, self.follow.middle)
        self._estimator = estimator(lambda: self._carriage.pose)
        self._period = 1.0 / rate
        self.start = self.arm.state().angles
        """(J,), rad: angles that the arm goes back to."""
        self.moments: list[Moment] = []
        self.busy = 0.0
        """Seconds that the machine took from readings to commands."""
        self._number = 0

    def play(self, press: Press, number: int, watch: Callable[[Moment], object]) -> None:
        """Go back, rest, be armed, and follow a touch.

        It raises an `ArgumentError` if the skin does not read as untouched before.
        """
        self.follow.disarm()
        while np.abs(self.arm.state().angles - self.start).max() > 1e-3:
            self._step((), -1, watch, self._homeward())
        self._wait(_REST, watch)
        if self.follow.state is State.FAULT:
            self.follow.reset()
        self.follow.arm()
        for k in range(round(press.seconds / self._period) + 1):
            self._step(press.contacts(k * self._period), number, watch)
        self._wait(_REST / 2, watch)

    def swing(self, watch: Callable[[Moment], object]) -> None:
        """Turn the joints that carry the skin to and fro, untouched, so that poses are learned."""
        self._wait(_REST, watch)
        joints = np.eye(self.arm.chain.joints)[: self.arm.chain.carriers]
        for joint in joints:
            for phase in np.arange(0.0, 2 * np.pi, 2 * np.pi * self._period / _SWING):
                self._step((), -1, watch, _SWUNG * 2 * np.pi / _SWING * np.cos(phase) * joint)

    def _wait(self, seconds: float, watch: Callable[[Moment], object]) -> None:
        for _ in range(round(seconds / self._period)):
            self._step((), -1, watch)

    def _step(
        self,
        contacts: Sequence[Contact],
        number: int,
        watch: Callable[[Moment], object],
        programme: Floats | None = None,
    ) -> None:
        """One reading: what it shows, what the arm is told, what it does until the next.

        A robot's programme may move the joints instead, (J,), rad/s, while nobody has armed.
        """
        self._number += 1
        self._now = self._number * self._period
        state, chain = self.arm.state(), self.arm.chain
        posture = chain.posture(state.angles)
        roll = geometry(self._design).roll
        place, push = np.zeros(3), np.zeros(3)
        for contact in contacts:
            x, y = contact.position
            place = posture.on_skin(roll.places(np.array([x, y, 0.0])))
            push = posture.of_skin(roll.axes(y) @ contact.force)
        self.arm.push(place, push)
        pose = self._carriage.look(self._now, state.angles, state.speeds)
        reading = self._skin.read(self._now, contacts, pose.turn, acceleration=pose.acceleration)
        begun = time.perf_counter()
        estimate = self._estimator.step(reading)
        command = self.follow.step(self._now, Seen(estimate, self._now), state)
        self.busy += time.perf_counter() - begun
        self.arm.move(command.speeds if programme is None else programme)
        velocity = posture.jacobian(place) @ state.speeds if contacts else np.zeros(3)
        speed = float(np.linalg.norm(velocity))
        moment = Moment(
            time=self._now,
            press=number,
            force=float(np.linalg.norm(push)),
            command=command,
            angle=law.turned_away(velocity, push) if speed > _MOVES else np.nan,
            speed=speed,
            fastest=float(np.linalg.norm(posture.corner_motions @ state.speeds, axis=1).max()),
            place=place,
            push=push,
        )
        self.moments.append(moment)
        watch(moment)

    def _homeward(self) -> Floats:
        """Speeds by which a disarmed arm goes back, gently at the end."""
        away = self.start - self.arm.state().angles
        gentle = min(1.0, float(np.abs(away).max()) / 0.1 + 0.02)
        return np.asarray(away / max(float(np.abs(away).max()), 1e-9) * _BACK * gentle)


def demonstrate(
    design: SkinDesign,
    *,
    seed: int = 0,
    rate: float = 100.0,
    calibration_touches: int = 15,
    table: ResponseTable | None = None,
    arm: Callable[[SkinDesign, Callable[[], float]], SimulatedArm] = SimulatedArm,
    limits: Limits | None = None,
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
    say, watch : callable
        Functions called with sentences about what is done, and with every moment.

    Raises
    ------
    ArgumentError
        If the rate is out of its range, or the skin reads as touched when nobody touches.
    ModelError
        If there is no table of the design, or the arm's model cannot be read.
    MissingExtraError
        If the extras ``robot``, ``twin`` and ``learned`` are not installed.
    """
    if not 50.0 <= rate <= 500.0:
        raise ArgumentError(f"rate must be from 50 to 500 Hz; got {rate}")
    say("A workshop makes a skin, and a rig calibrates it.")
    known = load_response_table(design.name) if table is None else table
    twin = Twin(design, seed=seed, manufactured=True)
    rig = VirtualRig(twin, seed=seed)
    done = calibrate(known, rig, design=design, count=calibration_touches)
    skin = CarriedSkin(twin, seed=seed)

    def estimator(pose: Callable[[], Pose]) -> Estimator:
        bayes = ZeroFirst(BayesEstimator(design, done.table))
        bayes.carried_by(pose)
        return bayes

    stage = Stage(lambda clock: arm(design, clock), skin, estimator, rate=rate, limits=limits)
    say("The arm swings untouched, so that what its pose changes is known.")
    stage.swing(lambda moment: watch(stage, moment))
    presses = scripted_presses(design)
    for number, press in enumerate(presses):
        x, y = 1e3 * press.place
        say(f"Touch {number + 1} of {len(presses)}, at ({x:.0f}, {y:.0f}) mm.")
        stage.play(press, number, lambda moment: watch(stage, moment))
    return judged(stage.moments, presses, limits or Limits(), len(stage.moments) / stage.busy)


def judged(
    moments: Sequence[Moment], presses: Sequence[Press], limits: Limits, rate: float
) -> Demonstration:
    """What every touch and the whole came to."""
    touches = tuple(
        _judged([m for m in moments if m.press == number], press)
        for number, press in enumerate(presses)
    )
    offs = [t.direction_error_deg for t in touches if t.direction_error_deg is not None]
    asked = [moment for moment in moments if moment.press >= 0]
    faults = [moment.command.state is State.FAULT for moment in moments]
    return Demonstration(
        touches=touches,
        summary=FollowSummary(
            touches=len(touches),
            moved_below_0_40_N=sum(touch.moved_below for touch in touches),
            still_above_0_60_N=sum(touch.still_above for touch in touches),
            direction_error_deg_max=max(offs, default=None),
            limit_violations=sum(moment.fastest > _EXACT * limits.speed for moment in asked)
            + sum(touch.moved_mm > 1e3 * limits.distance for touch in touches),
            faults=int(np.count_nonzero(np.diff([False, *faults]) & np.array(faults))),
            stop_ms_max=max((touch.stop_ms for touch in touches), default=0.0),
            rate_hz=round(rate, 1),
        ),
    )


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
