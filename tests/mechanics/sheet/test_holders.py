"""Magnets on their holders: rigid motions, the reduced model's limit, and the rim."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skins import with_magnets
from smoskin.mechanics.reduced.attenuation import (
    column_displacements,
    magnet_displacements,
    profiles,
)
from smoskin.mechanics.sheet.holders import holder_columns, holder_matrix
from smoskin.origami.geometry import geometry

SHEET = [1, 2]
"""Which of the reference design's magnets hang on the sheet."""


def magnet_motion(design, displacements):
    """Motion of every magnet, (G, 6), with the vertices' displacements, (..., V, 3)."""
    return np.einsum("gkvd,...vd->...gk", holder_matrix(design), displacements)


def on_vertices(design, loaded, attenuation):
    """The reduced model's column displacements as a field over all vertices."""
    sheet = geometry(design).sheet
    parts = profiles(design.cell, design.cells, (attenuation, attenuation), -1e-3)
    moved = np.zeros_like(sheet.vertices)
    moved[sheet.columns, :2] = column_displacements(parts, loaded)
    return parts, moved


def rigid_motion(design, g, shift, turn):
    """Of all vertices with magnet g."""
    away = geometry(design).sheet.vertices - geometry(design).magnets[g]
    return np.asarray(shift) + np.cross(turn, away)


@given(shift=st.tuples(*[st.floats(-1e-3, 1e-3)] * 3), turn=st.tuples(*[st.floats(-0.1, 0.1)] * 3))
def test_a_sheet_that_moves_as_a_body_takes_its_magnets_along(planar, shift, turn):
    for g in SHEET:
        motion = magnet_motion(planar, rigid_motion(planar, g, shift, turn))
        assert_allclose(motion[g], [*shift, *turn], atol=1e-15)


@pytest.mark.parametrize("corner", [(0, 0), (0, 3), (6, 6), (6, 0), (3, 0), (3, 6), (1, 1)])
def test_a_magnet_anywhere_on_the_grid_is_held(planar, corner):
    design = with_magnets(planar, [corner])
    shift, turn = [1e-4, -2e-4, 3e-4], [0.01, -0.02, 0.03]
    motion = magnet_motion(design, rigid_motion(design, 1, shift, turn))
    assert_allclose(motion[1], [*shift, *turn], atol=1e-15)


@pytest.mark.parametrize("loaded", [(0, 0), (2, 3), (5, 1), (3, 2)])
def test_a_rigid_sheet_moves_its_magnets_as_the_reduced_model_says(planar, loaded):
    parts, moved = on_vertices(planar, loaded, 1.0)
    motion = magnet_motion(planar, moved)
    for g in SHEET:
        expected = magnet_displacements(parts, planar.magnets[g].corner)[loaded]
        assert_allclose(motion[g, :2], expected, rtol=1e-12)
        assert_allclose(motion[g, 2:], 0, atol=1e-12)


@pytest.mark.parametrize("loaded", [(0, 0), (2, 3), (5, 1), (3, 2)])
def test_with_attenuation_y_is_that_of_the_reduced_model_and_x_its_mean_over_both_cells(
    planar, loaded
):
    v = planar.coefficients.attenuation[0]
    parts, moved = on_vertices(planar, loaded, v)
    motion = magnet_motion(planar, moved)
    for g in SHEET:
        p, _ = planar.magnets[g].corner
        x, y = magnet_displacements(parts, planar.magnets[g].corner)[loaded]
        growth = np.diff(parts.x[loaded[0], ::2])
        assert motion[g, 1] == pytest.approx(y, rel=1e-12)
        assert motion[g, 0] - x == pytest.approx((growth[p] - growth[p - 1]) / 4, rel=1e-9)


def test_a_magnet_hangs_on_the_three_columns_round_it(planar):
    sheet = geometry(planar).sheet
    for g in SHEET:
        gripping, bearing = holder_columns(planar, planar.magnets[g])
        p, q = planar.magnets[g].corner
        assert set(gripping) == {sheet.columns[2 * p - 1, q], sheet.columns[2 * p + 1, q]}
        distance = np.linalg.norm(
            sheet.vertices[sheet.columns, :2] - geometry(planar).magnets[g, :2], axis=-1
        )
        assert set(bearing) == set(sheet.columns.ravel()[np.argsort(distance, axis=None)[:3]])


def test_a_tilt_shifts_a_magnet_by_its_lever(planar):
    """Lowering the column on the far side tips the magnet below back under it."""
    sheet = geometry(planar).sheet
    p, q = planar.magnets[1].corner
    moved = np.zeros_like(sheet.vertices)
    moved[sheet.columns[2 * p + 1, q], 2] = -1e-4
    motion = magnet_motion(planar, moved)[1]
    tilt = 1e-4 / (sheet.vertices[sheet.columns[2, 0], 0] - sheet.vertices[sheet.columns[0, 0], 0])
    depth = -geometry(planar).magnets[1, 2]
    assert motion[4] == pytest.approx(tilt, rel=1e-12)
    assert motion[0] == pytest.approx(-tilt * depth, rel=1e-12)
    assert motion[2] == pytest.approx(-0.5e-4, rel=1e-12)


def test_the_map_is_linear_in_batches_and_leaves_the_base_alone(planar):
    moved = np.random.default_rng(0).normal(size=(2, 5, 169, 3))
    motion = magnet_motion(planar, moved)
    assert motion.shape == (2, 5, 3, 6)
    assert_allclose(motion[1, 3], magnet_motion(planar, moved[1, 3]), rtol=1e-12)
    assert_allclose(motion[:, :, 0], 0)
    assert holder_matrix(planar).shape == (3, 6, 169, 3)


def test_other_sizes_of_skin(long_planar):
    one_cell = replace(with_magnets(long_planar, [(1, 0)], cells=(1, 1)), name="one")
    motion = magnet_motion(one_cell, rigid_motion(one_cell, 1, [1e-4, 0, 0], [0, 0.1, 0]))
    assert_allclose(motion[1], [1e-4, 0, 0, 0, 0.1, 0], atol=1e-15)


@pytest.mark.parametrize("driver", ["column", "vertex"])
@pytest.mark.parametrize("corner", [(4, 2), (2, 4), (0, 3)])
def test_whatever_drives_it_a_magnet_goes_along_with_a_sheet_that_moves_as_a_body(
    planar, driver, corner
):
    plain = with_magnets(planar, [corner])
    magnets = (plain.magnets[0], replace(plain.magnets[1], driver=driver))
    design = replace(plain, magnets=magnets)
    shift, turn = [1e-4, -2e-4, 3e-4], [0.01, -0.02, 0.03]
    motion = magnet_motion(design, rigid_motion(design, 1, shift, turn))
    assert_allclose(motion[1], [*shift, *turn], atol=1e-15)


def test_the_driver_alone_moves_a_magnet_in_the_plane(planar):
    sheet = geometry(planar).sheet
    for driver, above in (("column", 2), ("vertex", 1)):
        magnets = (*planar.magnets[:1], replace(planar.magnets[1], driver=driver))
        design = replace(planar, magnets=magnets, halls=planar.halls[:2])
        by_plane = holder_matrix(design)[1, :2, :, :2]
        driven = np.flatnonzero(np.abs(by_plane).max(axis=(0, 2)) > 1e-12)
        assert len(driven) == above
        assert_allclose(by_plane.sum(axis=1), np.eye(2), atol=1e-12)
        if driver == "vertex":
            assert driven[0] in sheet.columns
            assert_allclose(geometry(design).magnets[1, :2], sheet.vertices[driven[0], :2])
