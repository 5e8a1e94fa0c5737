"""Closed forms against their own differences and against curvatures known otherwise."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.origami.surface.analytic import (
    Bump,
    Cone,
    Cylinder,
    HeightField,
    Plane,
    Saddle,
    Sphere,
)
from smoskin.origami.surface.surface import Turned, curvatures, forms, straight_way

LINE = np.linspace(-0.1, 0.1, 21)
SURFACES = [
    Plane(),
    Cylinder(0.05),
    Cone(0.06, 0.08, 0.15),
    Sphere(0.1),
    Saddle(0.1),
    Bump(0.01, 0.05),
    Turned(Cone(0.06, 0.08, 0.15), 0.3),
    HeightField(LINE, LINE, np.sin(10 * LINE)[:, None] * LINE**2),
]
PLACES = np.random.default_rng(0).uniform(-0.05, 0.05, (7, 2))
STEP = 1e-5


@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: type(s).__name__)
def test_derivatives_are_those_of_places_and_normals(surface):
    at = surface.jet(PLACES)
    turns = forms(surface, PLACES).turns
    for a, step in enumerate(STEP * np.eye(2)):
        after, before = surface.jet(PLACES + step), surface.jet(PLACES - step)
        slope = (after.places - before.places) / (2 * STEP)
        bend = (after.slopes - before.slopes) / (2 * STEP)
        normals = [forms(surface, PLACES + s * step).normals for s in (1, -1)]
        np.testing.assert_allclose(at.slopes[..., a], slope, atol=1e-7)
        np.testing.assert_allclose(at.bends[..., a], bend, atol=2e-5)
        np.testing.assert_allclose(turns[..., a], (normals[0] - normals[1]) / (2 * STEP), atol=1e-5)


@pytest.mark.parametrize("surface", SURFACES[:6], ids=lambda s: type(s).__name__)
def test_the_middle_lies_at_the_origin_along_x_y_and_z(surface):
    at = forms(surface, np.zeros(2))
    np.testing.assert_allclose(at.places, 0.0, atol=1e-15)
    np.testing.assert_allclose(at.slopes, np.eye(3)[:, :2], atol=1e-15)
    np.testing.assert_allclose(at.normals, [0.0, 0.0, 1.0], atol=1e-15)


def test_curvatures_are_the_textbooks():
    r = 0.07 + PLACES[:, 0] * 0.02 / np.hypot(0.02, 0.15)
    across = 0.15 / np.hypot(0.02, 0.15) / r
    expected = {
        Cylinder(0.05): [-20.0, 0.0],
        Sphere(0.1): [-10.0, -10.0],
        Cone(0.06, 0.08, 0.15): np.stack([-across, 0 * across], axis=-1),
    }
    for surface, values in expected.items():
        principal = curvatures(forms(surface, PLACES))
        np.testing.assert_allclose(principal, np.broadcast_to(values, principal.shape), atol=1e-6)
    np.testing.assert_allclose(curvatures(forms(Saddle(0.1), np.zeros(2))), [-10.0, 10.0])
    np.testing.assert_allclose(curvatures(forms(Bump(0.01, 0.05), np.zeros(2))), [-4.0, -4.0])


def test_a_chart_that_is_turned_tells_the_same_surface():
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    ours, other = (
        forms(Turned(Cylinder(0.05), np.pi / 2), PLACES),
        forms(Cylinder(0.05), PLACES @ turn.T),
    )
    np.testing.assert_allclose(ours.places, other.places, atol=1e-15)
    np.testing.assert_allclose(ours.normals, other.normals, atol=1e-15)
    np.testing.assert_allclose(ours.second[:, 0, 0], other.second[:, 1, 1], atol=1e-12)


def test_saddles_are_straight_along_two_lines_in_their_middle_and_others_are_not():
    for surface in (Saddle(0.1), Turned(Saddle(0.1), 0.3)):
        way = straight_way(surface)
        line = [np.cos(way), np.sin(way)]
        assert line @ forms(surface, np.zeros(2)).second @ line == pytest.approx(0.0, abs=1e-12)
    assert abs(way) == pytest.approx(np.pi / 4 - 0.3)  # the lesser of two
    assert [straight_way(surface) for surface in SURFACES[:4]] == [0.0] * 4


def test_places_lie_on_the_surface_that_is_named():
    x, y, z = np.moveaxis(Sphere(0.1).jet(PLACES).places, -1, 0)
    np.testing.assert_allclose(np.sqrt(x**2 + y**2 + (z + 0.1) ** 2), 0.1)
    # A cone with the axis through (0, 0, -r0 / cos) and the half angle of its slope.
    slope = np.arctan2(0.02, 0.15)
    apex = np.array([-0.07 / np.sin(slope), 0.0, 0.0])
    axis = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    away = Cone(0.06, 0.08, 0.15).jet(PLACES).places - apex
    cosine = away @ axis / np.linalg.norm(away, axis=-1)
    np.testing.assert_allclose(np.arccos(cosine), slope)


def test_a_wide_cylinder_keeps_its_digits():
    z = Cylinder(1e6).jet(np.array([0.0, 0.1])).places[2]
    np.testing.assert_allclose(z, -5e-9, rtol=1e-12)


def test_charts_know_where_they_end():
    assert list(Cylinder(0.05).holds(np.array([[0.0, 0.15], [9.0, 0.16]]))) == [True, False]
    assert list(Cone(0.05, 0.1, 0.1).holds(np.array([[0.2, 0.0], [-0.2, 0.0]]))) == [True, False]
    assert list(SURFACES[-1].holds(np.array([[0.0, 0.1], [0.11, 0.0]]))) == [True, False]
    assert list(Sphere(0.1).holds(np.array([[0.19, 0.1], [0.2, 0.1]]))) == [True, False]
    assert all(surface.holds(PLACES).all() for surface in SURFACES)


def test_wrong_sizes_are_refused_by_name():
    with pytest.raises(ArgumentError, match="radius must be finite and > 0 m; got 0"):
        Cylinder(0.0)
    with pytest.raises(ArgumentError, match="last must be finite"):
        Cone(0.1, -0.1, 0.1)
    with pytest.raises(ArgumentError, match="radius must be a number"):
        Sphere("3")
    with pytest.raises(ArgumentError, match="height must be finite"):
        Bump(np.inf, 0.1)
    with pytest.raises(ArgumentError, match="x must be at least four rising numbers"):
        HeightField(LINE[::-1], LINE, np.zeros((21, 21)))
    with pytest.raises(ArgumentError, match="heights must be finite"):
        HeightField(LINE, LINE, np.full((21, 21), np.nan))
