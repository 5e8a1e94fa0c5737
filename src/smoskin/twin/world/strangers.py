"""Contact laws that nobody calibrates for: made without a look at the family of `ScaleContact`."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Touches, check_on_skin, mean_shares, patch_points
from smoskin.origami.geometry import geometry
from smoskin.roles import ContactLaw


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Warped(ContactLaw):
    """Bilinear shares of a place that is warped between vertices, and levered past the rim.

    Between two vertices the way xi becomes ``(1 - s) t + s (3 t^2 - 2 t^3)`` with t = xi cut, so
    that next to a vertex that one takes everything. It raises an `ArgumentError` if a number
    lies outside its range.
    """

    smooth: float = 0.0
    """Share s of a smoothstep in the way from vertex to vertex, 0 to 1."""
    cut: float = 0.0
    """Share of a vertex' distance from the next on which it takes everything, 0 to 0.4."""
    lever: float = 1.0
    """Length of the lever past the rim over the whole one, 0 to 2."""

    def __post_init__(self) -> None:
        for name, most in (("smooth", 1.0), ("cut", 0.4), ("lever", 2.0)):
            if not 0.0 <= (value := getattr(self, name)) <= most:
                raise ArgumentError(f"{name} must lie in [0, {most}]; got {value}")

    def shares(self, design: SkinDesign, touches: Touches) -> Floats:
        """As `ContactLaw.shares`."""
        check_on_skin(design, touches)
        points = patch_points(touches, touches.radius)
        lines = geometry(design).lines
        return mean_shares(design, np.stack([
            self._warp(line, points[..., axis]) for axis, line in enumerate(lines)
        ], axis=-1))  # fmt: skip

    def _warp(self, line: Floats, where: Floats) -> Floats:
        """A place (...), m, as the warp has it on a line of vertices (L,), m."""
        if len(line) == 1:
            return where
        inside = np.clip(where, line[0], line[-1])
        before = np.clip(np.searchsorted(line, inside, side="right") - 1, 0, len(line) - 2)
        pitch = np.diff(line)[before]
        way = np.clip(((inside - line[before]) / pitch - self.cut) / (1 - 2 * self.cut), 0.0, 1.0)
        way = way + self.smooth * (3 * way**2 - 2 * way**3 - way)
        return np.asarray(line[before] + pitch * way + self.lever * (where - inside))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Gaussian(ContactLaw):
    """Shares by a Gaussian of each vertex' distance, that sum to 1; past the rim all but level."""

    width: float = 10e-3
    """Standard deviation, m."""

    def __post_init__(self) -> None:
        if not 0.0 < self.width < np.inf:
            raise ArgumentError(f"width must be positive and finite; got {self.width}")

    def shares(self, design: SkinDesign, touches: Touches) -> Floats:
        """As `ContactLaw.shares`."""
        check_on_skin(design, touches)
        points = patch_points(touches, touches.radius)[..., None, None, :]
        square = ((points - geometry(design).tops) ** 2).sum(axis=-1) / (2 * self.width**2)
        weights = np.exp(square.min(axis=(-2, -1), keepdims=True) - square)
        weights /= weights.sum(axis=(-2, -1), keepdims=True)
        return np.asarray(weights.mean(axis=2))


STRANGERS: Final[dict[str, ContactLaw]] = {
    "smoothstep-half": Warped(smooth=0.5),
    "smoothstep": Warped(smooth=1.0),
    "tight": Warped(cut=0.15),
    "half-lever": Warped(lever=0.5),
    "no-lever": Warped(lever=0.0),
    "gaussian": Gaussian(),
}
"""Laws outside the family, by the names of the worlds in which they rule alone."""
