"""Geometry of one rigid-foldable Miura-ori cell: size, fold angle, dihedrals, Poisson's ratios.

One degree of freedom, the fold angle phi, decides everything here; the dihedral angles are
interior ones (pi is flat), phi_1 at the a-creases and phi_2 at the b-creases.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats
from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError


class CellSize(NamedTuple):
    """Extent of a cell, m."""

    length: Floats
    """l, along x."""
    width: Floats
    """w, along y."""
    height: Floats
    """h, along z."""


class PoissonRatios(NamedTuple):
    """Ratios of the cell's relative size changes, sign reversed; no unit."""

    nu_12: Floats
    """-(dl/l) / (dw/w)."""
    nu_13: Floats
    """-(dl/l) / (dh/h)."""
    nu_23: Floats
    """-(dw/w) / (dh/h)."""


class DihedralAngles(NamedTuple):
    """Interior angles between neighbouring panels, rad; pi is flat."""

    at_a: Floats
    """phi_1, at the a-creases."""
    at_b: Floats
    """phi_2, at the b-creases."""


def size(cell: MiuraCell, fold_angle: ArrayLike | None = None) -> CellSize:
    """Length, width and height of the cell at a fold angle.

    Parameters
    ----------
    cell : MiuraCell
    fold_angle : array_like, optional
        phi, rad, in (0, alpha]; the cell's own by default. Its shape is that of the answers.

    Notes
    -----
    Source: SI Eq. (S1).

    Examples
    --------
    >>> from math import radians
    >>> cell = MiuraCell(panel_a=0.01, panel_b=0.01,
    ...                  sector_angle=radians(60), fold_angle=radians(45))
    >>> [round(float(x) * 1e3, 4) for x in size(cell)]
    [14.1421, 14.1421, 7.0711]
    """
    phi = _phi(cell, fold_angle)
    a, b, alpha = cell.panel_a, cell.panel_b, cell.sector_angle
    return CellSize(
        length=2 * b * np.sin(phi),
        width=2 * a * np.cos(alpha) / np.cos(phi),
        height=a * np.sqrt(np.maximum(np.sin(alpha) ** 2 - np.sin(phi) ** 2, 0)) / np.cos(phi),
    )


def fold_angle(
    cell: MiuraCell,
    *,
    length: ArrayLike | None = None,
    width: ArrayLike | None = None,
    height: ArrayLike | None = None,
) -> Floats:
    """Fold angle at which the cell has the one extent that is given, rad.

    It raises an `ArgumentError` if not exactly one extent is given, or the cell cannot have it.

    Notes
    -----
    Source: inverse of SI Eq. (S1); cos(phi) = a cos(alpha) / sqrt(a^2 - h^2).
    """
    extents = {"length": length, "width": width, "height": height}
    given = [(name, floats(name, value)) for name, value in extents.items() if value is not None]
    if len(given) != 1:
        raise ArgumentError(
            f"exactly one of length, width and height must be given; got {len(given)}"
        )
    [(name, value)] = given
    a, b, alpha = cell.panel_a, cell.panel_b, cell.sector_angle
    least, most = {
        "length": (0.0, 2 * b * np.sin(alpha)),
        "width": (2 * a * np.cos(alpha), 2 * a),
        "height": (0.0, a * np.sin(alpha)),
    }[name]
    slack = 1e-12 * most
    if not np.all((value >= least - slack) & (value <= most + slack)):
        raise ArgumentError(
            f"{name} must lie in [{least * 1e3:.4g}, {most * 1e3:.4g}] mm for this cell; "
            f"got {value * 1e3} mm"
        )
    value = np.clip(value, least, most)
    if name == "length":
        return np.asarray(np.arcsin(value / (2 * b)))
    half_width = value / 2 if name == "width" else np.sqrt(a**2 - value**2)
    return np.asarray(np.arccos(np.minimum(a * np.cos(alpha) / half_width, 1)))


def poisson_ratios(cell: MiuraCell, fold_angle: ArrayLike | None = None) -> PoissonRatios:
    """Poisson's ratios of the cell at a fold angle.

    Notes
    -----
    Source: SI Eq. (S2), erratum E1: nu_12 is -cot^2(phi), printed -cos^2(phi).

    Examples
    --------
    >>> from math import radians
    >>> cell = MiuraCell(panel_a=0.01, panel_b=0.01,
    ...                  sector_angle=radians(60), fold_angle=radians(45))
    >>> [round(float(x), 12) for x in poisson_ratios(cell)]
    [-1.0, 1.0, 1.0]
    """
    phi = _phi(cell, fold_angle)
    alpha = cell.sector_angle
    nu_23 = (np.sin(alpha) ** 2 - np.sin(phi) ** 2) / np.cos(alpha) ** 2
    cot2 = 1 / np.tan(phi) ** 2
    return PoissonRatios(nu_12=-cot2, nu_13=cot2 * nu_23, nu_23=nu_23)


def dihedral_angles(cell: MiuraCell, fold_angle: ArrayLike | None = None) -> DihedralAngles:
    """Interior dihedral angles at a fold angle.

    Notes
    -----
    Source: SI Eqs. (S13) and (S14): sin(phi) = sin(alpha) sin(phi_1/2) and
    h = a sin(alpha) cos(phi_2/2).
    """
    phi = _phi(cell, fold_angle)
    alpha = cell.sector_angle
    height = size(cell, phi).height
    return DihedralAngles(
        at_a=2 * np.arcsin(np.minimum(np.sin(phi) / np.sin(alpha), 1)),
        at_b=2 * np.arccos(np.minimum(height / (cell.panel_a * np.sin(alpha)), 1)),
    )


def _phi(cell: MiuraCell, fold_angle: ArrayLike | None) -> Floats:
    """The fold angle asked for, checked."""
    if fold_angle is None:
        return np.asarray(cell.fold_angle)
    phi = floats("fold_angle", fold_angle)
    if not np.all((phi > 0) & (phi <= cell.sector_angle)):
        raise ArgumentError(
            f"fold_angle must lie in (0, alpha] = (0, {cell.sector_angle:.4g}] rad; got {phi}"
        )
    return phi
