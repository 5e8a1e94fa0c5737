"""What is believed of touches before a reading, and what is known of them after it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError


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

    def __post_init__(self) -> None:
        if not 0 <= self.drag_spread < math.inf:
            raise ArgumentError(f"drag_spread must be finite and >= 0 N; got {self.drag_spread}")
        if not self.slide > 0:
            raise ArgumentError(f"slide must be positive; got {self.slide} m")
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


class Standing(NamedTuple):
    """Place of a touch while it was alone, a moment ago."""

    place: Floats
    """Its place, (2,), m."""
    spread: Floats
    """Covariance, (2, 2), m^2, with how far it may have moved since."""

    @property
    def precision(self) -> Floats:
        """Inverse of the covariance, (2, 2), m^-2."""
        return np.asarray(np.linalg.inv(self.spread))
