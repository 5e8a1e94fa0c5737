"""Stiffness of the skin under a press and under a drag, and the law from press depth to force.

The columns' motion in the plane is what resists a press (S21-S24); the creases' and the panels'
energies are left out, as the SI proposes (S25). A drag moves the board on its pillars (S26) and
the sheet on its columns, and stiffens the response to a press (S27).
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints
from smoskin.design.materials import ELASTOMERS
from smoskin.design.skin import Coefficients, MiuraCell, SkinDesign
from smoskin.mechanics.board import board_of
from smoskin.mechanics.reduced.attenuation import profiles


def pillar_stiffness(radius: float, height: float, shear_modulus: float) -> float:
    """In-plane stiffness of one elastomer pillar, k = S G / h, N/m.

    Notes
    -----
    Source: SI Eq. (S21).

    Examples
    --------
    >>> round(pillar_stiffness(1.5e-3, 10e-3, 25e3), 2)
    17.67
    """
    return math.pi * radius**2 * shear_modulus / height


def column_stiffness(design: SkinDesign) -> float:
    """k_bc of one support column, N/m."""
    columns = design.columns
    modulus = ELASTOMERS[columns.material].shear_modulus
    return pillar_stiffness(columns.radius, columns.height, modulus)


def board_stiffness(design: SkinDesign) -> float:
    """K_sf of the layer that lets a drag move the board, N/m.

    Notes
    -----
    Source: SI Eq. (S26), of pillars that bend: `smoskin.mechanics.board.board_of`.
    """
    return float(board_of(design).stiffness[0])


def sheet_stiffness(design: SkinDesign) -> float:
    """Stiffness of the sheet against sliding as a whole over the board, N/m.

    All columns shear in parallel. Those of the whole sheet bend, and are softer:
    `smoskin.mechanics.sheet.lattice.swaying_stiffness`.

    Notes
    -----
    Source: SI Eq. (S21).
    """
    n, m = design.cells
    return (2 * n + 1) * (m + 1) * column_stiffness(design)


def relative_stiffness_map(
    cell: MiuraCell, cells: tuple[int, int], attenuation: tuple[float, float]
) -> Floats:
    """K_B / k_bc of a press on each of (N, M) cells' loaded vertices, which move in z only, (N, M).

    `attenuation` is (v_aX, v_aY).

    Notes
    -----
    Source: SI Eqs. (S22)-(S24): E_B = k_bc/2 sum of |u|^2 over all columns, each counted once.
    Valid for small presses, where u is linear in dh.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> stiffness = relative_stiffness_map(read_design("planar").cell, (6, 6), (0.5, 0.5))
    >>> [round(float(stiffness[k, k]), 1) for k in range(3)]
    [255.5, 223.3, 214.4]
    """
    parts = profiles(cell, cells, attenuation, press=-1.0)
    wide, tall = parts.x.shape[1], parts.y.shape[1]
    of_column = tall * (parts.x**2 + parts.zigzag**2).sum(axis=1)
    of_row = wide * (parts.y**2).sum(axis=1)
    mixed = 2 * np.outer(parts.zigzag.sum(axis=1), parts.y.sum(axis=1))
    return np.asarray(of_column[:, None] + of_row + mixed)


def stiffness_map(design: SkinDesign, coefficients: Coefficients) -> Floats:
    """v_s K_z of each cell under these coefficients, shape (N, M), N/m.

    Notes
    -----
    Source: SI Eq. (S25) with K_C and K_p neglected, as the SI proposes.
    """
    relative = relative_stiffness_map(design.cell, design.cells, coefficients.attenuation)
    return coefficients.stiffness_variation * column_stiffness(design) * relative


def cell_layers(cells: tuple[int, int]) -> Ints:
    """Each cell's layer, counted from the rim inwards, shape (N, M).

    Notes
    -----
    Source: SI Text S5: v_f is measured for the outer, mid and inner layer.

    Examples
    --------
    >>> cell_layers((6, 6))[:3, :3].tolist()
    [[0, 0, 0], [0, 1, 1], [0, 1, 2]]
    """
    n, m = np.indices(cells)
    to_rim = np.minimum.reduce([n, m, cells[0] - 1 - n, cells[1] - 1 - m])
    return np.asarray(to_rim, dtype=np.int64)


def folding_correction_map(cells: tuple[int, int], coefficients: Coefficients) -> Floats:
    """v_f of each cell for shear in X and in Y, shape (N, M, 2), N.

    Cells deeper inside than the layers named take the innermost value.
    """
    table = np.stack(
        [coefficients.folding_correction_x, coefficients.folding_correction_y], axis=-1
    )
    return np.asarray(table[np.minimum(cell_layers(cells), len(table) - 1)])


def shear_gain(shear: ArrayLike, folding_correction: ArrayLike) -> Floats:
    """1 + |F_p| / v_f, (...): how much a drag F_p, (..., 2) N, stiffens the response to a press.

    Notes
    -----
    Source: SI Eq. (S27). The SI gives v_f along X and Y only; between them the two shares add
    as the legs of a right angle, which is exact on both axes.

    Examples
    --------
    >>> float(shear_gain([0.3, 0.0], [0.6, 0.9]))
    1.5
    """
    share = np.asarray(shear) / np.asarray(folding_correction)
    return np.asarray(1 + np.hypot(share[..., 0], share[..., 1]))


def normal_force(press: ArrayLike, stiffness: ArrayLike, gain: ArrayLike) -> Floats:
    """F_z, N, from the depth U_z, m, positive, to which the loaded vertex is pressed.

    Notes
    -----
    Source: SI Eq. (S27): F_z = gain stiffness U_z with the gain 1 + |F_p|/v_f, `shear_gain`,
    and the stiffness v_s K_z, `stiffness_map`.
    """
    force: Floats = np.multiply(np.multiply(gain, stiffness), press)
    return force


def press_depth(force: ArrayLike, stiffness: ArrayLike, gain: ArrayLike) -> Floats:
    """U_z under a normal force, m: the inverse of `normal_force`."""
    depth: Floats = np.divide(force, np.multiply(gain, stiffness))
    return depth
