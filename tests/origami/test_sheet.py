"""The sheet as a mesh, against what its own vertices say."""

from collections import Counter, defaultdict

import numpy as np
import pytest

from smoskin.origami.cell import dihedral_angles
from smoskin.origami.sheet import build_sheet


@pytest.fixture(params=[(6, 6), (2, 3), (1, 1), (5, 2)])
def sheet(request, planar):
    return request.param, build_sheet(planar.cell, request.param)


def neighbours(facets):
    """Facets on either side of each edge."""
    sides = defaultdict(list)
    for f, corners in enumerate(facets):
        for k in range(4):
            sides[frozenset((corners[k], corners[(k + 1) % 4]))].append(f)
    return {edge: pair for edge, pair in sides.items() if len(pair) == 2}


def test_creases_are_exactly_the_edges_with_two_panels(sheet):
    _, mesh = sheet
    assert {frozenset(c) for c in mesh.creases} == set(neighbours(mesh.facets))
    assert len(mesh.creases) == len(neighbours(mesh.facets))


def test_crease_counts(sheet):
    (n, m), mesh = sheet
    assert mesh.along_a.sum() == 2 * n * m + 2 * (n - 1) * m
    assert (~mesh.along_a).sum() == 2 * n * m + 2 * n * (m - 1)


def test_mountains_are_ridges_and_dihedrals_match(sheet, planar):
    _, mesh = sheet
    v, angles = mesh.vertices, dihedral_angles(planar.cell)
    sides = neighbours(mesh.facets)
    for crease, mountain, along_a in zip(mesh.creases, mesh.mountain, mesh.along_a, strict=True):
        left, right = (mesh.facets[f] for f in sides[frozenset(crease)])
        normals = [
            (lambda n: n / np.linalg.norm(n))(np.cross(v[q[1]] - v[q[0]], v[q[3]] - v[q[0]]))
            for q in (left, right)
        ]
        assert normals[0][2] > 0  # counter-clockwise seen from above
        beyond = normals[0] @ (v[right].mean(axis=0) - v[crease[0]])
        assert (beyond < 0) == mountain
        interior = np.pi - np.arccos(normals[0] @ normals[1])
        assert interior == pytest.approx(angles.at_a if along_a else angles.at_b, abs=1e-9)


def test_three_to_one_at_every_inner_vertex(sheet):
    _, mesh = sheet
    mountains, all_creases = Counter(), Counter()
    for crease, mountain in zip(mesh.creases, mesh.mountain, strict=True):
        for vertex in crease:
            all_creases[vertex] += 1
            mountains[vertex] += bool(mountain)
    inner = [vertex for vertex, count in all_creases.items() if count == 4]
    assert all(mountains[vertex] in (1, 3) for vertex in inner)


def test_columns_stand_under_bottom_vertices_and_are_counted_once(sheet):
    (n, m), mesh = sheet
    assert np.all(mesh.vertices[mesh.columns.ravel(), 2] == 0)
    assert np.all(mesh.vertices[mesh.loaded.ravel(), 2] > 0)
    assert mesh.columns.size == n * (m + 1) + (n + 1) * (m + 1)
