"""Point dipoles: what stands for magnets far away, for iron, and for small parts of a magnet."""

import math

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import Magnet

_RADII, _ANGLES, _LEVELS = 3, 4, 2
"""Dipoles along each axis of a sector; 5 mm off one of 5 mm radius they are good to 3 %."""


def dipole_field(moments: Floats, away: Floats) -> Floats:
    """Flux density B, (..., 3), T, of dipoles (..., 3), A m^2, at points `away` from them, m.

    Equation: ``B = mu_0 / (4 pi r^5) (3 (m . r) r - r^2 m)``.
    """
    square = np.einsum("...i,...i->...", away, away)[..., None]
    along = np.einsum("...i,...i->...", moments, away)[..., None]
    return np.asarray(1e-7 * (3 * along * away - square * moments) / square**2.5)


def sector_dipoles(magnet: Magnet, strengths: Floats) -> tuple[Floats, Floats]:
    """Dipoles for what four sectors are stronger than designed, in the magnet's frame.

    `strengths`, (4,), are shares of the remanence, counter-clockwise from the sector between x and
    y. Returns places, (D, 3), m, from the disc's middle, and moments, (D, 3), A m^2.
    """
    radius, angle, level, sector = np.meshgrid(
        magnet.radius * np.sqrt((np.arange(_RADII) + 0.5) / _RADII),
        0.5 * math.pi * (np.arange(_ANGLES) + 0.5) / _ANGLES,
        magnet.height * ((np.arange(_LEVELS) + 0.5) / _LEVELS - 0.5),
        np.arange(4),
        indexing="ij",
    )
    turn = angle + 0.5 * math.pi * sector
    places = np.stack([radius * np.cos(turn), radius * np.sin(turn), level], axis=-1)
    bisector = 0.5 * math.pi * (sector + 0.5)
    inward = -np.stack([np.cos(bisector), np.sin(bisector), np.zeros_like(bisector)], axis=-1)
    part = math.pi * magnet.radius**2 * magnet.height / sector.size
    amount = magnet.polarity * magnet.remanence * part * np.asarray(strengths)[sector]
    return places.reshape(-1, 3), (amount[..., None] * inward).reshape(-1, 3)
