"""Places of everything of a skin at rest, in the skin's frame: computed once for a design.

Decides the heights of magnets and chips. Places on a skin are told on its developed surface, on
which the bottom vertices lie: x along the limb's axis, y along the arc, and the height over it; on
a cone x along a generator, and y the arc in the middle of x. The board's upper face lies a column's
height below. A magnet on the sheet hangs above its chip on the board's upper face; a magnet on the
base lies below its chip on the lower face. One in place of a column stands under the bottom vertex
next to its corner. The skin's frame is that of the developed surface in the middle of the skin, and
everywhere on a planar one.
"""

import math
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, freeze
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.errors import DesignError
from smoskin.origami.cell import CellSize, size
from smoskin.origami.sheet import Sheet, build_sheet
from smoskin.origami.tessellation.arc import zigzag_angles

if TYPE_CHECKING:
    from smoskin.origami.surface.analytic import Cone, Cylinder, Plane

_DESIGNS = 64
"""Designs whose geometry is kept."""
_STEEPEST = 0.5
"""Most that a cone's radius grows along a generator: an angle of 30 degrees at the apex."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Roll:
    """How the developed surface lies in the skin's frame: rolled about an axis along x.

    Round a cone the axis leans towards the surface as x grows, and the radius grows.
    """

    curvature: float
    """1/m: of the surface round x in its middle; positive where its centre is below."""
    middle: float
    """m: the y at which the skin's frame touches it."""
    along: float = 0.0
    """m: the x at which it does."""
    rise: float = 0.0
    """Growth of a cone's radius along a generator, the sine of the angle at its apex."""

    def places(self, developed: ArrayLike) -> Floats:
        r"""Places in the skin's frame of developed ones, both (..., 3), m.

        Notes
        -----
        With :math:`\psi = \kappa\,(y - y_0)`, :math:`s = x - x_0`, a cone's
        :math:`\sin\gamma` and :math:`w = s \sin\gamma + z \cos\gamma`,

        .. math:: d = (1/\kappa + w)(1 - \cos\psi), \qquad
            (x - d \sin\gamma,\; y_0 + (1/\kappa + w) \sin\psi,\; z - d \cos\gamma),

        written so that it holds for every curvature.
        """
        x, y, z = np.moveaxis(np.asarray(developed, dtype=np.float64), -1, 0)
        away, rise, fall = y - self.middle, self.rise, self._fall
        angle = self.curvature * away
        # sin(psi) / psi of the whole and of half the angle.
        whole, half = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi))
        wider, cosine = rise * (x - self.along), np.cos(angle)
        drop = away * (angle * half**2 / 2)
        across = y + away * (whole - 1.0) + (wider + fall * z) * np.sin(angle)
        lower = drop + wider * (1.0 - cosine)
        height = z * (rise**2 + fall**2 * cosine) - fall * lower
        return np.stack([x - rise * (lower + fall * z * (1.0 - cosine)), across, height], axis=-1)

    def developed(self, places: ArrayLike) -> Floats:
        """Developed places of places in the skin's frame, both (..., 3), m: undoes `places`."""
        x, y, z = np.moveaxis(np.asarray(places, dtype=np.float64), -1, 0)
        if self.curvature == 0.0:
            return np.stack([x, y, z], axis=-1)
        away, rise, fall = y - self.middle, self.rise, self._fall
        wider = rise * (x - self.along)
        below = 1.0 + self.curvature * (wider + fall * z)
        angle = np.arctan2(self.curvature * away, below)
        # Over the radius in the middle, away from the axis.
        height = (np.hypot(self.curvature * away, below) - 1.0) / self.curvature
        return np.stack(
            [
                x + rise * (height - wider - fall * z),
                self.middle + angle / self.curvature,
                fall * height + rise * (rise * z - fall * (x - self.along)),
            ],
            axis=-1,
        )

    def flat(self, developed: ArrayLike, level: float) -> Floats:
        r"""Places (..., 2), m, on a flat layer that lies at a level once it is rolled.

        Lengths on the layer are true at that level; those of developed places are at 0, and on a
        cone in the middle of x.

        Notes
        -----
        On a cone the layer is a sector. With :math:`\varphi = \sin\gamma\,\kappa\,(y - y_0)`
        and :math:`\rho = s + (1/\kappa + z \cos\gamma) / \sin\gamma` from its apex,
        :math:`(x - \rho (1 - \cos\varphi),\; y_0 + \rho \sin\varphi)`.
        """
        x, y = np.moveaxis(np.asarray(developed, dtype=np.float64), -1, 0)
        away, wider = y - self.middle, self.stretch(level, x)
        angle = self.flat_turn(y)
        whole, half = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi))
        back = wider * away * (angle * half**2 / 2)
        return np.stack([x - back, self.middle + away * wider * whole], axis=-1)

    def from_flat(self, flat: ArrayLike, level: float) -> Floats:
        """Developed places of places on a flat layer, both (..., 2), m: undoes `flat`."""
        x, y = np.moveaxis(np.asarray(flat, dtype=np.float64), -1, 0)
        away, longer = y - self.middle, self.stretch(level, self.along)
        sharp = self.rise * self.curvature
        if sharp == 0.0:
            return np.stack([x, self.middle + away / longer], axis=-1)
        reach = longer + sharp * (x - self.along)
        along = self.along + (np.hypot(reach, sharp * away) - longer) / sharp
        return np.stack([along, self.middle + np.arctan2(sharp * away, reach) / sharp], axis=-1)

    def stretch(self, level: float, x: Any) -> Any:
        """True lengths of arcs at a level and such x, over those of developed places."""
        return 1.0 + self.curvature * (self._fall * level + self.rise * (x - self.along))

    def flat_turn(self, y: ArrayLike) -> Floats:
        """Angles, rad, of the generators at such places on a flat layer."""
        away = np.asarray(y, dtype=np.float64) - self.middle
        return np.asarray(self.rise * self.curvature * away)

    @property
    def _fall(self) -> float:
        """Cosine of the angle at the apex."""
        return math.sqrt(1.0 - self.rise**2)

    def axes(self, y: ArrayLike) -> Floats:
        """Local axes at such places: columns along x, along the arc and normal, (..., 3, 3).

        They are the same along a generator.
        """
        angle, rise, fall = (
            self.curvature * (np.asarray(y, dtype=np.float64) - self.middle),
            self.rise,
            self._fall,
        )
        sine, cosine = np.sin(angle), np.cos(angle)
        both = rise * fall * (cosine - 1.0)
        rows = [
            [fall**2 + rise**2 * cosine, -rise * sine, both],
            [rise * sine, cosine, fall * sine],
            [both, -fall * sine, rise**2 + fall**2 * cosine],
        ]
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Geometry:
    """A design at rest; its arrays are read-only."""

    cell: CellSize
    """Extent of one cell, m; of a curved skin along the developed surface."""
    extent: Floats
    """(2,), m: length and width of the sensing area, developed."""
    roll: Roll
    """The developed surface in the skin's frame."""
    sheet: Sheet
    """The folded sheet of all cells."""
    developed: Floats
    """(V, 3), m: its vertices on the developed surface and over it."""
    axes: Floats
    """(V, 3, 3): local axes at the vertices, columns along x, the arc and the normal."""
    tops: Floats
    """(N, M, 2), m: developed place of each cell's loaded vertex."""
    magnets: Floats
    """(G, 3), m: middles of the magnets."""
    magnet_places: Floats
    """(G, 2), m: their developed places."""
    magnet_axes: Floats
    """(G, 3, 3): local axes at the magnets."""
    chips: Floats
    """(S, 3), m: sensing points of the chips."""
    chip_axes: Floats
    """(S, 3, 3): axes at the chips, those of the flat circuit rolled with it: the local ones of the
    magnet that each one watches, on a cone turned about their normal."""
    rest: Floats
    """(S, 3), m: sensing point of each chip as seen from the middle of the magnet that it
    watches, along its local axes; it lies straight below a magnet on the sheet, straight above one
    on the base."""

    def __post_init__(self) -> None:
        places, turns = (None, 3), (None, 3, 3)
        freeze(self, extent=(2,), tops=(None, None, 2), magnets=places, chips=places, rest=places)
        freeze(
            self,
            magnet_places=(None, 2),
            developed=places,
            axes=turns,
            magnet_axes=turns,
            chip_axes=turns,
        )
        for field in fields(self.sheet):
            getattr(self.sheet, field.name).flags.writeable = False

    @property
    def lines(self) -> tuple[Floats, Floats]:
        """Places of the loaded vertices along x, (N,), and along y, (M,), m.

        On a cone, whose rows differ by 0.3 %, they are midway between those at either rim.
        """
        tops = self.tops
        return (tops[:, 0, 0] + tops[:, -1, 0]) / 2, (tops[0, :, 1] + tops[-1, :, 1]) / 2


@lru_cache(maxsize=_DESIGNS)
def geometry(design: SkinDesign) -> Geometry:
    """Geometry of a design at rest.

    It raises a `DesignError` if the limb is so thin that cells cannot follow it or the skin would
    wrap more than half of it.

    Notes
    -----
    A magnet that no chip watches lies as high as one of its mount that is watched, or as the chips
    on its side of the board.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> (geometry(read_design("planar")).extent * 1e3).round(1)
    array([120., 160.])
    """
    cell = size(design.cell)
    pitch = np.array([cell.length, cell.width])
    extent = np.multiply(design.cells, pitch)
    roll = _roll_of(design, extent)
    sheet = build_sheet(design.cell, design.cells)
    developed = _developed(design, sheet) if roll.rise == 0.0 else _on_cone(design, roll)
    sheet = replace(sheet, vertices=roll.places(developed))
    middles = _magnets_middles(design, pitch, developed[sheet.columns.ravel(), :2])
    upper = -design.columns.height + design.board.sensing_height
    lower = -design.columns.height - design.board.thickness - design.board.sensing_height
    chips, rest = np.empty((len(design.halls), 3)), np.zeros((len(design.halls), 3))
    heights = {}
    for s, site in enumerate(design.halls):
        magnet = design.magnet(site.magnet)
        on_sheet = magnet.mount == "sheet"
        reach = site.gap + magnet.height / 2
        chips[s] = *middles[magnet.name], upper if on_sheet else lower
        rest[s, 2] = -reach if on_sheet else reach
        heights[magnet.name] = chips[s, 2] - rest[s, 2]
    by_mount = {"sheet": upper, "base": lower}
    by_mount |= {design.magnet(name).mount: height for name, height in heights.items()}
    magnets = np.array(
        [
            [*middles[magnet.name], heights.get(magnet.name, by_mount[magnet.mount])]
            for magnet in design.magnets
        ]
    )
    return Geometry(
        cell=cell,
        extent=extent,
        roll=roll,
        sheet=sheet,
        developed=developed,
        axes=roll.axes(developed[:, 1]),
        tops=developed[sheet.loaded, :2],
        magnets=roll.places(magnets),
        magnet_places=magnets[:, :2],
        magnet_axes=roll.axes(magnets[:, 1]),
        chips=roll.places(chips),
        chip_axes=_chip_axes(roll, chips[:, 1]),
        rest=rest,
    )


def _chip_axes(roll: Roll, y: Floats) -> Floats:
    """Axes (S, 3, 3) of chips at such places: on a flat circuit they lie parallel."""
    angle = roll.flat_turn(y)
    sine, cosine, none = np.sin(angle), np.cos(angle), np.zeros(len(y))
    rows = [[cosine, sine, none], [-sine, cosine, none], [none, none, none + 1.0]]
    return np.asarray(roll.axes(y) @ np.moveaxis(np.array(rows), (0, 1), (-2, -1)))


def _roll_of(design: SkinDesign, extent: Floats) -> Roll:
    """How a skin of this extent, (2,), m, lies on its limb, if it can."""
    near, far = (0.0, 0.0) if design.limb is None else design.limb.radii
    roll = Roll(
        curvature=design.curvature,
        middle=float(extent[1]) / 2,
        along=float(extent[0]) / 2,
        rise=(far - near) / float(extent[0]),
    )
    if abs(roll.rise) > _STEEPEST:
        raise DesignError(
            f"limb.far_radius must lie within {1e3 * _STEEPEST * extent[0]:.1f} mm of skin_radius, "
            f"{1e3 * near:g} mm; got {1e3 * far:g} mm"
        )
    if (wrap := float(extent[1]) * roll.curvature) > np.pi:
        raise DesignError(
            f"limb.skin_radius must be at least {1e3 * extent[1] / np.pi:.1f} mm, so that the skin "
            f"wraps half of the limb at most; it wraps {np.degrees(wrap):.0f} degrees"
        )
    return roll


def _developed(design: SkinDesign, sheet: Sheet) -> Floats:
    """Vertices on the developed surface, (V, 3), of the planar sheet's.

    On a limb the zigzag of the top rows narrows; they stay half way between the bottom ones.
    """
    places = sheet.vertices.copy()
    if design.curvature == 0.0:
        return places
    n, m = design.cells
    i, j = np.indices((2 * n + 1, 2 * m + 1)).reshape(2, -1)
    radius = 1.0 / design.curvature
    bottom, top = (radius * angle for angle in zigzag_angles(design.cell, radius))
    planar = design.cell.panel_b * np.cos(design.cell.fold_angle)
    zigzag = np.where(j % 2, top, bottom)
    places[:, 1] += (i % 2 == 0) * (zigzag - planar) + (bottom - zigzag) / 2
    return places


def surface_of(design: SkinDesign) -> "Plane | Cylinder | Cone":
    """The surface of a skin's bottom vertices, a cone as long as the skin."""
    from smoskin.origami.surface.analytic import Cone, Cylinder, Plane

    if design.limb is None:
        return Plane()
    if design.limb.far_radius is None:
        return Cylinder(design.limb.skin_radius)
    (near, far), along = design.limb.radii, design.cells[0] * float(size(design.cell).length)
    return Cone(near, far, math.sqrt(along**2 - (far - near) ** 2))


def _on_cone(design: SkinDesign, roll: Roll) -> Floats:
    """Developed vertices, (V, 3), m, of the sheet on a cone, which no closed form gives."""
    plate, column = design.panels.thickness / 2, design.columns.height
    layers = _laid_on(surface_of(design), design.cell, design.cells, plate, column)
    # Rows zigzag to one side of where they begin, those that are sought to both.
    aside = zigzag_angles(design.cell, 1 / roll.curvature)[0] / (2 * roll.curvature)
    return np.asarray(layers + np.array([roll.along, roll.middle + aside, 0.0]))


@lru_cache(maxsize=_DESIGNS)
def _laid_on(
    surface: "Plane | Cylinder | Cone",
    cell: MiuraCell,
    cells: tuple[int, int],
    plate: float,
    column: float,
) -> Floats:
    """Parameters of a surface and heights over it, (V, 3), m, of the sheet's vertices there."""
    from smoskin.origami.tessellation.tessellate import tessellate

    made = tessellate(surface, cell, cells, plate=plate, column=column, refold=False)
    if not made.holds:
        raise DesignError(f"limb must be a cone that the cells can follow: {made.advice}")
    return made.layers


def _magnets_middles(design: SkinDesign, pitch: Floats, feet: Floats) -> dict[str, Floats]:
    """Developed place of each magnet's middle, by its name."""
    middles = {}
    for magnet in design.magnets:
        place = np.multiply(magnet.corner, pitch)
        if magnet.mount == "sheet" and magnet.driver == "vertex":
            place = feet[np.linalg.norm(feet - place, axis=1).round(9).argmin()]
        middles[magnet.name] = place
    return middles


def from_columns(skin: Geometry, place: Floats) -> Floats:
    """Distance of a place in the skin's frame from each column's axis, all rows in one, m."""
    feet = skin.sheet.columns.ravel()
    away = place - skin.sheet.vertices[feet]
    return np.asarray(np.linalg.norm(np.cross(away, skin.axes[feet][..., 2]), axis=1))


def places_to_the_rim(extent: Floats, counts: tuple[int, int]) -> Floats:
    """A grid of places on a skin from rim to rim, shape (P, 2), m; y changes fastest."""
    return _grid([np.linspace(0.0, end, n) for end, n in zip(extent, counts, strict=True)])


def middles_of_fields(extent: Floats, counts: tuple[int, int]) -> Floats:
    """The middles of as many equal fields of a skin, in the same order."""
    return _grid([(np.arange(n) + 0.5) * end / n for end, n in zip(extent, counts, strict=True)])


def _grid(lines: list[Floats]) -> Floats:
    """Every place on two lines of coordinates, (P, 2)."""
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
