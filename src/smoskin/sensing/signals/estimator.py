"""What estimators on signals share: their zero, whether anything touches, and what is believed.

Decides when a skin counts as touched: when chi-square of the signals in their noise passes what a
chosen rate of false alarms allows; and that no touch lies off the skin or is harder than is known.
Hides the path from readings to signals.
"""

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import Prony, elastomer_prony
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Pose, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.signals.idle import IdleNoise, IdleTest
from smoskin.sensing.signals.loops import Loops
from smoskin.sensing.signals.signals import LET_GO, Signals, signal_noise
from smoskin.sensing.signals.zero import TouchTest, ZeroTracking

FOLLOWING: Final = ZeroTracking(
    hold=0.2, time_constant=2.0, widening_rate=0.1e-6, widening_limit=10e-6
)
"""How a zero follows drift by default: what noise explains is soon known to be idle."""
ON_AN_ARM: Final = replace(FOLLOWING, arm=True)
"""The same of a skin that an arm turns."""
_BEYOND: Final = 5e-3
"""Distance from the rim, m, up to which a place off the skin is believed."""
_HARDER: Final = 1.25
"""Ratio to the largest force that is known up to which a force is believed."""
_DRIFTED: Final = 60e-6
"""Change of a zero along an axis, T, up to which it may be drift whatever it looks like."""


class SignalEstimator(Estimator):
    """Base of estimators that need no more than the signals of some chips.

    Parameters
    ----------
    chips : sequence of int
        Chips whose signals are read.
    creep : Prony or None
        Solid of the skin's rubber, to undo its creep; None: that of the design's columns.
    tracking : ZeroTracking or None
        How the zero follows drift while nothing touches; None: as `FOLLOWING`.
    false_alarms : float
        Chance of a reading of the untouched skin to count as touched by the noise.
    idle : IdleTest, optional
        Another decision about which readings are untouched.
    correction : tuple of Floats, optional
        Correction of each chip's field, as `Signals` takes it.
    most : float
        Largest force that is known, N; past a quarter more a touch is `OUT_OF_RANGE`.
    zeroed : bool
        Whether the correction holds the zero; else it is `NOT_CALIBRATED` until `zero`.
    left : Floats, shape (C, C), optional
        Covariance of what a touch leaves in the signals, T^2; by default nothing.
    loops : Loops, optional
        Hysteresis of the signals, which is undone.
    touched : TouchTest, optional
        Decision between a touch and a turn about a new axis; by default it is a turn.

    Raises
    ------
    ArgumentError
        If the chance does not lie in (0, 1).
    """

    def __init__(
        self,
        design: SkinDesign,
        chips: Sequence[int],
        *,
        creep: Prony | None,
        tracking: ZeroTracking | None,
        false_alarms: float = 1e-6,
        idle: IdleTest | None = None,
        correction: tuple[Floats, Floats] | None = None,
        most: float = math.inf,
        zeroed: bool = False,
        left: Floats | None = None,
        loops: Loops | None = None,
        touched: TouchTest | None = None,
    ) -> None:
        self.design = design
        self.creep = elastomer_prony(design.columns.material) if creep is None else creep
        """Solid whose creep is undone."""
        prompt = 1 - float(self.creep.retardation_shares.sum())
        self.noise = signal_noise(design, chips) / prompt**2
        """Covariance N of an untouched skin's signals, (C, C), T^2: undoing creep raises what
        changes from reading to reading by what is missing of a prompt answer."""
        self._chips = list(chips)
        self._most = _HARDER * most
        self._rim: list[float] = (geometry(design).extent + _BEYOND).tolist()
        self._signals = Signals(
            design,
            correction=correction,
            creep=self.creep,
            tracking=tracking or FOLLOWING,
            idle=idle or IdleNoise(self.noise, false_alarms),
            zeroed=zeroed,
            chips=chips,
            left=left,
            loops=loops,
            touched=touched,
        )

    def carried_by(self, pose: Callable[[], Pose]) -> None:
        """As `Estimator.carried_by`; "What a pose changes" in `docs/derivations_robot.md`."""
        self._signals.carried_by(pose)
        self._forget()

    def _forget(self) -> None:
        """Forget the last touch: nothing touches any more. By default nothing is remembered."""

    @abstractmethod
    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        """What touches, by these signals (C,), T, of a touched skin at this temperature, degC."""

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._signals.drift

    @typed
    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Take the mean of these readings of the untouched skin as its zero; all chips count.

        `ArgumentError` where they move, or where the present zero knows them for a touch, unless
        `force` says that nothing touches.
        """
        if self._signals.taken and not force:
            change = self._signals.change(readings)
            drifted = np.abs(change - change.mean(axis=0)).max() < _DRIFTED
            if not drifted and self._touched(change[self._chips].ravel()):
                raise ArgumentError(f"{LET_GO}; got what reads as a touch")
        self._signals.zero(readings, force=force)
        self._forget()

    def unzero(self) -> None:
        """Return to the zero before the last; `ArgumentError` if there is none."""
        self._signals.unzero()
        self._forget()

    def reset(self) -> None:
        """Return to the zero of the start and forget earlier readings."""
        self._signals.reset()
        self._forget()

    def step(self, reading: Reading) -> Estimate:
        """What one reading shows."""
        signal = self._signals.step(reading)
        if signal.status is Status.NO_CONTACT or self._signals.clock.anew:
            self._forget()
        if signal.status is not None:
            return Estimate(time=reading.time, status=signal.status)
        values = signal.values[self._chips].ravel()
        estimate = self._read(reading.time, values, signal.temperature)
        if all(map(self._believed, estimate.contacts)):
            return estimate
        self._forget()
        return Estimate(time=reading.time, status=Status.OUT_OF_RANGE)

    def _touched(self, signals: Floats) -> bool:
        """Whether signals (C,), T, are those of a touch."""
        self._forget()
        estimate = self._read(0.0, signals, self._signals.temperature)
        self._forget()
        return estimate.status in (Status.CONTACT, Status.AMBIGUOUS)

    def _believed(self, contact: Contact) -> bool:
        """Whether a touch lies on the skin and is no harder than what is known."""
        (x, y), most = contact.position.tolist(), self._most
        if not (-_BEYOND <= x <= self._rim[0] and -_BEYOND <= y <= self._rim[1]):
            return False
        return all(abs(force) <= most for force in contact.force.tolist())
