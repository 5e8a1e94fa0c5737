"""A board's clock on the host's: offset and drift through delays that only ever add."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.hardware.clock import BoardClock


def mapped(clock: BoardClock, true: np.ndarray, drift: float, delay: np.ndarray) -> np.ndarray:
    """Times that the clock makes of a board that runs slow by a drift and started at 7 s."""
    board = 7.0 + true / (1.0 + drift)
    return np.array([clock.host_time(b, t) for b, t in zip(board, true + delay, strict=True)])


@pytest.mark.parametrize("drift", [-200e-6, 0.0, 50e-6])
def test_offset_and_drift_are_found_through_delays(drift: float) -> None:
    rng = np.random.default_rng(0)
    true = np.arange(0.0, 120.0, 0.005)
    delay = 0.5e-3 + rng.exponential(1.5e-3, len(true)) + (rng.random(len(true)) < 0.01) * 0.05
    clock = BoardClock()
    times = mapped(clock, true, drift, delay)
    settled = true > 20.0
    assert_allclose(clock.drift, drift, atol=5e-6)
    assert np.abs(times - true)[settled].max() < 1e-3
    assert np.abs(times - true)[~settled].max() < 60e-3


def test_times_rise_as_steadily_as_the_boards() -> None:
    rng = np.random.default_rng(1)
    true = np.arange(0.0, 30.0, 0.005)
    delay = rng.exponential(4e-3, len(true)) + (rng.random(len(true)) < 0.02) * 0.1
    times = mapped(BoardClock(), true, 100e-6, delay)
    steps = np.diff(times)
    assert steps.min() > 0.97 * 0.005
    assert steps.max() < 1.03 * 0.005


def test_a_pause_of_the_stream_is_a_pause_of_the_times() -> None:
    clock = BoardClock()
    true = np.concatenate([np.arange(0.0, 10.0, 0.01), np.arange(40.0, 50.0, 0.01)])
    times = mapped(clock, true, 80e-6, np.full(len(true), 1e-3))
    assert_allclose(times - true, 1e-3, atol=3e-3)


def test_a_board_that_starts_again_is_mapped_anew() -> None:
    clock = BoardClock()
    mapped(clock, np.arange(0.0, 10.0, 0.01), 0.0, np.zeros(1000))
    clock.forget()
    assert clock.host_time(0.5, 12.0) == 12.0
    assert clock.host_time(0.51, 12.01) == pytest.approx(12.01)
