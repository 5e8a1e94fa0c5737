"""Meshes that files hold, and which are no surfaces."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.origami.surface.analytic import Cylinder, Plane
from smoskin.origami.surface.mesh import LARGEST, Mesh, read_mesh
from triangle_meshes import meshed

trimesh = pytest.importorskip("trimesh")
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]])


@pytest.mark.parametrize("kind", ["stl", "obj", "ply"])
def test_files_give_back_the_mesh_in_metres(kind, tmp_path):
    mesh = meshed(Cylinder(0.05), (0.03, 0.04))
    path = tmp_path / f"link.{kind}"
    trimesh.Trimesh(1e3 * mesh.vertices, mesh.triangles, process=False).export(path)
    read = read_mesh(path)
    assert read.vertices.shape == mesh.vertices.shape
    assert read.triangles.shape == mesh.triangles.shape
    # As sets of corners: formats may number vertices anew, and hold few digits.
    corners = [np.sort(m.vertices[m.triangles].sum(axis=1), axis=0) for m in (read, mesh)]
    np.testing.assert_allclose(*corners, atol=1e-7)
    np.testing.assert_allclose(
        np.sort(read.normals, axis=0), np.sort(mesh.normals, axis=0), atol=1e-4
    )


def test_what_is_no_surface_is_refused_with_its_reason():
    with pytest.raises(ArgumentError, match="over two triangles, one near"):
        Mesh(SQUARE, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    with pytest.raises(ArgumentError, match="turned against their neighbours near"):
        Mesh(SQUARE, [[0, 1, 2], [0, 3, 2], [0, 2, 3]][:2])
    with pytest.raises(ArgumentError, match="vertices must be finite"):
        Mesh(SQUARE * np.nan, [[0, 1, 2]])
    with pytest.raises(ArgumentError, match="triangles must name vertices"):
        Mesh(SQUARE, [[0, 1, 5]])
    with pytest.raises(ArgumentError, match=r"at most 200,000 triangles; got 200,001: cut out"):
        Mesh(SQUARE, np.zeros((LARGEST + 1, 3), dtype=int))


def test_files_that_hold_no_mesh_are_refused(tmp_path):
    (tmp_path / "mesh.step").write_text("x")
    with pytest.raises(ArgumentError, match=r"must end with \.stl, \.obj, \.ply; got mesh\.step"):
        read_mesh(tmp_path / "mesh.step")
    for kind, content in [("stl", "hello"), ("ply", "hello"), ("obj", "v 1 2 3\n"), ("stl", "")]:
        (tmp_path / f"mesh.{kind}").write_text(content)
        with pytest.raises(ArgumentError, match="mesh"):
            read_mesh(tmp_path / f"mesh.{kind}")


def test_every_edge_stands_once_in_either_direction():
    mesh = meshed(Plane(), (0.01, 0.01), edge=1e-2)
    assert len(mesh.vertices) - len(mesh.edges) // 2 + len(mesh.triangles) == 1
    assert len(mesh.rim) == 8
    np.testing.assert_allclose(mesh.normals, [[0.0, 0.0, 1.0]] * 9)
