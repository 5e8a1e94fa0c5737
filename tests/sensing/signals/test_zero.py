"""The zero: what is idle, how it is followed, and how far."""

import numpy as np
import pytest
from scipy.stats import chi2

from smoskin.errors import ArgumentError
from smoskin.sensing.signals.idle import IdleBand, IdleNoise
from smoskin.sensing.signals.signals import signal_noise
from smoskin.sensing.signals.turning import EARTH, turning, uniform_covariance
from smoskin.sensing.signals.zero import Zero, ZeroTracking
from studies.recordings.eflesh import read_eflesh

NOISE = np.diag([1.0, 4.0, 9.0, 1.0, 1.0, 2.0]) * 1e-12
NOISE[0, 1] = NOISE[1, 0] = 1e-12
FAINT = 1e-12 * np.eye(3)
SURE = np.zeros((3, 3))


def banded(start=0.0, **tracking) -> Zero:
    """A zero of three axes in the usual band, of a sensor whose noise is a microtesla."""
    return Zero(ZeroTracking(**tracking), IdleBand(), np.full(3, start), FAINT)


def noisy(**options) -> Zero:
    """A zero that follows what noise explains."""
    tracking = ZeroTracking(hold=0.0, time_constant=2.0, widening_rate=0.0)
    return Zero(tracking, IdleNoise(NOISE, 1e-6), np.zeros(6), NOISE, **options)


def turned(planar) -> Zero:
    """A zero of all chips of a design, which may turn."""
    noise = signal_noise(planar)
    tracking = ZeroTracking(hold=0.0, time_constant=2.0, widening_rate=0.0)
    return Zero(tracking, IdleNoise(noise, 1e-6), np.zeros(9), noise, turning=turning(planar))


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


def test_the_band_ends_at_its_field_on_every_axis():
    for axis in range(3):
        for sign in (-1, 1):
            change = np.zeros(3)
            change[axis] = sign * 39.9e-6
            assert IdleBand()(change, SURE) < 1
            change[axis] = sign * 40.1e-6
            assert IdleBand()(change, SURE) > 1
            assert IdleBand()(change, 0.2e-6**2 * np.eye(3)) < 1


def test_a_band_leaves_out_what_the_zeros_own_error_explains():
    alike, band = uniform_covariance(np.tile(np.eye(3), (3, 1, 1)), 100e-6), IdleBand(10e-6)
    change = np.tile([100e-6, 0.0, -80e-6], 3)
    change[4] = 9e-6
    assert band(change, np.zeros((9, 9))) == pytest.approx(10.0)
    assert 0.5 < band(change, alike) < 1  # a field of 170 uT alike at all is 10 uT wide
    change[4] = 25e-6
    assert band(change, alike) > 1


@pytest.mark.parametrize("rate", [1e-6, 0.05, 0.9])
def test_noise_is_idle_at_the_stated_rate(rate):
    idle, limit = IdleNoise(NOISE, rate), chi2.isf(rate, 6)
    unsure = 4e-12 * np.eye(6) + uniform_covariance(np.tile(np.eye(3), (2, 1, 1)), 3e-6)
    for more in (np.zeros((6, 6)), unsure):
        factor, rng = np.linalg.cholesky(NOISE + more), np.random.default_rng(0)
        for _ in range(20):
            way = rng.normal(size=6)
            change = factor @ way * np.sqrt(limit) / np.linalg.norm(way)
            assert idle(change, more) == pytest.approx(1.0)


def test_hold_ends_when_it_says():
    zero = banded(hold=1.0)
    for time in (0.0, 0.5, 0.99):
        assert zero.step(time, np.full(3, 1e-5))
    assert not zero.drift.any()
    zero.step(1.0, np.full(3, 1e-5))
    assert (zero.drift > 0).all()


def test_it_is_the_kalman_filter_of_a_zero_and_its_speed(planar):
    """Against the filter of both in one state, which forgets what it knew by e^(dt / 2 s)."""
    rng, zero = np.random.default_rng(0), turned(planar)
    noise = signal_noise(planar)
    state, covariance = np.zeros(18), np.kron(np.eye(2), noise / 20)
    sees, time, factor = np.eye(9, 18), 0.0, np.linalg.cholesky(noise)
    for k in range(60):
        step = 0.0 if k == 0 else rng.uniform(0.01, 0.2)
        time += step
        kept = np.exp(-step / 3.0)
        moves = np.kron([[1.0, 3.0 * (1 - kept)], [0.0, kept]], np.eye(9))
        state, covariance = moves @ state, moves @ covariance @ moves.T
        read = 0.5e-6 * time * np.arange(9) / 9 + factor @ rng.normal(size=9)
        assert zero.step(time, read)
        covariance = covariance * np.exp(step / 2.0)
        gain = covariance @ sees.T @ np.linalg.inv(sees @ covariance @ sees.T + noise)
        state = state + gain @ (read - state[:9])
        covariance = covariance - gain @ sees @ covariance
        np.testing.assert_allclose(zero.offset, state[:9], rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(zero.covariance, covariance[:9, :9], rtol=1e-6, atol=1e-17)


def test_the_zero_of_a_board_that_cannot_turn_forgets_by_its_time_constant():
    """In time its gain is 1 - e^(-dt / T), whatever the noise."""
    for scale in (1.0, 100.0):
        tracking = ZeroTracking(hold=0.0, time_constant=2.0)
        zero = Zero(tracking, IdleBand(), np.zeros(6), scale * NOISE)
        for k in range(200):
            zero.step(0.1 * k, np.zeros(6))
        zero.step(20.0, np.full(6, 10e-6))
        np.testing.assert_allclose(zero.drift, 10e-6 * (1 - np.exp(-0.05)), rtol=1e-5)


def test_a_zero_goes_on_under_a_touch_as_it_went(planar):
    zero, speed, touch = turned(planar), np.tile([20e-6, -10e-6, 15e-6], 3), np.zeros(9)
    touch[5] = touch[8] = 1e-3
    for k in range(50):
        assert zero.step(0.1 * k, 0.1 * k * speed)
    for k in range(50, 53):
        assert not zero.step(0.1 * k, 4.9 * speed + touch)
    # With a time constant of 3 s a speed is lost, once the acceleration that kept it has gone.
    np.testing.assert_allclose(zero.offset, 5.2 * speed, rtol=0.02)
    for k in range(53, 600):
        zero.step(0.1 * k, 4.9 * speed + touch)
    farther = zero.offset / speed - 4.9
    assert (farther > 3.0).all()
    assert (farther < 6.0).all()
    there = zero.offset
    zero.step(120.0, 4.9 * speed + touch)
    np.testing.assert_allclose(zero.offset, there, rtol=1e-4)


def test_the_zero_is_less_sure_at_its_rate_up_to_its_limit_and_sure_once_it_is_seen():
    tracking = {"hold": 0.0, "time_constant": 10.0, "widening_rate": 1e-6, "widening_limit": 5e-6}
    for busy, wide in ((0.0, 0.0), (2.0, 2e-6), (5.0, 5e-6), (100.0, 5e-6)):
        zero = banded(**tracking)
        zero.step(0.0, np.full(3, 1e-3))
        zero.step(busy, np.full(3, 1e-3))
        was = FAINT[0, 0] / 20
        np.testing.assert_allclose(zero.covariance, (was + wide**2) * np.eye(3), rtol=1e-9)
    zero.step(100.1, np.full(3, 44e-6))
    assert zero.covariance[0, 0] < FAINT[0, 0]
    np.testing.assert_allclose(zero.drift, 44e-6, rtol=0.05)


def test_what_a_touch_left_is_idle_and_at_once_the_zero():
    left = np.diag([900.0, 900, 900, 0, 0, 0]) * 1e-12
    touch, stays = np.full(6, 1e-3), np.array([60e-6, -50e-6, 40e-6, 0, 0, 0])
    for known, idle in ((None, False), (left, True)):
        zero = noisy(left=known)
        assert zero.step(0.0, np.zeros(6))
        assert not zero.step(0.1, touch)
        assert zero.step(0.2, stays) is idle
    np.testing.assert_allclose(zero.drift, stays, rtol=0.02, atol=1e-6)
    assert zero.covariance.diagonal().max() < 10e-12
    # Nothing is left where nothing touched.
    assert not zero.step(0.3, np.zeros(6))


@pytest.mark.parametrize("field", [60e-6, -130e-6])
def test_a_field_that_changes_alike_at_all_chips_is_idle_and_at_once_the_zero(planar, field):
    alike = np.tile([0.0, field, 0.0], 3)
    zero = turned(planar)
    assert zero.step(0.0, np.zeros(9))
    assert zero.step(0.01, alike)
    np.testing.assert_allclose(zero.drift, alike, atol=5e-6)
    zero = turned(planar)
    assert zero.step(0.0, np.zeros(9))
    assert not zero.step(0.01, 2 * alike * ([0] * 6 + [0, 1, 0]))


@pytest.mark.parametrize("rate", [10.0, 100.0])
def test_a_board_that_turns_is_followed(planar, rate):
    """Along the pattern of its weight, 14 degrees a second at most, as a slow arm turns."""
    weight = turning(planar).whole - turning(planar).field
    pattern = weight[0] / np.sqrt(weight[0, 0])
    zero, rng = turned(planar), np.random.default_rng(1)
    noise = np.linalg.cholesky(zero._noise)
    for k in range(int(20 * rate)):
        time = k / rate
        angle = np.pi / 4 * (1 - np.cos(2 * np.pi * max(time - 2.0, 0.0) / 20))
        read = pattern * np.sin(angle) + noise @ rng.normal(size=9)
        assert zero.step(time, read)
        if k == 12 * rate:
            np.testing.assert_allclose(zero.drift, pattern, atol=30e-6)
        if k > 3 * rate:
            off = zero.drift - pattern * np.sin(angle)
            assert off @ np.linalg.solve(zero.covariance + 25e-12 * np.eye(9), off) < 45
    assert zero.believed


def test_a_still_board_is_as_sure_as_noise_allows(planar):
    """No turn is looked for: the readings of its last two seconds tell its zero."""
    zero, rng = turned(planar), np.random.default_rng(2)
    noise = np.linalg.cholesky(zero._noise)
    for k in range(300):
        assert zero.step(0.1 * k, noise @ rng.normal(size=9))
    for k in range(300, 310):
        assert not zero.step(0.1 * k, np.full(9, 1e-3) * (-1.0) ** np.arange(9))
    assert (zero.covariance.diagonal() < 2 * zero._noise.diagonal()).all()


def test_a_board_that_was_still_for_an_hour_is_followed_as_it_turns(planar):
    zero, rng = turned(planar), np.random.default_rng(4)
    noise = np.linalg.cholesky(signal_noise(planar))
    for k in range(3600):
        assert zero.step(float(k), noise @ rng.normal(size=9))
    for k in range(300):
        alike = np.tile([3e-7 * k, -2e-7 * k, 0.0], 3)
        assert zero.step(3600 + 0.01 * k, alike + noise @ rng.normal(size=9))
    np.testing.assert_allclose(zero.drift, alike, atol=6e-6)


def test_what_a_turn_changes_is_the_earths_field_and_the_weights(planar):
    field, whole = turning(planar)
    alike = uniform_covariance(np.tile(np.eye(3), (3, 1, 1)), EARTH)
    np.testing.assert_array_equal(field, alike)
    weight = np.sqrt(np.diag(whole - field)).reshape(3, 3)
    # The board slides by 1.27 mm under its chip, where the field changes by 7.2 T/m.
    np.testing.assert_allclose(weight[0, :2], 1.27e-3 * 7.2, rtol=0.05)
    # The sheet sways by 0.28 mm and sinks by 0.04 mm over chips where it changes by 7.4 and 14 T/m.
    np.testing.assert_allclose(weight[1:, :2], 0.282e-3 * 7.4, rtol=0.05)
    np.testing.assert_allclose(weight[1:, 2], 0.040e-3 * 14, rtol=0.3)
    some = turning(planar, (2, 1))
    rows = [6, 7, 8, 3, 4, 5]
    np.testing.assert_allclose(some.whole, whole[np.ix_(rows, rows)], rtol=1e-12)


@pytest.mark.parametrize("start", [0.0, 1e-3, -1e-3])
def test_the_bound_is_on_the_drift_wherever_the_zero_starts(start):
    zero = banded(start=start, hold=0.0, time_constant=1e-3, drift_bound=50e-6)
    believed = []
    for k, moved in enumerate((0.0, 25e-6, 49.9e-6, 50.1e-6, 25e-6)):
        assert zero.step(float(k), np.array([start, start - moved, start]))
        believed.append(zero.believed)
    assert believed == [True, True, True, False, True]


def test_a_zero_without_an_idle_test_stays():
    zero = Zero(ZeroTracking(hold=0.0), None, np.zeros(3), FAINT)
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
    for field in (0.0, -1e-6, 1.1, np.inf, np.nan):
        with pytest.raises(ArgumentError, match="idle_field must be positive and at most 1 T"):
            IdleBand(field)
    for chance in (0.0, 1.0, -0.1, np.nan):
        with pytest.raises(ArgumentError, match=r"false_alarms must lie in \(0, 1\); got"):
            IdleNoise(NOISE, chance)


@pytest.mark.recordings
def test_idle_moments_of_a_real_recording_are_found_among_presses(recordings):
    (run,) = (course for course in read_eflesh(recordings) if course.set == "spatial_resolution")
    rest = run.field - run.field_rezeroed
    tracking = ZeroTracking(hold=0.0, time_constant=30.0, widening_rate=2e-6)
    noise = 40e-6**2 * np.eye(rest[0].size)
    zero = Zero(tracking, IdleBand(), rest[0].ravel(), noise)
    idle = [
        (zero.step(float(t) - 2.0, a.ravel()), zero.step(float(t), b.ravel()))
        for t, a, b in zip(run.time, rest, run.field, strict=True)
    ]
    at_rest, pressed = np.sum(idle, axis=0)
    assert at_rest > 0.99 * len(rest)
    assert pressed == 0
    assert zero.believed


def test_after_a_day_without_readings_the_zero_does_not_leap():
    for gap, share in ((0.9e5, 1.0), (1.1e5, 0.0)):
        zero = banded(hold=0.0)
        zero.step(0.0, np.zeros(3))
        zero.step(gap, np.full(3, 20e-6))
        np.testing.assert_allclose(zero.offset, share * 20e-6, atol=1e-6)


@pytest.mark.parametrize(("touched", "unnoticed"), [(0.02, 0.02), (0.3, 0.3), (3.0, 1.0)])
def test_a_turn_under_a_touch_began_after_the_last_idle_reading(planar, touched, unnoticed):
    """Accelerations of 0.08 rad/s^2 since then, for a second at most: half of their square."""
    zero = turned(planar)
    assert zero.step(1.0, np.zeros(9))
    assert not zero.step(1.0 + touched, np.full(9, 1e-3) * (-1.0) ** np.arange(9))
    begun, whole = zero.turned, turning(planar).whole
    angle = np.sqrt(begun[0, 0] / whole[0, 0])
    np.testing.assert_allclose(begun, angle**2 * whole, rtol=1e-6, atol=1e-18)
    assert angle == pytest.approx(0.08 * unnoticed**2 / 2, rel=0.2)


def on_an_arm(planar, arm=True) -> Zero:
    """A zero of all chips of a design on an arm, which may turn and whose motors are heard."""
    noise = signal_noise(planar)
    tracking = ZeroTracking(hold=0.0, time_constant=2.0, widening_rate=0.0, arm=arm)
    return Zero(tracking, IdleNoise(noise, 1e-6), np.zeros(9), noise, turning=turning(planar))


def loud(planar, louder, count, seed=0) -> np.ndarray:
    """Readings (count, 9) with the chips' noise and another of this covariance."""
    covariance = signal_noise(planar) + louder
    return np.random.default_rng(seed).multivariate_normal(np.zeros(9), covariance, count)


def test_noise_louder_than_the_chips_is_learned_on_an_arm(planar):
    """A motor's field in two patterns over the chips: found as it is, nothing else besides."""
    patterns = 3e-6 * np.random.default_rng(5).normal(size=(9, 2))
    louder, time = patterns @ patterns.T, 0.1 * np.arange(600)
    still = on_an_arm(planar, arm=False)
    followed(still, time, loud(planar, louder, 600))
    learned, stated = [], []
    for seed in range(3):
        zero = on_an_arm(planar)
        assert followed(zero, time, loud(planar, louder, 600, seed))[100:].all()
        learned.append(zero._louder)
        stated.append(zero.covariance)
    size = np.linalg.norm(louder)
    assert np.linalg.norm(np.mean(learned, axis=0) - louder) < 0.35 * size
    assert (np.linalg.eigvalsh(np.mean(stated, axis=0) - np.mean(learned, axis=0)) > 0).all()
    assert not still._louder.any()


def test_a_quiet_arm_is_not_heard(planar):
    """Where the chips alone make noise, what is learned besides stays a third of it."""
    zero = on_an_arm(planar)
    assert followed(zero, 0.1 * np.arange(600), loud(planar, 0.0, 600)).all()
    noise = signal_noise(planar)
    assert np.trace(np.linalg.solve(noise, zero._louder)) < 9 / 3


def test_a_loud_arm_is_no_turn(planar):
    """Noise of twice the chips' seems a turn now and then, until it was heard."""
    read, time = loud(planar, 1.2 * signal_noise(planar), 600), 0.1 * np.arange(600)
    seen = []
    for zero in (on_an_arm(planar), on_an_arm(planar)):
        turns = 0
        if seen:
            zero._listen = lambda change, course: None
        for t, row in zip(time, read, strict=True):
            zero.step(float(t), row)
            turns += t > 10.0 and zero._turn_seen == t
        seen.append(turns)
    assert seen[0] < 0.3 * seen[1]


@pytest.mark.parametrize("weighs", [True, False])
def test_readings_beyond_all_turns_are_no_turn_by_any_of_them(planar, monkeypatch, weighs):
    """What is not looked at any more would have changed nothing."""
    rng = np.random.default_rng(8)
    time = np.cumsum(rng.uniform(0.005, 0.2, 400))
    read = loud(planar, 0.0, 400)
    pattern = turning(planar).field if not weighs else turning(planar).whole
    read += np.sin(0.5 * time)[:, None] * pattern[0] / np.sqrt(pattern[0, 0])
    for begin in range(40, 400, 40):
        read[begin : begin + 10] += 10 ** rng.uniform(-6, -3) * rng.normal(size=9)
    ways = []
    for beyond in (10.0, np.inf):
        monkeypatch.setattr("smoskin.sensing.signals.zero._BEYOND", beyond)
        zero = on_an_arm(planar)
        ways.append((followed(zero, time, read), zero.offset, zero.covariance))
    for cut, full in zip(*ways, strict=True):
        np.testing.assert_array_equal(cut, full)
    assert 0 < ways[0][0].sum() < 400
