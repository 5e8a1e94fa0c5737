"""Creep undone: from what a creeping rubber reads to the elastic answer behind it."""

from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.mechanics.viscoelasticity import Prony

_INSTANT: Final = 1e-100
"""Shortest step, s."""


class Settling:
    """Undoes creep, one reading after the other.

    Notes
    -----
    With u the creeping and r the elastic response, u = (1 - sum c_k) r + sum c_k y_k and
    dy_k/dt = (r - y_k) / lambda_k, exact for r that changes evenly between steps: the inverse of
    `smoskin.mechanics.viscoelasticity.Memory`. Valid for responses that are proportional to
    motion, as fields freed of their curvature are to second order.

    Examples
    --------
    >>> from smoskin.mechanics.viscoelasticity import Memory
    >>> prony = Prony(moduli=[0.2], times=[1.0])
    >>> memory, settling = Memory(prony, 0.0), Settling(prony)
    >>> [round(float(settling.step(dt, memory.step(dt, r))), 9) for dt, r in ((0.1, 2.0), (1.0, 3))]
    [2.0, 3.0]
    """

    def __init__(self, prony: Prony) -> None:
        self._rates = 1 / prony.retardation_times
        self._shares = prony.retardation_shares
        self._prompt = float(1 - self._shares.sum())
        self._late: Floats | None = None
        self._last: Floats = np.zeros(())

    def reset(self) -> None:
        """Forget: the skin has rested untouched."""
        self._late = None

    def step(self, duration: float, response: Floats) -> Floats:
        """The elastic response, so many seconds after the last one."""
        flat = np.ravel(response)
        if self._late is None:
            self._late = np.zeros((len(self._rates), flat.size))
            self._last = np.zeros(flat.size)
        # Never nothing at all, so that what was left of a step may be divided by it.
        part = self._rates * max(duration, _INSTANT)
        gone = -np.expm1(-part)
        mean = gone / part
        moved = (1 - gone)[:, None] * self._late + (mean + gone - 1)[:, None] * self._last
        after = 1 - mean
        elastic = (flat - self._shares @ moved) / (self._prompt + self._shares @ after)
        self._late = moved + after[:, None] * elastic
        self._last = elastic
        return np.asarray(elastic.reshape(np.shape(response)))
