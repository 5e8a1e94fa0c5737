"""What a drag on a top vertex moves: the sheet sways, turns and unfolds on its columns.

A sheet whose facets stay rigid has four motions in the plane: two shifts, a turn, and the one
folding that is alike in all cells. A drag on a vertex does work on each by how far that carries the
vertex, so that one far from the middle turns and unfolds the sheet besides shifting it.
"""

from typing import NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.reduced.attenuation import (
    column_displacements,
    magnet_displacements,
    profiles,
)
from smoskin.mechanics.sheet.lattice import swaying_stiffness
from smoskin.origami.geometry import geometry


class DragMotions(NamedTuple):
    """Motions over the board by a newton along x and one along y on each cell's vertex, m/N."""

    magnets: Floats
    """(N, M, H, 2, 2): along x and y, of the H magnets that the sheet carries."""
    vertex: Floats
    """(N, M, 2, 2): of the dragged vertex."""


def drag_motions(design: SkinDesign) -> DragMotions:
    r"""What drags move on a sheet of rigid facets and free creases, on columns that bend.

    Notes
    -----
    With the motions :math:`\phi_j` of the sheet (two shifts, the turn about its middle and S11's
    fold for v_a = 1, less its mean), each of which the columns hold apart by
    :math:`k_j = k \sum_c |\phi_j(c)|^2`, a force F on p moves q by
    :math:`\sum_j \phi_j(q)\, \phi_j(p) \cdot F / k_j`.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> corner = drag_motions(read_design("planar")).magnets[0, 0]
    >>> (1e3 * corner[0]).round(2).tolist()  # mm/N, of M2; a shift alone is 0.35
    [[0.46, -0.23], [0.21, 0.37]]
    """
    skin, parts = geometry(design), profiles(design.cell, design.cells, (1.0, 1.0), -1.0)
    columns = skin.sheet.vertices[skin.sheet.columns][..., :2]
    middle, rows = columns.mean(axis=(0, 1)), design.cells[1]
    unfolded = column_displacements(parts, (0, 0))
    mean = unfolded.mean(axis=(0, 1))
    held = [n for n, magnet in enumerate(design.magnets) if magnet.mount == "sheet"]
    carried = np.reshape(
        [magnet_displacements(parts, design.magnets[n].corner)[0, 0] for n in held], (-1, 2)
    )
    # A top vertex follows the columns of its cell's middle line.
    aside = (unfolded[1::2, :-1] + unfolded[1::2, 1:])[:, :rows] / 2
    of_columns = _modes(columns - middle, unfolded - mean)
    of_magnets = _modes(skin.magnets[held, :2] - middle, carried - mean)
    of_tops = _modes(skin.tops - middle, aside - mean)
    each = swaying_stiffness(design) / (columns.size // 2)
    compliance = 1.0 / (each * (of_columns**2).sum(axis=(0, 1, 2)))
    return DragMotions(
        np.einsum("gaj,j,nmbj->nmgab", of_magnets, compliance, of_tops),
        np.einsum("nmaj,j,nmbj->nmab", of_tops, compliance, of_tops),
    )


def _modes(arms: Floats, unfolded: Floats) -> Floats:
    """How the four motions move points at arms (..., 2) from the middle, (..., 2, 4)."""
    x, y = np.moveaxis(arms, -1, 0)
    along = np.stack([np.ones_like(x), np.zeros_like(x), -y, unfolded[..., 0]], axis=-1)
    across = np.stack([np.zeros_like(x), np.ones_like(x), x, unfolded[..., 1]], axis=-1)
    return np.stack([along, across], axis=-2)
