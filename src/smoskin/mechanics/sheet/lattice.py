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
from smoskin.design.skin import MiuraCell, Panels, SkinDesign
from smoskin.errors import DesignError
from smoskin.mechanics import beam
from smoskin.mechanics.beam import Beam, Prop, prop
from smoskin.mechanics.plate import (
    bending_stiffness,
    crease_stiffness,
    panel_area,
    shear_stiffness,
    shifting_factor,
)
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import SCALE_BOSS
from smoskin.origami.sheet import Sheet

BOND_STRENGTH: Final = 20e3
"""Pa: pull at which a column leaves its base. Assumed: silicone poured on to a primed face peels
at some tens of kilopascals, far below the megapascal at which the rubber itself tears."""
FOLDED_RUBBER: Final = 0.35
"""Moment per angle, over G r^3, of rubber bonded over a radius r across a fold: by finite elements
of cylinders two to six radii high whose height is free; 0.26 to 0.43 of a scale's patch."""
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
    `smoskin.mechanics.plate` for panels.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> springs = springs_of(read_design("planar"))
    >>> round(springs.column_lateral, 2), round(springs.column_axial, 2)
    (31.2, 230.07)
    """
    column = column_beam(design)
    bending = bending_stiffness(design.cell, design.panels)
    return Springs(
        column_lateral=column.lateral,
        column_axial=column.axial,
        stop=_held(design).stiffness,
        crease=crease_stiffness(design.creases),
        panel_bending=bending * shifting_factor(design),
        panel_membrane=FILMS[design.panels.material].young_modulus * design.panels.thickness,
    )


def column_beam(design: SkinDesign, *, rim: bool = False) -> Beam:
    """One column as a beam; on the rim it may be free over a share of its height alone."""
    columns = design.columns
    modulus = ELASTOMERS[columns.material].shear_modulus
    free = columns.rim_share if rim else 1.0
    return beam.beam(columns.radius, free * columns.height, modulus)


def _held(design: SkinDesign) -> Prop:
    """The frame as a support of the rim's columns."""
    own, columns = column_beam(design, rim=True), design.columns
    free = columns.rim_share * columns.height
    place = 1 - (columns.height - design.frame.held_height) / free
    return prop(own.lateral, own.shear_share, place)


def swaying_stiffness(design: SkinDesign) -> float:
    """Stiffness of the whole sheet against sliding over the board, unloaded and off the stops, N/m.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> round(swaying_stiffness(read_design("planar")))
    2839
    """
    n, m = design.cells
    inner = (2 * n - 1) * (m - 1)
    rim = (2 * n + 1) * (m + 1) - inner
    return inner * column_beam(design).lateral + rim * column_beam(design, rim=True).lateral


def build_lattice(design: SkinDesign, springs: Springs | None = None) -> Lattice:
    """Lattice of a design, or of its shape with other springs than `springs_of(design)`.

    Notes
    -----
    Source: SI Eq. (S25), K_p, for the panels. An edge takes half of the plate on either side, so
    that a panel pulled along an edge is as stiff as its plate; the diagonal takes what shearing
    the panel costs, `smoskin.mechanics.plate.shear_stiffness`.

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
    columns, free = sheet.columns.size, np.ones(sheet.columns.shape)
    free[[0, -1]] = free[:, [0, -1]] = design.columns.rim_share
    on_rim, usual, rim = free.ravel() < 1.0, column_beam(design), column_beam(design, rim=True)
    # A magnet in place of a column hangs on the sheet alone.
    there = np.ones(columns)
    for magnet, place in zip(design.magnets, skin.magnets, strict=True):
        if magnet.mount == "sheet" and magnet.driver == "vertex":
            there[nearest_foot(design, place)] = 0.0
    supports = Supports(
        feet=sheet.columns.ravel(),
        lateral=there * springs.column_lateral * np.where(on_rim, rim.lateral / usual.lateral, 1.0),
        axial=there * springs.column_axial * np.where(on_rim, rim.axial / usual.axial, 1.0),
        height=free.ravel() * design.columns.height,
        shear_share=np.where(on_rim, rim.shear_share, usual.shear_share),
        axes=skin.axes[sheet.columns.ravel()],
    )
    return Lattice(
        nodes=sheet.vertices,
        bars=bars,
        bar_stiffness=springs.panel_membrane * bar_stiffness,
        hinges=np.concatenate([diagonals, creases]),
        hinge_stiffness=_hinge_stiffness(design, springs, creases[:, :2]),
        panel_hinges=len(diagonals),
        crease_set=np.full(len(creases), design.creases.set_fraction),
        supports=supports,
        stops=build_stops(design, springs.stop),
        loaded=sheet.loaded,
        loaded_axes=skin.axes[sheet.loaded.ravel()],
        bond_limit=BOND_STRENGTH * np.pi * design.columns.radius**2,
    )


def _hinge_stiffness(design: SkinDesign, springs: Springs, creases: Ints) -> Floats:
    """Stiffness of the panels' bends, then of creases between two nodes each, N m/rad.

    A hole of radius rho round an inner vertex takes rho of every crease there and, as a panel's
    twist is even, its area's share of the bending. Rubber on a vertex resists two folds of
    creases through it, `FOLDED_RUBBER` each, half at either crease's end: columns below, and a
    scale's patch on the loaded vertices.
    """
    sheet, parts, hole = geometry(design).sheet, design.creases, design.creases.vertex_hole
    inner = np.bincount(sheet.facets.ravel(), minlength=len(sheet.vertices)) == 4
    area = np.pi * hole**2 / panel_area(design.cell)
    bending = springs.panel_bending * (1 - inner[sheet.facets].mean(axis=1) * area)
    radius = np.zeros(len(sheet.vertices))
    radius[sheet.columns.ravel()] = design.columns.radius
    radius[sheet.loaded.ravel()] = SCALE_BOSS
    modulus = ELASTOMERS[design.columns.material].shear_modulus
    rubber = parts.vertex_rubber * FOLDED_RUBBER * modulus * radius**3 / 2
    length = _lengths(sheet, creases) - hole * inner[creases].sum(axis=1)
    return np.append(bending, springs.crease * length + rubber[creases].sum(axis=1))


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
    frame, skin, held = design.frame, geometry(design), _held(design)
    rows = skin.sheet.columns
    sides = [(rows[0], 0, -1.0), (rows[-1], 0, 1.0), (rows[:, 0], 1, -1.0), (rows[:, -1], 1, 1.0)]
    nodes = np.concatenate([line for line, _, _ in sides])
    normal = np.concatenate([sign * skin.axes[line][:, :, axis] for line, axis, sign in sides])
    free = np.full(len(nodes), frame.clearance / held.lever)
    down = frame.held_height - design.columns.height
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
    area = panel_area(cell)
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
    for start, end, left, right in diagonals.tolist():
        for wing in (left, right):
            for near, beyond in ((start, end), (end, start)):
                far.setdefault((min(near, wing), max(near, wing)), []).append(beyond)
    return np.array(
        [[p, q, *far[min(p, q), max(p, q)]] for p, q in sheet.creases.tolist()], dtype=np.int64
    ).reshape(-1, 4)


def _lengths(sheet: Sheet, pairs: Ints) -> Floats:
    """Distance between the nodes of each pair."""
    ends = sheet.vertices[pairs]
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1))
