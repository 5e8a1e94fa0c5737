"""The planar folded sheet of N x M cells: vertices, panels, creases, and where columns stand.

Vertex (i, j), i = 0..2N along x and j = 0..2M along y, has index ``i (2M + 1) + j``. Top
vertices have odd j, bottom vertices even j; one column stands under each bottom vertex, and
the loaded vertex of cell (n, m) is (2n + 1, 2m + 1). Figure S6.
"""

from dataclasses import dataclass

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import MiuraCell
from smoskin.origami.cell import size


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sheet:
    """A folded sheet at rest, in the skin's frame."""

    vertices: Floats
    """(V, 3), m; bottom vertices at z = 0."""
    facets: Ints
    """(F, 4): vertex indices of each panel, counter-clockwise seen from above."""
    creases: Ints
    """(C, 2): vertex indices of each fold line; rims are no creases."""
    mountain: Bools
    """(C,): a ridge seen from above; otherwise a valley."""
    along_a: Bools
    """(C,): an a-crease; otherwise a b-crease."""
    loaded: Ints
    """(N, M): index of the top vertex of each cell."""
    columns: Ints
    """(2N + 1, M + 1): index of each bottom vertex."""


def vertex_positions(cell: MiuraCell, cells: tuple[int, int]) -> Floats:
    """Vertices of the folded sheet, shape (2N + 1, 2M + 1, 3), m.

    Notes
    -----
    Source: SI Figure S6 and Eq. (S1): (i l/2, j w/2 + [i even] b cos(phi), [j odd] h).
    """
    i, j = np.meshgrid(np.arange(2 * cells[0] + 1), np.arange(2 * cells[1] + 1), indexing="ij")
    length, width, height = size(cell)
    zigzag = cell.panel_b * np.cos(cell.fold_angle)
    return np.stack(
        [i * length / 2, j * width / 2 + (i % 2 == 0) * zigzag, (j % 2 == 1) * height], axis=-1
    )


def build_sheet(cell: MiuraCell, cells: tuple[int, int]) -> Sheet:
    """The sheet of ``cells = (N, M)`` cells.

    Examples
    --------
    >>> from math import radians
    >>> cell = MiuraCell(panel_a=0.01, panel_b=0.01,
    ...                  sector_angle=radians(60), fold_angle=radians(45))
    >>> sheet = build_sheet(cell, (6, 6))
    >>> len(sheet.vertices), len(sheet.facets), sheet.columns.size
    (169, 144, 91)
    >>> int(sheet.along_a.sum()), int((~sheet.along_a).sum())
    (132, 132)
    """
    positions = vertex_positions(cell, cells)
    index = np.arange(positions[..., 0].size).reshape(positions.shape[:2])
    facets = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    i, j = np.indices(index.shape)
    # Along y at inner i run the a-creases, folded up and down in turn; along x at inner j the
    # b-creases, ridges at the top vertices (j odd) and valleys at the bottom ones.
    a_creases = np.stack([index[1:-1, :-1], index[1:-1, 1:]], axis=-1)
    b_creases = np.stack([index[:-1, 1:-1], index[1:, 1:-1]], axis=-1)
    a_mountain = ((i + j) % 2 == 1)[1:-1, :-1]
    b_mountain = (j % 2 == 1)[:-1, 1:-1]
    n_a = a_mountain.size
    return Sheet(
        vertices=positions.reshape(-1, 3),
        facets=facets.reshape(-1, 4),
        creases=np.concatenate([a_creases.reshape(-1, 2), b_creases.reshape(-1, 2)]),
        mountain=np.concatenate([a_mountain.ravel(), b_mountain.ravel()]),
        along_a=np.arange(n_a + b_mountain.size) < n_a,
        loaded=index[1::2, 1::2],
        columns=index[:, ::2],
    )
