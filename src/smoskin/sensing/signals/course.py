"""A zero that moves: its value, speed and acceleration, each a Gaussian, and how they go on.

Decides how a turn goes on that nothing shows, and how an idle reading corrects it. Hides the
blocks of the Kalman filter.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats, solve_definite

_LASTS: Final = 3.0
"""Time constant with which a speed is lost, s."""
_STEADY: Final = 2.0
"""Time constant with which an acceleration is lost, s."""
ACCELERATION: Final = 0.08
"""Standard deviation of the acceleration of a skin that turns, rad/s^2."""
_NODES, _WEIGHTS = (part / 2 for part in np.polynomial.legendre.leggauss(5))
_NODES = (_NODES + 0.5).tolist()


def _path(time: float) -> tuple[float, float, float]:
    """Value, speed and acceleration so many seconds after an acceleration of 1."""
    slow, fast = math.exp(-time / _LASTS), math.exp(-time / _STEADY)
    share = 1 / (1 / _STEADY - 1 / _LASTS)
    gone = share * (_LASTS * (1 - slow) - _STEADY * (1 - fast))
    return gone, share * (slow - fast), fast


def transition(elapsed: float) -> Floats:
    """What value, speed and acceleration become of each other after so many seconds, (3, 3)."""
    kept = math.exp(-elapsed / _LASTS)
    gone, speed, still = _path(elapsed)
    return np.array([[1.0, _LASTS * (1 - kept), gone], [0.0, kept, speed], [0.0, 0.0, still]])


def scatter(elapsed: float) -> Floats:
    """Covariance (3, 3) that accelerations add in so many seconds to a turn by a radian.

    They are white jerks of power 2 A^2 / tau, A their standard deviation, tau their time constant.
    """
    paths = np.array([_path(elapsed * node) for node in _NODES])
    power = 2 * ACCELERATION**2 / _STEADY * elapsed
    return np.asarray(power * (_WEIGHTS * paths.T) @ paths)


def turned(elapsed: float) -> Floats:
    """Covariance (3, 3) of a turn by a radian that began so many seconds ago."""
    began = transition(elapsed)[:, 2]
    return scatter(elapsed) + ACCELERATION**2 * np.outer(began, began)


def burst(power: float, duration: float) -> Floats:
    """Covariance (3, 3) after accelerations of a power, rad^2/s^3, white over the duration, s.

    Those of a turn that goes on join them.
    """
    added = np.zeros((3, 3))
    added[0, 0] = power * duration**3 / 3
    added[0, 1] = added[1, 0] = power * duration**2 / 2
    added[1, 1] = power * duration
    added[2, 2] = ACCELERATION**2
    return added


class Course(NamedTuple):
    """A zero z, its speed and its acceleration."""

    mean: Floats
    """(3, C): T, T/s, T/s^2."""
    spread: Floats
    """(3, 3, C, C): covariances of the three with each other."""

    @classmethod
    def still(cls, offset: Floats, zero: Floats, speed: Floats) -> "Course":
        """One at a zero (C,), T, with covariances of zero and speed, (C, C)."""
        spread = np.zeros((3, 3, *zero.shape))
        spread[0, 0], spread[1, 1] = zero, speed
        return cls(np.stack([offset, np.zeros_like(offset), np.zeros_like(offset)]), spread)

    @property
    def zero(self) -> Floats:
        """Covariance of the zero, (C, C), T^2."""
        return np.asarray(self.spread[0, 0])

    def later(self, elapsed: float) -> "Course":
        """The same so many seconds later, if nothing else turns it."""
        onward = transition(elapsed)
        shape = self.spread.shape
        gone = (onward @ self.spread.reshape(3, -1)).reshape(3, 3, -1)
        return Course(onward @ self.mean, (onward @ gone).reshape(shape))

    def wider(self, added: Floats, along: Floats) -> "Course":
        """The same with covariances (3, 3) more along a pattern's (C, C)."""
        return self._replace(spread=self.spread + added[:, :, None, None] * along)

    def unsure(self, added: Floats) -> "Course":
        """The same with a covariance (C, C) more of the zero."""
        spread = self.spread.copy()
        spread[0, 0] += added
        return self._replace(spread=spread)

    def corrected(self, change: Floats, noise: Floats, fading: float) -> "Course":
        """The same once a change (C,), T, of this noise was read; `fading` widens it before."""
        size = len(change)
        met = fading * self.spread[:, 0].reshape(-1, size)
        gains = solve_definite(met[:size] + noise, met.T).T
        mean = self.mean + (gains @ change).reshape(3, size)
        less = (gains @ met.T).reshape(3, size, 3, size).swapaxes(1, 2)
        spread = fading * self.spread - less
        return Course(mean, (spread + spread.transpose(1, 0, 3, 2)) / 2)
