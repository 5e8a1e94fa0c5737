"""Vertices of a sheet on a surface: the fairest that meet their conditions.

Decides what is fair, how the conditions are approached, and when to give up. Every vertex is
described by two parameters of the surface and its height over it, so that a sheet near the start
has its pitch and its depth. Solves

    minimise 1/2 |y - y_0|_H^2  subject to  c(y) = 0

by Newton's method on a residual that is taken away in steps, c(y) = (1 - t) c(y_0), t from 0 to 1.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from smoskin.arrays import Bools, Floats
from smoskin.origami.surface.surface import Surface, forms
from smoskin.origami.tessellation.conditions import Net, angle_slopes, sector_angles, volumes
from smoskin.origami.tessellation.hinges import Frame, fold_angles, fold_slopes

Listener = Callable[[str, float], object]
"""Listener to the work: what is being done, and the share that is done."""

_NEAR: Final = 1e-6
"""Residual of a step that counts as reached."""
_EXACT: Final = 1e-13
"""Residual at which the last step ends."""
_SHORTEST: Final = 1 / 64
"""Shortest step of t before it is given up."""
_NEWTON: Final = 8
"""Newton's steps at each t."""
_FAIR: Final = 25
"""Steps at the end that seek the fairest sheet."""
_FURTHER: Final = 20
"""Steps half as long by which a search goes on."""
_STILL: Final = 1e-4
"""Motion over the scale at which the sheet counts as the fairest."""
_DIVE: Final = 0.5
"""Longest motion of a step over the scale."""
_DEPTHS: Final = (0.84, 1.16)
"""Heights of top vertices over the planar cell's that are free."""
_SOFT: Final = 1e-11
"""Compliance of the conditions in the linear system, which keeps it regular; steps to conditions
that nearly depend on others end at it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """What counts as fair; on surfaces bent strongly other weights lead to other sheets."""

    heights: float = 10.0
    """Weight of heights against that of ways along the surface."""
    start: float = 0.03
    """Weight of the way from the start against that of its differences between neighbours."""
    angles: float = 30.0
    """Weight of a sector or fold angle's excess, 1/rad^2."""
    depth: float = 0.0
    """Weight of a top vertex' excess in height, over that of an angle's."""
    least_angle: float = float(np.radians(27))
    """Least sector angle that is free, rad; the largest is pi less it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """What a sheet must meet."""

    surface: Surface
    """Surface on which bottom vertices lie."""
    net: Net
    """Panels and their corners."""
    frame: Frame
    """Bars and hinges, of which creases have bounds."""
    shape: tuple[int, int]
    """Rows and columns of vertices, 2N + 1 and 2M + 1."""
    bottom: Bools
    """(V,): vertices that belong on the surface."""
    scale: float
    """m: the length of a cell."""
    flat_foldable: bool
    """Whether opposite sector angles must sum to pi."""
    sharpest: float
    """Fold angle that is free, rad; creases beyond take too much of the panels."""
    depth: float
    """m: height of the planar cell."""
    weights: Weights
    pull: float
    """Weight of a bottom vertex's height against that of other motions, where it is free; the
    vertices lie on the surface itself where the sheet need not fold flat."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """End of a search."""

    layers: Floats
    """(V, 3), m: both parameters and the height of every vertex."""
    reached: float
    """Share of the start's residual that could be taken away; 1 where all conditions hold."""
    residual: float
    """Largest residual left: of an angle sum, rad, or of a panel's volume over the scale's."""


def places(surface: Surface, layers: Floats) -> Floats:
    """Vertices (V, 3), m, of parameters and heights (V, 3)."""
    at = forms(surface, layers[:, :2])
    return np.asarray(at.places + layers[:, 2:] * at.normals)


def place_slopes(surface: Surface, layers: Floats) -> tuple[Floats, sparse.csr_array]:
    """Vertices and their derivatives by parameters and heights, (3 V, 3 V)."""
    at = forms(surface, layers[:, :2])
    by = at.slopes + layers[:, 2, None, None] * at.turns
    blocks = np.concatenate([by, at.normals[:, :, None]], axis=-1)
    count = len(layers)
    slopes = sparse.bsr_array(
        (blocks, np.arange(count), np.arange(count + 1)), shape=(3 * count, 3 * count)
    )
    return at.places + layers[:, 2:] * at.normals, slopes.tocsr()


class Placed(NamedTuple):
    """A sheet's vertices and sector angles, with their derivatives."""

    vertices: Floats
    """(V, 3), m."""
    by_layers: sparse.csr_array
    """(3 V, 3 V): derivatives of the vertices by the layers."""
    angles: Floats
    """(K,), rad: angle of every corner."""
    by_vertices: sparse.csr_array
    """(K, 3 V), rad/m: derivatives of the angles by the vertices."""


def placed(problem: Problem, layers: Floats) -> Placed:
    """What conditions and bounds at some layers both need."""
    vertices, by_layers = place_slopes(problem.surface, layers)
    net = problem.net
    return Placed(vertices, by_layers, sector_angles(net, vertices), angle_slopes(net, vertices))


def conditions(problem: Problem, at: Placed) -> tuple[Floats, sparse.csr_array]:
    """Residuals of planarity, angle sums and flat folding, and their derivatives by the layers."""
    net = problem.net
    volume, by_volume = volumes(net, at.vertices, problem.scale)
    parts = [volume, net.around @ at.angles - 2 * np.pi]
    slopes = [by_volume, net.around @ at.by_vertices]
    if problem.flat_foldable:
        parts.append(net.opposite @ at.angles - np.pi)
        slopes.append(net.opposite @ at.by_vertices)
    return np.concatenate(parts), (sparse.vstack(slopes) @ at.by_layers).tocsr()


def residuals(problem: Problem, layers: Floats) -> Floats:
    """Residuals of planarity, angle sums and flat folding, as `conditions` has them."""
    net, vertices = problem.net, places(problem.surface, layers)
    angles = sector_angles(net, vertices)
    parts = [volumes(net, vertices, problem.scale)[0], net.around @ angles - 2 * np.pi]
    if problem.flat_foldable:
        parts.append(net.opposite @ angles - np.pi)
    return np.concatenate(parts)


def settle(
    problem: Problem, start: Floats, *, deadline: float = np.inf, progress: Listener | None = None
) -> Solution:
    """The fairest sheet that meets the conditions, or how far the search came.

    Parameters
    ----------
    start : array, shape (V, 3)
        Parameters and heights of the vertices at the start, m, towards which it is fair.
    deadline : float
        Reading of `time.monotonic` at which the search ends.
    """
    search = _Search(problem, start)
    layers, t, step = start, 0.0, 1.0
    while t < 1.0:
        if time.monotonic() > deadline or step < _SHORTEST:
            return Solution(layers=layers, reached=t, residual=search.residual(layers))
        aim = min(1.0, t + step)
        further = search.reach(layers, aim)
        if further is None:
            step /= 2
            continue
        layers, t, step = further, aim, 2 * step
        if progress is not None:
            progress("approaching the surface", 0.8 * t)
    there = layers
    for k in range(_FAIR):
        motion = search.step(layers, 0.0, fair=True)
        layers = layers + motion
        if np.abs(motion).max() < _STILL * problem.scale or time.monotonic() > deadline:
            break
        if progress is not None:
            progress("seeking the fairest sheet", 0.8 + 0.2 * k / _FAIR)
    layers = search.polish(layers)
    if not search.residual(layers) < _NEAR:  # seeking what is fairer led astray
        layers = search.polish(there)
    return Solution(layers=layers, reached=1.0, residual=search.residual(layers))


def settle_further(
    problem: Problem, start: Floats, solution: Solution, *, deadline: float = np.inf
) -> Solution:
    """A fairer sheet, from one that meets the conditions.

    Whole steps may go to and fro between bounds that they pass and that they keep; these are half
    as long, so that what is left of the conditions is taken away at the end.
    """
    search, layers = _Search(problem, start), solution.layers
    for _ in range(_FURTHER):
        if time.monotonic() > deadline:
            break
        layers = layers + search.step(layers, 0.0, fair=True) / 2
    layers = search.polish(layers)
    residual = search.residual(layers)
    return replace(solution, layers=layers, residual=residual) if residual < _NEAR else solution


class _Search:
    """Newton's steps towards the conditions of a problem, by its fairness."""

    def __init__(self, problem: Problem, start: Floats) -> None:
        self._problem, self._start = problem, start
        weights = np.zeros_like(start)
        weights[problem.bottom, 2] = problem.pull
        fairness = sparse.kron(
            _fairness(problem.shape, problem.weights.start),
            sparse.diags_array([1.0, 1.0, problem.weights.heights]),
        )
        free = np.ones(start.shape, dtype=bool)
        free[problem.bottom, 2] = problem.flat_foldable
        self._free = np.flatnonzero(free.ravel())
        self._fairness = (fairness + sparse.diags_array(weights.ravel())).tocsr()
        self._inner = self._fairness[self._free][:, self._free]
        self._begin = residuals(problem, start)

    def residual(self, layers: Floats) -> float:
        """Largest residual of all conditions."""
        return float(np.abs(residuals(self._problem, layers)).max(initial=0.0))

    def reach(self, layers: Floats, t: float) -> Floats | None:
        """Layers at which the share t of the first residual is gone, if they are found."""
        before = np.inf
        for k in range(_NEWTON):
            layers = layers + self.step(layers, 1.0 - t, fair=k < 3)
            residual = self._left(layers, 1.0 - t)
            if residual < _NEAR:
                return layers
            if not residual < 4 * before:
                return None
            before = residual
        return layers if before < 1e-3 * (1.0 + np.abs(self._begin).max()) else None

    def polish(self, layers: Floats) -> Floats:
        """Layers that meet the conditions to rounding, by the least motion."""
        for _ in range(_NEWTON):
            if self._left(layers, 0.0) < _EXACT:
                break
            layers = layers + self.step(layers, 0.0, fair=False)
        return layers

    def step(self, layers: Floats, share: float, *, fair: bool) -> Floats:
        """Newton's step to a share of the first residual, fair or the least; bounded in length."""
        scale = self._problem.scale
        at = placed(self._problem, layers)
        residual, slopes = conditions(self._problem, at)
        residual = residual - share * self._begin
        slopes = (scale * slopes[:, self._free]).tocsr()
        weights, pull = self._inner, np.zeros(len(self._free))
        if fair:
            pull = (self._fairness @ (layers - self._start).ravel() / scale)[self._free]
            excess, by_excess = self._excess(layers, at)
            weights = weights + self._problem.weights.angles * (by_excess.T @ by_excess)
            pull = pull + self._problem.weights.angles * (by_excess.T @ excess)
        right = np.concatenate([-pull, -residual])
        soft = -_SOFT * sparse.eye_array(len(residual))
        blocks: Any = [[weights, slopes.T], [slopes, soft]]
        system: Any = sparse.block_array(blocks).tocsc()
        # Quasi-definite: any symmetric order has a factor, without pivots.
        factor = splu(
            system,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        answer = factor.solve(right)
        answer += factor.solve(right - system @ answer)
        motion = np.zeros(layers.size)
        motion[self._free] = scale * answer[: len(self._free)]
        longest = float(np.abs(motion).max())
        return (motion * min(1.0, _DIVE * scale / max(longest, 1e-300))).reshape(layers.shape)

    def _excess(self, layers: Floats, at: Placed) -> tuple[Floats, sparse.csr_array]:
        """Excess of sector and fold angles and of depth over their bounds, and its derivatives."""
        scale, limit = self._problem.scale, self._problem.sharpest
        least, depth = self._problem.weights.least_angle, self._problem.weights.depth
        angles, creases = at.angles, self._problem.frame.creases
        folds = fold_angles(at.vertices, creases)
        high = np.flatnonzero(~self._problem.bottom)
        tops = layers[high, 2] / self._problem.depth
        by_tops = sparse.csr_array(
            (np.full(len(high), 1 / self._problem.depth), (np.arange(len(high)), 3 * high + 2)),
            shape=(len(high), layers.size),
        )
        values = np.concatenate(
            [
                angles - np.clip(angles, least, np.pi - least),
                folds - np.clip(folds, -limit, limit),
                depth * (tops - np.clip(tops, *_DEPTHS)),
            ]
        )
        # Few are beyond their bounds: derivatives of those alone.
        rows = np.flatnonzero(values)
        bent, high_up = len(angles), len(angles) + len(folds)
        folded = rows[(rows >= bent) & (rows < high_up)] - bent
        by_places = [at.by_vertices[rows[rows < bent]], fold_slopes(at.vertices, creases[folded])]
        by_height = depth * by_tops[rows[rows >= high_up] - high_up]
        beyond = sparse.vstack([sparse.vstack(by_places) @ at.by_layers, by_height]).tocsr()
        return values[rows], (scale * beyond[:, self._free]).tocsr()

    def _left(self, layers: Floats, share: float) -> float:
        """Largest residual over a share of the first."""
        left = residuals(self._problem, layers) - share * self._begin
        return float(np.abs(left).max(initial=0.0))


def _fairness(shape: tuple[int, int], own: float) -> sparse.csr_array:
    """Weights of a motion and of its differences between vertices of the same kind, (V, V)."""
    index = np.arange(shape[0] * shape[1]).reshape(shape)
    pairs = np.concatenate(
        [
            np.stack([index[:-2], index[2:]], axis=-1).reshape(-1, 2),
            np.stack([index[:, :-2], index[:, 2:]], axis=-1).reshape(-1, 2),
        ]
    )
    rows = np.repeat(np.arange(len(pairs)), 2)
    ends = np.tile([1.0, -1.0], len(pairs))
    differences = sparse.csr_array((ends, (rows, pairs.ravel())), shape=(len(pairs), index.size))
    return sparse.csr_array(differences.T @ differences + own * sparse.eye_array(index.size))
