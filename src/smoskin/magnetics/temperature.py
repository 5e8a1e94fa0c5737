"""Warmth of magnets, chips and sheet: decides the laws of weakening and the bounds of service.

A warm skin reads less: the paper measured how much, and the chips' data sheet says that nearly all
of it is the chips' sensitivity, which nothing compensates at the resolutions in use; the rest is
the magnets'. Humidity and light had no effect (SI Text S11), so nothing here depends on them.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.errors import ArgumentError

TEMPERATURE_COEFFICIENT: Final = -0.005
"""1/degC: relative change per degree of what a skin reads (SI, Text S11: 5 % per 10 degC)."""
CHIP_COEFFICIENT: Final = -0.0045
"""1/degC: relative change of a chip's sensitivity per degree, its compensation TCMP being off
(Melexis MLX90393 data sheet rev 011, Tables 17 and 18)."""
REFERENCE_TEMPERATURE: Final = 25.0
"""degC: temperature at which the factor is one (SI, Text S11)."""
SERVICE_LIMITS: Final = (-40.0, 75.0)
"""degC: from the chips' lowest temperature to the highest at which magnets were tested and
hot-pressed layers held; glued panels came off at 75 and held at 50 for 24 h (SI, Text S11,
Figure S14). Below 25 the law of weakening is carried on."""


def temperature_factor(temperature: ArrayLike) -> Floats:
    """Reading of a magnet over that at the reference temperature, chip and magnet being as warm.

    Temperatures are in degC. It is the same for all three components; NaN where the temperature is
    NaN.

    Notes
    -----
    Source: SI Text S11, Figure S15. Valid for the tested range of 25 to 75 degC, where the
    printed loss is almost linear; reversible losses only. It is the product of `chip_factor` and
    `magnet_factor`: whoever corrects by it has corrected both.

    Examples
    --------
    >>> float(temperature_factor(35.0))
    0.95
    """
    warmth = floats("temperature", temperature) - REFERENCE_TEMPERATURE
    return np.asarray(1.0 + TEMPERATURE_COEFFICIENT * warmth)


def chip_factor(temperature: ArrayLike) -> Floats:
    """Sensitivity of a chip over that at the reference temperature, at its temperature in degC.

    Notes
    -----
    Source: Melexis MLX90393 data sheet rev 011, Tables 17 and 18. Valid for -40 to 85 degC with
    TCMP off; TCMP works at RES 0 and 1 only.

    Examples
    --------
    >>> float(chip_factor(35.0))
    0.955
    """
    warmth = floats("temperature", temperature) - REFERENCE_TEMPERATURE
    return np.asarray(1.0 + CHIP_COEFFICIENT * warmth)


def magnet_factor(temperature: ArrayLike) -> Floats:
    """Field of a magnet over that at the reference temperature, at its temperature in degC.

    It is what the chips leave of the paper's loss, some 0.05 % a degree. Makers state 0.11 % for
    bonded NdFeB; both numbers of which this is the difference are rounded by as much.

    Notes
    -----
    Source: `temperature_factor` over `chip_factor`. Valid as they are.

    Examples
    --------
    >>> round(float(magnet_factor(35.0)), 4)
    0.9948
    """
    return np.asarray(temperature_factor(temperature) / chip_factor(temperature))


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
