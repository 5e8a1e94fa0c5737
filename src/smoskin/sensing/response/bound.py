"""How well any estimator could do: the Cramer-Rao bound over the skin.

The bound is the inverse of the information that the signals of one reading carry about a touch's
place, drag and normal force; it needs the signals' slopes, from a response table or from whoever
knows them for a design without one. Decides what is unknown and what counts as noise, and names
regions blind where the signals leave the place open. Noise alone bounds far below what scatter of
manufacture leaves after a calibration: a table's own misfit can be counted as noise too.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, floats
from smoskin.errors import ArgumentError
from smoskin.sensing.response.table import ResponseTable

_BLIND: Final = 5e-3
"""m: a place whose bound is larger counts as blind."""
_WORST: Final = 99.0
"""Per cent of places that the worst bound leaves below it; single places say little."""
_PRIOR: Final = 1e-6
"""1/N^2: what is known of forces beforehand, next to nothing."""


class SuperResolution(NamedTuple):
    """How much finer touches are told apart than sensors lie."""

    area: float
    """Area a chip over the area of the mean square error: A / S over mean (dx^2 + dy^2)."""
    spacing: float
    """Spacing of the chips, the root of A / S, over the mean error."""


class Figures(NamedTuple):
    """A bound over the skin in four numbers, in its own unit."""

    mean: float
    median: float
    worst: float
    """99 % of the places have a lower one."""
    maximum: float


def figures(bound: Floats) -> Figures:
    """Mean, median and worst of a bound over the places of a map.

    Examples
    --------
    >>> figures(np.linspace(0.0, 1.0, 201))
    Figures(mean=0.5, median=0.5, worst=0.99, maximum=1.0)
    """
    return Figures(
        float(np.mean(bound)),
        float(np.median(bound)),
        float(np.percentile(bound, _WORST)),
        float(np.max(bound)),
    )


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
        taxel = (self.x[-1] - self.x[0]) * (self.y[-1] - self.y[0]) / self.chips
        if not len(seen):
            return SuperResolution(0.0, 0.0)
        # The mean distance of a round normal error is sqrt(pi) / 2 of its root mean square.
        mean = float(seen.mean()) * np.sqrt(np.pi) / 2
        return SuperResolution(float(taxel / np.mean(seen**2)), float(np.sqrt(taxel) / mean))

    def blind_regions(self) -> list[str]:
        """Names of the strips along the rim, and of the rest, where the place cannot be told."""
        if self.blind.all():
            return ["the whole skin"]
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
    """Bounds over the skin of a response table.

    Parameters
    ----------
    table : ResponseTable
    noise : Floats, shape (C, C)
        T^2: covariance of signals (`smoskin.sensing.signals.signals.signal_noise`).
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
    spread = np.broadcast_to(noise, (len(at), *noise.shape))
    if misfit:
        places_ways = table.mode_signals(at, np.tile([0.0, 0.0, -force], (len(at), 1)))
        spread = (
            noise + force**2 * table.misfit + np.einsum("bkc,bkd->bcd", places_ways, places_ways)
        )
    return bound_of_slopes(
        x,
        y,
        np.swapaxes(slopes, 1, 2).reshape(*places, table.count, 5),
        spread.reshape(*places, *noise.shape),
        drags=drags,
    )


def bound_of_slopes(
    x: Floats, y: Floats, slopes: Floats, noise: Floats, *, drags: bool = True
) -> BoundMap:
    """Bounds over the skin from the signals' slopes, wherever these come from.

    Parameters
    ----------
    x : Floats, shape (L,)
        m, from rim to rim; two or more.
    y : Floats, shape (W,)
        m, likewise.
    slopes : Floats, shape (L, W, C, 5)
        Of the C signals of C / 3 chips, by x and y, T/m, and by Fx, Fy and Fz, T/N.
    noise : Floats, shape (C, C) or (L, W, C, C)
        T^2: covariance of the signals.
    drags : bool
        Whether the drags are unknown too.

    Raises
    ------
    ArgumentError
        If shapes do not fit each other.

    Notes
    -----
    As `bound_map`.
    """
    shape = (len(x), len(y))
    known = floats("slopes", slopes, (*shape, None, 5))
    return bound_of_information(x, y, information(known, noise), known.shape[2] // 3, drags=drags)


def information(slopes: Floats, noise: Floats) -> Floats:
    """What signals tell of a touch's five numbers; that of chips whose noise is apart adds up.

    Parameters
    ----------
    slopes : Floats, shape (..., C, 5)
        As for `bound_of_slopes`.
    noise : Floats, shape (C, C) or (..., C, C)
        T^2: covariance of the signals.

    Returns
    -------
    Floats, shape (..., 5, 5)
        J^T N^-1 J, by x, y, Fx, Fy and Fz.
    """
    known = floats("slopes", slopes, (None, 5))
    count = known.shape[-2]
    spread = floats("noise", noise, (count, count))
    spread = np.broadcast_to(spread, (*known.shape[:-2], count, count))
    return np.asarray(np.swapaxes(known, -1, -2) @ np.linalg.solve(spread, known))


def bound_of_information(
    x: Floats, y: Floats, told: Floats, chips: int, *, drags: bool = True
) -> BoundMap:
    """Bounds over the skin from what so many chips tell at each place, (L, W, 5, 5).

    Raises
    ------
    ArgumentError
        If shapes do not fit each other.
    """
    shape = (len(x), len(y))
    if min(shape) < 2:
        raise ArgumentError(f"x and y must be two places or more each; got {shape}")
    unknown = [0, 1, 2, 3, 4] if drags else [0, 1, 4]
    known = floats("told", told, (*shape, 5, 5))[..., unknown, :][..., unknown]
    extent = np.array([x[-1] - x[0], y[-1] - y[0]])
    known = known + np.diag(np.array([*12 / extent**2, *[_PRIOR] * 3])[unknown])
    deviations = np.zeros((*shape, 5))
    deviations[..., unknown] = np.sqrt(np.einsum("...ii->...i", np.linalg.inv(known)))
    return BoundMap(
        x=x,
        y=y,
        place=deviations[..., :2],
        drag=deviations[..., 2:4],
        force=deviations[..., 4],
        chips=chips,
    )
