"""The estimator that knows what it does not know: touches by their posterior on a response table.

Decides how many touches there are, by their evidence, and what is answered. The table is of this
skin after a few-touch calibration (`smoskin.sensing.response.calibrate`), or of its design with
all that made skins differ by as its uncertainty.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final, NamedTuple
from weakref import WeakMethod

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.nonlinearity import field_curvature, straightened
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.origami.geometry import middles_of_fields
from smoskin.records import Contact, Estimate, Pose, Status
from smoskin.sensing.bayes.priors import Standing, TouchPosterior, TouchPriors
from smoskin.sensing.bayes.resting import Resting
from smoskin.sensing.bayes.solver import TouchSolver
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
_FRESH: Final = 0.05
"""Time, s, for which it serves however they change."""
_LIKE: Final = 1.25
"""Misfit over that of the search, likewise."""
_LEAP: Final = 0.3
"""Share of signals that is none of those before, past which what explained them leads nowhere."""
_AGE: Final = 0.2
"""Time, s, for which what a single touch could say of signals bounds what it can say of later ones:
noise, which widens meanwhile, is taken to be the same."""
_WORST: Final = 400.0
"""Misfit over its expected value past which nothing on the table fits."""
_LOST: Final = 1.0
"""Time, s, for which signals like those that nothing explained are not searched again: each such
search tries all that it can."""


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
    comes first. A single one that rests is where it was known best (`TouchPriors.wander`).
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
        # Were it held by what it asks, its table would stay until Python looks for such circles.
        likelier_touched = WeakMethod(self._likelier_touched)

        def touched(signals: Floats, density: float) -> bool:
            test = likelier_touched()
            return test is not None and test(signals, density)

        super().__init__(
            design,
            table.chips,
            creep=creep,
            false_alarms=false_alarms,
            tracking=tracking,
            most=table.forces[1],
            left=table.left,
            loops=table.loops,
            touched=touched,
        )
        self.table = table
        self._unwarps = table.contact.inverse(table.warps[0], table.basis.extent)
        # What loads the sheet is sought; from that follows the place of a touch.
        table = table.by_loads()
        self._priors = priors or TouchPriors()
        self._solver = TouchSolver(
            _with_creep_left(table, design, self.creep), self.noise, self._priors
        )
        if self._priors.chances[2] > 0:
            self._solver.ready_for_pair()
        self._resting = Resting(self._priors.wander)
        self._solved_at = np.nan
        self._leads: dict[str, Lead] = {}
        self._rival: Rival | None = None
        self._alone: LoneTouch | None = None
        self._lost: tuple[float, Floats] | None = None

    @property
    def misfit(self) -> Floats:
        """Covariance of what is not known of a touch of a newton, (C, C), T^2/N^2."""
        return self._solver.misfit

    def reset(self) -> None:
        """Return to the zero of the start and forget earlier readings, how warm they were too."""
        super().reset()
        self._solved_at = np.nan

    def carried_by(self, pose: Callable[[], Pose]) -> None:
        """As `Estimator.carried_by`; the zero is known under a touch, whether that rests or not."""
        super().carried_by(pose)
        self._resting = Resting(math.inf)

    def _forget(self) -> None:
        self._leads, self._rival, self._alone, self._lost = {}, None, None, None
        self._resting.forget()

    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        self._warm_to(temperature)
        if self._is_lost(time, signals):
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        posterior = self._likeliest(time, signals)
        if posterior.misfit > _WORST * self.table.count:
            self._forget()
            self._lost = time, signals
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        values, covariance = self._touches(posterior)
        if len(values) == 1:
            self._rest(time, values[0], covariance[0])
        else:
            self._resting.forget()
        return Estimate(
            time=time,
            status=Status.CONTACT,
            contacts=tuple(Contact(position=row[:2], force=row[2:]) for row in values),
            covariance=covariance,
        )

    def _rest(self, time: float, touch: Floats, spread: Floats) -> None:
        """Let a touch (5,) and its covariance (5, 5) know its place from earlier readings too.

        Its force follows by how it depends on the place.
        """
        read, own = touch[:2].copy(), spread[:2, :2].copy()
        place, spread_there = self._resting.joined(time, read, own)
        if place is read:
            return
        touch[:2], spread[:2, :2] = place, spread_there
        slope = np.linalg.solve(own, spread[:2, 2:]).T
        touch[2:] += slope @ (touch[:2] - read)
        spread[2:, 2:] += slope @ (spread[:2, :2] - own) @ slope.T
        spread[2:, :2] = slope @ spread[:2, :2]
        spread[:2, 2:] = spread[2:, :2].T

    def _warm_to(self, temperature: float) -> None:
        """Read a rubber of this temperature, degC."""
        if not abs(temperature - self._solved_at) < _WARMER:
            self._solver.warm_to(temperature)
            self._solved_at = temperature

    def _likelier_touched(self, signals: Floats, density: float) -> bool:
        """Whether signals (C,), T, are likelier a touch's than those of a turn of this density."""
        self._warm_to(self._signals.temperature)
        nothing = self._priors.chances[0]
        zero, amiss = self._signals.followed, self._signals.bent_amiss(signals)
        self._solver.add_noise(zero.covariance + amiss)
        touch = self._solver.single(signals)
        return touch.evidence > density + math.log(nothing or 1e-300)

    def _is_lost(self, time: float, signals: Floats) -> bool:
        """Whether nothing explained signals like these a moment ago."""
        if self._lost is None:
            return False
        since, before = self._lost
        near = np.linalg.norm(signals - before) < _NEAR * np.linalg.norm(before)
        return bool(near and time - since < _LOST)

    def _touches(self, posterior: TouchPosterior) -> tuple[Floats, Floats]:
        """Touch vectors (K, 5), and their covariance (K, 5, 5), others being as likely."""
        values, covariance = self._unwarped(posterior)
        covariance *= posterior.share
        for other in posterior.others:
            there, spread = self._unwarped(other)
            away = there - values
            covariance += other.share * (spread + away[:, :, None] * away[:, None])
        return values, covariance

    def _unwarped(self, posterior: TouchPosterior) -> tuple[Floats, Floats]:
        """Touch vectors and their covariance of what loads the sheet."""
        values, covariance = np.array(posterior.values), np.array(posterior.covariance)
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
        zero, amiss = self._signals.followed, self._signals.bent_amiss(signals)
        still = zero.covariance + amiss
        solver.add_noise(still)
        rival = self._rival
        goes_on = rival is not None and rival.still_misfits(time, signals)
        two = None
        if goes_on:
            two = self._pair(time, signals, self._leads)
        if rival and two and two.evidence > rival.at_best(signals, zero.turned):
            return two
        before, self._leads = self._leads, {}
        single = best = self._follow("single", time, signals, before)
        if single.misfit < _DOUBT * count:
            two = None
        elif two:
            self._leads["pair"] = before["pair"]
        elif self._priors.chances[2] > 0:
            two = self._pair(time, signals, before)
        self._rival = rival = Rival(time, signals, solver.whitener(single), single)
        if two and two.evidence > rival.at_best(signals, zero.turned):
            return two
        turned = False
        if single.misfit > _STIRRED * count and (turn := zero.turned).any():
            solver.add_noise(still + turn)
            other = self._follow("turned", time, signals, before)
            if other.evidence + _TURNS > single.evidence:
                best, turned = other, True
        if single.misfit < _DOUBT * count:
            self._alone = LoneTouch(time, best)
        elif two and two.evidence > best.evidence + (_TURNS if turned else 0.0):
            return two
        self._rival = None
        if turned:
            zero.stir()
        return best

    def _pair(
        self, time: float, signals: Floats, leads: "dict[str, Lead]"
    ) -> TouchPosterior | None:
        """Two touches that explain the signals; none if one of them is harder than what is known.

        Where a table misses what a drag does, such a pair may fit better than the touch itself.
        """
        two = self._follow("pair", time, signals, leads, self._standing(time))
        return two if -two.values[:, 4].min() <= self._most else None

    def _standing(self, time: float) -> Standing | None:
        """What is known of a touch from when it was alone."""
        return self._alone and self._alone.standing(time, self._priors.slide)

    def _follow(
        self,
        way: str,
        time: float,
        signals: Floats,
        leads: "dict[str, Lead]",
        *standing: Standing | None,
    ) -> TouchPosterior:
        """Touches that explain the signals in this way, from those of a reading ago."""
        solve = self._solver.pair if way == "pair" else self._solver.single
        lead = leads.get(way)
        guess, enough = (lead.values, lead.enough(time, signals)) if lead else (None, 0.0)
        if lead and lead.is_left(signals, enough):
            guess, enough = None, 0.0
        posterior = solve(signals, guess, *standing, enough=enough)
        if lead is None or posterior.misfit > enough:
            lead = Lead(time, posterior.guesses, signals, posterior.misfit)
        self._leads[way] = lead._replace(values=posterior.guesses)
        return posterior


class Rival(NamedTuple):
    """The single touch that explained signals worse than two did.

    How far any touch is from what is read changes by no more than what is read moves, so that for
    a while no other search tells whether one could do.
    """

    time: float
    """Time of those signals, s."""
    signals: Floats
    """Those signals, (C,), T."""
    white: Floats
    """Matrix (C, C), 1/T, that turns signals into standard deviations, as it was found."""
    touch: TouchPosterior
    """Single touch that explains them best."""

    def misfit(self, signals: Floats) -> float:
        """Least misfit that a single touch can have of other signals (C,), T."""
        moved = float(np.linalg.norm(self.white @ (signals - self.signals)))
        return max(math.sqrt(self.touch.misfit) - moved, 0.0) ** 2

    def still_misfits(self, time: float, signals: Floats) -> bool:
        """Whether any single touch fits such signals badly at another time."""
        return time - self.time < _AGE and self.misfit(signals) > _DOUBT * len(signals)

    def at_best(self, signals: Floats, turn: Floats) -> float:
        """Most evidence of a single touch for such signals, be it of a skin that turns.

        A turn adds this covariance (C, C), T^2, to noise. Where it widens noise by at most a
        factor, misfit and information shrink by that factor at most.
        """
        fits, least = self.touch.evidence + self.touch.misfit / 2, self.misfit(signals)
        wider = 1 + float(np.linalg.eigvalsh(self.white @ turn @ self.white.T)[-1])
        unknowns = np.count_nonzero(self.touch.covariance[0].diagonal())
        of_turn = _TURNS - least / (2 * wider) + unknowns / 2 * math.log(wider)
        return fits + max(-least / 2, of_turn)


class Lead(NamedTuple):
    """Touches that explained the last reading in one way, and the search that they follow from."""

    time: float
    """Time of that search, s."""
    values: Floats
    """Touch vectors (N, K, 5), those of others that were as likely after its own."""
    signals: Floats
    """Signals that were searched, (C,), T."""
    misfit: float
    """Misfit that the search came to."""

    def is_left(self, signals: Floats, enough: float) -> bool:
        """Whether signals tell of other touches, or these explained badly what has changed."""
        along = self.signals * (signals @ self.signals) / (self.signals @ self.signals)
        leapt = np.linalg.norm(signals - along) > _LEAP * np.linalg.norm(signals)
        return bool(leapt or (not enough and self.misfit > _DOUBT * len(signals)))

    def enough(self, time: float, signals: Floats) -> float:
        """Misfit up to which they are followed: the search's, if fresh or of like signals."""
        change = np.linalg.norm(signals - self.signals)
        near = change < _NEAR * np.linalg.norm(self.signals)
        return _LIKE * self.misfit if near or time - self.time < _FRESH else 0.0


class LoneTouch(NamedTuple):
    """A touch while it was the only one."""

    time: float
    """Time at which it was last alone, s."""
    touch: TouchPosterior
    """What was known of it."""

    def standing(self, time: float, slide: float) -> Standing | None:
        """Its place at another time, as far as that is known."""
        if not math.isfinite(slide):
            return None
        spread = self.touch.covariance[0, :2, :2].copy()
        spread[(0, 1), (0, 1)] += slide**2 * max(time - self.time, 0.0)
        return Standing(self.touch.values[0, :2], np.asarray(np.linalg.inv(spread)))


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
