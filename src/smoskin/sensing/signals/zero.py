"""The zero: what a skin reads while nothing touches it, and how that is followed.

Decides how fast and how far a zero follows readings that count as idle, and which count so: those
within a band of it, or those that its noise explains. The longer nothing was idle, the farther the
zero may have moved unseen, and the more is taken for idle, so that a zero that moved under a touch
is found again. Hides the memory that this needs.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError


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

    def __post_init__(self) -> None:
        for name in ("time_constant", "drift_bound"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive; got {getattr(self, name)}")
        for name in ("hold", "widening_rate", "widening_limit"):
            if not getattr(self, name) >= 0:
                raise ArgumentError(f"{name} must be >= 0; got {getattr(self, name)}")


IdleTest: TypeAlias = Callable[[Floats, float], bool]
"""Whether a change from the zero, T, is that of an idle sensor, if the zero may have moved so far
unseen, T."""


class IdleBand:
    """Takes for idle what changes by less than a field, T, on every axis.

    Raises
    ------
    ArgumentError
        If the field is not positive.
    """

    def __init__(self, field: float = 40e-6) -> None:
        if not field > 0:
            raise ArgumentError(f"idle_field must be positive; got {field} T")
        self._field = field

    def __call__(self, change: Floats, unseen: float) -> bool:
        """Whether every axis changes by less than the band, wider by what moved unseen."""
        band = self._field + unseen
        # Plain numbers: for nine of them NumPy takes longer to start than Python to finish.
        return all(abs(value) < band for value in change.ravel().tolist())


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
    Idle where s^T (N + u^2 I)^-1 s, which is chi-square of C, is below the quantile that only
    `false_alarms` exceed; u is how far the zero may have moved unseen.
    """

    def __init__(self, noise: Floats, chips: Sequence[int], false_alarms: float) -> None:
        if not 0.0 < false_alarms < 1.0:
            raise ArgumentError(f"false_alarms must lie in (0, 1); got {false_alarms}")
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.stats import chi2

        self._chips = list(chips)
        self._variances, axes = np.linalg.eigh(noise)
        self._axes = np.ascontiguousarray(axes.T)
        self._limit = float(chi2.isf(false_alarms, len(noise)))

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

    Examples
    --------
    >>> zero = Zero(ZeroTracking(hold=0.0, time_constant=1.0), IdleBand(), np.zeros(3))
    >>> [zero.step(float(t), np.full(3, 2e-5)) for t in range(9)] == [True] * 9
    True
    >>> bool(np.allclose(zero.offset, 2e-5, rtol=1e-3))
    True
    """

    def __init__(self, tracking: ZeroTracking, idle: IdleTest | None, offset: Floats) -> None:
        self.tracking = tracking
        self.offset = offset
        """The present zero, T."""
        self.believed = True
        """Whether it has stayed within its bound."""
        self._idle = idle
        self._start = offset
        self._unseen = 0.0
        self._last_time: float | None = None
        self._idle_since: float | None = None

    @property
    def drift(self) -> Floats:
        """How far it has moved since the start, T."""
        return np.asarray(self.offset - self._start)

    def step(self, time: float, read: Floats) -> bool:
        """Whether a reading, in T, is idle; the zero follows it once idleness has held."""
        if self._idle is None or not self._idle(read - self.offset, self._unseen):
            self.interrupt(time)
            return False
        elapsed = self._elapsed(time)
        if self._idle_since is None:
            self._idle_since = time
        if time - self._idle_since >= self.tracking.hold:
            kept = math.exp(-elapsed / self.tracking.time_constant)
            self.offset = read + kept * (self.offset - read)
            self.believed = float(np.abs(self.drift).max()) <= self.tracking.drift_bound
            # At the zero's own pace: sooner, and the zero would run out of the band.
            self._unseen *= kept
        return True

    def interrupt(self, time: float) -> None:
        """Begin idleness anew, as nothing idle was read: the zero may move unseen meanwhile."""
        elapsed = self._elapsed(time)
        self._idle_since = None
        if self.tracking.time_constant < math.inf:
            wider = self._unseen + self.tracking.widening_rate * elapsed
            self._unseen = min(wider, self.tracking.widening_limit)

    def _elapsed(self, time: float) -> float:
        """Seconds since the last reading of any kind."""
        elapsed = 0.0 if self._last_time is None else time - self._last_time
        self._last_time = time
        return elapsed
