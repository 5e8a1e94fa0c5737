"""Charts of meshes against the surfaces that these were made of."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.origami.surface.analytic import Bump, Cylinder, Plane, Sphere
from smoskin.origami.surface.chart import chart_of
from smoskin.origami.surface.mesh import Mesh
from smoskin.origami.surface.surface import curvatures, forms
from triangle_meshes import meshed

HALF = (0.07, 0.09)
SIZE = (0.08, 0.12)


def of(mesh, point=(0, 0, 0), along=(1, 0, 0), size=SIZE):
    return chart_of(mesh, point, along, size, 0.02)


def grid(chart):
    return np.random.default_rng(1).uniform(-1, 1, (300, 2)) * chart.half


def test_a_cylinder_of_triangles_keeps_lengths_and_place():
    chart = of(meshed(Cylinder(0.08), HALF))
    at = forms(chart, grid(chart))
    assert np.abs(np.hypot(at.places[:, 1], at.places[:, 2] + 0.08) - 0.08).max() < 2e-6
    np.testing.assert_allclose(at.metric, np.broadcast_to(np.eye(2), at.metric.shape), atol=5e-3)
    np.testing.assert_allclose(curvatures(at), np.broadcast_to([-12.5, 0.0], (300, 2)), atol=0.15)
    assert chart.roughness < 1e-6
    assert list(chart.holds(np.array([[0.04, 0.06], [0.041, 0.0]]))) == [True, False]


def test_derivatives_are_those_of_places():
    chart = of(meshed(Bump(0.01, 0.05), HALF))
    u = grid(chart)[:20] * 0.9
    at = chart.jet(u)
    for a, step in enumerate(1e-5 * np.eye(2)):
        after, before = chart.jet(u + step), chart.jet(u - step)
        np.testing.assert_allclose(
            at.slopes[..., a], (after.places - before.places) / 2e-5, atol=1e-7
        )
        np.testing.assert_allclose(
            at.bends[..., a], (after.slopes - before.slopes) / 2e-5, atol=5e-3
        )


def test_noise_finer_than_a_cell_goes_and_is_told():
    chart = of(meshed(Sphere(0.2), HALF, noise=1e-4, seed=3))
    middle = np.array([0, 0, -0.2])
    off = np.linalg.norm(forms(chart, grid(chart)).places - middle, axis=1) - 0.2
    assert np.sqrt(np.mean(off**2)) < 0.035e-3
    assert 0.08e-3 < chart.roughness < 0.11e-3


def test_the_chart_begins_at_the_point_and_along_the_direction():
    mesh = meshed(Cylinder(0.08), HALF)
    point = Cylinder(0.08).jet(np.array([0.011, 0.017])).places
    direction = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    at = forms(of(mesh, 1.01 * point, direction, (0.05, 0.05)), np.zeros(2))
    assert np.linalg.norm(at.places - point) < 1e-3
    along = direction - (direction @ at.normals) * at.normals
    assert along @ at.slopes[:, 0] / np.linalg.norm(along) / np.linalg.norm(at.slopes[:, 0]) > 0.999


def test_a_whole_tube_is_charted_on_one_side():
    turn = np.pi * 0.05
    mesh = meshed(Cylinder(0.05), (0.06, turn * 0.98))
    chart = of(mesh, size=(0.08, turn))  # a half turn
    at = forms(chart, grid(chart))
    assert np.abs(np.hypot(at.places[:, 1], at.places[:, 2] + 0.05) - 0.05).max() < 1e-5


def test_parts_that_no_sheet_can_lie_on_are_refused_with_their_place():
    hole = meshed(Plane(), HALF, drop=lambda u: np.hypot(*(u - [0.02, 0.01]).T) < 5e-3)
    with pytest.raises(ArgumentError, match=r"has a hole under the sheet, near \(\d\d\.\d, \d"):
        of(hole)
    of(hole, point=(-0.04, 0, 0), size=(0.04, 0.06))  # beside the hole
    with pytest.raises(ArgumentError, match="ends or has a hole under the sheet"):
        of(meshed(Plane(), HALF), size=(0.15, 0.1))
    with pytest.raises(ArgumentError, match="along must lie in the surface"):
        of(meshed(Plane(), HALF), along=(0, 0, 1))
    roof = meshed(Plane(), HALF)
    x, y, _ = roof.vertices.T
    steep = np.column_stack([x, y, -20 * np.maximum(x - 0.02, 0)])
    with pytest.raises(ArgumentError, match="folds over or has a sharp edge under the sheet, near"):
        of(Mesh(steep, roof.triangles))
    small = Mesh(np.eye(3) * 1e-3, [[0, 1, 2]])
    with pytest.raises(ArgumentError, match=r"ends or has a hole|smaller than the sheet"):
        of(small)
