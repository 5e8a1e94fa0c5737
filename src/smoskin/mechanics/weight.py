"""Weights of a skin's parts, and how they move the skin that bears them."""

import math
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.materials import DENSITY
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.board import board_of, carried
from smoskin.mechanics.sheet.lattice import column_beam
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import board_box, circuit_thickness, shell_thickness

GRAVITY: Final = 9.81
"""m/s^2."""
_POINTS: Final = 12
"""Points of the rule that finds the middle of an arc."""


def panel_masses(design: SkinDesign) -> Floats:
    """Masses of the sheet's panels, facet by facet, kg."""
    sheet = geometry(design).sheet
    corners = sheet.vertices[sheet.facets]
    sides = corners[:, [1, 3]] - corners[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.asarray(DENSITY[design.panels.material] * design.panels.thickness * areas)


def magnet_masses(design: SkinDesign) -> list[float]:
    """Masses of the magnets, kg; those on the base weigh on nothing that moves."""
    return [
        DENSITY["magnet"] * math.pi * magnet.radius**2 * magnet.height
        if magnet.mount == "sheet"
        else 0.0
        for magnet in design.magnets
    ]


def board_mass(design: SkinDesign) -> float:
    """Mass of the board with its margins, kg; of a limb's, its film and the printed shell."""
    width, length = board_box(design).size
    circuit = DENSITY["board"] * circuit_thickness(design)
    return width * length * (circuit + DENSITY["print"] * shell_thickness(design))


def board_load(design: SkinDesign) -> Floats:
    """Forces and moments of the board on its pillars, (6, 3), by 1 m/s^2 along x, y and z."""
    skin, board = geometry(design), board_of(design)
    middle = board.middle + np.array([0.0, 0.0, design.board.thickness / 2])
    # On a limb the board's mass lies round it, below its middle.
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    y = skin.extent[1] * (1 + nodes) / 2
    arc = skin.roll.places(np.stack([0 * y, y, 0 * y + middle[2]], axis=-1))
    middle[2] += weights @ (arc[:, 2] - middle[2]) / 2
    return board_mass(design) * carried(board, middle).T


class Sags(NamedTuple):
    """Motions of a skin by its own weight, each by 1 g along x, y and z."""

    sheet: Floats
    """(3,): of the sheet over the board, along the local axes by as much along them, m."""
    board: Floats
    """(6, 3): of the board over the base, m, and its turns, rad."""


def sags(design: SkinDesign) -> Sags:
    """How far and how a skin's own weight moves its sheet and its board.

    Columns bear panels and magnets, each as much of them, the pillars the board besides; rubber's
    own weight and its softening under load are left out.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> sheet, board = sags(read_design("planar"))
    >>> (1e3 * sheet).round(2).tolist(), (1e3 * board[:3].diagonal()).round(2).tolist()
    ([0.13, 0.13, 0.02], [0.7, 0.7, 0.13])
    """
    skin = geometry(design)
    whole, column = skin.sheet, column_beam(design)
    # A magnet hangs by its holder from the columns' tops.
    hung = skin.roll.places(np.pad(skin.magnet_places, ((0, 0), (0, 1))))
    places = np.vstack([whole.vertices[whole.facets].mean(axis=1), hung])
    masses = np.concatenate([panel_masses(design), magnet_masses(design)])
    board = board_of(design)
    loads = np.einsum("p,pab->ba", masses, carried(board, places)) + board_load(design)
    sheet = GRAVITY * masses.sum() / whole.columns.size
    return Sags(
        sheet=sheet / np.array([column.lateral, column.lateral, column.axial]),
        board=board.gives(GRAVITY * loads),
    )
