"""Posterior and evidence of K touches at once, given what chips read.

Decides what is believed and what it costs; hides the descent to the likeliest touches and how
misfit is weighed by their forces. One and two touches differ by their table's answer alone.
"""

import math
import operator
from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.errors import ArgumentError
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.response.point import PointTable
from smoskin.sensing.response.table import ResponseTable

_STEPS: Final = 15
"""Steps at most; what is not settled then is followed at the next reading."""
_SETTLED: Final = 1e-3
"""Fall of half the squared residual at which steps end."""
_POOR: Final = 10.0
"""Cost a signal past which a fit is poor: there steps end at a fall as many times as large."""
_REWEIGHED: Final = 6
"""First steps, before which the misfit is weighed by the forces found so far."""
_DAMPING: Final = 1e-3
_STRIDE: Final = (0.03, 1.0)
"""Longest step of a place, m, and of the logarithm of a force."""
_NONE: Final = np.zeros(0)
"""What descents have not yet."""
_BLUR: Final = 1e-9
"""Information on the logarithm of a force that keeps even a blind skin's covariance finite."""
APART: Final = 0.02
"""Distance, m, nearer than which two touches are one."""

Answer: TypeAlias = Callable[[Floats], tuple[Floats, Floats]]
"""Signals f(u) (B, C), T, of unknowns u (B, U), and their slopes J (B, U, C)."""


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
        self._poor = _POOR * len(noise)
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
        return self.descend_all(signals, start[None], standing, steps)[0]

    def descend_all(
        self, signals: Floats, starts: Floats, standing: Standing | None = None, steps: int = _STEPS
    ) -> list[Descent]:
        """The same from starts (B, U) at once; none of them minds the others."""
        at = np.minimum(np.maximum(starts, self._low), self._high)
        value, slopes = self._answer(at)
        rows, damping = np.arange(len(at)), np.full(len(at), _DAMPING)
        state = _Descents(rows, damping, at, signals - value, slopes)
        ends: dict[int, Descent] = {}
        for step in range(steps):
            if step < _REWEIGHED:
                state = self._weighed(state, standing)
            move, pull = self._step(state, standing)
            goes = 0.5 * (move * pull).sum(axis=1) >= _SETTLED
            if not goes.all():
                ends |= state.taken(~goes).ends()
                state, move = state.taken(goes), move[goes]
                if not len(move):
                    break
            new = state.at + np.minimum(np.maximum(move, -self._stride), self._stride)
            new = np.minimum(np.maximum(new, self._low), self._high)
            value, slopes = self._answer(new)
            ahead = state._replace(at=new, gap=signals - value, slopes=slopes)
            ahead = self._compared(ahead, standing)
            fell = state.cost - ahead.cost
            better = fell >= 0
            ahead = ahead._replace(damping=np.maximum(state.damping / 10, 1e-9))
            if not better.all():
                behind = state._replace(damping=np.maximum(state.damping * 10, 1e-3))
                ahead = behind.where(better, ahead)
            state = ahead
            over = np.where(
                better,
                fell < _SETTLED * np.maximum(1.0, state.cost / self._poor),
                state.damping > 1e6,
            )
            if over.any():
                ends |= state.taken(over).ends()
                state = state.taken(~over)
                if over.all():
                    break
        ends |= state.ends()
        return [ends[row] for row in rows.tolist()]

    def _step(self, state: "_Descents", standing: Standing | None) -> tuple[Floats, Floats]:
        """Steps of these descents, (B, U), and what pulls them."""
        curve = state.inner @ state.inner.swapaxes(1, 2)
        pull = (state.inner @ state.residual[..., None])[..., 0] - self._drag_precision * state.at
        # A level place bends the covariance, not the steps.
        diagonal = curve.reshape(len(curve), -1)[:, :: curve.shape[1] + 1]
        diagonal += self._curvature
        if standing is not None:
            curve[:, :2, :2] += standing.precision
            pull[:, :2] -= (state.at[:, :2] - standing.place) @ standing.precision
        diagonal *= 1 + state.damping[:, None]
        return np.asarray(np.linalg.solve(curve, pull[..., None])[..., 0], dtype=float), pull

    def _weighed(self, state: "_Descents", standing: Standing | None) -> "_Descents":
        """Descents whose misfit is weighed by the forces found so far."""
        squared = self._squared(state.at)
        state = state._replace(
            squared=squared, scale=1 / np.sqrt(1 + squared[:, None] * self._power)
        )
        return self._compared(state, standing)

    def _compared(self, state: "_Descents", standing: Standing | None) -> "_Descents":
        """Descents with their whitened slopes and residuals, and what these cost."""
        inner = (state.slopes @ self._axes.T) * state.scale[:, None]
        residual = (state.gap @ self._axes.T) * state.scale
        misfit = (residual * residual).sum(axis=1)
        if self._drags:
            misfit += (self._drag_precision * state.at * state.at).sum(axis=1)
        cost = 0.5 * misfit
        if standing is not None:
            away = state.at[:, :2] - standing.place
            cost += 0.5 * ((away @ standing.precision) * away).sum(axis=1)
        return state._replace(inner=inner, residual=residual, misfit=misfit, cost=cost)

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

    def _squared(self, at: Floats) -> Floats:
        """Squared forces F^2 of all touches, (B,), N^2."""
        squared = np.exp(2 * at[:, len(self.rows) - 1 :: len(self.rows)]).sum(axis=1)
        drags = (at[:, 2:4] ** 2).sum(axis=1) if self._drags else 0.0
        return np.asarray(squared + drags)


class _Descents(NamedTuple):
    """Descents on their way, B in each array."""

    row: Ints
    damping: Floats
    at: Floats
    gap: Floats
    slopes: Floats
    squared: Floats = _NONE
    scale: Floats = _NONE
    inner: Floats = _NONE
    residual: Floats = _NONE
    misfit: Floats = _NONE
    cost: Floats = _NONE

    def where(self, chosen: Bools, other: "_Descents") -> "_Descents":
        """Those of the others that are chosen, else its own."""
        masks = [chosen.reshape(-1, *[1] * (part.ndim - 1)) for part in self]
        return _Descents(*map(np.where, masks, other, self))

    def taken(self, chosen: Bools) -> "_Descents":
        """Those that are chosen."""
        return _Descents(*map(operator.itemgetter(chosen), self))

    def ends(self) -> dict[int, Descent]:
        """What each has come to."""
        parts = zip(self.at, self.squared.tolist(), self.inner, strict=True)
        costs = zip(self.misfit.tolist(), self.cost.tolist(), strict=True)
        both = zip(self.row.tolist(), parts, costs, strict=True)
        return {row: Descent(*part, *cost) for row, part, cost in both}


def single_answer(point: PointTable, *, straight: bool) -> Answer:
    """Signals of one touch by x, y, its drags and the logarithm of its press."""

    def answer(at: Floats) -> tuple[Floats, Floats]:
        force = np.zeros((len(at), 3))
        force[:, 2] = press = -np.exp(at[:, -1])
        if not straight:
            force[:, :2] = at[:, 2:4]
        values, slopes = point.at(at[:, :2], force)
        slopes[:, 4] *= press[:, None]
        return values, slopes[:, [0, 1, 4]] if straight else slopes

    return answer


def pair_answer(point: PointTable) -> Answer:
    """Signals of two straight touches by x, y and the logarithm of the press of each."""

    def answer(at: Floats) -> tuple[Floats, Floats]:
        each = at.reshape(-1, 2, 3)
        press = np.exp(each[:, :, 2])
        values, slopes = point.pairs(each[:, :, :2], press)
        slopes[:, [2, 5]] *= press[..., None]
        return values, slopes

    return answer
