"""Temperatures of magnets and rubber, from what chips report of their own.

Decides what counts as a temperature.
"""

import math
from typing import Final

from smoskin.arrays import Floats
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.sensing.signals.guards import PLAUSIBLE

_THERMAL_SMOOTHING: Final = 0.05
"""Share of a new temperature in the rubber's: chips round to a fiftieth of a degree."""


class Thermometer:
    """Temperatures of S magnets and the rubber, by the chips' reports that can be true."""

    def __init__(self, chips: int) -> None:
        self._last = [math.nan] * chips
        self._rubber = math.nan

    @property
    def magnets(self) -> list[float]:
        """Last plausible report of each chip, degC; the reference temperature before it."""
        return [REFERENCE_TEMPERATURE if math.isnan(last) else last for last in self._last]

    @property
    def rubber(self) -> float:
        """Smoothed mean of the chips that reported, degC; the reference temperature until then."""
        return REFERENCE_TEMPERATURE if math.isnan(self._rubber) else self._rubber

    def step(self, reported: Floats) -> None:
        """Take in what each chip reports, (S,), degC."""
        least, most = PLAUSIBLE
        self._last = [
            now if least < now < most else before
            for now, before in zip(reported.tolist(), self._last, strict=True)
        ]
        plausible = [last for last in self._last if not math.isnan(last)]
        if plausible:
            mean = sum(plausible) / len(plausible)
            before = mean if math.isnan(self._rubber) else self._rubber
            self._rubber = before + _THERMAL_SMOOTHING * (mean - before)
