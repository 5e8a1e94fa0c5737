"""Flat patterns against sheets whose patterns are known."""

import numpy as np
import pytest

from published_patterns import published
from smoskin.errors import ArgumentError
from smoskin.origami.sheet import build_sheet
from smoskin.origami.tessellation.unfold import lengths_of, unfold


def test_the_regular_sheet_unfolds_to_its_parallelograms(planar):
    sheet, cell = build_sheet(planar.cell, (4, 3)), planar.cell
    flat, closure = unfold(sheet.vertices, sheet.facets, sheet.vertices[:, :2])
    assert closure < 1e-15
    grid = flat.reshape(9, 7, 2)
    across = np.diff(grid, axis=1)
    np.testing.assert_allclose(across, np.broadcast_to([0, cell.panel_a], across.shape), atol=1e-14)
    along = np.diff(grid, axis=0)
    np.testing.assert_allclose(along[..., 0], cell.panel_b * np.sin(cell.sector_angle), atol=1e-14)
    np.testing.assert_allclose(flat.mean(axis=0), 0.0, atol=1e-15)


def test_lengths_are_kept_and_faces_stay_up():
    vertices, facets = published("F4D")
    flat, closure = unfold(vertices, facets, vertices[:, :2])
    assert closure < 1e-12 * np.ptp(vertices)
    pairs = lengths_of(facets)
    space = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)
    np.testing.assert_allclose(np.linalg.norm(flat[pairs[:, 0]] - flat[pairs[:, 1]], axis=1), space)
    p, r, q, s = (flat[facets[:, k]] for k in (0, 2, 1, 3))
    (a, b), (c, d) = (r - p).T, (s - q).T
    assert (a * d - b * c > 0).all()


def test_what_is_rounded_does_not_grow_from_panel_to_panel(planar):
    # Seventy panels along a slanted way: by doubling, a rounding would be longer than the sheet.
    sheet = build_sheet(planar.cell, (35, 35))
    rng = np.random.default_rng(0)
    stretched = sheet.vertices * (1 + 1e-13 * rng.standard_normal(sheet.vertices.shape))
    flat, closure = unfold(stretched, sheet.facets, sheet.vertices[:, :2])
    assert closure < 1e-12
    p, r, q, s = (flat[sheet.facets[:, k]] for k in (0, 2, 1, 3))
    (a, b), (c, d) = (r - p).T, (s - q).T
    assert (a * d - b * c > 0).all()


def test_a_bump_that_cannot_unfold_is_told_by_its_closure(planar):
    sheet = build_sheet(planar.cell, (2, 2))
    bent = sheet.vertices + [0, 0, 1e-3] * (np.arange(25) == 12)[:, None]
    assert 1e-6 < unfold(bent, sheet.facets, bent[:, :2])[1] < 1e-3


def test_panels_that_do_not_hang_together_are_refused(planar):
    sheet = build_sheet(planar.cell, (2, 2))
    with pytest.raises(ArgumentError, match="must hang together"):
        unfold(sheet.vertices, sheet.facets[[0, 10]], sheet.vertices[:, :2])
