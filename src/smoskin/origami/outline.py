"""Outlines of the frame and the board, which stand round the columns.

z = 0 is the surface of the bottom vertices, x and y those of the sheet, metres. On a limb outlines
are laid out flat, as the board is before it is rolled on to its shell: y is the arc at a level, by
default the board's; heights and x are as they are. On a planar skin every level is the same.
"""

from dataclasses import dataclass, replace
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
