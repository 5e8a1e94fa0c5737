"""FOLD and SVG files: they fold to the designed sheet, by our folding and by others' tools."""

import json
import math

import numpy as np
import pytest

from smoskin.fabrication.pattern.files import fold_files
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from smoskin.origami.tessellation.hinges import fold, frame_of


def missed(places, aim):
    """Largest distance between two shapes, m, one moved on to the other."""
    places, aim = places - places.mean(axis=0), aim - aim.mean(axis=0)
    left, _, right = np.linalg.svd(places.T @ aim)
    turn = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
    return float(np.linalg.norm(places @ turn - aim, axis=1).max())


@pytest.fixture(scope="module")
def documents(planar):
    return {file.path.split("/")[1]: file.content for file in fold_files(planar, Workshop())}


def test_the_pattern_folds_to_the_designed_sheet(planar, documents):
    pattern = json.loads(documents["pattern.fold"])
    assert pattern["frame_unit"] == "mm"
    flat = np.array(pattern["vertices_coords"])[:, :2] * 1e-3
    facets = np.array(pattern["faces_vertices"])
    folded = [
        (pair, angle)
        for pair, angle in zip(pattern["edges_vertices"], pattern["edges_foldAngle"], strict=True)
        if angle is not None
    ]
    creases = np.array([pair for pair, _ in folded])
    angles = np.radians([angle for _, angle in folded])
    frame = frame_of(np.pad(flat, ((0, 0), (0, 1))), facets, creases)
    sheet = fold(flat, frame, angles).steps[-1]
    assert missed(sheet, geometry(planar).sheet.vertices) < 1e-6
    names = dict(
        zip(map(tuple, pattern["edges_vertices"]), pattern["edges_assignment"], strict=True)
    )
    mountains = [names[min(p), max(p)] for p in geometry(planar).sheet.creases.tolist()]
    assert mountains == ["M" if m else "V" for m in geometry(planar).sheet.mountain]


def test_a_limbs_pattern_folds_round_it(curved):
    [pattern] = [f for f in fold_files(curved, Workshop()) if f.path == "pattern/pattern.fold"]
    read = json.loads(pattern.content)
    flat = np.array(read["vertices_coords"])[:, :2] * 1e-3
    edges = zip(read["edges_vertices"], read["edges_foldAngle"], strict=True)
    folded = [(pair, angle) for pair, angle in edges if angle is not None]
    frame = frame_of(
        np.pad(flat, ((0, 0), (0, 1))),
        np.array(read["faces_vertices"]),
        np.array([pair for pair, _ in folded]),
    )
    sheet = fold(flat, frame, np.radians([angle for _, angle in folded])).steps[-1]
    assert missed(sheet, geometry(curved).sheet.vertices) < 1e-6


def test_frames_lead_from_flat_to_folded(planar, documents):
    sheet = json.loads(documents["sheet.fold"])
    aim = geometry(planar).sheet.vertices
    assert missed(1e-3 * np.array(sheet["vertices_coords"]), aim) < 1e-6
    frames = sheet["file_frames"]
    assert len(frames) > 5
    heights = [float(np.ptp(np.array(f["vertices_coords"])[:, 2])) for f in frames]
    assert heights[0] == pytest.approx(0.0, abs=1e-9)
    assert missed(1e-3 * np.array(frames[-1]["vertices_coords"]), aim) < 1e-6


def test_the_fold_angles_are_the_design_s(planar, documents):
    pattern = json.loads(documents["pattern.fold"])
    angles = {round(abs(a), 3) for a in pattern["edges_foldAngle"] if a is not None}
    cell = planar.cell
    psi_a = 180 - math.degrees(
        2 * math.asin(math.sin(cell.fold_angle) / math.sin(cell.sector_angle))
    )
    assert min(angles) == pytest.approx(psi_a, abs=1e-3)
    assert len(angles) == 2


def test_the_picture_has_flat_elements_that_the_simulator_reads(documents):
    text = documents["creases.svg"].decode()
    assert "<g" not in text
    colours = {part.split('"')[1] for part in text.split(" stroke=")[1:] if '"' in part}
    assert colours == {"#ff0000", "#0000ff", "#000000"}
