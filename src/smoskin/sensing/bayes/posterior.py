"""Posterior and evidence of K touches at once, given what chips read.

Decides what is believed and what it costs; hides the descent to the likeliest touches and how
misfit is weighed by their forces. One and two touches differ by their table's answer alone.
"""

import math
from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.response.point import PointTable
from smoskin.sensing.response.table import ResponseTable

_STEPS: Final = 15
"""Steps at most; what is not settled then is followed at the next reading."""
_SETTLED: Final = 1e-3
"""Fall of half the squared residual at which steps end."""
_REWEIGHED: Final = 6
"""First steps, before which the misfit is weighed by the forces found so far."""
_DAMPING: Final = 1e-3
_STRIDE: Final = (0.03, 1.0)
"""Longest step of a place, m, and of the logarithm of a force."""
_BLUR: Final = 1e-9
"""Information on the logarithm of a force that keeps even a blind skin's covariance finite."""
APART: Final = 0.02
"""Distance, m, nearer than which two touches are one."""

Answer: TypeAlias = Callable[[Floats], tuple[Floats, Floats]]
"""Signals f(u) (C,), T, of unknowns u (U,), and their slopes J (U, C)."""


class Descent(NamedTuple):
    """End of a descent."""

    unknowns: Floats
    """Unknowns u, (U,)."""
    squared: float
    """Squared force by which the misfit is weighed, N^2."""
    slopes: Floats
    """Whitened slopes J W^T, (U, C)."""
    misfit: float
    """Squared length of the whitened residual, and of drags in their prior's spread."""
    cost: float
    """Half the misfit, and of what is known of a touch that stands."""


class TouchProblem:
    """K touches that explain signals.

    Parameters
    ----------
    answer, touches : Answer and int
        Signals of K touches, and K.
    table : ResponseTable
        Table of the skin, for its extent and forces.
    noise, misfit : Floats, shape (C, C)
        Covariances N, of signals at rest, T^2, and M, of what the table misses, T^2/N^2;
        `ArgumentError` if the noise is none.
    priors : TouchPriors

    Notes
    -----
    The unknowns u are x, y and log(-Fz) of each touch, with Fx and Fy before the last where a
    single touch may drag. With W^T W = (N + F^2 M)^-1, F^2 the sum of all squared forces,

        log p(s, u | K) = -1/2 |W (s - f(u))|^2 + log det(W / sqrt(2 pi)) + log p(u),

    where p(u) is level in place and log force and normal in drags. Gauss-Newton steps, damped by
    Levenberg's and Marquardt's rule, lead to its maximum; there the covariance is H^-1 with
    H = (W J)(W J)^T - d^2 log p(u) / du^2, a level place counting as normal of its variance, and
    Laplace's approximation of the evidence is

        log p(s | K) = log p(s, u | K) + log K! + U/2 log(2 pi) - 1/2 log det H.
    """

    def __init__(
        self,
        answer: Answer,
        touches: int,
        table: ResponseTable,
        noise: Floats,
        misfit: Floats,
        priors: TouchPriors,
    ) -> None:
        self._answer, self._count = answer, touches
        self._drags = drags = touches == 1 and priors.drag_spread > 0
        self.rows = np.array([0, 1, 2, 3, 4] if drags else [0, 1, 4])
        """Which of (x, y, Fx, Fy, Fz) are unknown."""
        # Along these axes noise and misfit are both apart, so that a force only scales them.
        sign, log_det_noise = np.linalg.slogdet(2 * math.pi * noise)
        if sign <= 0:
            raise ArgumentError("noise must be a covariance that is positive definite")
        white = np.linalg.inv(np.linalg.cholesky(noise))
        power, axes = np.linalg.eigh(white @ misfit @ white.T)
        self._axes, self._power = axes.T @ white, np.maximum(power, 0.0)
        extent, (least, most) = table.basis.extent, table.forces
        precision = priors.drag_spread**-2 if drags else 0.0

        def each(*values: float) -> Floats:
            """The values of (x, y, Fx, Fy, log press) of every touch's unknowns."""
            return np.tile(np.array(values)[self.rows], touches)

        self._low = each(0.0, 0.0, -math.inf, -math.inf, math.log(least / 5))
        self._high = each(*extent, math.inf, math.inf, math.log(most * 3))
        self._stride = each(_STRIDE[0], _STRIDE[0], math.inf, math.inf, _STRIDE[1])
        self._drag_precision = each(0.0, 0.0, precision, precision, 0.0)
        self._curvature = each(*12 / extent**2, precision, precision, _BLUR)
        # All of the evidence that depends on neither signals nor unknowns.
        volume = math.log(float(np.prod(extent)) * math.log(most / least))
        self._constant = (
            -0.5 * log_det_noise
            - touches * volume
            + math.lgamma(touches + 1)
            + math.log(priors.chances[touches] or 1e-300)
            + 0.5 * len(self._low) * math.log(2 * math.pi)
            - (math.log(2 * math.pi / precision) if drags else 0.0)
        )

    def whitener(self, squared: float) -> Floats:
        """W (C, C), which turns signals into standard deviations at this squared force, N^2."""
        return np.asarray(self._axes / np.sqrt(1 + squared * self._power)[:, None])

    def descend(
        self, signals: Floats, start: Floats, standing: Standing | None = None, steps: int = _STEPS
    ) -> Descent:
        """Damped Gauss-Newton steps from unknowns (U,), at most so many."""
        at = np.minimum(np.maximum(start, self._low), self._high)
        value, slopes = self._answer(at)
        gap, damping = signals - value, _DAMPING
        for step in range(steps):
            if step < _REWEIGHED:
                squared = self._squared(at)
                whiten = self.whitener(squared)
                inner, residual = slopes @ whiten.T, whiten @ gap
                misfit, cost = self._cost(residual, at, standing)
            curve = inner @ inner.T
            pull = inner @ residual - self._drag_precision * at
            diagonal = curve.ravel()[:: len(at) + 1]
            # A level place bends the covariance, not the steps.
            diagonal += self._curvature
            if standing is not None:
                curve[:2, :2] += standing.precision
                pull[:2] -= standing.precision @ (at[:2] - standing.place)
            diagonal *= 1 + damping
            move = np.linalg.solve(curve, pull)
            if 0.5 * float(move @ pull) < _SETTLED:
                break
            new = at + np.minimum(np.maximum(move, -self._stride), self._stride)
            new = np.minimum(np.maximum(new, self._low), self._high)
            value, new_slopes = self._answer(new)
            new_gap = signals - value
            new_residual = whiten @ new_gap
            new_misfit, new_cost = self._cost(new_residual, new, standing)
            if new_cost > cost:
                damping = max(damping * 10, 1e-3)
                if damping > 1e6:
                    break
                continue
            fell = cost - new_cost
            at, gap, slopes, residual = new, new_gap, new_slopes, new_residual
            misfit, cost, inner = new_misfit, new_cost, slopes @ whiten.T
            damping = max(damping / 10, 1e-9)
            if fell < _SETTLED:
                break
        return Descent(at, squared, inner, misfit, cost)

    def posterior(self, found: Descent, standing: Standing | None = None) -> TouchPosterior:
        """What a descent has come to; how many touches there are is judged by the reading alone."""
        count, rows = self._count, self.rows
        information = found.slopes @ found.slopes.T
        information.ravel()[:: len(information) + 1] += self._curvature
        log_det = float(np.linalg.slogdet(information)[1])
        if standing is not None:
            information[:2, :2] += standing.precision
        values, covariance = np.zeros((count, 5)), np.zeros((count, 5, 5))
        values[:, rows] = found.unknowns.reshape(count, -1)
        values[:, 4] = -np.exp(values[:, 4])
        inverse = np.linalg.inv(information)
        for k, value in enumerate(values):
            scale = np.ones(len(rows))
            scale[-1] = value[4]
            part = slice(k * len(rows), (k + 1) * len(rows))
            covariance[k][np.ix_(rows, rows)] = inverse[part, part] * scale[:, None] * scale
        evidence = self._constant - 0.5 * (
            found.misfit + float(np.log1p(found.squared * self._power).sum()) + log_det
        )
        if count == 2 and math.dist(values[0, :2], values[1, :2]) < APART:
            evidence = -math.inf
        return TouchPosterior(values, covariance, found.misfit, evidence)

    def unknowns(self, values: Floats) -> Floats:
        """Unknowns (U,) of touches (K, 5)."""
        at = np.array(values, dtype=np.float64)
        at[:, 4] = np.log(np.maximum(-at[:, 4], 1e-3))
        return at[:, self.rows].ravel()

    def _squared(self, at: Floats) -> float:
        """Squared force F^2 of all touches, N^2."""
        last = len(self.rows) - 1
        forces = [math.exp(log) for log in at[last :: last + 1]]
        if self._drags:
            forces += [at[2], at[3]]
        return float(sum(force * force for force in forces))

    def _cost(self, residual: Floats, at: Floats, standing: Standing | None) -> tuple[float, float]:
        """Squared misfit with that of drags, and half of it with that of a place that is known."""
        misfit = float(residual @ residual)
        if self._drags:
            misfit += float((self._drag_precision * at) @ at)
        if standing is None:
            return misfit, 0.5 * misfit
        away = at[:2] - standing.place
        return misfit, 0.5 * misfit + 0.5 * float(away @ standing.precision @ away)


def single_answer(point: PointTable, *, straight: bool) -> Answer:
    """Signals of one touch by x, y, its drags and the logarithm of its press."""

    def answer(at: Floats) -> tuple[Floats, Floats]:
        press = -math.exp(at[-1])
        drags = (0.0, 0.0) if straight else (at[2], at[3])
        values, slopes = point.at(at[0], at[1], np.array([*drags, press]))
        slopes[4] *= press
        return values, slopes[[0, 1, 4]] if straight else slopes

    return answer


def pair_answer(point: PointTable) -> Answer:
    """Signals of two straight touches by x, y and the logarithm of the press of each."""

    def answer(at: Floats) -> tuple[Floats, Floats]:
        each = at.reshape(2, 3)
        press = np.exp(each[:, 2])
        values, slopes = point.pair(each[:, :2], press)
        slopes[[2, 5]] *= press[:, None]
        return values, slopes

    return answer
