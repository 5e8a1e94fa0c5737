"""Warmth of magnets and sheet: decides the law of weakening and the bounds of service.

The chip compensates its own sensitivity; what is left in the reading is the magnet, which
weakens as it warms. Values are those of the paper's magnet mud. Humidity and light had no effect
there (SI Text S11), so nothing here depends on them.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.errors import ArgumentError

TEMPERATURE_COEFFICIENT: Final = -0.005
"""1/degC: relative change of the field per degree (SI, Text S11: 5 % per 10 degC)."""
REFERENCE_TEMPERATURE: Final = 25.0
"""degC: temperature at which the factor is one (SI, Text S11)."""
SERVICE_LIMITS: Final = (-40.0, 75.0)
"""degC: from the chips' lowest temperature to the highest at which magnets were tested and
hot-pressed layers held; glued panels came off at 75 and held at 50 for 24 h (SI, Text S11,
Figure S14). Below 25 the law of weakening is carried on."""


def temperature_factor(temperature: ArrayLike) -> Floats:
    """Field of a magnet over its field at the reference temperature, at temperatures in degC.

    It is the same for all three components; NaN where the temperature is NaN.

    Notes
    -----
    Source: SI Text S11, Figure S15. Valid for the tested range of 25 to 75 degC, where the
    printed loss is almost linear; reversible losses only.

    Examples
    --------
    >>> float(temperature_factor(35.0))
    0.95
    """
    warmth = floats("temperature", temperature) - REFERENCE_TEMPERATURE
    return np.asarray(1.0 + TEMPERATURE_COEFFICIENT * warmth)


def check_temperature(temperature: ArrayLike) -> Floats:
    """The temperatures that somebody sets, degC, as an array of any shape, if the skin stands them.

    It raises an `ArgumentError` if one lies outside `SERVICE_LIMITS` or is not a number.

    Notes
    -----
    Source: SI Text S11, Figures S14 and S15.

    Examples
    --------
    >>> check_temperature(80.0)
    Traceback (most recent call last):
    smoskin.errors.ArgumentError: temperature must lie in -40..75 degC; got 80.0
    """
    degrees = floats("temperature", temperature)
    least, most = SERVICE_LIMITS
    if not ((degrees >= least) & (degrees <= most)).all():
        raise ArgumentError(f"temperature must lie in {least:g}..{most:g} degC; got {degrees}")
    return degrees
