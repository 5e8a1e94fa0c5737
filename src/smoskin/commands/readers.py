"""The demonstration's estimators: several to choose from, one at a time, all with one zero.

Decides when each is made and which readings of the untouched skin count. Hides the zero before.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.response.bound import bound_map
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.service.page.carpet import Bound


def bound_of(design: SkinDesign, table: ResponseTable) -> Bound:
    """How finely a touch of 0.5 N can be placed over the skin of a table."""
    noise = signal_noise(design, table.chips)
    bounds = bound_map(table, noise, force=_FORCE, misfit=True, places=_PLACES)
    return Bound(bounds.x, bounds.y, bounds.location, _FORCE)


_FORCE: Final = 0.5
"""N: force of the touch whose bound is mapped."""
_PLACES: Final = (31, 41)
"""Places of that map along x and y."""
ZEROS: Final = 20
"""Readings of the untouched skin that are its zero."""


class Readers(Estimator):
    """One of several estimators at a time, each made by its function when it is first chosen.

    The first of the names is chosen at the start.
    """

    def __init__(self, makers: Mapping[str, Callable[[], Estimator]]) -> None:
        self._makers = dict(makers)
        self._made: dict[str, Estimator] = {}
        self._untouched: tuple[Reading, ...] = ()
        self._before: tuple[Reading, ...] = ()
        self.choose(next(iter(makers)))

    def choose(self, name: str) -> None:
        """Let the estimator of this name read the skin, with the zero of the one before it."""
        if name not in self._made:
            self._made[name] = self._makers[name]()
        self.name = name
        self._current = ZeroFirst(self._made[name], count=ZEROS)
        self._begin()

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._current.drift

    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Take these readings of the untouched skin as the zero, of whatever reads the skin."""
        self._current.zero(readings, force=force)
        self._untouched, self._before = tuple(readings), self._untouched

    def unzero(self) -> None:
        """Return to the zero before the last; `ArgumentError` if there is none."""
        if not self._before:
            raise ArgumentError("there is no zero before this one to return to")
        self._untouched, self._before = self._before, ()
        self._begin()

    def _begin(self) -> None:
        """Start anew with the zero that holds, if there is one."""
        self._current.reset()
        if self._untouched:
            self._current.zero(self._untouched, force=True)

    def reset(self) -> None:
        """Forget everything; the next good readings are the new zero."""
        self._untouched = self._before = ()
        self._begin()

    def step(self, reading: Reading) -> Estimate:
        """What the chosen estimator makes of a reading."""
        waits = not self._current.zeroed
        estimate = self._current.step(reading)
        if waits and estimate.status is Status.NOT_CALIBRATED:
            self._untouched = (*self._untouched, reading)[-ZEROS:]
        return estimate
