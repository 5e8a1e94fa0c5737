"""Recovery: its time in closed form, and the solid found again from a recording."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from paper.models.recovery import creeping_solid, fit_prony, late_parts
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import Prony, creep
from smoskin.sensing.characteristics import recovery_time


def test_recovery_of_one_element_in_closed_form() -> None:
    solid = creeping_solid([0.4], [1.0])
    times = np.concatenate([[0.0, 0.0], np.linspace(0, 30, 30001)[1:]])
    load = np.where(np.arange(len(times)) < 1, 1.0, 0.0)
    signal = creep(solid, times, load[:, None] * [1.0, -7.0]) + 3.0
    # After a long hold 0.4 is left at once, then 0.4 exp(-t).
    assert_allclose(recovery_time(times, signal, 0.0, within=0.05), np.log(0.4 / 0.05), atol=1e-4)
    assert_allclose(recovery_time(times, signal, 0.0, within=0.1), np.log(4.0), atol=1e-4)
    assert_array_equal(recovery_time(times, signal, 0.0, within=0.5), 0.0)


def test_a_signal_at_rest_has_no_recovery_time() -> None:
    signal = np.array([[1.0, 2.0], [0.0, 2.0], [0.0, 2.0]])
    assert_array_equal(recovery_time([0.0, 1.0, 2.0], signal, 0.0), [0.95, np.nan])


@given(
    st.lists(st.floats(0.01, 0.2), min_size=1, max_size=4),
    st.floats(-5.0, 5.0),
    st.sampled_from([2e-6, -3.0]),
)
@settings(max_examples=25)
def test_a_recovery_gives_its_solid_back(shares: list[float], rest: float, scale: float) -> None:
    tried = np.array([0.1, 1.0, 10.0, 100.0])
    solid = creeping_solid(shares, tried[: len(shares)])
    times = np.concatenate([[-60.0, 0.0, 0.0], np.geomspace(0.01, 500, 400)])
    load = np.where(np.arange(len(times)) < 2, 1.0, 0.0)
    signal = rest * abs(scale) + scale * creep(solid, times, load)
    fit = fit_prony(times, load, signal, tried)
    assert_allclose(fit.prony.moduli, solid.moduli, rtol=1e-4)
    assert_allclose(fit.prony.times, solid.times, rtol=1e-4)
    assert_allclose(
        [fit.rest, fit.scale], [rest * abs(scale), scale], rtol=1e-5, atol=1e-6 * abs(scale)
    )
    assert fit.residual < 1e-7 * abs(scale)


def test_the_deviation_of_a_fit_is_honest() -> None:
    truth = creeping_solid([0.1, 0.15], [0.3, 3.0])
    times = np.concatenate([[-1.0, 0.0, 0.0], np.linspace(0.01, 30, 3000)])
    load = np.where(np.arange(len(times)) < 2, 1.0, 0.0)
    clean = creep(truth, times, load)
    rng = np.random.default_rng(4)
    fits = [
        fit_prony(times, load, clean + 0.01 * rng.normal(size=clean.shape), [0.3, 3.0])
        for _ in range(60)
    ]
    moduli = np.array([fit.prony.moduli for fit in fits])
    instants = np.array([fit.prony.times for fit in fits])
    assert_allclose(moduli.mean(axis=0), truth.moduli, rtol=0.03)
    assert_allclose(moduli.std(axis=0), fits[0].moduli_deviation, rtol=0.3)
    assert_allclose(instants.std(axis=0), fits[0].times_deviation, rtol=0.3)
    assert_allclose(fits[0].residual, 0.01, rtol=0.1)


def test_without_knowing_the_times_the_recovery_is_still_foretold() -> None:
    truth = Prony(moduli=[0.04, 0.07, 0.05], times=[0.07, 0.9, 11.0])
    times = np.concatenate([np.linspace(-5, 0, 1000), np.linspace(0, 60, 12000)])
    load = np.where(np.arange(len(times)) < 1000, 1.0, 0.0)
    rng = np.random.default_rng(7)
    fit = fit_prony(times, load, creep(truth, times, load) + 2e-3 * rng.normal(size=len(times)))
    t = np.geomspace(0.05, 20, 50)
    assert_allclose(fit.prony.compliance(t), truth.compliance(t), atol=1.5e-3)
    assert_allclose(fit.prony.moduli, truth.moduli, rtol=0.1)
    assert_allclose(fit.prony.times, truth.times, rtol=0.2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: recovery_time([0, 1], [1, 0], 2.0), r"released must lie in 0\.\.1 s"),
        (lambda: recovery_time([0, 1], [1, 0], 0.0, within=2), "within must lie in"),
        (lambda: fit_prony([0, 1], [1, 1], [0, 1]), "load and signal must change"),
        (lambda: fit_prony([0, 1], [1, 0], [0, np.nan]), "load and signal must be finite"),
        (lambda: fit_prony([0, 1], [1, 0], [0, 0, 0]), "must have the shape"),
    ],
)
def test_wrong_use(call, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        call()


def test_creep_turned_back_gives_the_solid() -> None:
    solid = Prony(moduli=[0.03, 0.05, 0.1, 0.15], times=[0.05, 0.5, 4.0, 70.0])
    back = creeping_solid(solid.retardation_shares, solid.retardation_times)
    assert_allclose(back.moduli, solid.moduli, rtol=1e-9)
    assert_allclose(back.times, solid.times, rtol=1e-9)
    with pytest.raises(ArgumentError, match="shares must be positive"):
        creeping_solid([-0.1], [1.0])


def test_late_parts_at_once_are_the_steps_of_a_memory() -> None:
    solid, rng = Prony(moduli=[0.1, 0.2], times=[0.3, 5.0]), np.random.default_rng(0)
    times = np.cumsum(rng.choice([0.0, 0.004, 0.3, 20.0], 60))
    response = rng.normal(size=(60, 2))
    late = late_parts(solid.retardation_times, times, response)
    shares = solid.retardation_shares
    crept = (1 - shares.sum()) * response + np.tensordot(shares, late, 1)
    assert_allclose(crept, creep(solid, times, response), atol=1e-12)
