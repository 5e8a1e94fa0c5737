"""What a turn of the skin changes: the Earth's field and the weight of what can move."""

import numpy as np
import pytest

from skins import with_magnets
from smoskin.design.document import read_design
from smoskin.magnetics import mlx90393
from smoskin.magnetics.arrangement import rotation_matrix
from smoskin.magnetics.sector import field_and_gradient
from smoskin.mechanics.board import board_of, carried
from smoskin.mechanics.weight import sags
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.sensing.signals.turning import change_by_weight, turning, uniform_covariance
from smoskin.twin.whole import Twin
from smoskin.twin.world.arm import motion_by_acceleration


def moved(design, chip, motion):
    """Change of a chip's field, (3,), T, by its magnet's motion (6,), m and rad, by differences."""
    magnet, rest = design.magnet(design.halls[chip].magnet), geometry(design).rest[chip]

    def seen(motion):
        turn = rotation_matrix(motion[3:])
        return turn @ field_and_gradient(magnet, turn.T @ (rest - motion[:3]))[0]

    step = 1e-3 * np.asarray(motion)
    return (seen(step) - seen(-step)) / 2e-3


@pytest.mark.parametrize("chips", [None, (0, 2), (1,)])
def test_a_turn_changes_what_the_earth_and_weight_say(planar, chips):
    magnets, board = sags(planar)
    used = range(len(planar.halls)) if chips is None else chips
    earth = uniform_covariance(np.tile(np.eye(3), (len(used), 1, 1)), 100e-6)
    expected = np.array(earth)
    for way in range(3):
        parts = []
        for chip in used:
            magnet = planar.magnet(planar.halls[chip].magnet)
            if magnet.mount == "sheet":  # it hangs above its chip
                motion = magnets[planar.magnets.index(magnet), :, way]
            else:  # the chip goes with its board over a magnet below, and turns with it
                site = geometry(planar).chips[chip]
                motion = -np.append(carried(board_of(planar), site) @ board, board[3:], axis=0)
                motion[:3] -= np.cross(motion[3:].T, geometry(planar).rest[chip]).T
                motion = motion[:, way]
            parts.append(moved(planar, chip, motion))
        whole = np.concatenate(parts)
        expected += np.outer(whole, whole)
        for row, part in enumerate(parts):
            own = slice(3 * row, 3 * row + 3)
            expected[own, own] += 0.2**2 / 3 * (part @ part) * np.eye(3)
    covariance = turning(planar, chips)
    np.testing.assert_array_equal(covariance.field, earth)
    np.testing.assert_allclose(covariance.whole, expected, rtol=1e-5, atol=1e-7 * expected.max())


def test_a_field_that_is_the_same_at_all_chips_moves_them_together(planar):
    covariance = uniform_covariance(np.tile(np.eye(3), (3, 1, 1)), 2e-6)
    rng = np.random.default_rng(0)
    drawn = np.tile(2e-6 * rng.normal(size=(200_000, 3)), 3)
    np.testing.assert_allclose(np.cov(drawn.T), covariance, atol=0.02 * 4e-12)
    more = with_magnets(planar, [(2, 1), (3, 3)], (6, 6))
    assert turning(more).field.shape == (9, 9)


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_weight_moves_chips_as_the_whole_sheet_says(name):
    """Against the nonlinear sheet on its board, and exact fields of all its magnets."""
    design = read_design(name)
    twin = Twin(design)
    magnets, board = motion_by_acceleration(twin)
    sagged = sags(design)
    np.testing.assert_allclose(sagged.magnets[:, :3], 9.81 * magnets[:, :3], rtol=0.03, atol=2e-6)
    np.testing.assert_allclose(sagged.board, 9.81 * board, rtol=1e-9, atol=1e-12)
    turns = mlx90393.rotations(design.halls)
    rest = twin.readout.seen(Motion.rest(len(design.magnets)))
    patterns = []
    for way in range(3):
        tenth = Motion(magnets=0.981 * magnets[..., way], board=0.981 * board[:, way])
        patterns.append(10 * np.einsum("sij,sj->si", turns, twin.readout.seen(tenth) - rest))
    exact = np.stack(patterns, axis=-1)
    like = np.stack([change_by_weight(design, chip, sagged) for chip in range(len(exact))])
    off = np.sqrt(((like - exact) ** 2).sum(axis=(1, 2)) / (exact**2).sum(axis=(1, 2)))
    assert off.max() < 0.05
