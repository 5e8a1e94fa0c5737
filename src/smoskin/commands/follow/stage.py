"""The stage of the demonstration: a skin on a simulated arm, what estimates, and what follows.

Time is the simulation's: nothing depends on how busy the machine is, except the rate that is told.
"""

import time
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.follow.script import Press
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Pose
from smoskin.robot import law
from smoskin.robot.chain import Carriage
from smoskin.robot.follow import Command, Follow, Seen, State
from smoskin.robot.law import Limits
from smoskin.robot.simulated import SimulatedArm
from smoskin.roles import Estimator
from smoskin.service.recorder import Recorder
from smoskin.twin.carried import CarriedSkin

_REST: Final = 0.8
"""Time at rest before and after a touch, s."""
_SWING, _SWUNG = 2.0, 0.25
"""Time, s, and farthest turn, rad, of each joint to and fro before the first touch."""
_BACK: Final = 0.3
"""Speed of the joints on the way back, rad/s."""
_MOVES: Final = 5e-3
"""Speed from which the touched place has a direction, m/s."""
_SINKS: Final = 1e-3
"""Speed from which a part sinks, m/s: drives swing a little where an arm stands."""


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
    gain: float = 0.0
    """m/s^2: fastest gain of speed of any part that was asked for."""
    room: float = np.inf
    """rad: of the joint nearest to an end of its range, to that; negative beyond."""
    height: float = np.inf
    """m: of the lowest part that sinks; infinite where none does."""


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
        recorder: Recorder | None = None,
    ) -> None:
        self._now = 0.0
        self.arm = arm(lambda: self._now)
        self._design = skin.twin.design
        self.follow = Follow(self.arm.chain, self._design, limits)
        self._recorder, self._asked = recorder, np.zeros(self.arm.chain.joints)
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
        if self._recorder is not None:
            self._recorder.write(reading, estimate)
            arm = state.angles, state.speeds, command.sentence
            self._recorder.write_arm(self._now, *arm)
        velocity = posture.jacobian(place) @ state.speeds if contacts else np.zeros(3)
        speed = float(np.linalg.norm(velocity))
        parts = posture.corner_motions @ np.stack([state.speeds, command.speeds, self._asked], 1)
        fast, asked, before = np.linalg.norm(parts, axis=1).T
        self._asked, sinking = command.speeds, parts[:, 2, 0] < -_SINKS
        moment = Moment(
            time=self._now,
            press=number,
            force=float(np.linalg.norm(push)),
            command=command,
            angle=law.turned_away(velocity, push) if speed > _MOVES else np.nan,
            speed=speed,
            fastest=float(fast.max()),
            place=place,
            push=push,
            gain=float((asked - before).max()) / self._period,
            room=float(np.minimum(chain.upper - state.angles, state.angles - chain.lower).min()),
            height=float(posture.corners[sinking, 2].min(initial=np.inf)),
        )
        self.moments.append(moment)
        watch(moment)

    def _homeward(self) -> Floats:
        """Speeds by which a disarmed arm goes back, gently at the end."""
        away = self.start - self.arm.state().angles
        gentle = min(1.0, float(np.abs(away).max()) / 0.1 + 0.02)
        return np.asarray(away / max(float(np.abs(away).max()), 1e-9) * _BACK * gentle)
