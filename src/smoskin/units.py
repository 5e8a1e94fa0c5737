"""Unit suffixes of files, command line and wire, and their factors to SI.

Everything inside the package is SI. A number that leaves it carries its unit in its name
(`panel_a_mm`); this module holds the one table that says what each suffix means.
"""

import math
from typing import Final

#: Factor from the suffix's unit to SI.
SI_PER_SUFFIX: Final[dict[str, float]] = {
    "mm": 1e-3,
    "um": 1e-6,
    "deg": math.pi / 180.0,
    "N": 1.0,
    "N_per_mm": 1e3,
    "A_per_m": 1.0,
    "kPa": 1e3,
    "MPa": 1e6,
    "GPa": 1e9,
    "mT": 1e-3,
    "uT": 1e-6,
    "degC": 1.0,
    "percent_per_degC": 1e-2,
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
}


def split_suffix(key: str) -> tuple[str, float]:
    """Name and SI factor of a key that ends in a unit suffix; the longest suffix wins.

    Parameters
    ----------
    key : str
        A key of a file or an option, such as ``panel_a_mm``.

    Returns
    -------
    name : str
        The key without its suffix; the key itself where it has none.
    factor : float
        Multiply by this to get SI; 1 where there is no suffix.

    Examples
    --------
    >>> split_suffix("panel_a_mm")
    ('panel_a', 0.001)
    >>> split_suffix("stiffness_N_per_mm")
    ('stiffness', 1000.0)
    >>> split_suffix("digital_filter")
    ('digital_filter', 1.0)
    """
    for suffix in sorted(SI_PER_SUFFIX, key=len, reverse=True):
        if key.endswith(f"_{suffix}"):
            return key[: -len(suffix) - 1], SI_PER_SUFFIX[suffix]
    return key, 1.0
