"""The report: its rows, files and errors."""

import json
import re
import runpy
import sys
import xml.etree.ElementTree as ET
from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import get_args

import pytest

from paper.build import Report, build_report
from paper.errata import errata, errata_rows, page
from paper.golden import golden_rows
from paper.printed import location_rows
from paper.rows import TOLERANCE, Row, Verdict, compared, stated
from smoskin.errors import ArgumentError, MissingExtraError

OPEN = ["U1", "U2", "U3", "U4", "U5"]
ROOT = Path(__file__).parents[2]
FIGURES = {
    "figure_s1.svg", "figure_s5.svg", "figure_s6.svg", "figure_s7.svg", "figure_s9.svg",
    "figure_s10.svg", "figure_s11.svg", "figure_s15.svg", "figure_s16.svg",
    "displacement_field.svg", "attenuation_fit.svg", "touch_bound.svg", "touch_pairs.svg",
    "calibration_touches.svg",
}  # fmt: skip


@pytest.fixture(scope="module")
def steps() -> list[tuple[str, float]]:
    return []


@pytest.fixture(scope="module")
def report(planar, steps, tmp_path_factory) -> Report:
    pytest.importorskip("matplotlib")
    pytest.importorskip("jax")
    pytest.importorskip("felupe")
    return build_report(
        planar,
        tmp_path_factory.mktemp("report") / "new" / "folder",
        progress=lambda what, share: steps.append((what, share)),
    )


def test_a_row_of_numbers_judges_itself():
    assert compared("a", "b", 100.0, 100.0 * (1 + 0.9 * TOLERANCE), "").verdict == "reproduced"
    assert compared("a", "b", 100.0, 100.0 * (1 + 1.1 * TOLERANCE), "").verdict == "unresolved"
    assert stated("a", "b", "falls", "rises", False, "").verdict == "unresolved"


@pytest.mark.slow
def test_every_row_is_reproduced_corrected_or_explained(report):
    rows = report.rows
    assert len({row.id for row in rows}) == len(rows)
    for row in rows:
        assert row.why, row
        if row.verdict == "reproduced" and row.deviation is not None:
            assert abs(row.deviation) <= TOLERANCE, row
        if isinstance(row.printed, float | int):
            assert row.deviation is not None, row
    assert [row.id for row in rows if row.verdict == "unresolved"] == OPEN
    assert {
        "figure_s10.near", "figure_s10.far", "figure_s10.sheet", "figure_s15.loss",
        "figure_s15.corrected", "figure_s16.place", "figure_s16.resolution", "figure_s11.without",
        "figure_s11.force", "figure_s11.place", "figure_s11.open", "touch.solved", "touch.switch",
    } <= {row.id for row in rows}  # fmt: skip


@pytest.mark.slow
def test_printed_numbers_of_the_paper_are_among_the_rows(report):
    printed = {row.printed for row in report.rows}
    assert {0.6721, 0.7313, 0.9476, 0.8709, 0.804e6, 0.05, 825, 680625, 68062500, 9, 6} <= printed
    assert {0.804, -5227.78} <= printed
    assert {1964.91, 90.53, 18808.0, 184410.0} <= printed


def test_another_design_is_not_called_reproduced(planar):
    other = replace(planar, cell=replace(planar.cell, fold_angle=planar.cell.fold_angle * 0.98))
    rows = [*location_rows(other), *golden_rows(other)]
    failed = {row.id for row in rows if row.verdict == "unresolved"}
    assert {"location.u3x", "location.u2y", "golden.columns_1_11"} <= failed


@pytest.mark.slow
def test_json_holds_the_rows(report):
    document = json.loads(report.data.read_text(encoding="utf-8"))
    names = {field.name for field in fields(Row)}
    assert set(document) == {"rows"}
    assert len(document["rows"]) == len(report.rows)
    for plain, row in zip(document["rows"], report.rows, strict=True):
        assert set(plain) == names == {
            "id", "place", "printed", "computed", "deviation", "verdict", "why",
        }  # fmt: skip
        assert plain["verdict"] in get_args(Verdict)
        assert plain["deviation"] is None or isinstance(plain["deviation"], float)
        assert (plain["id"], plain["computed"]) == (row.id, row.computed)


@pytest.mark.slow
def test_figures_are_vector_graphics(report):
    assert {path.name for path in report.figures} == FIGURES
    for path in report.figures:
        picture = ET.parse(path).getroot()
        names = {element.tag.rpartition("}")[2] for element in picture.iter()}
        assert picture.tag.endswith("}svg")
        assert "path" in names
        assert "image" not in names


class _Page(HTMLParser):
    """Open tags, addresses and row names of a page."""

    VOID = ("meta", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.rows: list[str] = []
        self.pictures = 0

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)
        named = dict(attrs)
        self.addresses += [named[name] for name in ("src", "href") if name in named]
        self.pictures += tag == "img" and bool(named["alt"])
        if tag == "tr" and "id" in named:
            self.rows.append(named["id"])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.mark.slow
def test_page_is_whole_and_asks_for_nothing(report):
    text = report.page.read_text(encoding="utf-8")
    parsed = _Page()
    parsed.feed(text)
    parsed.close()
    assert parsed.open == []
    assert parsed.pictures == len(FIGURES)
    assert all(address.startswith("data:") for address in parsed.addresses)
    assert "http" not in text
    assert "@import" not in text
    assert sorted(parsed.rows) == sorted(row.id for row in report.rows)


@pytest.mark.slow
def test_document_has_a_page_for_each_figure_and_the_tables(report):
    data = report.document.read_bytes()
    assert data.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", data)) == report.pages
    assert len(FIGURES) < report.pages <= len(FIGURES) + 8
    assert b"/Subtype /Image" not in data


@pytest.mark.slow
def test_progress_is_told(report, steps):
    shares = [share for _, share in steps]
    assert shares == sorted(shares)
    assert steps[-1] == ("done", 1.0)


@pytest.mark.slow
def test_summary_counts_verdicts(report):
    assert re.fullmatch(r"\d+ rows: \d+ reproduced, \d+ corrected, 5 unresolved\.", report.summary)


@pytest.mark.slow
def test_same_design_same_bytes(report, planar):
    names = [path.name for path in report.page.parent.iterdir()]
    before = {name: (report.page.parent / name).read_bytes() for name in names}
    build_report(planar, report.page.parent)
    assert {name: (report.page.parent / name).read_bytes() for name in names} == before


def test_out_must_be_a_folder(planar, tmp_path):
    file = tmp_path / "taken"
    file.write_text("", encoding="utf-8")
    for out in (file, file / "below"):
        with pytest.raises(ArgumentError) as caught:
            build_report(planar, out)
        assert str(caught.value).startswith("out must be a folder that can be written; got ")
        assert "\n" not in str(caught.value)


def test_designs_of_another_layout_are_refused(long_planar, tmp_path):
    with pytest.raises(ArgumentError, match=r"6 x 6 cells and two magnets on the sheet.*4 x 5"):
        build_report(long_planar, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("module", ["matplotlib", "jax", "felupe"])
def test_without_its_modules_it_names_the_extra(planar, tmp_path, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=r"pip install 'smoskin\[report\]'"):
        build_report(planar, tmp_path)


def test_errata_page_says_what_the_report_says(planar):
    make = runpy.run_path(str(ROOT / "docs" / "make_errata.py"))
    written = make["PAGE"].read_text(encoding="utf-8")
    assert written == page(planar), "run python docs/make_errata.py"
    listed = re.findall(r"^\| ([EU]\d+) ", written, re.M)
    entries = errata(planar)
    rows = {row.id: row for row in errata_rows(planar)}
    assert listed == [one.number for one in entries] == list(rows)
    for one in entries:
        assert rows[one.number].computed == one.holds
        assert rows[one.number].verdict == ("unresolved" if one.is_open else "corrected")
    numbers = [int(one.number[1:]) for one in entries if not one.is_open]
    assert numbers == list(range(1, len(numbers) + 1))


def test_errata_tell_wording_from_what_a_test_shows(planar):
    for one in errata(planar):
        if one.test.startswith("tests/"):
            assert (ROOT / one.test).is_file()
        elif one.test:
            assert re.fullmatch(r"test_e\d+", one.test)
            assert one.test == f"test_{one.number.lower()}"
        assert "|" not in one.place + one.printed + one.holds + one.tried
