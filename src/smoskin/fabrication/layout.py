"""Places of the parts that a design does not place: frame, board, pillars and base.

The skin's frame: z = 0 is the plane of the bottom vertices, x and y those of the sheet, metres.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.origami.geometry import geometry

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


def column_places(design: SkinDesign) -> Floats:
    """Middles of the columns, (C, 2), m, those left out that a magnet stands in place of."""
    sheet = geometry(design).sheet
    places = sheet.vertices[sheet.columns.ravel(), :2]
    there = np.ones(len(places), dtype=bool)
    for magnet, at in zip(design.magnets, geometry(design).magnets, strict=True):
        if magnet.mount == "sheet" and magnet.driver == "vertex":
            there[np.linalg.norm(places - at[:2], axis=1).argmin()] = False
    return np.asarray(places[there])


def frame_box(design: SkinDesign) -> Box:
    """Outer faces of the frame's wall: the rim columns, their clearance and the wall."""
    places = geometry(design).sheet.vertices[geometry(design).sheet.columns.ravel(), :2]
    low, high = places.min(axis=0), places.max(axis=0)
    box = Box(left=low[0], low=low[1], right=high[0], high=high[1])
    return box.wider(design.columns.radius + design.frame.clearance + FRAME_WALL)


def board_box(design: SkinDesign) -> Box:
    """The board's outline, without what its connector needs beyond it."""
    return frame_box(design).wider(BOARD_MARGIN)


def pillar_places(design: SkinDesign) -> Floats:
    """Middles of the shear layer's pillars, (P, 2), m, evenly round and clear of magnets and chips.

    Pillars stand in rows as near to square as their number allows; one that would meet a base
    magnet's pocket or a chip on the board's lower face moves straight away from it.

    Raises
    ------
    DesignError
        If pillars run into each other, or stand beside the board.
    """
    count, extent = design.shear_layer.pillars, geometry(design).extent
    rows = max(1, round(float(np.sqrt(count * extent[1] / extent[0]))))
    sizes = [len(part) for part in np.array_split(np.arange(count), rows)]
    places = [
        ((k + 0.5) / size * extent[0], (row + 0.5) / rows * extent[1])
        for row, size in enumerate(sizes)
        for k in range(size)
    ]
    moved = np.array(places)
    for magnet, at in zip(design.magnets, geometry(design).magnets, strict=True):
        if magnet.mount != "base":
            continue
        room = magnet.radius + design.shear_layer.radius + 2e-3
        off = moved - at[:2]
        apart = np.linalg.norm(off, axis=1)
        near = apart < room
        away = np.where(apart[near, None] > 1e-9, off[near], [1.0, 0.0])
        away = away / np.linalg.norm(away, axis=1, keepdims=True)
        moved[near] = at[:2] + room * away
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
