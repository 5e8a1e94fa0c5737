"""Which readings are those of an idle skin.

Decides what a change from the zero may come to while nothing touches: a band, or what noise
explains.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from smoskin.arrays import Floats, solve_definite
from smoskin.errors import ArgumentError

IdleTest: TypeAlias = Callable[[Floats, Floats], float]
"""How near a change (C,) from a zero of this covariance (C, C), T and T^2, is to the largest of an
idle sensor, which is 1."""


class IdleBand:
    """Takes for idle what changes by less than a field, T, on every axis.

    A zero of covariance P widens the band b along P's own axes by their standard deviations: of a
    change d, ``(I + P^(1/2) / b)^-1 d`` must stay below b.

    Raises
    ------
    ArgumentError
        If the field is not positive, or above 1 T.
    """

    def __init__(self, field: float = 40e-6) -> None:
        if not 0 < field <= 1:
            raise ArgumentError(f"idle_field must be positive and at most 1 T; got {field} T")
        self._field = field

    def __call__(self, change: Floats, unsure: Floats) -> float:
        """Largest share of the band over the chips' axes."""
        variances, axes = np.linalg.eigh(unsure)
        wider = self._field + np.sqrt(np.maximum(variances, 0.0))
        return float(np.abs(axes @ ((axes.T @ change) / wider)).max())


class IdleNoise:
    """Takes for idle what the chips' noise explains.

    Parameters
    ----------
    noise : Floats, shape (C, C)
        Covariance N of an idle sensor's signals, T^2.
    false_alarms : float
        Chance of an idle reading not to be taken for one.

    Raises
    ------
    ArgumentError
        If the chance does not lie in (0, 1).

    Notes
    -----
    Idle where d^T (N + P)^-1 d, P the covariance of the zero, is below the quantile of chi-square
    that only `false_alarms` exceed.
    """

    def __init__(self, noise: Floats, false_alarms: float) -> None:
        if not 0.0 < false_alarms < 1.0:
            raise ArgumentError(f"false_alarms must lie in (0, 1); got {false_alarms}")
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.stats import chi2

        self._noise, self._limit = noise, float(chi2.isf(false_alarms, len(noise)))

    def __call__(self, change: Floats, unsure: Floats) -> float:
        """Share of the limit that a change comes to."""
        return float(change @ solve_definite(self._noise + unsure, change)) / self._limit
