"""Holders of the magnets on the sheet, with their lids and their columns to the sheet.

Decides the outline round a magnet and between its columns, which the design leaves open. A holder
is drawn upright over its magnet's place, where columns of a limb lean away from it.
"""

from typing import Any, Final

import numpy as np
import shapely
import shapely.affinity
from shapely import Polygon

from smoskin.arrays import Floats
from smoskin.design.skin import Magnet, SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.layout import columns_developed, magnet_height, pose
from smoskin.fabrication.moulds.solids import Part, Slab, disc, extruded, hole
from smoskin.fabrication.pattern.flat import fold_at_b
from smoskin.fabrication.workshop import Workshop
from smoskin.mechanics.sheet.holders import holder_columns
from smoskin.origami.geometry import geometry

_FLOOR: Final = 0.8e-3
"""m: plate under a magnet in its holder."""
_LID: Final = 0.8e-3
"""m: plate over it; the four sectors push each other apart."""
_WALL: Final = 1.2e-3
"""m: wall of a holder round its magnet and its notches."""
_SLIVER: Final = 0.05e-3
"""m: width of what is left where outlines nearly coincide."""
_DRIVER: Final = 2e-3
"""m: radius of the column by which the sheet drives a magnet."""


def holders(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A holder and a lid for every magnet on the sheet.

    Raises
    ------
    DesignError
        If columns with their play leave no room for a sound wall, or a chip is in the way.
    """
    parts = []
    for magnet, place in zip(design.magnets, geometry(design).magnet_places, strict=True):
        if magnet.mount == "sheet":
            parts += _holder(design, workshop, magnet, pose(design, place))
    return parts


def _holder(design: SkinDesign, workshop: Workshop, magnet: Magnet, there: Floats) -> list[Part]:
    """One holder with its lid, where they stand."""
    middle = magnet_height(design, magnet)
    bottom, top = middle - magnet.height / 2 - _FLOOR, middle + magnet.height / 2
    chip = -design.columns.height + 1e-3
    if bottom - chip < workshop.fit + 0.5e-3:
        raise DesignError(
            f"magnet {magnet.name!r}'s holder must stay {1e3 * workshop.fit + 0.5:.2f} mm above "
            f"its chip's package; got {1e3 * (bottom - chip):.2f} mm: widen the gap"
        )
    outline = _outline(design, workshop, magnet, there, (bottom, top + _LID))
    pocket = disc((0.0, 0.0), magnet.radius + workshop.fit)
    ring = outline.difference(pocket)
    sound = ring.buffer(-workshop.wall / 2).buffer(workshop.wall / 2)
    if sound.area < 0.5 * ring.area:
        raise DesignError(
            f"magnet {magnet.name!r}'s holder must have walls of {1e3 * workshop.wall:g} mm "
            "between pocket and columns; got less: take a smaller magnet, less play or thinner "
            "columns"
        )
    # Only what is too thin goes, so that walls and floor keep one edge elsewhere.
    walls = ring.difference(ring.difference(sound.buffer(_SLIVER)).buffer(_SLIVER))
    body = Slab(outline, bottom, bottom + _FLOOR), Slab(walls, bottom, top)
    lid, name = Slab(outline, top, top + _LID), magnet.name
    title = f"holder of {name}; its notches hang on the columns beside it"
    parts = [
        extruded(f"holder_{name}", title, *body, pose=there, silicone=True),
        extruded(f"holder_lid_{name}", f"lid of {name}, glued on", lid, pose=there),
    ]
    if magnet.driver == "column":
        parts.append(_driver(design, workshop, magnet, there, top + _LID))
    return parts


def _outline(
    design: SkinDesign,
    workshop: Workshop,
    magnet: Magnet,
    there: Floats,
    heights: tuple[float, float],
) -> Any:
    """Outline of a holder between two heights over its place, notched to all columns there."""
    skin = geometry(design)
    gripping, bearing = holder_columns(design, magnet)
    reach = design.columns.radius + magnet.play
    pieces = [disc((0.0, 0.0), magnet.radius + workshop.fit + _WALL)]
    for vertex in sorted({*gripping.tolist(), *bearing.tolist()}):
        ends, _ = _passing(design, skin.developed[vertex, :2], there, heights)
        arm = shapely.LineString([(0.0, 0.0), ends.mean(axis=0)])
        pieces.append(arm.buffer(reach + _WALL, cap_style="flat"))
    outline = shapely.union_all(pieces)
    near = outline.buffer(2 * reach)
    for place in columns_developed(design):
        ends, lean = _passing(design, place, there, heights)
        if near.contains(shapely.Point(ends[0])):
            notch = [hole(end, reach / lean) for end in ends]
            outline = outline.difference(shapely.union_all(notch).convex_hull)
    for beyond in _beside(design, magnet, there):
        outline = outline.difference(beyond) if outline.intersects(beyond) else outline
    # Slivers that no printer makes go; the piece that holds the magnet stays.
    outline = outline.buffer(-workshop.wall / 2).buffer(workshop.wall / 2)
    outline = max(getattr(outline, "geoms", [outline]), key=lambda piece: piece.area)
    return outline.simplify(_SLIVER / 10)


def _beside(design: SkinDesign, magnet: Magnet, there: Floats) -> list[Any]:
    """What is nearer to each other magnet on the sheet, a play from its holder; seen upright."""
    skin, areas = geometry(design), []
    for other, place in zip(design.magnets, skin.magnet_places, strict=True):
        if other.mount == "sheet" and other.name != magnet.name:
            way = ((pose(design, place)[:, 3] - there[:, 3]) @ there[:, :3])[:2]
            far = float(np.hypot(*way))
            begin, turn = (far - magnet.play) / 2, float(np.arctan2(way[1], way[0]))
            half = shapely.box(begin, -far, begin + far, far)
            areas.append(shapely.affinity.rotate(half, turn, (0.0, 0.0), use_radians=True))
    return areas


def _passing(
    design: SkinDesign, column: Floats, there: Floats, heights: tuple[float, float]
) -> tuple[Floats, float]:
    """Places (2, 2), m, at which a column's axis passes heights, and the cosine of its lean.

    Seen upright over the magnet's place; the column is told by its own developed place.
    """
    own = pose(design, column)
    top, axis = (own[:, 3] - there[:, 3]) @ there[:, :3], own[:, 2] @ there[:, :3]
    away = (np.array(heights) - top[2]) / axis[2]
    return top[:2] + away[:, None] * axis[:2], float(axis[2])


def _driver(
    design: SkinDesign, workshop: Workshop, magnet: Magnet, there: Floats, foot: float
) -> Part:
    """The rubber column from a holder's lid to the sheet straight above, which moves the magnet."""
    vertices = (geometry(design).sheet.vertices - there[:, 3]) @ there[:, :3]
    above = foot
    for corners in vertices[geometry(design).sheet.facets]:
        if Polygon(corners[:, :2]).buffer(1e-9).covers(shapely.Point(0.0, 0.0)):
            sides = np.stack([corners[1] - corners[0], corners[3] - corners[0]], axis=1)
            share = np.linalg.solve(sides[:2], -corners[0, :2])
            above = max(above, float(corners[0, 2] + sides[2] @ share))
    top = above - _clear_of_sheet(design, workshop)
    if top - foot < workshop.wall:
        raise DesignError(
            f"magnet {magnet.name!r}'s column to the sheet must be at least "
            f"{1e3 * workshop.wall:.2f} mm high; got {1e3 * (top - foot):.2f} mm"
        )
    slab = Slab(disc((0.0, 0.0), _DRIVER), foot, top)
    title = f"rubber column from the lid of {magnet.name} to the sheet, dripped to it"
    return extruded(f"holder_driver_{magnet.name}", title, slab, pose=there, silicone=True)


def _clear_of_sheet(design: SkinDesign, workshop: Workshop) -> float:
    """Depth below the sheet at which a column of `_DRIVER`'s radius clears the lower panels, m."""
    fold = max(fold_at_b(design, ridge=ridge) for ridge in (True, False))
    return workshop.plate(design) / float(np.cos(fold / 2)) + _DRIVER * float(np.tan(fold / 2))
