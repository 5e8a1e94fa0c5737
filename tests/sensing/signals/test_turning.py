"""What a turn of the skin changes: the Earth's field and the weight of what can move."""

import numpy as np
import pytest

from skins import with_magnets
from smoskin.magnetics import mlx90393
from smoskin.magnetics.sector import field_and_gradient
from smoskin.mechanics.board import board_of, carried
from smoskin.mechanics.weight import sags
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.sensing.signals.turning import turning, uniform_covariance
from smoskin.twin.whole import Twin
from smoskin.twin.world.arm import motion_by_acceleration


def moved(design, chip, motion):
    """Change of a chip's field, (3,), T, by a motion of its magnet, m, by differences."""
    magnet, rest = design.magnet(design.halls[chip].magnet), geometry(design).rest[chip]
    step = 1e-3 * np.asarray(motion)
    more, less = (field_and_gradient(magnet, rest + s)[0] for s in (step, -step))
    return (more - less) / 2e-3


@pytest.mark.parametrize("chips", [None, (0, 2), (1,)])
def test_a_turn_changes_what_the_earth_and_weight_say(planar, chips):
    sheet, board = sags(planar)
    used = range(len(planar.halls)) if chips is None else chips
    earth = uniform_covariance(np.tile(np.eye(3), (len(used), 1, 1)), 100e-6)
    expected = np.array(earth)
    for way, axis in enumerate(np.eye(3)):
        parts = []
        for chip in used:
            magnet = planar.magnet(planar.halls[chip].magnet)
            if magnet.mount == "sheet":  # it hangs above its chip
                parts.append(moved(planar, chip, -sheet * axis))
                continue
            # The chip goes with its board over a magnet below, and turns with it.
            rest, site = geometry(planar).rest[chip], geometry(planar).chips[chip]
            part = moved(planar, chip, (carried(board_of(planar), site) @ board)[:, way])
            parts.append(part - np.cross(board[3:, way], field_and_gradient(magnet, rest)[0]))
        whole = np.concatenate(parts)
        expected += np.outer(whole, whole)
        for row, part in enumerate(parts):
            own = slice(3 * row, 3 * row + 3)
            expected[own, own] += 0.2**2 / 3 * (part @ part) * np.eye(3)
    found = turning(planar, chips)
    np.testing.assert_array_equal(found.field, earth)
    np.testing.assert_allclose(found.whole, expected, rtol=1e-5, atol=1e-7 * expected.max())


def test_a_field_that_is_the_same_at_all_chips_moves_them_together(planar):
    covariance = uniform_covariance(np.tile(np.eye(3), (3, 1, 1)), 2e-6)
    rng = np.random.default_rng(0)
    drawn = np.tile(2e-6 * rng.normal(size=(200_000, 3)), 3)
    np.testing.assert_allclose(np.cov(drawn.T), covariance, atol=0.02 * 4e-12)
    more = with_magnets(planar, [(2, 1), (3, 3)], (6, 6))
    assert turning(more).field.shape == (9, 9)


def test_weight_moves_chips_as_the_whole_sheet_says(planar):
    """Against the nonlinear sheet on its board, and exact fields of all its magnets."""
    twin = Twin(planar)
    magnets, board = motion_by_acceleration(twin)
    turns = mlx90393.rotations(planar.halls)
    rest = twin.readout.seen(Motion.rest(3))
    patterns = []
    for way in range(3):
        tenth = Motion(magnets=0.981 * magnets[..., way], board=0.981 * board[:, way])
        seen = np.einsum("sij,sj->si", turns, twin.readout.seen(tenth) - rest)
        patterns.append(10 * seen.ravel())
    whole, field = turning(planar).whole, turning(planar).field
    exact = np.sqrt((np.array(patterns) ** 2).sum(axis=0))
    like = np.sqrt(np.diag(whole - field))
    # 0.2 of each chip's change is what made skins differ by, alike along its axes.
    large = exact > 0.15 * exact.max()
    assert large.sum() >= 5
    np.testing.assert_allclose(like[large], exact[large], rtol=0.12)
