"""Skins that a workshop sets aside."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.records import ChipFlag
from smoskin.twin.inspection import drawn_skin, reads_untouched
from smoskin.twin.manufacture import Tolerances, draw


def first(design, seed):
    """The first skin that is made of a seed."""
    of_skin, _ = np.random.SeedSequence(seed).spawn(2)
    return draw(design, np.random.default_rng(of_skin))


def test_a_skin_whose_chip_stands_at_its_rail_is_set_aside(planar):
    assert not reads_untouched(planar, first(planar, 2))
    assert reads_untouched(planar, drawn_skin(planar, 2))
    for seed in (0, 1, 3):
        made, drawn = first(planar, seed), drawn_skin(planar, seed)
        assert reads_untouched(planar, made)
        np.testing.assert_array_equal(made.remanence, drawn.remanence)
        np.testing.assert_array_equal(made.columns, drawn.columns)


def test_few_of_the_reference_are_set_aside(planar):
    """About one skin in twenty-five; many more would be the design's fault."""
    rng = np.random.default_rng(7)
    passed = [reads_untouched(planar, draw(planar, rng)) for _ in range(400)]
    assert 0.93 <= np.mean(passed) < 1.0


def test_a_design_that_no_skin_can_be_read_of_gives_its_last_one(planar):
    near = replace(planar, halls=tuple(replace(hall, gap=1e-3) for hall in planar.halls))
    made = drawn_skin(near, 0, Tolerances(remanence=0.0))
    assert not reads_untouched(near, made)


def test_made_twins_answer_untouched(planar):
    pytest.importorskip("jax")
    from smoskin.twin.whole import Twin

    flags = Twin(planar, seed=2, manufactured=True).read(time=0.0).flags
    assert (flags == int(ChipFlag.GOOD)).all()
