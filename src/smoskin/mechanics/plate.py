"""Panels as plates and creases as strips of film: how stiff each is."""

import numpy as np

from smoskin.design.materials import FILMS
from smoskin.design.skin import Creases, MiuraCell, Panels, SkinDesign


def shifting_factor(design: SkinDesign) -> float:
    """Stiffness of a panel's bend with the shift of the film strips round it, over that without.

    A warped panel's edges need not follow their neighbours': over a gap g the free film shifts out
    of the plane. Along an edge the shift grows evenly to the corner's, 12 D L / (3 g^3) for a film
    of D = E t^3 / (12 (1 - nu^2)), in series with `twist_stiffness`.

    Notes
    -----
    Source: clamped strip under a shift of its edges; L the mean edge. An estimate.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from smoskin.design.document import read_design
    >>> design = read_design("planar")
    >>> shifts = replace(design, creases=replace(design.creases, strip_shift=1.0))
    >>> shifting_factor(design), round(shifting_factor(shifts), 2)
    (1.0, 0.01)
    """
    creases, film = design.creases, FILMS[design.creases.material]
    rigidity = film.young_modulus * creases.thickness**3 / (12 * (1 - film.poisson_ratio**2))
    edge = (design.cell.panel_a + design.cell.panel_b) / 2
    shift = 4 * rigidity * edge / creases.gap**3
    twist = twist_stiffness(design.cell, design.panels)
    return shift / (shift + creases.strip_shift * twist)


def bending_stiffness(cell: MiuraCell, panels: Panels) -> float:
    """Moment per angle of a panel bent about its shorter diagonal, N m/rad.

    A corner that leaves the plane of the other three by ``delta`` turns the hinge by
    ``delta D / A``, with D the diagonal and A the panel's area.

    Notes
    -----
    Source: SI Eq. (S25), K_p; the energy of `twist_stiffness`.
    Valid for deflections below the panel's thickness.
    """
    a, b = cell.panel_a, cell.panel_b
    diagonal = float(np.sqrt(a**2 + b**2 - 2 * a * b * np.cos(cell.sector_angle)))
    return twist_stiffness(cell, panels) * (panel_area(cell) / diagonal) ** 2


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


def twist_stiffness(cell: MiuraCell, panels: Panels) -> float:
    """Force per corner deflection of a panel warped into a hyperbolic paraboloid, N/m.

    Its straight edges stay straight, as the neighbours across the creases want them:
    ``4 D (cot^2 alpha + (1 - nu)/2) / A`` with ``D = E t^3 / (12 (1 - nu^2))``, that is t^2 / 3
    times `shear_stiffness` over A^2, times the panels' `bonding`.

    Notes
    -----
    Source: SI Eq. (S25), which only names it; Kirchhoff's plate with a uniform twist.
    Valid for deflections below the panel's thickness.
    """
    solid = panels.thickness**2 / 3 * shear_stiffness(cell, panels) / panel_area(cell) ** 2
    return panels.bonding * solid


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
    shape = float(1 / np.tan(cell.sector_angle) ** 2 + (1 - nu) / 2)
    return membrane * shape * panel_area(cell)


def panel_area(cell: MiuraCell) -> float:
    """Area of one panel, m^2."""
    return float(cell.panel_a * cell.panel_b * np.sin(cell.sector_angle))
