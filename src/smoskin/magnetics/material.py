"""How the magnets' material behaves: decides the temperature law of the remanence (Figure S15).

The chip compensates its own sensitivity; what is left in the reading is the magnet, which
weakens as it warms. Values are those of the magnet mud of the paper.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats

TEMPERATURE_COEFFICIENT: Final = -0.005
"""1/degC: relative change of the field per degree (SI, Text S11: 5 % per 10 degC)."""
REFERENCE_TEMPERATURE: Final = 25.0
"""degC: where the factor is one (SI, Text S11)."""


def temperature_factor(
    temperature: ArrayLike,
    coefficient: float = TEMPERATURE_COEFFICIENT,
    reference: float = REFERENCE_TEMPERATURE,
) -> Floats:
    """Field of a magnet over its field at the reference temperature.

    Parameters
    ----------
    temperature : array_like, any shape
        Of the magnet, degC.
    coefficient : float, optional
        Relative change per degree, 1/degC.
    reference : float, optional
        Where the factor is one, degC.

    Returns
    -------
    Floats
        Factor, the same for all three components; NaN where the temperature is NaN.

    Notes
    -----
    Source: SI Text S11, Figure S15. Valid for the tested range of 25 to 75 degC, where the
    printed loss is almost linear; reversible losses only.

    Examples
    --------
    >>> float(temperature_factor(35.0))
    0.95
    """
    return np.asarray(1.0 + coefficient * (floats("temperature", temperature) - reference))
