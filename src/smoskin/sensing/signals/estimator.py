"""What estimators on signals share: their zero, and whether anything touches at all.

Decides when a skin counts as touched: when chi-square of the signals in their noise passes what a
chosen rate of false alarms allows. Hides the path from readings to signals.
"""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Final

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.viscoelasticity import Prony, elastomer_prony
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.signals.signals import Signals, signal_noise
from smoskin.sensing.signals.zero import IdleNoise, IdleTest, ZeroTracking

FOLLOWING: Final = ZeroTracking(
    hold=0.2, time_constant=2.0, widening_rate=0.1e-6, widening_limit=10e-6
)
"""How a zero follows drift by default: what noise explains is soon known to be idle."""


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
    ) -> None:
        self.design = design
        self.creep = elastomer_prony(design.columns.material) if creep is None else creep
        """Solid whose creep is undone."""
        self._chips = list(chips)
        self._signals = Signals(
            design,
            correction=correction,
            creep=self.creep,
            tracking=tracking or FOLLOWING,
            idle=idle or IdleNoise(signal_noise(design, chips), chips, false_alarms),
        )

    def _forget(self) -> None:
        """Forget the last touch: nothing touches any more. By default nothing is remembered."""

    @abstractmethod
    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        """What touches, by these signals (C,), T, of a touched skin at this temperature, degC."""

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._signals.drift

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take the mean of these readings of the untouched skin as its zero; all chips count."""
        self._signals.zero(readings)
        self._forget()

    def reset(self) -> None:
        """Return to the design's zero and forget earlier readings."""
        self._signals.reset()
        self._forget()

    def step(self, reading: Reading) -> Estimate:
        """What one reading shows."""
        signal = self._signals.step(reading)
        if signal.status is Status.NO_CONTACT:
            self._forget()
        if signal.status is not None:
            return Estimate(time=reading.time, status=signal.status)
        return self._read(reading.time, signal.values[self._chips].ravel(), signal.temperature)
