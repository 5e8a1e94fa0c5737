"""Motion of each column when one cell is pressed: the SI's reduced, attenuated sheet.

The pressed cell spreads by (dl, dw); each next cell by less, by a factor v_a a cell (S10), and
every bottom vertex adds up what lies between it and the load (S7-S11). Because a column's x
depends on its i alone and its y on i and j separately, one load costs O(N + M); `profiles`
holds those parts, `column_displacements` puts them together.

A column shared by several cells takes the mean of what they give.
"""

from typing import Literal, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError
from smoskin.origami.cell import fold_angle, poisson_ratios, size

Kinematics = Literal["first_order", "exact"]
FoldFrom = Literal["length", "width", "mean"]


class CellChange(NamedTuple):
    """Change of the pressed cell's extent, m."""

    dl: Floats
    dw: Floats


class Profiles(NamedTuple):
    """Column displacements of every possible load, in separated parts, m.

    Load (n0, m0) moves column (i, k), i = 0..2N, k = 0..M, by
    ``(x[n0, i], y[m0, k] + zigzag_x[n0, i] + [i even] zigzag_y[m0, k])``.
    """

    x: Floats
    """(N, 2N + 1)."""
    y: Floats
    """(M, M + 1)."""
    zigzag_x: Floats
    """(N, 2N + 1): shift of the zigzag as the columns of cells unfold; 0 for odd i."""
    zigzag_y: Floats
    """(M, M + 1): shift of the zigzag as the rows unfold; 0 unless the fold follows the width."""


def cell_change(
    cell: MiuraCell, press: float, kinematics: Kinematics = "first_order"
) -> CellChange:
    """Growth of the pressed cell in the plane when its top vertex moves by `press`.

    Parameters
    ----------
    cell : MiuraCell
    press : float
        dh, m; negative presses.
    kinematics : {"first_order", "exact"}
        S7, or the inverse of S1.

    Raises
    ------
    ArgumentError
        If the cell would have to be pressed flat or pulled past its panels.

    Notes
    -----
    Source: SI Eq. (S7), erratum E4: S7 holds to first order only, 4 % off for a press of 0.1 mm
    on a cell of 10 mm panels, 43 % for 1 mm.
    """
    length, width, height = size(cell)
    if kinematics == "first_order":
        nu = poisson_ratios(cell)
        return CellChange(
            dl=-press / height * length * nu.nu_13, dw=-press / height * width * nu.nu_23
        )
    if not 0.0 < height + press < cell.panel_a * np.sin(cell.sector_angle):
        raise ArgumentError(
            f"press must leave the cell a height in (0, "
            f"{cell.panel_a * np.sin(cell.sector_angle) * 1e3:.3f}) mm; got {press * 1e3:.3f} mm "
            f"on a height of {height * 1e3:.3f} mm"
        )
    pressed = size(cell, fold_angle(cell, height=height + press))
    return CellChange(dl=pressed.length - length, dw=pressed.width - width)


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
    cell: MiuraCell,
    cells: tuple[int, int],
    attenuation: tuple[float, float],
    press: float,
    *,
    kinematics: Kinematics = "first_order",
    fold_from: FoldFrom = "length",
) -> Profiles:
    """Column displacements for a press on each cell in turn, in separated parts.

    Parameters
    ----------
    cell : MiuraCell
    cells : tuple of int
        (N, M).
    attenuation : tuple of float
        (v_aX, v_aY).
    press : float
        dh of the loaded vertex, m; negative presses.
    kinematics : {"first_order", "exact"}
        How the loaded cell's growth and each cell's fold follow from the press.
    fold_from : {"length", "width", "mean"}
        Whether a cell's fold angle follows from its dl, its dw, or the mean of both, which
        differ off the diagonal.

    Notes
    -----
    Source: SI Eqs. (S8)-(S11), erratum E5: the SI leaves open which of a cell's two sizes
    gives its fold; its words under S18 say dl.
    """
    change = cell_change(cell, press, kinematics)
    columns, rows = cells
    growth_x = _powers(columns, attenuation[0]) * change.dl  # (N, N): dl of each cell
    growth_y = _powers(rows, attenuation[1]) * change.dw
    x = _edges(frame_shift(columns, attenuation[0]) * change.dl, growth_x)
    y = _edges(frame_shift(rows, attenuation[1]) * change.dw, growth_y)
    wide_x = np.zeros((columns, 2 * columns + 1))
    wide_x[:, ::2] = x
    wide_x[:, 1::2] = frame_shift(columns, attenuation[0]) * change.dl
    along, across = fold_shares(fold_from)
    zigzag_x = np.zeros_like(wide_x)
    zigzag_x[:, ::2] = along * line_means(_zigzag_shift(cell, growth_x, "length", kinematics))
    zigzag_y = across * line_means(_zigzag_shift(cell, growth_y, "width", kinematics))
    return Profiles(x=wide_x, y=y, zigzag_x=zigzag_x, zigzag_y=zigzag_y)


def column_displacements(parts: Profiles, loaded: tuple[int, int]) -> Floats:
    """In-plane displacement of every column for one loaded cell, shape (2N + 1, M + 1, 2), m.

    Parameters
    ----------
    parts : Profiles
    loaded : tuple of int
        (n0, m0), from 0.

    Notes
    -----
    Source: SI Eq. (S11), erratum E6 (the printed lines are broken by the scan).
    """
    n0, m0 = loaded
    even = np.arange(parts.x.shape[1]) % 2 == 0
    y = parts.y[m0][None, :] + parts.zigzag_x[n0][:, None]
    y = y + even[:, None] * parts.zigzag_y[m0][None, :]
    return np.stack([np.broadcast_to(parts.x[n0][:, None], y.shape), y], axis=-1)


def magnet_displacements(parts: Profiles, corner: tuple[int, int]) -> Floats:
    """Displacement of a magnet at a corner of the grid for a press on each cell, (N, M, 2), m.

    Its holder hangs between columns of the cells' middle lines, which have no zigzag, so that it
    moves with the lines between the cells.

    Parameters
    ----------
    parts : Profiles
    corner : tuple of int
        (p, q), at (p l, q w).

    Notes
    -----
    Source: SI Text S4 under Eq. (S12): for a unit press on cell (1,1) the reference design gives
    the four displacements printed there.
    """
    p, q = corner
    return np.stack(np.broadcast_arrays(parts.x[:, 2 * p, None], parts.y[None, :, q]), axis=-1)


def motion_product(one: Profiles, other: Profiles) -> Floats:
    """Sum over all columns of u . u' for each loaded cell, in O(N M), shape (N, M), m^2."""
    wide, tall = one.x.shape[1], one.y.shape[1]
    even = (wide + 1) // 2
    of_column = tall * ((one.x * other.x) + (one.zigzag_x * other.zigzag_x)).sum(axis=1)
    of_row = wide * (one.y * other.y).sum(axis=1)
    # The rows' zigzag acts at even i alone and meets both other parts of y there.
    both_rows = one.zigzag_y * other.zigzag_y + one.y * other.zigzag_y + one.zigzag_y * other.y
    of_row += even * both_rows.sum(axis=1)
    mixed = np.outer(one.zigzag_x.sum(axis=1), (other.y + other.zigzag_y).sum(axis=1))
    mixed += np.outer(other.zigzag_x.sum(axis=1), (one.y + one.zigzag_y).sum(axis=1))
    return np.asarray(of_column[:, None] + of_row[None, :] + mixed)


def fold_shares(fold_from: FoldFrom) -> tuple[float, float]:
    """Weights of the folds that a cell's length and its width would give it."""
    return {"length": (1.0, 0.0), "width": (0.0, 1.0), "mean": (0.5, 0.5)}[fold_from]


def line_means(per_cell: Floats) -> Floats:
    """Means of neighbouring cells on the lines between them, (..., K) to (..., K + 1).

    A line on the rim has one cell only.
    """
    inner = (per_cell[:, :-1] + per_cell[:, 1:]) / 2
    return np.concatenate([per_cell[:, :1], inner, per_cell[:, -1:]], axis=1)


def _powers(count: int, attenuation: float) -> Floats:
    """v^|n - n0| for every pair, (count, count)."""
    n = np.arange(count)
    return np.asarray(attenuation ** np.abs(n[None, :] - n[:, None]), dtype=np.float64)


def _edges(shift: Floats, growth: Floats) -> Floats:
    """Displacement of the lines between cells from their frames' shifts, (count, count + 1)."""
    first = shift[:, :1] - growth[:, :1] / 2
    return np.concatenate([first, shift + growth / 2], axis=1)


def _zigzag_shift(
    cell: MiuraCell, growth: Floats, size_name: Literal["length", "width"], kinematics: Kinematics
) -> Floats:
    """Shift b [cos(phi + dphi) - cos(phi)] of cells whose length or width grows by `growth`."""
    phi, b = cell.fold_angle, cell.panel_b
    extent = size(cell)
    if kinematics == "first_order":
        # dphi = dl / (2 b cos phi) = dw cot(phi) / w, both from S1.
        rate = (
            1 / (2 * b * np.cos(phi)) if size_name == "length" else 1 / extent.width / np.tan(phi)
        )
        return np.asarray(-b * np.sin(phi) * rate * growth)
    if size_name == "length":
        folded = fold_angle(cell, length=extent.length + growth)
    else:
        folded = fold_angle(cell, width=extent.width + growth)
    return np.asarray(b * (np.cos(folded) - np.cos(phi)))
