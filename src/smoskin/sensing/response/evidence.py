"""Likelihood of labelled touches, and what each reads beside what the others foretell.

The model is that of `smoskin.sensing.response.calibrate`, whose misfit may be larger by one factor:
``y_n = s_n + M_n^T w + n``, ``w ~ N(0, 1)``, ``n ~ N(0, R_n)``. Hides the closed forms ("Judged
touches" in `docs/derivations.md`).
"""

from typing import Final, NamedTuple

import numpy as np

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


class _Factors(NamedTuple):
    """What a misfit so large makes of the labels alone."""

    covariance: Floats
    """R, (N, C, C)."""
    precision: Floats
    """R^-1."""
    weighed: Floats
    """M R^-1, (N, K, C)."""
    open: Floats
    """P, (K, K): covariance of the weights."""
    volume: float
    """log det of the covariance of all signals."""


class Evidence:
    """What signals of touches with these labels tell of each other.

    ``log p(y) = -(sum_n r_n R_n^-1 r_n - u P u + sum_n log det R_n - log det P) / 2`` but for a
    constant, with ``r = y - s``, ``u = sum_n M_n R_n^-1 r_n`` and ``P = (1 + sum_n M_n R_n^-1
    M_n^T)^-1``. `LinAlgError` where labels are so far off that R has no inverse.
    """

    def __init__(self, table: ResponseTable, touches: LabelledTouches, noise: Floats) -> None:
        places, forces = touches.position, touches.force
        self._foretold = table.signals(places, forces, touches.temperature)
        self._modes = table.mode_signals(places, forces)
        spreads = touches.place_spread, touches.force_spread
        known = noise + label_noise(table, places, forces, spreads)
        misfit = (forces**2).sum(axis=1)[:, None, None] * table.misfit
        self._factors = [self._factored(known + s * s * misfit) for s in STRETCHES]

    def of(self, signals: Floats) -> Floats:
        """Logarithms of the likelihoods (H, F) of H sets of signals (H, N, C) with F stretches."""
        residual = signals - self._foretold
        values = []
        for factors in self._factors:
            along = np.tensordot(residual, factors.weighed, ([1, 2], [0, 2]))
            white = residual[:, :, None] @ factors.precision
            squared = (white[:, :, 0] * residual).sum(axis=(1, 2))
            squared -= ((along @ factors.open) * along).sum(axis=1)
            values.append(-0.5 * (squared + factors.volume))
        return np.array(values).T

    def left_out(self, signals: Floats, stretch: int) -> LeftOut:
        """Each touch of signals (N, C) beside the others, with the stretch of this number."""
        covariance, precision, weighed, still_open, _ = self._factors[stretch]
        residual, across = signals - self._foretold, np.swapaxes(self._modes, 1, 2)
        weights = still_open @ np.tensordot(weighed, residual, ([0, 2], [0, 1]))
        fitted = across @ still_open @ self._modes
        left = (residual - across @ weights)[..., None]
        apart = np.linalg.solve(np.eye(len(precision[0])) - fitted @ precision, left)
        spread = covariance @ np.linalg.solve(covariance - fitted, covariance)
        spread = (spread + np.swapaxes(spread, 1, 2)) / 2
        squared = (apart * np.linalg.solve(spread, apart)).sum(axis=(1, 2))
        parts = (np.asarray(part, dtype=np.float64) for part in (apart[..., 0], spread, squared))
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

    def _factored(self, covariance: Floats) -> _Factors:
        precision = np.linalg.inv(covariance)
        weighed = self._modes @ precision
        seen = np.tensordot(weighed, self._modes, ([0, 2], [0, 2]))
        inverse = np.eye(len(seen)) + seen
        volume = np.linalg.slogdet(covariance)[1].sum() + np.linalg.slogdet(inverse)[1]
        still_open = np.asarray(np.linalg.inv(inverse), dtype=np.float64)
        return _Factors(
            covariance, np.asarray(precision, dtype=np.float64), weighed, still_open, float(volume)
        )
