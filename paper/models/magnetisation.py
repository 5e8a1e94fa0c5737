"""How much of its magnetisation a magnet keeps: loop, working point, loss past the knee.

Decides the form of the major loop (Figure S10): what has not switched back, a hyperbolic tangent
about a field a little past the coercivity, plus a recoil line of constant slope. The two printed
points fix it exactly once slope and width are given. A magnet works where this loop meets the
field of its own poles; it loses for good what switches when heat or an opposing field drives it
further down. Fields are opposing where they are negative; everything is along the magnetisation.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, assign, floats
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics import sector
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE

OERSTED: Final = 1e3 / (4 * math.pi)
"""A/m."""
_KNEE: Final = 0.9
"""Part of the remanence that is left there: the usual mark of the knee, H_k."""
_NODES: Final = (12, 12, 6)
"""Gauss nodes along a sector's radius, azimuth and half height."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MagnetisationLoop:
    """Major loop of a magnet's material at 25 degC.

    Raises
    ------
    ArgumentError
        If a number is out of bounds, or no such loop runs through both points.

    Notes
    -----
    Source: SI Text S6, Figure S10: through M_r at H = 0 and through zero at H = -H_ci. Valid for
    the major loop, of which only these two points are printed.

    Examples
    --------
    >>> loop = MagnetisationLoop()
    >>> float(loop.descending(0.0)).__round__(), abs(float(loop.descending(-loop.coercivity))) < 1
    (804000, True)
    """

    remanence: float = 0.804e6
    """A/m, M_r: magnetisation without field (SI Text S6: 0.804 emu/mm3)."""
    coercivity: float = 5227.78 * OERSTED
    """A/m, H_ci: opposing field that takes the magnetisation to zero (SI Text S6: 5227.78 Oe)."""
    recoil: float = 0.2
    """Slope of the recoil line, dM/dH: makers state a recoil permeability of 1.2 for bonded
    NdFeB."""
    width: float = 0.4
    """Width of the switching, over the coercivity. Assumed: it puts the knee at about 0.4 of the
    coercivity, as is usual for bonded, isotropic material; the SI prints no third point."""
    remanence_coefficient: float = -0.0011
    """1/degC, of the material's remanence: makers state -0.11 % for bonded NdFeB. A whole magnet
    weakens by more (`smoskin.magnetics.temperature.TEMPERATURE_COEFFICIENT`), as its own poles
    drive
    it down a loop that shrinks."""
    coercivity_coefficient: float = -0.005
    """1/degC, of the coercivity: the middle of the -0.4 to -0.6 % that makers state for NdFeB."""
    plateau: float = field(init=False)
    """A/m: what switches, at most; the recoil line comes on top of it."""
    centre: float = field(init=False)
    """A/m: opposing field at which half has switched."""

    def __post_init__(self) -> None:
        for name in ("remanence", "coercivity", "width"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} must be positive and finite; got {value}")
        if not 0 <= self.recoil < self.remanence / self.coercivity:
            raise ArgumentError(
                f"recoil must lie in 0..{self.remanence / self.coercivity:.3g}, M_r/H_ci, for the "
                f"loop to have a knee; got {self.recoil}"
            )
        # M(0) = M_r and M(-H_ci) = 0: with T = tanh(1/width), q = recoil H_ci / M_r and
        # u = tanh of how far the centre lies past H_ci, plateau u = recoil H_ci and, by the
        # addition theorem, u (1 + T u) = q (T + u).
        top, part = math.tanh(1 / self.width), self.recoil * self.coercivity / self.remanence
        half = (1 - part) / 2
        shift = (math.sqrt(half**2 + top**2 * part) - half) / top
        beyond = math.atanh(shift) * self.width
        plateau = self.remanence / math.tanh((1 + beyond) / self.width)
        assign(self, centre=self.coercivity * (1 + beyond), plateau=plateau)

    def descending(self, field: ArrayLike) -> Floats:
        """Magnetisation on the way down from saturation, A/m.

        Parameters
        ----------
        field : array_like, any shape
            H inside the material, A/m.
        """
        inside = floats("field", field)
        return np.asarray(self.plateau * self.kept(inside) + self.recoil * inside)

    def ascending(self, field: ArrayLike) -> Floats:
        """Magnetisation on the way up from the opposite saturation, A/m."""
        return np.asarray(-self.descending(-floats("field", field)))

    def kept(self, field: ArrayLike) -> Floats:
        """What has not switched, over the plateau, on the way down; -1 once all has."""
        inside = floats("field", field)
        return np.asarray(np.tanh((inside + self.centre) / (self.width * self.coercivity)))

    @property
    def knee(self) -> float:
        """H_k: opposing field, A/m, that takes the magnetisation to nine tenths of M_r."""
        from scipy.optimize import brentq

        def above(opposing: float) -> float:
            return float(self.descending(-opposing)) - _KNEE * self.remanence

        return float(brentq(above, 0.0, self.coercivity, xtol=1e-6))

    def at(self, temperature: float) -> "MagnetisationLoop":
        """The loop of the same material at another temperature, degC.

        Raises
        ------
        ArgumentError
            If it is so hot that no remanence or coercivity is left, or no number.
        """
        warmer = temperature - REFERENCE_TEMPERATURE
        remanence = 1 + self.remanence_coefficient * warmer
        coercivity = 1 + self.coercivity_coefficient * warmer
        if not (0 < remanence < math.inf and 0 < coercivity < math.inf):
            raise ArgumentError(
                "temperature must leave the magnet a remanence and a coercivity; "
                f"got {temperature} degC"
            )
        return replace(
            self,
            remanence=self.remanence * remanence,
            coercivity=self.coercivity * coercivity,
        )


class WorkingPoint(NamedTuple):
    """Working point of a magnet."""

    field: float
    """A/m, H inside it; negative opposes."""
    magnetisation: float
    """A/m."""


def disc_factor(radius: float, height: float) -> float:
    """Demagnetising factor of a disc magnetised evenly along a diameter, mean over its volume.

    Parameters
    ----------
    radius, height : float
        m.

    Returns
    -------
    float
        N with H = -N M; 0 for a film, 1/2 for a long rod across.

    Notes
    -----
    R. I. Joseph, J. Appl. Phys. 37, 4639 (1966), for the axis; the two factors across share what
    it leaves of 1.

    Examples
    --------
    >>> round(disc_factor(1.0, 2.0), 4)
    0.3442
    """
    from scipy.special import ellipe, ellipk

    if not (0 < radius < math.inf and 0 < height < math.inf):
        raise ArgumentError(f"radius and height must be positive; got {radius} and {height} m")
    slender = height / (2 * radius)
    diagonal = 1 + slender**2
    mixed = slender**2 * ellipk(1 / diagonal) + (1 - slender**2) * ellipe(1 / diagonal)
    along = 1 - 4 / (3 * math.pi * slender) * (math.sqrt(diagonal) * mixed - 1)
    return float((1 - along) / 2)


def sector_factor(magnet: Magnet) -> float:
    """Demagnetising factor of the four-sector magnet, mean over its volume.

    Parameters
    ----------
    magnet : Magnet
        Its radius and height matter.

    Returns
    -------
    float
        N with H = -N M along each sector's magnetisation. The sectors face each other with like
        poles, so it is about three times that of a disc magnetised evenly.

    Examples
    --------
    >>> magnet = Magnet(name="m", mount="sheet", corner=(0, 0), radius=5e-3, height=2e-3,
    ...                 remanence=8.04e5)
    >>> round(sector_factor(magnet), 2)
    0.48
    """
    rules = [np.polynomial.legendre.leggauss(count) for count in _NODES]
    (r, in_r), (share, in_share), (z, in_z) = [((1 + x) / 2, w / 2) for x, w in rules]
    # Squared towards radius, rim and faces, where the field of the charged edges is steep.
    weights = np.einsum("i,j,k->ijk", in_r * r, in_share, in_z)
    azimuth = math.pi / 4 * share
    places = np.empty((*weights.shape, 3))
    places[..., 0] = magnet.radius * r[:, None, None] * np.cos(azimuth)[:, None]
    places[..., 1] = magnet.radius * r[:, None, None] * np.sin(azimuth)[:, None]
    places[..., 2] = magnet.height / 2 * z
    unit = replace(magnet, remanence=1.0 / sector.VACUUM_PERMEABILITY, polarity=1)
    inward = -np.sqrt(0.5) * sector.field(unit, places)[..., :2].sum(axis=-1)
    return float(1 - np.sum(weights * inward) / weights.sum())


def working_point(
    loop: MagnetisationLoop,
    factor: float,
    *,
    applied: float = 0.0,
    temperature: float = REFERENCE_TEMPERATURE,
) -> WorkingPoint:
    """Find where the descending loop meets the field of the magnet's own poles.

    Parameters
    ----------
    loop : MagnetisationLoop
        Of the material at 25 degC.
    factor : float
        Demagnetising factor, `disc_factor` or `sector_factor`.
    applied : float
        A/m: field from elsewhere along the magnetisation; negative opposes.
    temperature : float
        degC.

    Returns
    -------
    WorkingPoint
        H = applied - factor M, on the loop of this temperature.

    Raises
    ------
    ArgumentError
        If the factor is not in 0..1 or the temperature leaves nothing of the magnet.

    Notes
    -----
    Valid as a mean: the field of its poles varies within a magnet, so that its edges switch
    before its middle does.
    """
    from scipy.optimize import brentq

    if not 0 <= factor <= 1:
        raise ArgumentError(f"factor must lie in 0..1; got {factor}")
    if not math.isfinite(applied):
        raise ArgumentError(f"applied must be finite; got {applied}")
    warm = loop.at(temperature)

    def excess(inside: float) -> float:
        return inside - applied + factor * float(warm.descending(inside))

    # The excess rises with H; beyond this on either side nothing is left that could switch.
    reach = abs(applied) + warm.plateau
    inside = float(brentq(excess, -reach, reach, xtol=1e-6))
    return WorkingPoint(inside, float(warm.descending(inside)))


def irreversible_loss(
    loop: MagnetisationLoop,
    factor: float,
    *,
    applied: float = 0.0,
    temperature: float = REFERENCE_TEMPERATURE,
) -> float:
    """Part of its magnetisation that a magnet has lost once it is back in peace at 25 degC.

    Parameters
    ----------
    loop, factor, applied, temperature
        As for `working_point`: the worst that the magnet has been through.

    Returns
    -------
    float
        0 where the magnet was not driven past where it works in peace; above 1 where it comes
        back reversed.

    Notes
    -----
    Source: SI Text S6, Figure S10, and Text S11. Back along the recoil line magnet and
    poles weaken alike, so that the loss is that of what has not switched.

    A four-sector disc of 5 mm radius and 2 mm height already works past the knee. Heated for the
    first time to 75 degC it weakens by 3.4 % per 10 degC, nearly evenly, and does not get two
    thirds of that back; a disc magnetised evenly would weaken by 1.5 %. So the printed 5 % per
    10 degC may in part be loss for good, which ageing the magnets once would take away.
    """
    before = loop.kept(working_point(loop, factor).field)
    worst = working_point(loop, factor, applied=applied, temperature=temperature).field
    return max(0.0, float(1 - loop.at(temperature).kept(worst) / before))
