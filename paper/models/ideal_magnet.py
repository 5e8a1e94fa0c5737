"""Field of the ideal centripetal plate, whose inverse `smoskin.magnetics.centripetal` solves."""

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats


def ideal_field(points: ArrayLike, amplitude: float, wave_number: float) -> Floats:
    """Flux density of a plate magnetised m = m_0 (sin kx, sin ky, 0), below its lower face.

    Parameters
    ----------
    points : array_like, shape (..., 3)
        Points, m; z = 0 is the plate's lower face.
    amplitude, wave_number : float
        K, T; k, 1/m.

    Returns
    -------
    Floats, shape (..., 3)
        K exp(kz) (-sin kx, -sin ky, cos kx + cos ky), T.

    Raises
    ------
    ArgumentError
        If `points` is not (..., 3).

    Notes
    -----
    Source: SI Eqs. (S3), (S4). Valid for z <= 0. With K > 0 the magnetisation printed in S3
    points away from the axis; towards it, K < 0.
    """
    x, y, z = np.moveaxis(wave_number * floats("points", points, (3,)), -1, 0)
    waves = np.stack([-np.sin(x), -np.sin(y), np.cos(x) + np.cos(y)], axis=-1)
    return np.asarray(amplitude * np.exp(z)[..., None] * waves)
