"""How the sheet yields to touches, to first and second order in their loads.

A touch that sticks holds its patch over the ground, so that what another one does to that patch
comes back as a sideways force; how large it is follows from one matrix. What two loads move beyond
the sum of what each moves, columns under load holding less, is the second order.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.board import Board, board_of
from smoskin.mechanics.sheet.continuation import settle
from smoskin.mechanics.sheet.lattice import Lattice, build_lattice
from smoskin.mechanics.sheet.parts import Blocks
from smoskin.mechanics.sheet.tangent import Tangent

_STEP: Final = 1e-3
"""N: step of the differences of the stiffness."""


def grip_compliance(
    design: SkinDesign, lattice: Lattice | None = None, board: Board | None = None
) -> Floats:
    """Motion of every vertex that can be touched, by a force on every other, (H, 2, H, 3), m/N.

    Motion is over the ground along the local x and y, by a force along them and down; lattice and
    board, with stiffnesses of their own, are by default as designed.

    Notes
    -----
    With K the stiffness at rest, P the choice of the vertices' motions in the plane, S their motion
    with the board and B the board's stiffness: P K^-1 + P S B^-1 S'. Valid for small loads:
    under a newton the forces that follow from it are off by some 2 %.
    """
    made = lattice or build_lattice(design)
    board = board or board_of(design)
    tangent = Tangent(made, board)
    rest = settle(tangent)
    top = made.loaded.ravel()
    place = tangent.at(rest.motion, rest.board, rest.force)
    moved = made.at_tops(tangent.solve(place, _unit_loads(made)))[:, :2]
    arms = np.swapaxes(made.loaded_axes, 1, 2) @ board.carries(made.nodes[top])
    moved += np.einsum("hds,kes->hdke", arms[:, :2] / board.stiffness, arms * [[1], [1], [-1]])
    return np.asarray(moved)


def load_coupling(design: SkinDesign, readings: Floats) -> Floats:
    """What two forces on vertices make C readings beyond their sum, (H, 3, H, 3, C), 1/N^2.

    Forces are along x, along y and down; `readings`, (C, V, 3), are slopes by the motion of every
    vertex over the board, 1/m.

    Notes
    -----
    With f(u) the forces of the parts, u_i the motion by a unit force and K l = readings:
    ``Q_ij = -l . d2f[u_i, u_j]``. The skin is as designed; nothing is held. For small loads: under
    a newton some tenths of it are missing.
    """
    made = build_lattice(design)
    tangent = Tangent(made, board_of(design))
    rest = settle(tangent)
    place = tangent.at(rest.motion, rest.board, rest.force)
    shape, count = (len(made.nodes), 3), made.loaded.size
    unit = tangent.solve(place, _unit_loads(made)).reshape(*shape, 3 * count)
    lever = tangent.solve(place, np.moveaxis(readings, 0, -1))
    bent = []
    for motion in np.moveaxis(unit, -1, 0):
        ends = [
            tangent.blocks(rest.motion + sign * _STEP * motion, rest.board, fold=1.0)
            for sign in (1.0, -1.0)
        ]
        bent.append((_pushed(made, ends[0], lever) - _pushed(made, ends[1], lever)) / (2 * _STEP))
    flat = unit.reshape(-1, 3 * count)
    products = np.tensordot(np.stack(bent).reshape(3 * count, -1, len(readings)), flat, (1, 0))
    return -np.moveaxis(products, 1, 2).reshape(count, 3, count, 3, len(readings))


def _pushed(lattice: Lattice, blocks: Blocks, motion: Floats) -> Floats:
    """Forces of bars, hinges and columns by small motions (V, 3, C), (V, 3, C)."""
    out = np.zeros_like(motion)
    nodes = lattice.bars, lattice.hinges, lattice.feet[:, None]
    for stiffness, ends in zip((blocks.bars, blocks.hinges, blocks.columns), nodes, strict=True):
        moved = motion[ends].reshape(len(ends), -1, motion.shape[-1])
        np.add.at(out, ends, (stiffness @ moved).reshape(*ends.shape, 3, -1))
    return out


def _unit_loads(lattice: Lattice) -> Floats:
    """Forces of 1 N along x, along y and down on each vertex that can be touched, (V, 3, H, 3)."""
    top = lattice.loaded.ravel()
    loads = np.zeros((len(lattice.nodes), 3, len(top), 3))
    for axis, sign in enumerate((1.0, 1.0, -1.0)):
        loads[top, :, np.arange(len(top)), axis] = sign * lattice.loaded_axes[..., axis]
    return loads
