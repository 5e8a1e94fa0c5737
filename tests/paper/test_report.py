"""The report: its rows, files and errors."""

import importlib
import json
import os
import re
import runpy
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import get_args

import pytest

from paper.errata import errata, errata_rows, page
from paper.shared.rows import TOLERANCE, Row, Verdict, compared, stated, summary, table
from smoskin.errors import ArgumentError, MissingExtraError

pytest.importorskip("matplotlib")
pytest.importorskip("jax")
pytest.importorskip("felupe")

from paper.__main__ import SCRIPTS, main, write_report
from paper.figure_s5 import location_rows
from paper.figure_s7 import golden_rows
from paper.shared.setting import Setting
from paper.shared.style import show_rows

ROOT = Path(__file__).parents[2]
FIGURES = {f"{name.rpartition('.')[2]}.svg" for name in SCRIPTS}
QUICK = ("figure_s1", "figure_s5", "figure_s6", "figure_s7", "figure_s15")


def test_a_row_of_numbers_judges_itself():
    for sign in (-1, 1):
        near, far = (100.0 * (1 + sign * part * TOLERANCE) for part in (0.99, 1.01))
        assert compared("a", "b", 100.0, near, "").verdict == "reproduced"
        assert compared("a", "b", 100.0, far, "").verdict == "unresolved"
    assert compared("a", "b", -2.0, -3.0, "").deviation == 0.5
    assert compared("a", "b", 3.0, 3.14159265, "").computed == 3.14159
    assert stated("a", "b", "falls", "rises", False, "").verdict == "unresolved"
    assert stated("a", "b", "falls", "falls", True, "").verdict == "reproduced"


def test_a_script_fails_where_a_row_does_not_hold(capsys):
    rows = [stated("held", "b", "falls", "falls", True, ""), compared("off", "b", 1.0, 2.0, "why")]
    show_rows(rows[:1])
    with pytest.raises(AssertionError, match="not as printed: off"):
        show_rows(rows)
    assert capsys.readouterr().out.endswith(f"{table(rows)}\n")
    assert summary(rows) == "2 rows: 1 reproduced, 0 corrected, 1 unresolved."


@pytest.mark.parametrize("name", QUICK)
def test_quick_scripts_reproduce_what_is_printed(planar, name, tmp_path):
    plate = importlib.import_module(f"paper.{name}").plate(Setting(planar))
    assert {row.verdict for row in plate.rows} <= {"reproduced", "corrected"}
    assert plate.rows
    assert plate.name == name
    first, second = (plate.write(tmp_path).read_bytes() for _ in range(2))
    assert first == second
    picture = ET.fromstring(first)
    names = {element.tag.rpartition("}")[2] for element in picture.iter()}
    assert "path" in names
    assert "image" not in names


def test_printed_counts_and_constants_are_reproduced(planar):
    from paper.text_numbers import rows

    report = rows(Setting(planar))
    assert {row.verdict for row in report} == {"reproduced"}
    printed = {row.printed for row in report}
    assert {0.804e6, 0.804, -5227.78, 0.05, 825, 680625, 68062500, 9, 6, 3, 25, 33} <= printed


def test_every_script_opens_with_its_title():
    for name in SCRIPTS:
        title, line = importlib.import_module(f"paper.{name}").__doc__.strip().splitlines()[:2]
        assert line == "=" * len(title), name


def test_a_script_runs_by_itself():
    done = subprocess.run(
        [sys.executable, "-m", "paper.figure_s5"],
        capture_output=True,
        text=True,
        timeout=120.0,
        env=os.environ | {"MPLBACKEND": "agg"},
    )
    assert done.returncode == 0, done.stderr
    assert "table_s1.z5 (Table S1): corrected" in done.stdout
    assert "1.3248 (U1)" in done.stdout


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_whole_report(planar, tmp_path):
    steps: list[tuple[str, float]] = []
    out = tmp_path / "new" / "folder"
    rows = write_report(Setting(planar), out, lambda what, share: steps.append((what, share)))
    counts = {verdict: sum(row.verdict == verdict for row in rows) for verdict in get_args(Verdict)}
    assert counts == {"reproduced": 76, "corrected": 27, "unresolved": 6}
    left = [row.id for row in rows if row.verdict == "unresolved"]
    assert left == ["U1", "U2", "U3", "U4", "U5", "U6"]
    assert len({row.id for row in rows}) == 109
    for row in rows:
        assert row.why, row
        assert (row.deviation is not None) or isinstance(row.printed, str), row
        if row.verdict == "reproduced" and row.deviation is not None:
            assert abs(row.deviation) <= TOLERANCE, row
    document = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert [Row(**plain) for plain in document["rows"]] == rows
    assert set(document) == {"rows"}
    assert set(document["rows"][0]) == {field.name for field in fields(Row)}
    assert {path.name for path in out.iterdir()} == FIGURES | {"report.json", "index.html"}
    shares = [share for _, share in steps]
    assert shares == sorted(shares)
    assert steps[-1] == ("done", 1.0)
    index = _Pictures()
    index.feed((out / "index.html").read_text(encoding="utf-8"))
    assert set(index.addresses) == FIGURES


class _Pictures(HTMLParser):
    """Addresses that a page names."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.addresses += [value for name, value in attrs if name in ("src", "href")]


def test_another_design_is_not_called_reproduced(planar):
    other = replace(planar, cell=replace(planar.cell, fold_angle=planar.cell.fold_angle * 0.98))
    rows = [*location_rows(other), *golden_rows(other)]
    failed = {row.id for row in rows if row.verdict == "unresolved"}
    assert {"location.u3x", "location.u2y", "golden.columns_1_11"} <= failed


def test_out_must_be_a_folder(planar, tmp_path):
    file = tmp_path / "taken"
    file.write_text("", encoding="utf-8")
    for out in (file, file / "below"):
        with pytest.raises(ArgumentError) as caught:
            write_report(Setting(planar), out)
        assert str(caught.value).startswith("out must be a folder that can be written; got ")
        assert "\n" not in str(caught.value)


def test_designs_of_another_layout_are_refused(long_planar):
    with pytest.raises(ArgumentError, match=r"6 x 6 cells and two magnets on the sheet.*4 x 5"):
        Setting(long_planar)


@pytest.mark.parametrize("module", ["matplotlib", "jax", "felupe"])
def test_without_its_modules_it_names_the_extra(tmp_path, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=r"pip install .*\[paper\]'"):
        main(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_errata_page_says_what_the_report_says(planar):
    make = runpy.run_path(str(ROOT / "docs" / "make_errata.py"))
    written = make["PAGE"].read_text(encoding="utf-8")
    assert written == page(planar), "run python docs/make_errata.py"
    listed = re.findall(r"^\| ([EU]\d+) ", written, re.M)
    entries = errata(planar)
    rows = {row.id: row for row in errata_rows(planar)}
    assert listed == [erratum.number for erratum in entries] == list(rows)
    for erratum in entries:
        assert rows[erratum.number].computed == erratum.holds
        assert rows[erratum.number].verdict == ("unresolved" if erratum.is_open else "corrected")
    numbers = [int(erratum.number[1:]) for erratum in entries if not erratum.is_open]
    assert numbers == list(range(1, len(numbers) + 1))


def test_errata_tell_wording_from_what_a_test_shows(planar):
    for erratum in errata(planar):
        if erratum.test.startswith("tests/"):
            assert (ROOT / erratum.test).is_file()
        elif erratum.test:
            assert re.fullmatch(r"test_e\d+", erratum.test)
            assert erratum.test == f"test_{erratum.number.lower()}"
        assert "|" not in erratum.place + erratum.printed + erratum.holds + erratum.tried
