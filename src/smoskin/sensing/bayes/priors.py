"""What is believed of touches before a reading, and what is known of them after it."""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError

_ALIKE: Final = 2.0
"""Standard deviations within which two descents have come to one place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchPriors:
    """What is believed of touches before anything is read.

    Raises
    ------
    ArgumentError
        If a number is negative or the chances do not add up to 1.
    """

    drag_spread: float = 0.3
    """Standard deviation of each drag of a single touch, N; 0: touches are known to be straight.
    Two touches at once are always taken as straight."""
    chances: tuple[float, float, float] = (0.5, 0.45, 0.05)
    """Chances p(K) of K = 0, 1 and 2 touches."""
    slide: float = 5e-3
    """Standard deviation along each axis, m, by which a touch moves in a second after another has
    joined it; infinite: its place while it was alone is not used."""
    wander: float = 1e-3
    """Standard deviation along each axis, m, by which a touch that rests moves in a second;
    infinite: every reading of it stands for itself."""

    def __post_init__(self) -> None:
        if not 0 <= self.drag_spread < math.inf:
            raise ArgumentError(f"drag_spread must be finite and >= 0 N; got {self.drag_spread}")
        for name in ("slide", "wander"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive; got {getattr(self, name)} m")
        if min(self.chances) < 0 or abs(sum(self.chances) - 1) > 1e-9:
            raise ArgumentError(f"chances must add up to 1; got {self.chances}")


class TouchPosterior(NamedTuple):
    """What one reading tells of K touches."""

    values: Floats
    """Touch vectors t = (x, y, Fx, Fy, Fz), (K, 5), m and N."""
    covariance: Floats
    """Covariance of each, (K, 5, 5), likewise."""
    misfit: float
    """Squared length of the whitened residual, and of drags in their prior's spread."""
    evidence: float
    """Logarithm of p(s | K) p(K)."""
    share: float = 1.0
    """Probability of these rather than of others that explain the reading about as well."""
    others: tuple["TouchPosterior", ...] = ()
    """Those others, their touches in the same order."""

    @property
    def guesses(self) -> Floats:
        """Touches from where those of the next reading are sought, (1 + others, K, 5)."""
        return np.stack([self.values, *(other.values for other in self.others)])

    def in_order_of(self, first: "TouchPosterior") -> "TouchPosterior":
        """The same two touches, each named after the nearer of others."""
        away = np.hypot(*(self.values[:, None, :2] - first.values[:, :2]).transpose(2, 0, 1))
        if away.trace() <= away[::-1].trace():
            return self
        return self._replace(values=self.values[::-1], covariance=self.covariance[::-1])

    def is_at(self, first: "TouchPosterior") -> bool:
        """Whether its places are those of other touches, as far as these are known."""
        away = (self.values - first.values)[:, :2]
        sure = np.linalg.solve(first.covariance[:, :2, :2], away[..., None])[..., 0]
        return bool(((away * sure).sum(axis=1) < _ALIKE**2).all())


class Standing(NamedTuple):
    """Place of a touch while it was alone, a moment ago."""

    place: Floats
    """Its place, (2,), m."""
    precision: Floats
    """Inverse of its covariance, which counts how far it may have moved since, (2, 2), m^-2."""
