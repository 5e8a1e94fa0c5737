"""The zero: what is idle, how it is followed, and how far."""

import numpy as np
import pytest
from scipy.stats import chi2

from smoskin.errors import ArgumentError
from smoskin.sensing.signals.zero import (
    EARTH,
    IdleBand,
    IdleNoise,
    Zero,
    ZeroTracking,
    uniform_covariance,
)
from studies.recordings.eflesh import read_eflesh

NOISE = np.diag([1.0, 4.0, 9.0, 1.0, 1.0, 2.0]) * 1e-12
NOISE[0, 1] = NOISE[1, 0] = 1e-12


def banded(start=0.0, **tracking) -> Zero:
    """A zero of three axes in the usual band."""
    return Zero(ZeroTracking(**tracking), IdleBand(), np.full(3, start))


def followed(zero: Zero, time, read) -> np.ndarray:
    """Which readings are idle, one after the other."""
    return np.array([zero.step(float(t), row) for t, row in zip(time, read, strict=True)])


@pytest.mark.parametrize("rate", [5.0, 100.0])
def test_a_zero_that_moved_under_a_touch_is_found_again(rate):
    # A rubber that does not come back whole: 60 uT stay after a touch, over the idle band.
    time = np.arange(0.0, 120.0, 1 / rate)
    read = np.zeros((len(time), 3))
    read[time >= 10] = [4e-4, 0.0, 0.0]
    read[time >= 20] = [6e-5, 0.0, 0.0]
    fixed = banded(widening_rate=0.0)
    widening = banded()
    assert not followed(fixed, time, read)[time >= 20].any()
    idle = followed(widening, time, read)
    assert idle[time < 10].all()
    assert not idle[(time >= 10) & (time < 20)].any()
    assert idle[time >= 31].all()
    np.testing.assert_allclose(widening.offset, [6e-5, 0.0, 0.0], atol=1e-6)


def test_a_zero_that_moved_by_nearly_the_widest_band_is_found_again():
    # 40 uT of the band itself and 40 uT at most, at 1 uT/s, that the zero may move unseen.
    time = np.arange(0.0, 60.0, 0.1)
    idle = followed(banded(), time, np.tile([0.0, 79e-6, 0.0], (len(time), 1)))
    assert not idle[time < 38].any()
    assert idle[time > 40].all()


def test_a_touch_stronger_than_the_widest_band_is_never_taken_for_the_zero():
    zero = banded()
    time = np.arange(0.0, 3600.0, 0.5)
    assert not followed(zero, time, np.tile([0.0, 81e-6, 0.0], (len(time), 1))).any()
    assert not zero.drift.any()


def test_a_still_zero_neither_moves_nor_widens_its_band():
    zero = banded(hold=0.0, time_constant=np.inf)
    time = np.arange(0.0, 200.0, 0.5)
    read = np.where(time[:, None] < 100, 45e-6, 35e-6) * np.ones(3)
    np.testing.assert_array_equal(followed(zero, time, read), time >= 100)
    assert not zero.drift.any()


def test_after_a_reading_not_believed_idleness_holds_anew():
    zero = banded(hold=1.0)
    for k in range(30):
        zero.step(0.1 * k, np.full(3, 2e-5))
    moved = zero.drift.copy()
    assert (moved > 0).all()
    zero.interrupt(3.0)
    for k in range(31, 40):
        zero.step(0.1 * k, np.full(3, 2e-5))
    np.testing.assert_array_equal(zero.drift, moved)


def test_what_a_touch_left_is_idle_and_soon_the_zero():
    """It widens the band by 30 uT, and the zero follows by 50 ms; then at its own pace again."""
    for left, idle in ((69e-6, True), (71e-6, False)):
        zero = banded(hold=0.2, time_constant=10.0, widening_rate=0.0, residue=30e-6)
        assert not zero.step(0.0, np.full(3, 1e-3))
        assert zero.step(0.1, np.full(3, left)) is idle
    zero.step(1.0, np.full(3, 1e-3))
    for time in (1.1, 1.2):
        assert zero.step(time, np.full(3, 60e-6))
        assert not zero.drift.any()  # until idleness has held
    zero.step(1.31, np.full(3, 60e-6))
    np.testing.assert_allclose(zero.drift, 60e-6 * -np.expm1(-0.11 / 0.05))
    assert not zero.step(1.32, zero.offset + 44e-6)  # 40 uT, and 30 uT e^-2.2
    for time in (1.33, 1.6, 1.7):
        zero.step(time, np.full(3, 60e-6))
    before = zero.offset
    zero.step(1.9, np.full(3, 65e-6))
    zero.step(2.0, np.full(3, 65e-6))
    assert (zero.offset - before).max() < 0.6e-6


def test_the_band_ends_at_its_field_on_every_axis():
    for axis in range(3):
        for sign in (-1, 1):
            change = np.zeros(3)
            change[axis] = sign * 39.9e-6
            assert IdleBand()(change, 0.0)
            change[axis] = sign * 40.1e-6
            assert not IdleBand()(change, 0.0)
            assert IdleBand()(change, 0.2e-6)


@pytest.mark.parametrize("rate", [1e-6, 0.05, 0.9])
def test_noise_is_idle_at_the_stated_rate(rate):
    idle = IdleNoise(NOISE, (1, 2), rate)
    limit = chi2.isf(rate, 3)  # a field alike at both chips tells nothing
    spread = NOISE + uniform_covariance(2, EARTH)
    factor, rng = np.linalg.cholesky(spread), np.random.default_rng(0)
    for _ in range(20):
        change = np.full((3, 3), 1.0)  # not a chip that is used
        way = rng.normal(size=6)
        way /= np.linalg.norm(way)
        change[1:] = (factor @ way * np.sqrt(0.999 * limit)).reshape(2, 3)
        assert idle(change, 0.0)
        change[1:] *= np.sqrt(1.001 / 0.999)
        assert not idle(change, 0.0)


def test_what_the_zero_may_have_moved_unseen_is_noise_too():
    unseen, limit = 3e-6, chi2.isf(1e-3, 3)
    spread = NOISE + uniform_covariance(2, EARTH) + unseen**2 * np.eye(6)
    idle, factor = IdleNoise(NOISE, (0, 1), 1e-3), np.linalg.cholesky(spread)
    for way in np.eye(6):
        change = (factor @ way * np.sqrt(limit)).reshape(2, 3)
        assert idle(0.999 * change, unseen)
        assert not idle(1.001 * change, unseen)
        if not way[:3].any():  # else mostly alike at both chips
            assert not idle(0.999 * change, 0.0)


def test_hold_ends_when_it_says():
    zero = banded(hold=1.0)
    for time in (0.0, 0.5, 0.99):
        assert zero.step(time, np.full(3, 1e-5))
    assert not zero.drift.any()
    zero.step(1.0, np.full(3, 1e-5))
    assert (zero.drift > 0).all()


def test_the_zero_follows_at_its_time_constant():
    zero = banded(start=2e-3, hold=0.0, time_constant=4.0)
    zero.step(0.0, np.full(3, 2e-3))
    zero.step(2.0, np.full(3, 2.01e-3))
    assert zero.drift == pytest.approx(np.full(3, 1e-5 * (1 - np.exp(-0.5))))
    assert zero.offset == pytest.approx(2e-3 + zero.drift)


@pytest.mark.parametrize("start", [0.0, 1e-3, -1e-3])
def test_the_bound_is_on_the_drift_wherever_the_zero_starts(start):
    zero = banded(start=start, hold=0.0, time_constant=1e-3, drift_bound=50e-6)
    believed = []
    for k, moved in enumerate((0.0, 25e-6, 49.9e-6, 50.1e-6, 25e-6)):
        assert zero.step(float(k), np.array([start, start - moved, start]))
        believed.append(zero.believed)
    assert believed == [True, True, True, False, True]


def test_the_band_widens_at_its_rate_up_to_its_limit_and_narrows_with_the_zero():
    tracking = {"hold": 0.0, "time_constant": 10.0, "widening_rate": 1e-6, "widening_limit": 5e-6}
    for busy, wide in ((0.0, 0.0), (2.0, 2e-6), (5.0, 5e-6), (100.0, 5e-6)):
        for inside in (True, False):
            zero = banded(**tracking)
            zero.step(0.0, np.full(3, 1e-3))
            zero.step(busy, np.full(3, 1e-3))
            edge = 40e-6 + wide + (-1e-9 if inside else 1e-9)
            assert zero.step(busy, np.array([0.0, edge, 0.0])) is inside
    zero = banded(**tracking)
    for time, field in ((0.0, 1e-3), (100.0, 1e-3), (100.0, 0.0), (110.0, 0.0)):
        zero.step(time, np.full(3, field))
    narrowed = 40e-6 + 5e-6 / np.e
    assert zero.step(110.0, np.full(3, narrowed - 1e-9))
    assert not zero.step(110.0, np.full(3, narrowed + 1e-9))


def test_a_zero_without_an_idle_test_stays():
    zero = Zero(ZeroTracking(hold=0.0), None, np.zeros(3))
    assert not any(zero.step(float(k), np.full(3, 1e-6)) for k in range(9))
    assert not zero.drift.any()


@pytest.mark.parametrize(
    ("name", "least"),
    [("hold", 0.0), ("widening_rate", 0.0), ("widening_limit", 0.0),
     ("time_constant", None), ("drift_bound", None)],
)  # fmt: skip
def test_wrong_tracking_is_refused(name, least):
    if least is not None:
        assert getattr(ZeroTracking(**{name: least}), name) == least
    for value in (-1.0, np.nan, *([0.0] if least is None else [])):
        with pytest.raises(ArgumentError, match=f"{name} must be"):
            ZeroTracking(**{name: value})


def test_wrong_idle_tests_are_refused():
    for field in (0.0, -1e-6, np.nan):
        with pytest.raises(ArgumentError, match="idle_field must be positive"):
            IdleBand(field)
    for chance in (0.0, 1.0, -0.1, np.nan):
        with pytest.raises(ArgumentError, match=r"false_alarms must lie in \(0, 1\); got"):
            IdleNoise(NOISE, (0, 1), chance)


@pytest.mark.recordings
def test_idle_moments_of_a_real_recording_are_found_among_presses(recordings):
    (run,) = (one for one in read_eflesh(recordings) if one.set == "spatial_resolution")
    rest = run.field - run.field_rezeroed
    zero = Zero(ZeroTracking(hold=0.0, time_constant=30.0), IdleBand(), rest[0])
    idle = [
        (zero.step(float(t) - 2.0, a), zero.step(float(t), b))
        for t, a, b in zip(run.time, rest, run.field, strict=True)
    ]
    at_rest, pressed = np.sum(idle, axis=0)
    assert at_rest > 0.99 * len(rest)
    assert pressed == 0
    assert zero.believed


@pytest.mark.parametrize(("field", "idle"), [(130e-6, True), (145e-6, True), (155e-6, False)])
def test_the_earths_field_turned_over_is_idle(field, idle):
    # 25 to 65 uT, which turning over changes by twice as much.
    band = IdleBand(10e-6, uniform=True)
    for axis in range(3):
        change = np.zeros((3, 3))
        change[:, axis] = field, field + 9e-6, field - 9e-6
        assert band(change, 0.0) is idle
        assert band(-change, 0.0) is idle
        assert not IdleBand(10e-6)(change, 0.0)
        change[1, axis] += 3e-6  # past the band of what is not alike
        assert not band(change, 0.0)
        assert band(change, 5e-6) is idle


def test_a_field_that_changes_alike_is_followed_soon_and_drift_slowly():
    for change, seconds in ((7.9e-6, 10.0), (8.1e-6, 0.05)):
        zero = Zero(ZeroTracking(hold=0.0), IdleBand(uniform=True), np.zeros((3, 3)), uniform=True)
        zero.step(0.0, np.zeros((3, 3)))
        zero.step(0.02, np.tile([0.0, change, 0.0], (3, 1)))
        followed = -change * np.expm1(-0.02 / seconds)
        np.testing.assert_allclose(zero.offset[:, 1], followed, rtol=0.01)


def test_after_a_day_without_readings_the_zero_does_not_leap():
    for gap, share in ((0.9e5, 1.0), (1.1e5, 0.0)):
        zero = banded(hold=0.0)
        zero.step(0.0, np.zeros(3))
        zero.step(gap, np.full(3, 20e-6))
        np.testing.assert_allclose(zero.offset, share * 20e-6, atol=1e-12)
