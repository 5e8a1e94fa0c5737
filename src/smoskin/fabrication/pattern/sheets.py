"""Drawings of the sheet's parts: both panel sheets in their carriers, film, adhesive, releases.

Decides how panels hang together until they are bonded, where pins, marks and labels stand, and that
the lower sheet is drawn as its cutter sees it, mirrored. Origin: the carrier's low left corner.
"""

from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
import shapely
from shapely import LineString, Point, Polygon
from shapely.ops import linemerge

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.drawing import Circle, Drawing, Label, Line
from smoskin.fabrication.pattern.flat import FlatSheet, flat_sheet, outlines
from smoskin.fabrication.workshop import Workshop

ROUND: Final = 16
"""Straight lines in a quarter of a hole."""
_MARK: Final = 3e-3
"""m: half of an alignment mark."""
_MITRE: Any = {"join_style": "mitre", "mitre_limit": 5.0}


class Panels(NamedTuple):
    """Panels of one face as they are when finished."""

    shapes: list[Polygon]
    """In the order of the facets, m; the origin is the carrier's corner."""
    area: float
    """m2."""


def panels(sheet: FlatSheet, workshop: Workshop, *, upper: bool) -> Panels:
    """Finished panels of one face, seen from above, holes of their vertices taken out.

    Raises
    ------
    DesignError
        If the holes cut a panel apart or take half of it.
    """
    shift = workshop.border + workshop.slot
    corners = outlines(sheet, sheet.upper if upper else sheet.lower) + shift
    inner = set(sheet.inner.tolist())
    discs = {v: Point(sheet.vertices[v] + shift).buffer(sheet.hole, quad_segs=ROUND) for v in inner}
    shapes = []
    for facet, four in zip(sheet.facets.tolist(), corners, strict=True):
        shape = Polygon(four)
        for vertex in facet:
            if vertex in inner:
                shape = shape.difference(discs[vertex])
        if shape.geom_type != "Polygon" or shape.area < Polygon(four).area / 2:
            raise DesignError(
                f"vertex holes must leave panels whole; got holes of {2e3 * sheet.hole:.2f} mm in "
                f"panels of {1e6 * Polygon(four).area:.0f} mm2: take narrower gaps or larger cells"
            )
        shapes.append(shape)
    return Panels(shapes, float(sum(shape.area for shape in shapes)))


def sheet_drawings(design: SkinDesign, workshop: Workshop) -> list[Drawing]:
    """Every drawing of the sheet's parts."""
    sheet = flat_sheet(design, workshop)
    upper, lower = (_panel_sheet(design, sheet, workshop, upper=up) for up in (True, False))
    mirrored = [_mirrored(drawing) for drawing in lower]
    film, adhesive = _film(design, sheet, workshop), _adhesive(design, sheet, workshop)
    return [upper[0], mirrored[0], film, adhesive, upper[1], mirrored[1]]


def carrier_size(sheet: FlatSheet, workshop: Workshop) -> tuple[float, float]:
    """Extent of the carriers, m."""
    x, y = (sheet.extent + 2 * (workshop.border + workshop.slot)).tolist()
    return x, y


def _panel_sheet(
    design: SkinDesign, sheet: FlatSheet, workshop: Workshop, *, upper: bool
) -> tuple[Drawing, Drawing]:
    """One panel sheet in its carrier, seen from above, and the cut that frees its panels."""
    made = panels(sheet, workshop, upper=upper)
    bridges = _bridges(sheet, workshop)
    by_facet = _bridges_of_facets(sheet, bridges)
    cuts, releases = [], []
    for shape, own in zip(made.shapes, by_facet, strict=True):
        path = shape.buffer(workshop.kerf / 2, **_MITRE).exterior
        zones = shapely.union_all(own)
        cuts += _lines("CUT", path.difference(zones))
        releases += _lines("RELEASE", path.intersection(zones))
    rim = _rim(sheet, workshop)
    opening = rim.buffer(workshop.slot - workshop.kerf / 2, **_MITRE).exterior
    all_zones = shapely.union_all(list(bridges.values()))
    cuts += _lines("CUT", opening.difference(all_zones))
    name, face = ("upper", "above") if upper else ("lower", "below, mirrored")
    finished = [Line("PANEL", np.asarray(shape.exterior.coords)[:-1]) for shape in made.shapes]
    thick = 1e3 * design.panels.thickness / 2
    frame = _frame(sheet, workshop, kerf=True)
    title = (
        f"{design.name} {design.content_hash[:12]}: {name} panels, {design.panels.material} "
        f"{thick:g} mm with adhesive {1e3 * workshop.adhesive:g} mm on the film's side, seen from "
        f"{face}"
    )
    main = replace(
        frame,
        name=name,
        title=title,
        lines=(*frame.lines, *cuts, *finished),
        labels=(*frame.labels, *_labels(design, sheet, workshop, name.upper())),
    )
    trims = [Line("TRIM", np.asarray(rim.exterior.coords)[:-1])] if upper else []
    release = replace(
        frame,
        name=f"{name}_release",
        title=f"{design.name} {design.content_hash[:12]}: after bonding, cut the bridges of the "
        f"{name} face only as deep as the panels ({thick:g} mm)"
        + ("; then trim the film along TRIM" if upper else ""),
        lines=(*_outline(frame), *releases, *trims),
        circles=_pins(sheet, workshop, 0.0),
        labels=(Label(_text_place(workshop), f"{name.upper()} RELEASE, NOT THE FILM"),),
    )
    return main, release


def _film(design: SkinDesign, sheet: FlatSheet, workshop: Workshop) -> Drawing:
    """The film with its vertex holes, creases to see and perforations, if any."""
    shift = workshop.border + workshop.slot
    frame = _frame(sheet, workshop, kerf=True)
    holes = [
        Circle("HOLE", (x + shift, y + shift), sheet.hole - workshop.kerf / 2)
        for x, y in sheet.vertices[sheet.inner].tolist()
    ]
    creases = [
        Line("MOUNTAIN" if ridge else "VALLEY", sheet.vertices[pair] + shift, closed=False)
        for pair, ridge in zip(sheet.creases, sheet.mountain.tolist(), strict=True)
    ]
    return replace(
        frame,
        name="film",
        title=f"{design.name} {design.content_hash[:12]}: film, {design.creases.material} "
        f"{1e6 * design.creases.thickness:g} um, seen from above",
        lines=(*frame.lines, *creases, *perforations(sheet, workshop)),
        circles=(*frame.circles, *holes),
        labels=(Label(_text_place(workshop), "FILM"),),
    )


def _adhesive(design: SkinDesign, sheet: FlatSheet, workshop: Workshop) -> Drawing:
    """The adhesive, which goes on the panel stock and is cut with the panels."""
    frame = _frame(sheet, workshop, kerf=True)
    return replace(
        frame,
        name="adhesive",
        title=f"{design.name} {design.content_hash[:12]}: double-sided adhesive "
        f"{1e3 * workshop.adhesive:g} mm, two of these; laminate it on the panel stock, then cut "
        "both at once",
        labels=(Label(_text_place(workshop), "ADHESIVE 2x"),),
    )


def perforations(sheet: FlatSheet, workshop: Workshop) -> list[Line]:
    """Cuts along the creases, none near a vertex's hole; empty without perforation."""
    if not workshop.perforation:
        return []
    shift, pitch = workshop.border + workshop.slot, workshop.perforation_pitch
    skip = sheet.hole + workshop.corner_skip
    lines = []
    for pair in sheet.creases.tolist():
        start, end = sheet.vertices[pair] + shift
        length = float(np.linalg.norm(end - start))
        count = int((length - 2 * skip) / pitch)
        along = (end - start) / length
        for k in range(max(count, 0)):
            middle = length / 2 + (k - (count - 1) / 2) * pitch
            half = workshop.perforation * pitch / 2
            ends = [start + (middle - half) * along, start + (middle + half) * along]
            lines.append(Line("PERF", np.array(ends), closed=False))
    return lines


def _rim(sheet: FlatSheet, workshop: Workshop) -> Polygon:
    """The sheet's outline in its carrier."""
    return Polygon(sheet.vertices[sheet.rim] + workshop.border + workshop.slot)


def _bridges(sheet: FlatSheet, workshop: Workshop) -> dict[tuple[int, int], Polygon]:
    """Zone of the bridge in the middle of every edge, by the edge's vertices."""
    shift = workshop.border + workshop.slot
    widest = max(*sheet.at_a, *sheet.at_b) / 2 + workshop.kerf
    ring = np.stack([sheet.rim, np.roll(sheet.rim, -1)], axis=1)
    reaches = [(pair, widest) for pair in sheet.creases.tolist()]
    reaches += [(pair, 2 * workshop.slot) for pair in ring.tolist()]
    zones = {}
    for pair, reach in reaches:
        start, end = sheet.vertices[pair] + shift
        along = (end - start) / np.linalg.norm(end - start)
        across = np.array([-along[1], along[0]])
        middle, half = (start + end) / 2, along * workshop.bridge / 2
        wide = across * reach
        corners = [middle - half - wide, middle + half - wide]
        corners += [middle + half + wide, middle - half + wide]
        zones[min(pair), max(pair)] = Polygon(corners)
    return zones


def _bridges_of_facets(
    sheet: FlatSheet, bridges: dict[tuple[int, int], Polygon]
) -> list[list[Polygon]]:
    """Zones of the four bridges of each panel."""
    return [
        [bridges[min(f[k], f[(k + 1) % 4]), max(f[k], f[(k + 1) % 4])] for k in range(4)]
        for f in sheet.facets.tolist()
    ]


def _lines(layer: str, path: Any) -> list[Line]:
    """Open lines of what is left of a closed path."""
    if path.geom_type == "MultiLineString":
        path = linemerge(path)
    parts = [part for part in getattr(path, "geoms", [path]) if isinstance(part, LineString)]
    return [Line(layer, np.asarray(part.coords), closed=False) for part in parts if part.length]


def _frame(sheet: FlatSheet, workshop: Workshop, *, kerf: bool) -> Drawing:
    """What every drawing has: outline, origin, pins and marks."""
    width, height = carrier_size(sheet, workshop)
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    lines = [Line("CUT", corners), *_origin()]
    for x in (width / 2, workshop.border / 2, width - workshop.border / 2):
        for y in (height / 2, workshop.border / 4, height - workshop.border / 4):
            if (x == width / 2) != (y == height / 2):
                lines += _cross(x, y)
    return Drawing(
        name="",
        title="",
        size=(width, height),
        lines=tuple(lines),
        circles=_pins(sheet, workshop, workshop.kerf if kerf else 0.0),
    )


def _outline(frame: Drawing) -> list[Line]:
    """The frame's lines, to see and not to cut."""
    return [Line("OUTLINE", line.points) if line.layer == "CUT" else line for line in frame.lines]


def _origin() -> list[Line]:
    """An L at the origin, along x and y."""
    return [Line("ALIGN", np.array([[6e-3, 0.5e-3], [0.5e-3, 0.5e-3], [0.5e-3, 6e-3]]), False)]


def _cross(x: float, y: float) -> list[Line]:
    """An alignment mark."""
    arms = ([[x - _MARK, y], [x + _MARK, y]], [[x, y - _MARK], [x, y + _MARK]])
    return [Line("ALIGN", np.array(arm), closed=False) for arm in arms]


def pin_places(sheet: FlatSheet, workshop: Workshop) -> Floats:
    """Middles of the registration pins, (4, 2), m; one stands aside so that no sheet goes wrong."""
    width, height = carrier_size(sheet, workshop)
    near = workshop.border / 2
    return np.array(
        [
            [near, near],
            [width - near, near],
            [width - near, height - near],
            [3 * near, height - near],
        ]
    )


def _pins(sheet: FlatSheet, workshop: Workshop, kerf: float) -> tuple[Circle, ...]:
    """Holes of the pins."""
    radius = (workshop.pin - kerf) / 2
    return tuple(Circle("HOLE", (x, y), radius) for x, y in pin_places(sheet, workshop).tolist())


def _text_place(workshop: Workshop) -> tuple[float, float]:
    """Place of a sheet's name."""
    return 1.5 * workshop.border, 0.35 * workshop.border


def _labels(design: SkinDesign, sheet: FlatSheet, workshop: Workshop, name: str) -> list[Label]:
    """The sheet's name, and numbers of cells along its carrier."""
    shift = workshop.border + workshop.slot
    columns, rows = design.cells
    grid = sheet.vertices.reshape(2 * columns + 1, 2 * rows + 1, 2) + shift
    labels = [Label(_text_place(workshop), f"{name} {design.name} {design.content_hash[:8]}")]
    labels += [
        Label((grid[2 * n + 1, 0, 0], 0.7 * workshop.border), f"x{n + 1}", 2e-3)
        for n in range(columns)
    ]
    labels += [
        Label((0.5 * workshop.border, grid[0, 2 * m + 1, 1]), f"y{m + 1}", 2e-3)
        for m in range(rows)
    ]
    return labels


def _mirrored(drawing: Drawing) -> Drawing:
    """A drawing as seen from the other side, texts readable there."""
    width = drawing.size[0]

    def flip(points: Floats) -> Floats:
        return np.asarray(points * [-1.0, 1.0] + [width, 0.0])

    marks = [line for line in drawing.lines if not _is_origin(line)]
    return replace(
        drawing,
        lines=(*(Line(m.layer, flip(m.points), m.closed) for m in marks), *_origin()),
        circles=tuple(
            Circle(c.layer, (width - c.centre[0], c.centre[1]), c.radius) for c in drawing.circles
        ),
        labels=tuple(
            Label((width - t.place[0] - 0.7 * t.height * len(t.text), t.place[1]), t.text, t.height)
            for t in drawing.labels
        ),
    )


def _is_origin(line: Line) -> bool:
    """Whether a line marks the origin."""
    return line.layer == "ALIGN" and len(line.points) == 3
