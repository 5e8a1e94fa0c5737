"""Outlines of the frame and the board, which stand round the columns.

z = 0 is the surface of the bottom vertices, x and y those of the sheet, metres. On a limb outlines
are laid out flat, as the board is before it is rolled on to its shell, with true lengths at a
level, by default the board's; heights are as they are. On a planar skin every level is the same. A
box has sides along the sheet's x and y: on a cone, where its y are arcs in the middle of x, it is
laid out as a part of a sector.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry

FILM: Final = 0.11e-3
"""m: flexible circuit that lies on a limb's carrier shell."""
FRAME_WALL: Final = 3e-3
"""m: thickness of the frame's wall."""
BOARD_MARGIN: Final = 2e-3
"""m: board outside the frame's wall."""
SCALE_PAD: Final = 1.0e-3
"""m: thickness of a top scale, unless a workshop makes another."""
SCALE_GAP: Final = 1.0e-3
"""m: between neighbouring scales."""
SCALE_BOSS: Final = 2.0e-3
"""m: radius of the patch by which a scale is bonded to its top vertex."""
SCALE_RISE: Final = 1.5e-3
"""m: height of that patch."""
_PIECES: Final = 64
"""Straight pieces of a side that is bent on a cone: an arc of 160 mm within 2 um."""


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


def laid_flat(design: SkinDesign, developed: Any, level: float | None = None) -> Floats:
    """Flat places (K, 2) at a level of developed ones (K, 2), m."""
    return geometry(design).roll.flat(developed, level_of(design) if level is None else level)


def arcs_at(design: SkinDesign, y: Any, start: float, end: float) -> Any:
    """Arcs in the middle of x at one level of those at another, both m; the middle stays."""
    roll = geometry(design).roll
    share = roll.stretch(end, roll.along) / roll.stretch(start, roll.along)
    return roll.middle + (np.asarray(y) - roll.middle) * share


def boxed(design: SkinDesign, box: Box, level: float) -> Floats:
    """Corners (K, 2), m, of a box at a level, laid flat there; on a cone its ends are arcs."""
    corners = box.corners
    if geometry(design).roll.rise:
        share = np.linspace(0.0, 1.0, _PIECES, endpoint=False)[:, None]
        ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        corners = np.concatenate([start + share * (end - start) for start, end in ends])
    developed = np.stack([corners[:, 0], arcs_at(design, corners[:, 1], level, 0.0)], axis=-1)
    return laid_flat(design, developed, level)


def cell_width(design: SkinDesign, row: int, level: float) -> float:
    """Arc of a cell at a level, m, in a row along x; on a cone where it is narrowest."""
    skin = geometry(design)
    x, back = skin.lines[0][row], float(skin.cell.length) / 2
    return float(
        skin.cell.width * min(skin.roll.stretch(level, x + side) for side in (-back, back))
    )


def shell_thickness(design: SkinDesign) -> float:
    """Thickness of the shell under a limb's flexible circuit, m; none under a planar board."""
    return design.board.thickness - circuit_thickness(design)


def frame_box(design: SkinDesign, level: float | None = None) -> Box:
    """Outer faces of the frame's wall: the rim columns, their clearance and the wall."""
    edge, at = frame_level(design), level_of(design) if level is None else level
    skin = geometry(design)
    roll, places = skin.roll, skin.developed[skin.sheet.columns.ravel(), :2]
    (left, low), (right, high) = places.min(axis=0), places.max(axis=0)
    reach = design.columns.radius + design.frame.clearance + FRAME_WALL
    # On a cone the wall is as thick as this at its narrow end.
    narrow = min(roll.stretch(edge, x) for x in (left - reach, right + reach))
    aside = reach * roll.stretch(edge, roll.along) / narrow
    low, high = arcs_at(design, [low, high], 0.0, edge)
    low, high = arcs_at(design, [low - aside, high + aside], edge, at).tolist()
    return Box(left=float(left) - reach, low=low, right=float(right) + reach, high=high)


def board_box(design: SkinDesign, level: float | None = None) -> Box:
    """The rectangle of the board, laid out flat, without what its connector needs beyond it.

    On a cone it is the smallest one round the frame's sector.
    """
    own = level_of(design)
    corners = _round(boxed(design, frame_box(design).wider(BOARD_MARGIN), own))
    if level is None or level == own:
        return corners
    developed = geometry(design).roll.from_flat(corners.corners, own)
    return _round(laid_flat(design, developed, level))


def _round(places: Floats) -> Box:
    """The smallest rectangle round flat places (K, 2), m."""
    (left, low), (right, high) = places.min(axis=0).tolist(), places.max(axis=0).tolist()
    return Box(left=left, low=low, right=right, high=high)
