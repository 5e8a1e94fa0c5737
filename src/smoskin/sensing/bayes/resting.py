"""The place where a touch rests: as it was known best since it landed, joined with the newest.

Under a touch nothing shows how the zero of a skin on an arm goes on, so that a place gets less sure
though the touch has not moved. Decides when a touch has slid. Hides how places whose errors depend
on each other are joined.
"""

from typing import Final, NamedTuple, final

import numpy as np

from smoskin.arrays import Floats

_SLID: Final = 9.0
"""Squared distance, in standard deviations, past which a touch has slid; of one that rests 1 %."""
_OWN: Final = 0.1
"""Share of a place's covariance by which readings of a touch that rests differ on a still skin."""
_LUCK: Final = 1.4
"""Factor on the covariance of what is joined: the surest of many readings is so by luck as well."""
_SOON: Final = 1e-4
"""Shortest time between two readings, s."""
_SHARES: Final = np.linspace(0.0, 1.0, 11)[:, None, None]
"""Shares of the earlier place that are tried."""


class _Place(NamedTuple):
    """A place as one reading has it."""

    time: float
    """s."""
    mean: Floats
    """(2,), m."""
    spread: Floats
    """Covariance, (2, 2), m^2."""


@final
class Resting:
    """A touch that rests until its place moves by more than readings say by chance.

    Parameters
    ----------
    wander : float
        Standard deviation along each axis, m, by which a touch that rests moves in a second;
        infinite: every reading stands for itself.

    Notes
    -----
    "A touch that rests" in `docs/derivations.md`.

    Examples
    --------
    >>> resting, sure, unsure = Resting(1e-3), 1e-6 * np.eye(2), 9e-6 * np.eye(2)
    >>> place, _ = resting.joined(0.0, np.array([0.030, 0.040]), sure)
    >>> place, spread = resting.joined(0.3, np.array([0.033, 0.040]), unsure)
    >>> place.round(4).tolist(), round(1e3 * float(spread[0, 0]) ** 0.5, 2)
    ([0.03, 0.04], 1.35)
    >>> resting.joined(0.4, np.array([0.060, 0.040]), unsure)[0].tolist()
    [0.06, 0.04]
    """

    def __init__(self, wander: float) -> None:
        self._power = wander**2
        self._best: _Place | None = None

    def forget(self) -> None:
        """Take the next touch for another one."""
        self._best = None

    def joined(self, time: float, place: Floats, spread: Floats) -> tuple[Floats, Floats]:
        """Place (2,), m, and covariance (2, 2), m^2, of a touch that is read there at a time, s."""
        best = self._best
        if best is not None:
            wander = self._power * max(time - best.time, _SOON)
            surer = best.spread.trace() + 2 * wander < spread.trace()
            if surer and not _slid(place - best.mean, best.spread, spread, wander):
                before = best.spread + wander * np.eye(2)
                return _intersected(best.mean, before, place, spread)
        self._best = _Place(time, place, spread)
        return place, spread


def _slid(moved: Floats, before: Floats, spread: Floats, wander: float) -> bool:
    """Whether a place has moved by more than its zero, which is less sure now, makes likely."""
    power, axes = np.linalg.eigh(spread - before)
    apart = (axes * np.maximum(power, 0.0)) @ axes.T + _OWN * spread + wander * np.eye(2)
    return float(moved @ np.linalg.solve(apart, moved)) > _SLID


def _intersected(
    before: Floats, spread_before: Floats, place: Floats, spread: Floats
) -> tuple[Floats, Floats]:
    """Mean and covariance of a place known in two ways, whatever their errors have in common."""
    sure_before, sure = np.linalg.inv(spread_before), np.linalg.inv(spread)
    joined = np.linalg.inv(_SHARES * sure_before + (1 - _SHARES) * sure)
    k = int(np.einsum("kii->k", joined).argmin())
    share = float(_SHARES[k, 0, 0])
    information = share * (sure_before @ before) + (1 - share) * (sure @ place)
    luck = min(_LUCK, float(spread.trace() / joined[k].trace()))
    return joined[k] @ information, luck * joined[k]
