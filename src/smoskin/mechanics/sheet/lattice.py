"""The folded sheet as bars, hinges and springs: what the nonlinear model is made of.

A panel is four bars on its edges, one on its shorter diagonal and a hinge about that diagonal; a
crease is a hinge between two panels; a column is three springs from a bottom vertex to the board,
and the frame stiffens those of the rim in the plane. This module decides how stiff each is, and
hides how the mesh is numbered.
"""

from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.materials import ELASTOMERS, FILMS
from smoskin.design.skin import Columns, Creases, MiuraCell, Panels, SkinDesign
from smoskin.errors import DesignError
from smoskin.mechanics.reduced.stiffness import column_stiffness, pillar_stiffness
from smoskin.origami.geometry import geometry
from smoskin.origami.sheet import Sheet

BOND_STRENGTH: Final = 20e3
"""Pa: pull at which a column leaves its base. Assumed: silicone poured on to a primed face peels
at some tens of kilopascals, far below the megapascal at which the rubber itself tears."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Springs:
    """Stiffness of each kind of part; each number scales a kind of element.

    It raises a `DesignError` if a stiffness is negative or not finite.
    """

    column_shear: float
    """N/m: k_bc, stiffness of one column in the plane."""
    column_axial: float
    """N/m: stiffness of one column along z."""
    frame: float
    """N/m: stiffness that the frame adds in the plane to each rim column."""
    crease: float
    """N: moment per length and angle of a crease."""
    panel_bending: float
    """N m/rad: stiffness of a panel about its shorter diagonal."""
    panel_membrane: float
    """N/m: E t of a panel; its bars follow from it."""

    def __post_init__(self) -> None:
        for part in fields(self):
            value = getattr(self, part.name)
            if not (np.isfinite(value) and value >= 0.0):
                raise DesignError(f"springs.{part.name} must be finite and >= 0; got {value}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lattice:
    """Nodes, bars, hinges and springs to the board, each with its stiffness at rest."""

    nodes: Floats
    """(V, 3), m: the sheet's vertices at rest."""
    bars: Ints
    """(E, 2): nodes at the ends."""
    bar_stiffness: Floats
    """(E,), N/m: EA / L."""
    hinges: Ints
    """(H, 4): both nodes of the axis, then the wing on either side."""
    hinge_stiffness: Floats
    """(H,), N m/rad."""
    panel_hinges: int
    """The first so many hinges lie within panels; the others are creases."""
    ground: Floats
    """(V, 3), N/m: springs to the board along x, y and z; 0 where there is none."""
    frame: Floats
    """(V,), N/m: the frame's part of the springs along x and y."""
    loaded: Ints
    """(N, M): node of each cell's top vertex."""
    feet: Ints
    """(C,): nodes that stand on columns."""
    bond_limit: float
    """N: pull at which a column leaves its base."""
    stroke: float
    """m: the columns' height; no foot can sink so far."""


def springs_of(design: SkinDesign) -> Springs:
    """Stiffness of each kind of part of a design.

    Notes
    -----
    Source: SI Eqs. (S16) and (S21) for creases and columns in shear; `axial_stiffness` and
    `bending_stiffness` for the others.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> springs = springs_of(read_design("planar"))
    >>> round(springs.column_shear, 2), round(springs.column_axial, 2)
    (17.67, 53.61)
    """
    return Springs(
        column_shear=column_stiffness(design),
        column_axial=axial_stiffness(design.columns),
        frame=design.frame.stiffness,
        crease=crease_stiffness(design.creases),
        panel_bending=bending_stiffness(design.cell, design.panels),
        panel_membrane=FILMS[design.panels.material].young_modulus * design.panels.thickness,
    )


def axial_stiffness(columns: Columns) -> float:
    """Stiffness of one column along its axis, N/m.

    Notes
    -----
    Source: a rubber cylinder bonded at both ends, E A (1 + 2 S^2) / h with E = 3 G and the shape
    factor S = r / (2 h). Valid for strains up to some tenths, short of buckling.
    """
    modulus = ELASTOMERS[columns.material].shear_modulus
    shape = columns.radius / (2 * columns.height)
    return 3 * (1 + 2 * shape**2) * pillar_stiffness(columns.radius, columns.height, modulus)


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
    return twist_stiffness(cell, panels) * (_area(cell) / diagonal) ** 2


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
    times `shear_stiffness` over A^2.

    Notes
    -----
    Source: SI Eq. (S25), which only names it; Kirchhoff's plate with a uniform twist.
    Valid for deflections below the panel's thickness.
    """
    return panels.thickness**2 / 3 * shear_stiffness(cell, panels) / _area(cell) ** 2


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
    return membrane * shape * _area(cell)


def build_lattice(design: SkinDesign, springs: Springs | None = None) -> Lattice:
    """Lattice of a design, or of its shape with other springs than `springs_of(design)`.

    Notes
    -----
    Source: SI Eq. (S25), K_p, for the panels. An edge takes half of the plate on either side, so
    that a panel pulled along an edge is as stiff as its plate; the diagonal takes what shearing
    the panel costs, `shear_stiffness`.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> lattice = build_lattice(read_design("planar"))
    >>> lattice.nodes.shape, lattice.bars.shape, lattice.hinges.shape
    ((169, 3), (456, 2), (408, 4))
    """
    springs = springs or springs_of(design)
    cell, sheet = design.cell, geometry(design).sheet
    diagonals = _panel_hinges(sheet)
    bars, bar_stiffness = _bars(sheet, diagonals, cell, design.panels)
    creases = _crease_hinges(sheet, diagonals)
    bending = np.full(len(diagonals), springs.panel_bending)
    ground, frame = _ground(sheet, springs)
    return Lattice(
        nodes=sheet.vertices,
        bars=bars,
        bar_stiffness=springs.panel_membrane * bar_stiffness,
        hinges=np.concatenate([diagonals, creases]),
        hinge_stiffness=np.append(bending, springs.crease * _lengths(sheet, creases[:, :2])),
        panel_hinges=len(diagonals),
        ground=ground,
        frame=frame,
        loaded=sheet.loaded,
        feet=sheet.columns.ravel(),
        bond_limit=BOND_STRENGTH * np.pi * design.columns.radius**2,
        stroke=design.columns.height,
    )


def _panel_hinges(sheet: Sheet) -> Ints:
    """Each panel's shorter diagonal and the two corners beside it, (F, 4)."""
    p, q, r, s = sheet.facets.T
    first, second = sheet.facets[:, [0, 2]], sheet.facets[:, [1, 3]]
    is_first = _lengths(sheet, first) < _lengths(sheet, second)
    along_first = np.stack([p, r, s, q], axis=-1)
    along_second = np.stack([q, s, p, r], axis=-1)
    return np.where(is_first[:, None], along_first, along_second)


def _bars(sheet: Sheet, diagonals: Ints, cell: MiuraCell, panels: Panels) -> tuple[Ints, Floats]:
    """Every edge once and every diagonal, with EA / L over E t."""
    area = _area(cell)
    edges = np.concatenate([sheet.facets[:, [k, (k + 1) % 4]] for k in range(4)])
    bars, panels_beside = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    lengths = _lengths(sheet, bars)
    # Half a plate of E t times its width, area / L, for each panel that has this edge.
    of_edges = panels_beside * area / (2 * lengths**2)
    diagonal = _lengths(sheet, diagonals[:, :2])
    membrane = FILMS[panels.material].young_modulus * panels.thickness
    of_diagonals = shear_stiffness(cell, panels) / membrane * (diagonal / area) ** 2
    return np.concatenate([bars, diagonals[:, :2]]), np.append(of_edges, of_diagonals)


def _crease_hinges(sheet: Sheet, diagonals: Ints) -> Ints:
    """Each crease and the far corner of the triangle on either side, (C, 4)."""
    far: dict[tuple[int, int], list[int]] = {}
    for start, end, one, other in diagonals.tolist():
        for wing in (one, other):
            for near, beyond in ((start, end), (end, start)):
                far.setdefault((min(near, wing), max(near, wing)), []).append(beyond)
    return np.array(
        [[p, q, *far[min(p, q), max(p, q)]] for p, q in sheet.creases.tolist()], dtype=np.int64
    ).reshape(-1, 4)


def _ground(sheet: Sheet, springs: Springs) -> tuple[Floats, Floats]:
    """Springs from the columns to the board, (V, 3), and the frame's part of them, (V,)."""
    ground, frame = np.zeros_like(sheet.vertices), np.zeros(len(sheet.vertices))
    ground[sheet.columns] = [springs.column_shear, springs.column_shear, springs.column_axial]
    rim = np.ones(sheet.columns.shape, dtype=bool)
    rim[1:-1, 1:-1] = False
    frame[sheet.columns[rim]] = springs.frame
    ground[:, :2] += frame[:, None]
    return ground, frame


def _lengths(sheet: Sheet, pairs: Ints) -> Floats:
    """Distance between the nodes of each pair."""
    ends = sheet.vertices[pairs]
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1))


def _area(cell: MiuraCell) -> float:
    """Area of one panel, m^2."""
    return float(cell.panel_a * cell.panel_b * np.sin(cell.sector_angle))
