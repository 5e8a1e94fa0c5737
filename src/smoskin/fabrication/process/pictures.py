"""Pictures of the process sheet, cut from this design's own solids and outlines."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.fabrication.drawing import LAYERS, Drawing
from smoskin.fabrication.moulds.solids import Part, disc
from smoskin.fabrication.moulds.tools import sector
from smoskin.fabrication.pattern.flat import FlatSheet
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry

COLOURS: Final = {
    "panel": "#9ecae1",
    "upper": "#9ecae1",
    "lower": "#7fb3d5",
    "film": "#e6843b",
    "column": "#f4cccc",
    "pillar": "#f4cccc",
    "scale": "#d9c2e9",
    "cover": "#d9c2e9",
    "guide": "#c9b458",
    "magnet": "#555555",
    "sunk": "#555555",
    "holder": "#b6d7a8",
    "frame": "#cccccc",
    "board": "#4d7f4d",
    "shell": "#a9b7c6",
    "chip": "#202020",
    "base": "#dddddd",
    "plug": "#bbbbbb",
    "tool": "#d0d8e0",
}
"""Fill by what a part is."""


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A polygon with its fill, or a line without."""

    points: Floats
    """(K, 2), m."""
    fill: str | None = None
    stroke: str = "#333333"
    closed: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """Shapes and a caption."""

    shapes: tuple[Shape, ...]
    caption: str

    @property
    def box(self) -> Floats:
        """(2, 2), m: low and high corner."""
        points = np.concatenate([shape.points for shape in self.shapes])
        return np.array([points.min(axis=0), points.max(axis=0)])


def drawn(drawing: Drawing, caption: str) -> Picture:
    """A drawing as a picture."""
    shapes = [
        Shape(line.points, None, LAYERS[line.layer][1], line.closed) for line in drawing.lines
    ]
    for circle in drawing.circles:
        ring = np.asarray(disc(circle.centre, circle.radius).exterior.coords)[:-1]
        shapes.append(Shape(ring, None, LAYERS[circle.layer][1]))
    return Picture(tuple(shapes), caption)


def section(parts: Sequence[Part], at: float, caption: str, *, across_y: bool = True) -> Picture:
    """Parts cut by a plane across y (or x), seen from the front."""
    shapes = []
    for part in parts:
        kind = part.name.split("_")[0]
        fill = COLOURS.get(kind, COLOURS["tool"])
        shapes += _cut(part.solid, at, fill, across_y=across_y)
    return Picture(tuple(shapes), caption)


def _filled(cut: Any, fill: str) -> list[Shape]:
    """Outlines of a cut, its holes white."""
    rings = [np.asarray(points) for points in cut.to_polygons()]
    areas = [
        float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) for x, y in (r.T for r in rings)
    ]
    shapes = [Shape(ring, fill) for ring, area in zip(rings, areas, strict=True) if area > 0]
    holes = [Shape(ring, "#ffffff") for ring, area in zip(rings, areas, strict=True) if area <= 0]
    return shapes + holes


def _cut(solid: Any, at: float, fill: str, *, across_y: bool) -> list[Shape]:
    """Outlines of a solid in a plane, along the other horizontal axis and z, m."""
    ends = np.array(solid.bounding_box()).reshape(2, 3)
    if not ends[0, int(across_y)] < at < ends[1, int(across_y)]:
        return []
    # The plane is turned to lie flat: (x, z, -y), or (y, z, x).
    turn = (
        np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]])
        if across_y
        else np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0]])
    )
    return _filled(solid.transform(turn).slice(-at if across_y else at), fill)


def plan(parts: Sequence[Part], height: float, caption: str) -> Picture:
    """Parts cut at a height, seen from above, the widest first: openings hide what is below."""
    shapes = []
    for part in sorted(parts, key=lambda part: -float(part.size[:2].prod())):
        low, high = np.array(part.solid.bounding_box())[[2, 5]]
        if low < height < high:
            fill = COLOURS.get(part.name.split("_")[0], COLOURS["tool"])
            shapes += _filled(part.solid.slice(height), fill)
    return Picture(tuple(shapes), caption)


def within(picture: Picture, middle: Sequence[float], half: Sequence[float]) -> Picture:
    """The shapes of a picture that reach into a window, cut to it."""
    import shapely

    window = shapely.box(*np.subtract(middle, half).tolist(), *np.add(middle, half).tolist())
    shapes = []
    for shape in picture.shapes:
        seen = shapely.Polygon(shape.points).buffer(0).intersection(window)
        for piece in getattr(seen, "geoms", [seen]):
            if piece.geom_type == "Polygon" and not piece.is_empty:
                points = np.asarray(piece.exterior.coords)[:-1]
                shapes.append(Shape(points, shape.fill, shape.stroke))
    return Picture(tuple(shapes), picture.caption)


def over(picture: Picture, outline: Floats) -> Picture:
    """A picture with an outline round it."""
    return Picture((Shape(outline, "#ffffff"), *picture.shapes), picture.caption)


def layers_of_a_crease(design: SkinDesign, sheet: FlatSheet, workshop: Workshop) -> Picture:
    """Both panels on either side of a flat b-crease that becomes a ridge, four times as thick."""
    times, reach = 4.0, 4e-3
    film = design.creases.thickness * times
    glue, panel = workshop.adhesive * times, design.panels.thickness / 2 * times
    shapes = [_bar(-reach, reach, -film / 2, film / 2, "film")]
    for side, gap in ((1.0, sheet.at_b.convex), (-1.0, sheet.at_b.concave)):
        for left, right in ((-reach, -gap / 2), (gap / 2, reach)):
            for low, high, kind in (
                (film / 2, film / 2 + glue, "scale"),
                (film / 2 + glue, film / 2 + glue + panel, "panel"),
            ):
                ends = sorted((side * low, side * high))
                shapes.append(_bar(left, right, ends[0], ends[1], kind))
    caption = (
        f"A b-crease that becomes a ridge, thicknesses drawn four times: gap "
        f"{1e3 * sheet.at_b.convex:.2f} mm above, where the film stays free, "
        f"{1e3 * sheet.at_b.concave:.2f} mm below, where panels close up"
    )
    return Picture(tuple(shapes), caption)


def _bar(left: float, right: float, low: float, high: float, kind: str) -> Shape:
    """A filled rectangle."""
    points = np.array([[left, low], [right, low], [right, high], [left, high]])
    return Shape(points, COLOURS[kind])


def sectors(design: SkinDesign) -> Picture:
    """The four sectors of a magnet with their magnetisation."""
    magnet, shapes = design.magnets[0], []
    quarter = np.asarray(sector(magnet.radius).exterior.coords)[:-1]
    arrow = np.array([[0.75, 0.0], [0.3, 0.0], [0.42, 0.08], [0.3, 0.0], [0.42, -0.08]])
    arrow = arrow * magnet.radius if magnet.polarity > 0 else (1.0 - arrow) * magnet.radius
    for k in range(4):
        turn = np.pi / 2 * k
        matrix = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        shapes.append(Shape(quarter @ matrix, "#d8d8d8"))
        shapes.append(Shape(arrow @ matrix, None, "#c00000", closed=False))
    way = "towards" if magnet.polarity > 0 else "away from"
    return Picture(
        tuple(shapes), f"Four sectors, each magnetised along its bisector {way} the middle"
    )


def across_a_magnet(design: SkinDesign) -> float:
    """A place along x that cuts the last magnet, columns and panels beside their creases, m."""
    return float(geometry(design).magnet_places[-1, 0]) + 0.6 * design.columns.radius


def through_a_magnet(design: SkinDesign, parts: Sequence[Part]) -> Picture:
    """A section of the assembled skin through a magnet on the sheet."""
    sheet_magnets = [
        (magnet, place)
        for magnet, place in zip(design.magnets, geometry(design).magnet_places, strict=True)
        if magnet.mount == "sheet"
    ]
    magnet, place = (
        sheet_magnets[0]
        if sheet_magnets
        else (design.magnets[0], geometry(design).magnet_places[0])
    )
    picture = section(parts, float(place[1]) + 1e-4, "")
    caption = f"The assembled skin cut through magnet {magnet.name}"
    low, high = picture.box
    close = within(picture, (float(place[0]), float(low[1] + high[1]) / 2), (35e-3, 30e-3))
    return Picture(close.shapes, caption)
