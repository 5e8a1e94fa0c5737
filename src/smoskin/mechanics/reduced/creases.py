"""Energy that the creases store when the cells under and round a press change their fold.

Decides which creases there are, which fold each follows and how stiff the bare film between two
panels is (S16-S20). A crease inside a cell follows that cell; one on the border of two cells
takes the mean of their changes. The sheet's rims are no creases.
"""

from typing import Literal, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.materials import FILMS
from smoskin.design.skin import Creases, MiuraCell
from smoskin.mechanics.reduced.attenuation import FoldFrom
from smoskin.mechanics.reduced.separable import Split, fading_folds, inner_product
from smoskin.origami.cell import dihedral_rates

CreaseCount = Literal["each_once", "printed"]
"""Every crease once with 1/2 k L dphi^2, or S16 and S19 to the letter."""


class DihedralChanges(NamedTuple):
    """Change of every cell's two dihedral angles, or its derivative by the press."""

    at_a: Split
    """dphi_1, at the a-creases, rad."""
    at_b: Split
    """dphi_2, at the b-creases, rad."""


def crease_stiffness(creases: Creases) -> float:
    """Moment per length and angle that a crease holds, k, N (that is N m per m and rad).

    Notes
    -----
    Source: SI Eq. (S16), the text under it: k = E I / g with I = t^3 / 12 per length, the film
    bent evenly across its gap g. Valid for a gap much narrower than a panel.

    Examples
    --------
    >>> film = Creases(thickness=50e-6, gap=1e-3, material="polyimide")
    >>> round(crease_stiffness(film), 5)
    0.02604
    """
    modulus = FILMS[creases.material].young_modulus
    return modulus * creases.thickness**3 / (12 * creases.gap)


def crease_product(
    cell: MiuraCell, one: DihedralChanges, other: DihedralChanges, count: CreaseCount
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
            cell.panel_a * _as_printed(one.at_a, other.at_a)
            + cell.panel_b * _as_printed(one.at_b, other.at_b)
        )
    of_a = inner_product(one.at_a, other.at_a)
    of_a += inner_product(one.at_a.between_columns(), other.at_a.between_columns())
    of_b = inner_product(one.at_b, other.at_b)
    of_b += inner_product(one.at_b.between_rows(), other.at_b.between_rows())
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


def _as_printed(one: Split, other: Split) -> Floats:
    """Sums over all cells and, for the bottom creases, again over the first (N - 1)(M - 1)."""
    bottom = [Split(part.along[:, :-1], part.across[:, :-1]) for part in (one, other)]
    return np.asarray(inner_product(one, other) + inner_product(*bottom))
