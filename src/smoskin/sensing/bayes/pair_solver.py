"""The two straight touches that best explain what chips read, and how sure that is.

Unknown are place and the logarithm of the normal force of each. Starts are pairs of coarse places
whose answers come nearest once signals are freed of their curvature, so that forces enter
linearly; a few steps from each tell which to follow to the end. A touch that was alone a moment
ago is known to stand about where it stood. Hides starts, damping and whitening.
"""

import math
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.magnetics.nonlinearity import straightened
from smoskin.origami.geometry import middles_of_fields
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.response.pair_point import PairPoint
from smoskin.sensing.response.pairs import mutual_drags
from smoskin.sensing.response.table import PointTable, ResponseTable

_GRID: Final = (7, 9)
"""Coarse places, the middles of as many fields."""
_TYPICAL: Final = 0.5
"""N: force at which coarse answers are compared."""
_TUG: Final = 0.2
"""N: drag, likewise."""
_APART: Final = 0.02
"""m: starts are tried this far apart, and touches of a pair are at least so."""
_TUGS: Final = ((_TUG, 0.0), (-_TUG, 0.0), (0.0, _TUG), (0.0, -_TUG))
_STARTS: Final = 14
_BRIEF: Final = 4
"""Steps after which starts are compared."""
_KEPT: Final = 3
"""Starts that are followed to the end; the others, where none of these fits as noise lets it."""
_STEPS: Final = 40
_SETTLED: Final = 1e-3
"""Fall of half the squared residual at which steps end."""
_REWEIGHED: Final = 6
"""First steps, after which the misfit is weighed by the forces found."""
_FITS: Final = 4.0
"""Squared residual a signal up to which what follows from the last reading is believed."""
_STRIDE: Final = np.array([0.03, 0.03, 1.0])
"""m and logarithm of force: the longest step."""


class _Path(NamedTuple):
    """Where a descent stands."""

    at: Floats
    """(2, 3): x, y and the logarithm of the normal force."""
    whiten: Floats
    """(C, C)."""
    slopes: Floats
    """(6, C), in standard deviations."""
    residual: Floats
    """(C,), likewise."""
    cost: float
    """Half the squared residual, and of what is known beforehand."""
    damping: float
    steps: int
    done: bool


class PairSolver:
    """Solves single readings of one skin for two touches.

    Parameters
    ----------
    table : ResponseTable
        Of the skin.
    noise : Floats, shape (C, C)
        T^2: covariance of signals of a skin at rest.
    misfit : Floats, shape (C, C)
        T^2/N^2: what is not known of single touches' signals.
    priors : TouchPriors
    """

    def __init__(
        self, table: ResponseTable, noise: Floats, misfit: Floats, priors: TouchPriors
    ) -> None:
        self._table = table
        self._noise, self._misfit = noise, misfit + table.pair_misfit
        self._chance = math.log(priors.chances[2] or 1e-300)
        self._extent = table.basis.extent
        self._expected = max(1.5 * (table.count - 6), 1.0)
        self._level = np.tile([*12 / self._extent**2, 1e-9], 2)
        self._limits = math.log(table.forces[0]), math.log(table.forces[1] * 2)
        area = float(np.prod(self._extent))
        self._log_prior = -2 * math.log(area * math.log(table.forces[1] / table.forces[0]))
        self._starts: tuple[Floats, Floats, Floats, Floats] | None = None
        self._pair = PairPoint(table, table.point_table())

    def warm_to(self, point: PointTable) -> None:
        """Take single touches from this table, at the rubber's temperature."""
        self._pair = PairPoint(self._table, point)

    def solve(
        self, signals: Floats, guess: Floats | None = None, standing: Standing | None = None
    ) -> TouchPosterior:
        """The pair that explains signals (C,) best.

        Parameters
        ----------
        signals : Floats, shape (C,)
            T.
        guess : Floats, shape (2, 5), optional
            The touches a moment ago; the first of them is the one that stands.
        standing : Standing, optional
            What is known of one of them from when it was alone; then it comes first.
        """
        if guess is not None:
            begun = np.concatenate([guess[:, :2], np.log(-guess[:, 4:])], axis=1)
            found = self._advance(signals, self._begin(signals, begun, standing), standing, _STEPS)
            if 2 * found.cost < _FITS * len(signals):
                return self._posterior(found, standing)
        paths = [
            self._advance(signals, self._begin(signals, start, standing), standing, _BRIEF)
            for start in self._begins(signals, standing)
        ]
        best: _Path | None = None
        for tried, path in enumerate(sorted(paths, key=lambda path: path.cost)):
            if best is not None and tried >= _KEPT and 2 * best.cost < self._expected:
                break
            end = self._advance(signals, path, standing, _STEPS)
            if best is None or end.cost < best.cost:
                best = end
        if best is not None and (standing is None or 2 * best.cost < _FITS * len(signals)):
            return self._posterior(best, standing)
        if standing is not None:
            return self.solve(signals)
        middle = np.array([[0.25, 0.25], [0.75, 0.75]]) * self._extent
        begun = np.concatenate([middle, np.full((2, 1), -1.0)], axis=1)
        last = self._advance(signals, self._begin(signals, begun, None), None, _STEPS)
        return self._posterior(last, None)

    def _begins(self, signals: Floats, standing: Standing | None) -> list[Floats]:
        """Places and forces (2, 3) to start from, the likeliest first."""
        if self._starts is None:
            self._starts = self._coarse()
        places, whiten, basis, loads = self._starts
        inside = basis @ (whiten @ straightened(self._table.curvature, signals))
        force = np.einsum("gij,gj->gi", loads, inside)
        explained = (inside * inside).sum(axis=1)
        explained[~(force > self._table.forces[0] / 2).all(axis=1)] = -np.inf
        turn = np.zeros(len(places), dtype=np.int64)
        if standing is not None:
            away = np.hypot(*np.moveaxis(places - standing.place, -1, 0))
            turn = away.argmin(axis=1)
            explained[away.min(axis=1) > _APART] = -np.inf
        found: list[Floats] = []
        while len(found) < _STARTS and np.isfinite(explained.max()):
            g = int(explained.argmax())
            order = [turn[g], 1 - turn[g]]
            start = np.concatenate([places[g], np.log(force[g])[:, None]], axis=1)[order]
            if standing is not None:
                start[0, :2] = standing.place
            found.append(start)
            explained[np.abs(places - places[g]).max(axis=(1, 2)) < _APART] = -np.inf
        return found

    def _coarse(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Pairs of places (G, 2, 2), a whitener (C, C), bases (G, 2, C) and loads (G, 2, 2)."""
        table = self._table
        grid = middles_of_fields(self._extent, _GRID)
        forces = np.array([[0, 0, -_TYPICAL], *([a, b, -_TYPICAL] for a, b in _TUGS)])
        said = table.signals(np.repeat(grid, len(forces), axis=0), np.tile(forces, (len(grid), 1)))
        flat = straightened(table.curvature, said).reshape(len(grid), len(forces), -1)
        by_press = flat[:, 0] / _TYPICAL
        by_drag = (flat[:, 1::2] - flat[:, 2::2]) / (2 * _TUG)
        pairs = np.array(
            [(a, b) for a, b in combinations(range(len(grid)), 2)
             if np.hypot(*(grid[a] - grid[b])) > _APART]
        )  # fmt: skip
        shares = table.vertex_shares(grid)[pairs]
        answers = []
        for k in (0, 1):
            press = np.zeros((len(pairs), 2))
            press[:, k] = 1.0
            drags = mutual_drags(table.grip, shares, press)
            pulled = np.einsum("gkd,gkdc->gc", drags, by_drag[pairs])
            answers.append(by_press[pairs[:, k]] + pulled)
        whiten = self._whitener(np.full(2, _TYPICAL))
        bases, coordinates = np.linalg.qr(whiten @ np.stack(answers, axis=-1))
        basis = np.ascontiguousarray(np.swapaxes(bases, 1, 2))
        return grid[pairs], whiten, basis, np.linalg.inv(coordinates)

    def _whitener(self, force: Floats) -> Floats:
        """Turns signals under two such forces, N, into standard deviations."""
        spread = self._noise + float(force @ force) * self._misfit
        return np.asarray(np.linalg.inv(np.linalg.cholesky(spread)))

    def _begin(self, signals: Floats, at: Floats, standing: Standing | None) -> _Path:
        """A descent's first place."""
        start = np.array(at)
        start[:, :2] = np.clip(start[:, :2], 0.0, self._extent)
        start[:, 2] = np.clip(start[:, 2], *self._limits)
        whiten = self._whitener(np.exp(start[:, 2]))
        found = self._weighed(signals, start, whiten, standing)
        return found._replace(damping=1e-2, steps=0)

    def _advance(
        self, signals: Floats, path: _Path, standing: Standing | None, steps: int
    ) -> _Path:
        """As many damped Gauss-Newton steps further, or to the end."""
        while not path.done and path.steps < steps:
            curve = path.slopes @ path.slopes.T
            pull = path.slopes @ path.residual
            curve[np.diag_indices_from(curve)] += self._level
            if standing is not None:
                sure = np.linalg.inv(standing.spread)
                curve[:2, :2] += sure
                pull[:2] -= sure @ (path.at[0, :2] - standing.place)
            curve[np.diag_indices_from(curve)] *= 1 + path.damping
            move = np.linalg.solve(curve, pull).reshape(2, 3)
            new = path.at + np.clip(move, -_STRIDE, _STRIDE)
            new[:, :2] = np.clip(new[:, :2], 0.0, self._extent)
            new[:, 2] = np.clip(new[:, 2], *self._limits)
            tried = self._weighed(signals, new, path.whiten, standing)
            count = path.steps + 1
            if tried.cost > path.cost:
                damping = max(path.damping * 10, 1e-3)
                path = path._replace(damping=damping, steps=count, done=damping > 1e6)
                continue
            fell = path.cost - tried.cost
            if count <= _REWEIGHED:
                whiten = self._whitener(np.exp(new[:, 2]))
                tried = self._weighed(signals, new, whiten, standing)
            path = tried._replace(
                damping=max(path.damping / 10, 1e-9), steps=count, done=fell < _SETTLED
            )
        return path

    def _weighed(
        self, signals: Floats, at: Floats, whiten: Floats, standing: Standing | None
    ) -> _Path:
        """Slopes, residual and cost at a place."""
        force = np.exp(at[:, 2])
        said = self._pair.at(at[:, :2], force)
        said.slopes[[2, 5]] *= force[:, None]
        residual = whiten @ (signals - said.values)
        cost = 0.5 * float(residual @ residual)
        if standing is not None:
            away = at[0, :2] - standing.place
            cost += 0.5 * float(away @ np.linalg.solve(standing.spread, away))
        return _Path(at, whiten, said.slopes @ whiten.T, residual, cost, 0.0, 0, done=False)

    def _posterior(self, found: _Path, standing: Standing | None) -> TouchPosterior:
        """What a descent has come to; how many touches there are is judged by the reading alone."""
        force = np.exp(found.at[:, 2])
        curve = found.slopes @ found.slopes.T
        curve[np.diag_indices_from(curve)] += self._level
        volume = float(np.linalg.slogdet(curve)[1])
        if standing is not None:
            curve[:2, :2] += np.linalg.inv(standing.spread)
        inverse = np.linalg.inv(curve)
        values, spread = np.zeros((2, 5)), np.zeros((2, 5, 5))
        values[:, :2], values[:, 4] = found.at[:, :2], -force
        for k in (0, 1):
            turn = np.array([1.0, 1.0, -force[k]])
            block = inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] * turn[:, None] * turn
            spread[k][np.ix_([0, 1, 4], [0, 1, 4])] = block
        misfit = float(found.residual @ found.residual)
        # Nearer to each other they are one touch.
        two = np.hypot(*(values[0, :2] - values[1, :2])) > _APART
        evidence = (
            -0.5 * misfit
            + float(np.linalg.slogdet(found.whiten / math.sqrt(2 * math.pi))[1])
            + self._log_prior
            + math.log(2)
            + 0.5 * (6 * math.log(2 * math.pi) - volume)
            + self._chance
        )
        return TouchPosterior(values, spread, misfit, evidence if two else -math.inf)
