"""Masses of a skin's parts."""

import math
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.materials import DENSITY
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import (
    FRAME_WALL,
    SCALE_BOSS,
    SCALE_GAP,
    SCALE_PAD,
    SCALE_RISE,
    arcs_at,
    board_box,
    circuit_thickness,
    frame_box,
    frame_level,
    shell_thickness,
)

GRAVITY: Final = 9.81
"""m/s^2."""


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


def column_mass(design: SkinDesign) -> float:
    """Mass of a column, kg."""
    columns = design.columns
    return DENSITY["rubber"] * math.pi * columns.radius**2 * columns.height


def scale_mass(design: SkinDesign) -> float:
    """Mass of the elastomer scale on a cell, with its patch, kg."""
    cell = geometry(design).cell
    pad = (float(cell.length) - SCALE_GAP) * (float(cell.width) - SCALE_GAP) * SCALE_PAD
    return DENSITY["rubber"] * (pad + math.pi * SCALE_BOSS**2 * SCALE_RISE)


def frame_mass(design: SkinDesign) -> float:
    """Mass of the frame, kg: its wall, and the teeth that stop a rim's columns that stand back."""
    skin, level, reach = geometry(design), frame_level(design), design.columns.radius
    width, length = frame_box(design, level).size
    area = 2 * FRAME_WALL * (width + length - 2 * FRAME_WALL)
    grid = skin.developed[skin.sheet.columns, :2]
    grid[..., 1] = arcs_at(design, grid[..., 1], 0.0, level)
    half = float(grid[1, 0, 0] - grid[0, 0, 0]) - reach - 2 * design.frame.clearance
    inner = width / 2 - FRAME_WALL
    for row, outward in ((grid[:, 0], -1.0), (grid[:, -1], 1.0)):
        back = (outward * row[:, 1]).max() - outward * row[:, 1]
        away = np.abs(row[:, 0] - row[:, 0].mean())
        area += float((back * np.minimum(2 * half, half + inner - away)).sum())
    return DENSITY["print"] * area * design.frame.held_height


def mass_on_pillars(design: SkinDesign) -> float:
    """Mass of all that the pillars bear, kg: the board and what stands on it."""
    n, m = design.cells
    mass = board_mass(design) + float(panel_masses(design).sum()) + sum(magnet_masses(design))
    mass += n * m * scale_mass(design) + (2 * n + 1) * (m + 1) * column_mass(design)
    return mass + frame_mass(design) * (design.frame.stands_on == "board")
