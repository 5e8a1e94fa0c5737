"""Column motion against a direct, cell-by-cell evaluation of S8-S11."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.mechanics.reduced.attenuation import (
    cell_change,
    column_displacements,
    frame_shift,
    magnet_displacements,
    profiles,
)
from smoskin.mechanics.reduced.stiffness import relative_stiffness_map

#: Bottom vertices (2), (5), (1), (3), (6), (4) of a cell: steps (di, dj) from its top vertex.
BOTTOM = [(0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)]


def displacements_cell_by_cell(cell, cells, attenuation, press, loaded):
    """S8-S11 written out as loops: every cell moves its six columns, sharers are averaged."""
    change = cell_change(cell, press)
    total = np.zeros((2 * cells[0] + 1, cells[1] + 1, 2))
    sharers = np.zeros(total.shape[:2])
    b, phi = cell.panel_b, cell.fold_angle
    for n in range(cells[0]):
        for m in range(cells[1]):
            dl = change.dl * attenuation[0] ** abs(n - loaded[0])
            dw = change.dw * attenuation[1] ** abs(m - loaded[1])
            frame = []
            for k, growth, v in (
                (n - loaded[0], change.dl, attenuation[0]),
                (m - loaded[1], change.dw, attenuation[1]),
            ):
                between = 0.5 + sum(v**q for q in range(1, abs(k))) + v ** abs(k) / 2
                frame.append(np.sign(k) * between * growth if k else 0.0)
            zigzag = -b * np.sin(phi) * dl / (2 * b * np.cos(phi))
            for di, dj in BOTTOM:
                local = np.array([di * dl / 2, dj * dw / 2 + (di != 0) * zigzag])
                foot = 2 * n + 1 + di, m + (dj + 1) // 2
                total[foot] += frame + local
                sharers[foot] += 1
    return total / sharers[..., None]


@given(
    v_x=st.floats(0.05, 1.0),
    v_y=st.floats(0.05, 1.0),
    n0=st.integers(0, 4),
    m0=st.integers(0, 3),
)
def test_separated_parts_equal_the_cells_one_by_one(planar, v_x, v_y, n0, m0):
    cells, press = (5, 4), -0.4e-3
    parts = profiles(planar.cell, cells, (v_x, v_y), press)
    written_out = displacements_cell_by_cell(planar.cell, cells, (v_x, v_y), press, (n0, m0))
    np.testing.assert_allclose(column_displacements(parts, (n0, m0)), written_out, atol=1e-17)


@pytest.mark.parametrize("cells", [(1, 1), (1, 3), (2, 1)])
def test_the_smallest_sheets_move_as_written_out(planar, cells):
    for loaded in np.ndindex(cells):
        parts = profiles(planar.cell, cells, (0.4, 0.7), -0.4e-3)
        written_out = displacements_cell_by_cell(planar.cell, cells, (0.4, 0.7), -0.4e-3, loaded)
        np.testing.assert_allclose(column_displacements(parts, loaded), written_out, atol=1e-17)


def test_a_rigid_sheet_moves_as_a_stretched_grid(planar):
    change = cell_change(planar.cell, -1e-6)
    shift = frame_shift(6, 1.0) * change.dl
    np.testing.assert_allclose(np.diff(shift, axis=1), change.dl, rtol=1e-12)


def test_a_mirrored_press_gives_a_mirrored_answer(planar):
    parts = profiles(planar.cell, (6, 6), (0.3, 0.5), -3e-4)
    here, there = column_displacements(parts, (1, 2)), column_displacements(parts, (4, 2))
    np.testing.assert_allclose(here[..., 0], -there[::-1, :, 0], atol=1e-18)
    np.testing.assert_allclose(here[..., 1], there[::-1, :, 1], atol=1e-18)


def test_stiffness_is_the_energy_of_the_columns(planar):
    v = (0.4, 0.7)
    parts = profiles(planar.cell, (5, 4), v, -1.0)
    relative = relative_stiffness_map(planar.cell, (5, 4), v)
    for n0 in range(5):
        for m0 in range(4):
            energy = 0.5 * (column_displacements(parts, (n0, m0)) ** 2).sum()
            assert relative[n0, m0] == pytest.approx(2 * energy, rel=1e-12)


def test_magnets_move_away_from_the_load(planar):
    parts = profiles(planar.cell, planar.cells, planar.coefficients.attenuation, -1.0)
    for corner in ((4, 2), (2, 4), (3, 3)):
        motion = magnet_displacements(parts, corner)
        n, m = np.indices((6, 6))
        assert np.all((motion[..., 0] > 0) == (n < corner[0]))
        assert np.all((motion[..., 1] > 0) == (m < corner[1]))
