"""Gerber files as areas, read by gerbonara and joined by shapely."""

import warnings
from pathlib import Path
from typing import Any

from shapely import affinity
from shapely.geometry import LineString, Point, Polygon, box
from shapely.ops import unary_union


def area(path: Path) -> Any:
    """Everything that a Gerber file draws, mm."""
    from gerbonara import GerberFile
    from gerbonara.graphic_primitives import ArcPoly, Circle, Line, Rectangle
    from gerbonara.utils import MM

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        drawn = GerberFile.open(path)
    shapes = []
    for thing in drawn.objects:
        for part in thing.to_primitives(unit=MM):
            if isinstance(part, Circle):
                shapes.append(Point(part.x, part.y).buffer(part.r, quad_segs=32))
            elif isinstance(part, Line):
                line = LineString([(part.x1, part.y1), (part.x2, part.y2)])
                shapes.append(line.buffer(part.width / 2, quad_segs=32))
            elif isinstance(part, Rectangle):
                half = part.w / 2, part.h / 2
                shape = box(part.x - half[0], part.y - half[1], part.x + half[0], part.y + half[1])
                shapes.append(affinity.rotate(shape, part.rotation, use_radians=True))
            elif isinstance(part, ArcPoly):
                shapes.append(Polygon(part.outline).buffer(0))
            else:
                raise TypeError(type(part))
    return unary_union(shapes)


def area_apart(first: Path, second: Path) -> tuple[float, float]:
    """Area that one of two files draws and the other does not, and what the first draws, mm2."""
    ours, theirs = area(first), area(second)
    return ours.symmetric_difference(theirs).area, ours.area
