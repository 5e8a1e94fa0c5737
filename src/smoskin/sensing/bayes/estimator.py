"""The estimator that knows what it does not know: touches by their posterior on a response table.

Decides how many touches there are (their evidence) and what is said of them. The table is of this
skin after a few-touch calibration (`smoskin.sensing.response.calibrate`), or of its design with
all that made skins differ by as its uncertainty.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.nonlinearity import field_curvature, straightened
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.origami.geometry import middles_of_fields
from smoskin.records import Contact, Estimate, Status
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.estimator import SignalEstimator
from smoskin.sensing.signals.signals import signal_noise
from smoskin.sensing.signals.zero import ZeroTracking

_WARMER: Final = 0.25
"""degC: change of the rubber's temperature from which the table is taken anew."""
_DOUBT: Final = 1e-35
"""Chance of a single touch to fit so badly that two are tried. What a table misses has heavier
tails than a normal: hard touches in a corner fit to 1e-30 on some skins, few pairs better."""
_TYPICAL: Final = 0.5
"""N: force at which the signals' curvature is taken."""
_WORST: Final = 20.0
"""Standard deviations a signal, root mean square, beyond which nothing on the table fits."""


class BayesEstimator(SignalEstimator):
    """Place and force of no, one or two touches, with their covariance.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Of this skin or of its design; of some of its chips, where it shall use only those.
    priors : TouchPriors, optional
    creep : Prony, optional
        Solid of the skin's rubber, to undo its creep; that of the design's columns by default,
        `smoskin.mechanics.viscoelasticity.ELASTIC` for none.
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
    Two touches are taken as straight. One that was alone before the other came is taken to stand
    about where it stood (`TouchPriors.slide`) and is said first.
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
        design.check_own("table", table.design_hash)
        super().__init__(
            design,
            table.chips,
            creep=creep,
            false_alarms=false_alarms,
            tracking=tracking,
        )
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.stats import chi2

        self.table = table
        known = _with_creep_left(table, design, self.creep)
        self._solver = TouchSolver(known, signal_noise(design, table.chips), priors)
        self._doubtful = float(chi2.isf(_DOUBT, table.count))
        self._pairs = (priors or TouchPriors()).chances[2] > 0
        self._solved_at = np.nan
        self._guess: Floats | None = None
        self._slide = (priors or TouchPriors()).slide
        self._alone: _Alone | None = None

    def _forget(self) -> None:
        self._guess = self._alone = None

    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        if not abs(temperature - self._solved_at) < _WARMER:
            self._solver.warm_to(temperature)
            self._solved_at = temperature
        return self._estimate(time, self._likeliest(time, signals))

    def _likeliest(self, time: float, values: Floats) -> TouchPosterior:
        """One touch, or two where one fits badly and two are likelier."""
        last = self._guess
        single = last is not None and len(last) == 1
        found = self._solver.one(values, last[0] if last is not None and single else None)
        if self._pairs and found.misfit > self._doubtful:
            standing = None if self._alone is None else self._alone.standing(time, self._slide)
            other = self._solver.two(values, None if single else last, standing)
            if other.evidence > found.evidence:
                return other
        if found.misfit < self._doubtful:
            self._alone = _Alone(time, found)
        return found

    def _estimate(self, time: float, found: TouchPosterior) -> Estimate:
        """A posterior as an estimate."""
        if found.misfit > _WORST**2 * self.table.count:
            self._forget()
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        self._guess = found.values
        return Estimate(
            time=time,
            status=Status.CONTACT,
            contacts=tuple(Contact(position=one[:2], force=one[2:]) for one in found.values),
            covariance=found.covariance,
        )


class _Alone(NamedTuple):
    """A touch while it was the only one."""

    time: float
    found: TouchPosterior

    def standing(self, time: float, slide: float) -> Standing | None:
        """Where it is at another time, as far as that is known."""
        if not math.isfinite(slide):
            return None
        moved = slide**2 * max(time - self.time, 0.0) * np.eye(2)
        return Standing(self.found.values[0, :2], self.found.covariance[0, :2, :2] + moved)


def _with_creep_left(table: ResponseTable, design: SkinDesign, creep: Prony) -> ResponseTable:
    """The table with what undoing creep misses: it takes motions to be proportional to forces."""
    places = middles_of_fields(table.basis.extent, (7, 7))
    force = np.tile([0.0, 0.0, -_TYPICAL], (len(places), 1))
    curvature = field_curvature(design)[list(table.chips)]
    whole, half = (
        straightened(curvature, table.signals(places, part)) for part in (force, force / 2)
    )
    # Of a quadratic, half is missing where half the force is taken twice.
    missed = float(creep.retardation_shares.sum()) * 2 * (whole - 2 * half) / _TYPICAL
    return replace(table, misfit=table.misfit + missed.T @ missed / len(missed))
