"""What follows a touch: decides when an arm may move, how far, and what stops it.

Hides the memory of a touch, of the arm's past and of faults. Knows no threads and no clocks:
whoever calls `step` says what time it is.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Estimate, Status
from smoskin.robot import law
from smoskin.robot.arm import ArmState
from smoskin.robot.chain import Chain, Posture
from smoskin.robot.law import Limits
from smoskin.robot.reasons import OF_STATUS, Reason

THRESHOLDS: Final = (0.3, 1.0)
"""Least and largest force from which the arm may be let move, N: untouched skins that turn have
felt up to 0.14 N, and what is excessive must lie above."""
_BAND: Final = 0.1
"""Force below the threshold at which the arm stands again, N."""
_AT_REST: Final = 0.01
"""Speed of a joint, rad/s, below which it rests."""
_REST: Final = 0.5
"""Time for which the arm must rest untouched before it is armed or reset, s."""
_ELLIPSE: Final = 5.991
"""Quantile of chi-square with 2 degrees of freedom that 95 % stay below."""
_STANDS: Final = 0.05
"""Share of a wanted speed below which the arm stands rather than creeps."""
_JUMP: Final = 0.1
"""Time by which readings' clock and ours may part from one estimate to the next, s."""
_ASTRAY: Final = 0.03
"""Speed by which a part may differ from what was asked, m/s, and time for which."""
_UNLIKE: Final = 0.25
_RELEASE: Final = 1.0
"""Longest time of giving way to an excessive force, s."""


class State(Enum):
    """What the arm is allowed; the value is a word for people."""

    DISARMED = "disarmed"
    STANDING = "standing"
    MOVING = "moving"
    RELEASING = "releasing"
    FAULT = "fault"


class Seen(NamedTuple):
    """An estimate, and when its reading arrived on the clock of whoever calls."""

    estimate: Estimate
    arrival: float
    """s."""
    news: float | None = None
    """s: when the first of the readings arrived that have been the same to the bit since; None
    where nobody compares them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Command:
    """What the arm is to do now, and why."""

    speeds: Floats
    """(J,), rad/s; nothing where the arm stands."""
    state: State
    reason: Reason
    place: Floats | None = None
    """(3,), m: touched place in the base's frame, of one touch that is believed."""
    force: Floats | None = None
    """(3,), N: its force there."""

    @property
    def sentence(self) -> str:
        """What the arm is allowed, and why, for people."""
        return f"{self.state.value}: {self.reason.value}"


class _Touch(NamedTuple):
    """One touch that is believed, in the base's frame."""

    place: Floats
    force: Floats
    jacobian: Floats


class Follow:
    """Yields to touches of a skin on an arm; disarmed at first.

    Parameters
    ----------
    chain : Chain
        Arm's joints, with the skin's place.
    design : SkinDesign
        Skin on it.
    limits : Limits, optional
        What the arm may do.

    Notes
    -----
    This is not a safety function: it runs on an ordinary computer and stops by category 2 of
    IEC 60204-1 (the drives stay powered). The wired emergency stop and the robot's own limits stay
    in force.
    """

    _since: float | None
    _ended: Reason | None

    def __init__(self, chain: Chain, design: SkinDesign, limits: Limits | None = None) -> None:
        self._chain = chain
        self._skin = geometry(design)
        self.middle = self._skin.roll.places(np.append(self._skin.extent / 2, 0.0))
        """Middle of the skin in its frame, (3,), m."""
        self._limits = Limits() if limits is None else limits
        self._still = np.zeros(chain.joints)
        self.state = State.DISARMED
        """What the arm is allowed now."""
        self.fault: Reason | None = None
        """What stopped the arm for good."""
        self._speeds = self._still
        self._now = -math.inf
        self._last: Seen | None = None
        self._resting = self._alike = math.inf
        self._pushed = False
        self._forget_touch()

    def arm(self) -> None:
        """Let touches move the arm; only a person may ask for it.

        Raises
        ------
        ArgumentError
            If there is a fault, or the arm does not rest untouched for half a second.
        """
        if self.state is State.FAULT:
            raise ArgumentError(f"fault must be reset first: {self.fault and self.fault.value}")
        self._require_rest()
        if self.state is State.DISARMED:
            self.state = State.STANDING

    def disarm(self) -> None:
        """Let touches move the arm no more; a fault stays."""
        if self.state is not State.FAULT:
            self.state = State.DISARMED

    def reset(self) -> None:
        """Forget a fault: the arm is disarmed then. It raises as `arm` does."""
        self._require_rest()
        if self.state is State.FAULT:
            self.state, self.fault = State.DISARMED, None

    def set_threshold(self, begin: float) -> None:
        """Let the arm move from this force on, N, of `THRESHOLDS`; only while it is disarmed."""
        low, high = THRESHOLDS
        if not low <= begin <= high:
            raise ArgumentError(f"threshold must be from {low:g} to {high:g} N; got {begin}")
        if self.state is not State.DISARMED:
            raise ArgumentError("arm must be disarmed before its threshold changes")
        self._limits = replace(self._limits, begin=begin, end=begin - _BAND)

    @property
    def limits(self) -> Limits:
        """What the arm may do."""
        return self._limits

    @property
    def way(self) -> float:
        """How far this touch has moved its place, m."""
        return self._way

    def fail(self, reason: Reason) -> Command:
        """Stop for a fault."""
        self.fault = reason if self.fault is None else self.fault
        self.state = State.FAULT
        self._resting = math.inf
        return self._stand(reason)

    def step(self, now: float, seen: Seen | None, arm: ArmState, *, run: bool = True) -> Command:
        """What the arm is to do at this time, s, by the newest estimate and its own state.

        `run` is whether the switch is held that lets it move; without it the arm does not give way
        to an excessive force either.
        """
        elapsed, self._now = now - self._now, now
        posture = self._chain.posture(arm.angles)
        touch, reason = self._judged(now, elapsed, seen, arm, posture)
        self._last = seen
        self._rest(now, seen, arm)
        if reason is not None and reason.fault:
            return self.fail(reason)
        if self.state in (State.FAULT, State.DISARMED):
            return self._stand(self.fault or Reason.DISARMED, touch)
        hard = touch is not None and np.linalg.norm(touch.force) >= self._limits.excessive
        if hard and self.state is not State.RELEASING:
            self.state, self._way, self._since = State.RELEASING, 0.0, now
        if self.state is State.RELEASING:
            if not run:
                return self.fail(Reason.FORCE)
            return self._released(now, elapsed, touch, arm, posture)
        if reason is not None or touch is None:
            return self._stand(reason or Reason.UNTOUCHED, touch)
        if not run:
            return self._stand(Reason.SWITCH, touch)
        return self._followed(now, elapsed, touch, arm, posture)

    def _judged(
        self, now: float, elapsed: float, seen: Seen | None, arm: ArmState, posture: Posture
    ) -> tuple[_Touch | None, Reason | None]:
        """The one touch that is believed, if any, and what forbids to move."""
        limits = self._limits
        if not (elapsed > 0.0 and math.isfinite(now)):
            return None, Reason.CLOCK
        if reason := self._of_arm(now, arm, posture):
            return None, reason
        if elapsed > limits.cycle and math.isfinite(elapsed) and self._armed:
            return None, Reason.DEADLINE
        if seen is None or now - seen.arrival > limits.patience:
            return None, Reason.SILENT if self._armed else Reason.DISARMED
        if self._jumped(now, seen):
            return None, Reason.CLOCK
        # While the arm moves no chip says the same twice: fields turn, and there is noise.
        moves = self.state in (State.MOVING, State.RELEASING)
        if moves and seen.news is not None and now - seen.news > limits.patience:
            return None, Reason.STALE
        return self._of_estimate(seen.estimate, posture)

    def _of_arm(self, now: float, arm: ArmState, posture: Posture) -> Reason | None:
        """What is wrong with the arm."""
        if arm.meets:
            return Reason.COLLISION
        if not (np.isfinite(arm.angles).all() and np.isfinite(arm.speeds).all()):
            return Reason.ARM
        parts = posture.corner_motions @ np.stack([arm.speeds, arm.speeds - self._speeds], axis=-1)
        fastest, farthest = np.linalg.norm(parts, axis=1).max(axis=0, initial=0.0)
        # While it is disarmed or stopped for good, whoever moves it has his own limits.
        ours = self.state not in (State.DISARMED, State.FAULT)
        if fastest > law.HARD_LIMIT and ours:
            return Reason.ASTRAY
        if farthest < _ASTRAY or not ours:
            self._alike = now
        return Reason.ASTRAY if now - self._alike > _UNLIKE else None

    def _jumped(self, now: float, seen: Seen) -> bool:
        """Whether the clock of readings or ours has jumped since the estimate before."""
        if seen.arrival > now:
            return True
        if self._last is None or self._last.arrival == seen.arrival:
            return False
        ours = seen.arrival - self._last.arrival
        theirs = seen.estimate.time - self._last.estimate.time
        return self._armed and not abs(theirs - ours) < _JUMP

    def _of_estimate(
        self, estimate: Estimate, posture: Posture
    ) -> tuple[_Touch | None, Reason | None]:
        """What an estimate says, in the base's frame."""
        if (reason := OF_STATUS.get(estimate.status)) is not None:
            return None, reason if self._armed or not reason.fault else Reason.DISARMED
        if not estimate.contacts:
            return None, None
        if len(estimate.contacts) > 1:
            return None, Reason.TWO_TOUCHES
        (contact,), (spread,) = estimate.contacts, estimate.covariance
        x, y = contact.position
        roll = self._skin.roll
        place = posture.on_skin(roll.places(np.array([x, y, 0.0])))
        force = posture.of_skin(roll.axes(y) @ contact.force)
        if not np.isfinite(force).all():
            return None, Reason.OUT_OF_RANGE
        touch = _Touch(place, force, posture.jacobian(place))
        # What is not known is not below any bound.
        variance = _largest(spread[:2, :2])
        wide = not _ELLIPSE * variance <= self._limits.ellipse**2
        return touch, Reason.WIDE if wide else None

    def _rest(self, now: float, seen: Seen | None, arm: ArmState) -> None:
        """Keep since when the arm has rested untouched, and forget a touch that is over."""
        fresh = seen is not None and now - seen.arrival <= self._limits.patience
        untouched = seen is not None and seen.estimate.status is Status.NO_CONTACT
        if fresh and untouched:
            self._forget_touch()
        if not (fresh and untouched and np.abs(arm.speeds).max(initial=0.0) < _AT_REST):
            self._resting = math.inf
        elif not math.isfinite(self._resting):
            self._resting = now

    def _followed(
        self, now: float, elapsed: float, touch: _Touch, arm: ArmState, posture: Posture
    ) -> Command:
        """Move along the force, unless it is light or something is at its end."""
        limits = self._limits
        self._pushed = law.is_pushed(float(np.linalg.norm(touch.force)), self._pushed, limits)
        moving = touch.jacobian @ arm.speeds
        speed = float(np.linalg.norm(moving))
        self._way += elapsed * speed
        if not self._pushed:
            return self._stand(Reason.LIGHT, touch)
        self._since = now if self._since is None else self._since
        if self._way + speed**2 / (2 * limits.braking) + elapsed * speed >= limits.distance:
            self._ended = Reason.DISTANCE
        elif now - self._since >= limits.duration:
            self._ended = Reason.DURATION
        if self._ended is not None:
            return self._stand(self._ended, touch)
        return self._towards(law.yielding(touch.force, limits), elapsed, touch, arm, posture)

    def _released(
        self, now: float, elapsed: float, touch: _Touch | None, arm: ArmState, posture: Posture
    ) -> Command:
        """Give way to an excessive force, then stop for good."""
        limits, since = self._limits, now if self._since is None else self._since
        if touch is None:
            return self.fail(Reason.FORCE)
        size, speed = np.linalg.norm(touch.force), np.linalg.norm(touch.jacobian @ arm.speeds)
        self._way += float(elapsed * speed)
        braked = self._way + speed**2 / (2 * limits.braking) + elapsed * speed
        if size < limits.end or braked >= limits.release or now - since > _RELEASE:
            return self.fail(Reason.FORCE)
        wanted = touch.force * (limits.release_speed / size)
        command = self._towards(wanted, elapsed, touch, arm, posture)
        return command if command.speeds.any() else self.fail(Reason.FORCE)

    def _towards(
        self, wanted: Floats, elapsed: float, touch: _Touch, arm: ArmState, posture: Posture
    ) -> Command:
        """Move a place at a velocity (3,), m/s, as far as joints, limits and workspace allow."""
        limits, chain = self._limits, self._chain
        speeds = law.joint_speeds(touch.jacobian, wanted)
        reached = touch.jacobian @ speeds
        size = np.linalg.norm(wanted)
        if law.turned_away(reached, wanted) > limits.angle or np.linalg.norm(reached) < size / 2:
            return self._stand(Reason.NO_WAY, touch)
        speeds = speeds * law.speed_factor(chain, posture, speeds, limits)
        ranged, roomy = self._room(speeds, touch, arm, posture)
        if min(ranged, roomy) < _STANDS:
            return self._stand(Reason.JOINT_RANGE if ranged < roomy else Reason.WORKSPACE, touch)
        speeds = law.gained(chain, posture, self._speeds, speeds, elapsed, limits)
        # Speed is lost as fast as need be.
        speeds = min(self._room(speeds, touch, arm, posture)) * speeds
        self._speeds = law.speed_factor(chain, posture, speeds, limits) * speeds
        if self.state is not State.RELEASING:
            self.state = State.MOVING
        reason = Reason.MOVING if self.state is State.MOVING else Reason.RELEASING
        return Command(
            speeds=self._speeds, state=self.state, reason=reason, place=touch.place,
            force=touch.force,
        )  # fmt: skip

    def _room(
        self, speeds: Floats, touch: _Touch, arm: ArmState, posture: Posture
    ) -> tuple[float, float]:
        """Factors at which speeds, (J,), respect the ranges of joints, and the workspace."""
        velocity = touch.jacobian @ speeds
        return (
            law.range_factor(self._chain, arm.angles, speeds, self._limits),
            law.workspace_factor(posture, touch.place, velocity, speeds, self._limits),
        )

    def _stand(self, reason: Reason, touch: _Touch | None = None) -> Command:
        """Stand."""
        self._speeds = self._still
        if self.state is State.MOVING:
            self.state = State.STANDING
        place, force = (None, None) if touch is None else touch[:2]
        return Command(
            speeds=self._still, state=self.state, reason=reason, place=place, force=force
        )

    def _forget_touch(self) -> None:
        """Forget the touch, which is over."""
        self._pushed, self._way = False, 0.0
        self._since, self._ended = None, None

    def _require_rest(self) -> None:
        """Raise unless the arm has rested untouched for a while."""
        if not self._now - self._resting >= _REST:
            raise ArgumentError(
                f"arm must rest, and the skin be untouched and read, for {_REST:g} s before"
            )

    @property
    def _armed(self) -> bool:
        return self.state is not State.DISARMED


def _largest(spread: Floats) -> float:
    """Largest variance along any direction of a covariance (2, 2)."""
    (a, b), (_, c) = spread.tolist()
    return float((a + c) / 2 + math.hypot((a - c) / 2, b))
