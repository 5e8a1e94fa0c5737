"""The record of a skin's answers, and what it refuses."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.reduced.stiffness import board_stiffness, sheet_stiffness
from smoskin.sensing.closed_form.press_table import PressTable, uniform_drag
from tables import ideal_table


def test_a_uniform_drag_moves_the_board_on_and_the_sheet_ahead(planar):
    """As `location.readout` takes it off: SI Eq. (S26)."""
    drag = uniform_drag(planar)
    assert drag.shape == (6, 6, 3, 3, 2)
    across = drag[2, 3, :, :2]
    np.testing.assert_allclose(across[0], np.eye(2) / board_stiffness(planar))
    np.testing.assert_allclose(across[1], -np.eye(2) / sheet_stiffness(planar))
    np.testing.assert_allclose(across[2], across[1])
    assert not drag[:, :, :, 2].any()
    assert np.ptp(drag, axis=(0, 1)).max() == 0
    np.testing.assert_allclose(uniform_drag(planar, 500.0, 1e3)[0, 0, :2, 0, 0], (2e-3, -1e-3))


def test_answers_are_press_and_drags_side_by_side(planar):
    table = ideal_table(planar)
    answers = table.answers
    assert answers.shape == (6, 6, 9, 3)
    np.testing.assert_array_equal(answers[..., 0], table.press.reshape(6, 6, 9))
    np.testing.assert_array_equal(answers[..., 2], table.drag[..., 1].reshape(6, 6, 9))
    with pytest.raises(ValueError, match="read-only"):
        table.press[0] = 0.0


def test_tables_are_equal_by_their_numbers(planar):
    table = ideal_table(planar)
    assert table == ideal_table(planar)
    assert table != ideal_table(planar, 1.001)
    assert table != 1


def test_wrong_use_is_named(planar):
    table = ideal_table(planar)
    still = table.press.copy()
    still[3, 1] = 0.0
    with pytest.raises(ModelError, match=r"each in its own way; cell \(4, 2\) does not"):
        PressTable(press=still, drag=table.drag)
    still[3, 1] = np.nan
    with pytest.raises(ModelError, match=r"must be finite .* cell \(4, 2\) does not"):
        PressTable(press=still, drag=table.drag)
    with pytest.raises(ArgumentError, match=r"drag must have shape"):
        PressTable(press=table.press, drag=table.drag[..., 0])
    with pytest.raises(ModelError, match=r"cells and chips, \(6, 6, 3\); got \(6, 6, 2\)"):
        PressTable(press=table.press[:, :, 1:] + 1e-6, drag=table.drag[:, :, :2]).check_fits(planar)
