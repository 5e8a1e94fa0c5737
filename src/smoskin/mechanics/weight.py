"""Weights of a skin's parts, and how they move the skin that bears them."""

from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.board import board_of, carried
from smoskin.mechanics.masses import (
    GRAVITY,
    board_mass,
    column_mass,
    frame_mass,
    magnet_masses,
    panel_masses,
    scale_mass,
)
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.lattice import springs_of
from smoskin.origami.geometry import geometry

_POINTS: Final = 12
"""Points of the rule that finds the middle of an arc."""


def hung_masses(design: SkinDesign) -> Floats:
    """Mass that hangs on each vertex of the sheet, (V,), kg, besides magnets.

    A quarter of each panel, the scales on the top vertices, and half of each column: what a beam
    held at both ends leaves to either.
    """
    sheet = geometry(design).sheet
    quarters = np.repeat(panel_masses(design) / 4, 4)
    masses = np.zeros(len(sheet.vertices))
    np.add.at(masses, sheet.facets.ravel(), quarters)
    masses[sheet.loaded.ravel()] += scale_mass(design)
    masses[sheet.columns.ravel()] += column_mass(design) / 2
    return masses


def hung_loads(design: SkinDesign, holders: Floats) -> Floats:
    """Forces on each vertex of the sheet, (V, 3, 3), by 1 m/s^2 along x, y and z, magnets' too.

    They hang from the vertices by their holders' linear map, (G, 6, V, 3).
    """
    hung = hung_masses(design)[:, None, None] * np.eye(3)
    axes, masses = geometry(design).magnet_axes, magnet_masses(design)
    return np.asarray(hung + np.einsum("g,gid,gdva->vai", masses, axes, holders[:, :3]))


def board_load(design: SkinDesign) -> Floats:
    """Forces and moments of what stands on the pillars, (6, 3), by 1 m/s^2 along x, y and z.

    The board, the lower halves of the columns, and the frame where it stands on the board.
    """
    skin, board = geometry(design), board_of(design)
    middle = board.middle + np.array([0.0, 0.0, design.board.thickness / 2])
    # On a limb the board's mass lies round it, below its middle.
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    y = skin.extent[1] * (1 + nodes) / 2
    x = skin.extent[0] / 2
    arc = skin.roll.places(np.stack([0 * y + x, y, 0 * y + middle[2]], axis=-1))
    middle[2] += weights @ (arc[:, 2] - middle[2]) / 2
    load = board_mass(design) * carried(board, middle).T
    flat = skin.developed[skin.sheet.columns.ravel(), :2]
    feet = skin.roll.places(np.pad(flat, ((0, 0), (0, 1)), constant_values=-design.columns.height))
    load += column_mass(design) / 2 * carried(board, feet).sum(axis=0).T
    if design.frame.stands_on == "board":
        middle[2] += (design.board.thickness + design.frame.held_height) / 2
        load += frame_mass(design) * carried(board, middle).T
    return np.asarray(load)


class Sags(NamedTuple):
    """Motions of a skin by its own weight, each by 1 g along x, y and z."""

    magnets: Floats
    """(G, 6, 3): of the magnets over the board along their own axes, m, and their turns, rad; 0 of
    those on the base."""
    board: Floats
    """(6, 3): of the board over the base, m, and its turns, rad."""


def sags(design: SkinDesign) -> Sags:
    """How far and how a skin's own weight moves its sheet and its board.

    Columns bear panels, scales, magnets and their own upper halves, the pillars the rest besides;
    what softens under that weight is left out. On a limb columns lean each its own way, and the
    sheet bends between them: pulled along its girth it sways round the limb.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> magnets, board = sags(read_design("planar"))
    >>> [(1e3 * motion[:3].diagonal()).round(2).tolist() for motion in (magnets[1], board)]
    [[0.29, 0.28, 0.04], [1.27, 1.27, 0.24]]
    """
    # Here, so that whoever only imports the package does not wait for SciPy.
    from scipy.sparse.linalg import splu

    from smoskin.mechanics.sheet.foldability import sheet_stiffness

    skin, board = geometry(design), board_of(design)
    sheet, holders = skin.sheet, holder_matrix(design).reshape(len(design.magnets), 6, -1, 3)
    stiffness = sheet_stiffness(sheet, skin.axes[sheet.columns][..., 2], springs_of(design))
    weights = GRAVITY * hung_loads(design, holders)
    moved = splu(stiffness.tocsc()).solve(weights.reshape(-1, 3)).reshape(weights.shape)
    taken = np.einsum("vdb,vda->ba", carried(board, sheet.vertices), weights)
    return Sags(
        magnets=np.einsum("gpva,vad->gpd", holders, moved),
        board=board.gives(taken + GRAVITY * board_load(design)),
    )
