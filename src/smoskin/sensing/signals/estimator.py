"""What estimators on signals share: their zero, and whether anything touches at all.

Decides when a skin counts as touched: when chi-square of the signals in their noise passes what a
chosen rate of false alarms allows. Hides conditioning and how the zero follows drift.
"""

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.signals.conditioning import ZeroTracking
from smoskin.sensing.signals.signals import Signals, signal_noise


class SignalEstimator(Estimator):
    """Base of estimators that need no more than the signals of some chips.

    Parameters
    ----------
    design : SkinDesign
    chips : sequence of int
        Whose signals are read.
    creep : Prony, optional
        Of the skin's rubber, to undo its creep; by default touches are taken to have settled.
    false_alarms : float
        Chance of a reading of the untouched skin to count as touched.
    tracking : ZeroTracking, optional
        How the zero follows drift while nothing touches.

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
        false_alarms: float,
        tracking: ZeroTracking | None,
    ) -> None:
        if not 0.0 < false_alarms < 1.0:
            raise ArgumentError(f"false_alarms must lie in (0, 1); got {false_alarms}")
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.stats import chi2

        self.design = design
        self._chips = list(chips)
        self._signals = Signals(design, creep=creep, tracking=tracking)
        self._calm = np.linalg.inv(signal_noise(design, chips))
        self._touched = float(chi2.isf(false_alarms, 3 * len(chips)))

    @abstractmethod
    def _forget(self) -> None:
        """Nothing touches any more."""

    @abstractmethod
    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        """What touches, by these signals (C,), T, of a touched skin at this temperature, degC."""

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
        self._forget()

    def reset(self) -> None:
        """Return to the design's zero and forget earlier readings."""
        self._signals.reset()
        self._forget()

    def step(self, reading: Reading) -> Estimate:
        """What one reading shows.

        Raises
        ------
        ArgumentError
            If the reading has another number of chips than the design.
        """
        signal = self._signals.step(reading)
        if signal.status is not None:
            return Estimate(time=reading.time, status=signal.status)
        values = signal.values[self._chips].ravel()
        if values @ self._calm @ values < self._touched:
            self._signals.follow()
            self._forget()
            return Estimate(time=reading.time, status=Status.NO_CONTACT)
        self._signals.touched()
        return self._read(reading.time, values, signal.temperature)
