"""Drawings as lines, circles and labels on layers, and the files that they become.

Decides layers, their colours and that every file is in millimetres at 1:1 with the same bytes each
time. Hides the formats: DXF for cutters, SVG, and PDF for paper.
"""

import io
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final
from xml.sax.saxutils import escape

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import require
from smoskin.fabrication.workshop import LASER

LAYERS: Final = {
    "CUT": (1, "#ff0000"),
    "HOLE": (6, "#ff00ff"),
    "PERF": (30, "#ff7f00"),
    "RELEASE": (4, "#00a0a0"),
    "TRIM": (2, "#808000"),
    "PANEL": (8, "#a0a0a0"),
    "MOUNTAIN": (242, "#a00000"),
    "VALLEY": (5, "#0000ff"),
    "ALIGN": (3, "#008000"),
    "TEXT": (7, "#000000"),
    "OUTLINE": (9, "#c0c0c0"),
}
"""Colour index and colour of each layer; PANEL and OUTLINE are for reading, never cut."""
_READ_ONLY: Final = ("PANEL", "OUTLINE")
_POINTS: Final = 72 / 25.4
"""Points of a PDF in a millimetre."""
_INK: Final = 0.2
"""mm: width of a drawn line."""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A polygon or an open line."""

    layer: str
    points: Floats
    """(K, 2), m."""
    closed: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Circle:
    """A round hole or mark."""

    layer: str
    centre: tuple[float, float]
    """m."""
    radius: float
    """m."""


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A text from its low left corner."""

    place: tuple[float, float]
    """m."""
    text: str
    height: float = 3e-3
    """m."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """A drawing whose origin is the low left corner of its outline."""

    name: str
    """Name of its files."""
    title: str
    size: tuple[float, float]
    """m: extent of the outline."""
    lines: tuple[Line, ...] = ()
    circles: tuple[Circle, ...] = ()
    labels: tuple[Label, ...] = ()

    def moved(self, by: Sequence[float], *, turned: bool = False) -> "Drawing":
        """The drawing elsewhere, m, first turned by a quarter about its outline's corner."""
        shift = np.asarray(by, dtype=float)

        def to(places: Any) -> Floats:
            places = np.asarray(places, dtype=float)
            if turned:
                places = np.stack([self.size[1] - places[..., 1], places[..., 0]], axis=-1)
            return np.asarray(places + shift)

        def at(place: tuple[float, float]) -> tuple[float, float]:
            x, y = to(place).tolist()
            return x, y

        return Drawing(
            name=self.name,
            title=self.title,
            size=self.size[::-1] if turned else self.size,
            lines=tuple(Line(line.layer, to(line.points), line.closed) for line in self.lines),
            circles=tuple(Circle(c.layer, at(c.centre), c.radius) for c in self.circles),
            labels=tuple(Label(at(t.place), t.text, t.height) for t in self.labels),
        )


def dxf(drawing: Drawing) -> bytes:
    """The drawing as a DXF file (R2010), millimetres, continuous lines, a layer each.

    Raises
    ------
    MissingExtraError
        If the DXF writer is not installed.
    """
    require("writing DXF files", "fabrication", "ezdxf")
    from ezdxf import options  # type: ignore[attr-defined]
    from ezdxf.filemanagement import new

    fixed = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True  # no dates, no random ids
    try:
        document = new("R2010", units=4)
        for name, (colour, _) in LAYERS.items():
            layer = document.layers.add(name, color=colour, linetype="CONTINUOUS")
            layer.dxf.plot = int(name not in _READ_ONLY)
        space = document.modelspace()
        for line in drawing.lines:
            points = _millimetres(line.points)
            space.add_lwpolyline(points, close=line.closed, dxfattribs={"layer": line.layer})
        for circle in drawing.circles:
            [centre] = _millimetres([circle.centre])
            radius = round(1e3 * circle.radius, 6)
            space.add_circle(centre, radius, dxfattribs={"layer": circle.layer})
        for label in drawing.labels:
            [place] = _millimetres([label.place])
            attributes = {"layer": "TEXT", "height": 1e3 * label.height, "insert": place}
            space.add_text(label.text, dxfattribs=attributes)
        # The writer would name the kinds of entities in a set's order, another in each process.
        for kind in sorted(document.entitydb.dxf_types_in_use()):
            document.classes.add_class(kind)
        stream = io.StringIO()
        document.write(stream)
    finally:
        options.write_fixed_meta_data_for_testing = fixed
    return stream.getvalue().encode()


def svg(drawing: Drawing) -> bytes:
    """The drawing as an SVG file in millimetres; y points up, as in the others."""
    width, height = (1e3 * side for side in drawing.size)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
        f'viewBox="0 0 {width:.3f} {height:.3f}">'
    )
    lines = [head, f"<title>{escape(drawing.title)}</title>"]
    for name, (_, colour) in LAYERS.items():
        parts = [*_svg_shapes(drawing, name, height)]
        if parts:
            style = f'fill="none" stroke="{colour}" stroke-width="{_INK}"'
            lines += [f'<g id="{name}" {style}>', *parts, "</g>"]
    if drawing.labels:
        lines.append('<g id="TEXT" fill="#000000" font-family="sans-serif">')
        for label in drawing.labels:
            x, y = 1e3 * label.place[0], height - 1e3 * label.place[1]
            size = f'font-size="{1e3 * label.height:.3f}"'
            lines.append(f'<text x="{x:.4f}" y="{y:.4f}" {size}>{escape(label.text)}</text>')
        lines.append("</g>")
    return ("\n".join([*lines, "</svg>"]) + "\n").encode()


def _svg_shapes(drawing: Drawing, layer: str, height: float) -> Iterable[str]:
    """Elements of one layer."""
    for line in drawing.lines:
        if line.layer == layer:
            places = " ".join(f"{x:.4f},{height - y:.4f}" for x, y in _millimetres(line.points))
            yield f'<{"polygon" if line.closed else "polyline"} points="{places}"/>'
    for circle in drawing.circles:
        if circle.layer == layer:
            (x, y), radius = _millimetres([circle.centre])[0], 1e3 * circle.radius
            yield f'<circle cx="{x:.4f}" cy="{height - y:.4f}" r="{radius:.4f}"/>'


def pdf(drawings: Sequence[Drawing], title: str) -> bytes:
    """The drawings at 1:1, one a page as large as it needs, each with a bar of 100 mm."""
    pages = [_page(drawing) for drawing in drawings]
    return pdf_of([(size, content) for size, content in pages], title)


def _page(drawing: Drawing) -> tuple[tuple[float, float], str]:
    """Size of a page, mm, and its content."""
    margin, foot = 10.0, 30.0
    width, height = (1e3 * side for side in drawing.size)
    size = max(width, 110.0) + 2 * margin, height + 2 * margin + foot
    ink = [f"{_POINTS:.9f} 0 0 {_POINTS:.9f} 0 0 cm {_INK} w 1 j"]
    shift = np.array([margin, margin + foot])
    for layer, (_, colour) in LAYERS.items():
        ink.append(f"{_rgb(colour)} RG")
        for line in drawing.lines:
            if line.layer == layer:
                ink.append(pdf_path(1e3 * np.asarray(line.points) + shift, closed=line.closed))
        for circle in drawing.circles:
            if circle.layer == layer:
                turns = np.linspace(0, 2 * np.pi, 33)[:-1]
                ring = circle.radius * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
                places = 1e3 * (np.asarray(circle.centre) + ring) + shift
                ink.append(pdf_path(places, closed=True))
    for label in drawing.labels:
        x, y = 1e3 * np.asarray(label.place) + shift
        ink.append(pdf_text(x, y, label.text, 1e3 * label.height))
    bar = np.add([[0, 0], [0, 5], [0, 0], [100, 0], [100, 5]], [margin, 16])
    ink += ["0 0 0 RG", pdf_path(bar, closed=False)]
    ink.append(pdf_text(margin + 34, 17.5, "100 mm: measure before cutting", 2.5))
    limit = f"mm; limits ± {1e3 * LASER:g} mm; tool paths are offset by half of the kerf"
    ink += [pdf_text(margin, 8, drawing.title, 3.5), pdf_text(margin, 3.5, limit, 2.5)]
    return size, "\n".join(ink)


def pdf_path(points: Floats, *, closed: bool, fill: bool = False) -> str:
    """Operators of a line through points, mm."""
    steps = [f"{x:.4f} {y:.4f} {'l' if k else 'm'}" for k, (x, y) in enumerate(points.tolist())]
    return " ".join([*steps, "b" if fill else "s" if closed else "S"])


def pdf_text(x: float, y: float, text: str, size: float) -> str:
    """Operators of a text in Helvetica, mm."""
    plain = text.encode("cp1252", "replace").decode("cp1252")
    safe = plain.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
    return f"BT 0 g /F1 {size:.3f} Tf {x:.4f} {y:.4f} Td ({safe}) Tj ET"


def pdf_of(pages: Sequence[tuple[tuple[float, float], str]], title: str) -> bytes:
    """A PDF file of pages, each its size in mm and its operators; the same bytes each time."""
    font = "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>"
    kids = " ".join(f"{5 + 2 * k} 0 R" for k in range(len(pages)))
    safe = title.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>".encode(),
        font.encode(),
        f"<< /Title ({safe}) /Creator (smoskin) >>".encode("cp1252", "replace"),
    ]
    for k, ((width, height), content) in enumerate(pages):
        box = f"[0 0 {width * _POINTS:.4f} {height * _POINTS:.4f}]"
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents {6 + 2 * k} 0 R "
            "/Resources << /Font << /F1 3 0 R >> >> >>".encode()
        )
        packed = zlib.compress(content.encode("cp1252", "replace"), 9)
        head = f"<< /Length {len(packed)} /Filter /FlateDecode >>\nstream\n".encode()
        objects.append(head + packed + b"\nendstream")
    out, places = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n", []
    for number, body in enumerate(objects, 1):
        places.append(len(out))
        out += f"{number} 0 obj\n".encode() + body + b"\nendobj\n"
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    count = len(objects) + 1
    end = f"xref\n0 {count}\n0000000000 65535 f \n{table}trailer\n<< /Size {count} /Root 1 0 R "
    return out + f"{end}/Info 4 0 R >>\nstartxref\n{len(out)}\n%%EOF\n".encode()


def _rgb(colour: str) -> str:
    """A colour as a PDF has it."""
    return " ".join(f"{int(colour[k : k + 2], 16) / 255:.3f}" for k in (1, 3, 5))


def _millimetres(points: Any) -> list[tuple[float, float]]:
    """Places in mm, rounded to a nanometre."""
    return [(x, y) for x, y in np.round(1e3 * np.asarray(points), 6).tolist()]
