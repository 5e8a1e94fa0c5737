"""Cover panels on guided bars, one for each cell, in place of scales: SI Figure S16.

Decides what the figure leaves open: bars and their play, the bushes that guide them, and how far a
cover sinks before it is stopped. Bars are straight: under 1 N a cell sinks by 0.1 to 0.4 mm and its
neighbours by nearly as much, so that no step on a bar would tell the pressed one from them.
"""

from dataclasses import replace
from typing import Final

import numpy as np
import shapely
from shapely import Polygon

from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.layout import pose
from smoskin.fabrication.moulds.roll import rolled
from smoskin.fabrication.moulds.sheet import clear_of_ridge
from smoskin.fabrication.moulds.solids import Part, Slab, disc, extruded, prism
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import (
    FRAME_WALL,
    Box,
    arcs_at,
    boxed,
    cell_width,
    frame_box,
    frame_level,
)

PLAY: Final = 0.25e-3
"""m: of a bar in its bush on every side; covers that are not pressed move less, and stay free."""
STROKE: Final = 1.5e-3
"""m: by which a cover sinks until its panel meets the guide, several times what 1 N does."""
_FRICTION: Final = 0.2
"""Coefficient of friction at which a bar still slides under a touch on its panel's corner."""
_BAR: Final = 1.5e-3
"""m: radius of a bar."""
_BUSH: Final = 1.5e-3
"""m: wall of a bush."""
_RIB: Final = (3e-3, 2.5e-3)
"""m: width and height of the guide's ribs."""
_POST: Final = 8e-3
"""m: width of its posts on the frame."""
_PANEL: Final = 1.2e-3
"""m: thickness of a cover."""
_GAP: Final = 1e-3
"""m: between neighbouring covers, and between the guide and the sheet."""


def foot(design: SkinDesign, workshop: Workshop) -> float:
    """Height of the bars' feet over the bottom vertices, m: on the top vertices' panels."""
    return float(geometry(design).cell.height) + clear_of_ridge(design, workshop)


def panel_size(design: SkinDesign, workshop: Workshop, row: int = 0) -> tuple[float, float]:
    """Extent of a cover in a row along x, m: a cell's where the covers lie, less a gap."""
    arc = cell_width(design, row, foot(design, workshop))
    return float(geometry(design).cell.length) - _GAP, arc - _GAP


def bush_length(design: SkinDesign, workshop: Workshop) -> float:
    r"""Length of a bush, m, in which a bar does not bind wherever its panel is touched.

    Notes
    -----
    Source: a force F at the arm a presses the bar on both ends of a bush of length L by F a / L; it
    slides while the friction of both, 2 mu F a / L, is less than F.
    """
    sizes = [panel_size(design, workshop, row) for row in range(design.cells[0])]
    return _FRICTION * max(float(np.hypot(*size)) for size in sizes)


def covers(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A panel on its bar over each cell."""
    low = foot(design, workshop)
    high = low + _GAP + bush_length(design, workshop) + STROKE
    thick = max(_PANEL, workshop.wall)
    bar = Slab(disc((0.0, 0.0), _BAR), low, high + thick / 2)
    parts = []
    for k, place in enumerate(geometry(design).tops.reshape(-1, 2)):
        x, y = (side / 2 for side in panel_size(design, workshop, k // design.cells[1]))
        panel = Slab(shapely.box(-x, -y, x, y), high, high + thick)
        name, there = f"cover_{k + 1}", pose(design, place)
        parts.append(extruded(name, "cover panel on its bar", bar, panel, pose=there))
    return parts


def guide(design: SkinDesign, workshop: Workshop) -> Part:
    """A lattice of bushes on posts that stand on the frame: it takes a drag into the board.

    Raises
    ------
    DesignError
        If bushes of neighbouring cells run into each other.
    """
    skin, low = geometry(design), foot(design, workshop) + _GAP
    around = _BAR + PLAY + max(_BUSH, workshop.wall)
    if (room := float(min(skin.cell.length, skin.cell.width)) - 2 * around) < workshop.wall:
        raise DesignError(
            f"cells must leave {1e3 * workshop.wall:.2f} mm between the bushes of their covers, "
            f"{2e3 * around:.1f} mm wide; got {1e3 * room:.2f} mm: take larger cells"
        )
    wide, deep = _RIB
    wall, half = frame_box(design, low), _POST / 2

    def outline(box: Box) -> Polygon:
        return Polygon(boxed(design, box, low))

    rim = outline(wall).difference(outline(wall.wider(-FRAME_WALL)))
    x, y = skin.lines
    ribs = [rim]
    ribs += [outline(replace(wall, left=a - wide / 2, right=a + wide / 2)) for a in x.tolist()]
    arcs = arcs_at(design, y, 0.0, low).tolist()
    ribs += [outline(replace(wall, low=a - wide / 2, high=a + wide / 2)) for a in arcs]
    middle = (wall.left + wall.right) / 2, (wall.low + wall.high) / 2
    # On a limb it comes over the sheet from above: posts at its sides, which lean, would not pass.
    columns = (wall.left, *middle[: design.limb is None], wall.right)
    feet = [
        outline(Box(left=a - half, low=b - half, right=a + half, high=b + half))
        for a in columns
        for b in (wall.low, middle[1], wall.high)
    ]
    posts = shapely.union_all(feet).intersection(rim)
    frame = frame_level(design)
    slabs = Slab(shapely.union_all(ribs), low, low + deep), Slab(posts, frame, low + deep)
    part = rolled(design, extruded("guide", "guide of the covers' bars, on the frame", *slabs), low)
    solid, high = part.solid, low + bush_length(design, workshop)
    bush = prism(disc((0.0, 0.0), around), low, high)
    hole = prism(disc((0.0, 0.0), _BAR + PLAY), low - deep, high + deep)
    there = [pose(design, place) for place in skin.tops.reshape(-1, 2)]
    for place in there:
        solid = solid + bush.transform(place)
    for place in there:
        solid = solid - hole.transform(place)
    return replace(part, solid=solid, slabs=(), pose=None)
