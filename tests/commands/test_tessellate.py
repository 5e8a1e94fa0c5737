"""The command over the tessellation: which files, which refusals."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.commands.tessellate import numbers, tessellate_surface
from smoskin.commands.tessellate.surfaces import named_surface
from smoskin.errors import ArgumentError, FileError
from smoskin.origami.surface.analytic import Bump, Cone, Cylinder, Plane
from smoskin.origami.surface.surface import curvatures, forms
from triangle_meshes import meshed

RUN = CliRunner()
SOUND = {"validity.json", "sheet.svg", "sheet.fold", "pattern.fold", "sheet.obj", "pattern.svg"}


def test_a_cylinder_gets_all_files_and_a_second_run_asks_first(tmp_path):
    out = tmp_path / "skin"
    line = ["tessellate", "cylinder:100", "--cells", "2", "2", "--out", str(out)]
    ran = RUN.invoke(app, [*line, "--json"])
    assert ran.exit_code == 0, ran.output
    told = json.loads(ran.stdout)
    assert told["holds"]
    assert told["folds"]
    assert {file.name for file in out.iterdir()} == SOUND
    assert told["files"] == [str(out / name) for name in told_names(told)]
    assert json.loads((out / "validity.json").read_text())["fold_share"] == told["fold_share"]
    with pytest.raises(FileError, match=r"validity\.json exists"):
        RUN.invoke(app, line, catch_exceptions=False)
    assert RUN.invoke(app, [*line, "--force"]).exit_code == 0


def told_names(told):
    return [file.rsplit("/", 1)[1] for file in told["files"]]


def test_no_pattern_is_left_of_a_sheet_that_must_not_be_cut(planar, tmp_path):
    (tmp_path / "pattern.fold").write_text("an older one")
    report = tessellate_surface("sphere:100", planar, (6, 6), tmp_path, time_limit=1e-3, force=True)
    assert not report.made.holds
    assert {file.name for file in tmp_path.iterdir()} == {"validity.json", "sheet.svg"}
    told = json.loads((tmp_path / "validity.json").read_text())
    assert told["holds"] is False
    assert told["advice"].endswith("there was no time left to look for what would fit")


def test_the_exit_code_tells_of_a_gate_that_fails(tmp_path):
    line = ["tessellate", "sphere:100", "--cells", "6", "6", "--time-limit", "0.001", "--out"]
    ran = RUN.invoke(app, [*line, str(tmp_path)])
    assert ran.exit_code == 1
    assert "This sheet must not be cut: " in ran.stderr


def test_surfaces_have_names(planar):
    def named(text):
        return named_surface(text, planar.cell, (2, 2), (0, 0, 0), (1, 0, 0))[0]

    assert named("plane") == Plane()
    assert named("cylinder:53.4") == Cylinder(0.0534)
    assert named("cone:60,80,150") == Cone(0.06, 0.08, 0.15)
    assert named("bump:-10,50") == Bump(-0.01, 0.05)
    for wrong in ("cylinder", "cylinder:a", "cylinder:1,2", "cone:60,80", "plane:3"):
        with pytest.raises(ArgumentError, match=f"surface must be {wrong.split(':')[0]}:"):
            named(wrong)
    with pytest.raises(ArgumentError, match=r"surface must be plane, cylinder:R, .* got 'torus:3'"):
        named("torus:3")
    with pytest.raises(ArgumentError, match="radius must be finite and > 0 m"):
        named("sphere:-3")


def test_a_mesh_is_charted_round_its_point(planar, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    mesh = meshed(Cylinder(0.08), (0.06, 0.08))
    path = tmp_path / "link.STL"
    trimesh.Trimesh(1e3 * mesh.vertices, mesh.triangles, process=False).export(
        path, file_type="stl"
    )
    chart, roughness = named_surface(str(path), planar.cell, (2, 2), (10, 0, 0), (1, 0, 0))
    at = forms(chart, np.zeros(2))
    np.testing.assert_allclose(at.places, [0.01, 0, 0], atol=1e-4)
    np.testing.assert_allclose(curvatures(at), [-12.5, 0], atol=0.2)
    assert roughness < 1e-6


def test_wrong_arguments_are_refused_by_name(planar, tmp_path):
    with pytest.raises(ArgumentError, match="cells must be at least 1 1; got 0 3"):
        tessellate_surface("plane", planar, (0, 3), tmp_path)
    with pytest.raises(ArgumentError, match="scale must be finite and > 0"):
        tessellate_surface("plane", planar, (1, 1), tmp_path, scale=-1.0)
    with pytest.raises(ArgumentError, match="along must be three numbers such as"):
        numbers("along", "x")
    with pytest.raises(ArgumentError, match=r"at must be three numbers; got \(1.0, 2.0\)"):
        tessellate_surface("a.stl", planar, (1, 1), tmp_path, at=(1.0, 2.0))
    with pytest.raises(FileError, match=r"a\.stl cannot be read"):
        tessellate_surface("a.stl", planar, (1, 1), tmp_path)
    assert list(tmp_path.iterdir()) == []
