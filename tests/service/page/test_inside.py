"""What the page draws between the board and the sheet."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.origami.geometry import geometry
from smoskin.service.page.inside import Columns, inward_arrows

PLANAR, CURVED = read_design("planar"), read_design("curved")


def ring(places, columns, level):
    """Middles of one ring of every column, the lowest 0, the highest -1."""
    return places.reshape(len(columns.heads), -1, 6, 3)[:, level].mean(axis=1)


@pytest.mark.parametrize("design", [PLANAR, CURVED])
def test_columns_stand_from_the_board_to_the_sheet(design):
    skin, columns = geometry(design), Columns(design)
    places = columns.places(skin.sheet.vertices)
    assert set(columns.triangles.ravel()) == set(range(len(places)))
    heads = skin.sheet.vertices[columns.heads]
    np.testing.assert_allclose(ring(places, columns, -1), heads, atol=1e-12)
    over = skin.roll.developed(ring(places, columns, 0))[:, 2]
    np.testing.assert_allclose(over, -design.columns.height, atol=1e-12)
    lowest = places.reshape(len(heads), -1, 6, 3)[:, 0]
    away = np.linalg.norm(lowest - ring(places, columns, 0)[:, None], axis=-1)
    np.testing.assert_allclose(away, design.columns.radius)


def test_a_column_bends_as_between_two_ends_that_do_not_turn():
    columns, rest = Columns(PLANAR), geometry(PLANAR).sheet.vertices
    moved = columns.places(rest + np.array([1e-3, 0.0, -5e-4])) - columns.places(rest)
    np.testing.assert_allclose(ring(moved, columns, 0), 0.0, atol=1e-15)
    np.testing.assert_allclose(ring(moved, columns, 2), [[5e-4, 0, -2.5e-4]] * len(columns.heads))
    first = ring(moved, columns, 1)[:, 0]
    assert (first < 1e-3 * 3 / 16).all(), "the foot stands upright"
    last = ring(moved, columns, 3)[:, 0]
    np.testing.assert_allclose(first + last, 1e-3)


def test_a_magnet_in_place_of_a_column_leaves_that_one_out():
    magnets = tuple(
        replace(part, driver="vertex") if part.mount == "sheet" else part for part in PLANAR.magnets
    )
    hung = sum(part.mount == "sheet" for part in magnets)
    instead = Columns(replace(PLANAR, magnets=magnets))
    assert len(instead.heads) == len(Columns(PLANAR).heads) - hung


@pytest.mark.parametrize("polarity", [1, -1])
def test_arrows_point_as_the_sectors_are_magnetised(polarity):
    part = replace(PLANAR.magnets[0], polarity=polarity)
    lines = inward_arrows(part)
    shafts = lines[:4]
    inward = -((shafts[:, 1] - shafts[:, 0])[:, :2] * shafts.mean(axis=1)[:, :2]).sum(axis=1)
    assert (np.sign(inward) == polarity).all()
    assert np.linalg.norm(lines[..., :2], axis=-1).max() < part.radius
    np.testing.assert_allclose(lines[4:, 0], np.tile(shafts[:, 1], (2, 1)))
