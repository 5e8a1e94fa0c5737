"""How well touches could be told and how well they are: bounds and errors over the skin, as arrays.

Decides the touches of both: one of half a newton anywhere with any drag, and pairs at all
distances. Bounds are the chips' noise's alone; errors are of whole sessions on made skins, with
creep, drift, temperature and noise, after a calibration of 60 touches. A touch that is not found,
or found twice, counts as if it had been taken to lie in the skin's middle.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from paper.shared.setting import TrialSkin
from smoskin.arrays import Floats
from smoskin.commands.score.errors import together
from smoskin.commands.score.evaluate import grid_sessions, judge, press
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.response.bound import BoundMap, SuperResolution, bound_map
from smoskin.sensing.response.table import ResponseTable

FORCE: Final = 0.5
"""N, normal, of single touches."""
DRAG: Final = 0.3
"""N: their largest drag, of any direction."""
PLACES: Final = (11, 15)
DISTANCES: Final = (0.01, 0.02, 0.04, 0.07, 0.13)
"""m: ends of the classes of pairs by how far apart they are."""
FORCES: Final = (0.1, 0.3, 0.6, 1.0)
"""N: ends of the classes of pairs by force; both touches are of one class."""
_A_CLASS: Final = 5
"""Pairs."""
_STEPS: Final = np.array([1e-5, 1e-5, 1e-3])
"""m and N: by which a pair's unknowns are varied for its slopes."""
_RANK: Final = 1e-6
"""Smallest over largest singular value from which six unknowns count as told apart."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchErrors:
    """Bounds of single touches, and errors of the estimator beside them, at L x W places."""

    bound: BoundMap
    """By noise alone, with drags unknown."""
    distance: Floats
    """(L, W), m: mean distance of the place said from the true one."""
    squared: Floats
    """(L, W), m^2: its mean square."""
    force: Floats
    """(L, W), N: mean error of the normal force."""
    drag: Floats
    """(L, W), N: mean distance of the drag said from the true one."""
    counted: float
    """Share of the touches that were found as one."""
    idle: float
    """Share of the moments between touches at which nothing was found."""

    @property
    def over_bound(self) -> float:
        """Root mean square error of the place over its bound."""
        return float(np.sqrt(self.squared.mean() / (self.bound.location**2).mean()))

    @property
    def super_resolution(self) -> SuperResolution:
        """Super-resolution that the estimator reaches, in both usual definitions."""
        taxel = self.bound.x[-1] * self.bound.y[-1] / self.bound.chips
        return SuperResolution(
            float(taxel / self.squared.mean()), float(np.sqrt(taxel) / self.distance.mean())
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairErrors:
    """Two straight touches at once, in D classes of distance and F classes of force."""

    counted: Floats
    """(D, F): share of the pairs found as two."""
    distance: Floats
    """(D, F), m: mean distance of the places said from the true ones, of pairs found as two; NaN
    where there are none."""
    bound: Floats
    """(D, F), m: median of the bound on that by noise alone, root mean square."""
    each: Floats
    """(D, F, B), m: mean of both distances of each pair; NaN where it was not found as two."""
    each_bound: Floats
    """(D, F, B), m: of each pair."""
    identifiable: float
    """Share of all pairs whose nine signals tell the six unknowns apart."""

    @property
    def apart(self) -> tuple[slice, slice]:
        """The classes from 40 mm and from 0.3 N on."""
        return slice(DISTANCES.index(0.04), None), slice(FORCES.index(0.3), None)


def touch_errors(design: SkinDesign, skins: tuple[TrialSkin, ...]) -> TouchErrors:
    """Touch every skin at every place once, and bound what could be said of the first."""
    judged = []
    for k, skin in enumerate(skins):
        rng = np.random.default_rng([2, k])
        (session,) = grid_sessions(skin.twin, rng, places=PLACES, forces=(FORCE,), drag=DRAG)
        judged.append(judge(_estimator(design, skin, DRAG), skin.twin, session, rng))
    whole = together(judged)
    extent = geometry(design).extent
    cells = np.rint(whole.truth[:, :2] / extent * (np.array(PLACES) - 1)).astype(np.int64)
    drag_error = np.hypot(whole.force_error[:, 0], whole.force_error[:, 1])

    def mapped(values: Floats) -> Floats:
        total = np.zeros(PLACES)
        np.add.at(total, tuple(cells.T), values)
        return total / len(skins)

    return TouchErrors(
        bound=bound_map(skins[0].table, skins[0].noise, force=FORCE, places=PLACES),
        distance=mapped(whole.distance),
        squared=mapped(whole.distance**2),
        force=mapped(whole.force_error[:, 2]),
        drag=mapped(drag_error),
        counted=float((whole.count == 1).mean()),
        idle=float((whole.idle == 0).mean()),
    )


def pair_errors(design: SkinDesign, skin: TrialSkin) -> PairErrors:
    """Press pairs of all classes on one skin, with the drags known to be none."""
    rng = np.random.default_rng(3)
    shape = (len(DISTANCES) - 1, len(FORCES) - 1, _A_CLASS)
    where, push = np.empty((*shape, 2, 2)), np.zeros((*shape, 2, 3))
    for d, f in np.ndindex(*shape[:2]):
        where[d, f] = _places(geometry(design).extent, DISTANCES[d], DISTANCES[d + 1], rng)
        push[d, f, ..., 2] = -rng.uniform(FORCES[f], FORCES[f + 1], (_A_CLASS, 2))
    flat = Touches(position=where.reshape(-1, 2, 2), force=push.reshape(-1, 2, 3))
    estimator = _estimator(design, skin, 0.0)
    result = judge(estimator, skin.twin, press(skin.twin, flat, 25.0), rng)
    off = np.hypot(result.error[:, 0], result.error[:, 1])
    each = off.reshape(*shape, 2).mean(axis=-1)
    right = (result.count == 2).reshape(shape)
    counted = right.mean(axis=2)
    bound, identifiable = _pair_bounds(skin.table, skin.noise, flat)
    total = np.where(right, each, 0.0).sum(axis=2)
    return PairErrors(
        counted=counted,
        distance=np.divide(
            total, right.sum(axis=2), out=np.full(shape[:2], np.nan), where=counted > 0
        ),
        bound=np.median(bound.reshape(shape), axis=2),
        each=each,
        each_bound=bound.reshape(shape),
        identifiable=identifiable,
    )


def _estimator(design: SkinDesign, skin: TrialSkin, drag: float) -> BayesEstimator:
    return BayesEstimator(
        design,
        skin.table,
        priors=TouchPriors(drag_spread=drag),
    )


def _places(extent: Floats, least: float, most: float, rng: np.random.Generator) -> Floats:
    """Pairs of places on the skin, their distance evenly drawn from a class, (B, 2, 2)."""
    kept = np.empty((0, 2, 2))
    while len(kept) < _A_CLASS:
        first = rng.uniform(0, extent, (8 * _A_CLASS, 2))
        reach, angle = rng.uniform(least, most, len(first)), rng.uniform(0, 2 * np.pi, len(first))
        second = first + reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        on_skin = ((second >= 0) & (second <= extent)).all(axis=1)
        kept = np.concatenate([kept, np.stack([first, second], axis=1)[on_skin]])
    return kept[:_A_CLASS]


def _pair_bounds(table: ResponseTable, noise: Floats, pairs: Touches) -> tuple[Floats, float]:
    """Bound on the places of each pair (B,), m, and the share with all unknowns told apart."""
    slopes = np.empty((len(pairs), table.count, 2, 3))
    for touch, unknown in np.ndindex(2, 3):
        ends = []
        for side in (-1, 1):
            where, push = pairs.position.copy(), pairs.force.copy()
            # The normal force is the third unknown; it counts downwards.
            held = push if unknown == 2 else where
            held[:, touch, unknown] += side * _STEPS[unknown]
            ends.append(table.together(where, push))
        slopes[:, :, touch, unknown] = (ends[1] - ends[0]) / (2 * _STEPS[unknown])
    white = np.linalg.solve(np.linalg.cholesky(noise), slopes.reshape(len(pairs), -1, 6))
    units = np.tile([*table.basis.extent, FORCE], 2)
    scaled = np.linalg.svd(white * units, compute_uv=False)
    information = np.swapaxes(white, 1, 2) @ white
    information[:, range(6), range(6)] += np.tile([*12 / table.basis.extent**2, 1e-6], 2)
    variances = np.einsum("bii->bi", np.linalg.inv(information))[:, [0, 1, 3, 4]]
    bound = np.sqrt(variances.sum(axis=1) / 2)
    return np.asarray(bound), float((scaled[:, -1] > _RANK * scaled[:, 0]).mean())
