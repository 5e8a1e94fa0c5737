"""Energy that the panels store where neighbouring cells fold differently.

The SI names this energy (S25) and leaves it out. Here it follows from one assumption: the border
of two cells that would fold differently lies half-way between what each asks of it, and the
panels on both sides are strained to meet it, by a uniform twist out of their planes and a
uniform shear within them. Nothing is strained inside a cell, nor where neighbours fold alike;
that a cell off the diagonal gets a length and a width that no fold has both of (S10) is not
charged to its panels.
"""

from typing import NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.materials import FILMS
from smoskin.design.skin import MiuraCell, Panels
from smoskin.mechanics.reduced.attenuation import FoldFrom
from smoskin.mechanics.reduced.separable import Split, fading_folds, inner_product
from smoskin.origami.cell import dihedral_angles, dihedral_rates, size


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
    turn = np.sin(cell.sector_angle) * np.cos(at_a / 2) / np.cos(cell.fold_angle) / 2
    turn = abs(turn * dihedral_rates(cell).at_a)
    return BorderMisfit(
        twist_x=float(cell.panel_a * lean / 2 * np.sin(at_a / 2)),
        twist_y=float(cell.panel_b * turn / 2 * np.cos(at_b / 2)),
        shear_x=float(lean / 2 * np.cos(at_a / 2)),
        shear_y=float(turn / 2 * np.sin(at_b / 2)),
    )


def twist_stiffness(cell: MiuraCell, panels: Panels) -> float:
    """Force per corner deflection of a panel warped into a hyperbolic paraboloid, N/m.

    Its straight edges stay straight, as the neighbours across the creases want them:
    ``4 D (cot^2 alpha + (1 - nu)/2) / A`` with ``D = E t^3 / (12 (1 - nu^2))``.

    Notes
    -----
    Source: SI Eq. (S25), which only names it; Kirchhoff's plate with a uniform twist.
    Valid for deflections below the panel's thickness.
    """
    material = FILMS[panels.material]
    nu = material.poisson_ratio
    bending = material.young_modulus * panels.thickness**3 / (12 * (1 - nu**2))
    return 4 * bending * _shape(cell, nu) / _area(cell)


def shear_stiffness(cell: MiuraCell, panels: Panels) -> float:
    """Moment per change of a panel's corner angle with its edges' lengths kept, N m/rad.

    ``A E t (cot^2 alpha + (1 - nu)/2) / (1 - nu^2)``.

    Notes
    -----
    Source: SI Eq. (S25), which only names it; plane stress with a uniform strain.
    """
    material = FILMS[panels.material]
    nu = material.poisson_ratio
    membrane = material.young_modulus * panels.thickness / (1 - nu**2)
    return membrane * _shape(cell, nu) * _area(cell)


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


def _squared(part: Split) -> Floats:
    """Sum of the squares over the grid."""
    return inner_product(part, part)


def _shape(cell: MiuraCell, poisson_ratio: float) -> float:
    """Shape factor of a parallelogram under a uniform twist or shear along its edges."""
    return float(1 / np.tan(cell.sector_angle) ** 2 + (1 - poisson_ratio) / 2)


def _area(cell: MiuraCell) -> float:
    """Of one panel, m^2."""
    return float(cell.panel_a * cell.panel_b * np.sin(cell.sector_angle))
