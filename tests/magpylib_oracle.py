"""The four-sector magnet built, placed and turned by magpylib: an independent oracle."""

import magpylib
import numpy as np
from scipy.spatial.transform import Rotation

from smoskin.design.skin import Magnet
from smoskin.magnetics.sector import VACUUM_PERMEABILITY


def magpylib_disc(magnet: Magnet, place, turn) -> magpylib.Collection:
    """The magnet of four cylinder segments, placed and turned by magpylib."""
    strength = magnet.polarity * magnet.remanence * VACUUM_PERMEABILITY
    parts = []
    for quarter in range(4):
        bisector = np.deg2rad(45.0 + 90.0 * quarter)
        parts.append(
            magpylib.magnet.CylinderSegment(
                dimension=(0.0, magnet.radius, magnet.height, 90 * quarter, 90 * quarter + 90),
                polarization=-strength * np.array([np.cos(bisector), np.sin(bisector), 0.0]),
            )
        )
    disc = magpylib.Collection(*parts)
    disc.rotate(Rotation.from_rotvec(np.array(turn)), anchor=(0, 0, 0))
    disc.move(place)
    return disc
