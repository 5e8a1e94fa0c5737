"""Likelihood of labelled touches, and what each reads beside what the others foretell.

The model is that of `smoskin.sensing.response.calibrate`, whose misfit may be larger by one factor:
``y_n = s_n + M_n^T w + n``, ``w ~ N(0, 1)``, ``n ~ N(0, R_n)``. Hides the closed forms ("Judged
touches" in `docs/derivations.md`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from smoskin.arrays import Floats
from smoskin.sensing.response.calibrate import LabelledTouches, label_noise
from smoskin.sensing.response.table import ResponseTable

STRETCHES: Final = 2.0 ** np.arange(8)
"""Factors on the misfit's deviation that are tried."""
_ODD: Final = (1e2, 1e4, 1e6)
"""Factors on the variance of a touch that has nothing to do with its label."""


class LeftOut(NamedTuple):
    """N touches, each beside what all others foretell of it."""

    residual: Floats
    """What is read less what was foretold, (N, C), T."""
    covariance: Floats
    """Covariance of that, (N, C, C), T^2."""
    squared: Floats
    """Squared length of the residual in its standard deviations, (N,): C on average."""

    @property
    def logarithm(self) -> Floats:
        """Logarithm of the density of each touch where the others are known, (N,)."""
        return np.asarray(-0.5 * (self.squared + np.linalg.slogdet(self.covariance)[1]))


class _Labels(NamedTuple):
    """What N labels alone tell of signals."""

    foretold: Floats
    """s, (N, C), T."""
    modes: Floats
    """M W^T, (N, K, C)."""
    axes: Floats
    """W, (N, C, C)."""
    power: Floats
    """d, (N, C), with ``W R W^T = 1 + stretch^2 diag(d)``."""

    @classmethod
    def of(cls, table: ResponseTable, touches: LabelledTouches, noise: Floats) -> "_Labels":
        """Read off the table, in noise (C, C) that does not depend on them."""
        places, forces = touches.position, touches.force
        labels = label_noise(table, places, forces, (touches.place_spread, touches.force_spread))
        white = np.linalg.inv(np.linalg.cholesky(noise))
        # By eigenvectors, which labels that are far off have as well.
        power, axes = np.linalg.eigh(white @ labels @ white.T)
        axes = axes / np.sqrt(1 + np.maximum(power, 0.0))[:, None]
        first = np.swapaxes(axes, 1, 2) @ white
        misfit = (forces**2).sum(axis=1)[:, None, None] * table.misfit
        power, axes = np.linalg.eigh(first @ misfit @ np.swapaxes(first, 1, 2))
        axes = np.swapaxes(axes, 1, 2) @ first
        modes = table.mode_signals(places, forces) @ np.swapaxes(axes, 1, 2)
        foretold = table.signals(places, forces, touches.temperature)
        return cls(foretold, modes, axes, np.maximum(power, 0.0))


class Evidence:
    """What signals of touches with these labels tell of each other.

    ``log p(y) = -(sum_n r_n R_n^-1 r_n - u P u + sum_n log det R_n - log det P) / 2`` but for a
    constant, with ``r = y - s``, ``u = sum_n M_n R_n^-1 r_n`` and ``P = (1 + sum_n M_n R_n^-1
    M_n^T)^-1``. `LinAlgError` where labels are so far off that nothing can be told.
    """

    def __init__(self, table: ResponseTable, touches: LabelledTouches, noise: Floats) -> None:
        self._know(_Labels.of(table, touches, noise))

    @classmethod
    def of_sets(
        cls, table: ResponseTable, touches: Sequence[LabelledTouches], noise: Floats
    ) -> Iterator["Evidence | None"]:
        """The same of several sets of as many touches, laid out at once; None for an error."""
        many = [
            np.concatenate([getattr(labelled, name) for labelled in touches])
            for name in ("position", "force", "signals", "temperature")
        ]
        whole = replace(
            touches[0], position=many[0], force=many[1], signals=many[2], temperature=many[3]
        )
        labels = _Labels.of(table, whole, noise)
        for begin in range(0, len(whole), len(touches[0])):
            part = slice(begin, begin + len(touches[0]))
            evidence = cls.__new__(cls)
            try:
                evidence._know(_Labels(*(values[part] for values in labels)))
            except np.linalg.LinAlgError:
                yield None
            else:
                yield evidence

    def _know(self, labels: _Labels) -> None:
        modes = labels.modes
        self._foretold, self._axes = labels.foretold, labels.axes
        self._modes = np.swapaxes(modes, 0, 1).reshape(modes.shape[1], -1)
        self._variances = 1 + labels.power.ravel() * STRETCHES[:, None] ** 2
        """Variances of all signals along the axes, (F, N C)."""
        weighed = self._modes / np.sqrt(self._variances)[:, None]
        still = np.eye(len(self._modes)) + weighed @ np.swapaxes(weighed, 1, 2)
        self._roots = np.linalg.cholesky(still)
        """Roots of P^-1, (F, K, K)."""
        diagonals = np.einsum("fkk->fk", self._roots)
        volumes = np.log(self._variances).sum(axis=1) + 2 * np.log(diagonals).sum(axis=1)
        self._volumes = volumes - 2 * np.linalg.slogdet(self._axes)[1].sum()

    def of(self, signals: Floats) -> Floats:
        """Logarithms of the likelihoods (H, F) of H sets of signals (H, N, C) with F stretches."""
        white = self._white(signals).reshape(len(signals), -1)
        squared = white**2 @ (1 / self._variances).T
        for stretch, (variances, root) in enumerate(zip(self._variances, self._roots, strict=True)):
            along = solve_triangular(root, self._modes @ (white / variances).T, lower=True)
            squared[:, stretch] -= (along**2).sum(axis=0)
        return np.asarray(-0.5 * (squared + self._volumes))

    def left_out(self, signals: Floats, stretch: int) -> LeftOut:
        """Each touch of signals (N, C) beside the others, with the stretch of this number."""
        white = self._white(signals[None])[0]
        count, width = white.shape
        variances = self._variances[stretch].reshape(count, width)
        root = solve_triangular(self._roots[stretch], self._modes, lower=True)
        taken = root.reshape(-1, count, width)
        fitted = np.einsum("knc,knd->ncd", taken, taken, optimize=True)
        left = white - np.tensordot(root @ (white / variances).ravel(), taken, 1)
        apart = np.linalg.solve(np.eye(width) - fitted / variances[:, None], left[..., None])
        own = variances[..., None] * np.eye(width)
        spread = variances[..., None] * np.linalg.solve(own - fitted, own)
        spread = (spread + np.swapaxes(spread, 1, 2)) / 2
        squared = (apart * np.linalg.solve(spread, apart)).sum(axis=(1, 2))
        back = np.linalg.inv(self._axes)
        covariance, apart = back @ spread @ np.swapaxes(back, 1, 2), back @ apart
        parts = (
            np.asarray(part, dtype=np.float64) for part in (apart[..., 0], covariance, squared)
        )
        return LeftOut(*parts)

    def without_label(self, signals: Floats) -> Floats:
        """The same of signals (N, C) where one touch's label alone says nothing, (N, F)."""
        whole = self.of(signals[None])[0]
        values = []
        for stretch in range(len(STRETCHES)):
            left = self.left_out(signals, stretch)
            spread = np.array(_ODD)[:, None]
            volume = np.linalg.slogdet(left.covariance)[1] + signals.shape[1] * np.log(spread)
            odd = (-0.5 * (left.squared / spread + volume)).max(axis=0)
            values.append(whole[stretch] - left.logarithm + odd)
        return np.array(values).T

    def _white(self, signals: Floats) -> Floats:
        """What signals (H, N, C) are off along the axes."""
        return np.asarray(np.einsum("ncd,hnd->hnc", self._axes, signals - self._foretold))
