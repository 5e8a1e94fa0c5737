"""Drawings read back by ezdxf: areas, holes, layers and units are the design's."""

import io
import re
import xml.etree.ElementTree as ET
import zlib
from dataclasses import replace

import ezdxf
import numpy as np
import pytest
from shapely import LineString, Polygon
from shapely.ops import polygonize, unary_union

from smoskin.errors import DesignError
from smoskin.fabrication.drawing import dxf, pdf, svg
from smoskin.fabrication.pattern.coupon import BAR, coupon, rows_on_stock
from smoskin.fabrication.pattern.flat import crease_gaps, flat_sheet
from smoskin.fabrication.pattern.sheets import sheet_drawings
from smoskin.fabrication.workshop import Workshop


@pytest.fixture(scope="module")
def small(planar):
    """A skin of few cells."""
    magnets = tuple(replace(m, corner=(k, 1)) for k, m in enumerate(planar.magnets))
    return replace(planar, cells=(2, 3), magnets=magnets)


@pytest.fixture(scope="module")
def drawings(small):
    return {drawing.name: drawing for drawing in sheet_drawings(small, Workshop())}


def opened(drawing):
    return ezdxf.read(io.StringIO(dxf(drawing).decode()))


def polygons(document, layer):
    """Closed lines of a layer."""
    polylines = document.modelspace().query(f'LWPOLYLINE[layer=="{layer}"]')
    return [Polygon([p[:2] for p in line.get_points()]) for line in polylines if line.closed]


def circles(document, layer):
    return [*document.modelspace().query(f'CIRCLE[layer=="{layer}"]')]


def counted_area(sheet, facet, shop, is_upper):
    """Area of a panel, mm2, by counting squares that are far enough from creases and vertices."""
    kinds = {
        tuple(sorted(pair)): (bool(ridge), sheet.at_a if k < along_a else sheet.at_b)
        for along_a in [sum(np.ptp(sheet.vertices[sheet.creases], axis=1)[:, 0] < 1e-9)]
        for k, (pair, ridge) in enumerate(zip(sheet.creases.tolist(), sheet.mountain, strict=True))
    }
    corners = sheet.vertices[sheet.facets[facet]]
    (left, low), (right, high) = corners.min(axis=0), corners.max(axis=0)
    middles = (np.arange(2000) + 0.5) / 2000
    x, y = np.meshgrid(left + middles * (right - left), low + middles * (high - low))
    inside = np.ones(x.shape, dtype=bool)
    for k in range(4):
        pair = sheet.facets[facet][[k, (k + 1) % 4]].tolist()
        start, end = sheet.vertices[pair]
        along = (end - start) / np.linalg.norm(end - start)
        ridge, gaps = kinds[tuple(sorted(pair))]
        half = (gaps.convex if ridge == is_upper else gaps.concave) / 2
        inside &= along[0] * (y - start[1]) - along[1] * (x - start[0]) > half
        inside &= np.hypot(x - start[0], y - start[1]) > sheet.hole
    return float(inside.mean() * (right - left) * (high - low)) * 1e6


def test_files_are_sound_and_in_millimetres(drawings):
    for drawing in drawings.values():
        document = opened(drawing)
        assert not document.audit().errors
        assert document.header["$INSUNITS"] == 4
        assert {e.dxf.linetype for e in document.modelspace()} == {"BYLAYER"}
        assert {layer.dxf.linetype.upper() for layer in document.layers} == {"CONTINUOUS"}
        width, height = (1e3 * side for side in drawing.size)
        [outline] = [
            p
            for p in polygons(document, "CUT") + polygons(document, "OUTLINE")
            if p.bounds[:2] == (0, 0)
        ]
        assert outline.area == pytest.approx(width * height)


@pytest.mark.parametrize(("name", "upper"), [("upper", True), ("lower", False)])
def test_panels_have_the_area_that_their_gaps_leave(small, drawings, name, upper):
    shop = Workshop()
    panels = polygons(opened(drawings[name]), "PANEL")
    assert len(panels) == 4 * small.cells[0] * small.cells[1]
    sheet = flat_sheet(small, shop)
    for facet in (7, 8, 9, 10, 13, 14):  # inside the rim
        expected = counted_area(sheet, facet, shop, upper)
        assert panels[facet].area == pytest.approx(expected, rel=1e-3)


def test_the_cutter_s_path_lies_half_a_kerf_outside(small):
    shop = Workshop(kerf=0.3e-3)
    document = opened(sheet_drawings(small, shop)[0])
    path = [
        LineString([p[:2] for p in line.get_points()])
        for line in document.modelspace().query('LWPOLYLINE[layer=="CUT"]')
    ]
    for panel in polygons(document, "PANEL")[:10]:
        away = [line.distance(panel) for line in path]
        assert min(away) == pytest.approx(0.15, abs=1e-6)


def test_panels_hang_in_their_carrier_until_they_are_released(drawings):
    for name in ("upper", "lower"):
        cut = opened(drawings[name])
        lines = [
            LineString(
                [*(p[:2] for p in e.get_points()), e.get_points()[0][:2]][
                    : None if e.closed else -1
                ]
            )
            for e in cut.modelspace().query('LWPOLYLINE[layer=="CUT"]')
        ]
        held = max(polygonize(unary_union(lines)), key=lambda face: face.area)
        # Cut lines close nothing but the carrier: all panels hang on it.
        for panel in polygons(cut, "PANEL"):
            assert held.contains(panel.representative_point())
        freed = opened(drawings[f"{name}_release"])
        lines += [
            LineString([p[:2] for p in e.get_points()])
            for e in freed.modelspace().query('LWPOLYLINE[layer=="RELEASE"]')
        ]
        loose = [
            *polygonize(
                unary_union([line.buffer(0).boundary if line.is_empty else line for line in lines])
            )
        ]
        panels = polygons(cut, "PANEL")
        for panel in panels:
            assert any(
                face.contains(panel.representative_point()) and face.area < 1.1 * panel.area
                for face in loose
            )


def test_the_release_spares_the_film(drawings):
    """Only bridges are cut; the film is trimmed outside the panels, on one face."""
    for name, trims in (("upper_release", 1), ("lower_release", 0)):
        document = opened(drawings[name])
        kinds = {e.dxf.layer for e in document.modelspace()}
        assert "CUT" not in kinds
        assert len(polygons(document, "TRIM")) == trims


def test_every_inner_vertex_has_a_hole_wider_than_the_gap(small, drawings):
    holes = circles(opened(drawings["film"]), "HOLE")
    pins = 4
    inner = (2 * small.cells[0] - 1) * (2 * small.cells[1] - 1)
    assert len(holes) == inner + pins
    widest = max(max(pair) for pair in crease_gaps(small, Workshop()))
    vertex = [h for h in holes if h.dxf.radius * 2 < 2.5]
    assert len(vertex) == inner
    assert min(h.dxf.radius for h in vertex) * 2 > 1e3 * widest


def test_pins_meet_when_the_lower_sheet_is_turned_over(drawings):
    upper, lower = (
        {
            (round(c.dxf.center.x, 6), round(c.dxf.center.y, 6))
            for c in circles(opened(drawings[n]), "HOLE")
        }
        for n in ("upper", "lower")
    )
    width = 1e3 * drawings["upper"].size[0]
    assert {(round(width - x, 6), y) for x, y in lower} == upper
    assert upper != lower  # they fit one way only


def test_perforations_stay_off_the_corners(small):
    assert not [line for line in sheet_drawings(small, Workshop())[2].lines if line.layer == "PERF"]
    shop = Workshop(perforation=0.4)
    film = sheet_drawings(small, shop)[2]
    cuts = [line.points for line in film.lines if line.layer == "PERF"]
    assert len(cuts) > 100
    holes = np.array([c.centre for c in film.circles[4:]])
    radius = film.circles[-1].radius + shop.kerf / 2
    apart = [np.linalg.norm(holes - point, axis=1).min() for cut in cuts for point in cut]
    assert min(apart) > radius + shop.corner_skip - 1e-9
    assert all(np.linalg.norm(cut[1] - cut[0]) == pytest.approx(0.8e-3) for cut in cuts)


def test_the_coupon_has_a_bar_of_100_mm_and_the_design_s_gaps(planar):
    document = opened(coupon(planar, Workshop()))
    bars = polygons(document, "PANEL")
    assert max(p.bounds[2] - p.bounds[0] for p in bars) == pytest.approx(1e3 * BAR)
    tiles = sorted((p for p in bars if p.bounds[3] - p.bounds[1] > 11), key=lambda p: p.bounds[0])
    apart = [tiles[k + 1].bounds[0] - tiles[k].bounds[2] for k in (0, 2, 4, 6)]
    gaps = [gap for pair in crease_gaps(planar, Workshop()) for gap in pair]
    assert apart == pytest.approx([1e3 * gap for gap in gaps])


def test_parts_lie_on_stock_without_touching(planar):
    shop = Workshop()
    drawings = sheet_drawings(planar, shop)[:3]
    [sheet] = rows_on_stock(drawings, shop, "acrylic")
    outlines = [Polygon(line.points) for line in sheet.lines if line.layer == "CUT" and line.closed]
    assert len(outlines) == 3
    for k, outline in enumerate(outlines):
        assert Polygon([(0, 0), (1, 0), (1, 0.6), (0, 0.6)]).contains(outline)
        assert all(outline.distance(other) > 4.9e-3 for other in outlines[:k])
    with pytest.raises(DesignError, match=r"178 x 236 mm; got 200 x 150 mm"):
        rows_on_stock(drawings, replace(shop, stock=(0.2, 0.15)), "acrylic")


def test_bytes_are_the_same_each_time(drawings):
    drawing = drawings["upper"]
    for write in (dxf, svg, lambda d: pdf([d], "one")):
        assert write(drawing) == write(drawing)


def test_svg_files_are_as_large_as_their_drawing_and_hold_the_same_lines(drawings):
    drawing = drawings["upper"]
    root = ET.fromstring(svg(drawing))
    width, height = (1e3 * side for side in drawing.size)
    assert root.get("width") == f"{width:.3f}mm"
    assert [float(v) for v in root.get("viewBox").split()] == pytest.approx(
        [0, 0, width, height], abs=1e-3
    )
    space = "{http://www.w3.org/2000/svg}"
    groups = {g.get("id"): g for g in root.iter(f"{space}g")}
    outlines = [p.get("points").split() for p in groups["PANEL"]]
    mine = [line for line in drawing.lines if line.layer == "PANEL"]
    assert len(outlines) == len(mine)
    x, y = (float(v) for v in outlines[0][0].split(","))
    assert (x, height - y) == pytest.approx(tuple(1e3 * mine[0].points[0]), abs=1e-3)


def test_the_pdf_is_drawn_at_1_to_1(drawings):
    drawing = drawings["coupon" if "coupon" in drawings else "upper"]
    content = pdf([drawing], "one")
    [box] = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", content)
    points = 72 / 25.4
    assert float(box[0]) == pytest.approx((max(1e3 * drawing.size[0], 110) + 20) * points, abs=0.01)
    stream = content.split(b"stream\n")[1].split(b"\nendstream")[0]
    ink = zlib.decompress(stream).decode("cp1252")
    scale = float(ink.split()[0])
    bar = next(line for line in ink.splitlines() if line.endswith(" S") and line.count(" l") == 4)
    ends = [float(word) for word in bar.split() if word not in ("m", "l", "S")][::2]
    assert (max(ends) - min(ends)) * scale == pytest.approx(100 * points, rel=1e-6)
