"""Exact field of the four-sector centripetal disc magnet, and its gradient.

Each sector is uniformly magnetised, so that B = mu_0 (H + M) with H the field of the magnetic
charges on its curved and its radial faces (`smoskin.magnetics.faces`). Decides what is said on
surfaces and edges; hides the folding by symmetry. Magnet frame: origin at the disc's centre, z its
axis, sectors between the azimuths 0, 90, 180 and 270 degrees; lengths inside are in radii.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.design.skin import Magnet
from smoskin.magnetics import faces

VACUUM_PERMEABILITY: Final = 1.25663706127e-6
"""mu_0, T m/A (CODATA 2022)."""

_SWAPPED: Final = [1, 0, 2, 4, 3, 5, 7, 6]
"""Rows of sums with x and y swapped."""
_BLOCK: Final = 512
"""Points at a time, so that working arrays of nodes times points stay in the cache."""


def field(magnet: Magnet, points: ArrayLike) -> Floats:
    """Flux density B of the magnet at points (..., 3), m, from the disc's centre, (..., 3), T.

    Both are in its own frame. Inside the disc the magnetisation is included, on the plane between
    two sectors as their mean. On an outer surface it is the outer limit; on a sharp edge, where B
    has no limit, the value 1e-9 radii off it. NaN where a coordinate is not finite. It raises an
    `ArgumentError` if `points` is not (..., 3).

    Notes
    -----
    Valid for all points, to 1.2e-7 of B; the recoil permeability is taken as one.
    """
    where = floats("points", points, (3,))
    return _density(magnet, where, _sums(magnet, where, rows=3))


def field_and_gradient(magnet: Magnet, points: ArrayLike) -> tuple[Floats, Floats]:
    """Flux density B as `field` gives it, T, and its gradient, T/m, at the same points (..., 3).

    The gradient, (..., 3, 3), has dB_i/dx_j at [..., i, j]; it is symmetric and of zero trace, and
    good to 1e-6 of itself (4e-6 within 1e-6 radii of the rim).
    """
    where = floats("points", points, (3,))
    sums = _sums(magnet, where, rows=8)
    x, y, z = np.sign(where.reshape(-1, 3)).T
    xx, yy, xy, xz, yz = sums[3], sums[4], sums[5] * x * y, sums[6] * x * z, sums[7] * y * z
    slope = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy], axis=-1)
    slope *= _scale(magnet) / magnet.radius
    return _density(magnet, where, sums), slope.reshape(*where.shape, 3)


def _sums(magnet: Magnet, where: Floats, *, rows: int) -> Floats:
    """Sums of `faces.sums`, (rows, P), each point's as if all its coordinates were positive."""
    flat, half = where.reshape(-1, 3), 0.5 * magnet.height / magnet.radius
    finite = np.isfinite(flat).all(axis=1)
    size = np.where(finite, np.abs(flat.T) / magnet.radius, 0.0)
    swapped = size[1] > size[0]
    folded = np.stack([np.maximum(size[0], size[1]), np.minimum(size[0], size[1]), size[2]])
    up = size[2]
    radius = np.hypot(folded[0], folded[1])
    grazing = np.abs(radius - 1.0) < faces.TOUCHING
    folded[:2, grazing] *= (1.0 + faces.TOUCHING) / radius[grazing]
    radius[grazing] = 1.0 + faces.TOUCHING
    slab = up < half
    clear = np.where(slab, 0.0, up - half) ** 2
    nearness = np.sqrt(((radius - 1.0) ** 2 + clear) / ((radius + 1.0) ** 2 + clear))
    kind = faces.kinds(nearness, radius**2 + up**2)
    kind[slab] = ~kind[slab]

    sums = np.empty((rows, len(flat)))
    for signed in np.unique(kind).tolist():
        beside, rule = signed < 0, ~signed if signed < 0 else signed
        (index,) = np.nonzero(kind == signed)
        for start in range(0, len(index), _BLOCK):
            some = index[start : start + _BLOCK]
            sums[:, some] = faces.sums(rule, folded[:, some], nearness[some], half, beside, rows)
    # Inside, B = mu_0 (H + M); M of the folded sector points to the axis along its bisector.
    inside = slab & (radius < 1.0)
    sums[:2, inside] -= 4.0 * np.pi / math.sqrt(2.0)
    sums[:, ~finite] = np.nan
    sums[:, swapped] = sums[_SWAPPED[:rows]][:, swapped]
    return sums


def _density(magnet: Magnet, where: Floats, sums: Floats) -> Floats:
    """B at the points; odd components vanish on their symmetry planes."""
    components = np.ascontiguousarray(sums[:3].T).reshape(where.shape)
    return components * (_scale(magnet) * np.sign(where)) + 0.0  # no negative zeros


def _scale(magnet: Magnet) -> float:
    """Field of a unit sum, T."""
    return VACUUM_PERMEABILITY * magnet.remanence * magnet.polarity / (4.0 * np.pi)
