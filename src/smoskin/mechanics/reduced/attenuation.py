"""Motion of each column when one cell is pressed: the SI's reduced, attenuated sheet.

The pressed cell spreads by (dl, dw); each next cell by less, by a factor v_a a cell (S10), and
every bottom vertex adds up what lies between it and the load (S7-S11). A column's x depends on its
i alone, its y on i and j separately, so that one load costs O(N + M). A column shared by several
cells takes the mean of what they give.
"""

from typing import NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.origami.cell import poisson_ratios, size


class CellChange(NamedTuple):
    """Change of the pressed cell's extent, m."""

    dl: Floats
    dw: Floats


class Profiles(NamedTuple):
    """Column displacements of every possible load, in separated parts, m.

    Load (n0, m0) moves column (i, k), i = 0..2N, k = 0..M, by
    ``(x[n0, i], y[m0, k] + zigzag[n0, i])``.
    """

    x: Floats
    """(N, 2N + 1)."""
    y: Floats
    """(M, M + 1)."""
    zigzag: Floats
    """(N, 2N + 1): shift of the zigzag as the columns of cells unfold; 0 for odd i."""


def cell_change(cell: MiuraCell, press: float) -> CellChange:
    """Growth of the pressed cell in the plane when its top vertex moves by `press`, m, < 0 down.

    Notes
    -----
    Source: SI Eq. (S7), erratum E4: S7 holds to first order only, 4 % off for a press of 0.1 mm
    on a cell of 10 mm panels, 43 % for 1 mm.
    """
    length, width, height = size(cell)
    nu = poisson_ratios(cell)
    return CellChange(dl=-press / height * length * nu.nu_13, dw=-press / height * width * nu.nu_23)


def frame_shift(count: int, attenuation: float) -> Floats:
    """Shift of each cell's frame per unit growth of the loaded cell, shape (count, count).

    Element [n0, n] is ``sgn(n - n0) [1/2 + v + ... + v^(|n - n0| - 1) + v^|n - n0| / 2]``.

    Notes
    -----
    Source: SI Eq. (S11).

    Examples
    --------
    >>> frame_shift(4, 0.5)[0]
    array([0.    , 0.75  , 1.125 , 1.3125])
    """
    n = np.arange(count)
    steps = n[None, :] - n[:, None]
    away = np.abs(steps)
    powers = attenuation ** np.arange(count + 1)
    between = np.concatenate([[0.0], np.cumsum(powers[1:])])  # v + ... + v^k
    shift = 0.5 + between[np.maximum(away - 1, 0)] + powers[away] / 2
    return np.asarray(np.sign(steps) * np.where(away == 0, 0.0, shift))


def profiles(
    cell: MiuraCell, cells: tuple[int, int], attenuation: tuple[float, float], press: float
) -> Profiles:
    """Column displacements for a press dh on each of (N, M) cells in turn, in separated parts.

    `attenuation` is (v_aX, v_aY), `press` the dh of the loaded vertex, m; negative presses.

    Notes
    -----
    Source: SI Eqs. (S8)-(S11), erratum E5: the SI leaves open which of a cell's two sizes
    gives its fold; its words under S18 say dl.
    """
    change = cell_change(cell, press)
    shifts, growths = [], []
    for count, v, growth in zip(cells, attenuation, change, strict=True):
        n = np.arange(count)
        shifts.append(frame_shift(count, v) * growth)
        growths.append(np.float64(v) ** np.abs(n[None, :] - n[:, None]) * growth)
    x = np.empty((cells[0], 2 * cells[0] + 1))
    x[:, ::2], x[:, 1::2] = _edges(shifts[0], growths[0]), shifts[0]
    # Change of b cos(phi), with dphi = dl / (2 b cos(phi)) from S1; between cells their mean.
    shift = -np.tan(cell.fold_angle) / 2 * growths[0]
    zigzag = np.zeros_like(x)
    zigzag[:, [0, -1]] = shift[:, [0, -1]]
    zigzag[:, 2:-2:2] = (shift[:, :-1] + shift[:, 1:]) / 2
    return Profiles(x=x, y=_edges(shifts[1], growths[1]), zigzag=zigzag)


def column_displacements(parts: Profiles, loaded: tuple[int, int]) -> Floats:
    """In-plane displacement of every column, (2N + 1, M + 1, 2), m, for a loaded cell (n0, m0).

    Notes
    -----
    Source: SI Eq. (S11), erratum E6 (the printed lines are broken by the scan).
    """
    n0, m0 = loaded
    y = parts.y[m0][None, :] + parts.zigzag[n0][:, None]
    return np.stack([np.broadcast_to(parts.x[n0][:, None], y.shape), y], axis=-1)


def magnet_displacements(parts: Profiles, corner: tuple[int, int]) -> Floats:
    """Displacement of a magnet at a corner of the grid for a press on each cell, (N, M, 2), m.

    Corner (p, q) lies at (p l, q w). The holder hangs between columns of the cells' middle lines,
    which have no zigzag, so that it moves with the lines between the cells.

    Notes
    -----
    Source: SI Text S4 under Eq. (S12): for a unit press on cell (1,1) the reference design gives
    the four displacements printed there.
    """
    p, q = corner
    return np.stack(np.broadcast_arrays(parts.x[:, 2 * p, None], parts.y[None, :, q]), axis=-1)


def _edges(shift: Floats, growth: Floats) -> Floats:
    """Displacement of the lines between cells from their frames' shifts, (count, count + 1)."""
    first = shift[:, :1] - growth[:, :1] / 2
    return np.concatenate([first, shift + growth / 2], axis=1)
