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
from smoskin.magnetics import faces
from smoskin.magnetics.sector import VACUUM_PERMEABILITY

_PLANES: Final = (11, 4)
"""Gauss nodes across the diameter and over the height of each of the two radial planes."""
_CURVED: Final = (6, 3)
"""Gauss nodes along the azimuth and over the height of each of the four curved faces."""
_EYE: Final = np.eye(3)


def point_charges(magnets: Sequence[Magnet]) -> tuple[Floats, Floats]:
    """Charges that stand for each of S magnets, in its own frame.

    Places (S, 160, 3), m, from the disc's centre, and charges (S, 160), T m^2: B = q d / |d|^3 at d
    from the charge. It raises an `ArgumentError` if there is no magnet.

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
    half = 0.5 * magnet.height / magnet.radius
    places, amounts = [], []
    for (lines, charge), count in (
        (faces.plane_lines(_PLANES[0]), _PLANES[1]),
        (faces.curved_lines(_CURVED[0]), _CURVED[1]),
    ):
        levels, thickness = faces.gauss(count)
        x, y = np.repeat(lines.T, count, axis=1)
        places.append(np.stack([x, y, np.tile(half * levels, len(lines))]))
        amounts.append(np.outer(charge, half * thickness).ravel())
    scale = VACUUM_PERMEABILITY * magnet.remanence * magnet.polarity / (4.0 * np.pi)
    place = magnet.radius * np.concatenate(places, axis=1)
    return place.T, scale * magnet.radius**2 * np.concatenate(amounts)


def charge_field_and_gradient(
    positions: Floats, charges: Floats, points: Floats
) -> tuple[Floats, Floats]:
    """Flux density (..., S, 3), T, and gradient (..., S, 3, 3), T/m, at S points of Q charges each.

    Places (S, Q, 3), m, and charges (S, Q), T m^2, are as `point_charges` lays them out; point s of
    (..., S, 3), m, is in the frame of magnet s; dB_i/dx_j stands at [..., i, j]. Arguments are not
    checked: this is the innermost call of a live estimator.
    """
    away, square, weight, density = _summed(positions, charges, points)
    steep = (-3.0 * weight / square)[..., None] * away
    gradient = np.matmul(np.swapaxes(away, -1, -2), steep)
    gradient += weight.sum(axis=-1)[..., None, None] * _EYE
    return density, gradient


def charge_field(positions: Floats, charges: Floats, points: Floats) -> Floats:
    """Flux density alone of what `charge_field_and_gradient` takes, (..., S, 3), T."""
    return _summed(positions, charges, points)[-1]


def _summed(
    positions: Floats, charges: Floats, points: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Ways d from charges, their squared lengths, q / |d|^3, and the flux densities."""
    away = points[..., None, :] - positions
    square = np.einsum("...qi,...qi->...q", away, away)
    weight = charges / (square * np.sqrt(square))
    return away, square, weight, np.matmul(weight[..., None, :], away)[..., 0, :]
