"""Zones of cells that the signs of two magnets' displacements tell apart: Table S1, Figure S5.

The wheel decides by `smoskin.sensing.closed_form.location.divisions`, which needs no zones; here
they stand as the SI prints them, with the lines that divide the cells of each.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.errors import ArgumentError

_DIGITS: Final = 12
"""Decimals of a ratio: columns alike to within rounding have one."""


def signal_matrix(displacements: Floats) -> Ints:
    """Signs by which the zones are told apart: +1 where the load lies at larger x or y.

    Parameters
    ----------
    displacements : Floats, shape (..., G, 2)
        Displacements of the sheet's magnets in x and y, m, by the press alone.

    Notes
    -----
    Source: SI Table S1, erratum E7 (row Z.5 is - + + -). A press spreads its cell, so that
    magnets move away from the load: the sign is the opposite of the displacement's.
    """
    return np.where(np.asarray(displacements) > 0, -1, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """Cells whose displacements have the same signs, and how ratios tell them apart."""

    number: int
    """Number from 1, along x first: Z.1 to Z.9 of Table S1 on the reference design."""
    columns: tuple[int, ...]
    """n of its cells."""
    rows: tuple[int, ...]
    """m of its cells; each column meets each row."""
    signs: tuple[int, int, int, int]
    """`signal_matrix`: first magnet in x and y, second magnet in x and y."""
    ratios_x: tuple[float, ...]
    """First over second magnet's displacement in x, of each column."""
    ratios_y: tuple[float, ...]
    """Likewise in y, of each row."""
    lines_x: tuple[float, ...]
    """Ratios in x that divide the columns, ascending."""
    lines_y: tuple[float, ...]
    """Ratios in y that divide the rows, ascending."""


def zones(unit: Floats) -> tuple[Zone, ...]:
    """The zones of a skin with two magnets: Table S1 and Figure S5 as data.

    Parameters
    ----------
    unit : Floats, shape (N, M, 2, 2)
        `smoskin.sensing.closed_form.location.unit_press`.

    Raises
    ------
    ArgumentError
        If there are not two magnets.

    Notes
    -----
    Source: SI Table S1 and Figure S5.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> from smoskin.sensing.closed_form.location import unit_press
    >>> first = zones(unit_press(read_design("planar")))[0]
    >>> first.columns, first.signs, [round(line, 4) for line in first.lines_x]
    ((0, 1), (-1, -1, -1, -1), [1.3248])
    """
    if unit.ndim != 4 or unit.shape[2:] != (2, 2):
        raise ArgumentError(f"unit must have shape (N, M, 2, 2); got {unit.shape}")
    across, along = _groups(unit[:, 0, :, 0]), _groups(unit[0, :, :, 1])
    parts: list[Zone] = []
    for rows in along:
        for columns in across:
            n, m = columns[0], rows[0]
            a, b, c, d = signal_matrix(unit[n, m]).ravel().tolist()
            ratios_x, lines_x = _ratios(unit[list(columns), 0, :, 0])
            ratios_y, lines_y = _ratios(unit[0, list(rows), :, 1])
            parts.append(
                Zone(
                    number=len(parts) + 1,
                    columns=columns,
                    rows=rows,
                    signs=(a, b, c, d),
                    ratios_x=ratios_x,
                    ratios_y=ratios_y,
                    lines_x=lines_x,
                    lines_y=lines_y,
                )
            )
    return tuple(parts)


def _groups(along: Floats) -> list[tuple[int, ...]]:
    """Columns (or rows) of equal signs, in the order of their first."""
    groups: dict[tuple[int, ...], list[int]] = {}
    for k, signs in enumerate(signal_matrix(along).tolist()):
        groups.setdefault(tuple(signs), []).append(k)
    return [tuple(group) for group in groups.values()]


def _ratios(along: Floats) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Ratios of one zone's columns (or rows), and the lines between them."""
    ratio = along[:, 0] / along[:, 1]
    rising = np.unique(ratio.round(_DIGITS))
    return tuple(ratio.tolist()), tuple(((rising[1:] + rising[:-1]) / 2).tolist())
