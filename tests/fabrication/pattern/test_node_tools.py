"""The FOLD file in origami libraries that others wrote: npm's `fold` and `rabbit-ear`."""

import json
import os
import shutil
import subprocess

import numpy as np
import pytest

from smoskin.fabrication.pattern.files import fold_files
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from smoskin.origami.pattern import broken_rules, read_pattern

SCRIPT = """
const ear = require("rabbit-ear"), fold = require("fold");
const given = JSON.parse(require("fs").readFileSync(0));
const flat = structuredClone(given);
flat.vertices_coords = flat.vertices_coords.map(v => v.slice(0, 2));
const alone = {vertices_coords: flat.vertices_coords, edges_vertices: given.edges_vertices};
fold.convert.edges_vertices_to_vertices_vertices_sorted(alone);
fold.convert.vertices_vertices_to_faces_vertices(alone);
const whole = Object.assign(flat, ear.graph.populate(flat));
process.stdout.write(JSON.stringify({
  kawasaki: ear.singleVertex.validateKawasaki(whole),
  maekawa: ear.singleVertex.validateMaekawa(whole),
  valid: ear.graph.validate(whole).summary,
  faces: alone.faces_vertices.length,
  edges: ["mountainEdges", "valleyEdges", "boundaryEdges"].map(k => fold.filter[k](given).length),
  folded: ear.graph.makeVerticesCoordsFolded(whole),
}));
"""


def ask_node(text):
    """What the libraries say of a FOLD document; skips where they are not installed."""
    if not shutil.which("node"):
        pytest.skip("no node")
    environment = {
        **os.environ,
        "NODE_PATH": os.environ.get("SMOSKIN_NODE_MODULES", "node_modules"),
    }
    there = subprocess.run(
        ["node", "-e", "require('fold'); require('rabbit-ear')"],
        env=environment,
        capture_output=True,
    )
    if there.returncode:
        pytest.skip("npm install fold rabbit-ear, and name their folder in SMOSKIN_NODE_MODULES")
    done = subprocess.run(
        ["node", "-e", SCRIPT],
        input=text,
        env=environment,
        capture_output=True,
        timeout=60,
        check=True,
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_they_read_it_find_it_legal_and_fold_it_to_the_designed_sheet(name, request):
    design = request.getfixturevalue(name)
    files = {file.path: file.content for file in fold_files(design, Workshop())}
    report = ask_node(files["pattern/pattern.fold"])
    assert report["valid"] == "valid"
    assert report["kawasaki"] == report["maekawa"] == []
    assert report["faces"] == 144
    sheet = geometry(design).sheet
    ridges = int(sheet.mountain.sum())
    assert report["edges"] == [ridges, len(sheet.creases) - ridges, 48]
    folded, aim = np.array(report["folded"]) * 1e-3, sheet.vertices
    apart = [np.linalg.norm(v[:, None] - v[None], axis=2) for v in (folded, aim)]
    assert np.abs(apart[0] - apart[1]).max() < 1e-6
    # Distances are blind to a mirror: ridges must be up.
    rise = [np.linalg.det(v[[1, 2, 27]] - v[0]) for v in (folded, aim)]
    assert np.sign(rise[0]) == np.sign(rise[1])
    assert abs(rise[0]) > 1e-10


def test_they_and_we_find_the_same_vertices_illegal(planar, tmp_path):
    files = {file.path: file.content for file in fold_files(planar, Workshop())}
    document = json.loads(files["pattern/pattern.fold"])
    rng = np.random.default_rng(4)
    for vertex in rng.choice(len(document["vertices_coords"]), 5, replace=False).tolist():
        document["vertices_coords"][vertex][0] += 1.0
    letters = document["edges_assignment"]
    for edge in rng.choice([k for k, a in enumerate(letters) if a != "B"], 5).tolist():
        letters[edge] = "V" if letters[edge] == "M" else "M"
    file = tmp_path / "bad.fold"
    file.write_text(json.dumps(document))
    report = ask_node(file.read_bytes())
    broken = broken_rules(read_pattern(file))
    for rule in ("Kawasaki", "Maekawa"):
        own = sorted(finding.vertex for finding in broken if finding.rule == rule)
        assert own == sorted(report[rule.lower()])
        assert len(own) >= 5
