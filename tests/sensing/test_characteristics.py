"""Figures of a skin in closed form: known loops, slopes, noises, coefficients and recoveries."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.sensing.characteristics import (
    crosstalk,
    loop_share,
    mean_of,
    noise,
    recovery_time,
    relative_slope,
    repeatability,
    slope,
)


def test_the_mean_of_figures_leaves_out_what_is_not_known() -> None:
    mean = mean_of([1.0, np.nan, 3.0])
    assert (mean.value, mean.deviation, mean.count) == (2.0, 1.0, 2)
    assert np.isnan(mean_of([5.0]).deviation)
    assert np.isnan(mean_of([]).value)


def test_noise_is_found_beneath_a_drift_as_surely_as_is_said() -> None:
    rng, sigma = np.random.default_rng(0), 2e-6
    drift = np.linspace(0.0, 50e-6, 40)[:, None]
    estimates = [noise(drift + sigma * rng.normal(size=(40, 3))) for _ in range(400)]
    values = np.array([each.value for each in estimates])
    # A drift of 1.3 um a reading adds a fifth to a variance; without it the noise is unbiased.
    assert_allclose(values.mean(), (sigma**2 + (50e-6 / 39) ** 2 / 2) ** 0.5, rtol=0.02)
    still = [noise(sigma * rng.normal(size=(40, 3))) for _ in range(400)]
    assert_allclose(np.mean([each.value for each in still]), sigma, rtol=0.02)
    spread = np.std([each.value for each in still])
    assert_allclose(np.mean([each.deviation for each in still]), spread, rtol=0.15)


def test_a_slope_is_as_sure_as_it_says() -> None:
    rng, x = np.random.default_rng(1), np.linspace(0.0, 1.0, 12)
    estimates = [slope(x, 3.0 - 7.0 * x + 0.1 * rng.normal(size=12)) for _ in range(500)]
    pulls = [(each.value + 7.0) / each.deviation for each in estimates]
    # Student's t of ten degrees has a deviation of 1.118.
    assert_allclose(np.std(pulls), 1.118, rtol=0.12)
    assert abs(np.mean(pulls)) < 0.15
    exact = slope([0.0, 2.0], [1.0, 5.0])
    assert exact.value == 2.0
    assert np.isnan(exact.deviation)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_a_loop_of_known_area(share: float) -> None:
    # Loaded along F = d, let go along F = d - share d (1 - d) * 3: area share / 2 of 1 / 2.
    up = np.linspace(0.0, 1.0, 501)
    down = up[::-1]
    drive = np.concatenate([up, down])
    response = np.concatenate([up, down - 3.0 * share * down * (1.0 - down)])
    assert_allclose(loop_share(drive, response, 500), share, atol=2e-5)
    # Neither units nor a zero of the drive change a share, and hardly does a late beginning.
    assert_allclose(loop_share(5.0 - 1e-3 * drive, -2e-6 * response, 500), share, atol=2e-5)
    late = drive >= 0.05
    partial = loop_share(drive[late], response[late], int(late[:501].sum()) - 1)
    assert_allclose(partial, share, rtol=0.02, atol=2e-5)


def test_a_viscous_loop_in_closed_form() -> None:
    # x = sin^2(pi t), r = x + c dx/dt over its period: the loop is c * integral of (dx/dt)^2.
    t, c = np.linspace(0.0, 1.0, 4001), 0.01
    x, rate = np.sin(np.pi * t) ** 2, np.pi * np.sin(2 * np.pi * t)
    loading = 0.5 + c * np.pi**2 / 4
    expected = c * np.pi**2 / 2 / loading
    assert_allclose(loop_share(x, x + c * rate, 2000), expected, rtol=1e-4)


def test_repeatability_is_the_relative_spread() -> None:
    rng = np.random.default_rng(2)
    spreads = [repeatability(-5.0 * (1 + 0.03 * rng.normal(size=8))) for _ in range(500)]
    assert_allclose(np.mean([each.value for each in spreads]) / 0.9650, 0.03, rtol=0.03)  # c_4 of 8
    spread = np.std([each.value for each in spreads])
    assert_allclose(np.mean([each.deviation for each in spreads]), spread, rtol=0.1)


def test_crosstalk_is_what_others_touches_give() -> None:
    signals = [[10.0, -1.0, 2.0], [12.0, 1.0, 2.0], [2.2, 20.0, 4.0]]
    assert_allclose(crosstalk(signals, [0, 0, 1]), [0.2, 0.05, np.nan])


def test_a_temperature_coefficient_at_its_reference() -> None:
    degrees = np.array([15.0, 25.0, 45.0])
    coefficient = relative_slope(degrees, 3e-3 * (1 - 0.005 * (degrees - 25.0)))
    assert_allclose(coefficient.value, -0.005, rtol=1e-12)
    assert coefficient.deviation < 1e-15
    assert_allclose(relative_slope(degrees, 1 - 0.005 * (degrees - 25.0), 45.0).value, -0.005 / 0.9)


@pytest.mark.parametrize("part", [0.1, 0.05, 0.01])
def test_a_recovery_of_known_time_constant(part: float) -> None:
    times = np.linspace(-1.0, 5.0, 3001)
    signal = np.where(times < 0.0, 1.0, np.exp(-times / 0.7)) + 3.0
    recovery = recovery_time(times, signal, 0.0, within=part, rest=3.0)
    assert_allclose(recovery, -0.7 * np.log(part), atol=1e-4)
    short = times < 0.5
    assert np.isnan(recovery_time(times[short], signal[short], 0.0, within=part, rest=3.0))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: noise([[1.0], [2.0]]), "at least 3; got 2"),
        (lambda: slope([1.0, 1.0], [0.0, 1.0]), "differ in x"),
        (lambda: loop_share([0.0, 1.0], [0.0, 1.0], 1), "turn must lie within"),
        (lambda: repeatability([1.0]), "at least 2; got 1"),
        (lambda: crosstalk([[1.0, 2.0]], [2]), "chips from 0 to 1"),
    ],
)
def test_what_determines_nothing_is_refused(wrong, message) -> None:
    with pytest.raises(ArgumentError, match=message):
        wrong()
