"""Compliance of the sheet in the plane where touches grip it, for small loads.

A touch that sticks holds its patch over the ground, so that what another one does to that patch
comes back as a sideways force; how large it is follows from this one matrix.
"""

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.reduced.stiffness import board_stiffness, yaw_stiffness
from smoskin.mechanics.sheet.lattice import Lattice, build_lattice
from smoskin.mechanics.sheet.tangent import Tangent
from smoskin.origami.geometry import geometry


def grip_compliance(design: SkinDesign, lattice: Lattice | None = None) -> Floats:
    """Motion of every vertex that can be touched, by a force on every other, (H, 2, H, 3), m/N.

    Motion is over the ground along x and y, by a force along x, along y and down; the lattice, with
    springs of its own, is `build_lattice(design)` by default.

    Notes
    -----
    With K the stiffness at rest, P the choice of the vertices' motions in the plane, and t the
    turned arms from the board's middle: P K^-1 + 1 / K_sf + t t' / K_yaw. Valid for small loads:
    under a newton the forces that follow from it are off by some 2 %.
    """
    made = lattice or build_lattice(design)
    tangent = Tangent(made)
    top = made.loaded.ravel()
    count = len(top)
    right = np.zeros((len(made.nodes), 3, count, 3))
    for axis, sign in enumerate((1.0, 1.0, -1.0)):  # along x, along y, and pressing
        right[top, axis, np.arange(count), axis] = sign
    moved = tangent.solve(tangent.at(np.zeros_like(made.nodes)), right)[top, :2]
    arms = geometry(design).tops.reshape(-1, 2) - geometry(design).extent / 2
    turned = np.stack([-arms[:, 1], arms[:, 0]], axis=-1)
    moved[..., :2] += np.eye(2)[None, :, None] / board_stiffness(design)
    moved[..., :2] += turned[:, :, None, None] * turned / yaw_stiffness(design)
    return np.asarray(moved)
