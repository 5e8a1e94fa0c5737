"""Energy that creases and panels store under a press, by the reduced sheet's folds.

The SI adds both to the columns' energy and then leaves them out (S16-S20, S25). A crease inside a
cell follows that cell, one on the border of two cells the mean of their changes; rims are no
creases. The panels' energy follows from one assumption: the border of two cells that would fold
differently lies half-way between what each asks of it, and the panels on both sides are strained
to meet it, by a uniform twist out of their planes and a uniform shear within them. Nothing is
strained inside a cell, nor where neighbours fold alike; that a cell off the diagonal gets a length
and a width that no fold has both of (S10) is not charged to its panels.

Under one load every fold change is the sum of a column's part and a row's part, so that a map over
all loads costs what the parts cost, not loads times cells.
"""

from typing import Literal, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell, Panels
from smoskin.mechanics.plate import shear_stiffness, twist_stiffness
from smoskin.origami.cell import DihedralAngles, dihedral_angles, size

CreaseCount = Literal["each_once", "printed"]
"""Every crease once with 1/2 k L dphi^2, or S16 and S19 to the letter."""
FoldFrom = Literal["length", "width", "mean"]
"""Which of a cell's two sizes gives its fold; off the diagonal they differ (erratum E5)."""


class Split(NamedTuple):
    """A quantity of every cell under every load, in two parts.

    Load (n0, m0) gives cell (n, m) the value ``along[n0, n] + across[m0, m]``.
    """

    along: Floats
    """(N, R): loads by columns of the grid; R columns, N of cells or N - 1 of lines between."""
    across: Floats
    """(M, C): likewise for the rows."""

    def scaled(self, factor: float) -> "Split":
        """The quantity times a number."""
        return Split(self.along * factor, self.across * factor)

    def between_columns(self) -> "Split":
        """Its means on the lines between neighbouring columns."""
        return Split(line_means(self.along)[:, 1:-1], self.across)

    def between_rows(self) -> "Split":
        """Its means on the lines between neighbouring rows."""
        return Split(self.along, line_means(self.across)[:, 1:-1])


def fold_shares(fold_from: FoldFrom) -> tuple[float, float]:
    """Weights of the folds that a cell's length and its width would give it."""
    return {"length": (1.0, 0.0), "width": (0.0, 1.0), "mean": (0.5, 0.5)}[fold_from]


def line_means(per_cell: Floats) -> Floats:
    """Means of neighbouring cells on the lines between them, (..., K) to (..., K + 1).

    A line on the rim has one cell only.
    """
    inner = (per_cell[:, :-1] + per_cell[:, 1:]) / 2
    return np.concatenate([per_cell[:, :1], inner, per_cell[:, -1:]], axis=1)


def dihedral_rates(cell: MiuraCell) -> DihedralAngles:
    """Rates d phi_1 / dh and d phi_2 / dh at the cell's fold angle, rad/m.

    Notes
    -----
    Source: SI Eq. (S18).
    """
    at_a, at_b = dihedral_angles(cell)
    a, alpha = cell.panel_a, cell.sector_angle
    q = 1 - np.sin(alpha) ** 2 * np.sin(at_a / 2) ** 2
    return DihedralAngles(
        at_a=2 * np.sqrt(q) * -q / (a * np.cos(alpha) ** 2 * np.sin(alpha) * np.sin(at_a / 2)),
        at_b=-2 / (a * np.sin(alpha) * np.sin(at_b / 2)),
    )


def fading_folds(
    cells: tuple[int, int], attenuation: tuple[float, float], fold_from: FoldFrom
) -> Split:
    """Each cell's fold change over that of the loaded cell, for small presses.

    Notes
    -----
    Source: SI Eq. (S10), erratum E5: ``v_aX^|n - n0|`` where the fold follows the length,
    ``v_aY^|m - m0|`` where it follows the width, or their mean.
    """
    along, across = fold_shares(fold_from)
    parts = []
    for count, v, share in zip(cells, attenuation, (along, across), strict=True):
        n = np.arange(count)
        parts.append(share * np.float64(v) ** np.abs(n[None, :] - n[:, None]))
    return Split(*parts)


def inner_product(item: Split, other: Split) -> Floats:
    """Sum over the grid of the product of two quantities, for each load, shape (N, M).

    Examples
    --------
    >>> grid = Split(np.array([[1.0, 2.0]]), np.array([[10.0, 20.0, 30.0]]))
    >>> float(inner_product(grid, grid)[0, 0]) == 11**2 + 12**2 + 21**2 + 22**2 + 31**2 + 32**2
    True
    """
    columns, rows = item.along.shape[1], item.across.shape[1]
    of_columns = rows * (item.along * other.along).sum(axis=1)
    of_rows = columns * (item.across * other.across).sum(axis=1)
    mixed = np.outer(item.along.sum(axis=1), other.across.sum(axis=1))
    mixed += np.outer(other.along.sum(axis=1), item.across.sum(axis=1))
    return np.asarray(of_columns[:, None] + of_rows[None, :] + mixed)


class DihedralChanges(NamedTuple):
    """Change of every cell's two dihedral angles, or its derivative by the press."""

    at_a: Split
    """dphi_1, at the a-creases, rad."""
    at_b: Split
    """dphi_2, at the b-creases, rad."""


def crease_product(
    cell: MiuraCell, item: DihedralChanges, other: DihedralChanges, count: CreaseCount
) -> Floats:
    """Sum over all creases of length times both changes, for each load, shape (N, M), m rad^2.

    With `one` and `other` the same, k/2 times it is the energy.

    Notes
    -----
    Source: SI Eqs. (S16) and (S19), errata E12 and E14: each cell has two a- and two b-creases of
    its own and shares as many with each neighbour, 2NM + 2(N - 1)M and 2NM + 2N(M - 1) in all. As
    printed, the four of a cell store ``2 k (a dphi_1^2 + b dphi_2^2)``, twice too much, and the
    sum over bottom creases runs over the first (N - 1)(M - 1) cells alone.
    """
    if count == "printed":
        return 4 * (
            cell.panel_a * _as_printed(item.at_a, other.at_a)
            + cell.panel_b * _as_printed(item.at_b, other.at_b)
        )
    of_a = inner_product(item.at_a, other.at_a)
    of_a += inner_product(item.at_a.between_columns(), other.at_a.between_columns())
    of_b = inner_product(item.at_b, other.at_b)
    of_b += inner_product(item.at_b.between_rows(), other.at_b.between_rows())
    return 2 * (cell.panel_a * of_a + cell.panel_b * of_b)


def relative_crease_stiffness_map(
    cell: MiuraCell,
    cells: tuple[int, int],
    attenuation: tuple[float, float],
    *,
    fold_from: FoldFrom = "length",
    count: CreaseCount = "each_once",
) -> Floats:
    """K_C / k of a press on each cell's loaded vertex, shape (N, M), 1/m.

    Parameters
    ----------
    cell : MiuraCell
    cells : tuple of int
        (N, M).
    attenuation : tuple of float
        (v_aX, v_aY).
    fold_from : {"length", "width", "mean"}
        Which of a cell's two sizes gives its fold.
    count : {"each_once", "printed"}
        Every crease once, or S16 and S19 to the letter.

    Notes
    -----
    Source: SI Eqs. (S17), (S18) and (S20): K_C = d2E_C/d(dh)2.
    Valid for small presses, where the dihedral angles are linear in dh.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> cell = read_design("planar").cell
    >>> stiffness = relative_crease_stiffness_map(cell, (6, 6), (0.5, 0.5))
    >>> [round(float(stiffness[n, 0])) for n in range(3)]
    [31267, 39570, 41523]
    """
    folds, rates = fading_folds(cells, attenuation, fold_from), dihedral_rates(cell)
    changes = DihedralChanges(
        at_a=folds.scaled(float(rates.at_a)), at_b=folds.scaled(float(rates.at_b))
    )
    return crease_product(cell, changes, changes, count)


class PanelStiffness(NamedTuple):
    """K_p of a press on each cell, (N, M) each, N/m."""

    bending: Floats
    """What twisting the panels resists."""
    stretching: Floats
    """What shearing them in their planes resists."""


class BorderMisfit(NamedTuple):
    """Motion of a panel's edge on a border per metre by which the neighbour's dh differs."""

    twist_x: float
    """m/m: out of the panel's plane, of the a-edge's end, per difference in dh along x."""
    twist_y: float
    """m/m: of the b-edge's end, per difference in dh along y."""
    shear_x: float
    """rad/m: within the panel's plane, of the a-edge."""
    shear_y: float
    """rad/m: of the b-edge."""


def border_misfit(cell: MiuraCell) -> BorderMisfit:
    """Turn of the panels' edges on the border of two cells per difference in the cells' dh.

    On a border along y the a-edges lean by psi, sin(psi) = h/a; on one along x the b-edges turn
    in the plane by phi. A panel takes half the difference; sin(phi_1/2) and cos(phi_2/2) of it
    lie along its normal.

    Notes
    -----
    Source: SI Eq. (S25), the text under S24; derived from Eqs. (S1), (S13) and (S14).
    """
    extent, (at_a, at_b) = size(cell), dihedral_angles(cell)
    lean = 2 / extent.width  # d psi / dh = 1 / (a cos psi), and w = 2 a cos psi
    # sin(phi) = sin(alpha) sin(phi_1/2), differentiated.
    rotation = np.sin(cell.sector_angle) * np.cos(at_a / 2) / np.cos(cell.fold_angle) / 2
    rotation = abs(rotation * dihedral_rates(cell).at_a)
    return BorderMisfit(
        twist_x=float(cell.panel_a * lean / 2 * np.sin(at_a / 2)),
        twist_y=float(cell.panel_b * rotation / 2 * np.cos(at_b / 2)),
        shear_x=float(lean / 2 * np.cos(at_a / 2)),
        shear_y=float(rotation / 2 * np.sin(at_b / 2)),
    )


def panel_stiffness_map(
    cell: MiuraCell,
    panels: Panels,
    cells: tuple[int, int],
    attenuation: tuple[float, float],
    *,
    fold_from: FoldFrom = "length",
) -> PanelStiffness:
    """K_p of a press on each cell's loaded vertex.

    Parameters
    ----------
    cell : MiuraCell
    panels : Panels
    cells : tuple of int
        (N, M).
    attenuation : tuple of float
        (v_aX, v_aY); where both are 1 the sheet is rigid and K_p zero.
    fold_from : {"length", "width", "mean"}
        Which of a cell's two sizes gives its fold.

    Notes
    -----
    Source: SI Eq. (S25), K_p, which the SI leaves out.
    Valid for small presses. The displacements are the reduced model's (S10), not those of least
    energy: panels of stiff plate make K_p far larger than K_B, where a real sheet would rather
    unfold more evenly.
    """
    folds, misfit = fading_folds(cells, attenuation, fold_from), border_misfit(cell)
    # Both edges of a cell's half meet a border, with a panel on either side: four each.
    across_x = 4 * _squared(Split(np.diff(folds.along), 0 * folds.across))
    across_y = 4 * _squared(Split(0 * folds.along, np.diff(folds.across)))
    twist, shear = twist_stiffness(cell, panels), shear_stiffness(cell, panels)
    return PanelStiffness(
        bending=twist * (misfit.twist_x**2 * across_x + misfit.twist_y**2 * across_y),
        stretching=shear * (misfit.shear_x**2 * across_x + misfit.shear_y**2 * across_y),
    )


def _as_printed(item: Split, other: Split) -> Floats:
    """Sums over all cells and, for the bottom creases, again over the first (N - 1)(M - 1)."""
    bottom = [Split(part.along[:, :-1], part.across[:, :-1]) for part in (item, other)]
    return np.asarray(inner_product(item, other) + inner_product(*bottom))


def _squared(part: Split) -> Floats:
    """Sum of the squares over the grid."""
    return inner_product(part, part)
