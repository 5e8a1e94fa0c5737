"""The touch, or the two touches, that best explain what chips read, and how sure that is.

Unknown are place, drag and the logarithm of the normal force, in damped Gauss-Newton steps from
the place of a coarse grid whose answers come nearest; the covariance is that of the linearised
problem. Evidence for no, one or two touches is Laplace's approximation with stated priors. Hides
starts, damping and whitening.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.origami.geometry import places_to_the_rim
from smoskin.sensing.bayes.pair_solver import PairSolver
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.response.table import ResponseTable

_GRID: Final = (16, 20)
"""Coarse places from rim to rim where a single touch may start."""
_TYPICAL: Final = 0.5
"""N: force at which coarse answers are compared."""
_STEPS: Final = 25
_SETTLED: Final = 1e-3
"""Fall of half the squared residual at which steps end."""
_REWEIGHED: Final = (2,)
"""Steps before which the misfit is weighed by the force found so far."""
_APART: Final = 0.02
"""m: starts are tried this far apart."""


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
        self.misfit = table.misfit + _mode_energy(table)
        self._extent = table.basis.extent
        straight = self.priors.drag_spread == 0
        self._free = np.array([0, 1, 4] if straight else [0, 1, 2, 3, 4])
        self._block = np.ix_(self._free, self._free)
        drag = 0.0 if straight else self.priors.drag_spread**-2
        # A place is uniform on the skin; its variance's curvature keeps even a blind skin's finite.
        place = 12 / self._extent**2
        self._prior = np.array([*place, drag, drag, 0.0])[self._free]
        self._force_range = math.log(table.forces[1] / table.forces[0])
        self._limits = math.log(table.forces[0] / 5), math.log(table.forces[1] * 3)
        sign, self._quiet = np.linalg.slogdet(2 * np.pi * noise)
        if sign <= 0:
            raise ArgumentError("noise must be a covariance that is positive definite")
        self._calm = np.linalg.inv(noise)
        # Along these ways noise and misfit are both apart, so that a force only scales them.
        white = np.linalg.inv(np.linalg.cholesky(noise))
        power, turn = np.linalg.eigh(white @ self.misfit @ white.T)
        self._ways, self._power = turn.T @ white, np.maximum(power, 0.0)
        self._whiten = self._whitener(_TYPICAL**2)
        self._pairs: PairSolver | None = None
        self.warm_to(REFERENCE_TEMPERATURE)

    def warm_to(self, temperature: float) -> None:
        """Take the rubber to be this warm, degC."""
        self._point = self.table.point_table(temperature)
        self._starts = self._single_starts()
        if self._pairs is not None:
            self._pairs.warm_to(self._point)

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
                return self._posterior(found)
        places, basis, loads = self._starts
        inside = (basis @ (self._whiten @ signals)).reshape(-1, 3)
        explained = (inside * inside).sum(axis=1)
        explained[~((loads[:, 2] * inside).sum(axis=1) < 0)] = -np.inf
        best: _Descent | None = None
        for _ in range(3):
            g = int(explained.argmax())
            if not np.isfinite(explained[g]):
                break
            start = np.concatenate([places[g], loads[g] @ inside[g]])
            found = self._descend(signals, _to_unknowns(start))
            if best is None or found.cost < best.cost:
                best = found
            if best.cost < 2 * len(signals):
                break
            explained[np.hypot(*(places - places[g]).T) < _APART] = -np.inf
        if best is None:
            best = self._descend(signals, _to_unknowns(np.array([*self._extent / 2, 0, 0, -0.1])))
        return self._posterior(best)

    def two(
        self, signals: Floats, guess: Floats | None = None, standing: Standing | None = None
    ) -> TouchPosterior:
        """The two straight touches that explain signals (C,) best; see `PairSolver.solve`."""
        if self._pairs is None:
            self._pairs = PairSolver(self.table, self._noise, self.misfit, self.priors)
            self._pairs.warm_to(self._point)
        return self._pairs.solve(signals, guess, standing)

    def _whitener(self, squared: float) -> Floats:
        """Turns signals into standard deviations at this squared force, N^2."""
        return np.asarray(self._ways / np.sqrt(1 + squared * self._power)[:, None])

    def _single_starts(self) -> tuple[Floats, Floats, Floats]:
        """Coarse places (G, 2), their answers' orthonormal bases (3 G, C) and loads (G, 3, 3)."""
        places = places_to_the_rim(self._extent, _GRID)
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
        return places, basis.reshape(-1, basis.shape[2]), np.linalg.inv(coordinates)

    def _descend(self, signals: Floats, start: Floats) -> "_Descent":
        """Damped Gauss-Newton steps of one touch from these unknowns."""
        free, prior = self._free, self._prior
        at = start.copy()
        if len(free) == 3:
            at[2:4] = 0.0
        self._bound(at, *self._limits)
        gap, slopes = self._single(signals, at)
        damping = 1e-4
        for step in range(_STEPS):
            if step == 0 or step in _REWEIGHED:
                whiten = self._whitener(_squared(at))
                residual = whiten @ gap
                cost = self._cost(residual, at)
            inner = slopes[free] @ whiten.T
            curve = inner @ inner.T
            # The place's prior is level: it bends the covariance, not the steps.
            pull = inner @ residual
            pull[2:-1] -= prior[2:-1] * at[free[2:-1]]
            diagonal = curve.ravel()[:: len(free) + 1]
            diagonal += prior
            diagonal *= 1 + damping
            move = np.linalg.solve(curve, pull)
            if 0.5 * float(move @ pull) < _SETTLED:
                break
            new = at.copy()
            new[free] += move
            low, high = self._limits
            self._bound(new, max(at[4] - 1.0, low), min(at[4] + 1.0, high))
            new_gap, new_slopes = self._single(signals, new)
            new_residual = whiten @ new_gap
            new_cost = self._cost(new_residual, new)
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
        return _Descent(at, slopes @ whiten.T, residual, 2 * cost, whiten)

    def _bound(self, at: Floats, low: float, high: float) -> None:
        """Put unknowns back on the skin, and the logarithm of the force between these."""
        at[0] = min(max(at[0], 0.0), self._extent[0])
        at[1] = min(max(at[1], 0.0), self._extent[1])
        at[4] = min(max(at[4], low), high)

    def _cost(self, residual: Floats, at: Floats) -> float:
        """Half the squared misfit, and that of the drags to their prior."""
        drags = at[self._free[2:-1]]
        return 0.5 * float(residual @ residual + (self._prior[2:-1] * drags) @ drags)

    def _single(self, signals: Floats, at: Floats) -> tuple[Floats, Floats]:
        """What is left of the signals (C,), and slopes by the unknowns (5, C), T."""
        force = np.array([at[2], at[3], -math.exp(at[4])])
        value, slopes = self._point.at(at[0], at[1], force)
        slopes[4] *= force[2]
        return signals - value, slopes

    def _posterior(self, found: "_Descent") -> TouchPosterior:
        """What a descent has come to."""
        free, at = self._free, found.at
        curve = found.slopes[free] @ found.slopes[free].T
        curve.ravel()[:: len(free) + 1] += self._prior
        spread = np.zeros((5, 5))
        spread[self._block] = np.linalg.inv(curve)
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
        return TouchPosterior(values[None], spread[None], found.cost, evidence)


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


def _mode_energy(table: ResponseTable) -> Floats:
    """What the modes leave open in a touch of a newton, mean over the skin, (C, C), T^2/N^2."""
    places = places_to_the_rim(table.basis.extent, (7, 9))
    force = np.tile([0.0, 0.0, -_TYPICAL], (len(places), 1))
    open_ways = table.mode_signals(places, force) / _TYPICAL
    return np.asarray(np.einsum("bkc,bkd->cd", open_ways, open_ways) / len(places))
