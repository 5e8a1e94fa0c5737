"""Records as plain values for machines that know nothing of this package.

Decides that units stand in the names, in millimetres, newtons and microtesla, and that a number
that is not known is null: JSON has no NaN.
"""

import math
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.records import ChipFlag, Contact, Estimate, Reading

_MM_AND_N: Final = np.array([1e3, 1e3, 1.0, 1.0, 1.0])
_UNITS: Final = np.multiply.outer(_MM_AND_N, _MM_AND_N)
"""Units of a covariance's rows and columns."""


def touch_values(contact: Contact) -> dict[str, Any]:
    """A touch: its place on the skin, mm, and its force on the skin, N.

    Examples
    --------
    >>> touch_values(Contact(position=(0.045, 0.080), force=(0.0, 0.1, -0.5)))
    {'x_mm': 45.0, 'y_mm': 80.0, 'force_N': [0.0, 0.1, -0.5]}
    """
    x, y = contact.position.tolist()
    return {
        "x_mm": round(1e3 * x, 3),
        "y_mm": round(1e3 * y, 3),
        "force_N": contact.force.round(4).tolist(),
    }


def estimate_values(estimate: Estimate) -> dict[str, Any]:
    """An estimate: its time, s, status and touches."""
    touches = [touch_values(contact) for contact in estimate.contacts]
    return {"time_s": estimate.time, "status": estimate.status.name, "contacts": touches}


def covariance_values(estimate: Estimate) -> Any:
    """Covariance of x, y, mm, and the force, N, of every touch of an estimate, (C, 5, 5)."""
    return _known(estimate.covariance * _UNITS, 6)


def chip_values(reading: Reading) -> list[dict[str, Any]]:
    """What each chip read: its field, uT, temperature, degC, and what is wrong with it."""
    rows = zip(
        _known(1e6 * reading.field, 3),
        _known(reading.temperature, 2),
        reading.flags.tolist(),
        strict=True,
    )
    return [
        {
            "field_uT": field,
            "temperature_degC": degrees,
            "faults": [flag.name for flag in ChipFlag(flags)] if flags else [],
        }
        for field, degrees, flags in rows
    ]


def number(value: float, digits: int) -> float | None:
    """A number for JSON, None where it is not finite."""
    return round(value, digits) if math.isfinite(value) else None


def _known(values: Floats, digits: int) -> Any:
    """Lists of the numbers of an array, None where they are not finite."""
    rounded = values.round(digits)
    finite = np.isfinite(rounded)
    if finite.all():
        return rounded.tolist()
    lists = rounded.astype(object)
    lists[~finite] = None
    return lists.tolist()
