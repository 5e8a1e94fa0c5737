"""The estimator that knows what it does not know: touches by their posterior on a response table.

Decides whether anything touches (chi-square of the signals in their noise, at a chosen rate of
false alarms), how many touches there are (their evidence), and what is said of them. The table is
of this skin after a few-touch calibration (`smoskin.sensing.few_touch`), or of its design with
all that made skins differ by as its uncertainty.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.relaxation import Prony
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.conditioning import ZeroTracking
from smoskin.sensing.posterior import TouchSolver
from smoskin.sensing.response import ResponseTable
from smoskin.sensing.signals import Signals, signal_noise
from smoskin.sensing.touch_priors import TouchPosterior, TouchPriors

_WARMER: Final = 0.25
"""degC: change of the rubber's temperature from which the table is taken anew."""
_DOUBT: Final = 1e-9
"""Chance of a single touch to fit so badly that two are tried."""
_TYPICAL: Final = 0.5
"""N: force at which the signals' curvature is taken."""
_WORST: Final = 20.0
"""Standard deviations a signal, root mean square, beyond which nothing on the table fits."""


class BayesEstimator(Estimator):
    """Place and force of no, one or two touches, with their covariance.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Of this skin or of its design; of some of its chips, where it shall use only those.
    priors : TouchPriors, optional
    creep : Prony, optional
        Of the skin's rubber (`mechanics.relaxation.elastomer_prony`), to undo its creep; by
        default touches are taken to have settled.
    false_alarms : float
        Chance of a reading of the untouched skin to count as touched.
    tracking : ZeroTracking, optional
        How the zero follows drift while nothing touches.

    Raises
    ------
    ModelError
        If the table belongs to another design.
    ArgumentError
        If the chance does not lie in (0, 1).

    Notes
    -----
    Two touches are taken as straight. Places past the outermost vertices cannot be told: there
    the position is the middle of what fits, and the covariance is as wide.
    """

    def __init__(
        self,
        design: SkinDesign,
        table: ResponseTable,
        *,
        priors: TouchPriors | None = None,
        creep: Prony | None = None,
        false_alarms: float = 1e-6,
        tracking: ZeroTracking | None = None,
    ) -> None:
        if table.design_hash != design.content_hash:
            raise ModelError(
                f"table must be of the design {design.name!r} ({design.content_hash[:12]}); got "
                f"one of {table.design_hash[:12]}"
            )
        if not 0.0 < false_alarms < 1.0:
            raise ArgumentError(f"false_alarms must lie in (0, 1); got {false_alarms}")
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.stats import chi2

        self.design = design
        self.table = table
        self._chips = list(table.chips)
        self._signals = Signals(design, creep=creep, tracking=tracking)
        known = table if creep is None else _with_creep_left(table, creep)
        self._solver = TouchSolver(known, signal_noise(design, table.chips), priors)
        self._touched = float(chi2.isf(false_alarms, table.count))
        self._doubtful = float(chi2.isf(_DOUBT, table.count))
        self._pairs = (priors or TouchPriors()).chances[2] > 0
        self._solved_at = np.nan
        self._guess: Floats | None = None

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._signals.drift

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take these readings of the untouched skin as its zero.

        Raises
        ------
        ArgumentError
            If there are none with all chips good.
        """
        self._signals.zero(readings)
        self._guess = None

    def reset(self) -> None:
        """Return to the design's zero and forget earlier readings."""
        self._signals.reset()
        self._guess = None

    def step(self, reading: Reading) -> Estimate:
        """The touches that one reading shows.

        Raises
        ------
        ArgumentError
            If the reading has another number of chips than the design.
        """
        signal = self._signals.step(reading)
        if signal.status is not None:
            return Estimate(time=reading.time, status=signal.status)
        if not abs(signal.temperature - self._solved_at) < _WARMER:
            self._solver.warm_to(signal.temperature)
            self._solved_at = signal.temperature
        values = signal.values[self._chips].ravel()
        squared, _ = self._solver.silence(values)
        if squared < self._touched:
            self._signals.follow()
            self._guess = None
            return Estimate(time=reading.time, status=Status.NO_CONTACT)
        self._signals.touched()
        return self._estimate(reading.time, self._likeliest(values))

    def _likeliest(self, values: Floats) -> TouchPosterior:
        """One touch, or two where one fits badly and two are likelier."""
        last = self._guess
        single = last is not None and len(last) == 1
        found = self._solver.one(values, last[0] if last is not None and single else None)
        if self._pairs and found.misfit > self._doubtful:
            other = self._solver.two(values, None if single else last)
            if other.evidence > found.evidence:
                found = other
        return found

    def _estimate(self, time: float, found: TouchPosterior) -> Estimate:
        """A posterior as an estimate."""
        if found.misfit > _WORST**2 * self.table.count:
            self._guess = None
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        self._guess = found.values
        return Estimate(
            time=time,
            status=Status.CONTACT,
            contacts=tuple(Contact(position=one[:2], force=one[2:]) for one in found.values),
            covariance=found.covariance,
        )


def _with_creep_left(table: ResponseTable, creep: Prony) -> ResponseTable:
    """The table with what undoing creep misses: it takes signals to be proportional to motion."""
    lines = [(np.arange(7) + 0.5) * end / 7 for end in table.basis.extent]
    places = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    force = np.tile([0.0, 0.0, -_TYPICAL], (len(places), 1))
    # Of a quadratic, half is missing where half the force is taken twice.
    bent = 2 * (table.signals(places, force) - 2 * table.signals(places, force / 2))
    missed = float(creep.retardation_shares.sum()) * bent / _TYPICAL
    return replace(table, misfit=table.misfit + missed.T @ missed / len(missed))
