"""The pattern's files in a browser's origami simulator, which others wrote."""

import base64
import json
from dataclasses import replace

import pytest

from origami_simulator import folds_to, open_simulator
from smoskin.fabrication.pattern.files import fold_files
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry


@pytest.fixture(scope="module")
def small(planar):
    """A skin of few cells, which the simulator folds soon."""
    corners = {"M1": (1, 2), "M2": (2, 1), "M3": (1, 1)}
    magnets = tuple(replace(m, corner=corners[m.name]) for m in planar.magnets)
    return replace(planar, cells=(3, 3), magnets=magnets)


@pytest.fixture(scope="module")
def files(small):
    return {file.path.split("/")[1]: file.content for file in fold_files(small, Workshop())}


@pytest.mark.slow
@pytest.mark.browser
def test_the_fold_file_folds_to_the_designed_sheet(small, files):
    with open_simulator() as opened:
        pattern = json.loads(files["pattern.fold"])
        opened.page.evaluate("fold => globals.pattern.setFoldData(fold)", pattern)
        assert folds_to(opened, geometry(small).sheet.vertices, 0.2e-3) < 0.5


@pytest.mark.slow
@pytest.mark.browser
def test_the_picture_is_read_as_the_same_pattern(small, files):
    with open_simulator() as opened:
        picture = "data:image/svg+xml;base64," + base64.b64encode(files["creases.svg"]).decode()
        opened.page.evaluate("url => globals.pattern.loadSVG(url)", picture)
        sheet = geometry(small).sheet
        script = "() => globals.pattern.getFoldData(false)"
        opened.wait_until(
            lambda: len(opened.page.evaluate(script)["vertices_coords"]) == len(sheet.vertices)
        )
        fold_data = opened.page.evaluate(script)
    kinds = {kind: fold_data["edges_assignment"].count(kind) for kind in "MVB"}
    ridges = int(sheet.mountain.sum())
    assert kinds["M"] == ridges
    assert kinds["V"] == len(sheet.creases) - ridges
    assert kinds["B"] == 24
