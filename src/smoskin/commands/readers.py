"""Estimators to choose from: what can read a skin, one at a time, all with one zero.

Decides which there are, when each is made and which readings of the untouched skin count. Hides
the zero before.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError, ModelError
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst, load_estimator
from smoskin.sensing.learned.gaussian_process import LearnedEstimator
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.response.bound import bound_map
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.sensing.signals.estimator import FOLLOWING, ON_AN_ARM
from smoskin.sensing.signals.signals import signal_noise
from smoskin.sensing.signals.zero import ZeroTracking
from smoskin.service.page.carpet import Bound

Given = str | os.PathLike[str]
Makers: TypeAlias = dict[str, Callable[[], Estimator]]

_KINDS: Final = {
    BayesEstimator: "Bayes",
    ClosedFormEstimator: "closed form",
    NetworkEstimator: "network",
    LearnedEstimator: "learned",
}


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


def makers_of(
    design: SkinDesign,
    calibration: Given | None = None,
    others: Sequence[Given] = (),
    *,
    arm: bool = False,
    uncalibrated: bool = False,
    shipped: bool = True,
) -> Makers:
    """What can read a skin with what is given, by names for people; the first reads it at first.

    That is what the calibration holds, or else the closed form of a skin that is as designed, which
    is there beside any calibration of another kind; a response table reads by Bayes and by closed
    form. Without a calibration the shipped table of the design is there too, where `shipped` says
    that the skin moves as the whole sheet does. Other options are as of `smoskin.load_estimator`;
    a file that cannot be read raises its errors at once.
    """
    makers: Makers = {}
    plain: Callable[..., Estimator] = partial(
        ClosedFormEstimator, design, tracking=ZeroTracking(arm=arm)
    )
    if calibration is None:
        makers["closed form, as designed"] = plain
        # A design of one's own has no shipped table, and safetensors may not be there.
        with suppress(ModelError, MissingExtraError):
            table = load_response_table(design.name)
            if shipped and table.design_hash == design.content_hash:
                tracking = ON_AN_ARM if arm else FOLLOWING
                makers["Bayes, as designed"] = partial(
                    BayesEstimator, design, table, tracking=tracking
                )
    for file in (*(() if calibration is None else (calibration,)), *others):
        made = load_estimator(file, design, arm=arm, uncalibrated=uncalibrated)
        if isinstance(made, LearnedEstimator) and made.model.chips_in_reading != len(design.halls):
            raise ModelError(
                f"{file}: must be of {len(design.halls)} chips, as design {design.name!r}; "
                f"got a model of {made.model.chips_in_reading}"
            )
        name = Path(file).name
        name = os.fspath(file) if any(known.endswith(f", {name}") for known in makers) else name
        makers[f"{_KINDS[type(made)]}, {name}"] = partial(_kept, made)
        if isinstance(made, BayesEstimator):
            makers[f"closed form, {name}"] = partial(plain, made.table)
    if not any(name.startswith("closed form") for name in makers):
        makers["closed form, as designed"] = plain
    return makers


def _kept(made: Estimator) -> Estimator:
    """An estimator that is there already."""
    return made


class Readers(Estimator):
    """One of several estimators at a time, each made by its function when it is first chosen.

    The first of the names is chosen at the start; without `zero` each reads from its first reading
    on by the zero that it has.
    """

    def __init__(self, makers: Mapping[str, Callable[[], Estimator]], *, zero: bool = True) -> None:
        self._makers, self._zero_first = dict(makers), zero
        self._made: dict[str, Estimator] = {}
        self._untouched: tuple[Reading, ...] = ()
        self._before: tuple[Reading, ...] = ()
        self.choose(next(iter(makers)))

    @property
    def names(self) -> tuple[str, ...]:
        """Those that can be chosen."""
        return tuple(self._makers)

    def made(self, name: str) -> Estimator:
        """The estimator of this name, made if it is not yet; from any one thread at a time."""
        if name not in self._made:
            self._made[name] = self._makers[name]()
        return self._made[name]

    def choose(self, name: str) -> None:
        """Let the estimator of this name read the skin, with the zero of the one before it."""
        made = self.made(name)
        self.name = name
        self._current = ZeroFirst(made, count=ZEROS) if self._zero_first else made
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
        waits = isinstance(self._current, ZeroFirst) and not self._current.zeroed
        estimate = self._current.step(reading)
        if waits and estimate.status is Status.NOT_CALIBRATED:
            self._untouched = (*self._untouched, reading)[-ZEROS:]
        return estimate
