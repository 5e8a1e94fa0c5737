"""Zero, drift, temperature and chip faults."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.magnetics.inversion import FieldInverse, rest_cross_talk
from smoskin.records import ChipFlag, Contact, Reading, Status
from smoskin.sensing.signals.conditioning import Conditioner, IdleZero, ZeroTracking
from smoskin.twin.reduced import ReducedTwin
from studies.recordings.eflesh import read_eflesh

TOUCH = [Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))]


@pytest.fixture
def twin(planar):
    return ReducedTwin(planar, seed=None)


def conditioner(design, **tracking: float) -> Conditioner:
    inverse = FieldInverse(design)
    return Conditioner(
        design, inverse.rest_field, rest_cross_talk(design), tracking=ZeroTracking(**tracking)
    )


def changed(reading: Reading, **changes: object) -> Reading:
    values = {name: getattr(reading, name) for name in ("time", "field", "temperature", "flags")}
    return Reading(**(values | changes))


def test_an_untouched_ideal_skin_reads_its_rest_field(planar, twin):
    one = conditioner(planar).step(twin.read())
    assert one.status is Status.NO_CONTACT
    np.testing.assert_allclose(one.field, FieldInverse(planar).rest_field, atol=0.1e-6)


@pytest.mark.parametrize("temperature", [0.0, 25.0, 60.0])
def test_temperature_is_taken_out(planar, twin, temperature):
    held = twin.motion(TOUCH)  # the same motion: warm rubber would move less
    warm = conditioner(planar).step(twin.sense(held, temperature=temperature)).field
    reference = conditioner(planar).step(twin.sense(held)).field
    np.testing.assert_allclose(warm, reference, atol=1e-9)


def test_an_offset_is_zeroed(planar, twin):
    earth = np.array([30e-6, -40e-6, 55e-6])
    seen = conditioner(planar)
    idle = [changed(twin.read(time=0.01 * k), field=twin.read().field + earth) for k in range(10)]
    seen.zero(idle)
    touched = changed(twin.read(TOUCH, time=1.0), field=twin.read(TOUCH).field + earth)
    clean = conditioner(planar).step(twin.read(TOUCH, time=1.0)).field
    np.testing.assert_allclose(seen.step(touched).field, clean, atol=0.1e-6)


def test_the_zero_follows_slow_drift_while_idle(planar, twin):
    seen = conditioner(planar, hold=1.0, time_constant=2.0)
    rest = twin.read()
    for k in range(6000):  # 1 uT a second for a minute, 60 uT in all: over the idle band
        drifted = changed(rest, time=0.01 * k, field=rest.field + 1e-8 * k)
        assert seen.step(drifted).status is Status.NO_CONTACT
    assert np.abs(seen.drift).max() == pytest.approx(58e-6, abs=1e-6)  # lags by the time constant


def test_a_press_does_not_move_the_zero(planar, twin):
    seen = conditioner(planar, hold=0.0)
    for k in range(300):
        seen.step(twin.read(TOUCH, time=0.01 * k))
    assert np.all(seen.drift == 0)


def test_past_its_bound_the_zero_is_not_believed(planar, twin):
    seen = conditioner(planar, hold=0.0, time_constant=0.5, drift_bound=50e-6)
    rest = twin.read()
    statuses = [
        seen.step(changed(rest, time=0.01 * k, field=rest.field + 5e-8 * k)).status
        for k in range(2000)
    ]
    assert statuses[0] is Status.NO_CONTACT
    assert statuses[-1] is Status.NOT_CALIBRATED
    seen.reset()
    assert seen.step(changed(twin.read(), time=0.0)).status is Status.NO_CONTACT


@pytest.mark.parametrize(
    ("flags", "status"),
    [
        ([ChipFlag.MISSING, 0, 0], Status.CHIP_MISSING),
        ([0, ChipFlag.INVALID, 0], Status.CHIP_MISSING),
        ([0, ChipFlag.SATURATED, 0], Status.SATURATED),
        ([0, 0, ChipFlag.WRAPPED], Status.SATURATED),
        ([0, ChipFlag.MISSING, ChipFlag.SATURATED], Status.CHIP_MISSING),
        ([ChipFlag.OLD, ChipFlag.OLD, ChipFlag.OLD], Status.STALE),
    ],
)
def test_flags_become_statuses(planar, twin, flags, status):
    assert conditioner(planar).step(changed(twin.read(), flags=flags)).status is status


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_become_a_missing_chip(planar, twin, value):
    field = twin.read().field.copy()
    field[1, 2] = value
    assert conditioner(planar).step(changed(twin.read(), field=field)).status is Status.CHIP_MISSING
    field[2] = -field[1]
    assert conditioner(planar).step(changed(twin.read(), field=field)).status is Status.CHIP_MISSING


def test_time_that_does_not_go_on_is_stale(planar, twin):
    seen = conditioner(planar)
    times = [0.0, 0.1, 0.05, 0.1, 0.2]
    statuses = [seen.step(twin.read(time=t)).status for t in times]
    assert [s is Status.STALE for s in statuses] == [False, False, True, True, False]


def test_a_jump_of_half_the_window_is_a_wrap_where_a_chip_can_wrap(planar, twin):
    fine = replace(
        planar, hall_setting=replace(planar.hall_setting, gain_selection=0, resolution=1)
    )
    seen = conditioner(fine)
    assert seen.step(twin.read()).status is Status.NO_CONTACT
    wrapped = twin.read(time=0.1).field - [0.0, 0.0, 0.17]
    assert seen.step(changed(twin.read(), time=0.1, field=wrapped)).status is Status.SATURATED


@pytest.mark.parametrize("report", [np.nan, -300.0, 1e6])
def test_a_temperature_that_cannot_be_is_the_last_good_one(planar, twin, report):
    seen, reference = conditioner(planar), conditioner(planar)
    for one in (seen, reference):
        one.step(twin.read(TOUCH, time=0.0, temperature=45.0))
    bad = changed(twin.read(TOUCH, time=0.1, temperature=45.0), temperature=[45.0, report, 45.0])
    good = twin.read(TOUCH, time=0.1, temperature=45.0)
    np.testing.assert_array_equal(seen.step(bad).field, reference.step(good).field)


def test_wrong_use_is_named(planar, twin):
    seen = conditioner(planar)
    with pytest.raises(ArgumentError, match="must come from 3 chips, as the design has; got 4"):
        seen.step(Reading(time=0.0, field=np.zeros((4, 3))))
    with pytest.raises(ArgumentError, match="must come from 3 chips, as the design has; got 5"):
        seen.zero([twin.read(), Reading(time=0.0, field=np.zeros((5, 3)))])
    with pytest.raises(ArgumentError, match="at least one with all chips good; got 1 readings"):
        seen.zero([changed(twin.read(), flags=[1, 0, 0])])
    with pytest.raises(ArgumentError, match="time_constant must be positive; got 0"):
        ZeroTracking(time_constant=0)
    with pytest.raises(ArgumentError, match="widening_rate must be >= 0; got -1"):
        ZeroTracking(widening_rate=-1)


def followed(zero: IdleZero, time, read) -> np.ndarray:
    """Which readings are idle, one after the other."""
    return np.array([zero.step(float(t), row) for t, row in zip(time, read, strict=True)])


@pytest.mark.parametrize("rate", [5.0, 100.0])
def test_a_zero_that_moved_under_a_touch_is_found_again(rate):
    # A rubber that does not come back whole: 60 uT stay after a touch, over the idle band.
    time = np.arange(0.0, 120.0, 1 / rate)
    read = np.zeros((len(time), 3))
    read[time >= 10] = [4e-4, 0.0, 0.0]
    read[time >= 20] = [6e-5, 0.0, 0.0]
    fixed = IdleZero(ZeroTracking(widening_rate=0.0), np.zeros(3))
    widening = IdleZero(ZeroTracking(), np.zeros(3))
    assert not followed(fixed, time, read)[time >= 20].any()
    idle = followed(widening, time, read)
    assert idle[time < 10].all()
    assert not idle[(time >= 10) & (time < 20)].any()
    assert idle[time >= 31].all()
    np.testing.assert_allclose(widening.offset, [6e-5, 0.0, 0.0], atol=1e-6)


def test_a_touch_stronger_than_the_widest_band_is_never_taken_for_the_zero():
    zero = IdleZero(ZeroTracking(), np.zeros(3))
    time = np.arange(0.0, 3600.0, 0.5)
    assert not followed(zero, time, np.tile([0.0, 81e-6, 0.0], (len(time), 1))).any()
    assert not zero.drift.any()


def test_a_still_zero_neither_moves_nor_widens_its_band():
    zero = IdleZero(ZeroTracking(hold=0.0, time_constant=np.inf), np.zeros(3))
    time = np.arange(0.0, 200.0, 0.5)
    read = np.where(time[:, None] < 100, 45e-6, 35e-6) * np.ones(3)
    np.testing.assert_array_equal(followed(zero, time, read), time >= 100)
    assert not zero.drift.any()


def test_after_a_reading_not_believed_idleness_holds_anew():
    zero = IdleZero(ZeroTracking(hold=1.0), np.zeros(3))
    for k in range(30):
        zero.step(0.1 * k, np.full(3, 2e-5))
    moved = zero.drift.copy()
    assert (moved > 0).all()
    zero.interrupt(3.0)
    for k in range(31, 40):
        zero.step(0.1 * k, np.full(3, 2e-5))
    np.testing.assert_array_equal(zero.drift, moved)


@pytest.mark.recordings
def test_idle_moments_of_a_real_recording_are_found_among_presses(recordings):
    (run,) = (one for one in read_eflesh(recordings) if one.set == "spatial_resolution")
    rest = run.field - run.field_rezeroed
    zero = IdleZero(ZeroTracking(hold=0.0, time_constant=30.0), rest[0])
    idle = [
        (zero.step(float(t) - 2.0, a), zero.step(float(t), b))
        for t, a, b in zip(run.time, rest, run.field, strict=True)
    ]
    at_rest, pressed = np.sum(idle, axis=0)
    assert at_rest > 0.99 * len(rest)
    assert pressed == 0
    assert zero.believed
