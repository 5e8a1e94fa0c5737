"""The 3-D half of the page: the sheet, what lies under it, and the touches on it.

Decides how a planar skin looks (camera, light, colours, the exaggerated deformation) and where on
the skin a ray from the camera lands. Hides the viewer's scene graph and the triangles that stand
for the facets.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Self

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints, assign, freeze
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate
from smoskin.service.page.markers import LIFT, UNITS, Marker

if TYPE_CHECKING:
    import viser

ESTIMATED: Final = (213, 94, 0)
"""Colour of what is estimated."""
TRUE: Final = (40, 92, 168)
"""Colour of what is true."""

_FIELD_OF_VIEW: Final = float(np.deg2rad(34.0))

_PAPER: Final = (247, 226, 186)
_CREASE: Final = np.array((150, 138, 116), dtype=float)
_BOARD: Final = (108, 138, 130)
_MAGNET: Final = (96, 100, 108)
_CHIP: Final = (38, 40, 44)
_VIVID_DEPTH: Final = 0.2e-3
"""m: a crease takes the full colour of a touch where it has sunk this deep."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SkinShape:
    """What a planar skin looks like at rest, in the skin's frame.

    Raises
    ------
    ArgumentError
        If a shape is wrong, a facet names no vertex or names and chips differ in number.
    """

    vertices: Floats
    """Vertices of the sheet, (V, 3), m."""
    facets: Ints
    """Vertices of each panel, in order round it, (F, 4)."""
    chip_names: tuple[str, ...]
    """Names of the S chips, in the order of every reading."""
    chips: Floats
    """Middles of the chips, (S, 3), m."""
    magnets: Floats
    """Middles of the magnets, (G, 3), m."""
    magnet_radius: float = 5e-3
    """Radius of every magnet, m."""
    magnet_height: float = 2e-3
    """Height of every magnet, m."""
    board: float = -10e-3
    """Height of the board's upper face, m."""
    extent: tuple[float, float] | None = None
    """Length and width of the skin, m: a press outside counts at the nearest place inside; without
    them none is outside."""

    def __post_init__(self) -> None:
        facets = np.array(self.facets, dtype=np.int64)
        if facets.ndim != 2 or facets.shape[1] != 4:
            raise ArgumentError(f"facets must have shape (F, 4); got {facets.shape}")
        count = len(self.vertices)
        if not (len(facets) and facets.min() >= 0 and facets.max() < count):
            raise ArgumentError(
                f"facets must name at least one panel of vertices 0..{count - 1}; "
                f"got {len(facets)} panels"
            )
        facets.setflags(write=False)
        assign(self, facets=facets, chip_names=tuple(self.chip_names))
        freeze(self, vertices=(None, 3), chips=(len(self.chip_names), 3), magnets=(None, 3))

    @classmethod
    def of_design(cls, design: SkinDesign) -> Self:
        """The shape of a skin of this design."""
        skin = geometry(design)
        length, width = skin.extent.tolist()
        return cls(
            vertices=skin.sheet.vertices,
            facets=skin.sheet.facets,
            chip_names=tuple(site.name for site in design.halls),
            chips=skin.chips,
            magnets=skin.magnets,
            magnet_radius=design.magnets[0].radius,
            magnet_height=design.magnets[0].height,
            board=-design.columns.height,
            extent=(length, width),
        )

    @property
    def triangles(self) -> Ints:
        """(2 F, 3): each facet cut along its first diagonal."""
        return np.concatenate([self.facets[:, [0, 1, 2]], self.facets[:, [0, 2, 3]]])

    @property
    def creases(self) -> Ints:
        """(E, 2): every edge of a facet, once."""
        edges = np.stack([self.facets, np.roll(self.facets, -1, axis=1)], axis=-1)
        return np.unique(np.sort(edges.reshape(-1, 2), axis=1), axis=0)


def camera(shape: SkinShape) -> tuple[Floats, Floats, float]:
    """The place from which the page looks at first, and what it looks at.

    Parameters
    ----------
    shape : SkinShape
        The skin to be seen whole.

    Returns
    -------
    position : Floats
        (3,), m.
    target : Floats
        (3,), m: appears in the middle of the picture.
    field_of_view : float
        rad, from the picture's upper to its lower edge.
    """
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    size = float(np.linalg.norm((high - low)[:2]))
    # The near edge looks larger than the far one: aim a little in front of the middle.
    target = (low + high) / 2 - size * np.array((0.0, 0.04, 0.0))
    towards = np.array((-0.26, -0.95, 1.05))
    return target + towards / np.linalg.norm(towards) * size * 1.74, target, _FIELD_OF_VIEW


def pick(shape: SkinShape, drawn: Floats, origin: ArrayLike, direction: ArrayLike) -> Floats | None:
    """The place on the skin that a ray meets first.

    Parameters
    ----------
    shape : SkinShape
        The skin at rest.
    drawn : Floats
        (V, 3), m: its vertices as they are drawn.
    origin : array_like
        (3,), m: where the ray starts.
    direction : array_like
        (3,): where it goes, of any length.

    Returns
    -------
    Floats or None
        (2,), m: x and y on the undeformed skin of the material point hit; None on a miss.
    """
    corners = drawn[shape.triangles]
    start, along = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(along, second)
    volume = np.einsum("ti,ti->t", first, across)
    seen = np.abs(volume) > 1e-15 * np.linalg.norm(along)
    scale = np.divide(1.0, volume, out=np.zeros_like(volume), where=seen)
    offset = start - corners[:, 0]
    u = np.einsum("ti,ti->t", offset, across) * scale
    lever = np.cross(offset, first)
    v = lever @ along * scale
    depth = np.einsum("ti,ti->t", second, lever) * scale
    # A hair of slack, so that a ray along a crease falls through neither of its two panels.
    inside = seen & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9) & (depth > 0.0)
    if not inside.any():
        return None
    hit = int(np.argmin(np.where(inside, depth, np.inf)))
    weights = np.array((1.0 - u[hit] - v[hit], u[hit], v[hit]))
    place: Floats = weights @ shape.vertices[shape.triangles[hit], :2]
    return place if shape.extent is None else np.clip(place, 0.0, shape.extent)


class SkinScene:
    """Draws the skin and its touches in a viewer's scene.

    Parameters
    ----------
    server : viser.ViserServer
        The server whose scene is filled.
    shape : SkinShape
        The skin at rest.
    """

    def __init__(self, server: "viser.ViserServer", shape: SkinShape) -> None:
        self._server = server
        self._shape = shape
        self._triangles = shape.triangles
        self._creases = shape.creases
        self._estimated: list[Marker] = []
        self._true: list[Marker] = []
        self._hung: list[tuple[viser.CylinderHandle, int, Floats]] = []
        self._drawn: Floats = shape.vertices
        self._stage()
        self.sheet = server.scene.add_mesh_simple(
            "/sheet",
            self._drawn * UNITS,
            self._triangles,
            color=_PAPER,
            flat_shading=True,
            side="double",
        )
        """The node that takes clicks."""
        self._lines = server.scene.add_line_segments(
            "/creases",
            self._drawn[self._creases] * UNITS,
            _CREASE.astype(np.uint8),
            thickness=0.05,
        )

    def place_under(self, origin: ArrayLike, direction: ArrayLike) -> Floats | None:
        """The place on the skin that a ray of the viewer's scene meets first, (2,), m."""
        return pick(self._shape, self._drawn, np.asarray(origin) / UNITS, direction)

    def draw(
        self,
        estimate: Estimate | None,
        truth: Sequence[Contact],
        vertices: Floats | None,
        exaggeration: float,
        opacity: float,
    ) -> None:
        """Show one moment.

        Parameters
        ----------
        estimate : Estimate or None
            Its contacts are drawn solid, with their 95 % ellipses where known.
        truth : sequence of Contact
            Drawn translucent.
        vertices : Floats or None
            (V, 3), m: the deformed sheet; None at rest.
        exaggeration : float
            How many times larger than life the deformation is drawn.
        opacity : float
            Opacity of the sheet, 0 to 1.
        """
        rest = self._shape.vertices
        moved = np.zeros_like(rest) if vertices is None else np.nan_to_num(vertices - rest)
        self._drawn = rest + exaggeration * moved
        points = (self._drawn * UNITS).astype(np.float32)
        # In the plane a press moves the whole sheet; what lights up is the dent.
        sunk = -moved[self._creases, 2]
        share = np.clip(sunk / _VIVID_DEPTH, 0.0, 1.0)[..., None]
        self.sheet.vertices = points
        self.sheet.opacity = opacity if opacity < 1.0 else None
        for node, vertex, offset in self._hung:
            node.position = tuple(points[vertex] + offset)
        self._lines.points = points[self._creases]
        self._lines.colors = (_CREASE + share * (np.array(ESTIMATED) - _CREASE)).astype(np.uint8)
        unknown = np.full((len(truth), 2, 2), np.nan)
        self._mark(self._true, "/true", TRUE, 0.45, truth, unknown)
        contacts = () if estimate is None else estimate.contacts
        spread = np.zeros((0, 2, 2)) if estimate is None else estimate.covariance[:, :2, :2]
        self._mark(self._estimated, "/estimated", ESTIMATED, 1.0, contacts, spread)

    def _mark(
        self,
        markers: "list[Marker]",
        name: str,
        color: tuple[int, int, int],
        opacity: float,
        contacts: Sequence[Contact],
        covariance: Floats,
    ) -> None:
        """Move one marker to each contact and hide the rest."""
        while len(markers) < len(contacts):
            markers.append(Marker(self._server, f"{name}/{len(markers)}", color, opacity))
        for marker, contact, spread in zip(markers, contacts, covariance, strict=False):
            marker.show(contact, self._height(contact.position), spread)
        for marker in markers[len(contacts) :]:
            marker.hide()

    def _height(self, place: Floats) -> float:
        """Z of the top of the drawn facet at a place on the skin, m."""
        middles = self._shape.vertices[self._shape.facets, :2].mean(axis=1)
        nearest = int(np.argmin(np.linalg.norm(middles - place, axis=1)))
        return float(self._drawn[self._shape.facets[nearest], 2].max())

    def _stage(self) -> None:
        """Everything that never moves: camera, light, board, chips, magnets."""
        shape, scene = self._shape, self._server.scene
        position, target, field_of_view = camera(shape)
        start = self._server.initial_camera
        start.position, start.look_at = position * UNITS, target * UNITS
        start.fov = field_of_view
        # Light that grazes from the left tells the panels of the sheet apart.
        scene.configure_environment_map(None)
        scene.configure_default_lights(enabled=False)
        scene.add_light_hemisphere(
            "/light/sky", sky_color=(255, 255, 255), ground_color=(186, 194, 206), intensity=1.9
        )
        scene.add_light_directional("/light/sun", intensity=2.2, position=(-30.0, -6.0, 22.0))
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        middle = (low + high) / 2 * UNITS
        width, depth, _ = (high - low + 4e-3) * UNITS
        top = shape.board * UNITS
        scene.add_box(
            "/board",
            color=_BOARD,
            dimensions=(width, depth, 0.16),
            position=(middle[0], middle[1], top - 0.08),
        )
        scene.add_grid(
            "/table",
            width=80.0,
            height=80.0,
            cell_size=1.0,
            section_size=5.0,
            cell_color=(226, 229, 233),
            section_color=(206, 211, 217),
            fade_distance=60.0,
            position=(middle[0], middle[1], top - 1.2),
        )
        self._stage_magnets()
        for name, chip in zip(shape.chip_names, shape.chips * UNITS, strict=True):
            scene.add_box(
                f"/chips/{name}", color=_CHIP, dimensions=(0.4, 0.4, 0.14), position=tuple(chip)
            )
            scene.add_label(
                f"/chips/{name}/label",
                name,
                font_screen_scale=0.8,
                anchor="center-center",
                depth_test=False,
            )

    def _stage_magnets(self) -> None:
        """Magnets; those above the board hang from the nearest vertex of the sheet."""
        shape, scene = self._shape, self._server.scene
        for index, magnet in enumerate(shape.magnets * UNITS):
            node = scene.add_cylinder(
                f"/magnets/{index}",
                radius=shape.magnet_radius * UNITS,
                height=shape.magnet_height * UNITS,
                color=_MAGNET,
                position=tuple(magnet),
            )
            if magnet[2] > shape.board * UNITS:
                offsets = magnet - np.array((0.0, 0.0, LIFT)) - self._drawn * UNITS
                vertex = int(np.argmin(np.linalg.norm(offsets, axis=1)))
                self._hung.append((node, vertex, offsets[vertex]))
