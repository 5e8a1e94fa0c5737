"""Conditions of sheets against differences and against patterns that others published."""

import numpy as np
import pytest

from published_patterns import published
from smoskin.origami.sheet import build_sheet
from smoskin.origami.tessellation.conditions import (
    angle_slopes,
    net_of,
    sector_angles,
    volumes,
    warps,
)

STEP = 1e-7


@pytest.fixture
def crumpled(planar):
    """A sheet, each vertex moved at random, and a direction to move all of them in."""
    sheet = build_sheet(planar.cell, (2, 3))
    rng = np.random.default_rng(1)
    noise, way = rng.normal(size=(2, *sheet.vertices.shape))
    return net_of(sheet.facets), sheet.vertices + 3e-4 * noise, way


def test_derivatives_are_those_of_the_values(crumpled):
    net, places, way = crumpled
    slopes = angle_slopes(net, places)
    volume, by_places = volumes(net, places, 0.02)
    differences = [
        (of(places + STEP * way) - of(places - STEP * way)) / (2 * STEP)
        for of in (lambda x: sector_angles(net, x), lambda x: volumes(net, x, 0.02)[0])
    ]
    np.testing.assert_allclose(slopes @ way.ravel(), differences[0], rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(by_places @ way.ravel(), differences[1], rtol=1e-6, atol=1e-6)
    assert volume.shape == (24,)


def test_inner_vertices_are_those_that_panels_surround(planar):
    sheet = build_sheet(planar.cell, (2, 3))
    net = net_of(sheet.facets)
    grid = np.arange(35).reshape(5, 7)
    np.testing.assert_array_equal(net.inner, grid[1:-1, 1:-1].ravel())
    angles = sector_angles(net, sheet.vertices)
    np.testing.assert_allclose(net.around @ angles, 2 * np.pi)
    # Opposite corners of a vertex belong to panels that share it alone.
    for row in net.opposite.toarray():
        first, second = net.facets[np.flatnonzero(row) // 4]
        assert len(set(first) & set(second)) == 1
    np.testing.assert_allclose(net.opposite @ angles, np.pi)


def test_flat_places_have_angles_too():
    net = net_of(np.array([[0, 1, 2, 3]]))
    square = np.array([[0.0, 0], [2, 0], [2, 1], [0, 1]])
    np.testing.assert_allclose(sector_angles(net, square), np.pi / 2)
    assert net.inner.size == 0
    assert net.around.shape == net.opposite.shape == (0, 4)


def test_a_warp_is_the_distance_of_diagonals_over_their_length():
    corners = np.array([[0.0, 0, 0], [1, 0, 0.1], [1, 1, 0], [0, 1, 0.1]])
    net = net_of(np.array([[0, 1, 2, 3]]))
    np.testing.assert_allclose(abs(warps(net, corners)), 0.1 / np.sqrt(2))


@pytest.mark.parametrize("name", ["F4B", "F4D", "F4E"])
def test_published_patterns_are_plane_and_unfold(name):
    vertices, facets = published(name)
    net = net_of(facets)
    assert np.abs(warps(net, vertices)).max() < 1e-6
    assert np.abs(net.around @ sector_angles(net, vertices) - 2 * np.pi).max() < 1e-9
