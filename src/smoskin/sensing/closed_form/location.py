"""Which cell is pressed: rules from the magnets' displacements to a column and a row of cells.

Decides by the SI's own rule where two magnets ride on an ideal sheet: their signs name a zone
(Table S1), the ratio of their displacements a column and a row in it (S12, Figure S5). Any other
number of magnets names the column and the row whose displacements point most nearly the same way.
Every rule ignores a common factor, so that the force need not be known.
"""

from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.reduced.attenuation import magnet_displacements, profiles
from smoskin.sensing.closed_form.calibration import Calibration

_AXIS_TURNS: Final = np.array([0.0, 4 * np.pi])
"""Added to the directions of x and y, so that one sorted list of lines serves both."""
_DIGITS: Final = 12
"""Decimals of a direction: columns alike to within rounding are one direction."""
_TINY: Final = 10.0**-_DIGITS


def unit_press(design: SkinDesign, coefficients: Coefficients | None = None) -> Floats:
    """How far each of G watched magnets of the sheet moves for a press on each cell, by theory.

    In x and y per unit of press, (N, M, G, 2), m/m.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> unit_press(read_design("planar"))[0, 0].round(4).tolist()
    [[0.7313, 0.8709], [0.6721, 0.9476]]
    """
    attenuation = (coefficients or design.coefficients).attenuation
    parts = profiles(design.cell, design.cells, attenuation, -1.0)
    watched = [design.magnet(site.magnet) for site in design.halls]
    moved = [magnet_displacements(parts, m.corner) for m in watched if m.mount == "sheet"]
    if not moved:
        raise ArgumentError(
            f"design must have a chip under a magnet of the sheet; {design.name!r} has none"
        )
    return np.stack(moved, axis=2)


def readout(design: SkinDesign, calibration: Calibration) -> Floats:
    """Matrix (3S, 2G + 2) from the chips' motions to a press's motions and the drag.

    It multiplies the motions (..., 3S), m, of a skin with G chips under magnets of the sheet and
    one over a magnet of the base, from the right. The first 2G columns give the x and y of each
    magnet on the sheet as the press alone moves it, m; the last two the drag, N.

    Notes
    -----
    Source: SI Eq. (S26) and Text S5: the drag moves the board by F_p / K_sf and the sheet against
    it by a share that is taken off. Chips are at rest in their own frame; a magnet's motion is the
    reverse of theirs.
    """
    mounts = [design.magnet(site.magnet).mount for site in design.halls]
    lower = mounts.index("base")
    upper = [s for s, mount in enumerate(mounts) if mount == "sheet"]
    matrix = np.zeros((len(mounts), 3, 2 * len(upper) + 2))
    for axis in range(2):
        matrix[lower, axis, axis::2] = -calibration.board_stiffness / calibration.sheet_stiffness
        matrix[lower, axis, axis - 2] = calibration.board_stiffness
        for g, s in enumerate(upper):
            matrix[s, axis, 2 * g + axis] = -1.0
    return matrix.reshape(3 * len(mounts), -1)


class Divisions(NamedTuple):
    """How two magnets' displacements along x and y name a column and a row of cells.

    The signs of the two displacements and their ratio are together one direction,
    ``arctan2(first, second)``. Lines on its circle divide the columns, and where the signs
    belong to no column, a sector is nobody's. A second circle divides the rows.
    """

    lines: Floats
    """(K,), rad, ascending: for x in [-pi, pi], for y two turns further."""
    cells: Ints
    """(K + 1,): the column (or row) between the lines, the first of those of one direction; -1
    where there is none."""


class Directions(NamedTuple):
    """Which way the displacements of each column along x, and of each row along y, point."""

    columns: Floats
    """(N, 2G): unit vectors."""
    rows: Floats
    """(M, 2G): unit vectors."""


Rule = Divisions | Directions


def ideal_rule(unit: Floats) -> Rule:
    """The rule for an ideal sheet: the SI's lines for two magnets, else nearest directions.

    In `unit_press`, (N, M, G, 2), what lies along x depends on the column alone, along y on the
    row. One magnet tells by its signs alone.
    """
    return divisions(unit) if unit.shape[2] == 2 else directions(unit)


def directions(unit: Floats) -> Directions:
    """Unit vectors of what each column moves along x, and each row along y."""
    return Directions(_units(unit[:, :1] * (1.0, 0.0)), _units(unit[:1] * (0.0, 1.0)))


def divisions(unit: Floats) -> Divisions:
    """Dividing lines halfway between the ratios that neighbouring columns, and rows, give.

    `unit`, (N, M, 2, 2), are the displacements of `unit_press` of a first and a second magnet. It
    raises an `ArgumentError` if there are not two magnets.

    Notes
    -----
    Source: SI Eq. (S12) and Figure S5: the mean of two neighbours' ratios divides them. Where
    the second magnet stands still and a ratio is infinite, the line is halfway in direction.
    """
    if unit.ndim != 4 or unit.shape[2:] != (2, 2):
        raise ArgumentError(f"unit must have shape (N, M, 2, 2); got {unit.shape}")
    lines, cells = [], [-1]
    for turn, along in zip(_AXIS_TURNS, (unit[:, 0, :, 0], unit[0, :, :, 1]), strict=True):
        direction = np.arctan2(along[:, 0], along[:, 1]).round(_DIGITS)
        direction[direction >= np.pi - _TINY] -= 2 * np.pi
        begin = len(cells)
        for quarter in np.arange(-np.pi, np.pi - 0.1, np.pi / 2):
            past = direction - quarter
            members = np.flatnonzero((past >= -_TINY) & (past < np.pi / 2 - _TINY))
            distinct, first = np.unique(direction[members], return_index=True)
            members = members[first]
            lines += [quarter + turn, *(_between(along[members], distinct) + turn)]
            cells += members.tolist() or [-1]
        # The circle closes: at pi begins what began at -pi.
        lines.append(np.pi + turn)
        cells.append(cells[begin])
    return Divisions(np.array(lines), np.array(cells))


def decide(rule: Rule, displacements: Floats) -> Ints:
    """Cell (n, m) that displacements belong to, shape (..., 2); -1 where no cell gives them.

    The displacements are those of the magnets in x and y, (..., G, 2); a common factor does not
    matter.

    Notes
    -----
    Source: SI Eq. (S12): the signs name a zone (Table S1), the ratios a cell in it.
    """
    if isinstance(rule, Divisions):
        direction = np.arctan2(displacements[..., 0, :], displacements[..., 1, :])
        sector = rule.lines.searchsorted(direction + _AXIS_TURNS, side="right")
        return np.asarray(rule.cells.take(sector))
    flat = displacements.reshape(*displacements.shape[:-2], -1)
    return np.stack([(flat @ units.T).argmax(axis=-1) for units in rule], axis=-1)


def _between(along: Floats, direction: Floats) -> Floats:
    """Directions of the lines between neighbours of one quarter, (C, 2) in, (C - 1,) out."""
    still = np.abs(along[:, 1]) < _TINY * np.abs(along[:, 0])
    second = np.where(still, 1.0, along[:, 1])
    ratio, side = along[:, 0] / second, np.sign(second)
    lines = np.arctan2(side[1:] * (ratio[1:] + ratio[:-1]) / 2, side[1:])
    halfway = (direction[1:] + direction[:-1]) / 2
    return np.where(still[1:] | still[:-1], halfway, lines)


def _units(displacements: Floats) -> Floats:
    """Directions of (..., G, 2) as unit vectors (R, 2G); nothing that moves has none."""
    flat = displacements.reshape(-1, displacements.shape[-2] * 2)
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    # Rounded, so that cells of one direction tie exactly and the first of them is named.
    return np.asarray((flat / np.where(length > 0, length, 1.0)).round(_DIGITS))
