"""The zero: what a skin reads while nothing touches it, and how that is followed.

Decides how fast and how far a zero follows readings that count as idle, and which count so: those
within a band of it, or those that its noise explains. The longer nothing was idle, the farther the
zero may have moved unseen, and the more is taken for idle, so that a zero that moved under a touch
is found again. A field that changes alike at all chips is the Earth's, of a skin that turns: it is
idle and soon followed. Hides the memory that this needs.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError

EARTH: Final = 100e-6
"""Spread u along each axis, T, of what a skin that turns in the Earth's field sees change at all of
its chips alike: a field of 25 to 65 uT turned over changes by twice as much."""
_TURNED: Final = 8e-6
"""Change of the field at all chips alike, T, past which the zero follows at once."""
_TURNING: Final = 0.05
"""Time constant, s, with which it then follows."""
_SMALL: Final = 0.05
"""Share of what a touch left below which the zero follows at its own pace again."""
_WILD: Final = 1e5
"""Seconds without a reading after which none is taken for a zero's pace: a clock has jumped."""


def uniform_covariance(chips: int, spread: float) -> Floats:
    """Covariance u^2 (1 1^T) x I of a field that is the same at all chips, (3 S, 3 S), T^2."""
    return np.kron(np.full((chips, chips), spread**2), np.eye(3))


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
    """Time constant of the exponential mean that the zero follows with, s; `inf` keeps it still."""
    drift_bound: float = 500e-6
    """Distance from its start, T, past which the zero is no longer believed."""
    widening_rate: float = 1e-6
    """Speed, T/s, at which a zero may move unseen while nothing is idle."""
    widening_limit: float = 40e-6
    """Farthest that it may have moved so, T: a steady touch that is fainter becomes the zero."""
    residue: float = 0.0
    """How far a touch leaves it off, T; the zero is soon taken anew once nothing touches."""

    def __post_init__(self) -> None:
        for name in ("time_constant", "drift_bound"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive; got {getattr(self, name)}")
        for name in ("hold", "widening_rate", "widening_limit", "residue"):
            if not getattr(self, name) >= 0:
                raise ArgumentError(f"{name} must be >= 0; got {getattr(self, name)}")


IdleTest: TypeAlias = Callable[[Floats, float], bool]
"""Whether a change from the zero, T, is that of an idle sensor, if the zero may have moved so far
unseen, T."""


class IdleBand:
    """Takes for idle what changes by less than a field, T, on every axis.

    With `uniform` a field that is the same at all chips, in the skin's axes, may change besides.

    Raises
    ------
    ArgumentError
        If the field is not positive.
    """

    def __init__(self, field: float = 40e-6, *, uniform: bool = False) -> None:
        if not field > 0:
            raise ArgumentError(f"idle_field must be positive; got {field} T")
        self._field, self._uniform = field, uniform

    def __call__(self, change: Floats, unseen: float) -> bool:
        """Whether every axis changes by less than the band, wider by what moved unseen."""
        band = self._field + unseen
        # Plain numbers: for nine of them NumPy takes longer to start than Python to finish.
        values: list[float] = change.ravel().tolist()
        if all(abs(value) < band for value in values):
            return True
        if not self._uniform:
            return False
        for axis in range(3):
            along = values[axis::3]
            mean = sum(along) / len(along)
            if abs(mean) > 1.5 * EARTH or not all(abs(value - mean) < band for value in along):
                return False
        return True


class IdleNoise:
    """Takes for idle what the chips' noise explains.

    Parameters
    ----------
    noise : Floats, shape (C, C)
        Covariance N of an idle sensor's signals, T^2.
    chips : sequence of int
        Rows of a change that these signals are, C / 3 of them.
    false_alarms : float
        Chance of an idle reading not to be taken for one.

    Raises
    ------
    ArgumentError
        If the chance does not lie in (0, 1).

    Notes
    -----
    Idle where s^T (N + v^2 I + u^2 (1 1^T) x I)^-1 s is below the quantile of chi-square that only
    `false_alarms` exceed; v is how far the zero may have moved unseen, u the spread of a field that
    is the same at all chips (`EARTH`). It leaves nothing to tell along three of the C directions of
    two or more chips; a single chip's u is 0.
    """

    def __init__(self, noise: Floats, chips: Sequence[int], false_alarms: float) -> None:
        if not 0.0 < false_alarms < 1.0:
            raise ArgumentError(f"false_alarms must lie in (0, 1); got {false_alarms}")
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.stats import chi2

        self._chips = list(chips)
        told = len(noise)
        if len(self._chips) > 1:
            noise, told = noise + uniform_covariance(len(self._chips), EARTH), told - 3
        self._variances, axes = np.linalg.eigh(noise)
        self._axes = np.ascontiguousarray(axes.T)
        self._limit = float(chi2.isf(false_alarms, told))

    def __call__(self, change: Floats, unseen: float) -> bool:
        """Whether noise, and what moved unseen, explain a change, (S, 3), T."""
        along = self._axes @ change[self._chips].ravel()
        return float(along @ (along / (self._variances + unseen**2))) < self._limit


class Zero:
    """An offset that follows what is read while nothing touches.

    Parameters
    ----------
    idle : IdleTest or None
        Which readings count as idle; None: none do.
    offset : Floats, any shape
        T: the zero to start from.
    uniform : bool
        Whether it soon follows a field that is the same at all chips, in offsets (S, 3).

    Examples
    --------
    >>> zero = Zero(ZeroTracking(hold=0.0, time_constant=1.0), IdleBand(), np.zeros(3))
    >>> [zero.step(float(t), np.full(3, 2e-5)) for t in range(9)] == [True] * 9
    True
    >>> bool(np.allclose(zero.offset, 2e-5, rtol=1e-3))
    True
    """

    def __init__(
        self,
        tracking: ZeroTracking,
        idle: IdleTest | None,
        offset: Floats,
        *,
        uniform: bool = False,
    ) -> None:
        self.tracking = tracking
        self.offset = offset
        """The present zero, T."""
        self.believed = True
        """Whether it has stayed within its bound."""
        self._idle, self._uniform = idle, uniform
        self._start = offset
        self._unseen = self._left = 0.0
        self._last_time: float | None = None
        self._idle_since: float | None = None

    @property
    def drift(self) -> Floats:
        """How far it has moved since the start, T."""
        return np.asarray(self.offset - self._start)

    def step(self, time: float, read: Floats) -> bool:
        """Whether a reading, in T, is idle; the zero follows it once idleness has held."""
        unseen = math.hypot(self._unseen, self._left)
        if self._idle is None or not self._idle(read - self.offset, unseen):
            self.interrupt(time)
            return False
        elapsed = self._elapsed(time)
        if self._idle_since is None:
            self._idle_since = time
        if time - self._idle_since >= self.tracking.hold:
            pace = self.tracking.time_constant
            if self._left > _SMALL * self.tracking.residue:
                pace = min(pace, _TURNING)
            kept = math.exp(-elapsed / pace)
            self._left *= kept
            if self._uniform and kept < 1:
                self._turn(elapsed, read)
            self.offset = read + kept * (self.offset - read)
            self.believed = float(np.abs(self.drift).max()) <= self.tracking.drift_bound
            # At the zero's own pace: sooner, and the zero would run out of the band.
            self._unseen *= kept
        return True

    def rest(self) -> None:
        """Forget when readings came, as their clock starts again; the zero stays."""
        self._last_time = self._idle_since = None

    def interrupt(self, time: float) -> None:
        """Begin idleness anew, as nothing idle was read: the zero may move unseen meanwhile."""
        elapsed = self._elapsed(time)
        self._idle_since = None
        self._left = self.tracking.residue
        if self.tracking.time_constant < math.inf:
            wider = self._unseen + self.tracking.widening_rate * elapsed
            self._unseen = min(wider, self.tracking.widening_limit)

    def _elapsed(self, time: float) -> float:
        """Seconds since the last reading of any kind."""
        elapsed = 0.0 if self._last_time is None else time - self._last_time
        self._last_time = time
        return elapsed if elapsed < _WILD else 0.0

    def _turn(self, elapsed: float, read: Floats) -> None:
        """Follow a field that has changed at all chips alike."""
        common = (read - self.offset).mean(axis=0)
        if (common @ common) > _TURNED**2:
            self.offset = self.offset - common * math.expm1(-elapsed / _TURNING)
