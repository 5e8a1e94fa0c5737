"""What no chip says while it works: every limit, from both sides of its edge."""

import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag, Reading, Status
from smoskin.sensing.signals.guards import ChipGuard, Clock


def reading(time=0.0, field=0.0, warmth=25.0, flags=None):
    return Reading(
        time=time,
        field=np.broadcast_to(field, (3, 3)),
        temperature=np.broadcast_to(warmth, (3,)),
        flags=flags,
    )


@pytest.mark.parametrize(
    ("warmth", "good"),
    [
        ((-39.9, -39.9, -39.9), True),
        ((-40.0, -39.9, -39.9), False),
        ((124.9, 124.9, 124.9), True),
        ((124.9, 125.0, 124.9), False),
        ((20.0, 34.9, 30.0), True),
        ((20.0, 30.0, 35.0), False),
        ((20.0, math.nan, 34.9), True),
        ((math.nan, 20.0, 35.1), False),
        ((math.nan, math.nan, math.nan), True),
    ],
)
def test_chips_report_their_operating_range_and_at_most_15_k_apart(warmth, good):
    guard = ChipGuard(range(3))
    assert guard.bad(reading(warmth=warmth)) is (None if good else Status.CHIP_MISSING)
    assert guard.step(reading(warmth=warmth)) is (None if good else Status.CHIP_MISSING)


@pytest.mark.parametrize("elapsed", [0.01, 1.0, 4.0])
def test_a_chip_warms_by_5_k_and_1_k_a_second_at_most(elapsed):
    most = 5.0 + elapsed
    for change, good in ((0.99 * most, True), (1.01 * most, False)):
        for sign in (1, -1):
            guard = ChipGuard(range(3))
            assert guard.step(reading(10.0, 0.0)) is None
            warmth = (25.0, 25.0 + sign * change, 25.0)
            status = guard.step(reading(10.0 + elapsed, 1e-6, warmth))
            assert status is (None if good else Status.CHIP_MISSING)
            # What was not believed counts from when it last was.
            again = guard.step(reading(10.0 + elapsed + 2.0, 2e-6, warmth))
            assert again is (None if change < most + 2 else Status.CHIP_MISSING)


def test_a_chip_that_does_not_report_keeps_its_last_temperature():
    guard = ChipGuard(range(3))
    for time, warmth in ((0.0, 25.0), (0.1, math.nan), (0.2, 29.9)):
        assert guard.step(reading(time, time, (25.0, warmth, 25.0))) is None
    assert guard.step(reading(0.3, 0.3, (25.0, math.nan, 25.0))) is None
    assert guard.step(reading(0.4, 0.4, (25.0, 24.5, 25.0))) is Status.CHIP_MISSING


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("moved", "frozen"), [(59e-6, False), (61e-6, True)])
def test_a_chip_is_frozen_that_repeats_ten_readings_while_another_moves(axis, moved, frozen):
    guard = ChipGuard(range(3))
    for k in range(12):
        field = np.array([[1e-6 * k, 0, 0], [3e-6, 3e-6, 3e-6], [0, 1e-6 * k, 0]])
        if k == 11:
            field[2, axis] = moved + (axis == 1) * 0.0
        # The tenth repetition is the first that may count, and here the last one moves far.
        status = guard.step(reading(0.1 * k, field))
        assert status is (Status.CHIP_MISSING if frozen and k == 11 else None), k


@pytest.mark.parametrize(("repeated", "frozen"), [(9, False), (10, True)])
def test_nine_repetitions_are_chance(repeated, frozen):
    guard = ChipGuard(range(3))
    for k in range(repeated + 1):
        far = 1e-3 * (k == repeated)
        field = np.array([[far, 0, 1e-7 * k], [3e-6, 3e-6, 3e-6], [0, 0, 1e-7 * k]])
        status = guard.step(reading(0.1 * k, field))
    assert status is (Status.CHIP_MISSING if frozen else None)


def test_without_a_setting_any_field_counts_that_squares_well():
    guard = ChipGuard(range(3))
    assert guard.bad(reading(field=0.99e6)) is None
    assert guard.bad(reading(field=-1.01e6)) is Status.SATURATED


def test_a_field_within_a_step_and_a_half_of_the_rail_is_saturated(planar):
    setting = planar.hall_setting
    assert not mlx90393.wraps(setting)
    full, step = mlx90393.full_scale(setting), mlx90393.sensitivity(setting)
    guard = ChipGuard(range(3), setting)
    for axis in range(3):
        for back, status in ((1.6, None), (1.4, Status.SATURATED)):
            for sign in (1, -1):
                field = np.zeros((3, 3))
                field[1, axis] = sign * (full[axis] - back * step[axis])
                assert guard.bad(reading(field=field)) is status


def test_where_chips_wrap_a_jump_of_their_range_is_a_wrap(planar):
    setting = replace(planar.hall_setting, gain_selection=0, resolution=1)
    assert mlx90393.wraps(setting)
    full = mlx90393.full_scale(setting)
    for axis in range(3):
        for share, status in ((0.99, None), (1.01, Status.SATURATED)):
            guard = ChipGuard(range(3), setting)
            field = np.zeros((3, 3))
            field[1, axis] = -0.5 * full[axis]
            assert guard.step(reading(0.0, field)) is None
            field[1, axis] += share * full[axis]
            assert guard.step(reading(0.1, field)) is status
    # A field past the largest range of the three axes is no chip's.
    for share, status in ((1.0, None), (1.02, Status.SATURATED)):
        assert ChipGuard(range(3), setting).bad(reading(field=share * full.max())) is status


@pytest.mark.parametrize(
    ("flags", "status"),
    [
        (ChipFlag.MISSING, Status.CHIP_MISSING),
        (ChipFlag.INVALID, Status.CHIP_MISSING),
        (ChipFlag.SATURATED, Status.SATURATED),
        (ChipFlag.WRAPPED, Status.SATURATED),
        (ChipFlag.OLD, Status.STALE),
        (ChipFlag.OLD | ChipFlag.WRAPPED, Status.SATURATED),
        (ChipFlag.OLD | ChipFlag.INVALID, Status.CHIP_MISSING),
        (2 * max(ChipFlag), Status.CHIP_MISSING),  # a flag of a later version
    ],
)
def test_only_flags_of_chips_that_are_used_count(flags, status):
    for chips, expected in (((0, 1, 2), status), ((1,), status), ((0, 2), None)):
        assert ChipGuard(chips).bad(reading(flags=[0, int(flags), 0])) is expected


def test_a_clock_has_started_again_where_it_goes_back_by_two_seconds():
    for back, anew in ((1.9, False), (2.1, True)):
        clock = Clock()
        assert [clock.stale(time) for time in (0.0, 10.0, 10.0)] == [False, False, True]
        assert clock.stale(10.0 - back)
        assert clock.anew is anew
        assert clock.stale(10.0 - back + 0.1) is not anew
        assert not clock.anew
