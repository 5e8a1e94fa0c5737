"""Posterior and evidence of K touches at once, given what chips read.

Decides what is believed and what it costs; hides the descent to the likeliest touches and how
misfit is weighed by their forces. One and two touches differ by their table's answer alone.
"""

import math
from collections.abc import Callable, Generator, Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from smoskin.arrays import Floats, inverse_and_log_det, solve_definite
from smoskin.errors import ArgumentError
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.response.point import PointTable
from smoskin.sensing.response.table import ResponseTable

_STEPS: Final = 15
"""Steps at most, where no others are asked for."""
_SETTLED: Final = {1: 1e-3, 2: 1e-2}
"""Fall of half the squared residual at which steps to K touches end. Two creep along a valley,
where a tenth of their spread is a fall of 0.005."""
_POOR: Final = 10.0
"""Cost a signal past which a fit is poor: there the fall at which steps end grows by the square."""
_LATE: Final = 2
"""Steps that are left to others when one descent has ended well."""
_REWEIGHED: Final = 6
"""First steps, before which the misfit is weighed by the forces found so far."""
_DAMPING: Final = 1e-3
_STUCK: Final = 1e6
"""Damping past which no shorter step is tried."""
_UNLIKELY, _OTHERS = 5.0, 2
"""Nats by which touches may be less likely than others to be thought of, and how many are."""
_STRIDE: Final = (0.03, 1.0)
"""Longest step of a place, m, and of the logarithm of a force."""
_NONE: Final = np.zeros(0)
"""What descents have not yet."""
_BLUR: Final = 1e-9
"""Information on the logarithm of a force that keeps even a blind skin's covariance finite."""
_SAME: Final = 1e-12
"""Difference of unknowns up to which signals are the same."""
APART: Final = 0.02
"""Distance, m, nearer than which two touches are one."""

Answer: TypeAlias = Callable[[Floats], tuple[Floats, Floats]]
"""Signals f(u) (B, C), T, of unknowns u (B, U), and their slopes J (B, U, C)."""


_Answered: TypeAlias = tuple[Floats, Floats]
"""Signals f(u) (C,), T, of unknowns u, and their slopes (U, C)."""
_Known: TypeAlias = tuple[Floats, Floats] | None
"""Place of a touch that stands, (2,), m, and its precision, (2, 2), m^-2."""


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
    single touch may drag. With W^T W = (N + F^2 M)^-1, F the sum of all forces, since what a table
    misses of a skin is alike under both touches,

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
        self._answer, self._count, self._settled = answer, touches, _SETTLED[touches]
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

        self._presses = slice(len(self.rows) - 1, None, len(self.rows))
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
        self,
        signals: Floats,
        starts: Floats,
        standing: Standing | None = None,
        steps: int = _STEPS,
        good: float = 0.0,
    ) -> list[Descent]:
        """The same from starts (B, U) at once.

        Where a descent ends at a cost below `good`, the others take two more steps at most.
        """
        known = None if standing is None else (standing.place, standing.precision)
        ways = [self._way(signals, start, known, steps) for start in starts]
        asked = {row: next(way) for row, way in enumerate(ways)}
        ends: dict[int, Descent] = {}
        left = math.inf
        while asked:
            answers: Sequence[_Answered | None] = [None] * len(asked)
            if left > 0:
                answers = [*zip(*self._answer(np.array(list(asked.values()))), strict=True)]
            left -= 1
            for row, answer in zip(list(asked), answers, strict=True):
                try:
                    asked[row] = ways[row].send(answer)
                except StopIteration as end:
                    ends[row] = end.value
                    del asked[row]
                    left = min(left, _LATE if end.value.cost < good else math.inf)
        return [ends[row] for row in range(len(ways))]

    def _way(
        self, signals: Floats, start: Floats, known: _Known, steps: int
    ) -> Generator[Floats, _Answered | None, Descent]:
        """One descent: asks for signals and slopes of unknowns until it ends, or is told none."""
        at, damping = np.minimum(np.maximum(start, self._low), self._high), _DAMPING
        answer = yield at
        assert answer is not None
        rows = self._rows(signals, *answer)
        for step in range(steps):
            if step < _REWEIGHED:
                # The misfit is weighed by the forces found so far.
                squared = self._squared(at)
                scale = 1 / np.sqrt(1 + squared * self._power)
                inner = rows * scale
                misfit, cost = self._cost(inner[0], at, known)
            move, pull = self._step(inner, at, damping, known)
            if 0.5 * float(move @ pull) < self._settled:
                break
            move = np.minimum(np.maximum(move, -self._stride), self._stride)
            ahead = np.minimum(np.maximum(at + move, self._low), self._high)
            answer = yield ahead
            if answer is None:
                break
            rows_ahead = self._rows(signals, *answer)
            inner_ahead = rows_ahead * scale
            misfit_ahead, cost_ahead = self._cost(inner_ahead[0], ahead, known)
            fell = cost - cost_ahead
            if fell < 0:
                if damping > _STUCK:
                    break
                damping = max(damping * 10, 1e-3)
                continue
            settled = fell < self._settled * max(1.0, (cost / self._poor) ** 2)
            at, rows, inner, misfit, cost = ahead, rows_ahead, inner_ahead, misfit_ahead, cost_ahead
            damping = max(damping / 10, 1e-9)
            if settled:
                break
        return Descent(at, squared, inner[1:], misfit, cost)

    def _rows(self, signals: Floats, value: Floats, slopes: Floats) -> Floats:
        """What a touch leaves of signals, and its slopes, along the axes of noise, (1 + U, C)."""
        rows = np.empty((1 + len(slopes), len(signals)))
        np.subtract(signals, value, out=rows[0])
        rows[1:] = slopes
        return np.asarray(rows @ self._axes.T)

    def _step(
        self, inner: Floats, at: Floats, damping: float, known: _Known
    ) -> tuple[Floats, Floats]:
        """Step (U,) by whitened residual and slopes, (1 + U, C), and what pulls."""
        products = inner @ inner.T
        curve, pull = products[1:, 1:], products[1:, 0]
        if self._drags:
            pull -= self._drag_precision * at
        # A level place bends the covariance, not the steps.
        diagonal = products.ravel()[len(at) + 2 :: len(at) + 2]
        diagonal += self._curvature
        if known is not None:
            place, precision = known
            curve[:2, :2] += precision
            pull[:2] -= precision @ (at[:2] - place)
        diagonal *= 1 + damping
        return solve_definite(curve, pull), pull

    def _cost(self, residual: Floats, at: Floats, known: _Known) -> tuple[float, float]:
        """Misfit of a whitened residual, and what it costs."""
        misfit = float(residual @ residual)
        if self._drags:
            misfit += float((self._drag_precision * at) @ at)
        cost = 0.5 * misfit
        if known is not None:
            place, precision = known
            away = at[:2] - place
            cost += 0.5 * float(away @ precision @ away)
        return misfit, cost

    def posterior(self, end: Descent, standing: Standing | None = None) -> TouchPosterior:
        """What a descent has come to; how many touches there are is judged by the reading alone."""
        return self._laplace(end, standing)[0]

    def posteriors(self, ends: list[Descent], standing: Standing | None = None) -> TouchPosterior:
        """The same of the first of several descents, beside which stand others as likely."""
        first, height = self._laplace(ends[0], standing)
        kept, heights = [first], [height]
        for end in ends[1:]:
            if end.cost > ends[0].cost + _UNLIKELY:
                continue
            other, height = self._laplace(end, standing)
            if standing is None:
                other = other.in_order_of(first)
            if height > max(heights) - _UNLIKELY and not any(map(other.is_at, kept)):
                kept.append(other)
                heights.append(height)
        if len(kept) == 1:
            return first
        shares = np.exp(np.array(heights) - max(heights))
        shares /= shares.sum()
        first, *others = (
            posterior._replace(share=share)
            for posterior, share in zip(kept, shares.tolist(), strict=True)
        )
        return first._replace(others=tuple(others[:_OTHERS]))

    def _laplace(self, end: Descent, standing: Standing | None) -> tuple[TouchPosterior, float]:
        """What a descent has come to, and the logarithm of how likely that is beside others."""
        count, rows = self._count, self.rows
        information = end.slopes @ end.slopes.T
        information.ravel()[:: len(information) + 1] += self._curvature
        inverse, log_det = inverse_and_log_det(information)
        log_det_known = log_det
        if standing is not None:
            information[:2, :2] += standing.precision
            inverse, log_det_known = inverse_and_log_det(information)
        values, covariance = np.zeros((count, 5)), np.zeros((count, 5, 5))
        values[:, rows] = end.unknowns.reshape(count, -1)
        values[:, 4] = -np.exp(values[:, 4])
        scale = np.ones(len(inverse))
        scale[self._presses] = values[:, 4]
        inverse *= scale[:, None] * scale
        blocks = inverse.reshape(count, len(rows), count, len(rows))
        for k in range(count):
            covariance[k, rows[:, None], rows] = blocks[k, :, k]
        fit = -0.5 * float(np.log1p(end.squared * self._power).sum())
        evidence = self._constant + fit - 0.5 * (end.misfit + log_det)
        height = fit - end.cost - 0.5 * log_det_known
        if count == 2 and math.dist(values[0, :2], values[1, :2]) < APART:
            evidence = height = -math.inf
        return TouchPosterior(values, covariance, end.misfit, evidence), height

    def unknowns(self, values: Floats) -> Floats:
        """Unknowns (U,) of touches (K, 5)."""
        at = np.array(values, dtype=np.float64)
        at[:, 4] = np.log(np.maximum(-at[:, 4], 1e-3))
        return at[:, self.rows].ravel()

    def _squared(self, at: Floats) -> float:
        """Squared sum F^2 of the forces of all touches, N^2."""
        drags = float(at[2:4] @ at[2:4]) if self._drags else 0.0
        return drags + sum(map(math.exp, at[self._presses].tolist())) ** 2


class Recalled:
    """Signals of unknowns as another answer has them, which knows what it was asked last.

    Where one descent ended, the next reading's begins.
    """

    def __init__(self, answer: Answer) -> None:
        self._answer = answer
        self._at, self._last = _NONE, (_NONE, _NONE)

    def __call__(self, at: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C), T, and their slopes (B, U, C)."""
        if len(at) > 1:
            return self._answer(at)
        if len(self._at) != 1 or np.abs(at - self._at).max() > _SAME:
            self._last = self._answer(at)
            self._at = at
        return self._last


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

    return Recalled(answer)


def pair_answer(point: PointTable) -> Answer:
    """Signals of two straight touches by x, y and the logarithm of the press of each."""

    def answer(at: Floats) -> tuple[Floats, Floats]:
        each = at.reshape(-1, 2, 3)
        press = np.exp(each[:, :, 2])
        values, slopes = point.pairs(each[:, :, :2], press)
        slopes[:, 2::3] *= press[..., None]
        return values, slopes

    return Recalled(answer)
