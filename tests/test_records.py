"""What flows through the package: checked where it is made, and equal where it says the same."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.records import ChipFlag, Contact, Estimate, HeldTouch, Motion, Reading, Status

FIELD = [[1e-3, 2e-3, 3e-3], [4e-3, np.nan, 6e-3]]


def reading(**changes):
    return Reading(**{"time": 1.5, "field": FIELD, "temperature": [20.0, np.nan], **changes})


def contact(**changes):
    return Contact(**{"position": (0.01, 0.02), "force": (0.1, 0.2, -0.5), **changes})


def test_a_reading_keeps_copies_that_nobody_changes():
    field = np.array(FIELD)
    kept = Reading(time=1, field=field, flags=[0, ChipFlag.OLD])
    field[:] = 0
    np.testing.assert_array_equal(kept.field, FIELD)
    assert np.isnan(kept.temperature).all()
    assert kept.flags.tolist() == [0, 8]
    assert isinstance(kept.time, float)
    for array in (kept.field, kept.temperature, kept.flags):
        assert not array.flags.writeable
    assert reading().flags.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": np.nan}, "time must be finite; got nan"),
        ({"time": np.inf}, "time must be finite; got inf"),
        ({"field": [1.0, 2.0, 3.0]}, "field must have"),
        ({"field": [[1.0, 2.0]]}, r"field must have shape \(\.\.\., n, 3\)"),
        ({"temperature": [20.0]}, r"temperature must have shape \(\.\.\., 2\); got \(1,\)"),
        ({"flags": [0]}, r"flags must have shape \(2,\); got \(1,\)"),
        ({"flags": [[0, 0]]}, r"flags must have shape \(2,\); got \(1, 2\)"),
    ],
)
def test_a_reading_that_cannot_be_is_refused(changes, message):
    with pytest.raises(ArgumentError, match=message):
        reading(**changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"time": 1.6},
        {"field": [[1e-3, 2e-3, 3e-3], [4e-3, 0.0, 6e-3]]},
        {"temperature": [20.5, np.nan]},
        {"temperature": None},
        {"flags": [0, 1]},
    ],
)
def test_readings_are_equal_where_all_of_them_is(changes):
    assert reading() == reading()
    assert reading() != reading(**changes)
    assert reading() != 3


def test_flags_can_be_told_apart():
    flags = [ChipFlag.MISSING, ChipFlag.SATURATED, ChipFlag.WRAPPED, ChipFlag.OLD, ChipFlag.INVALID]
    assert [int(flag) for flag in flags] == [1, 2, 4, 8, 16]
    assert ChipFlag.GOOD == 0
    assert len({status.value for status in Status}) == len(Status) == 8


def test_a_contact_presses_along_minus_z():
    assert contact().normal_force == 0.5
    assert not contact().position.flags.writeable
    assert not contact().force.flags.writeable
    assert np.isnan(contact(force=(np.nan, 0, 0)).force[0])
    assert contact() == contact()
    assert contact() != contact(position=(0.01, 0.03))
    assert contact() != contact(force=(0.1, 0.2, -0.6))
    assert contact() != "contact"
    for wrong in ((np.nan, 0.0), (0.0, np.inf)):
        with pytest.raises(ArgumentError, match=r"position must be finite; got .* m"):
            contact(position=wrong)
    with pytest.raises(ArgumentError, match="force must have shape"):
        contact(force=(0.0, 0.0))


def test_an_estimate_states_a_covariance_of_each_contact():
    touched = Estimate(
        time=1.0, status=Status.CONTACT, contacts=(contact(),), covariance=np.ones((1, 5, 5))
    )
    assert not touched.covariance.flags.writeable
    assert touched == replace(touched)
    for changes in (
        {"time": 2.0},
        {"status": Status.AMBIGUOUS},
        {"contacts": (contact(position=(0.0, 0.0)),)},
        {"covariance": np.full((1, 5, 5), np.nan)},
    ):
        assert touched != replace(touched, **changes)
    assert touched != 1
    assert Estimate(time=0.0, status=Status.NO_CONTACT).covariance.shape == (0, 5, 5)
    with pytest.raises(ArgumentError, match="covariance must have shape"):
        Estimate(time=0.0, status=Status.CONTACT, contacts=(contact(),))


@pytest.mark.parametrize(
    ("rest", "held", "valid"),
    [
        ((0.0, 1.0), (2.0, 3.0), True),
        ((1.0, 1.0), (1.0, 1.0), True),
        ((0.0, 1.0), (0.999, 3.0), False),
        ((1.001, 1.0), (2.0, 3.0), False),
        ((0.0, 1.0), (3.001, 3.0), False),
    ],
)
def test_a_touch_is_held_after_the_rest(rest, held, valid):
    def touch():
        return HeldTouch(contact=contact(), readings=(reading(),), rest=rest, held=held)

    if valid:
        assert touch().held == held
        return
    with pytest.raises(ArgumentError, match="rest must end before held begins"):
        touch()


def test_a_touch_without_readings_or_times_is_refused():
    for changes in ({"readings": ()}, {"rest": (np.nan, 1.0)}, {"held": (2.0, np.inf)}):
        given = {"readings": (reading(),), "rest": (0.0, 1.0), "held": (2.0, 3.0), **changes}
        with pytest.raises(ArgumentError, match="readings must be there and times finite"):
            HeldTouch(contact=contact(), **given)


def motion(batch=()):
    rng = np.random.default_rng(1)
    return Motion(magnets=rng.normal(size=(*batch, 3, 6)), board=rng.normal(size=(*batch, 6)))


@pytest.mark.parametrize("part", ["magnets", "board"])
def test_a_motion_with_any_number_missing_is_invalid(part):
    for place in np.ndindex(getattr(motion(), part).shape):
        for value in (np.nan, np.inf):
            states = motion((2,))
            getattr(states, part)[(1, *place)] = value
            assert states.valid.tolist() == [True, False]


def test_motions_go_into_batches_and_out_again():
    states = motion((2, 4))
    assert states.valid.shape == (2, 4)
    assert np.array_equal(states[1, 2].magnets, states.magnets[1, 2])
    assert np.array_equal(states[1, 2].board, states.board[1, 2])
    back = Motion.stack([states[0], states[1]])
    assert np.array_equal(back.magnets, states.magnets)
    assert np.array_equal(back.board, states.board)
    joined = Motion.concatenate([states[1], Motion.rest(3, (1,))])
    assert joined.board.shape == (5, 6)
    assert np.array_equal(joined.magnets[:4], states.magnets[1])
    assert not joined.magnets[4].any()
    assert not joined.board[4].any()


def test_motions_are_scaled_state_by_state():
    states = motion((2,))
    alike, apart = states.scaled([2.0, 3.0]), states.scaled([2.0, 3.0], board=0.5)
    assert np.array_equal(alike.magnets[1], 3.0 * states.magnets[1])
    assert np.array_equal(alike.board[1], 3.0 * states.board[1])
    assert np.array_equal(apart.magnets, alike.magnets)
    assert np.array_equal(apart.board, 0.5 * states.board)


def test_states_that_are_not_valid_hold_no_number():
    states = motion((3,))
    some = states.where(np.array([True, False, True]))
    assert some.valid.tolist() == [True, False, True]
    assert np.isnan(some.magnets[1]).all()
    assert np.isnan(some.board[1]).all()
    assert np.array_equal(some.board[2], states.board[2])
