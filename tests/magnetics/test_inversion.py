"""Displacements from fields, against the exact field that the inverse does not use."""

import numpy as np
import pytest

from smoskin.magnetics import inversion, sector
from smoskin.magnetics.inversion import FieldInverse, rest_cross_talk
from smoskin.origami.geometry import geometry


def exact_fields(design, moved):
    """Field of each chip's own magnet when the chip has moved, (..., S, 3)."""
    fields = []
    for s, site in enumerate(design.halls):
        rest = geometry(design).rest[s]
        fields.append(sector.field(design.magnet(site.magnet), rest + moved[..., s, :]))
    return np.stack(fields, axis=-2)


def test_round_trip_over_the_stroke_within_a_micrometre(planar):
    inverse = FieldInverse(planar)
    moved = np.random.default_rng(0).uniform(-1, 1, (2000, 3, 3)) * [1.2e-3, 1.2e-3, 0.5e-3]
    answer = inverse.displacements(exact_fields(planar, moved))
    assert answer.within.all()
    assert np.abs(answer.moved - moved).max() < 1e-6


def test_rest_is_rest(planar):
    inverse = FieldInverse(planar)
    answer = inverse.displacements(inverse.rest_field[None])
    assert answer.within.all()
    np.testing.assert_allclose(answer.moved, 0, atol=1e-7)


@pytest.mark.parametrize("field", [0.0, np.nan, 1.0, -0.05])
def test_a_field_of_no_place_is_not_found_and_does_not_raise(planar, field):
    answer = FieldInverse(planar).displacements(np.full((2, 3, 3), field))
    assert not answer.within.any()


def test_one_reading_and_many_give_the_same(planar):
    inverse = FieldInverse(planar)
    moved = np.random.default_rng(1).uniform(-0.6e-3, 0.6e-3, (300, 3, 3)) * [1, 1, 0.2]
    fields = exact_fields(planar, moved)
    together = inverse.displacements(fields)
    alone = [inverse.displacements(field[None]) for field in fields]
    np.testing.assert_allclose(
        np.concatenate([estimate.moved for estimate in alone]),
        together.moved,
        rtol=1e-9,
        atol=1e-15,
    )
    assert together.within.all()
    assert all(estimate.within.all() for estimate in alone)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("chip", [0, 1, 2])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_place_counts_until_the_stroke_ends(planar, axis, chip, sign):
    """Exact fields of places inside and outside; one chip outside is enough."""
    inverse = FieldInverse(planar)
    far = np.array([2.2, 2.49, 2.51, 2.6, 3.0])
    moved = np.zeros((len(far), 3, 3))
    moved[:, chip, axis] = sign * far * 1e-3
    answer = inverse.displacements(exact_fields(planar, moved))
    assert answer.within.tolist() == [True, True, False, False, False]
    np.testing.assert_allclose(answer.moved[:2], moved[:2], atol=2e-6)


def test_the_stroke_may_be_another(planar):
    moved = np.zeros((2, 3, 3))
    moved[:, 1, 0] = [0.99e-3, 1.01e-3]
    fields = exact_fields(planar, moved)
    assert FieldInverse(planar, stroke=1e-3).displacements(fields).within.tolist() == [True, False]


def test_past_its_usable_range_the_closed_inverse_is_refined(planar):
    """With a tolerance so wide that Newton steps never follow, the answer errs more."""
    moved = np.zeros((1, 3, 3))
    moved[:, :, 0] = 1.2e-3
    fields = exact_fields(planar, moved)
    errors = [
        np.abs(FieldInverse(planar, tolerance=most).displacements(fields).moved - moved).max()
        for most in (1e-6, 1e-3)
    ]
    assert errors[0] < 1e-7
    assert 1e-6 < errors[1] < 1e-3


def test_the_other_magnets_fields_are_those_of_their_places(planar):
    """Each chip at rest, magnet by magnet."""
    chips, magnets = geometry(planar).chips, geometry(planar).magnets
    expected = np.zeros((3, 3))
    for s, site in enumerate(planar.halls):
        for magnet, place in zip(planar.magnets, magnets, strict=True):
            if magnet.name != site.magnet:
                expected[s] += sector.field(magnet, chips[s] - place)
    assert np.abs(expected).max() > 1e-7
    np.testing.assert_allclose(rest_cross_talk(planar), expected, rtol=1e-12, atol=1e-15)


def test_one_reading_near_rest_takes_plain_numbers(planar, monkeypatch):
    """The pace of a live skin: no array is inverted while every magnet is in its usable range."""
    inverse = FieldInverse(planar)
    moved = np.full((1, 3, 3), 1e-4)
    fields = exact_fields(planar, moved)

    def refused(*_):
        raise AssertionError("arrays were inverted")

    monkeypatch.setattr(inversion, "displacement", refused)
    answer = inverse.displacements(fields)
    np.testing.assert_allclose(answer.moved, moved, atol=1e-6)
    assert answer.within.tolist() == [True]
    # Past the usable range of one chip, or with a field that no place has, arrays take over.
    far = moved.copy()
    far[0, 1, 0] = 1e-3
    for field in (exact_fields(planar, far), np.zeros((1, 3, 3))):
        with pytest.raises(AssertionError, match="arrays were inverted"):
            inverse.displacements(field)


@pytest.mark.parametrize("field", [0.0, np.nan, 1.0])
def test_one_reading_of_no_place_is_not_found(planar, field):
    assert not FieldInverse(planar).displacements(np.full((1, 3, 3), field)).within.any()
