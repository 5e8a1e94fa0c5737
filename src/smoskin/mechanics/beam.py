"""A rubber column or pillar as a beam: what holds its top sideways, under load and at a stop.

Clamped at its foot; its top is guided, free to move sideways but not to turn. Bending and shear
after Haringx, to second order in the sway. Its functions serve NumPy and JAX alike. Numbers of the
beam are: its height h, bending stiffness EI, and shear share s = EI / (G A_s h^2).
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats

_ENDS: Final = 0.25
"""Share of the radius by which bonded ends, whose rubber cannot swell aside, shorten a column in
bending: between 1.113 (h = 4 r) and 1.054 (14 r) times as stiff, by finite elements."""
_SHEAR_FACTOR: Final = 0.9
"""Effective share of a round section in shear."""
_TERMS: Final = tuple(
    (-1) ** k * (k + 1) / (2 * 4**k * math.factorial(2 * k + 3)) for k in range(21)
)
"""Series of (sin x - x cos x) / (4 x^3) by (2x)^2, good to 1e-15 from -240 to 90."""
_TENSION: Final = 0.8
"""Share of the shear stiffness G A_s up to which a pull counts; bonds break before."""


class Sway(NamedTuple):
    """Stiffness of a beam's top against sway, over EI / h^3, and its derivatives by z."""

    value: Any
    slope: Any
    curvature: Any


class Beam(NamedTuple):
    """A beam's numbers."""

    lateral: float
    """N/m: stiffness against sway without load."""
    axial: float
    """N/m: stiffness along the axis."""
    shear_share: float
    """s = EI / (G A_s h^2)."""


class Prop(NamedTuple):
    """A rigid support of a beam on its way up."""

    lever: float
    """Deflection there over the sway of the top, without load."""
    stiffness: float
    """N/m: what the support adds to the stiffness against sway."""


def beam(radius: float, height: float, shear_modulus: float) -> Beam:
    """A round rubber column of `radius` and `height`, m, and `shear_modulus`, Pa.

    Notes
    -----
    Source: Timoshenko's beam with E = 3 G and A_s = 0.9 A sideways, 1 / (h^3 / (12 E I) +
    h / (G A_s)), its ends stiffened as finite elements say, (1 + r / (4 h))^3 in bending. Along the
    axis a cylinder bonded at both ends, E A (1 + 2 S^2) / h with the shape factor S = r / (2 h).
    The SI takes columns in pure shear (S21), five and a half times as stiff sideways at r = 1.5 and
    h = 10 mm. Valid for axial strains up to some tenths.

    Examples
    --------
    >>> column = beam(1.5e-3, 10e-3, 25e3)
    >>> round(column.lateral, 2), round(column.axial, 2)
    (3.19, 53.61)
    """
    area = math.pi * radius**2
    bending = 3 * shear_modulus * area * radius**2 / 4 * (1 + _ENDS * radius / height) ** 3
    shear = _SHEAR_FACTOR * shear_modulus * area
    return Beam(
        lateral=1 / (height**3 / (12 * bending) + height / shear),
        axial=3 * shear_modulus * area * (1 + radius**2 / (2 * height**2)) / height,
        shear_share=bending / (shear * height**2),
    )


def sway(z: Any, share: Any) -> Sway:
    """Stiffness against sway under the axial compression N, with z = N h^2 / EI.

    Notes
    -----
    Source: Haringx's column, clamped and guided: N / ((1 + N / (G A_s)) (2 / q) tan(q h / 2) - h)
    with q^2 = N (1 + N / (G A_s)) / EI, in a form that is smooth through N = 0 and through
    tan's poles. It is 0 at q h = pi, where the column alone sways; q h = 2 pi is `buckling_load`.
    Valid from -0.8 G A_s up to `crushing`, and for axial strains of a few per cent: it keeps the
    unloaded height and section, while finite elements of a neo-Hookean column (h = 8 r) are stiffer
    sideways by some 5 times the axial strain, 0.1 of the unloaded stiffness at 2 %.
    """
    more = 1 + share * z
    y, y_slope = z * more, 1 + 2 * share * z
    whole, slope, curved = _series(y)
    # sin x / x and cos x follow from the series: y S' + 3/2 S = sin x / (8 x), S = (.. - cos) / y.
    sine = 8 * y * slope + 12 * whole
    cosine, c1, c2 = sine - y * whole, -sine / 8, whole / 16
    s1, s2 = slope * y_slope, curved * y_slope**2 + slope * 2 * share
    c1, c2 = c1 * y_slope, c2 * y_slope**2 + c1 * 2 * share
    under = share * cosine + more**2 * whole
    under1 = share * c1 + 2 * share * more * whole + more**2 * s1
    under2 = share * c2 + 2 * share**2 * whole + 4 * share * more * s1 + more**2 * s2
    value = cosine / under
    first = (c1 - value * under1) / under
    return Sway(value, first, (c2 - 2 * first * under1 - value * under2) / under)


def _series(y: Any) -> tuple[Any, Any, Any]:
    """S(y) = (sin x - x cos x) / (4 x^3) with y = 4 x^2, and its two derivatives."""
    whole = _TERMS[-1] + 0.0 * y
    slope, curved = 0.0 * y, 0.0 * y
    for term in reversed(_TERMS[:-1]):
        curved = curved * y + slope
        slope = slope * y + whole
        whole = whole * y + term
    return whole, slope, 2 * curved


def unloaded(share: Any) -> Any:
    """Stiffness against sway without load over EI / h^3: 1 / (1/12 + s)."""
    return 1 / (1 / 12 + share)


def slackest(share: Any) -> Any:
    """Lowest z at which `sway` holds, negative: a pull near which rubber's bond breaks."""
    return -_TENSION / share


def buckling(share: Any) -> Any:
    """Z at which a column between two clamps buckles: q h = 2 pi, after Haringx."""
    return _compression(4 * np.pi**2, share)


def crushing(share: Any) -> Floats:
    """Z at which no force holds the column's height any more: `sway` falls to minus infinity."""
    low, high = buckling(share), _compression(80.8, share)
    for _ in range(60):
        middle = (low + high) / 2
        more = 1 + share * middle
        whole, slope, _ = _series(middle * more)
        cosine = 8 * middle * more * slope + (12 - middle * more) * whole
        holds = share * cosine + more**2 * whole > 0
        low, high = np.where(holds, middle, low), np.where(holds, high, middle)
    return np.asarray(low)


def _compression(y: float, share: Any) -> Any:
    """The z > 0 of z (1 + s z) = y."""
    return 2 * y / (1 + np.sqrt(1 + 4 * share * y))


def prop(lateral: float, share: float, place: float) -> Prop:
    """A support at the share `place` of a beam's height, 0 < place < 1.

    Notes
    -----
    Source: with f_pp the deflection there by a unit force there and w that by a unit sway of the
    top, the support adds w^2 / (f_pp - w^2 / k) to the stiffness k; Timoshenko's beam, no load.
    """
    softness = unloaded(share) / lateral  # h^3 / EI
    lever = (place**2 / 4 - place**3 / 6 + share * place) * unloaded(share)
    give = softness * (place**3 / 3 - place**4 / 4 + share * place)
    return Prop(lever=lever, stiffness=lever**2 / (give - lever**2 / lateral))
