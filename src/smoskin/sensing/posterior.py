"""The touch, or the two touches, that best explain what chips read, and how sure that is.

Unknown are place, drag and the logarithm of the normal force, in damped Gauss-Newton steps from
the place of a coarse grid whose answers come nearest; the covariance is that of the linearised
problem. Past the outermost vertices the reading does not tell the place: there the posterior is
summed over the strip. Evidence for no, one or two touches is Laplace's approximation with stated
priors. Hides starts, damping and whitening.
"""

import math
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.magnetics.material import REFERENCE_TEMPERATURE
from smoskin.sensing.response import ResponseTable
from smoskin.sensing.touch_basis import PointLine
from smoskin.sensing.touch_priors import TouchPosterior, TouchPriors

_GRID: Final = (16, 20)
"""Coarse places from rim to rim where a single touch may start."""
_PAIR_GRID: Final = (7, 9)
_TYPICAL: Final = 0.5
"""N: force at which coarse answers are compared."""
_STEPS: Final = 25
_SETTLED: Final = 1e-3
"""Fall of half the squared residual at which steps end."""
_REWEIGHED: Final = (2,)
"""Steps before which the misfit is weighed by the force found so far."""
_APART: Final = 0.02
"""m: starts are tried this far apart."""
_PAIR_STARTS: Final = 8
"""Places from which pairs are sought."""
_SCAN: Final = 25
"""Places along a strip in which the reading says little about the place."""


class TouchSolver:
    """Solves single readings of one skin.

    Parameters
    ----------
    table : ResponseTable
        Of the skin; modes that it still has count as misfit.
    noise : Floats, shape (C, C)
        T^2: covariance of signals of a skin at rest.
    priors : TouchPriors, optional
    """

    def __init__(
        self, table: ResponseTable, noise: Floats, priors: TouchPriors | None = None
    ) -> None:
        self.table = table
        self.priors = priors or TouchPriors()
        self._noise = noise
        self._misfit = table.misfit + _mode_energy(table)
        self._extent = table.basis.extent
        straight = self.priors.drag_spread == 0
        self._free = np.array([0, 1, 4] if straight else [0, 1, 2, 3, 4])
        drag = 0.0 if straight else self.priors.drag_spread**-2
        # A place is uniform on the skin; the curvature of its variance keeps blind strips finite.
        place = 12 / self._extent**2
        self._prior = np.array([*place, drag, drag, 0.0])
        self._force_range = math.log(table.forces[1] / table.forces[0])
        self._limits = math.log(table.forces[0] / 5), math.log(table.forces[1] * 3)
        sign, self._quiet = np.linalg.slogdet(2 * np.pi * noise)
        if sign <= 0:
            raise ArgumentError("noise must be a covariance that is positive definite")
        self._calm = np.linalg.inv(noise)
        lines = table.basis.lines_x, table.basis.lines_y
        reach = table.basis.radius
        self._strips = [
            (float(line[0]) + reach, float(line[-1]) - reach, float(end))
            for line, end in zip(lines, self._extent, strict=True)
        ]
        # Steps that enter a blind strip would find no slope to leave it by.
        self._lines = tuple(PointLine(line, reach) for line in lines)
        self._reach = np.array(
            [
                (max(float(line[0]) - reach / 2, 0.0), min(float(line[-1]) + reach / 2, float(end)))
                for line, end in zip(lines, self._extent, strict=True)
            ]
        ).T
        self.warm_to(REFERENCE_TEMPERATURE)

    def warm_to(self, temperature: float) -> None:
        """Take the rubber to be this warm, degC."""
        self._point = self.table.point_table(temperature)
        self._whiten = self._whitener(_TYPICAL**2)
        self._starts = self._single_starts()
        self._pairs: tuple[Floats, Floats, Floats] | None = None

    def silence(self, signals: Floats) -> tuple[float, float]:
        """Squared norm of signals in their noise, and the evidence that nothing touches.

        The norm is chi-square of C where that is so.
        """
        squared = float(signals @ self._calm @ signals)
        return squared, -0.5 * (squared + self._quiet) + math.log(self.priors.chances[0] or 1e-300)

    def one(self, signals: Floats, guess: Floats | None = None) -> TouchPosterior:
        """The single touch that explains signals (C,) best; from a guess (5,), where given."""
        if guess is not None:
            found = self._descend(signals, _to_unknowns(guess))
            if found.cost < 4 * len(signals):
                return self._posterior(signals, found)
        places, basis, loads = self._starts
        inside = basis @ (self._whiten @ signals)
        force = np.einsum("gij,gj->gi", loads, inside)
        explained = (inside * inside).sum(axis=1)
        explained[~(force[:, 2] < 0)] = -np.inf
        best: _Descent | None = None
        for _ in range(3):
            g = int(explained.argmax())
            if not np.isfinite(explained[g]):
                break
            found = self._descend(signals, _to_unknowns(np.concatenate([places[g], force[g]])))
            if best is None or found.cost < best.cost:
                best = found
            if best.cost < 2 * len(signals):
                break
            explained[np.hypot(*(places - places[g]).T) < _APART] = -np.inf
        if best is None:
            best = self._descend(signals, _to_unknowns(np.array([*self._extent / 2, 0, 0, -0.1])))
        return self._posterior(signals, best)

    def two(self, signals: Floats, guess: Floats | None = None) -> TouchPosterior:
        """The two straight touches that explain signals (C,) best; from a guess (2, 5)."""
        if guess is not None:
            near = np.concatenate([guess[:, :2], np.log(-guess[:, 4:])], axis=1).ravel()
            found = self._descend_pair(signals, near)
            if found.cost < 4 * len(signals):
                return self._pair_posterior(found)
        places, basis, loads = self._pair_starts()
        inside = basis @ (self._whiten @ signals)
        force = np.einsum("gij,gj->gi", loads, inside)
        explained = (inside * inside).sum(axis=1)
        explained[~(force > self.table.forces[0] / 2).all(axis=1)] = -np.inf
        best: _Descent | None = None
        for _ in range(_PAIR_STARTS):
            g = int(explained.argmax())
            if not np.isfinite(explained[g]):
                break
            start = np.concatenate([places[g], np.log(force[g])[:, None]], axis=1).ravel()
            found = self._descend_pair(signals, start)
            if best is None or found.cost < best.cost:
                best = found
            if best.cost < 2 * len(signals):
                break
            explained[np.abs(places - places[g]).max(axis=(1, 2)) < _APART] = -np.inf
        if best is None:
            middle = np.array([[0.25, 0.25], [0.75, 0.75]]) * self._extent
            best = self._descend_pair(
                signals, np.concatenate([middle, np.full((2, 1), -1.0)], axis=1).ravel()
            )
        return self._pair_posterior(best)

    def _whitener(self, squared: float, product: float = 0.0) -> Floats:
        """Turns signals into standard deviations at this squared force, N^2."""
        spread = self._noise + squared * self._misfit + product * self.table.pair_misfit
        return np.asarray(np.linalg.inv(np.linalg.cholesky(spread)))

    def _single_starts(self) -> tuple[Floats, Floats, Floats]:
        """Coarse places (G, 2), their answers' orthonormal bases (G, 3, C) and loads (G, 3, 3)."""
        places = _grid(self._extent, _GRID)
        force = np.array([0.0, 0.0, -_TYPICAL])
        slopes = self._point.scan(places[:, 0], places[:, 1], force)[1][:, 2:]
        white = slopes @ self._whiten.T
        drags = np.zeros((3, 3))
        spread = self.priors.drag_spread
        drags[[0, 1], [0, 1]] = 1 / spread if spread else 1e6
        both = np.concatenate([np.swapaxes(white, 1, 2), np.broadcast_to(drags, (len(white), 3, 3))]
                              , axis=1)  # fmt: skip
        bases, coordinates = np.linalg.qr(both)
        basis = np.swapaxes(bases[:, : white.shape[2]], 1, 2)
        return places, np.ascontiguousarray(basis), np.linalg.inv(coordinates)

    def _pair_starts(self) -> tuple[Floats, Floats, Floats]:
        """Pairs of coarse places (G, 2, 2), bases (G, 2, C) and loads (G, 2, 2)."""
        if self._pairs is None:
            grid = _grid(self._extent, _PAIR_GRID, rim=False)
            pairs = np.array(
                [(a, b) for a, b in combinations(range(len(grid)), 2)
                 if np.hypot(*(grid[a] - grid[b])) > _APART]
            )  # fmt: skip
            places = grid[pairs]
            force = np.zeros((len(places), 2, 3))
            answers = []
            for k in (0, 1):
                force[:] = 0.0
                force[:, k, 2] = -_TYPICAL
                answers.append(self.table.together(places, force) / _TYPICAL)
            white = np.stack(answers, axis=-1)
            white = self._whiten @ white
            bases, coordinates = np.linalg.qr(white)
            self._pairs = (places, np.swapaxes(bases, 1, 2).copy(), np.linalg.inv(coordinates))
        return self._pairs

    def _descend(self, signals: Floats, start: Floats) -> "_Descent":
        """Damped Gauss-Newton steps of one touch from these unknowns."""
        free, prior = self._free, self._prior[self._free]
        at = start.copy()
        if len(free) == 3:
            at[2:4] = 0.0
        at[:2] = np.clip(at[:2], *self._reach)
        at[4] = min(max(at[4], self._limits[0]), self._limits[1])
        gap, slopes = self._single(signals, at)
        whiten = self._whitener(_squared(at))
        damping = 1e-4
        cost = math.inf
        for step in range(_STEPS):
            if step in _REWEIGHED:
                whiten = self._whitener(_squared(at))
                cost = math.inf
            if cost == math.inf:
                residual = whiten @ gap
                cost = 0.5 * float(residual @ residual + prior[2:-1] @ at[free][2:-1] ** 2)
            inner = slopes[free] @ whiten.T
            curve = inner @ inner.T
            # The place's prior is level: it bends the covariance, not the steps.
            pull = inner @ residual
            pull[2:-1] -= prior[2:-1] * at[free][2:-1]
            diagonal = curve.ravel()[:: len(free) + 1]
            diagonal += prior
            diagonal *= 1 + damping
            move = np.linalg.solve(curve, pull)
            if 0.5 * float(move @ pull) < _SETTLED:
                break
            new = at.copy()
            new[free] += move
            new[:2] = np.clip(new[:2], *self._reach)
            new[4] = min(max(new[4], at[4] - 1.0, self._limits[0]), at[4] + 1.0, self._limits[1])
            new_gap, new_slopes = self._single(signals, new)
            new_residual = whiten @ new_gap
            drags = prior[2:-1] @ new[free][2:-1] ** 2
            new_cost = 0.5 * float(new_residual @ new_residual + drags)
            if new_cost <= cost:
                fell = cost - new_cost
                at, gap, slopes, residual, cost = new, new_gap, new_slopes, new_residual, new_cost
                damping = max(damping / 10, 1e-9)
                if fell < _SETTLED and step > max(_REWEIGHED):
                    break
            else:
                damping = max(damping * 10, 1e-3)
                if damping > 1e6:
                    break
        return _Descent(at, slopes @ whiten.T, whiten @ gap, 2 * cost, whiten)

    def _single(self, signals: Floats, at: Floats) -> tuple[Floats, Floats]:
        """What is left of the signals (C,), and slopes by the unknowns (5, C), T."""
        force = np.array([at[2], at[3], -math.exp(at[4])])
        value, slopes = self._point.at(at[0], at[1], force)
        slopes[4] *= force[2]
        return signals - value, slopes

    def _posterior(self, signals: Floats, found: "_Descent") -> TouchPosterior:
        """What a descent has come to, with the strips of the rim summed over."""
        free, at = self._free, found.at
        curve = found.slopes[free] @ found.slopes[free].T
        curve[np.diag_indices_from(curve)] += self._prior[free]
        spread = np.zeros((5, 5))
        spread[np.ix_(free, free)] = np.linalg.inv(curve)
        force = -math.exp(at[4])
        drags = len(free) - 3
        log_prior = -math.log(float(np.prod(self._extent)) * self._force_range)
        if drags:
            log_prior -= drags * 0.5 * math.log(2 * math.pi * self.priors.drag_spread**2)
        evidence = (
            -0.5 * found.cost
            + float(np.linalg.slogdet(found.whiten / math.sqrt(2 * math.pi))[1])
            + log_prior
            + 0.5 * (len(free) * math.log(2 * math.pi) - np.linalg.slogdet(curve)[1])
            + math.log(self.priors.chances[1] or 1e-300)
        )
        values = np.array([at[0], at[1], at[2], at[3], force])
        turn = np.array([1.0, 1.0, 1.0, 1.0, force])
        spread *= turn[:, None] * turn
        blind = [
            axis for axis, (low, high, _) in enumerate(self._strips) if not low < at[axis] < high
        ]
        if blind:
            values, spread = self._sum_over(signals, found, blind, values, spread)
        return TouchPosterior(values[None], spread[None], found.cost, evidence)

    def _sum_over(
        self, signals: Floats, found: "_Descent", blind: list[int], values: Floats, spread: Floats
    ) -> tuple[Floats, Floats]:
        """Mean and covariance over the strips along some axes, all else fitted linearly."""
        lines = []
        for axis in blind:
            low, high, end = self._strips[axis]
            inner = 2 * self.table.basis.radius
            ends = (0.0, low + inner) if values[axis] <= low else (high - inner, end)
            edges = np.linspace(*ends, _SCAN + 1)
            lines.append((edges[1:] + edges[:-1]) / 2)
        mesh = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, len(blind))
        places = np.tile(values[:2], (len(mesh), 1))
        places[:, blind] = mesh
        said, slopes = self._point.scan(places[:, 0], places[:, 1], values[2:])
        rest = [axis for axis in (0, 1) if axis not in blind] + [k for k in self._free if k > 1]
        white = slopes[:, rest] @ found.whiten.T
        residual = (signals - said) @ found.whiten.T
        curve = white @ np.swapaxes(white, 1, 2)
        prior = self._prior[rest] * (np.array(rest) > 1)
        curve[:, np.arange(len(rest)), np.arange(len(rest))] += prior
        pull = np.einsum("bkc,bc->bk", white, residual) - prior * values[rest]
        move = np.linalg.solve(curve, pull[..., None])[..., 0]
        cost = (residual**2).sum(axis=1) - np.einsum("bk,bk->b", pull, move)
        weight = np.exp(-0.5 * (cost - cost.min()))
        weight /= weight.sum()
        cases = np.tile(values, (len(mesh), 1))
        cases[:, :2] = places
        cases[:, rest] += move
        middle = weight @ cases
        apart = cases - middle
        within = np.zeros((5, 5))
        # What is fitted at each place keeps the spread that it has there.
        within[np.ix_(rest, rest)] = np.einsum("b,bij->ij", weight, np.linalg.inv(curve))
        for axis, line in zip(blind, lines, strict=True):
            within[axis, axis] += (line[1] - line[0]) ** 2 / 12
        middle[:2] = np.clip(middle[:2], 0.0, self._extent)
        middle[4] = min(middle[4], -self.table.forces[0] / 100)
        return middle, within + (weight[:, None] * apart).T @ apart

    def _descend_pair(self, signals: Floats, start: Floats) -> "_Descent":
        """Damped Gauss-Newton steps of two straight touches, unknowns (x, y, log force) twice."""
        at = start.copy()
        whiten = self._pair_whitener(at)
        state = self._double(signals, at, whiten)
        damping = 1e-2
        level = np.tile([*12 / self._extent**2, 0.0], 2)
        for step in range(2 * _STEPS):
            slopes, residual, cost = state
            curve = slopes @ slopes.T
            curve[np.diag_indices_from(curve)] += level
            curve[np.diag_indices_from(curve)] *= 1 + damping
            move = np.linalg.solve(curve, slopes @ residual).reshape(2, 3)
            new = at.reshape(2, 3) + np.clip(move, [-0.03, -0.03, -1.0], [0.03, 0.03, 1.0])
            new[:, :2] = np.clip(new[:, :2], *self._reach)
            new[:, 2] = np.clip(new[:, 2], *self._limits)
            tried = self._double(signals, new.ravel(), whiten)
            if tried[2] <= cost:
                fell, at, state = cost - tried[2], new.ravel(), tried
                damping = max(damping / 10, 1e-9)
                if fell < _SETTLED:
                    break
                if step < 6:
                    whiten = self._pair_whitener(at)
                    state = self._double(signals, at, whiten)
            else:
                damping = max(damping * 10, 1e-3)
                if damping > 1e6:
                    break
        return _Descent(at, state[0], state[1], 2 * state[2], whiten)

    def _pair_whitener(self, at: Floats) -> Floats:
        force = np.exp(at[[2, 5]])
        return self._whitener(float(force @ force), float(force.prod()))

    def _double(self, signals: Floats, at: Floats, whiten: Floats) -> tuple[Floats, Floats, float]:
        """Slopes (6, C) and residual (C,) in standard deviations, and half the squared misfit."""
        table, count = self.table, self.table.count
        value, slopes = np.zeros(count), np.zeros((6, count))
        hats = []
        force = np.exp(at[[2, 5]])
        for k in (0, 1):
            x, y = at[3 * k], at[3 * k + 1]
            push = np.array([0.0, 0.0, -force[k]])
            said, by = self._point.at(x, y, push)
            value += said
            slopes[3 * k : 3 * k + 2] += by[:2]
            slopes[3 * k + 2] -= by[4]
            hats.append(self._vertex_rates(x, y))
        vertices = hats[0].shape[1]
        flat = table.coupling.transpose(1, 0, 2, 3).reshape(vertices, -1)
        for one, other in ((0, 1), (1, 0)):
            # (3, 2, H, C): this touch's share and its slopes along x and y.
            mine = (hats[one] @ flat).reshape(3, 2, vertices, count)
            both = np.einsum("gh,akhc->gakc", hats[other], mine)
            press, beside = force[one], force[other]
            extra = press * (both[..., 0, :] + beside * both[..., 1, :])
            value += extra[0, 0]
            slopes[3 * one : 3 * one + 2] += extra[0, 1:]
            slopes[3 * other : 3 * other + 2] += extra[1:, 0]
            slopes[3 * one + 2] += extra[0, 0] / press
            slopes[3 * other + 2] += press * both[0, 0, 1]
        slopes[[2, 5]] *= force[:, None]
        residual = whiten @ (signals - value)
        return slopes @ whiten.T, residual, 0.5 * float(residual @ residual)

    def _vertex_rates(self, x: float, y: float) -> Floats:
        """Shares of the vertices and their slopes along x and y, (3, H)."""
        basis = self.table.basis
        on_x, by_x = self._lines[0].at(x)[:, : len(basis.lines_x)]
        on_y, by_y = self._lines[1].at(y)[:, : len(basis.lines_y)]
        pairs = [np.outer(on_x, on_y), np.outer(by_x, on_y), np.outer(on_x, by_y)]
        return np.stack(pairs).reshape(3, -1)

    def _pair_posterior(self, found: "_Descent") -> TouchPosterior:
        """What a descent of two touches has come to."""
        at = found.at.reshape(2, 3)
        force = np.exp(at[:, 2])
        curve = found.slopes @ found.slopes.T
        curve[np.diag_indices_from(curve)] += np.tile([*12 / self._extent**2, 1e-9], 2)
        inverse = np.linalg.inv(curve)
        values, spread = np.zeros((2, 5)), np.zeros((2, 5, 5))
        values[:, :2], values[:, 4] = at[:, :2], -force
        for k in (0, 1):
            turn = np.array([1.0, 1.0, -force[k]])
            block = inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] * turn[:, None] * turn
            spread[k][np.ix_([0, 1, 4], [0, 1, 4])] = block
            for axis, (low, high, end) in enumerate(self._strips):
                inner, outer = self._reach[:, axis]
                if not inner < values[k, axis] < outer:
                    reach = self.table.basis.radius
                    ends = (0.0, low - reach) if values[k, axis] < low else (high + reach, end)
                    values[k, axis] = sum(ends) / 2
                    spread[k, axis, axis] = max((ends[1] - ends[0]) ** 2 / 12, 0.0)
                    others = [o for o in (0, 1, 4) if o != axis]
                    spread[k, axis, others] = spread[k, others, axis] = 0.0
        log_prior = -2 * math.log(float(np.prod(self._extent)) * self._force_range)
        evidence = (
            -0.5 * found.cost
            + float(np.linalg.slogdet(found.whiten / math.sqrt(2 * math.pi))[1])
            + log_prior
            + math.log(2)
            + 0.5 * (6 * math.log(2 * math.pi) - np.linalg.slogdet(curve)[1])
            + math.log(self.priors.chances[2] or 1e-300)
        )
        return TouchPosterior(values, spread, found.cost, evidence)


class _Descent(NamedTuple):
    """Where steps have ended: unknowns, slopes, residual, squared misfit, whitener."""

    at: Floats
    slopes: Floats
    residual: Floats
    cost: float
    whiten: Floats


def _to_unknowns(values: Floats) -> Floats:
    """(x, y, Fx, Fy, Fz) with the logarithm of the normal force."""
    at = np.array(values, dtype=np.float64)
    at[4] = math.log(max(-at[4], 1e-3))
    return at


def _squared(at: Floats) -> float:
    """Squared force of one touch's unknowns, N^2."""
    return float(at[2] ** 2 + at[3] ** 2 + math.exp(2 * at[4]))


def _grid(extent: Floats, counts: tuple[int, int], *, rim: bool = True) -> Floats:
    """Places from rim to rim, or the middles of as many fields, (G, 2)."""
    lines = [
        np.linspace(0, end, count) if rim else (np.arange(count) + 0.5) * end / count
        for end, count in zip(extent, counts, strict=True)
    ]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)


def _mode_energy(table: ResponseTable) -> Floats:
    """What the modes leave open in a touch of a newton, mean over the skin, (C, C), T^2/N^2."""
    places = _grid(table.basis.extent, (7, 9))
    force = np.tile([0.0, 0.0, -_TYPICAL], (len(places), 1))
    open_ways = table.mode_signals(places, force) / _TYPICAL
    return np.asarray(np.einsum("bkc,bkd->cd", open_ways, open_ways) / len(places))
