"""Files of a sheet, read back by hand."""

import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from smoskin.origami.surface.analytic import Cylinder
from smoskin.origami.tessellation import documents
from smoskin.origami.tessellation.hinges import fold_angles, frame_of
from smoskin.origami.tessellation.tessellate import tessellate


@pytest.fixture(scope="module")
def made(planar):
    return tessellate(Cylinder(0.1), planar.cell, (2, 2))


def test_the_folded_form_holds_the_sheet_and_its_way_from_flat(made):
    fold = json.loads(documents.folded_form(made, "a skin"))
    assert fold["frame_classes"] == ["foldedForm"]
    assert fold["frame_unit"] == "mm"
    np.testing.assert_allclose(fold["vertices_coords"], 1e3 * made.sheet.vertices, atol=1e-11)
    assert fold["faces_vertices"] == made.sheet.facets.tolist()
    assert len(fold["edges_vertices"]) == 40
    frames = fold["file_frames"]
    assert frames[0]["frame_classes"] == ["creasePattern"]
    assert all(frame["frame_inherit"] and frame["frame_parent"] == 0 for frame in frames)
    # The angles of every frame are those of its own vertices.
    creases = [k for k, name in enumerate(fold["edges_assignment"]) if name != "B"]
    pairs = np.array(fold["edges_vertices"])[creases]
    for frame in (*frames[1:], fold):
        places = np.array(frame["vertices_coords"])
        hinges = frame_of(places, made.sheet.facets, pairs).creases
        degrees = [frame["edges_foldAngle"][k] for k in creases]
        np.testing.assert_allclose(degrees, np.degrees(fold_angles(places, hinges)), atol=1e-7)


def test_the_crease_pattern_is_flat_with_all_that_simulators_ask_for(made):
    fold = json.loads(documents.crease_pattern(made, "a skin"))
    places = np.array(fold["vertices_coords"])
    np.testing.assert_array_equal(places[:, 2], 0.0)
    assert "file_frames" not in fold
    names, angles = fold["edges_assignment"], fold["edges_foldAngle"]
    assert (names.count("B"), names.count("M") + names.count("V")) == (16, 24)
    assert all((a is None) == (n == "B") for n, a in zip(names, angles, strict=True))
    assert all(a < 0 if n == "M" else a > 0 for n, a in zip(names, angles, strict=True) if a)
    first = places[np.array(fold["faces_vertices"])]
    (ax, ay, _), (bx, by, _) = (first[:, 2] - first[:, 0]).T, (first[:, 3] - first[:, 1]).T
    assert (ax * by - ay * bx > 0).all()  # counter-clockwise


def test_validity_tells_gates_and_how_the_sheet_folds(made):
    validity = json.loads(documents.validity(made, surface="cylinder:100"))
    assert validity["holds"] is True
    assert validity["folds"] is True
    assert set(validity["gates"][0]) == {"name", "value", "limit", "unit", "holds"}
    assert validity["surface"] == "cylinder:100"
    assert validity["refolding_error_mm"] < 1e-9


def test_the_mesh_and_the_drawing_are_in_millimetres(made):
    lines = documents.mesh_text(made, "a skin").splitlines()
    read = np.array([line.split()[1:] for line in lines if line[0] == "v"], dtype=float)
    np.testing.assert_allclose(read, 1e3 * made.sheet.vertices, atol=1e-11)
    assert sum(line.startswith("f ") for line in lines) == 16
    drawing = ET.fromstring(documents.drawing(made, "a skin"))
    strokes = [child.get("stroke") for child in drawing if child.tag.endswith("line")]
    assert strokes.count("#000000") == 16
    assert strokes.count("#ff0000") + strokes.count("#0000ff") == 24
    assert drawing.get("width") == f"{float(drawing.get('viewBox').split()[2]):.3f}mm"
