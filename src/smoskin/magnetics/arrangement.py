"""Field of several magnets, each anywhere and turned anyhow, in one common frame.

Decides how poses are written (a place and a rotation); hides the turning of every point into
every magnet's frame and of its field back, and that magnets of one shape are worked out together.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics import sector


def rotation_matrix(vector: ArrayLike) -> Floats:
    """Matrices R, (..., 3, 3), with v' = R @ v, of rotation vectors (..., 3): axis by angle, rad.

    By Rodrigues' formula; exact for any angle, zero included. NaN where a vector is not finite.

    Examples
    --------
    >>> rotation_matrix([0.0, 0.0, np.pi / 2]).round(12) @ [1.0, 0.0, 0.0]
    array([0., 1., 0.])
    """
    vectors = floats("vector", vector, (3,))
    angle = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None, None]
    cross = np.zeros((*vectors.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[..., k, j] = vectors[..., i]
        cross[..., j, k] = -vectors[..., i]
    whole, half = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi))
    return np.asarray(np.eye(3) + whole * cross + 0.5 * half**2 * (cross @ cross))


def arrangement_field(
    magnets: Sequence[Magnet], places: ArrayLike, rotations: ArrayLike, points: ArrayLike
) -> Floats:
    """Flux density of G magnets together at points (..., S, 3), m: B in the common frame, T.

    Magnets have their middles at `places`, (..., G, 3), m, and are turned by `rotations`, (..., G,
    3, 3), from their frames to the common one. NaN where a pose or point is not finite. It raises
    an `ArgumentError` if there is no magnet or a shape is wrong.

    Notes
    -----
    Valid as `smoskin.magnetics.sector.field`: exact for any number of poses. The magnets do not
    change each other's magnetisation.
    """
    count = len(magnets)
    if not count:
        raise ArgumentError("magnets must name at least one magnet; got none")
    middles = floats("places", places, (count, 3))
    turns = floats("rotations", rotations, (count, 3, 3))
    where = floats("points", points, (None, 3))
    away = where[..., None, :, :] - middles[..., :, None, :]
    batch = np.broadcast_shapes(away.shape[:-3], turns.shape[:-3])
    local = np.broadcast_to(away @ turns, (*batch, *away.shape[-3:]))
    seen = np.empty(local.shape)
    shapes = [(magnet.radius, magnet.height) for magnet in magnets]
    for shape in sorted(set(shapes)):
        alike = [g for g, each in enumerate(shapes) if each == shape]
        unit = replace(magnets[alike[0]], remanence=1.0, polarity=1)
        strength = np.array([magnets[g].remanence * magnets[g].polarity for g in alike])
        seen[..., alike, :, :] = strength[:, None, None] * sector.field(
            unit, local[..., alike, :, :]
        )
    return np.asarray((seen @ np.swapaxes(turns, -1, -2)).sum(axis=-3))
