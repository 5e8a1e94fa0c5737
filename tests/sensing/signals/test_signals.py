"""Signals of readings: offset, drift, temperature, creep and chip faults."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.nonlinearity import Bend, field_curvature
from smoskin.magnetics.temperature import temperature_factor
from smoskin.mechanics.viscoelasticity import ELASTIC, Memory, Prony
from smoskin.records import ChipFlag, Contact, Motion, Reading, Status
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.signals.idle import IdleBand, IdleNoise
from smoskin.sensing.signals.loops import Loops
from smoskin.sensing.signals.signals import Signals, signal_noise
from smoskin.sensing.signals.thermometer import Thermometer
from smoskin.sensing.signals.zero import ZeroTracking
from smoskin.twin.manufacture import draw
from smoskin.twin.readout import Readout
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import plain

TOUCH = [Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))]


@pytest.fixture
def twin(planar):
    return ReducedTwin(planar, seed=None)


def banded(design, **tracking: float) -> Signals:
    return Signals(design, tracking=ZeroTracking(**tracking), idle=IdleBand())


def changed(reading: Reading, **changes: object) -> Reading:
    values = {name: getattr(reading, name) for name in ("time", "field", "temperature", "flags")}
    return Reading(**(values | changes))


def test_an_untouched_ideal_skin_reads_nothing(planar, twin):
    sample = banded(planar).step(twin.read())
    assert sample.status is Status.NO_CONTACT
    np.testing.assert_allclose(sample.values, 0.0, atol=0.1e-6)


@pytest.mark.parametrize("temperature", [0.0, 25.0, 60.0])
def test_temperature_is_taken_out(planar, twin, temperature):
    held = twin.motion(TOUCH)  # the same motion: warm rubber would move less
    warm = banded(planar).step(twin.sense(held, temperature=temperature)).values
    reference = banded(planar).step(twin.sense(held)).values
    np.testing.assert_allclose(warm, reference, atol=1e-9)


def test_an_offset_is_zeroed(planar, twin):
    earth = np.array([30e-6, -40e-6, 55e-6])
    seen = banded(planar)
    idle = [changed(twin.read(time=0.01 * k), field=twin.read().field + earth) for k in range(10)]
    seen.zero(idle)
    touched = changed(twin.read(TOUCH, time=1.0), field=twin.read(TOUCH).field + earth)
    clean = banded(planar).step(twin.read(TOUCH, time=1.0)).values
    np.testing.assert_allclose(seen.step(touched).values, clean, atol=0.1e-6)


def test_the_zero_follows_slow_drift_while_idle(planar, twin):
    seen = banded(planar, hold=1.0, time_constant=2.0)
    rest = twin.read()
    for k in range(6000):  # 1 uT a second for a minute, 60 uT in all: over the idle band
        drifted = changed(rest, time=0.01 * k, field=rest.field + 1e-8 * k)
        assert seen.step(drifted).status is Status.NO_CONTACT
    assert np.abs(seen.drift).max() == pytest.approx(58e-6, abs=1e-6)  # lags by the time constant


def test_a_press_does_not_move_the_zero(planar, twin):
    seen = banded(planar, hold=0.0)
    for k in range(300):
        seen.step(twin.read(TOUCH, time=0.01 * k))
    assert np.all(seen.drift == 0)


def test_past_its_bound_the_zero_is_not_believed(planar, twin):
    seen = banded(planar, hold=0.0, time_constant=0.5, drift_bound=50e-6)
    rest = twin.read()
    statuses = [
        seen.step(changed(rest, time=0.01 * k, field=rest.field + 1e-6 * k)).status
        for k in range(5000)
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
    assert banded(planar).step(changed(twin.read(), flags=flags)).status is status


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_become_a_missing_chip(planar, twin, value):
    field = twin.read().field.copy()
    field[1, 2] = value
    assert banded(planar).step(changed(twin.read(), field=field)).status is Status.CHIP_MISSING
    field[2] = -field[1]
    assert banded(planar).step(changed(twin.read(), field=field)).status is Status.CHIP_MISSING


def test_time_that_does_not_go_on_is_stale(planar, twin):
    seen = banded(planar)
    times = [0.0, 0.1, 0.05, 0.1, 0.2]
    statuses = [seen.step(twin.read(time=t)).status for t in times]
    assert [s is Status.STALE for s in statuses] == [False, False, True, True, False]


def test_a_jump_of_half_the_window_is_a_wrap_where_a_chip_can_wrap(planar, twin):
    fine = replace(
        planar, hall_setting=replace(planar.hall_setting, gain_selection=0, resolution=1)
    )
    seen = banded(fine)
    assert seen.step(twin.read()).status is Status.NO_CONTACT
    wrapped = twin.read(time=0.1).field - [0.0, 0.0, 0.17]
    assert seen.step(changed(twin.read(), time=0.1, field=wrapped)).status is Status.SATURATED


def test_a_temperature_that_is_not_reported_is_the_last_good_one(planar, twin):
    seen, reference = banded(planar), banded(planar)
    for signals in (seen, reference):
        signals.step(twin.read(TOUCH, time=0.0, temperature=45.0))
    for k in range(1, 41):
        good = twin.read(TOUCH, time=0.1 * k, temperature=45.0)
        there = reference.step(good)
        here = seen.step(changed(good, temperature=[45.0, np.nan, 45.0]))
    np.testing.assert_array_equal(here.values, there.values)
    assert here.temperature == there.temperature


def test_temperatures_inside_the_chips_range_are_believed():
    for edge in (-39.9, 124.9):
        thermometer = Thermometer(3)
        thermometer.step(np.array([edge, 20.0, 20.0]))
        assert thermometer.magnets == [edge, 20.0, 20.0]
        assert thermometer.rubber == pytest.approx((edge + 40.0) / 3)


def test_the_rubber_follows_the_mean_of_the_chips_that_report():
    thermometer = Thermometer(3)
    assert (thermometer.rubber, thermometer.magnets) == (25.0, [25.0] * 3)
    thermometer.step(np.full(3, np.nan))
    assert thermometer.rubber == 25.0
    thermometer.step(np.array([30.0, np.nan, 32.0]))
    assert thermometer.rubber == pytest.approx(31.0)
    assert thermometer.magnets == [30.0, 25.0, 32.0]
    thermometer.step(np.array([40.0, np.nan, 42.0]))
    assert thermometer.rubber == pytest.approx(31.5)
    for _ in range(300):
        thermometer.step(np.array([40.0, 41.0, 42.0]))
    assert thermometer.rubber == pytest.approx(41.0)


@pytest.mark.parametrize("seed", range(5))
def test_what_made_magnets_differ_by_weakens_as_they_warm(planar, seed):
    """Fields at rest are up to 7 mT off the design's: ten degrees take 0.35 mT of that."""
    made = ReducedTwin(planar, seed=None, deviations=draw(planar, np.random.default_rng(seed)))
    seen = banded(planar)
    seen.zero([made.read()])
    warm = seen.step(made.read(time=1.0, temperature=35.0)).values
    assert np.abs(warm).max() < 20e-6


def test_warmth_is_taken_to_lessen_the_earths_field_as_the_magnets(planar, twin):
    earth = np.array([30e-6, -40e-6, 55e-6])
    seen = banded(planar)
    held = twin.motion(TOUCH)
    rest = twin.read()
    seen.zero([changed(rest, field=rest.field + earth)])
    warm = twin.sense(held, time=1.0, temperature=65.0)
    values = seen.step(changed(warm, field=warm.field + earth)).values
    seen_by_chips = mlx90393.rotations(planar.halls) @ earth
    left = seen_by_chips * (1 / temperature_factor(65.0) - 1)
    np.testing.assert_allclose(values - banded(planar).step(warm).values, left, atol=1e-9)


def test_the_zero_may_be_taken_warm(planar, twin):
    """What is at rest at 45 degC is at rest at 25 degC."""
    seen = banded(planar)
    seen.zero([twin.read(temperature=45.0)])
    np.testing.assert_allclose(seen.step(twin.read(time=1.0)).values, 0.0, atol=0.1e-6)


@pytest.mark.parametrize("report", [-300.0, -40.1, 125.1, 300.0, 1e6, 50.1, 60.1])
def test_a_temperature_that_cannot_be_is_refused(planar, twin, report):
    """Beyond the chip's range, 15 K apart from the others, or 5 K from the reading before."""
    seen = banded(planar)
    seen.step(twin.read(TOUCH, time=0.0, temperature=45.0))
    reading = twin.read(TOUCH, time=0.01, temperature=45.0)
    refused = seen.step(changed(reading, temperature=[45.0, report, 45.0]))
    assert refused.status is Status.CHIP_MISSING
    again = twin.read(TOUCH, time=0.02, temperature=45.0)
    assert seen.step(changed(again, temperature=[45.0, 46.0, 45.0])).status is None


@pytest.mark.parametrize(("share", "status"), [(0.999, None), (1.0, Status.SATURATED)])
def test_no_chip_reads_more_than_its_range(planar, twin, share, status):
    most = float(mlx90393.full_scale(planar.hall_setting)[1])
    field = twin.read().field.copy()
    field[2, 1] = -share * most
    assert banded(planar).step(changed(twin.read(), field=field)).status is status


def test_refused_readings_have_no_signals(planar, twin):
    refused = banded(planar).step(changed(twin.read(), flags=[1, 0, 0]))
    assert np.isnan(refused.values).all()


def test_a_refused_reading_begins_idleness_anew(planar, twin):
    seen, rest = banded(planar, hold=1.0), twin.read()
    moved = rest.field + 20e-6
    for k in range(20):
        bad = {"flags": [1, 0, 0]} if k == 9 else {}
        seen.step(changed(rest, time=0.1 * k, field=moved, **bad))
    assert not seen.drift.any()
    seen.step(changed(rest, time=2.01, field=moved))
    assert (np.abs(seen.drift) > 1e-7).all()


def test_without_an_idle_test_nothing_is_idle_and_the_zero_stays(planar, twin):
    seen = Signals(planar, tracking=ZeroTracking(hold=0.0))
    for k in range(30):
        signal = seen.step(changed(twin.read(), time=0.1 * k, field=twin.read().field + 1e-6))
        assert signal.status is None
    assert not seen.drift.any()


def test_chips_are_turned_and_scaled_as_calibrated(planar, twin):
    from scipy.spatial.transform import Rotation

    turn = 0.05 * np.arange(9.0).reshape(3, 3) - 0.2
    calibration = replace(
        Calibration.nominal(planar),
        chip_rotation=tuple(map(tuple, turn.tolist())),
        field_factor=(0.9, 1.0, 1.1),
        field_offset=((2e-4, 2e-4, 2e-4),) * 3,
    )
    plain, seen = banded(planar), Signals(planar, correction=calibration.field_correction)
    boards = mlx90393.rotations(planar.halls)
    matrices = Rotation.from_rotvec(turn).as_matrix()
    reading = twin.read(TOUCH)
    skin = np.einsum("sij,sj->si", boards, reading.field)
    # What a chip would read whose mounting and magnet the calibration undoes.
    made = np.einsum("sji,sj->si", matrices, (skin - 2e-4) / np.array([[0.9], [1.0], [1.1]]))
    spoilt = changed(reading, field=np.einsum("sji,sj->si", boards, made))
    np.testing.assert_allclose(seen.step(spoilt).values, plain.step(reading).values, atol=1e-10)


def test_creeping_touches_read_as_settled(planar):
    """Motions creep; the fields that they make are freed of it, though not linear in them."""
    skin = plain(planar)
    prony = Prony(moduli=[0.1], times=[1.0])
    exact, readout = ReducedTwin(skin, seed=None), Readout(skin)
    pressed, rest = exact.motion(TOUCH), exact.motion([])
    magnets, board = Memory(prony, rest.magnets), Memory(prony, rest.board)
    creeping, taken = Signals(skin, creep=prony), Signals(skin, creep=ELASTIC)
    for signals in (creeping, taken):
        signals.zero([exact.read(time=-1.0)])
    for k in range(1, 30):
        held = pressed if k > 5 else rest
        moved = Motion(
            magnets=magnets.step(0.02, held.magnets),
            board=board.step(0.02, held.board),
        )
        reading = readout.read(moved, None, time=0.02 * k)
        last = [signals.step(reading).values for signals in (creeping, taken)]
    settled = taken.step(exact.read(TOUCH, time=1.0)).values
    undone, left = (np.abs(values - settled).max() for values in last)
    assert left > 0.01 * np.abs(settled).max()
    assert undone < 0.03 * left


@pytest.mark.parametrize("begin", ["zero", "reset"])
def test_from_its_zero_on_the_skin_has_rested(planar, twin, begin):
    prony = Prony(moduli=[0.2], times=[1.0])
    used, fresh = Signals(planar, creep=prony), Signals(planar, creep=prony)
    for k in range(9):
        used.step(twin.read(TOUCH, time=0.1 * k))
    used.zero([twin.read()]) if begin == "zero" else used.reset()
    fresh.zero([twin.read()]) if begin == "zero" else fresh.reset()
    for time in (2.0, 2.1):
        sample, expected = (signals.step(twin.read(TOUCH, time=time)) for signals in (used, fresh))
        np.testing.assert_allclose(sample.values, expected.values, atol=1e-12)


@pytest.mark.slow
def test_the_stated_noise_is_that_of_readings(planar):
    """Covariance of each chip's signals, whose temperatures round like everybody's."""
    twin, seen = ReducedTwin(planar, seed=4), Signals(planar)
    warmth = np.random.default_rng(0).uniform(24.0, 26.0, 3000)
    rest = [twin.read(time=0.01 * k, temperature=float(t)) for k, t in enumerate(warmth)]
    values = np.array([seen.step(reading).values for reading in rest])
    known = signal_noise(planar)
    for s in range(3):
        part = slice(3 * s, 3 * s + 3)
        white = np.linalg.inv(np.linalg.cholesky(known[part, part]))
        whitened = white @ np.cov(values[:, s].T) @ white.T
        np.testing.assert_allclose(whitened, np.eye(3), atol=0.12)
        other = known[part].copy()
        other[:, part] = 0.0
        assert not other.any()


def test_noise_of_some_chips_is_that_part_of_all(planar):
    whole = signal_noise(planar)
    rows = [6, 7, 8, 0, 1, 2]
    np.testing.assert_array_equal(signal_noise(planar, (2, 0)), whole[np.ix_(rows, rows)])


def test_wrong_use_is_named(planar, twin):
    seen = banded(planar)
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


@pytest.mark.parametrize("count", [2, 40])
def test_readings_at_rest_are_refused_once_in_1e9_of_chips_thrice_as_loud(planar, count):
    signals = banded(planar)
    rng = np.random.default_rng(0)
    moves = rng.normal(size=(count, 3, 3))
    moves -= moves.mean(axis=0)
    flat, freedom = moves.reshape(count, 9), 9 * (count - 1)
    size = np.einsum("bi,ij,bj->", flat, np.linalg.inv(signal_noise(planar)), flat)
    moves *= 3 * np.sqrt(chi2.isf(1e-9, freedom) / size)
    signals._check_rest(0.999 * moves)
    with pytest.raises(ArgumentError, match="let go first; got readings that move by"):
        signals._check_rest(1.001 * moves)


def test_hysteresis_is_undone_and_a_zero_taken_of_what_it_left(planar, twin):
    """A swing makes the past known; from then on loops do not show, whatever zero is taken."""
    loops = Loops(weights=[0.2], plays=[0.1], reach=np.full(6, 1e-3))
    own = Signals(planar, idle=IdleBand(4e-6), chips=(1, 2), loops=loops)
    bend, play, rest = Bend(field_curvature(planar)), np.zeros(()), twin.read().field
    to_chips = np.swapaxes(mlx90393.rotations(planar.halls), 1, 2)

    def read(time, x):
        nonlocal play
        play = np.clip(play, x - 1e-4, x + 1e-4)
        signals = np.zeros((3, 3))
        signals[1:] = 0.8 * x + 0.2 * play
        raised = to_chips @ bend.bent(signals)[:, :, None]
        return Reading(time=time, field=rest + raised[:, :, 0])

    def elastic(time, x):
        return bend.straightened(own.step(read(time, x)).values)[1:]

    for time, x in enumerate((-1e-3, 1e-3, -1e-3)):
        elastic(float(time), x)
    np.testing.assert_allclose(elastic(3.0, 5e-4), 5e-4, atol=2e-7)
    # At rest again, to which 20 uT are left: that is the zero from here on.
    assert own.step(read(4.0, 0.0)).status is Status.NO_CONTACT
    own.zero([read(5.0, 0.0)], force=True)
    assert own.step(read(6.0, 0.0)).status is Status.NO_CONTACT
    np.testing.assert_allclose(elastic(7.0, -5e-4), -5e-4, atol=2e-6)
    own.unzero()
    np.testing.assert_allclose(elastic(8.0, 5e-4), 5e-4, atol=2e-7)


def test_an_unknown_past_explains_a_rest_until_the_zero_is_taken_of_it(planar, twin):
    """What a first touch leaves, from wherever the plays began, is idle from its first reading."""
    loops = Loops(weights=[0.1, 0.1], plays=[0.02, 0.1], reach=np.full(6, 2e-3))
    noise = signal_noise(planar, (1, 2))
    tracking = ZeroTracking(hold=0.2, time_constant=2.0)
    rest, bend = twin.read().field, Bend(field_curvature(planar))
    to_chips, rng = np.swapaxes(mlx90393.rotations(planar.halls), 1, 2), np.random.default_rng(0)
    widths = loops.plays[:, None] * loops.reach
    for _ in range(10):
        own = Signals(
            planar, tracking=tracking, idle=IdleNoise(noise, 1e-6), chips=(1, 2), loops=loops
        )
        plays, seen = widths * rng.uniform(-1, 1, widths.shape), []
        first = 0.1 * plays.sum(axis=0)
        for k in range(60):
            x = 1e-3 * np.array([1, -1, 2, 0.5, -1, 1]) * (20 <= k < 30)
            plays = np.clip(plays, x - widths, x + widths)
            signals = np.zeros((3, 3))
            signals[1:] = (0.8 * x + 0.1 * plays.sum(axis=0) - first).reshape(2, 3)
            raised = to_chips @ bend.bent(signals)[:, :, None]
            field = rest + raised[:, :, 0] + 1e-7 * rng.normal(size=(3, 3))
            seen.append(own.step(Reading(time=0.05 * k, field=field)).status)
        assert set(seen[20:30]) == {None}
        assert set(seen[:20] + seen[30:]) == {Status.NO_CONTACT}
