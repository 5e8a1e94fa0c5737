"""Encodings: what a model is fed of the present and the past, and that neither knows the future."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.errors import ArgumentError
from smoskin.sensing.learned.inputs import Encoding, Form, History, Past

EVERY = [
    Encoding(chips=(0, 2), form=form, past=past, time_constants=times, floor=1e-4)
    for form in Form
    for past in Past
    for times in ((), (3.0,), (1.0, 20.0))
]


def readings(rows=60, seed=0):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.02, 0.2, rows))
    swing = np.sin(time)[:, None, None] ** 2
    return time, swing * rng.normal(0.0, 1e-3, (1, 3, 3)) + 1e-6 * rng.normal(size=(rows, 3, 3))


@pytest.mark.parametrize("encoding", EVERY)
def test_a_row_has_the_columns_that_are_told(encoding):
    assert encoding.encode(*readings()).shape == (60, encoding.columns)


@pytest.mark.parametrize("encoding", EVERY)
def test_no_row_knows_what_comes_after_it(encoding):
    time, field = readings()
    whole = encoding.encode(time, field)
    np.testing.assert_array_equal(encoding.encode(time[:20], field[:20]), whole[:20])


@pytest.mark.parametrize("encoding", EVERY)
def test_a_chip_that_is_not_used_does_not_matter(encoding):
    time, field = readings()
    other = field.copy()
    other[:, 1] = 1.0
    np.testing.assert_array_equal(encoding.encode(time, other), encoding.encode(time, field))


@given(st.floats(0.1, 30.0), st.floats(0.01, 100.0))
def test_a_mean_forgets_a_step_with_its_time_constant(tau, elapsed):
    history = History((tau,))
    history.step(0.0, np.zeros(1))
    (lag,) = history.step(elapsed, np.ones(1))
    assert lag == pytest.approx(np.exp(-elapsed / tau))


@given(st.floats(1.0, 1e3))
def test_of_a_strong_field_the_past_of_strength_and_the_direction_do_not_know_its_scale(scale):
    encoding = Encoding(
        chips=(0, 1, 2), form=Form.DIRECTION, past=Past.STRENGTH, time_constants=(2.0,), floor=1e-15
    )
    time, field = readings()
    field = field + 1e-5
    plain, scaled = encoding.encode(time, field), encoding.encode(time, scale * field)
    length = 9
    np.testing.assert_allclose(np.delete(scaled, length, 1), np.delete(plain, length, 1), atol=1e-9)
    np.testing.assert_allclose(scaled[:, length] - plain[:, length], np.log(scale), atol=1e-9)


def test_below_the_floor_a_field_has_no_direction():
    encoding = Encoding(chips=(0,), form=Form.DIRECTION, floor=1e-4)
    inputs = encoding.encode(np.arange(2.0), np.array([[[1e-7, 0, 0]], [[1e-2, 0, 0]]]))
    np.testing.assert_allclose(inputs[:, 0], [1e-3, 1.0], rtol=1e-3)
    np.testing.assert_allclose(np.exp(inputs[:, 3]), [1e-4, 1e-2], rtol=1e-3)
    np.testing.assert_allclose(encoding.faintness(inputs), [1e8, 1e4], rtol=1e-3)


def test_wrong_use_is_named():
    with pytest.raises(ArgumentError, match="chips must be distinct indices from 0"):
        Encoding(chips=(1, 1))
    with pytest.raises(ArgumentError, match="time_constants must be positive"):
        Encoding(chips=(0,), time_constants=(0.0,))
    with pytest.raises(ArgumentError, match=r"floor must be positive, 1e-15 to 1 T; got 0\.0 T"):
        Encoding(chips=(0,), floor=0.0)
    with pytest.raises(ArgumentError, match="must have the chips"):
        Encoding(chips=(0, 3)).encode(*readings())
