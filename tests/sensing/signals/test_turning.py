"""What a turn of the skin changes: the Earth's field and the weight of what can move."""

import numpy as np
import pytest

from skins import with_magnets
from smoskin.magnetics.sector import field_and_gradient
from smoskin.mechanics.weight import slides
from smoskin.origami.geometry import geometry
from smoskin.sensing.signals.turning import turning, uniform_covariance


def moved(design, chip, motion):
    """Change of a chip's field, (3,), T, by a motion of its magnet, m, by differences."""
    magnet, rest = design.magnet(design.halls[chip].magnet), geometry(design).rest[chip]
    step = 1e-3 * np.asarray(motion)
    more, less = (field_and_gradient(magnet, rest + s)[0] for s in (step, -step))
    return (more - less) / 2e-3


@pytest.mark.parametrize("chips", [None, (0, 2), (1,)])
def test_a_turn_changes_what_the_earth_and_weight_say(planar, chips):
    sheet, board = slides(planar)
    used = range(len(planar.halls)) if chips is None else chips
    earth = uniform_covariance(len(used), 100e-6)
    expected = np.array(earth)
    for axis in np.eye(3):
        parts = []
        for chip in used:
            on_base = planar.magnet(planar.halls[chip].magnet).mount == "base"
            # A magnet hangs above its chip; a chip slides with its board over a magnet below.
            way = board * axis * [1, 1, 0.05] if on_base else -sheet * axis
            parts.append(moved(planar, chip, way))
        whole = np.concatenate(parts)
        expected += np.outer(whole, whole)
        for row, part in enumerate(parts):
            own = slice(3 * row, 3 * row + 3)
            expected[own, own] += 0.2**2 / 3 * (part @ part) * np.eye(3)
    found = turning(planar, chips)
    np.testing.assert_array_equal(found.field, earth)
    np.testing.assert_allclose(found.whole, expected, rtol=1e-5, atol=1e-7 * expected.max())


def test_a_field_that_is_the_same_at_all_chips_moves_them_together(planar):
    covariance = uniform_covariance(3, 2e-6)
    rng = np.random.default_rng(0)
    drawn = np.tile(2e-6 * rng.normal(size=(200_000, 3)), 3)
    np.testing.assert_allclose(np.cov(drawn.T), covariance, atol=0.02 * 4e-12)
    more = with_magnets(planar, [(2, 1), (3, 3)], (6, 6))
    assert turning(more).field.shape == (9, 9)
