"""The zero: what a skin reads while nothing touches it, followed by a Kalman filter.

Decides which readings are idle, how fast and how far the zero follows them, and how sure it is.
While something touches, the zero goes on as fast as it went. A skin that turns is followed along
what its weight and the Earth's field change. Hides the filter.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from smoskin.arrays import Floats, log_density, solve_definite
from smoskin.errors import ArgumentError
from smoskin.sensing.signals.course import Course, burst, scatter, turned
from smoskin.sensing.signals.idle import IdleTest
from smoskin.sensing.signals.turning import Turning, TurnsSeen

_CALM: Final = 0.8
"""Share of an idle reading's limit past which a turn is looked for."""
_BEYOND: Final = 10.0
"""The same share past which none is, where all of them together leave a reading there."""
_JERK: Final = 0.8**2
"""Power of accelerations with which a turn starts or stops, rad^2/s^3."""
_JERKS: Final = (0.1, 0.3)
"""Shortest and longest time for which they may have lasted unnoticed, s."""
_GOES_ON: Final = 2.0
"""Time for which a turn is taken to go on once it was seen, s."""
_MOVES: Final = 3.0
"""Squared speed, of its variance along each axis, past which the skin turns still."""
_SLOW: Final = 0.01
"""Variance of speeds that do not count, of the noise's, 1/s^2."""
_UNNOTICED: Final = 1.0
"""Longest time for which a turn may have gone on under a touch before it was seen, s."""
_FARTHEST: Final = 6.0
"""Turn, rad, up to which a zero is believed."""
_BELIEVED: Final = (0.3, 3)
"""Time, s, and idle readings for which a turn must have held, not to be a touch's beginning."""
_TAKEN: Final = 20
"""Number of readings that zeros are taken from; for as many the chips' own noise counts."""
_HEARD: Final = 200
"""Idle readings over which louder noise is averaged."""
_LONG: Final = 20.0
"""Time constants after which nothing is known any more."""
_STAYS: Final = 0.3
"""Share of what a touch leaves by which the zero is unsure under the next. Touches of a rig on five
made skins are as likely with any share up to it, and less with more: what loops add under a touch
counts as what the table misses."""
_WILD: Final = 1e5
"""Seconds without a reading after which none is taken for a zero's pace: a clock has jumped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroTracking:
    """How a zero follows the sensor while nothing touches it.

    Raises
    ------
    ArgumentError
        If a number is not positive, or `hold` or what widens is negative.
    """

    hold: float = 1.0
    """Seconds of idleness before the zero starts to follow."""
    time_constant: float = 10.0
    """Time constant, s, with which the zero forgets readings; `inf` keeps it still."""
    drift_bound: float = 500e-6
    """Distance from its start, T, past which the zero is no longer believed, turns apart."""
    widening_rate: float = 1e-6
    """Speed, T/s, at which a zero may move unseen while nothing is idle."""
    widening_limit: float = 40e-6
    """Farthest that it may have moved so, T: a steady touch that is fainter becomes the zero."""
    arm: bool = False
    """Whether an arm carries the skin, so that its own weight moves it as it turns: that is
    followed, and a slow press may be taken for it. Else only fields may turn. Besides, its motors
    are heard: how much louder readings are than the chips alone is learned while idle."""

    def __post_init__(self) -> None:
        for name in ("time_constant", "drift_bound"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive; got {getattr(self, name)}")
        for name in ("hold", "widening_rate", "widening_limit"):
            if not getattr(self, name) >= 0:
                raise ArgumentError(f"{name} must be >= 0; got {getattr(self, name)}")


TouchTest: TypeAlias = Callable[[Floats, float], bool]
"""Whether a change (C,), T, is likelier a touch's than a turn's, given the logarithm of the density
of such changes by a turn."""


@dataclass(slots=True)
class _Steady:
    """What the zero is if a turn that has just begun is none: a touch begins or ends slowly too."""

    course: Course
    turn: Floats | None
    turn_seen: float
    idle_until: float
    began: float
    """Time of the turn's first idle reading, s."""
    readings: int = 0
    """Idle readings since."""


class Zero:
    """A zero that is followed while nothing touches.

    Parameters
    ----------
    idle : IdleTest or None
        Which readings count as idle; None: none do.
    offset : Floats, shape (C,)
        T: the zero to start from.
    noise : Floats, shape (C, C)
        Covariance N of an idle sensor's readings, T^2.
    turning : Turning, optional
        What a turn of the skin changes; by default nothing.
    left : Floats, shape (C, C), optional
        Covariance L of what a touch leaves, T^2; by default nothing.
    touched : TouchTest, optional
        Decision between a touch and a turn about an axis about which the skin has not turned yet;
        by default it is a turn.

    Notes
    -----
    The state is the zero z, its speed v and acceleration a, ``dz/dt = v``, ``dv/dt = a - v / T``
    and ``da/dt = -a / tau + w``, with w white along what turns change where the skin turns; "The
    zero" in `docs/derivations.md`.

    Examples
    --------
    >>> from smoskin.sensing.signals.idle import IdleBand
    >>> tracking = ZeroTracking(hold=0.0, time_constant=1.0)
    >>> zero = Zero(tracking, IdleBand(), np.zeros(3), 1e-12 * np.eye(3))
    >>> [zero.step(float(t), np.full(3, 2e-5)) for t in range(9)] == [True] * 9
    True
    >>> bool(np.allclose(zero.offset, 2e-5, rtol=1e-2))
    True
    """

    def __init__(
        self,
        tracking: ZeroTracking,
        idle: IdleTest | None,
        offset: Floats,
        noise: Floats,
        *,
        turning: Turning | None = None,
        left: Floats | None = None,
        touched: TouchTest | None = None,
    ) -> None:
        self.tracking = tracking
        self.believed = True
        """Whether it has stayed within its bound."""
        self._idle: IdleTest = idle or (lambda change, unsure: math.inf)
        self._noise, self._turning = noise, turning
        self._seen = TurnsSeen(turning) if turning is not None and turning.weighs else None
        self._likelier_touched = touched
        self.left = np.zeros_like(noise) if left is None else left
        """Covariance L of what a touch leaves, T^2."""
        bound = tracking.drift_bound**2 * np.eye(len(noise))
        if turning is not None:
            bound = bound + _FARTHEST**2 * turning.whole
        self._bound = np.linalg.inv(bound)
        self._start = offset
        self._louder = np.zeros_like(noise)
        self._posed = self._jolted = np.zeros_like(noise)
        self._heard = 0
        self._touched = False
        self._unseen = 0.0
        self._come_to_rest(offset)

    @property
    def offset(self) -> Floats:
        """The present zero, (C,), T."""
        return np.asarray(self._course.mean[0])

    @property
    def drift(self) -> Floats:
        """How far it has moved since the start, T."""
        return np.asarray(self.offset - self._start)

    @property
    def settled(self) -> bool:
        """Whether it has followed what was read since something touched last."""
        return not self._touched

    @property
    def covariance(self) -> Floats:
        """Covariance of what is read under a touch besides its own and the chips' noise, T^2.

        (C, C): that of the zero, P, of what touches leave under others, and of noise that is not
        the chips'.
        """
        return self._unsure(self._course, _STAYS)

    def rest(self) -> None:
        """Forget when readings came, as their clock starts again; the zero stays."""
        self._come_to_rest(self.offset)

    def _come_to_rest(self, offset: Floats) -> None:
        self._last_time: float | None = None
        self._idle_since: float | None = None
        self._idle_until = -math.inf
        taken = self._noise / _TAKEN
        self._course = Course.still(offset, taken, taken if self._turning else 0 * taken)
        self._turn: Floats | None = None
        self._turn_seen = -math.inf
        self._steady: _Steady | None = None

    @property
    def turned(self) -> Floats:
        """What a turn that has just begun, under what touches the skin, adds to it."""
        return self._begun().zero - self._course.zero

    def stir(self) -> None:
        """Take the skin to have just begun to turn."""
        if self._turning is not None and self._last_time is not None:
            self._keep(math.inf)
            self._course, self._turn = self._begun(), self._turning.whole
            self._turn_seen = self._last_time

    def _begun(self) -> Course:
        """What is known of the zero of a skin that has just begun to turn."""
        if self._turning is None or self._last_time is None:
            return self._course
        unnoticed = min(self._last_time - self._idle_until, _UNNOTICED)
        return self._course.wider(turned(unnoticed), self._turning.whole)

    def _unsure(self, course: Course, stays: float = 1.0) -> Floats:
        """Covariance of a reading besides the chips' noise, if the zero goes this way.

        Of what a touch leaves so much stays: untouched all of it.
        """
        unsure = course.zero + self._louder + self._posed
        return unsure + stays * self.left if self._touched else unsure

    def carried(self, posed: Floats, jolted: Floats) -> None:
        """Take what is not known of an arm's pose into account, and what jolts may add, untouched.

        Both are covariances (C, C), T^2, of the next reading.
        """
        self._posed, self._jolted = posed, jolted

    def step(self, time: float, read: Floats) -> bool:
        """Whether a reading (C,), T, is idle; the zero follows it once idleness has held."""
        elapsed = self._elapsed(time)
        self._go_on(elapsed)
        if self._steady is not None and self._explains(self._steady, read):
            self._return()
        change = read - self.offset
        if not self._explained(time, elapsed, change):
            if self._idle_since is not None:
                self._return()
            self._leave(elapsed)
            return False
        if self._idle_since is None:
            self._idle_since = time
        self._idle_until = time
        self._believe(time)
        held = time - self._idle_since >= self.tracking.hold
        if held and self.tracking.time_constant < math.inf:
            self._follow(time, elapsed, change)
        return True

    def interrupt(self, time: float) -> None:
        """Begin idleness anew, as nothing idle was read: the zero may move unseen meanwhile."""
        elapsed = self._elapsed(time)
        self._go_on(elapsed)
        self._leave(elapsed)

    def _elapsed(self, time: float) -> float:
        """Seconds since the last reading of any kind."""
        elapsed = 0.0 if self._last_time is None else time - self._last_time
        self._last_time = time
        return elapsed if elapsed < _WILD else 0.0

    def _go_on(self, elapsed: float) -> None:
        """Let the zero move as it did."""
        self._course = self._course.later(elapsed)
        if (steady := self._steady) is not None:
            steady.course = steady.course.later(elapsed)
            if steady.turn is not None:
                steady.course = steady.course.wider(scatter(elapsed), self._along(steady.turn))

    def _along(self, turn: Floats) -> Floats:
        """What a turn that goes on changes, by all that was seen of it."""
        seen = self._seen
        return turn if seen is None or turn is not seen.before else seen.whole

    def _keep(self, began: float, course: Course | None = None) -> None:
        """Remember the zero from before a turn, until that is believed."""
        if self._steady is None:
            self._steady = _Steady(
                course or self._course,
                self._turn,
                self._turn_seen,
                self._idle_until,
                began,
            )

    def _explains(self, steady: _Steady, read: Floats) -> bool:
        """Whether a reading needs no turn."""
        course = steady.course
        return self._idle(read - course.mean[0], self._unsure(course)) < _CALM

    def _return(self) -> None:
        """Take a turn back that was none."""
        if (steady := self._steady) is not None:
            self._course = steady.course
            self._turn, self._turn_seen = steady.turn, steady.turn_seen
            self._idle_until = steady.idle_until
            self._steady = None

    def _believe(self, time: float) -> None:
        """Count an idle reading towards the turn."""
        if (steady := self._steady) is not None:
            steady.began, steady.readings = min(steady.began, time), steady.readings + 1
            if time - steady.began >= _BELIEVED[0] and steady.readings >= _BELIEVED[1]:
                self._steady = None

    def _explained(self, time: float, elapsed: float, change: Floats) -> bool:
        """Whether a change is idle; a turn that explains it makes the zero less sure."""
        still = self._course
        share = self._idle(change, self._unsure(still) + self._jolted)
        if time - self._turn_seen > _GOES_ON:
            self._turn = None
        if self._turn is not None:
            self._course = still.wider(scatter(elapsed), self._along(self._turn))
        if share < _CALM or self._turning is None:
            return share < 1.0
        share = self._idle(change, self._unsure(self._course))
        course, turn = self._course, self._turn
        jerk = burst(_JERK, min(max(elapsed, _JERKS[0]), _JERKS[1]))
        if share > _BEYOND and self._idle(change, self._at_most(self._turning, jerk)) > _BEYOND:
            return False
        for before, of, whole in self._turns(self._turning, still):
            if share < _CALM:
                break
            unsure = before.zero + jerk[0, 0] * of + self._louder
            now = self._idle(change, unsure)
            if now < min(share, 1.0) and self._turns_so(change, unsure, of):
                course, share = before.wider(jerk, of), now
                turn = self._turning.whole if whole else of
        if share < 1.0 and turn is not None:
            if self._turn is None:
                self._keep(time, still)
            self._course, self._turn_seen = course, time
            if self._turn is not self._turning.whole:
                self._turn = turn
        return share < 1.0

    def _at_most(self, turning: Turning, jerk: Floats) -> Floats:
        """What no turn that begins or ends with a jerk exceeds, as a covariance of a reading."""
        field, whole = turning.field, turning.whole
        more = jerk[0, 0] * (field + whole + self._along(whole))
        return np.asarray(self._course.zero + field + more + self._louder)

    def _turns(self, turning: Turning, still: Course) -> Iterator[tuple[Course, Floats, bool]]:
        """What may turn with a jerk and so explain a change, from which zero, the likeliest first.

        A turn starts or stops, in the Earth's field alone or with the skin's weight, about the axes
        that were seen; or the skin is handed over, which may leave it in any pose; or it turns
        about another axis. With each comes whether its weight takes part.
        """
        yield self._course, turning.field, False
        yield self._course, self._along(turning.whole), True
        yield still.unsure(turning.field), turning.field, False
        yield self._course, turning.whole, True

    def _turns_so(self, change: Floats, unsure: Floats, turn: Floats) -> bool:
        """Whether a change that such a turn explains is not likelier a touch's.

        That is asked of turns about another axis, once some axis is known.
        """
        seen, touched = self._seen, self._likelier_touched
        if seen is None or touched is None or turn is not seen.before or turn is seen.whole:
            return True
        return not touched(change, log_density(change, self._noise + unsure))

    def _leave(self, elapsed: float) -> None:
        """Be less sure of a zero that nothing idle showed."""
        self._idle_since, self._touched = None, True
        if self.tracking.time_constant < math.inf:
            wider = self._unseen + self.tracking.widening_rate * elapsed
            wider, before = min(wider, self.tracking.widening_limit), self._unseen
            added = (wider**2 - before**2) * np.eye(len(self._noise))
            self._course = self._course.unsure(added)
            self._unseen = wider

    def _follow(self, time: float, elapsed: float, change: Floats) -> None:
        """Take in an idle change; what was known before fades by the time constant."""
        fading = math.exp(min(elapsed / self.tracking.time_constant, _LONG))
        course = self._course.unsure(self.left) if self._touched else self._course
        if self.tracking.arm:
            self._listen(change, course.zero + self._posed + self._jolted)
        # What poses may explain is for whoever learns them.
        noise = self._noise + self._louder + self._posed + self._jolted
        self._course = course = course.corrected(change, noise, fading)
        self._touched, self._unseen = False, 0.0
        if self._turn is not None:
            speed, spread = course.mean[1], course.spread[1, 1]
            moves = speed @ solve_definite(spread + _SLOW * self._noise, speed)
            if moves > _MOVES * len(speed):
                self._turn_seen = time
                if self._seen is not None:
                    self._seen.learn(elapsed, speed, spread)
        drift = self.drift
        self.believed = float(drift @ self._bound @ drift) <= 1.0

    def _listen(self, change: Floats, zero: Floats) -> None:
        """Learn from an idle change how much louder readings are than the chips alone.

        A step of expectation-maximization: the noise that is likely in a change, and its spread.
        """
        self._heard = min(self._heard + 1, _HEARD)
        noise = self._noise + self._louder
        share = solve_definite(zero + noise, noise).T
        likely = share @ change
        expected = np.outer(likely, likely) + noise - share @ noise
        more = self._louder + (expected - noise) / (_TAKEN + self._heard)
        powers, axes = np.linalg.eigh(more)
        self._louder = (axes * np.maximum(powers, 0.0)) @ axes.T
