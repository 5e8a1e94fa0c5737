"""The MLX90393 as an instrument: ranges, words, wrap, noise, times and axes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.design.skin import HallSetting, HallSite
from smoskin.errors import ArgumentError
from smoskin.magnetics.mlx90393 import (
    HallNoise,
    burst_period,
    conversion_time,
    degrees,
    full_scale,
    measure,
    noise,
    rotation,
    sensitivity,
    settles,
    temperature_counts,
    tesla,
    wraps,
)
from smoskin.records import ChipFlag


def setting(gain: int = 7, resolution: int = 0, oversampling: int = 0, digital_filter: int = 0):
    return HallSetting(
        gain_selection=gain,
        resolution=resolution,
        oversampling=oversampling,
        digital_filter=digital_filter,
    )


settings = st.builds(
    setting, st.integers(0, 7), st.integers(0, 3), st.integers(0, 3), st.integers(0, 7)
)


@pytest.mark.parametrize(
    ("gain", "lateral", "axial"),
    [
        (0, 0.751, 1.210),
        (1, 0.601, 0.968),
        (2, 0.451, 0.726),
        (3, 0.376, 0.605),
        (4, 0.300, 0.484),
        (5, 0.250, 0.403),
        (6, 0.200, 0.323),
        (7, 0.150, 0.242),
    ],
)
def test_sensitivity_is_the_data_sheets(gain: int, lateral: float, axial: float) -> None:
    for resolution in range(4):
        step = sensitivity(setting(gain, resolution)) * 1e6 / 2**resolution
        assert_allclose(step, [lateral, lateral, axial], rtol=3e-3)


def test_ranges() -> None:
    assert_allclose(full_scale(setting(resolution=0)) * 1e3, [4.92, 4.92, 7.93], atol=0.01)
    assert_allclose(full_scale(setting(resolution=1)) * 1e3, [9.83, 9.83, 15.86], atol=0.01)
    assert_allclose(full_scale(setting(resolution=2)) * 1e3, [13.2, 13.2, 21.3], atol=0.05)
    assert_allclose(full_scale(setting(resolution=3)) * 1e3, [13.2, 13.2, 21.3], atol=0.05)
    # The data sheet's largest field: 106 mT in z at the lowest gain.
    assert_allclose(full_scale(setting(0, 3))[2], 106.5e-3, atol=0.1e-3)
    assert [wraps(setting(resolution=r)) for r in range(4)] == [True, True, False, False]


@given(
    chosen=settings,
    counts=st.lists(st.integers(-10809, 10808), min_size=3, max_size=3),
)
def test_counts_survive_the_way_to_tesla_and_back(chosen: HallSetting, counts: list[int]) -> None:
    assert_array_equal(measure(tesla(counts, chosen), chosen).counts, counts)


@given(chosen=settings, part=st.lists(st.floats(-0.99, 0.99), min_size=3, max_size=3))
def test_a_field_in_range_reads_to_within_a_count(chosen: HallSetting, part: list[float]) -> None:
    field = np.array(part) * full_scale(chosen)
    sample = measure(field, chosen)
    assert np.abs((tesla(sample.counts, chosen) - field) / sensitivity(chosen)).max() <= 1.0
    assert sample.flags == ChipFlag.GOOD


def test_at_the_lowest_resolution_a_large_field_wraps_without_a_flag() -> None:
    sample = measure([4.92e-3, -4.92e-3, 8.0e-3], setting(resolution=0))
    read = tesla(sample.counts, setting(resolution=0))
    assert_allclose(read, [4.92e-3 - 9.8304e-3, -4.92e-3 + 9.8304e-3, 8.0e-3 - 15.86e-3], atol=1e-6)
    assert sample.flags == ChipFlag.GOOD


@pytest.mark.parametrize("field", [[14e-3, 0, 0], [0, -14e-3, 0], [0, 0, 22e-3], [1.0, 1.0, -1.0]])
@pytest.mark.parametrize("resolution", [2, 3])
def test_where_all_bits_are_read_it_stops_at_the_rail_and_says_so(
    field: list[float], resolution: int
) -> None:
    chosen = setting(resolution=resolution)
    sample = measure([field, [0.0, 0.0, 0.0]], chosen)
    assert_array_equal(sample.flags, [ChipFlag.SATURATED, ChipFlag.GOOD])
    assert np.abs(sample.counts).max() in ((21999, 22000) if resolution == 2 else (10999, 11000))
    assert_array_equal(np.sign(sample.counts[0]), np.sign(field))


@pytest.mark.parametrize("resolution", [2, 3])
def test_a_reading_is_flagged_before_any_chip_stops(resolution: int) -> None:
    chosen = setting(resolution=resolution)
    edge = full_scale(chosen)
    samples = measure([0.9999 * edge, 1.0001 * edge, -0.9999 * edge, -1.0001 * edge], chosen)
    good, bad = ChipFlag.GOOD, ChipFlag.SATURATED
    assert_array_equal(samples.flags, [good, bad, good, bad])


def test_a_field_that_is_no_number_is_flagged() -> None:
    sample = measure([[np.nan, 0.0, 0.0], [1e-3, 0.0, 0.0]], setting())
    assert_array_equal(sample.flags, [ChipFlag.INVALID, ChipFlag.GOOD])
    assert_array_equal(sample.counts[0], 0)


def test_noise_has_the_stated_deviation() -> None:
    chosen = setting(oversampling=1, digital_filter=3)
    rng = np.random.default_rng(1)
    field = np.broadcast_to([1e-3, -2e-3, 3e-3], (40_000, 3))
    read = tesla(measure(field, chosen, rng=rng).counts, chosen)
    assert_allclose(read.std(axis=0), noise(chosen), rtol=0.02)
    assert_allclose(read.mean(axis=0), field[0], atol=5e-8)
    again = measure(field, chosen, rng=np.random.default_rng(1))
    assert_array_equal(again.counts, measure(field, chosen, rng=np.random.default_rng(1)).counts)


def test_noise_falls_with_averaging_down_to_its_floor() -> None:
    law = HallNoise(white=(4e-6, 4e-6, 4e-6), floor=(0.0, 0.0, 0.0))
    slow = setting(oversampling=2, digital_filter=0)
    assert_allclose(noise(slow, law), 2e-6)  # four times the samples
    law = HallNoise(white=(4e-6, 4e-6, 4e-6), floor=(1e-6, 1e-6, 1e-6))
    assert_allclose(noise(setting(oversampling=3, digital_filter=7), law), 1e-6, rtol=0.03)
    with pytest.raises(ArgumentError, match="white must be three numbers >= 0"):
        HallNoise(white=(-1e-6, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="floor must be three numbers >= 0"):
        HallNoise(floor=(0.0, np.inf, 0.0))
    assert_allclose(noise(slow, HallNoise(white=(0.0, 0.0, 0.0))), HallNoise().floor)


@pytest.mark.parametrize(
    ("oversampling", "digital_filter", "typical", "worst", "burst"),
    [(0, 2, 2.29, 2.59, 493), (0, 3, 3.06, 3.43, 348), (1, 3, 4.98, 5.55, 201)],
)
def test_conversion_times_are_the_data_sheets(
    oversampling: int, digital_filter: int, typical: float, worst: float, burst: float
) -> None:
    chosen = setting(0, 0, oversampling, digital_filter)
    assert_allclose(1e3 * conversion_time(chosen, 0), typical, atol=6e-3)
    assert_allclose(1e3 * conversion_time(chosen, 0, worst=True), worst, atol=6e-3)
    assert_allclose(1 / burst_period(chosen, 0, worst=True), burst, atol=0.5)


def test_a_pause_in_burst_mode_comes_on_top_of_the_measurement() -> None:
    chosen = setting(oversampling=1, digital_filter=3)
    assert_allclose(burst_period(chosen, data_rate=5) - burst_period(chosen), 0.1)
    worst = burst_period(chosen, 0, data_rate=5, worst=True)
    assert_allclose(worst, 1.1 * burst_period(chosen, 0, data_rate=5))
    with pytest.raises(ArgumentError, match=r"data_rate must lie in 0\.\.63; got 64"):
        burst_period(chosen, data_rate=64)


@given(st.floats(-40.0, 85.0))
def test_temperature_word_goes_both_ways(warmth: float) -> None:
    assert abs(float(degrees(temperature_counts(warmth))) - warmth) <= 0.5 / 45.2 + 1e-9


def test_temperature_word_is_the_data_sheets_at_room_temperature() -> None:
    assert temperature_counts(25.0) == 46244
    assert temperature_counts(26.0) == 46289
    assert temperature_counts([np.nan, -1e4, 1e4]).tolist() == [0, 0, 0xFFFF]
    sample = measure(np.zeros((2, 3)), setting(), [25.0, 35.0])
    assert_allclose(degrees(sample.temperature_counts), [25.0, 35.0], atol=0.02)


@pytest.mark.parametrize("axes", [("+x", "+y", "+z"), ("+x", "-y", "-z"), ("-y", "+x", "+z")])
def test_rotation_leads_from_chip_to_skin(axes: tuple[str, str, str]) -> None:
    site = HallSite(name="S", magnet="M", gap=5e-3, axes=axes, address=0x0C)
    turned = rotation(site)
    assert_allclose(turned @ turned.T, np.eye(3))
    assert_allclose(np.linalg.det(turned), 1.0)
    for column, axis in enumerate(axes):
        along = np.zeros(3)
        along["xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
        assert_allclose(turned @ np.eye(3)[column], along)


def test_the_converters_noise_grows_with_its_step() -> None:
    law = HallNoise(white=(4e-6, 4e-6, 4e-6), floor=(0.0, 0.0, 0.0), converter=0.5)
    assert_allclose(noise(setting(7), law), 4e-6)
    # At GAIN_SEL 0 a step is five times as large: half of the variance 25-fold, half unchanged.
    assert_allclose(noise(setting(0), law), 4e-6 * np.sqrt(0.5 + 0.5 * 25))
    quiet = HallNoise(white=(4e-6, 4e-6, 4e-6), floor=(0.0, 0.0, 0.0), converter=0.0)
    assert_allclose(noise(setting(0), quiet), 4e-6)
    louder = [noise(setting(gain))[0] for gain in range(7, -1, -1)]
    assert (np.diff(louder) > 0).all()
    with pytest.raises(ArgumentError, match=r"converter must lie in 0\.\.1"):
        HallNoise(converter=2.0)


def test_noise_is_set_by_the_time_of_conversion_alone() -> None:
    # 10 ms, made of filter or of oversampling, within the settings' own steps.
    slow = [setting(7, 0, osr, filt) for osr, filt in ((0, 5), (1, 4), (2, 3))]
    noises = [noise(config)[0] * np.sqrt(conversion_time(config)) for config in slow]
    assert_allclose(noises, noises[0], rtol=0.1)


def test_the_temperature_reading_has_its_own_noise() -> None:
    law = HallNoise(temperature=0.2)
    rng = np.random.default_rng(3)
    sample = measure(np.zeros((20_000, 3)), setting(), 30.0, rng, law)
    warmth = degrees(sample.temperature_counts)
    assert_allclose([warmth.mean(), warmth.std()], [30.0, 0.2], rtol=0.02)
    # It comes after the field's, whose stream it does not touch.
    plain = measure(np.zeros((20_000, 3)), setting(), 30.0, np.random.default_rng(3))
    assert_array_equal(plain.counts, sample.counts)
    assert_array_equal(
        measure(np.zeros((5, 3)), setting(), 30.0, None, law).temperature_counts,
        temperature_counts(30.0),
    )
    with pytest.raises(ArgumentError, match="temperature must be >= 0 degC"):
        HallNoise(temperature=-1.0)


def test_three_pairs_of_oversampling_and_filter_are_not_allowed() -> None:
    short = [(o, f) for o in range(4) for f in range(8) if not settles(setting(7, 0, o, f))]
    assert short == [(0, 0), (0, 1), (1, 0)]


def test_temperature_takes_its_time() -> None:
    config = setting(oversampling=1, digital_filter=3)
    extra = [conversion_time(config, osr2) - conversion_time(config) for osr2 in range(4)]
    assert_allclose(extra, [259e-6, 451e-6, 835e-6, 1603e-6])
    with pytest.raises(ArgumentError, match=r"temperature_oversampling must lie in 0\.\.3"):
        conversion_time(config, 4)
