"""The command that writes the files of a skin."""

import json
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.design.document import format_design


@pytest.fixture(scope="module")
def design(planar, tmp_path_factory):
    """A design document of few cells."""
    corners = {"M1": (1, 2), "M2": (2, 1), "M3": (1, 1)}
    magnets = tuple(replace(m, corner=corners[m.name]) for m in planar.magnets)
    path = tmp_path_factory.mktemp("designs") / "small.toml"
    path.write_text(format_design(replace(planar, name="small", cells=(3, 3), magnets=magnets)))
    return path


def invoke(*arguments):
    return CliRunner().invoke(app, ["fabricate", *map(str, arguments)])


def test_one_command_writes_the_bundle_and_says_what_to_do_first(design, tmp_path):
    out = tmp_path / "skin"
    done = invoke(design, "--out", out, "--json")
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    manifest = json.loads((out / "manifest.json").read_text())
    assert answer["design_hash"] == manifest["design_hash"]
    assert len(answer["files"]) == len(manifest["files"]) + 1
    assert answer["mass_g"] > 50
    assert "coupon.dxf" in done.stderr
    again = invoke(design, "--out", out)
    assert again.exit_code != 0
    assert "exists" in str(again.exception)


def test_what_cannot_be_made_is_refused_and_nothing_is_written(design, tmp_path):
    shop = tmp_path / "shop.toml"
    shop.write_text('bond = "hot press"\n')
    done = invoke(design, "--out", tmp_path / "skin", "--workshop", shop)
    assert done.exit_code != 0
    assert "320 degC" in str(done.exception)
    assert not list((tmp_path / "skin").iterdir())


def test_tables_tell_files_and_masses(design, tmp_path):
    done = invoke(design, "--out", tmp_path / "skin", "--covers")
    assert done.exit_code == 0, done.output
    assert "support column" in done.stdout
    assert "kind" in done.stdout
    assert "cover" in done.stdout
    assert "top scale" not in done.stdout
    assert (tmp_path / "skin/parts/guide.stl").exists()
    assert "SI Figure S16" in (tmp_path / "skin/process.html").read_text()
