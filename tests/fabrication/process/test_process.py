"""The process sheet: it tells this design's numbers, and its pictures are cut from its solids."""

import json
import re
from dataclasses import asdict, replace

import numpy as np
import pytest
import shapely

from smoskin.fabrication.materials import bill
from smoskin.fabrication.moulds.assembly import whole_skin
from smoskin.fabrication.moulds.files import solid_files
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.process.files import process_files
from smoskin.fabrication.process.page import _wrapped
from smoskin.fabrication.process.pictures import (
    COLOURS,
    plan,
    through_a_magnet,
)
from smoskin.fabrication.process.readings import first_readings, suited_magnets
from smoskin.fabrication.process.tolerances import CUT, made_tolerances, tolerance_table
from smoskin.fabrication.workshop import Workshop
from smoskin.feasibility import field_extent, load_design
from smoskin.mechanics.beam import beam
from smoskin.origami.geometry import geometry
from smoskin.twin.manufacture import Tolerances


@pytest.fixture(scope="module")
def files(planar):
    shop = Workshop()
    solids = solid_files(planar, shop)
    made = process_files(planar, shop, solids, bill(planar, shop, solids.parts))
    return {file.path: file.content for file in made}


def test_the_page_tells_every_step_of_figure_s4(files):
    page = files["process.html"].decode()
    for step in ("(1,1)", "(1,2)", "(1,3)", "(2,1)", "(3,1)", "(4)", "(5), (6)", "(7)"):
        assert f"SI Figure S4 {step}" in page
    assert page.count("<figure>") >= 9
    assert not re.search(r'(src|href)="', page)  # nothing comes from outside
    assert "320 degC" not in page  # no hot press in a sheet with acrylic
    row = re.search(r"<td>magnet_mould_1</td>(.*?)</tr>", page).group(1)
    assert "PTFE, PEEK, aluminium" in row
    assert "PLA" not in row
    order = [page.index(text) for text in ("foot_jig", "Thread the holders", "fold_jig", "Drip")]
    assert order == sorted(order)


def test_the_hot_press_is_told_with_its_warning_where_panels_stand_it(planar):
    corners = {"M1": (0, 0), "M2": (2, 1), "M3": (0, 1)}
    design = replace(
        planar,
        cells=(2, 2),
        panels=replace(planar.panels, material="polyimide"),
        magnets=tuple(replace(m, corner=corners[m.name], driver="column") for m in planar.magnets),
    )
    shop = Workshop(bond="hot press")
    solids = solid_files(design, shop)
    items = bill(design, shop, solids.parts)
    [page] = [f for f in process_files(design, shop, solids, items) if f.path == "process.html"]
    assert "320 degC. Never with acrylic" in page.content.decode()
    assert not [item for item in items if "adhesive" in item.part]
    assert "Glue a rubber column of 4.0 mm" in page.content.decode()
    assert not [part for part in solids.parts if "driver" in part.name]


def test_the_pdf_has_pages(files):
    content = files["process.pdf"]
    assert content.startswith(b"%PDF-1.4")
    pages = content.count(b"/Type /Page ")
    assert pages >= 4
    assert f"/Count {pages} ".encode() in content


def test_words_wider_than_a_cell_are_broken():
    assert _wrapped("a" * 50, 20.0, 3.0) == ["a" * 13] * 3 + ["a" * 11]
    assert " ".join(_wrapped("one two three four", 15.0, 3.0)) == "one two three four"


def test_first_readings_are_those_of_the_feasibility_check(planar, files):
    written = json.loads(files["first_readings.json"])
    for site, reading in zip(planar.halls, first_readings(planar), strict=True):
        rest = field_extent(planar, site).rest
        assert reading.designed == pytest.approx(rest, abs=0.1e-3)  # neighbours add a little
        assert (reading.low < reading.designed).all()
        assert (reading.designed < reading.high).all()
        assert (np.abs(reading.high) < reading.full_scale).all()
        assert written[site.name]["address"] == site.address
        assert written[site.name]["designed_mT"] == pytest.approx(1e3 * rest, abs=0.1)


def test_the_sheet_says_what_to_build_with_other_magnets(planar, files):
    rows = suited_magnets(planar)
    assert [row.remanence for row in rows] == [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    readings = np.array([row.reading for row in rows])
    rest = np.linalg.norm(field_extent(planar, planar.halls[0]).rest)
    np.testing.assert_allclose(readings[-1] / rest, 1.0 / 1.0103, rtol=1e-3)
    np.testing.assert_allclose(readings / readings[-1], [row.remanence for row in rows])
    page = files["process.html"].decode()
    assert "<td>0.4</td><td>12.5</td><td>3.7</td><td>3.6</td><td>3.6</td><td>3</td>" in page


def test_the_table_is_the_twin_s_tolerances(planar):
    table = {row.field: row for row in tolerance_table(planar)}
    made = made_tolerances(planar)
    assert {getattr(made, field) for field in table} == {row.spread for row in table.values()}
    assert made.magnet_place == pytest.approx(0.3e-3 / CUT)
    columns = planar.columns
    wide, usual = (beam(r, columns.height, 1.0).lateral for r in (3.6e-3, 3.5e-3))
    assert f"{100 * (wide / usual - 1):+.0f} /" in table["column_stiffness"].effect
    assert table["crease_stiffness"].spread == pytest.approx(0.1e-3 / 1.2e-3 / CUT)


@pytest.mark.parametrize("name", ["planar", "optimised", "curved"])
def test_who_keeps_the_table_makes_no_worse_skins_than_those_that_are_judged(name):
    made, judged = asdict(made_tolerances(load_design(name))), asdict(Tolerances())
    assert {field for field in made if made[field] > judged[field] * (1 + 1e-9)} == set()


def test_the_section_shows_the_magnet_over_its_chip(planar):
    shop = Workshop()
    parts = whole_skin(planar, flat_sheet(planar, shop), shop)
    picture = through_a_magnet(planar, parts)
    dark = [shapely.Polygon(s.points) for s in picture.shapes if s.fill == "#555555"]
    chip = [shapely.Polygon(s.points) for s in picture.shapes if s.fill == "#202020"]
    assert len(dark) == len(chip) == 1
    gap = dark[0].bounds[1] - chip[0].bounds[3]
    site = planar.halls[1]
    assert gap == pytest.approx(site.gap - (1e-3 - planar.board.sensing_height), abs=1e-6)
    assert dark[0].centroid.x == pytest.approx(geometry(planar).magnets[1, 0], abs=1e-5)


def test_a_plan_hides_no_part_behind_another_s_opening(planar):
    shop = Workshop()
    parts = whole_skin(planar, flat_sheet(planar, shop), shop)
    stand = [p for p in parts if p.name.split("_")[0] in ("column", "frame", "holder", "magnet")]
    shown = plan(stand, -6.7e-3, "").shapes
    for kind, count in (("magnet", 2), ("column", 91)):
        mine = [k for k, s in enumerate(shown) if s.fill == COLOURS[kind]]
        assert len(mine) == count
        for k in mine:
            middle = shapely.Polygon(shown[k].points).centroid
            over = [s for s in shown[k + 1 :] if shapely.Polygon(s.points).contains(middle)]
            assert over == []
