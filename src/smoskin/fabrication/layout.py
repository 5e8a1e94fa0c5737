"""Places of the parts that a design does not place: frame, board, pillars and base.

z = 0 is the surface of the bottom vertices, x and y those of the sheet, metres. On a limb parts are
laid out flat, as the board is before it is rolled on to its shell: y is the arc at a level, by
default the board's; heights and x are as they are. On a planar skin every level is the same.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import Magnet, SkinDesign
from smoskin.errors import DesignError
from smoskin.origami.geometry import geometry

FILM: Final = 0.11e-3
"""m: flexible circuit that lies on a limb's carrier shell."""
FRAME_WALL: Final = 3e-3
"""m: thickness of the frame's wall."""
BOARD_MARGIN: Final = 2e-3
"""m: board outside the frame's wall."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A rectangle along x and y, m."""

    left: float
    low: float
    right: float
    high: float

    def wider(self, by: float) -> "Box":
        """The rectangle so much larger on every side, m."""
        return Box(
            left=self.left - by, low=self.low - by, right=self.right + by, high=self.high + by
        )

    @property
    def size(self) -> tuple[float, float]:
        """Extent along x and y, m."""
        return self.right - self.left, self.high - self.low

    @property
    def corners(self) -> Floats:
        """(4, 2), m: counter-clockwise from the low left one."""
        x, y = (self.left, self.right), (self.low, self.high)
        return np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])


def circuit_thickness(design: SkinDesign) -> float:
    """Thickness of the floating circuit, m: the board, or the film that a limb's shell carries."""
    return design.board.thickness if design.limb is None else FILM


def level_of(design: SkinDesign) -> float:
    """Level at which the board's lengths are true, m: the middle of its circuit."""
    return -design.columns.height - circuit_thickness(design) / 2


def frame_level(design: SkinDesign) -> float:
    """Level of the frame's upper edge, which stops the columns, m."""
    return design.frame.held_height - design.columns.height


def at_level(design: SkinDesign, y: Any, start: float, end: float) -> Any:
    """Arcs at one level of what has the arcs y at another, both m; the middle stays."""
    roll = geometry(design).roll
    share = (1 + roll.curvature * end) / (1 + roll.curvature * start)
    return roll.middle + (np.asarray(y) - roll.middle) * share


def laid_flat(design: SkinDesign, developed: Floats, level: float | None = None) -> Floats:
    """Flat places (K, 2) at a level of developed ones (K, 2), m."""
    at = level_of(design) if level is None else level
    return np.stack([developed[:, 0], at_level(design, developed[:, 1], 0.0, at)], axis=-1)


def pose(design: SkinDesign, developed: Any) -> Floats:
    """Pose (3, 4) of a solid drawn over the origin: upright at a developed place."""
    roll = geometry(design).roll
    x, y = float(developed[0]), float(developed[1])
    return np.concatenate([roll.axes(y), roll.places([x, y, 0.0])[:, None]], axis=1)


def column_places(design: SkinDesign, level: float | None = None) -> Floats:
    """Middles of the columns, (C, 2), m, those left out that a magnet stands in place of."""
    skin = geometry(design)
    places = skin.developed[skin.sheet.columns.ravel(), :2]
    there = np.ones(len(places), dtype=bool)
    for magnet, at in zip(design.magnets, skin.magnet_places, strict=True):
        if magnet.mount == "sheet" and magnet.driver == "vertex":
            there[np.linalg.norm(places - at, axis=1).argmin()] = False
    return laid_flat(design, places[there], level)


def chip_places(design: SkinDesign) -> Floats:
    """Places of the chips on the board, (S, 2), m."""
    skin = geometry(design)
    names = [magnet.name for magnet in design.magnets]
    watched = [names.index(site.magnet) for site in design.halls]
    return laid_flat(design, skin.magnet_places[watched])


def magnet_height(design: SkinDesign, magnet: Magnet) -> float:
    """Height of a magnet's middle, m.

    On a limb the base's magnet stands higher than in `geometry` by the shell: its chip lies in the
    shell's window under the film and not under the shell, and keeps its gap.
    """
    skin = geometry(design)
    k = design.magnets.index(magnet)
    height = float(skin.roll.developed(skin.magnets[k])[2])
    return height + (shell_thickness(design) if magnet.mount == "base" else 0.0)


def shell_thickness(design: SkinDesign) -> float:
    """Thickness of the shell under a limb's flexible circuit, m; none under a planar board."""
    return design.board.thickness - circuit_thickness(design)


def frame_box(design: SkinDesign, level: float | None = None) -> Box:
    """Outer faces of the frame's wall: the rim columns, their clearance and the wall."""
    edge, at = frame_level(design), level_of(design) if level is None else level
    skin = geometry(design)
    places = laid_flat(design, skin.developed[skin.sheet.columns.ravel(), :2], edge)
    low, high = places.min(axis=0), places.max(axis=0)
    box = Box(left=low[0], low=low[1], right=high[0], high=high[1])
    return _carried(
        design, box.wider(design.columns.radius + design.frame.clearance + FRAME_WALL), edge, at
    )


def board_box(design: SkinDesign, level: float | None = None) -> Box:
    """The board's outline, without what its connector needs beyond it."""
    own = level_of(design)
    at = own if level is None else level
    return _carried(design, frame_box(design).wider(BOARD_MARGIN), own, at)


def _carried(design: SkinDesign, box: Box, start: float, end: float) -> Box:
    """A rectangle of one level at another."""
    low, high = at_level(design, [box.low, box.high], start, end).tolist()
    return replace(box, low=low, high=high)


def pillar_places(design: SkinDesign) -> Floats:
    """Middles of the shear layer's pillars, (P, 2), m, evenly round and clear of magnets and chips.

    Pillars stand in rows as near to square as their number allows; one that would meet a base
    magnet's pocket or a chip on the board's lower face moves straight away from it.

    Raises
    ------
    DesignError
        If pillars run into each other, or stand beside the board.
    """
    skin = geometry(design)
    count, extent = design.shear_layer.pillars, skin.extent
    rows = max(1, round(float(np.sqrt(count * extent[1] / extent[0]))))
    sizes = [len(part) for part in np.array_split(np.arange(count), rows)]
    places = [
        ((k + 0.5) / size * extent[0], (row + 0.5) / rows * extent[1])
        for row, size in enumerate(sizes)
        for k in range(size)
    ]
    moved = laid_flat(design, np.array(places))
    middles = laid_flat(design, skin.magnet_places)
    for magnet, at in zip(design.magnets, middles, strict=True):
        if magnet.mount != "base":
            continue
        room = magnet.radius + design.shear_layer.radius + 2e-3
        off = moved - at
        apart = np.linalg.norm(off, axis=1)
        near = apart < room
        away = np.where(apart[near, None] > 1e-9, off[near], [1.0, 0.0])
        away = away / np.linalg.norm(away, axis=1, keepdims=True)
        moved[near] = at + room * away
    _check_pillars(design, moved)
    return moved


def _check_pillars(design: SkinDesign, places: Floats) -> None:
    """Refuse pillars that run into each other or stand beside the board."""
    wide = 2 * design.shear_layer.radius
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    apart[np.diag_indices(len(places))] = np.inf
    if apart.min() < wide:
        raise DesignError(
            f"the shear layer's pillars must stand {1e3 * wide:.2f} mm apart, their diameter; got "
            f"{1e3 * float(apart.min()):.2f} mm: take fewer or thinner ones"
        )
    low, _, high, _ = board_box(design).wider(-wide / 2).corners
    if not ((places >= low) & (places <= high)).all():
        raise DesignError(
            f"the shear layer's pillars must stand under the board, {1e3 * wide / 2:.2f} mm within "
            "its edge; got one outside: take thinner pillars or another place for the base's magnet"
        )
