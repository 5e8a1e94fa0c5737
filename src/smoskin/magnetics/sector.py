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

from smoskin.arrays import Bools, Floats, floats
from smoskin.design.skin import Magnet
from smoskin.magnetics import faces

VACUUM_PERMEABILITY: Final = 1.25663706127e-6
"""mu_0, T m/A (CODATA 2022)."""

_BLOCK: Final = 512
"""Points at a time, so that working arrays of nodes times points stay in the cache."""


def field(magnet: Magnet, points: ArrayLike) -> Floats:
    """Flux density of the magnet, B, in its own frame.

    Parameters
    ----------
    magnet : Magnet
        The disc; its mount and corner play no part here.
    points : array_like, shape (..., 3)
        Points, m, from the disc's centre.

    Returns
    -------
    Floats, shape (..., 3)
        T. Inside the disc the magnetisation is included, on the plane between two sectors as
        their mean. On an outer surface the outer limit; on a sharp edge, where B has no limit,
        the value 1e-9 radii off it. NaN where a coordinate is not finite.

    Raises
    ------
    ArgumentError
        If `points` is not (..., 3).

    Notes
    -----
    Valid for all points, to 1.2e-7 of B; the recoil permeability is taken as one.
    """
    where = floats("points", points, (3,))
    sums, swapped = _potentials(magnet, where.reshape(-1, 3), rows=3)
    density = _density(magnet, sums, swapped, where.reshape(-1, 3))
    return density.reshape(where.shape)


def field_and_gradient(magnet: Magnet, points: ArrayLike) -> tuple[Floats, Floats]:
    """Flux density and its gradient, in the magnet's own frame.

    Parameters
    ----------
    magnet : Magnet
        The disc.
    points : array_like, shape (..., 3)
        Where, m, from the disc's centre.

    Returns
    -------
    density : Floats, shape (..., 3)
        B, T, as `field` gives it.
    gradient : Floats, shape (..., 3, 3)
        dB_i/dx_j at [..., i, j], T/m; symmetric and of zero trace.

    Raises
    ------
    ArgumentError
        If `points` is not (..., 3).

    Notes
    -----
    Valid as `field`, the gradient to 1e-6 of itself (4e-6 within 1e-6 radii of the rim).
    """
    where = floats("points", points, (3,))
    flat = where.reshape(-1, 3)
    sums, swapped = _potentials(magnet, flat, rows=8)
    density = _density(magnet, sums, swapped, flat)
    slope = _slope(magnet, sums, swapped, flat)
    return density.reshape(where.shape), slope.reshape(*where.shape, 3)


def _potentials(magnet: Magnet, flat: Floats, *, rows: int) -> tuple[Floats, Bools]:
    """Unit-charge sums at the points folded into 0 <= y <= x, 0 <= z.

    Rows are E_x, E_y, E_z and, where 8 are asked for, E_xx, E_yy, E_xy, E_xz, E_yz. The second
    result says where x and y were swapped.
    """
    half = 0.5 * magnet.height / magnet.radius
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
    return sums, swapped


def _density(magnet: Magnet, sums: Floats, swapped: Bools, flat: Floats) -> Floats:
    """B (P, 3) from the folded sums; odd components vanish on their symmetry planes."""
    scale = VACUUM_PERMEABILITY * magnet.remanence * magnet.polarity / (4.0 * np.pi)
    density = np.empty_like(flat)
    density[:, 0] = np.where(swapped, sums[1], sums[0])
    density[:, 1] = np.where(swapped, sums[0], sums[1])
    density[:, 2] = sums[2]
    density *= scale * np.sign(flat)
    density += 0.0  # no negative zeros
    return density


def _slope(magnet: Magnet, sums: Floats, swapped: Bools, flat: Floats) -> Floats:
    """Gradient (P, 3, 3) from the folded sums."""
    scale = VACUUM_PERMEABILITY * magnet.remanence * magnet.polarity / (4.0 * np.pi)
    sign = np.sign(flat).T
    slope = np.empty((len(flat), 3, 3))
    slope[:, 0, 0] = np.where(swapped, sums[4], sums[3])
    slope[:, 1, 1] = np.where(swapped, sums[3], sums[4])
    slope[:, 2, 2] = -sums[3] - sums[4]
    slope[:, 0, 1] = slope[:, 1, 0] = sums[5] * sign[0] * sign[1]
    slope[:, 0, 2] = slope[:, 2, 0] = np.where(swapped, sums[7], sums[6]) * sign[0] * sign[2]
    slope[:, 1, 2] = slope[:, 2, 1] = np.where(swapped, sums[6], sums[7]) * sign[1] * sign[2]
    slope *= scale / magnet.radius
    return slope
