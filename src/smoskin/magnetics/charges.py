"""The four-sector magnet as point charges: field and gradient at the pace of a live estimator.

Decides how many charges stand for a magnet and where; hides the memory layout that keeps one
call over all chips of a skin to a dozen NumPy operations. `smoskin.magnetics.sector` is exact
and has no limits of nearness; this is its light stand-in below the magnet.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics.sector import VACUUM_PERMEABILITY

_PLANES: Final = (11, 4)
"""Gauss nodes across the diameter and over the height of each of the two radial planes."""
_CURVED: Final = (6, 3)
"""Gauss nodes along the azimuth and over the height of each of the four curved faces."""
_EYE: Final = np.eye(3)


def point_charges(magnets: Sequence[Magnet]) -> tuple[Floats, Floats]:
    """Charges that stand for each magnet, in its own frame.

    Parameters
    ----------
    magnets : sequence of Magnet
        S magnets, usually the one that each chip watches.

    Returns
    -------
    positions : Floats, shape (S, 160, 3)
        m, from the disc's centre.
    charges : Floats, shape (S, 160)
        T m^2: B = q d / |d|^3 at d from the charge.

    Raises
    ------
    ArgumentError
        If there is no magnet.

    Notes
    -----
    Valid for gaps of 0.8 radii and more in front of a disc up to 0.4 radii high: with a radius
    of 5 mm and a height of 2 mm, within 2 mm of the axis, B is off by at most 2.1e-6 of itself
    (0.1 uT) at a gap of 4 mm and 6e-7 (0.02 uT) from 6 mm on; at 3 mm by 7e-6.

    Examples
    --------
    >>> magnet = Magnet(name="m", mount="sheet", corner=(0, 0), radius=5e-3, height=2e-3,
    ...                 remanence=8.04e5)
    >>> positions, charges = point_charges([magnet])
    >>> positions.shape, bool(abs(charges.sum()) < 1e-12)
    ((1, 160, 3), True)
    """
    if not magnets:
        raise ArgumentError("magnets must name at least one magnet; got none")
    places, amounts = zip(*(_charges(magnet) for magnet in magnets), strict=True)
    return np.stack(places), np.stack(amounts)


def _charges(magnet: Magnet) -> tuple[Floats, Floats]:
    """Gauss rule over the charged faces of one magnet, coordinates outermost in memory."""
    half = 0.5 * magnet.height
    across, width = np.polynomial.legendre.leggauss(_PLANES[0])
    levels, thickness = np.polynomial.legendre.leggauss(_PLANES[1])
    line, z = np.meshgrid(magnet.radius * across, half * levels, indexing="ij")
    still = np.zeros_like(line)
    planes = [np.stack([line, still, z]), np.stack([still, line, z])]
    charge = np.sqrt(2.0) * magnet.radius * half * np.multiply.outer(width, thickness)
    amounts = [charge, charge]

    share, width = np.polynomial.legendre.leggauss(_CURVED[0])
    levels, thickness = np.polynomial.legendre.leggauss(_CURVED[1])
    offset = 0.25 * np.pi * share
    density = -np.cos(offset) * 0.25 * np.pi * width
    charge = magnet.radius * half * np.multiply.outer(density, thickness)
    for bisector in 0.25 * np.pi * np.array([1.0, 3.0, 5.0, 7.0]):
        azimuth, z = np.meshgrid(bisector + offset, half * levels, indexing="ij")
        planes.append(np.stack([np.cos(azimuth), np.sin(azimuth), z / magnet.radius]))
        planes[-1] *= magnet.radius
        amounts.append(charge)

    places = np.concatenate([plane.reshape(3, -1) for plane in planes], axis=1)
    scale = VACUUM_PERMEABILITY * magnet.remanence * magnet.polarity / (4.0 * np.pi)
    return places.T, scale * np.concatenate([amount.ravel() for amount in amounts])


def charge_field_and_gradient(
    positions: Floats, charges: Floats, points: Floats
) -> tuple[Floats, Floats]:
    """Flux density and its gradient at S points, each of its own Q charges.

    The arguments are taken as they are, unchecked: this is the innermost call of a live
    estimator.

    Parameters
    ----------
    positions : Floats, shape (S, Q, 3)
        Charges' places as `point_charges` lays them out, m.
    charges : Floats, shape (S, Q)
        T m^2.
    points : Floats, shape (..., S, 3)
        Point s in the frame of magnet s, m.

    Returns
    -------
    density : Floats, shape (..., S, 3)
        B, T.
    gradient : Floats, shape (..., S, 3, 3)
        dB_i/dx_j at [..., i, j], T/m.

    Notes
    -----
    Valid for the gaps named by `point_charges`.
    """
    away = points[..., None, :] - positions
    square = np.einsum("...qi,...qi->...q", away, away)
    weight = charges / (square * np.sqrt(square))
    density = np.matmul(weight[..., None, :], away)[..., 0, :]
    steep = (-3.0 * weight / square)[..., None] * away
    gradient = np.matmul(np.swapaxes(away, -1, -2), steep)
    gradient += weight.sum(axis=-1)[..., None, None] * _EYE
    return density, gradient
