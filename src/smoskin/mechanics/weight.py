"""Weights of a skin's parts, and how far they move the skin that bears them."""

import math
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness
from smoskin.origami.geometry import geometry

GRAVITY: Final = 9.81
"""m/s^2."""
_ACRYLIC, _MAGNET, _BOARD = 1190.0, 5500.0, 1850.0
"""Densities, kg/m^3: panels, bonded magnets, the board."""


def panel_masses(design: SkinDesign) -> Floats:
    """Masses of the sheet's panels, facet by facet, kg."""
    sheet = geometry(design).sheet
    corners = sheet.vertices[sheet.facets]
    sides = corners[:, [1, 3]] - corners[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.asarray(_ACRYLIC * design.panels.thickness * areas)


def magnet_masses(design: SkinDesign) -> list[float]:
    """Masses of the magnets, kg; those on the base weigh on nothing that moves."""
    return [
        _MAGNET * math.pi * magnet.radius**2 * magnet.height if magnet.mount == "sheet" else 0.0
        for magnet in design.magnets
    ]


def board_mass(design: SkinDesign) -> float:
    """Mass of the board, kg."""
    return _BOARD * design.board.thickness * float(np.prod(geometry(design).extent))


class Slides(NamedTuple):
    """Motions by a skin's own weight as it hangs upright, m."""

    sheet: float
    """Motion of the sheet over the board."""
    board: float
    """Motion of the board over the base."""


def slides(design: SkinDesign) -> Slides:
    """How far their weight moves sheet and board of a skin that hangs upright.

    Columns bear panels and magnets, the shear layer the board besides; rubber's own weight is left
    out.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> [round(1e3 * slide, 2) for slide in slides(read_design("planar"))]
    [0.05, 0.57]
    """
    sheet = GRAVITY * (float(panel_masses(design).sum()) + sum(magnet_masses(design)))
    board = sheet + GRAVITY * board_mass(design)
    return Slides(sheet / sheet_stiffness(design), board / board_stiffness(design))
