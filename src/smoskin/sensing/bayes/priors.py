"""What is believed of touches before a reading, and what is said of them after it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

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
    """N: standard deviation of each drag of a single touch; 0: touches are known to be straight.
    Two touches at once are always taken as straight."""
    chances: tuple[float, float, float] = (0.5, 0.45, 0.05)
    """Of no, one and two touches."""
    slide: float = 5e-3
    """m: standard deviation along each axis by which a touch moves in a second after another has
    joined it; infinite: where it was while alone is not used."""

    def __post_init__(self) -> None:
        if not 0 <= self.drag_spread < math.inf:
            raise ArgumentError(f"drag_spread must be finite and >= 0 N; got {self.drag_spread}")
        if not self.slide > 0:
            raise ArgumentError(f"slide must be positive; got {self.slide} m")
        if min(self.chances) < 0 or abs(sum(self.chances) - 1) > 1e-9:
            raise ArgumentError(f"chances must add up to 1; got {self.chances}")


class TouchPosterior(NamedTuple):
    """What one reading says of T touches."""

    values: Floats
    """(T, 5): x, y, Fx, Fy, Fz of each, m and N."""
    covariance: Floats
    """(T, 5, 5), likewise."""
    misfit: float
    """Sum of squared residuals in standard deviations."""
    evidence: float
    """Logarithm of how likely so many touches make the reading, and of their prior chance."""


class Standing(NamedTuple):
    """Where a touch stood while it was alone, a moment ago."""

    place: Floats
    """(2,), m."""
    spread: Floats
    """(2, 2), m^2: covariance, with how far it may have moved since."""
