"""The command over the tessellation: which files, which refusals."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from chromium import open_file
from smoskin.cli import app
from smoskin.commands.tessellate import numbers, tessellate_surface
from smoskin.commands.tessellate.panels import panels_for
from smoskin.commands.tessellate.surfaces import named_surface
from smoskin.design.document import read_design
from smoskin.design.materials import PLATES
from smoskin.errors import ArgumentError, FileError
from smoskin.feasibility import load_design
from smoskin.mechanics.sheet.foldability import fold_shares
from smoskin.mechanics.sheet.lattice import springs_of
from smoskin.mechanics.sheet.touches import Frictionless, Touches
from smoskin.origami.geometry import geometry
from smoskin.origami.surface.analytic import Bump, Cone, Cylinder, Plane, Sphere
from smoskin.origami.surface.surface import curvatures, forms
from smoskin.origami.tessellation.hinges import laid_onto
from smoskin.origami.tessellation.survey import TooBentError
from smoskin.origami.tessellation.tessellate import tessellate
from triangle_meshes import meshed

RUN = CliRunner()
ALWAYS = {"validity.json", "report.html", "fold.html", "sheet.svg"}
SOUND = {*ALWAYS, "sheet.fold", "pattern.fold", "sheet.obj", "sheet.stl", "pattern.svg"}


def test_a_cylinder_gets_all_files_and_a_second_run_asks_first(tmp_path):
    out = tmp_path / "skin"
    line = ["tessellate", "cylinder:100", "--cells", "2", "2", "--out", str(out)]
    ran = RUN.invoke(app, [*line, "--json"])
    assert ran.exit_code == 0, ran.output
    answer = json.loads(ran.stdout)
    assert answer["holds"]
    assert answer["folds"]
    # Magnets of a skin this small stand too near each other.
    assert "geometry alone: magnets" in answer["sensing"]
    assert {file.name for file in out.iterdir()} == SOUND
    assert answer["files"] == [str(out / name) for name in told_names(answer)]
    assert json.loads((out / "validity.json").read_text())["fold_share"] == answer["fold_share"]
    with pytest.raises(FileError, match=r"validity\.json exists"):
        RUN.invoke(app, line, catch_exceptions=False)
    assert RUN.invoke(app, [*line, "--force"]).exit_code == 0


def told_names(answer):
    return [file.rsplit("/", 1)[1] for file in answer["files"]]


def test_no_pattern_is_left_of_a_sheet_that_must_not_be_cut(planar, tmp_path):
    (tmp_path / "pattern.fold").write_text("an older one")
    report = tessellate_surface("sphere:100", planar, (6, 6), tmp_path, time_limit=1e-3, force=True)
    assert not report.made.holds
    assert {file.name for file in tmp_path.iterdir()} == ALWAYS
    page = (tmp_path / "report.html").read_text()
    assert "This sheet must not be cut: the search came 0 % of the way" in page
    assert page.count('class="NO"') == sum(not gate.holds for gate in report.made.gates) > 0
    validity = json.loads((tmp_path / "validity.json").read_text())
    assert validity["holds"] is False
    assert validity["advice"].endswith("there was no time left to look for what would fit")


def test_a_cylinder_gives_a_design_whose_skin_is_that_sheet(tmp_path):
    curved = read_design("curved")
    report = tessellate_surface("cylinder:80", curved, (6, 6), tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {*SOUND, "design.toml"}
    skin = load_design(tmp_path / "design.toml")
    assert skin == report.skin
    assert skin.content_hash == curved.content_hash
    assert skin.provenance["limb.skin_radius"].reason == "a sheet on cylinder:80"
    sheet = geometry(skin).sheet.vertices
    np.testing.assert_allclose(
        laid_onto(report.made.sheet.vertices, sheet), sheet, atol=1e-9, rtol=0
    )
    assert json.loads((tmp_path / "validity.json").read_text())["sensing"] == "design.toml"


def test_a_plane_gives_the_planar_skin_again(planar, tmp_path):
    report = tessellate_surface("plane", planar, planar.cells, tmp_path)
    assert report.skin.content_hash == planar.content_hash


def test_more_cells_take_their_magnets_along(planar, tmp_path):
    report = tessellate_surface("cylinder:150", planar, (9, 9), tmp_path)
    corners = [magnet.corner for magnet in report.skin.magnets]
    assert corners == [(6, 6), (6, 3), (3, 6)]


def test_the_design_of_a_cone_has_the_sheet_that_was_laid_on_it(planar, tmp_path):
    report = tessellate_surface("cone:60,80,150", planar, (3, 4), tmp_path)
    skin = read_design(tmp_path / "design.toml")
    assert skin == report.skin
    assert np.array(skin.limb.radii) == pytest.approx([0.066, 0.074], abs=1e-4)
    apart = geometry(skin).developed - report.made.layers
    # The sheet begins at the skin's corner, and was laid round the surface's middle.
    assert np.ptp(apart, axis=0) == pytest.approx(0.0, abs=1e-9)
    assert apart[0, 2] == pytest.approx(0.0, abs=1e-12)


FIXED = [
    case
    for case in tomllib.loads(
        (Path(__file__).parents[1] / "origami/tessellation/surfaces.toml").read_text()
    )["surface"]
    if case["kind"].startswith("c") and not case.get("noisy")
]


CHOSEN = {
    "wide cylinder": 6e-4,
    "cylinder of small cells": 6e-4,
    "cone of small cells": 6e-4,
    "tight cylinder": 3.8e-4,
    "cylinder of many cells": 3.8e-4,
    "cone of many cells": 3.8e-4,
}
"""The thickest plates that do it, m, where they are not of half a millimetre."""


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=[pytest.mark.slow] if case["cells"] == [24, 24] else [])
        for case in FIXED
    ],
    ids=[case["name"] for case in FIXED],
)
def test_a_press_folds_its_cell_on_every_cylinder_and_cone_as_on_a_plane(planar, case):
    """By 0.85 of what it does with the same panels, with the plates that are chosen."""
    assert len(FIXED) == 9
    scale, cells = case.get("scale", 1.0), tuple(case["cells"])
    edges = {name: scale * getattr(planar.cell, name) for name in ("panel_a", "panel_b")}
    cell = replace(planar.cell, **edges)
    surface, _ = named_surface(case["kind"], cell, cells, (0, 0, 0), (1, 0, 0))
    made, flat = (
        tessellate(each, cell, cells, plate=6e-4, refold=False) for each in (surface, Plane())
    )
    chosen = panels_for(planar, made, flat)
    assert chosen.relative >= 0.85
    plate = chosen.design.panels.thickness / 2
    assert plate in (6e-4, *PLATES)
    assert made.with_plate(plate).holds
    own = springs_of(planar)
    assert chosen.fold_share >= 0.85 * fold_shares(flat.sheet, flat.normals, own).mean()
    assert plate == CHOSEN.get(case["name"], 5e-4)


def test_stiff_panels_give_way_to_thinner_ones_on_a_cylinder_and_files_say_so(planar, tmp_path):
    report = tessellate_surface("cylinder:100", planar, (6, 6), tmp_path)
    validity = json.loads((tmp_path / "validity.json").read_text())
    assert validity["panels_mm"] == 1.0
    assert validity["fold_share"] >= 0.85 * validity["planar_fold_share"]
    assert validity["panels_reason"].startswith(
        "plates of 0.5 mm, as with 0.6 mm a press folds its"
    )
    assert validity["panels_reason"] in (tmp_path / "report.html").read_text()
    skin = read_design(tmp_path / "design.toml")
    assert skin == report.skin
    assert skin.panels.thickness == 1e-3
    assert skin.provenance["panels.thickness"].reason == validity["panels_reason"]
    gap = next(gate for gate in validity["gates"] if gate["name"] == "crease_gap")
    assert gap["holds"]
    assert gap["value"] == pytest.approx(report.made.with_plate(6e-4).gates[-1].value / 1.2)


@pytest.mark.slow
@pytest.mark.parametrize("surface", ["cylinder:53.4", "cone:60,80,150"])
def test_a_newton_folds_its_cell_and_moves_magnets_as_on_a_plane_with_the_same_panels(
    planar, tmp_path, surface
):
    """By the whole model: with the frame's stops, the board on its pillars, and large motions."""
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge
    from smoskin.twin.whole import Twin

    skin = tessellate_surface(surface, planar, (6, 6), tmp_path).skin
    shares, moved = [], []
    for design in (skin, replace(planar, panels=skin.panels)):
        own, model = geometry(design), BarHinge(design, grip=Frictionless())
        places = own.tops.reshape(-1, 1, 2)
        force = np.broadcast_to([0.0, 0.0, -1.0], (len(places), 1, 3))
        pressed = model.press(Touches(position=places, force=force))
        sunk = np.moveaxis(pressed.displacements, 0, -1)
        tops = model.lattice.at_tops(sunk)[:, 2].diagonal()
        normals = own.axes[own.sheet.columns][..., 2]
        feet = np.einsum("nmib,nmi->bnm", sunk[own.sheet.columns], normals)
        cells = [
            feet[k, 2 * n : 2 * n + 3, m : m + 2].mean()
            for k, (n, m) in enumerate(np.ndindex(own.sheet.loaded.shape))
        ]
        shares.append(np.mean(1 - np.array(cells) / tops))
        motion = Twin(design).motions(Touches(position=places, force=force))
        on_sheet = [k for k, magnet in enumerate(design.magnets) if magnet.mount == "sheet"]
        moved.append(np.linalg.norm(motion.magnets[:, on_sheet, :3], axis=-1).mean())
    assert shares[0] >= 0.8 * shares[1]
    assert moved[0] >= 0.7 * moved[1]


def test_panels_of_a_sheet_that_is_locked_are_kept(planar):
    made, flat = (
        tessellate(surface, planar.cell, (2, 2), plate=6e-4, refold=False)
        for surface in (Sphere(0.267), Plane())
    )
    chosen = panels_for(planar, made, flat)
    assert chosen.design is planar
    assert chosen.reason == "plates of 0.6 mm, as in planar"
    thin = panels_for(planar, made.with_plate(5e-4), flat)
    assert thin.design.panels.thickness == 1e-3
    assert thin.reason == "plates of 0.5 mm, as creases leave no room for 0.6 mm"


@pytest.mark.parametrize(
    ("surface", "name", "unit"),
    [("sphere:100", "fold_angle_inside", "deg"), ("cylinder:15", "curvature_times_cell", "1")],
)
def test_a_surface_that_is_refused_leaves_the_bound_and_no_sheet(
    planar, tmp_path, surface, name, unit
):
    for file in {*SOUND, "design.toml"}:
        (tmp_path / file).write_text("of another sheet")
    with pytest.raises(TooBentError) as refused:
        tessellate_surface(surface, planar, (12, 12), tmp_path, scale=0.6, force=True)
    assert {file.name for file in tmp_path.iterdir()} == {"validity.json"}
    validity = json.loads((tmp_path / "validity.json").read_text())
    assert validity["holds"] is False
    assert validity["advice"] == str(refused.value)
    [gate] = validity["gates"]
    assert (gate["name"], gate["unit"], gate["holds"]) == (name, unit, False)
    assert gate["value"] > gate["limit"] > 0
    assert gate.keys() == {"name", "value", "limit", "unit", "holds"}


def test_elsewhere_there_is_geometry_alone_and_an_older_design_goes(planar, tmp_path):
    (tmp_path / "design.toml").write_text("of another sheet")
    report = tessellate_surface("sphere:267", planar, (2, 2), tmp_path, force=True)
    assert report.made.holds
    assert {file.name for file in tmp_path.iterdir()} == SOUND
    sensing = json.loads((tmp_path / "validity.json").read_text())["sensing"]
    assert sensing == (
        "geometry alone: skins are sensed on planes, cylinders and cones; film and circuit are "
        "flat and cannot lie on a surface that is bent two ways"
    )
    assert sensing in (tmp_path / "report.html").read_text()


def test_pages_show_every_gate_and_ask_for_nothing_outside(planar, tmp_path):
    report = tessellate_surface("cylinder:100", planar, (2, 2), tmp_path)
    page = (tmp_path / "report.html").read_text()
    for gate in report.made.gates:
        assert f"<td>{gate.name}</td><td>{gate.value:.4g}</td>" in page
    assert 'class="NO"' not in page
    assert 'href="fold.html"' in page
    for name in ("report.html", "fold.html"):
        text = (tmp_path / name).read_text()
        assert 'src="http' not in text
        assert 'href="http' not in text


def test_the_folded_mesh_is_the_sheet_in_millimetres(planar, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    report = tessellate_surface("cylinder:100", planar, (2, 2), tmp_path)
    read = trimesh.load_mesh(tmp_path / "sheet.stl")
    np.testing.assert_allclose(
        np.ptp(read.vertices, axis=0), 1e3 * np.ptp(report.made.sheet.vertices, axis=0), rtol=1e-6
    )
    panels = report.made.sheet.vertices[report.made.sheet.facets]
    areas = np.cross(panels[:, 2] - panels[:, 0], panels[:, 3] - panels[:, 1]) / 2
    assert read.area == pytest.approx(1e6 * np.linalg.norm(areas, axis=1).sum(), rel=1e-6)
    assert (read.face_normals @ [0, 0, 1] > 0).all()


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


@pytest.mark.slow
@pytest.mark.browser
def test_the_slider_folds_the_sheet_and_lowers_it_on_to_its_surface(planar, tmp_path):
    made = tessellate_surface("cylinder:80", planar, (3, 3), tmp_path).made
    with open_file(tmp_path / "fold.html") as opened:

        def corners(share):
            """Panels' corners at a place of the slider, mm."""
            opened.page.locator("#fold").fill(str(share))
            places = opened.page.evaluate("Array.from(groups[0].now)")
            return np.reshape(places, (-1, 4, 3))

        facets = made.sheet.facets
        np.testing.assert_allclose(corners(1), 1e3 * made.sheet.vertices[facets], atol=1e-4)
        flat = corners(0)
        assert np.linalg.matrix_rank(flat.reshape(-1, 3) - flat[0, 0], tol=1e-2) == 2
        spans = np.linalg.norm(flat[:, 2] - flat[:, 0], axis=1)
        pattern = 1e3 * made.pattern[facets]
        aim = np.linalg.norm(pattern[:, 2] - pattern[:, 0], axis=1)
        np.testing.assert_allclose(spans, aim, atol=1e-3)
        half = corners(0.5)
        assert np.abs(half - flat).max() > 3
        assert np.abs(half - corners(1)).max() > 3
        before = opened.page.screenshot()
        opened.page.locator("input[type=radio]").nth(2).check()
        assert opened.page.screenshot() != before
        assert opened.page.locator("input[type=radio]").count() == 4
        assert "most now" in opened.page.locator("form").text_content()
