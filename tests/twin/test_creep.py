"""How a motion creeps, state by state and over a history."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import creep, elastomer_prony
from smoskin.records import Motion
from smoskin.twin.creep import Creep


def held(rows, magnets):
    still = np.zeros((rows, magnets, 6))
    still[1:3], board = 1e-3, np.zeros((rows, 6))
    board[1:3] = 2e-3
    return Motion(magnets=still, board=board)


def test_a_history_is_what_each_rubber_makes_of_it(planar):
    steps = np.array([0.0, 0.02, 0.3, 0.02, 5.0])
    motion = held(len(steps), len(planar.magnets))
    moved = Creep(planar).steps(steps, motion)
    for rubber, elastic, crept in [
        (planar.columns.material, motion.magnets, moved.magnets),
        (planar.shear_layer.material, motion.board, moved.board),
    ]:
        known = creep(elastomer_prony(rubber), np.cumsum(steps), elastic)
        np.testing.assert_allclose(crept, known, atol=1e-15)
    assert 0 < moved.magnets[-1].max() < moved.magnets[3].max()


def test_a_state_that_is_none_leaves_the_later_ones_alone(planar):
    motion = held(4, len(planar.magnets))
    motion.magnets[1], motion.valid[1] = np.nan, False
    moved = Creep(planar).steps(np.full(4, 0.1), motion)
    assert np.isfinite(moved.magnets[[0, 2, 3]]).all()
    np.testing.assert_array_equal(moved.valid, motion.valid)


def test_time_does_not_run_backwards(planar):
    with pytest.raises(ArgumentError, match="duration"):
        Creep(planar).steps([0.0, -0.1], held(2, len(planar.magnets)))
