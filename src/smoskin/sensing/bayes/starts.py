"""Starts of a search for touches: coarse places whose answers come nearest to the signals.

Decides on which places and in which order; forces enter linearly, so that each place's best are
known at once. Hides the bases in which answers are compared.
"""

from itertools import combinations
from typing import Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.magnetics.nonlinearity import Bend, straightened
from smoskin.origami.geometry import middles_of_fields, places_to_the_rim
from smoskin.sensing.bayes.posterior import APART, TouchProblem
from smoskin.sensing.bayes.priors import Standing
from smoskin.sensing.response.pairs import mutual_drags
from smoskin.sensing.response.point import PointTable
from smoskin.sensing.response.table import ResponseTable

TYPICAL: Final = 0.5
"""Force at which answers are compared, N."""
_TUG: Final = 0.2
"""Drag, likewise."""
_SINGLE_GRID: Final = (16, 20)
"""Places from rim to rim where a single touch may start."""
_PAIR_GRID: Final = (8, 10)
"""Places, the middles of as many fields, of which two are where a pair may start."""


class Starts:
    """Places of K touches and their answers to forces.

    Parameters
    ----------
    sites, which : Floats, shape (S, 2), and Ints, shape (G, K)
        Places where touches may stand, m, and at which of them K do.
    answers : Floats, shape (G, L, C)
        Slopes of signals by loads, T/N: presses of K touches, or drags and press of one.
    ridge : Floats, shape (L,)
        Precision root of each load beforehand, 1/N.
    whiten : Floats, shape (C, C)
        Matrix that turns signals into standard deviations, 1/T.
    least : float
        Press that each touch must have to be a start, N.
    curvature : Floats, shape (S, 3, 3, 3), optional
        Curvature of the signals, 1/T, which they are freed of first.
    """

    def __init__(
        self,
        sites: Floats,
        which: Ints,
        answers: Floats,
        ridge: Floats,
        whiten: Floats,
        least: float,
        curvature: Floats | None = None,
    ) -> None:
        self._sites, self._which, self._whiten = sites, which.T, whiten
        self._bend = None if curvature is None else Bend(curvature)
        self._least, count = least, answers.shape[2]
        loads = answers.shape[1]
        white = np.swapaxes(answers @ whiten.T, 1, 2)
        ridges = np.broadcast_to(np.diag(ridge), (len(which), loads, loads))
        columns = np.concatenate([white, ridges], axis=1)
        bases, coordinates = np.linalg.qr(columns)
        self._bases = np.ascontiguousarray(np.moveaxis(bases[:, :count], 2, 0))
        self._loads = np.ascontiguousarray(np.moveaxis(np.linalg.inv(coordinates), 0, -1))

    def best(self, signals: Floats, count: int, standing: Standing | None) -> list[Floats]:
        """Touches (K, 5) to start from, the likeliest first."""
        if self._bend is not None:
            signals = self._bend.straightened(signals)
        which, bases, by_inside = self._which, self._bases, self._loads
        if standing is not None:
            # Only those of which one touch is about there.
            away = np.hypot(*(self._sites - standing.place).T)
            about = np.flatnonzero((away <= APART)[which].any(axis=0))
            which, bases, by_inside = which[:, about], bases[:, about], by_inside[..., about]
            first = away[which].argmin(axis=0)
        inside = bases @ (self._whiten @ signals)
        explained = (inside * inside).sum(axis=0)
        loads = (by_inside * inside).sum(axis=1)
        single = len(which) == 1
        presses = loads[-1:] if single else loads
        explained[presses.min(axis=0) <= self._least] = -np.inf
        out: list[Floats] = []
        while len(out) < min(count, explained.size):
            g = int(explained.argmax())
            if not np.isfinite(explained[g]):
                break
            touches = np.zeros((len(which), 5))
            touches[:, :2], touches[:, 4] = self._sites[which[:, g]], -presses[:, g]
            if single and len(loads) == 3:
                touches[0, 2:4] = loads[:2, g]
            if standing is not None:
                touches = touches[[first[g], 1 - first[g]]]
                touches[0, :2] = standing.place
            out.append(touches)
            near = np.ones(explained.size, dtype=np.bool_)
            for sites in which:
                away = np.abs(self._sites - self._sites[sites[g]]).max(axis=1)
                near &= (away < APART)[sites]
            explained[near] = -np.inf
        return out


def single_starts(
    table: ResponseTable, point: PointTable, problem: TouchProblem, drag_spread: float
) -> Starts:
    """Starts of one touch, from rim to rim."""
    places = places_to_the_rim(table.basis.extent, _SINGLE_GRID)
    typical = np.array([0.0, 0.0, -TYPICAL])
    slopes = point.scan(places[:, 0], places[:, 1], typical)[1][:, problem.rows[2:]]
    slopes[:, -1] *= -1
    ridge = np.array([1 / drag_spread, 1 / drag_spread, 0.0] if drag_spread else [0.0])
    which = np.arange(len(places))[:, None]
    return Starts(places, which, slopes, ridge, problem.whitener(TYPICAL**2), 0.0)


def pair_starts(table: ResponseTable, problem: TouchProblem) -> Starts:
    """Starts of two straight touches, freed of what bends their signals."""
    grid = middles_of_fields(table.basis.extent, _PAIR_GRID)
    tugs = _TUG * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
    forces = np.insert(tugs, 2, -TYPICAL, axis=1)
    signals = table.signals(np.repeat(grid, len(forces), axis=0), np.tile(forces, (len(grid), 1)))
    flat = straightened(table.curvature, signals).reshape(len(grid), len(forces), -1)
    by_press = flat[:, 0] / TYPICAL
    by_drag = (flat[:, 1::2] - flat[:, 2::2]) / (2 * _TUG)
    pairs = np.array(list(combinations(range(len(grid)), 2)))
    pairs = pairs[np.hypot(*(grid[pairs[:, 0]] - grid[pairs[:, 1]]).T) > APART]
    shares = table.basis.vertex_shares(grid)[pairs]
    _, drags = mutual_drags(table.grip, shares, np.ones((len(pairs), 2)))
    answer = by_press[pairs] + np.einsum("glkd,gkdc->glc", drags, by_drag[pairs])
    whiten, least = problem.whitener((2 * TYPICAL) ** 2), table.forces[0] / 2
    return Starts(grid, pairs, answer, np.zeros(2), whiten, least, table.curvature)
