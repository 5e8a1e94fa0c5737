"""Unit suffixes of files, command line and wire, and their exact conversion to SI.

Everything inside the package is SI. A number that leaves it carries its unit in its name
(`panel_a_mm`); this module holds the one table that says what each suffix means. Conversion
goes through decimals, so that a value written to a file is read back as the same float.
"""

from decimal import Context, Decimal
from types import MappingProxyType
from typing import Final

_PRECISE: Final = Context(prec=50)
_DEGREE: Final = _PRECISE.divide(
    Decimal("3.14159265358979323846264338327950288419716939937511"), Decimal(180)
)

#: One of the suffix's unit in SI.
SI_PER_SUFFIX: Final = MappingProxyType(
    {
        "mm": Decimal("1e-3"),
        "um": Decimal("1e-6"),
        "deg": _DEGREE,
        "N": Decimal(1),
        "N_per_mm": Decimal("1e3"),
        "um_per_N": Decimal("1e-6"),
        "A_per_m": Decimal(1),
        "mT": Decimal("1e-3"),
        "uT": Decimal("1e-6"),
        "degC": Decimal(1),
        "us": Decimal("1e-6"),
        "s": Decimal(1),
    }
)


def to_si(number: Decimal | float, suffix: str) -> float:
    """A number of the suffix's unit as an SI float.

    Examples
    --------
    >>> to_si(15.5334, "mm")
    0.0155334
    """
    exact = number if isinstance(number, Decimal) else Decimal(repr(number))
    return float(_PRECISE.multiply(exact, SI_PER_SUFFIX[suffix]))


def from_si(value: float, suffix: str) -> Decimal:
    """The shortest decimal in the suffix's unit that `to_si` turns back into `value`.

    Examples
    --------
    >>> from_si(0.0155334, "mm")
    Decimal('15.5334')
    """
    exact = _PRECISE.divide(Decimal(repr(value)), SI_PER_SUFFIX[suffix])
    for digits in range(1, _PRECISE.prec):
        short = Decimal(f"{exact:.{digits}g}")
        if to_si(short, suffix) == value:
            break
    return Decimal(f"{short:f}")
