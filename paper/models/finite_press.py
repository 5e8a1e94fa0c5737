"""Energy, push-back force and tangent stiffness of the reduced sheet under a press of any depth.

The maps of `stiffness` hold for small presses; here the fold of every cell follows exactly
(inverse of S1), so that force and stiffness change with depth. Derivatives are exact: each
quantity travels with its first and second derivative by the press.
"""

from typing import Literal, NamedTuple

import numpy as np

from paper.models.fold_energies import (
    CreaseCount,
    DihedralChanges,
    FoldFrom,
    Split,
    crease_product,
    fold_shares,
    line_means,
)
from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.plate import crease_stiffness
from smoskin.mechanics.reduced.attenuation import CellChange, cell_change, profiles
from smoskin.mechanics.reduced.stiffness import column_stiffness
from smoskin.origami.cell import dihedral_angles, fold_angle, size

Kinematics = Literal["first_order", "exact"]
"""S7, or the inverse of S1."""


class PressResponse(NamedTuple):
    """What a press on each cell's loaded vertex meets, (N, M) each."""

    energy: Floats
    """J, stored by the press."""
    force: Floats
    """N, -dE/d(dh): along +z, positive while the sheet is pressed."""
    stiffness: Floats
    """N/m, d2E/d(dh)2: the tangent at this depth."""


class Jet(NamedTuple):
    """A quantity with its derivatives by the press dh."""

    value: Floats
    rate: Floats
    """Per m."""
    bend: Floats
    """Per m^2."""

    def through(self, value: Floats, slope: Floats, bend: Floats) -> "Jet":
        """A function of it, from the function's own value and derivatives there."""
        return Jet(value, slope * self.rate, slope * self.bend + bend * self.rate**2)


class Columns(NamedTuple):
    """Column displacements of every load, m, whichever size a cell's fold follows.

    They are the parts of `smoskin.mechanics.reduced.attenuation.Profiles`; a fold that follows the
    width moves column (i, k) with even i by ``zigzag_y[m0, k]`` more along y.
    """

    x: Floats
    """(N, 2N + 1)."""
    y: Floats
    """(M, M + 1)."""
    zigzag_x: Floats
    """(N, 2N + 1): shift of the zigzag as the columns of cells unfold; 0 for odd i."""
    zigzag_y: Floats
    """(M, M + 1): shift of the zigzag as the rows unfold; 0 unless the fold follows the width."""


def exact_change(cell: MiuraCell, press: float) -> CellChange:
    """Growth of the pressed cell in the plane when its top vertex moves by `press`, m.

    Raises
    ------
    ArgumentError
        If the cell would have to be pressed flat or pulled past its panels.

    Notes
    -----
    Source: the inverse of SI Eq. (S1).
    """
    length, width, height = size(cell)
    most = cell.panel_a * np.sin(cell.sector_angle)
    if not 0.0 < height + press < most:
        raise ArgumentError(
            f"press must leave the cell a height in (0, {most * 1e3:.3f}) mm; got "
            f"{press * 1e3:.3f} mm on a height of {height * 1e3:.3f} mm"
        )
    pressed = size(cell, fold_angle(cell, height=height + press))
    return CellChange(dl=pressed.length - length, dw=pressed.width - width)


def motion_product(item: Columns, other: Columns) -> Floats:
    """Sum over all columns of u . u' for each loaded cell, in O(N M), shape (N, M), m^2."""
    wide, tall = item.x.shape[1], item.y.shape[1]
    even = (wide + 1) // 2
    of_column = tall * ((item.x * other.x) + (item.zigzag_x * other.zigzag_x)).sum(axis=1)
    of_row = wide * (item.y * other.y).sum(axis=1)
    # The rows' zigzag acts at even i alone and meets both other parts of y there.
    both_rows = item.zigzag_y * other.zigzag_y + item.y * other.zigzag_y + item.zigzag_y * other.y
    of_row += even * both_rows.sum(axis=1)
    mixed = np.outer(item.zigzag_x.sum(axis=1), (other.y + other.zigzag_y).sum(axis=1))
    mixed += np.outer(other.zigzag_x.sum(axis=1), (item.y + item.zigzag_y).sum(axis=1))
    return np.asarray(of_column[:, None] + of_row[None, :] + mixed)


def column_response(
    design: SkinDesign,
    attenuation: tuple[float, float],
    press: float,
    *,
    kinematics: Kinematics = "exact",
    fold_from: FoldFrom = "length",
) -> PressResponse:
    """What the columns hold against a press.

    Parameters
    ----------
    design : SkinDesign
    attenuation : tuple of float
        (v_aX, v_aY).
    press : float
        dh of the loaded vertex, m; negative presses.
    kinematics : {"first_order", "exact"}
        Displacements linear in dh, or from the inverse of S1.
    fold_from : {"length", "width", "mean"}
        Which of a cell's two sizes gives its fold.

    Raises
    ------
    ArgumentError
        If the cell would have to be pressed flat or pulled past its panels.

    Notes
    -----
    Source: SI Eqs. (S22)-(S24), with F = -dE/d(dh) and K = d2E/d(dh)2 at this depth.
    """
    at = press if kinematics == "exact" else 0.0
    value, rate, bend = _column_motion(design.cell, design.cells, attenuation, at, fold_from)
    k = column_stiffness(design)
    if kinematics == "first_order":
        return _linear(k * motion_product(rate, rate), press)
    return PressResponse(
        energy=k / 2 * motion_product(value, value),
        force=-k * motion_product(value, rate),
        stiffness=k * (motion_product(rate, rate) + motion_product(value, bend)),
    )


def crease_response(
    design: SkinDesign,
    attenuation: tuple[float, float],
    press: float,
    *,
    kinematics: Kinematics = "exact",
    fold_from: FoldFrom = "length",
    count: CreaseCount = "each_once",
) -> PressResponse:
    """What the creases hold against a press; parameters as `column_response`.

    The creases are free of stress at rest.

    Notes
    -----
    Source: SI Eqs. (S16)-(S20), with F = -dE/d(dh) and K = d2E/d(dh)2 at this depth.
    """
    at = press if kinematics == "exact" else 0.0
    value, rate, bend = _dihedral_changes(design.cell, design.cells, attenuation, at, fold_from)
    cell, k = design.cell, crease_stiffness(design.creases)
    stiffness = k * crease_product(cell, rate, rate, count)
    if kinematics == "first_order":
        return _linear(stiffness, press)
    return PressResponse(
        energy=k / 2 * crease_product(cell, value, value, count),
        force=-k * crease_product(cell, value, rate, count),
        stiffness=stiffness + k * crease_product(cell, value, bend, count),
    )


def _linear(stiffness: Floats, press: float) -> PressResponse:
    """A spring."""
    return PressResponse(stiffness * press**2 / 2, -stiffness * press, stiffness)


def _loaded_extents(cell: MiuraCell, press: float) -> tuple[Jet, Jet]:
    """Growth of the loaded cell's length and width; inverse of S1, differentiated."""
    change = exact_change(cell, press)
    a, alpha, height = cell.panel_a, cell.sector_angle, size(cell).height + press
    left = a**2 - height**2
    # l = 2 b sqrt(g) with g = (a^2 sin^2(alpha) - h^2) / (a^2 - h^2); w = 2 sqrt(a^2 - h^2).
    g = ((a * np.sin(alpha)) ** 2 - height**2) / left
    slope = -2 * height * (a * np.cos(alpha)) ** 2 / left**2
    bend = -2 * (a * np.cos(alpha)) ** 2 * (a**2 + 3 * height**2) / left**3
    root = np.sqrt(g)
    length = Jet(
        change.dl,
        cell.panel_b * slope / root,
        cell.panel_b * (bend / root - slope**2 / (2 * root**3)),
    )
    return length, Jet(change.dw, -2 * height / np.sqrt(left), -2 * a**2 / left**1.5)


def _cell_folds(
    cell: MiuraCell, cells: tuple[int, int], attenuation: tuple[float, float], press: float
) -> tuple[Jet, Jet]:
    """Fold angle of each cell as its length gives it, (N, N), and as its width does, (M, M)."""
    rest, jets = size(cell), []
    growths = _loaded_extents(cell, press)
    for count, v, growth in zip(cells, attenuation, growths, strict=True):
        n = np.arange(count)
        fading = np.float64(v) ** np.abs(n[None, :] - n[:, None])
        jets.append(Jet(*(fading * item for item in growth)))
    length, width = jets
    phi = fold_angle(cell, length=rest.length + length.value)
    slope = 1 / (2 * cell.panel_b * np.cos(phi))
    from_length = length.through(phi, slope, np.tan(phi) * slope**2)
    extent = rest.width + width.value
    phi = fold_angle(cell, width=extent)
    slope = 1 / (extent * np.tan(phi))
    from_width = width.through(phi, slope, -slope / extent * (1 / np.sin(phi) ** 2 + 1))
    return from_length, from_width


def _dihedral_changes(
    cell: MiuraCell,
    cells: tuple[int, int],
    attenuation: tuple[float, float],
    press: float,
    fold_from: FoldFrom,
) -> tuple[DihedralChanges, DihedralChanges, DihedralChanges]:
    """Value and derivatives of every cell's dihedral changes."""
    alpha, parts = cell.sector_angle, []
    folds = _cell_folds(cell, cells, attenuation, press)
    for phi, share in zip(folds, fold_shares(fold_from), strict=True):
        # sin(phi) = sin(alpha) sin(phi_1/2), then tan(phi_2/2) = cos(alpha) tan(phi_1/2).
        sine, cosine = np.sin(phi.value), np.cos(phi.value)
        room = np.sin(alpha) ** 2 - sine**2
        at_a = phi.through(
            2 * np.arcsin(sine / np.sin(alpha)),
            2 * cosine / np.sqrt(room),
            2 * sine * np.cos(alpha) ** 2 / room**1.5,
        )
        half = at_a.value / 2
        at_b = at_a.through(
            2 * np.arctan(np.cos(alpha) * np.tan(half)),
            np.cos(alpha) / cosine**2,
            np.cos(alpha) * np.sin(alpha) ** 2 * np.sin(half) * np.cos(half) / cosine**4,
        )
        rest = dihedral_angles(cell)
        parts.append(
            [
                Jet(share * (jet.value - start), share * jet.rate, share * jet.bend)
                for jet, start in zip((at_a, at_b), rest, strict=True)
            ]
        )
    (a_along, b_along), (a_across, b_across) = parts
    orders = [
        DihedralChanges(at_a=Split(*a_pair), at_b=Split(*b_pair))
        for a_pair, b_pair in zip(
            zip(a_along, a_across, strict=True), zip(b_along, b_across, strict=True), strict=True
        )
    ]
    return orders[0], orders[1], orders[2]


def _column_motion(
    cell: MiuraCell,
    cells: tuple[int, int],
    attenuation: tuple[float, float],
    press: float,
    fold_from: FoldFrom,
) -> tuple[Columns, Columns, Columns]:
    """Value and derivatives of the columns' displacements."""
    unit, per_unit = profiles(cell, cells, attenuation, -1.0), cell_change(cell, -1.0)
    length, width = _loaded_extents(cell, press)
    folds = _cell_folds(cell, cells, attenuation, press)
    b, phi_0 = cell.panel_b, cell.fold_angle
    zigzags = []
    for phi, share in zip(folds, fold_shares(fold_from), strict=True):
        shift = phi.through(
            b * (np.cos(phi.value) - np.cos(phi_0)), -b * np.sin(phi.value), -b * np.cos(phi.value)
        )
        zigzags.append([share * line_means(item) for item in shift])
    orders = []
    for dl, dw, of_columns, of_rows in zip(length, width, *zigzags, strict=True):
        zigzag_x = np.zeros_like(unit.x)
        zigzag_x[:, ::2] = of_columns
        orders.append(
            Columns(
                x=unit.x * (dl / per_unit.dl),
                y=unit.y * (dw / per_unit.dw),
                zigzag_x=zigzag_x,
                zigzag_y=of_rows,
            )
        )
    return orders[0], orders[1], orders[2]
