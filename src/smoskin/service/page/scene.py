"""The 3-D half of the page: the sheet, what lies under it, and the touches on it.

Decides how a skin looks (camera, light, colours, the exaggerated deformation) and where on
the skin a ray from the camera lands. Hides the viewer's scene graph and the facets' triangles.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading
from smoskin.service.page.board import Cells, draw_rulers
from smoskin.service.page.carpet import Carpet
from smoskin.service.page.inside import Columns, inward_arrows
from smoskin.service.page.markers import LIFT, UNITS, Marker, attitude
from smoskin.service.page.stack import Scales, Words, board, frame, lift

if TYPE_CHECKING:
    import viser

ESTIMATED: Final = (213, 94, 0)
"""Colour of what is estimated."""
TRUE: Final = (40, 92, 168)
"""Colour of what is true."""

CREASE: Final = (150, 138, 116)
"""Colour of a crease at rest."""
SUNK: Final = (46, 34, 22)
"""Colour of a crease that has sunk."""

COLUMN: Final = (176, 196, 206)
"""Colour of the columns."""
MAGNETISED: Final = (240, 196, 84)
"""Colour of the arrows along which a magnet's sectors are magnetised."""

_FIELD_OF_VIEW: Final = float(np.deg2rad(34.0))
_PAPER: Final = (247, 226, 186)
_BOARD: Final = (108, 138, 130)
_MAGNET: Final = (58, 62, 70)
_CHIP: Final = (24, 26, 30)
FRAME: Final = (92, 96, 104)
_SCALE: Final = (206, 212, 220)
_CREASE_LIFT: Final = 0.015
"""Place of the creases over the sheet, in units of the scene: they lie on it, not in it."""
_PARTS: Final = {
    "board": ("/board", "/chips", "/rulers"),
    "frame": ("/frame",),
    "columns": ("/columns",),
    "magnets": ("/magnets",),
    "sheet": ("/sheet", "/creases", "/cells", "/trail", "/bound", "/true", "/estimated"),
    "scales": ("/scales",),
}
"""Nodes of the scene that are lifted with each part."""
_VIVID_DEPTH: Final = 0.2e-3
"""m: a crease is darkest where it has sunk this deep."""


class Moment(NamedTuple):
    """All that is known of one reading."""

    reading: Reading
    estimate: Estimate | None
    """What was made of the reading, if anything."""
    truth: tuple[Contact, ...]
    """What really touches, where that is known."""
    vertices: Floats | None
    """Vertices of the deformed sheet, (V, 3), m; None at rest."""
    latency: float
    """Time from reading to estimate, s; NaN where unknown."""
    arrival: float
    """Time at which the reading came, s, on the clock of the view."""


def triangles(facets: Ints) -> Ints:
    """Triangles of a sheet, (2 F, 3): each facet cut along its first diagonal."""
    return np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])


def creases(facets: Ints) -> Ints:
    """Vertices of every edge of a facet, (E, 2), once each."""
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1)
    return np.unique(np.sort(edges.reshape(-1, 2), axis=1), axis=0)


def camera(design: SkinDesign, *, narrow: bool = False) -> tuple[Floats, Floats, float]:
    """The eye's place and what it looks at first, (3,), m, and the picture's height, rad.

    A picture that is narrow for its height, as a telephone's, shows the skin from above.
    """
    vertices = geometry(design).sheet.vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = float(np.linalg.norm((high - low)[:2]))
    # The near edge looks larger than the far one: aim a little in front of the middle.
    target = (low + high) / 2 - size * np.array((0.02, 0.06, 0.0))
    towards = np.array((-0.08, -0.6, 1.6) if narrow else (-0.26, -0.95, 1.05))
    distance = size * (2.7 if narrow else 2.05)
    return target + towards / np.linalg.norm(towards) * distance, target, _FIELD_OF_VIEW


def pick(
    design: SkinDesign, drawn: Floats, origin: ArrayLike, direction: ArrayLike
) -> Floats | None:
    """The place on the skin that a ray meets first; None on a miss.

    Parameters
    ----------
    design : SkinDesign
    drawn : Floats, shape (V, 3)
        Vertices of the sheet as they are drawn, m.
    origin, direction : array_like, shape (3,)
        Start of the ray, m, and its direction, of any length.

    Returns
    -------
    Floats or None
        (2,), m: material point hit, on the undeformed skin, or the nearest inside its extent.
    """
    skin = geometry(design)
    faces = triangles(skin.sheet.facets)
    corners = drawn[faces]
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
    return np.clip(weights @ skin.developed[faces[hit], :2], 0.0, skin.extent)


def _linear(color: tuple[int, int, int]) -> Floats:
    """A colour as the viewer takes those of single lines: in linear light, 0 to 255."""
    return np.asarray(255 * (np.array(color) / 255) ** 2.2)


class SkinScene:
    """The skin and its touches in a viewer's scene."""

    def __init__(self, server: "viser.ViserServer", design: SkinDesign) -> None:
        self._server = server
        self._design = design
        sheet = geometry(design).sheet
        self._creases = creases(sheet.facets)
        self._markers: dict[str, list[Marker]] = {"/true": [], "/estimated": []}
        self._hung: list[tuple[viser.CylinderHandle, int, Floats]] = []
        self._based: list[tuple[viser.CylinderHandle, Floats]] = []
        self._apart = 0.0
        self._lifted: dict[str, viser.SceneNodeHandle] = {
            name: server.scene.add_frame(name, show_axes=False)
            for name in ("/rulers", "/chips", "/magnets", "/cells", "/true", "/estimated")
        }
        """Nodes that are lifted with all that is under them, by their names."""
        self._rest = self._drawn = sheet.vertices
        self._stage()
        self._stage_parts()
        self._stage_columns()
        draw_rulers(server, design)
        self._cells = Cells(server, design, ESTIMATED)
        self._dots = self._lifted["/trail"] = server.scene.add_point_cloud(
            "/trail", np.zeros((0, 3)), ESTIMATED, point_size=0.14, point_shape="circle"
        )
        self.sheet = self._lifted["/sheet"] = server.scene.add_mesh_simple(
            "/sheet",
            self._drawn * UNITS,
            triangles(sheet.facets),
            color=_PAPER,
            flat_shading=True,
            side="double",
        )
        """The node that takes clicks."""
        self._lines = self._lifted["/creases"] = server.scene.add_line_segments(
            "/creases",
            self._drawn[self._creases] * UNITS,
            # One colour for all would stay white when each gets its own.
            np.broadcast_to(_linear(CREASE).astype(np.uint8), (len(self._creases), 2, 3)),
            thickness=0.05,
        )
        self._words = Words(server, design)
        self.carpet = Carpet(server, design)
        """The map of a bound."""
        self._lifted["/bound"] = self.carpet.node

    def spread(self, apart: float, scaled: bool) -> None:
        """Lift the parts off each other, 0 to 1 of the way, and show the scales or not.

        A skin that is taken apart shows them anyhow.
        """
        if self._cover.visible != (covered := scaled or apart > 0.0):
            self._cover.visible = covered
        if apart == self._apart:
            return
        self._apart = apart
        for part, names in _PARTS.items():
            for name in names:
                self._lifted[name].position = (0.0, 0.0, lift(part, apart))
        for node, place in self._based:
            away = lift("base", apart) - lift("magnets", apart)
            node.position = (place[0], place[1], place[2] + away)
        self._words.show(apart)

    def place_under(self, origin: ArrayLike, direction: ArrayLike) -> Floats | None:
        """The place on the skin that a ray of the viewer's scene meets first, (2,), m."""
        start = np.asarray(origin) - (0.0, 0.0, lift("sheet", self._apart))
        return pick(self._design, self._drawn, start / UNITS, direction)

    def draw(self, moment: Moment, exaggeration: float, opacity: float, trail: Floats) -> None:
        """Show estimates solid, with their 95 % ellipses, and the truth translucent.

        The deformation is drawn so many times larger than life, the sheet with this opacity, and
        a dot on each place of the trail (N, 2), m.
        """
        rest, vertices = self._rest, moment.vertices
        moved = np.zeros_like(rest) if vertices is None else np.nan_to_num(vertices - rest)
        self._drawn = rest + exaggeration * moved
        points = (self._drawn * UNITS).astype(np.float32)
        # In the plane a press moves the whole sheet; what lights up is the dent.
        outward = geometry(self._design).axes[..., 2]
        sunk = -(moved * outward).sum(axis=1)[self._creases]
        share = np.clip(sunk / _VIVID_DEPTH, 0.0, 1.0)[..., None]
        self.sheet.vertices = points
        columns = (self._columns.places(self._drawn) * UNITS).astype(np.float32)
        if not np.array_equal(columns, self._standing.vertices):
            self._standing.vertices = columns  # fifteen times the sheet's data
        if self._cover.visible:
            scales = (self._scales.places(self._drawn) * UNITS).astype(np.float32)
            if not np.array_equal(scales, self._cover.vertices):
                self._cover.vertices = scales
        self.sheet.opacity = opacity if opacity < 1.0 else None
        for node, vertex, offset in self._hung:
            node.position = tuple(points[vertex] + offset)
        lifted = (self._drawn * UNITS + _CREASE_LIFT * outward).astype(np.float32)
        self._lines.points = lifted[self._creases]
        crease, dark = _linear(CREASE), _linear(SUNK)
        self._lines.colors = (crease + share * (dark - crease)).astype(np.uint8)
        self._draw_trail(trail)
        unknown = np.full((len(moment.truth), 2, 2), np.nan)
        self._mark("/true", moment.truth, unknown)
        if moment.estimate is None:
            self._mark("/estimated", (), unknown[:0])
            self._cells.show((), self._height)
        else:
            spread = moment.estimate.covariance[:, :2, :2]
            self._mark("/estimated", moment.estimate.contacts, spread)
            self._cells.show(moment.estimate.contacts, self._height)

    def _draw_trail(self, places: Floats) -> None:
        """Put a dot on each place, the older the paler."""
        skin = geometry(self._design)
        over = [(*place, self._height(place) + LIFT / UNITS) for place in places]
        points = skin.roll.places(np.reshape(over, (-1, 3))) * UNITS
        age = np.linspace(0.8, 0.0, len(points))[:, None]
        self._dots.points = np.array(points, dtype=np.float32).reshape(-1, 3)
        self._dots.colors = (ESTIMATED + age * (np.array(_PAPER) - ESTIMATED)).astype(np.uint8)

    def _mark(self, name: str, contacts: Sequence[Contact], covariance: Floats) -> None:
        """Move one marker to each contact and hide the rest."""
        markers = self._markers[name]
        color, opacity = (TRUE, 0.45) if name == "/true" else (ESTIMATED, 1.0)
        while len(markers) < len(contacts):
            markers.append(Marker(self._server, f"{name}/{len(markers)}", color, opacity))
        for marker, contact, spread in zip(markers, contacts, covariance, strict=False):
            skin, place = geometry(self._design), contact.position
            over = skin.roll.places([*place, self._height(place) + LIFT / UNITS])
            marker.show(contact, over, attitude(skin.roll.axes(place[1])), spread)
        for marker in markers[len(contacts) :]:
            marker.hide()

    def _height(self, place: Floats) -> float:
        """Height of the top of the drawn facet over a place on the skin, m."""
        skin = geometry(self._design)
        facets = skin.sheet.facets
        middles = skin.developed[facets, :2].mean(axis=1)
        nearest = int(np.argmin(np.linalg.norm(middles - place, axis=1)))
        away = self._drawn[facets[nearest]] - skin.roll.places([*place, 0.0])
        return float((away @ skin.roll.axes(place[1])[:, 2]).max())

    def _stage(self) -> None:
        """Set camera, light and board, none of which moves."""
        scene, start = self._server.scene, self._server.initial_camera
        position, target, start.fov = camera(self._design)
        start.position, start.look_at = position * UNITS, target * UNITS
        # Light that grazes from the left tells the panels of the sheet apart.
        scene.configure_environment_map(None)
        scene.configure_default_lights(enabled=False)
        scene.add_light_hemisphere(
            "/light/sky", sky_color=(255, 255, 255), ground_color=(186, 194, 206), intensity=1.9
        )
        scene.add_light_directional("/light/sun", intensity=2.2, position=(-30.0, -6.0, 22.0))
        for name, (places, faces), color in (
            ("/board", board(self._design), _BOARD),
            ("/frame", frame(self._design), FRAME),
        ):
            self._lifted[name] = scene.add_mesh_simple(
                name, places * UNITS, faces, color=color, flat_shading=True, side="double"
            )

    def _stage_columns(self) -> None:
        """Set what stands under the sheet and what lies on it: columns and scales."""
        self._columns = Columns(self._design)
        self._standing = self._lifted["/columns"] = self._server.scene.add_mesh_simple(
            "/columns",
            (self._columns.places(self._rest) * UNITS).astype(np.float32),
            self._columns.triangles,
            color=COLUMN,
            side="double",
        )
        self._scales = Scales(self._design)
        self._cover = self._lifted["/scales"] = self._server.scene.add_mesh_simple(
            "/scales",
            (self._scales.places(self._rest) * UNITS).astype(np.float32),
            self._scales.triangles,
            color=_SCALE,
            opacity=0.35,
            flat_shading=True,
            visible=False,
        )

    def _stage_parts(self) -> None:
        """Set chips and magnets; magnets on the sheet hang from the nearest of its vertices."""
        design, scene, places = self._design, self._server.scene, geometry(self._design)
        turns = [attitude(axes) for axes in places.chip_axes]
        for site, chip, turn in zip(design.halls, places.chips * UNITS, turns, strict=True):
            name = f"/chips/{site.name}"
            scene.add_box(
                name, color=_CHIP, dimensions=(0.4, 0.4, 0.14), position=tuple(chip), wxyz=turn
            )
            scene.add_label(
                f"{name}/label",
                site.name,
                font_screen_scale=0.8,
                anchor="center-center",
                depth_test=False,
            )
        for index, (part, place) in enumerate(
            zip(design.magnets, places.magnets * UNITS, strict=True)
        ):
            node = scene.add_cylinder(
                f"/magnets/{index}",
                radius=part.radius * UNITS,
                height=part.height * UNITS,
                color=_MAGNET,
                position=tuple(place),
                wxyz=attitude(places.magnet_axes[index]),
            )
            scene.add_line_segments(
                f"/magnets/{index}/inward", inward_arrows(part) * UNITS, MAGNETISED, thickness=0.05
            )
            if part.mount == "sheet":
                offsets = place - LIFT * places.magnet_axes[index][:, 2] - self._rest * UNITS
                vertex = int(np.argmin(np.linalg.norm(offsets, axis=1)))
                self._hung.append((node, vertex, offsets[vertex]))
            else:
                self._based.append((node, place))
