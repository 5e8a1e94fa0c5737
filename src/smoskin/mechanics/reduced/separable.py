"""Sums over the cells of quantities that split into a column's part and a row's part.

Under one load every fold change of the reduced sheet is such a sum, so that an energy needs the
parts' own sums only: a map over all loads costs what its parts cost, not loads times cells.
"""

from typing import NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.mechanics.reduced.attenuation import FoldFrom, Profiles, fold_shares, line_means


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


def inner_product(one: Split, other: Split) -> Floats:
    """Sum over the grid of the product of two quantities, for each load, shape (N, M).

    Examples
    --------
    >>> grid = Split(np.array([[1.0, 2.0]]), np.array([[10.0, 20.0, 30.0]]))
    >>> float(inner_product(grid, grid)[0, 0]) == 11**2 + 12**2 + 21**2 + 22**2 + 31**2 + 32**2
    True
    """
    columns, rows = one.along.shape[1], one.across.shape[1]
    of_columns = rows * (one.along * other.along).sum(axis=1)
    of_rows = columns * (one.across * other.across).sum(axis=1)
    mixed = np.outer(one.along.sum(axis=1), other.across.sum(axis=1))
    mixed += np.outer(other.along.sum(axis=1), one.across.sum(axis=1))
    return np.asarray(of_columns[:, None] + of_rows[None, :] + mixed)


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
