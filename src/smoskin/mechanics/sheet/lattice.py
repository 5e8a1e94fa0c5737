"""The folded sheet as bars, hinges and springs: what the nonlinear model is made of.

A panel is four bars on its edges, one on its shorter diagonal and a hinge about that diagonal; a
crease is a hinge between two panels; a column is a beam from a bottom vertex to the board, and the
frame stops those of the rim, a corner's on both sides. This module decides how stiff each is and
where the frame meets it, and hides how the mesh is numbered.
"""

from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.materials import ELASTOMERS, FILMS
from smoskin.design.skin import Creases, MiuraCell, Panels, SkinDesign
from smoskin.errors import DesignError
from smoskin.mechanics import beam
from smoskin.mechanics.beam import Beam, prop
from smoskin.origami.geometry import geometry
from smoskin.origami.sheet import Sheet

BOND_STRENGTH: Final = 20e3
"""Pa: pull at which a column leaves its base. Assumed: silicone poured on to a primed face peels
at some tens of kilopascals, far below the megapascal at which the rubber itself tears."""
_ROUNDING = 0.05
"""Half of the sway over which a stop's force sets in, over the free sway."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Springs:
    """Stiffness of each kind of part; each number scales a kind of element.

    It raises a `DesignError` if a stiffness is negative or not finite.
    """

    column_lateral: float
    """N/m: stiffness of one column against sway, without load."""
    column_axial: float
    """N/m: stiffness of one column along z."""
    stop: float
    """N/m: stiffness that the frame adds to a rim column's sway past its free one."""
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
class Supports:
    """Columns as beams, each with its own height and stiffness."""

    feet: Ints
    """(C,): nodes on their tops."""
    lateral: Floats
    """(C,), N/m: stiffness against sway without load."""
    axial: Floats
    """(C,), N/m: stiffness along the axis."""
    height: Floats
    """(C,), m: free height."""
    shear_share: Floats
    """(C,): EI / (G A_s h^2)."""
    axes: Floats
    """(C, 3, 3): local axes at their tops, in columns; they stand along the last one."""

    @property
    def unit(self) -> Floats:
        """EI / h^3 of each column, (C,), N/m."""
        return np.asarray(self.lateral / beam.unloaded(self.shear_share))

    @property
    def buckling_load(self) -> Floats:
        """Compression at which each column buckles between its clamped ends, (C,), N."""
        loads = self.unit * self.height * beam.buckling(self.shear_share)
        # Where a magnet stands in place of a column nothing can buckle.
        return np.where(self.axial > 0, loads, np.inf)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stops:
    """Places where the frame stops columns, S of them."""

    nodes: Ints
    """(S,): nodes on the columns' tops."""
    normal: Floats
    """(S, 3): outward from the rim."""
    stiffness: Floats
    """(S,), N/m: what a stop adds to the stiffness against sway."""
    free: Floats
    """(S,), m: sway of the top at which the column meets the frame."""
    rounding: Floats
    """(S,), m: half of the sway over which its force sets in."""
    lever: Floats
    """(S,): deflection where it is held over the sway of the top."""
    places: Floats
    """(S, 3), m: points where the columns are held."""
    on_base: bool
    """The frame stands on the base, so that the board's motion counts too."""


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
    crease_set: Floats
    """(H - P,): share of its fold that each crease keeps unloaded, 1 where it is at rest so."""
    supports: Supports
    """Columns from nodes to the board."""
    stops: Stops
    """The frame's stops of rim columns."""
    loaded: Ints
    """(N, M): node of each cell's top vertex."""
    loaded_axes: Floats
    """(N M, 3, 3): local axes there, in columns: along x, along y and outward. A touch's force on
    a vertex, and what it holds, are along them."""
    bond_limit: float
    """N: pull at which a column leaves its base."""

    @property
    def feet(self) -> Ints:
        """Nodes that stand on columns, (C,)."""
        return self.supports.feet

    def at_tops(self, motion: Floats) -> Floats:
        """Motions (V, 3, ...) at the top vertices along their local axes, (N M, 3, ...)."""
        there = motion[self.loaded.ravel()]
        return np.asarray(np.einsum("tij,ti...->tj...", self.loaded_axes, there))

    def sunk(self, motion: Floats) -> Floats:
        """How far columns' tops have sunk along their axes, (..., C), of motions (..., V, 3)."""
        return np.asarray(-(motion[..., self.feet, :] * self.supports.axes[..., 2]).sum(axis=-1))


def springs_of(design: SkinDesign) -> Springs:
    """Stiffness of each kind of part of a design.

    Notes
    -----
    Source: SI Eq. (S16) for creases, `smoskin.mechanics.beam` for columns and stops,
    `bending_stiffness` for panels.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> springs = springs_of(read_design("planar"))
    >>> round(springs.column_lateral, 2), round(springs.column_axial, 2)
    (31.2, 230.07)
    """
    column = column_beam(design)
    place = design.frame.held_height / design.columns.height
    bending = bending_stiffness(design.cell, design.panels)
    return Springs(
        column_lateral=column.lateral,
        column_axial=column.axial,
        stop=prop(column.lateral, column.shear_share, place).stiffness,
        crease=crease_stiffness(design.creases),
        panel_bending=bending * shifting_factor(design),
        panel_membrane=FILMS[design.panels.material].young_modulus * design.panels.thickness,
    )


def column_beam(design: SkinDesign) -> Beam:
    """One column as a beam."""
    columns = design.columns
    modulus = ELASTOMERS[columns.material].shear_modulus
    return beam.beam(columns.radius, columns.height, modulus)


def swaying_stiffness(design: SkinDesign) -> float:
    """Stiffness of the whole sheet against sliding over the board, unloaded and off the stops, N/m.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> round(swaying_stiffness(read_design("planar")))
    2839
    """
    n, m = design.cells
    return (2 * n + 1) * (m + 1) * column_beam(design).lateral


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
    times `shear_stiffness` over A^2, times the panels' `bonding`.

    Notes
    -----
    Source: SI Eq. (S25), which only names it; Kirchhoff's plate with a uniform twist.
    Valid for deflections below the panel's thickness.
    """
    solid = panels.thickness**2 / 3 * shear_stiffness(cell, panels) / _area(cell) ** 2
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
    cell, skin = design.cell, geometry(design)
    sheet = skin.sheet
    diagonals = _panel_hinges(sheet)
    bars, bar_stiffness = _bars(sheet, diagonals, cell, design.panels)
    creases = _crease_hinges(sheet, diagonals)
    bending = np.full(len(diagonals), springs.panel_bending)
    columns = sheet.columns.size
    # A magnet in place of a column hangs on the sheet alone.
    there = np.ones(columns)
    for magnet, place in zip(design.magnets, skin.magnets, strict=True):
        if magnet.mount == "sheet" and magnet.driver == "vertex":
            there[nearest_foot(design, place)] = 0.0
    supports = Supports(
        feet=sheet.columns.ravel(),
        lateral=there * springs.column_lateral,
        axial=there * springs.column_axial,
        height=np.full(columns, design.columns.height),
        shear_share=np.full(columns, column_beam(design).shear_share),
        axes=skin.axes[sheet.columns.ravel()],
    )
    return Lattice(
        nodes=sheet.vertices,
        bars=bars,
        bar_stiffness=springs.panel_membrane * bar_stiffness,
        hinges=np.concatenate([diagonals, creases]),
        hinge_stiffness=np.append(bending, springs.crease * _lengths(sheet, creases[:, :2])),
        panel_hinges=len(diagonals),
        crease_set=np.full(len(creases), design.creases.set_fraction),
        supports=supports,
        stops=build_stops(design, springs.stop),
        loaded=sheet.loaded,
        loaded_axes=skin.axes[sheet.loaded.ravel()],
        bond_limit=BOND_STRENGTH * np.pi * design.columns.radius**2,
    )


def nearest_foot(design: SkinDesign, place: Floats) -> int:
    """Place among the columns, all rows in one, of that whose vertex is nearest to a magnet."""
    sheet = geometry(design).sheet
    apart = np.linalg.norm(sheet.vertices[sheet.columns.ravel()] - place, axis=1)
    return int(apart.argmin())


def build_stops(design: SkinDesign, stiffness: float) -> Stops:
    """Stops of a design's frame, as stiff at the columns' tops as given, N/m.

    Notes
    -----
    Source: `smoskin.mechanics.beam.prop`, a rigid frame. A column's load is left out of it.
    """
    frame, columns, skin = design.frame, design.columns, geometry(design)
    rows = skin.sheet.columns
    sides = [(rows[0], 0, -1.0), (rows[-1], 0, 1.0), (rows[:, 0], 1, -1.0), (rows[:, -1], 1, 1.0)]
    nodes = np.concatenate([line for line, _, _ in sides])
    normal = np.concatenate([sign * skin.axes[line][:, :, axis] for line, axis, sign in sides])
    own = column_beam(design)
    held = prop(own.lateral, own.shear_share, frame.held_height / columns.height)
    free = np.full(len(nodes), frame.clearance / held.lever)
    down = frame.held_height - columns.height
    places = skin.sheet.vertices[nodes] + down * skin.axes[nodes][:, :, 2]
    return Stops(
        nodes=nodes,
        normal=normal,
        stiffness=np.full(len(nodes), stiffness),
        free=free,
        rounding=_ROUNDING * free,
        lever=np.full(len(nodes), held.lever),
        places=places,
        on_base=frame.stands_on == "base",
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


def _lengths(sheet: Sheet, pairs: Ints) -> Floats:
    """Distance between the nodes of each pair."""
    ends = sheet.vertices[pairs]
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1))


def _area(cell: MiuraCell) -> float:
    """Area of one panel, m^2."""
    return float(cell.panel_a * cell.panel_b * np.sin(cell.sector_angle))
