"""How well any estimator could do: the Cramer-Rao bound over the skin, from a response table.

The bound is the inverse of the information that the signals of one reading carry about a touch's
place, drag and normal force. Past the outermost vertices they carry none about the place across
the rim: those regions are named blind, and the place there is only known to lie in them. Decides
what is unknown and what counts as noise; works for any design that has a table.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats
from smoskin.errors import ArgumentError
from smoskin.sensing.response import ResponseTable

_BLIND: Final = 5e-3
"""m: a place whose bound is larger counts as blind."""


class SuperResolution(NamedTuple):
    """How much finer touches are told apart than sensors lie."""

    area: float
    """Area a chip over the area of the mean square error: A / S over mean (dx^2 + dy^2)."""
    spacing: float
    """Spacing of the chips, the root of A / S, over the mean error."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoundMap:
    """Bounds of a touch of one force at L x W places from rim to rim.

    Standard deviations; a place that cannot be told is bounded by that of the skin's own size.
    """

    x: Floats
    """(L,), m."""
    y: Floats
    """(W,), m."""
    place: Floats
    """(L, W, 2), m, of x and of y."""
    drag: Floats
    """(L, W, 2), N, of Fx and Fy; zero where drags are known to be none."""
    force: Floats
    """(L, W), N, of the normal force."""
    chips: int
    """How many the signals come from."""

    @property
    def location(self) -> Floats:
        """Root mean square distance from the true place, (L, W), m."""
        return np.asarray(np.hypot(self.place[..., 0], self.place[..., 1]))

    @property
    def blind(self) -> Bools:
        """Where the place cannot be told to 5 mm, (L, W)."""
        return np.asarray(self.location > _BLIND, dtype=np.bool_)

    @property
    def super_resolution(self) -> SuperResolution:
        """In both usual definitions, over the places that are not blind."""
        seen = self.location[~self.blind]
        taxel = self.x[-1] * self.y[-1] / self.chips
        if not len(seen):
            return SuperResolution(0.0, 0.0)
        # The mean distance of a round normal error is sqrt(pi) / 2 of its root mean square.
        mean = float(seen.mean()) * np.sqrt(np.pi) / 2
        return SuperResolution(float(taxel / np.mean(seen**2)), float(np.sqrt(taxel) / mean))

    def blind_regions(self) -> list[str]:
        """Names of the strips along the rim, and of the rest, where the place cannot be told."""
        rows, columns = (np.asarray(self.blind.all(axis=axis)) for axis in (1, 0))
        named = []
        for axis, line, dark in (("x", self.x, rows), ("y", self.y, columns)):
            low = int(np.argmin(dark)) if not dark.all() else len(dark)
            high = int(np.argmin(dark[::-1])) if not dark.all() else 0
            if low:
                named.append(f"{axis} <= {line[low - 1] * 1e3:.0f} mm")
            if high:
                named.append(f"{axis} >= {line[-high] * 1e3:.0f} mm")
        inside = self.blind & ~rows[:, None] & ~columns
        if inside.any():
            named.append(f"{inside.mean():.1%} of the skin elsewhere")
        return named


def bound_map(
    table: ResponseTable,
    noise: Floats,
    *,
    force: float = 0.5,
    drags: bool = True,
    misfit: bool = False,
    places: tuple[int, int] = (49, 65),
) -> BoundMap:
    """Bounds over the skin.

    Parameters
    ----------
    table : ResponseTable
    noise : Floats, shape (C, C)
        T^2: covariance of signals (`smoskin.sensing.signals.signal_noise`).
    force : float
        N, normal, of the touch; without drag.
    drags : bool
        Whether the drags are unknown too.
    misfit : bool
        Whether what the table does not know counts as noise: then it is the bound of whoever knows
        no more of the skin than the table.
    places : tuple of int
        Along x and y.

    Raises
    ------
    ArgumentError
        If the force is not positive or there are fewer than two places along an axis.

    Notes
    -----
    The Cramer-Rao inequality, cov >= (J^T N^-1 J)^-1, with the variance of a place spread
    evenly over the skin as what is known beforehand.
    """
    if not force > 0 or min(places) < 2:
        raise ArgumentError(f"force and places must be positive; got {force} N and {places}")
    x, y = (np.linspace(0, end, n) for end, n in zip(table.basis.extent, places, strict=True))
    at = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    slopes = table.point_table().scan(at[:, 0], at[:, 1], np.array([0.0, 0.0, -force]))[1]
    spread = noise
    if misfit:
        places_ways = table.mode_signals(at, np.tile([0.0, 0.0, -force], (len(at), 1)))
        spread = (
            noise + force**2 * table.misfit + np.einsum("bkc,bkd->bcd", places_ways, places_ways)
        )
    unknown = [0, 1, 2, 3, 4] if drags else [0, 1, 4]
    inner = slopes[:, unknown]
    information = inner @ np.linalg.solve(
        np.broadcast_to(spread, (len(at), *noise.shape)), np.swapaxes(inner, 1, 2)
    )
    prior = np.array([*12 / table.basis.extent**2, 1e-6, 1e-6, 1e-6])[unknown]
    information[:, range(len(unknown)), range(len(unknown))] += prior
    deviations = np.zeros((len(at), 5))
    deviations[:, unknown] = np.sqrt(np.einsum("bii->bi", np.linalg.inv(information)))
    shape = (len(x), len(y))
    return BoundMap(
        x=x,
        y=y,
        place=deviations[:, :2].reshape(*shape, 2),
        drag=deviations[:, 2:4].reshape(*shape, 2),
        force=deviations[:, 4].reshape(shape),
        chips=len(table.chips),
    )
