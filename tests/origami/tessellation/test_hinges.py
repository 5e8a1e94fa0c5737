"""Fold angles, folding again and rigidity, against the regular sheet's closed form."""

import numpy as np
import pytest

from published_patterns import published
from smoskin.origami.cell import dihedral_angles, size
from smoskin.origami.sheet import build_sheet
from smoskin.origami.tessellation.hinges import (
    fold,
    fold_angles,
    fold_slopes,
    frame_of,
    rigid_modes,
)
from smoskin.origami.tessellation.unfold import unfold

CELLS = (3, 2)
STEP = 1e-7


@pytest.fixture
def sheet(planar):
    return build_sheet(planar.cell, CELLS)


def test_angles_of_the_regular_sheet_are_its_dihedrals(sheet, planar):
    frame = frame_of(sheet.vertices, sheet.facets, sheet.creases)
    dihedral = dihedral_angles(planar.cell)
    angles = fold_angles(sheet.vertices, frame.creases)
    expected = np.pi - np.where(sheet.along_a, dihedral.at_a, dihedral.at_b)
    np.testing.assert_allclose(angles, np.where(sheet.mountain, -expected, expected), atol=1e-13)
    np.testing.assert_allclose(fold_angles(sheet.vertices, frame.panels), 0.0, atol=1e-13)


def test_derivatives_of_angles_are_their_differences(sheet):
    frame = frame_of(sheet.vertices, sheet.facets, sheet.creases)
    noise, way = np.random.default_rng(2).normal(size=(2, *sheet.vertices.shape))
    places = sheet.vertices + 3e-4 * noise
    for hinges in (frame.creases, frame.panels):
        after, before = (fold_angles(places + s * STEP * way, hinges) for s in (1, -1))
        slopes = fold_slopes(places, hinges) @ way.ravel()
        np.testing.assert_allclose(slopes, (after - before) / (2 * STEP), rtol=1e-6, atol=1e-4)


def test_the_regular_pattern_folds_again_by_angles_alone(sheet, planar):
    flat, _ = unfold(sheet.vertices, sheet.facets, sheet.vertices[:, :2])
    frame = frame_of(sheet.vertices, sheet.facets, sheet.creases)
    folding = fold(flat, frame, fold_angles(sheet.vertices, frame.creases))
    np.testing.assert_array_equal(folding.steps[0][:, :2], flat)
    assert folding.strain < 1e-12
    assert folding.twist < 1e-10
    # Distances between all vertices are those of the sheet.
    places = folding.steps[-1]
    far = np.linalg.norm(places[:, None] - places, axis=-1)
    aim = np.linalg.norm(sheet.vertices[:, None] - sheet.vertices, axis=-1)
    np.testing.assert_allclose(far, aim, atol=1e-12)
    # Half way, by the closed form, the sheet is another Miura sheet.
    grid = folding.steps[6].reshape(7, 5, 3)
    widths = np.linalg.norm(grid[:, 2:] - grid[:, :-2], axis=-1)
    lengths = np.linalg.norm(grid[2:] - grid[:-2], axis=-1)
    phi = np.arcsin(lengths.mean() / (2 * planar.cell.panel_b))
    np.testing.assert_allclose(widths, size(planar.cell, phi).width, rtol=1e-10)


def test_the_regular_sheet_has_one_motion_that_only_folds(sheet):
    values, motions = rigid_modes(sheet.vertices, sheet.facets)
    assert values[0] < 1e-13
    assert values[1] > 0.03
    # It is the change of the fold angle: heights and widths change together everywhere.
    heights = motions[0].reshape(7, 5, 3)[..., 2]
    rise = heights[:, 1::2].mean(axis=1) - heights[:, [0, 2]].mean(axis=1)
    assert np.ptp(rise) < 1e-10
    assert abs(rise).min() > 1e-3


def test_a_single_cell_folds_too(planar):
    sheet = build_sheet(planar.cell, (1, 1))
    values, _ = rigid_modes(sheet.vertices, sheet.facets)
    assert values[0] < 1e-13
    assert values[1] > 0.1


def test_both_ways_to_the_singular_values_agree(planar, monkeypatch):
    small, large = (build_sheet(planar.cell, cells) for cells in ((3, 4), (8, 8)))
    assert small.vertices.size <= 200 < large.vertices.size
    assert rigid_modes(large.vertices, large.facets)[0][0] < 1e-9
    bent = small.vertices + 1e-3 * np.random.default_rng(0).normal(size=small.vertices.shape)
    dense = rigid_modes(bent, small.facets)[0]
    monkeypatch.setattr("smoskin.origami.tessellation.hinges.DENSE", 0)
    sparse = rigid_modes(bent, small.facets)[0]
    np.testing.assert_allclose(sparse, dense, rtol=1e-6)


def test_a_published_pattern_that_is_locked_is_found_locked():
    values, _ = rigid_modes(*published("F4B"))
    np.testing.assert_allclose(values[0], 3.3e-3, rtol=0.02)
