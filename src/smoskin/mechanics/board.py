"""The board on its pillars: a rigid body that slides, sinks and turns under what pushes the skin.

The design does not place the pillars; they are taken as spread evenly under the sensing area.
"""

from dataclasses import dataclass

import numpy as np

from smoskin.arrays import Floats, freeze
from smoskin.design.materials import ELASTOMERS
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.beam import beam
from smoskin.origami.cell import size


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Board:
    """How stiffly the pillars hold the board."""

    stiffness: Floats
    """(6,): against motion along x, y, z, N/m, and against turns about them, N m/rad."""
    middle: Floats
    """(3,), m: point of the board, on the pillars' tops, to which its motion refers."""

    def __post_init__(self) -> None:
        freeze(self, stiffness=(6,), middle=(3,))


def board_of(design: SkinDesign) -> Board:
    """The board of a design.

    Notes
    -----
    Source: SI Eq. (S26), of pillars that bend as `smoskin.mechanics.beam.beam` says, the SI's in
    pure shear; their squared distances from the middle for the turns. Their own resistance to
    their tops' turning is left out.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> stiffness = board_of(read_design("planar")).stiffness
    >>> (stiffness[:3] / 1e3).round(2).tolist(), stiffness[3:].round(2).tolist()
    ([1.61, 1.61, 8.48], [18.1, 10.18, 5.38])
    """
    layer, cell = design.shear_layer, size(design.cell)
    x, y = np.multiply(design.cells, [float(cell.length), float(cell.width)])
    pillar = beam(layer.radius, layer.height, ELASTOMERS[layer.material].shear_modulus)
    across, along = layer.pillars * pillar.lateral, layer.pillars * pillar.axial
    turns = [along * y**2 / 12, along * x**2 / 12, across * (x**2 + y**2) / 12]
    return Board(
        stiffness=np.array([across, across, along, *turns]),
        middle=np.array([x / 2, y / 2, -design.columns.height - design.board.thickness]),
    )


def carried(board: Board, places: Floats) -> Floats:
    """Motion of places (..., 3), m, with each of the board's small motions, (..., 3, 6)."""
    turns = turned(np.asarray(places) - board.middle)
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=-1)


def turned(arms: Floats) -> Floats:
    """Motion of the ends of arms (..., 3), m, with small turns about x, y and z, (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(arms), -1, 0)
    still = np.zeros_like(x)
    rows = np.array([[still, z, -y], [-z, still, x], [y, -x, still]])
    return np.moveaxis(rows, (0, 1), (-2, -1))
