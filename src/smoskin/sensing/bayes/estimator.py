"""The estimator that knows what it does not know: touches by their posterior on a response table.

Decides how many touches there are, by their evidence, and what is answered. The table is of this
skin after a few-touch calibration (`smoskin.sensing.response.calibrate`), or of its design with
all that made skins differ by as its uncertainty.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.nonlinearity import field_curvature, straightened
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.origami.geometry import middles_of_fields
from smoskin.records import Contact, Estimate, Status
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.bayes.solver import Solve, TouchSolver
from smoskin.sensing.bayes.starts import TYPICAL
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.estimator import SignalEstimator
from smoskin.sensing.signals.zero import ZeroTracking

_WARMER: Final = 0.25
"""Change of the rubber's temperature, degC, from which the table is taken anew."""
_DOUBT: Final = 25.0
"""Misfit of a single touch over its expected value, one a signal, past which two are tried. What
a table misses has heavier tails than a normal: hard touches in a corner come to 15 on some
skins, few pairs to less than 25."""
_STIRRED: Final = 4.0
"""Misfit of a single touch, likewise, past which the skin may turn under it."""
_TURNS: Final = math.log(0.01)
"""Logarithm of the chance that a skin begins to turn under a touch."""
_NEAR: Final = 0.1
"""Change of signals, as a share of them, within which one search for touches serves."""
_LIKE: Final = 1.25
"""Misfit over that of the search, likewise."""
_WORST: Final = 400.0
"""Misfit over its expected value past which nothing on the table fits."""


class BayesEstimator(SignalEstimator):
    """Place and force of no, one or two touches, with their covariance.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Table of this skin or of its design; of some of its chips, to use only those.
    priors : TouchPriors, optional
    creep, false_alarms, tracking
        As `smoskin.sensing.signals.estimator.SignalEstimator` takes them; by default the creep of
        the design's columns is undone (`smoskin.mechanics.viscoelasticity.ELASTIC` for none), and
        the zero follows drift.

    Raises
    ------
    ModelError
        If the table belongs to another design.
    ArgumentError
        If the chance does not lie in (0, 1).

    Notes
    -----
    Where one touch fits badly, the number K of touches is the one of greater evidence
    p(s | K) p(K); see `smoskin.sensing.bayes.posterior.TouchProblem`. How unsure the zero is joins
    the noise ("The zero" in `docs/derivations.md`). Two touches are taken as straight. One that was
    alone before the other came is taken to stand about where it stood (`TouchPriors.slide`) and
    comes first.
    """

    @typed
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
            most=table.forces[1],
            left=table.left,
            loops=table.loops,
        )
        self.table = table
        self._unwarps = table.contact.inverse(table.warps[0], table.basis.extent)
        # What loads the sheet is sought; from that follows the place of a touch.
        table = table.by_loads()
        self._priors = priors or TouchPriors()
        self._solver = TouchSolver(
            _with_creep_left(table, design, self.creep), self.noise, self._priors
        )
        self._solved_at = np.nan
        self._leads: dict[str, Lead] = {}
        self._alone: LoneTouch | None = None

    @property
    def misfit(self) -> Floats:
        """Covariance of what is not known of a touch of a newton, (C, C), T^2/N^2."""
        return self._solver.misfit

    def _forget(self) -> None:
        self._leads, self._alone = {}, None

    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        if not abs(temperature - self._solved_at) < _WARMER:
            self._solver.warm_to(temperature)
            self._solved_at = temperature
        found = self._likeliest(time, signals)
        if found.misfit > _WORST * self.table.count:
            self._forget()
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        values, covariance = self._touches(found)
        return Estimate(
            time=time,
            status=Status.CONTACT,
            contacts=tuple(Contact(position=row[:2], force=row[2:]) for row in values),
            covariance=covariance,
        )

    def _touches(self, found: TouchPosterior) -> tuple[Floats, Floats]:
        """Touch vectors (K, 5), and their covariance (K, 5, 5), of what loads the sheet."""
        values, covariance = np.array(found.values), np.array(found.covariance)
        for axis, unwarp in enumerate(self._unwarps):
            if unwarp.is_none:
                continue
            for value, spread in zip(values, covariance, strict=True):
                load, variance = float(value[axis]), float(spread[axis, axis])
                value[axis], apart = unwarp.place(load, variance)
                scale = math.sqrt(apart / variance)
                spread[axis] *= scale
                spread[:, axis] *= scale
        return values, covariance

    def _likeliest(self, time: float, signals: Floats) -> TouchPosterior:
        """One touch, of a skin that turns or two where one fits badly and these are likelier."""
        count, solver = self.table.count, self._solver
        before, self._leads = self._leads, {}

        def follow(way: str, solve: Solve, *standing: Standing | None) -> TouchPosterior:
            """The touches that explain the signals in this way, from those of a reading ago."""
            lead = before.get(way)
            guess, enough = (lead.values, lead.enough(signals)) if lead else (None, 0.0)
            found = solve(signals, guess, *standing, enough=enough)
            if lead is None or found.misfit > enough:
                lead = Lead(found.values, signals, found.misfit)
            self._leads[way] = lead._replace(values=found.values)
            return found

        zero, amiss = self._signals.followed, self._signals.bent_amiss(signals)
        solver.add_noise(zero.covariance + amiss)
        one = best = follow("one", solver.one)
        turned = False
        if one.misfit > _STIRRED * count:
            solver.add_noise(zero.stirred + amiss)
            other = follow("turned", solver.one)
            if other.evidence + _TURNS > one.evidence:
                best, turned = other, True
        if one.misfit < _DOUBT * count:
            self._alone = LoneTouch(time, best)
        elif self._priors.chances[2] > 0:
            solver.add_noise(zero.covariance + amiss)
            standing = self._alone and self._alone.standing(time, self._priors.slide)
            two = follow("two", solver.two, standing)
            if two.evidence > best.evidence + (_TURNS if turned else 0.0):
                return two
        if turned:
            zero.stir()
        return best


class Lead(NamedTuple):
    """Touches that explained the last reading in one way, and the search that they follow from."""

    values: Floats
    """Touch vectors (K, 5)."""
    signals: Floats
    """Signals that were searched, (C,), T."""
    misfit: float
    """Misfit that the search came to."""

    def enough(self, signals: Floats) -> float:
        """Misfit up to which they are followed: about the search's, while signals are its own."""
        change = np.linalg.norm(signals - self.signals)
        near = change < _NEAR * np.linalg.norm(self.signals)
        return _LIKE * self.misfit if near else 0.0


class LoneTouch(NamedTuple):
    """A touch while it was the only one."""

    time: float
    """Time at which it was last alone, s."""
    found: TouchPosterior
    """What was known of it."""

    def standing(self, time: float, slide: float) -> Standing | None:
        """Its place at another time, as far as that is known."""
        if not math.isfinite(slide):
            return None
        moved = slide**2 * max(time - self.time, 0.0) * np.eye(2)
        return Standing(self.found.values[0, :2], self.found.covariance[0, :2, :2] + moved)


def _with_creep_left(table: ResponseTable, design: SkinDesign, creep: Prony) -> ResponseTable:
    """The table with what undoing creep misses: it takes motions to be proportional to forces."""
    places = middles_of_fields(table.basis.extent, (7, 7))
    force = np.tile([0.0, 0.0, -TYPICAL], (len(places), 1))
    curvature = field_curvature(design)[list(table.chips)]
    whole, half = (
        straightened(curvature, table.signals(places, part)) for part in (force, force / 2)
    )
    # Of a quadratic, half is missing where half the force is taken twice.
    missed = float(creep.retardation_shares.sum()) * 2 * (whole - 2 * half) / TYPICAL
    return replace(table, misfit=table.misfit + missed.T @ missed / len(missed))
