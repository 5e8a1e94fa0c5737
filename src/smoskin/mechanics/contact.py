"""How a touch anywhere on the skin becomes loads on top vertices.

The SI loads top vertices only. A touch between them presses the four round it through the
elastomer scales, in shares that fall off linearly along each axis; past the outermost vertices
the outermost take it all.
"""

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.cell import size
from smoskin.origami.sheet import loaded_positions

_SLACK = 1e-6
"""m: a position this far past the rim is rounding."""


def vertex_shares(design: SkinDesign, positions: ArrayLike) -> Floats:
    """Share of a touch that each cell's top vertex takes.

    Parameters
    ----------
    design : SkinDesign
    positions : array_like, shape (..., 2)
        Where the skin is touched, m.

    Returns
    -------
    Floats, shape (..., N, M)
        Their sum over the cells is 1.

    Raises
    ------
    ArgumentError
        If a position lies off the skin.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> shares = vertex_shares(read_design("planar"), [0.015, 0.160 / 12])
    >>> shares[:3, 0].round(3).tolist()
    [0.75, 0.25, 0.0]
    """
    where = floats("positions", positions, (2,))
    extent = size(design.cell)
    whole = np.array([design.cells[0] * extent.length, design.cells[1] * extent.width])
    off = ~((where >= -_SLACK) & (where <= whole + _SLACK)).all(axis=-1)
    if off.any():
        x, y = where[off][0] * 1e3
        raise ArgumentError(
            f"position must lie on the skin, (0..{whole[0] * 1e3:.1f}, 0..{whole[1] * 1e3:.1f}) "
            f"mm; got ({x:.1f}, {y:.1f}) mm"
        )
    places = loaded_positions(design)
    shares = []
    for axis, vertices in enumerate((places[:, 0, 0], places[0, :, 1])):
        cells = np.arange(len(vertices))
        within = np.interp(where[..., axis], vertices, cells)
        shares.append(np.maximum(1 - np.abs(cells - within[..., None]), 0))
    return np.asarray(shares[0][..., :, None] * shares[1][..., None, :])
