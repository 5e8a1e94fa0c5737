"""Displacements from fields, against the exact field that the inverse does not use."""

import numpy as np
import pytest

from smoskin.magnetics import sector
from smoskin.magnetics.inversion import FieldInverse
from smoskin.origami.layout import chip_offset


def exact_fields(design, moved):
    """Field of each chip's own magnet when the chip has moved, (..., S, 3)."""
    fields = []
    for s, site in enumerate(design.halls):
        rest = np.array([0.0, 0.0, chip_offset(design, site)])
        fields.append(sector.field(design.magnet(site.magnet), rest + moved[..., s, :]))
    return np.stack(fields, axis=-2)


def test_round_trip_over_the_stroke_within_a_micrometre(planar):
    inverse = FieldInverse(planar)
    moved = np.random.default_rng(0).uniform(-1, 1, (2000, 3, 3)) * [1.2e-3, 1.2e-3, 0.5e-3]
    answer = inverse.displacements(exact_fields(planar, moved))
    assert answer.found.all()
    assert np.abs(answer.moved - moved).max() < 1e-6


def test_rest_is_rest(planar):
    inverse = FieldInverse(planar)
    answer = inverse.displacements(inverse.rest_field[None])
    assert answer.found.all()
    np.testing.assert_allclose(answer.moved, 0, atol=1e-7)


@pytest.mark.parametrize("field", [0.0, np.nan, 1.0, -0.05])
def test_a_field_of_no_place_is_not_found_and_does_not_raise(planar, field):
    answer = FieldInverse(planar).displacements(np.full((2, 3, 3), field))
    assert not answer.found.any()


def test_one_reading_and_many_give_the_same(planar):
    inverse = FieldInverse(planar)
    moved = np.random.default_rng(1).uniform(-0.6e-3, 0.6e-3, (300, 3, 3)) * [1, 1, 0.2]
    fields = exact_fields(planar, moved)
    together = inverse.displacements(fields)
    alone = [inverse.displacements(one[None]) for one in fields]
    np.testing.assert_allclose(
        np.concatenate([one.moved for one in alone]), together.moved, rtol=1e-9, atol=1e-15
    )
    assert together.found.all()
    assert all(one.found.all() for one in alone)
