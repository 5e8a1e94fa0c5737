"""How well any estimator could do: the Cramer-Rao bound over the skin.

Decides what is unknown and what counts as noise, and calls places blind where signals leave the
place open. Noise alone bounds far below what scatter of manufacture leaves after a calibration; so
a table's own misfit can count as noise too. Equations: "The bound" in `docs/derivations.md`.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, floats
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import places_to_the_rim
from smoskin.sensing.response.table import ResponseTable

_BLIND: Final = 5e-3
"""Bound of a place from which it counts as blind, m."""
_WORST: Final = 99.0
"""Per cent of places below the worst bound; single places say little."""
_PRIOR: Final = 1e-6
"""Information about forces beforehand, next to nothing, 1/N^2."""


class SuperResolution(NamedTuple):
    """How much finer touches are told apart than sensors lie."""

    area: float
    """Area a chip over the area of the mean square error: A / S over mean (dx^2 + dy^2)."""
    spacing: float
    """Spacing of the chips, the root of A / S, over the mean error."""


class Figures(NamedTuple):
    """Four numbers of a bound over the skin, in its own unit."""

    mean: float
    median: float
    worst: float
    """Bound below which 99 % of the places lie."""
    maximum: float


def figures(bound: Floats) -> Figures:
    """Mean, median and worst of a bound over the places of a map.

    Examples
    --------
    >>> figures(np.linspace(0.0, 1.0, 201))
    Figures(mean=0.5, median=0.5, worst=0.99, maximum=1.0)
    """
    values = np.mean(bound), np.median(bound), np.percentile(bound, _WORST), np.max(bound)
    return Figures(*map(float, values))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoundMap:
    """Bounds of a touch of one force at L x W places from rim to rim, as standard deviations.

    A place that cannot be told is bounded by that of the skin's own size.
    """

    x: Floats
    """(L,), m."""
    y: Floats
    """(W,), m."""
    place: Floats
    """Bounds of x and y, (L, W, 2), m."""
    drag: Floats
    """Bounds of Fx and Fy, (L, W, 2), N; zero where drags are known to be none."""
    force: Floats
    """Bound of the normal force, (L, W), N."""
    chips: int
    """Number of chips that the signals come from."""

    @property
    def location(self) -> Floats:
        """Root mean square distance from the true place, (L, W), m."""
        return np.asarray(np.hypot(self.place[..., 0], self.place[..., 1]))

    @property
    def blind(self) -> Bools:
        """Whether the place cannot be told to 5 mm, (L, W)."""
        return np.asarray(self.location > _BLIND, dtype=np.bool_)

    @property
    def super_resolution(self) -> SuperResolution:
        """Super-resolution in both usual definitions, over the places that are not blind."""
        seen = self.location[~self.blind]
        taxel = (self.x[-1] - self.x[0]) * (self.y[-1] - self.y[0]) / self.chips
        if not len(seen):
            return SuperResolution(0.0, 0.0)
        # The mean distance of a round normal error is sqrt(pi) / 2 of its root mean square.
        mean = float(seen.mean()) * np.sqrt(np.pi) / 2
        return SuperResolution(float(taxel / np.mean(seen**2)), float(np.sqrt(taxel) / mean))


def bound_map(
    table: ResponseTable,
    noise: Floats,
    *,
    force: float = 0.5,
    drags: bool = True,
    misfit: bool = False,
    places: tuple[int, int] = (49, 65),
) -> BoundMap:
    """Bounds over the skin of a response table, at so many places along x and y.

    The touch has a normal force, N, and no drag; `noise`, (C, C), T^2, is the covariance of signals
    (`smoskin.sensing.signals.signals.signal_noise`). `drags` says whether drags are unknown too,
    `misfit` whether what the table does not know of the skin is noise. It raises an `ArgumentError`
    if the force is not positive or there are fewer than two places along an axis.

    Notes
    -----
    The Cramer-Rao inequality ``cov >= (J^T R^-1 J + prior)^-1`` with ``R = N``, or with the misfit
    ``R = N + F^2 E + sum_k m_k m_k^T``; beforehand the place is spread evenly over the skin.
    """
    if not force > 0 or min(places) < 2:
        raise ArgumentError(
            f"force must be positive and places two or more each way; got {force} N and {places}"
        )
    x, y = (np.linspace(0, end, n) for end, n in zip(table.basis.extent, places, strict=True))
    position = places_to_the_rim(table.basis.extent, places)
    push = np.tile([0.0, 0.0, -force], (len(position), 1))
    covariance = np.broadcast_to(noise, (len(position), *noise.shape))
    if misfit:
        modes = table.mode_signals(position, push)
        covariance = noise + force**2 * table.misfit + np.einsum("bkc,bkd->bcd", modes, modes)
    slopes = table.slopes(position, push).reshape(*places, table.count, 5)
    return bound_of_slopes(x, y, slopes, covariance.reshape(*places, *noise.shape), drags=drags)


def information(slopes: Floats, noise: Floats) -> Floats:
    """Information J^T N^-1 J of signals about a touch, (..., 5, 5); it adds up over chips.

    Slopes J (..., C, 5) are those by x and y, T/m, and by Fx, Fy and Fz, T/N; the covariance N of
    the signals is (C, C) or (..., C, C), T^2. `ArgumentError` if shapes do not fit.
    """
    slopes = floats("slopes", slopes, (None, 5))
    noise = floats("noise", noise, (slopes.shape[-2], slopes.shape[-2]))
    noise = np.broadcast_to(noise, (*slopes.shape[:-1], slopes.shape[-2]))
    return np.asarray(np.swapaxes(slopes, -1, -2) @ np.linalg.solve(noise, slopes))


def bound_of_information(
    x: Floats, y: Floats, fisher: Floats, chips: int, *, drags: bool = True
) -> BoundMap:
    """Bounds at two or more places x (L,) and y (W,), m, of the information (L, W, 5, 5) of chips.

    Drags may be known to be none. `ArgumentError` if shapes do not fit each other.
    """
    shape = (len(x), len(y))
    if min(shape) < 2:
        raise ArgumentError(f"x and y must be two places or more each; got {shape}")
    free = [0, 1, 2, 3, 4] if drags else [0, 1, 4]
    known = floats("fisher", fisher, (*shape, 5, 5))[..., free, :][..., free]
    extent = np.array([x[-1] - x[0], y[-1] - y[0]])
    covariance = np.linalg.inv(known + np.diag(np.array([*12 / extent**2, *[_PRIOR] * 3])[free]))
    deviations = np.zeros((*shape, 5))
    deviations[..., free] = np.sqrt(np.einsum("...ii->...i", covariance))
    place, drag, force = deviations[..., :2], deviations[..., 2:4], deviations[..., 4]
    return BoundMap(x=x, y=y, place=place, drag=drag, force=force, chips=chips)


def bound_of_slopes(
    x: Floats, y: Floats, slopes: Floats, noise: Floats, *, drags: bool = True
) -> BoundMap:
    """Bounds from slopes (L, W, C, 5) of signals of C / 3 chips, as `information` takes them."""
    fisher = information(slopes, noise)
    return bound_of_information(x, y, fisher, slopes.shape[-2] // 3, drags=drags)
