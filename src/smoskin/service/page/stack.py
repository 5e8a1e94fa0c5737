"""What a skin is stacked of, from its board to its scales, and how far apart its parts are drawn.

Decides which parts lie on which level, what each is there for in a few words, and how far the
slider lifts them off each other. Hides the triangles of board, frame and scales.
"""

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry
from smoskin.service.page.markers import UNITS

if TYPE_CHECKING:
    import viser

LEVELS: Final = {
    "base": (-1.5, "base magnet"),
    "board": (-1.0, "chips feel the field"),
    "frame": (-0.35, "frame holds the rim"),
    "columns": (0.2, "columns bend"),
    "magnets": (0.75, "magnets sink with it"),
    "sheet": (1.3, "folded sheet sinks"),
    "scales": (1.9, "scales are touched"),
}
"""Level of each part, in shares of the whole way, and what it does."""
BOARD_DRAWN: Final = 1.6e-3
"""m: thickness of the board."""
BOARD_RIM: Final = 2e-3
"""m: how far it reaches past the frame's wall."""
_WALL: Final = 3e-3
"""m: thickness of the frame's wall."""
_WAY: Final = 2.6
"""Units of the scene in one share of the whole way."""
_SCALE: Final = (1.2e-3, 0.8e-3)
"""m: a scale's lower face over the top vertex, and its thickness."""
_SCALE_GAP: Final = 1e-3
"""m: between neighbouring scales."""
_STRIPS: Final = 24
"""Flat strips of which a plate round a limb is drawn."""
_QUADS: Final = ((0, 1), (1, 2), (2, 3), (3, 0))


def lift(part: str, apart: float) -> float:
    """Height that a part is lifted to where the skin is so far apart, 0 to 1; scene's units."""
    return LEVELS[part][0] * apart * _WAY


def slab(
    design: SkinDesign, low: ArrayLike, high: ArrayLike, heights: tuple[float, float]
) -> tuple[Floats, Ints]:
    """Vertices, m, and triangles of a plate between two developed corners (2,) and two heights."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    foot, top = heights
    across = np.linspace(low[1], high[1], _STRIPS + 1)
    ring = np.array([(low[0], top), (high[0], top), (high[0], foot), (low[0], foot)])
    flat = np.array([(x, y, z) for y in across for x, z in ring])
    sides = [
        (4 * k + a, 4 * k + b, 4 * k + 4 + b, 4 * k + 4 + a)
        for k in range(_STRIPS)
        for a, b in _QUADS
    ]
    last = 4 * _STRIPS
    quads = np.array([*sides, (3, 2, 1, 0), (last, last + 1, last + 2, last + 3)])
    return geometry(design).roll.places(flat), _halved(quads)


def board_corners(design: SkinDesign) -> tuple[Floats, Floats]:
    """Developed corners (2,) of the board, which carries columns and frame, m."""
    low, high = _walls(design)
    reach = _WALL + BOARD_RIM
    return low - reach, high + reach


def board(design: SkinDesign) -> tuple[Floats, Ints]:
    """The board."""
    top = -design.columns.height
    return slab(design, *board_corners(design), (top - BOARD_DRAWN, top))


def frame(design: SkinDesign) -> tuple[Floats, Ints]:
    """The constraint frame: a wall round the outer columns, as high as it holds them."""
    low, high = _walls(design)
    foot = -design.columns.height
    heights = foot, foot + design.frame.held_height
    (left, near), (right, far) = low, high
    return _joined(
        [
            slab(design, low - _WALL, (left, far + _WALL), heights),
            slab(design, (right, near - _WALL), high + _WALL, heights),
            slab(design, (left, near - _WALL), (right, near), heights),
            slab(design, (left, far), (right, far + _WALL), heights),
        ]
    )


class Scales:
    """The scales of a design, one over each cell, which go along with its top vertex."""

    def __init__(self, design: SkinDesign) -> None:
        skin = geometry(design)
        self._tops = skin.sheet.loaded.ravel()
        self._axes = skin.axes[self._tops]
        wide = np.array([float(skin.cell.length), float(skin.cell.width)]) / 2 - _SCALE_GAP / 2
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * wide
        foot, thick = _SCALE
        self._box = np.array([(x, y, z) for z in (foot, foot + thick) for x, y in corners])
        faces = [(3, 2, 1, 0), (4, 5, 6, 7), *((a, b, b + 4, a + 4) for a, b in _QUADS)]
        starts = len(self._box) * np.arange(len(self._tops))
        box = _halved(np.array(faces))
        self.triangles: Ints = (box + starts[:, None, None]).reshape(-1, 3)
        """Triangles of all the scales, (T, 3), over the rows of `places`."""

    def places(self, vertices: Floats) -> Floats:
        """Vertices of all the scales over a sheet with such vertices (V, 3), both in m."""
        turned = np.einsum("tij,bj->tbi", self._axes, self._box)
        return np.asarray(vertices[self._tops][:, None] + turned).reshape(-1, 3)


def _walls(design: SkinDesign) -> tuple[Floats, Floats]:
    """Developed corners of the frame's inner face: outer columns and their clearance, m."""
    skin = geometry(design)
    places = skin.developed[skin.sheet.columns.ravel(), :2]
    reach = design.columns.radius + design.frame.clearance
    return places.min(axis=0) - reach, places.max(axis=0) + reach


def _halved(quads: Ints) -> Ints:
    """Triangles (2 Q, 3) of quadrilaterals (Q, 4)."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _joined(plates: list[tuple[Floats, Ints]]) -> tuple[Floats, Ints]:
    """Several bodies as one."""
    starts = np.cumsum([0, *(len(places) for places, _ in plates[:-1])])
    faces = [start + triangles for start, (_, triangles) in zip(starts, plates, strict=True)]
    return np.concatenate([places for places, _ in plates]), np.concatenate(faces)


class Words:
    """Words at the right of each part that is lifted off, which say what it does."""

    def __init__(self, server: "viser.ViserServer", design: SkinDesign) -> None:
        vertices = geometry(design).sheet.vertices * UNITS
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        mounts = {magnet.mount for magnet in design.magnets}
        parts = [part for part in LEVELS if part != "base" or "base" in mounts]
        self._start = {part: _middle(part, low, high, design) for part in parts}
        self._nodes = {
            part: server.scene.add_label(
                f"/words/{part}",
                LEVELS[part][1],
                position=tuple(place),
                font_screen_scale=0.8,
                anchor="center-left",
                depth_test=False,
                visible=False,
            )
            for part, place in self._start.items()
        }

    def show(self, apart: float) -> None:
        """Put the words beside the parts, and hide them from a skin that is whole."""
        for part, node in self._nodes.items():
            node.visible = apart > 0.3
            node.position = tuple(self._start[part] + (0.0, 0.0, lift(part, apart)))


def _middle(part: str, low: Floats, high: Floats, design: SkinDesign) -> Floats:
    """Place of a part's words at rest, at the right of the near rim, scene's units."""
    foot = -design.columns.height * UNITS
    rest = {"base": foot, "board": foot, "frame": foot, "columns": foot / 2, "magnets": 0.0}
    height = rest.get(part, high[2])
    return np.array((high[0] + 0.6, low[1] + 0.25 * (high[1] - low[1]), height))
