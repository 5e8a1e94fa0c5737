"""The elastomer's memory: conversions, exact steps, thermodynamics."""

import itertools
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.design.materials import ELASTOMERS
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import Memory, Prony, creep, elastomer_prony, modulus_factor

FOUR = Prony(moduli=[0.03, 0.05, 0.1, 0.15], times=[0.05, 0.5, 4.0, 70.0])


@st.composite
def solids(draw: st.DrawFn) -> Prony:
    """One to five terms, anything from nearly elastic to nearly fluid."""
    ratios = draw(st.lists(st.floats(1.05, 50.0), min_size=1, max_size=5))
    parts = draw(st.lists(st.floats(0.01, 1.0), min_size=len(ratios) + 1, max_size=len(ratios) + 1))
    shares = np.array(parts)[:-1] / np.sum(parts)
    return Prony(moduli=shares, times=1e-2 * np.cumprod(ratios))


def rounding(solid: Prony) -> float:
    """Relative error that eigenvalues of this spread may have, at least 1e-9."""
    spread = solid.times[-1] / solid.times[0] / (1 - solid.moduli.sum())
    return max(1e-9, 8 * np.finfo(float).eps * spread)


def test_one_maxwell_element_is_the_standard_linear_solid() -> None:
    g, tau = 0.3, 2.0
    solid = Prony(moduli=[g], times=[tau])
    t = np.linspace(0, 20, 50)
    assert_allclose(solid.relaxation(t), (1 - g + g * np.exp(-t / tau)) / (1 - g), rtol=1e-14)
    # By hand: retardation time tau G(0)/G(inf), late share g.
    assert_allclose(solid.retardation_times, tau / (1 - g), rtol=1e-14)
    assert_allclose(solid.compliance(t), 1 - g * np.exp(-t * (1 - g) / tau), rtol=1e-14)


@given(solids(), st.floats(-4.0, 4.0))
def test_relaxation_and_creep_are_inverse_in_laplace_space(solid: Prony, decade: float) -> None:
    s = 10.0**decade
    stiff = 1 + np.sum(solid.moduli / (1 - solid.moduli.sum()) * s / (s + 1 / solid.times))
    late = solid.retardation_shares
    soft = 1 - np.sum(late * s / (s + 1 / solid.retardation_times))
    assert_allclose(stiff * soft, 1.0, rtol=rounding(solid))
    assert_allclose(late.sum(), solid.moduli.sum(), rtol=rounding(solid))


def test_relaxation_over_creep_is_the_identity_in_time() -> None:
    # Volterra: the stress of the strain that a step of stress brings about is that step.
    t = np.geomspace(1e-4, 300, 4000)
    edges = np.concatenate([[0.0], t])
    strain = FOUR.compliance(edges)
    for at in (0.01, 1.0, 50.0):
        before = edges[edges <= at]
        middle = 0.5 * (before[1:] + before[:-1])
        stress = strain[0] * FOUR.relaxation(before[-1])
        stress += FOUR.relaxation(before[-1] - middle) @ np.diff(strain[: len(before)])
        assert_allclose(stress, 1.0, atol=1e-5)


@given(solids())
def test_each_retardation_time_follows_its_relaxation_time(solid: Prony) -> None:
    assert (solid.retardation_times > solid.times * (1 - 1e-9)).all()
    assert (solid.retardation_times[:-1] <= solid.times[1:] * (1 + 1e-9)).all()
    assert (solid.retardation_shares >= 0).all()


def test_a_step_of_load_creeps_as_the_compliance_says() -> None:
    memory = Memory(FOUR, settled=np.zeros((3, 6)))
    unit = np.arange(18.0).reshape(3, 6)
    passed = 0.0
    for duration in (0.0, 0.01, 0.5, 3.0, 200.0):
        passed += duration
        assert_allclose(memory.step(duration, unit), FOUR.compliance(passed) * unit, rtol=1e-12)


@given(solids(), st.integers(2, 40), st.floats(1e-3, 100.0))
@settings(max_examples=40)
def test_many_steps_of_a_ramp_are_one(solid: Prony, count: int, duration: float) -> None:
    once, often = Memory(solid, 1.0), Memory(solid, 1.0)
    whole = once.step(duration, 3.0)
    for value in np.linspace(1.0, 3.0, count + 1)[1:]:
        last = often.step(duration / count, value)
    assert_allclose(last, whole, rtol=1e-10)


@given(solids(), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_a_history_at_once_is_its_steps(solid: Prony, seed: int) -> None:
    rng = np.random.default_rng(seed)
    durations = rng.choice([0.0, 0.004, 0.3, 20.0], 40) * rng.uniform(0.5, 1.5, 40)
    times = np.concatenate([[5.0], 5.0 + np.cumsum(durations)])
    response = rng.normal(size=(41, 2, 3))
    memory = Memory(solid, response[0])
    steps = [memory.step(gap, now) for gap, now in zip(np.diff(times), response[1:], strict=True)]
    assert_allclose(creep(solid, times, response)[1:], steps, rtol=1e-8, atol=1e-10)
    assert_allclose(creep(solid, times, response)[0], response[0], rtol=1e-14)


@given(solids(), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_no_cycle_of_load_gives_energy(solid: Prony, seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.001, 5.0, 60)), [1e4, 2e4]])
    load = np.concatenate([[0.0], rng.normal(size=60), [0.0, 0.0]])
    fine = np.unique(np.concatenate([np.linspace(a, b, 30) for a, b in itertools.pairwise(times)]))
    force = np.interp(fine, times, load)
    motion = creep(solid, fine, force)
    work = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(motion))
    assert work > 0
    # Under way, too: what went in is never less than nothing from the untouched state.
    paid = np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(motion))
    assert paid.min() > -1e-6 * np.abs(force).max() ** 2


@given(solids())
def test_creep_rises_and_relaxation_falls_to_one(solid: Prony) -> None:
    t = np.concatenate([[0.0], np.geomspace(1e-5, 1e9, 200)])
    assert (np.diff(solid.compliance(t)) >= 0).all()
    assert (np.diff(solid.relaxation(t)) <= 0).all()
    assert_allclose([solid.compliance(1e12), solid.relaxation(1e12)], 1.0, rtol=1e-9)
    assert_allclose(solid.compliance(0.0) * solid.relaxation(0.0), 1.0, rtol=rounding(solid))


def test_without_terms_it_is_elastic() -> None:
    solid = Prony(moduli=[], times=[])
    memory = Memory(solid, np.zeros(3))
    assert_array_equal(memory.step(0.1, [1.0, 2.0, 3.0]), [1.0, 2.0, 3.0])
    assert_array_equal(creep(solid, [0.0, 1.0], [1.0, 2.0]), [1.0, 2.0])
    assert solid.relaxation(1.0) == solid.compliance(1.0) == 1.0


def test_what_is_no_number_stays_so_and_is_forgotten() -> None:
    memory, other = Memory(FOUR, [0.0, 0.0]), Memory(FOUR, [0.0, 0.0])
    memory.step(0.1, [1.0, 1.0])
    assert_array_equal(np.isnan(memory.step(0.1, [np.nan, 2.0])), [True, False])
    other.step(0.1, [1.0, 1.0])
    other.step(0.1, [1.0, 2.0])
    assert_array_equal(memory.step(0.1, [3.0, 3.0]), other.step(0.1, [3.0, 3.0]))
    assert_array_equal(np.isnan(creep(FOUR, [0.0, 1.0, 2.0], [1.0, np.nan, 1.0])), [0, 1, 0])


def test_reset_forgets() -> None:
    memory = Memory(FOUR, [0.0])
    memory.step(1.0, [5.0])
    memory.reset([2.0])
    assert_allclose(memory.step(3.0, [2.0]), [2.0], rtol=1e-15)


def test_a_live_step_is_quick() -> None:
    memory = Memory(FOUR, np.zeros((3, 6)))
    response = np.ones((3, 6))
    best = np.inf
    for _ in range(200):
        start = time.perf_counter()
        for _ in range(10):
            memory.step(0.0045, response)
        best = min(best, (time.perf_counter() - start) / 10)
    assert best < 20e-6


def test_the_named_elastomers_are_solids_that_creep_a_little() -> None:
    for name, elastomer in ELASTOMERS.items():
        solid = elastomer_prony(name)
        assert 0.02 < 1 - solid.compliance(0.0) < 0.2
        assert elastomer.relaxation_source
    # An ideal rubber: in proportion to the absolute temperature.
    assert_allclose(
        modulus_factor("Ecoflex 00-30", [25.0, -273.15, 75.0]), [1, 0, 348.15 / 298.15], atol=1e-12
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Prony(moduli=[0.6, 0.5], times=[1, 2]), "moduli must be positive with a sum"),
        (lambda: Prony(moduli=[0.5, 0.5], times=[1, 2]), "moduli must be positive with a sum"),
        (lambda: Prony(moduli=[0.1, 0.0], times=[1, 2]), "moduli must be positive with a sum"),
        (lambda: Prony(moduli=[-0.1], times=[1]), "moduli must be positive with a sum"),
        (lambda: Prony(moduli=[np.nan], times=[1]), "moduli must be positive with a sum"),
        (lambda: Prony(moduli=[0.1], times=[0]), "times must be positive and rise"),
        (lambda: Prony(moduli=[0.1], times=[np.inf]), "times must be positive and rise"),
        (lambda: Prony(moduli=[0.1, 0.1], times=[2, 2]), "times must be positive and rise"),
        (lambda: Prony(moduli=[0.1], times=[1, 2]), "times must have shape"),
        (lambda: elastomer_prony("chewing gum"), "material must be one of Ecoflex 00-30"),
        (lambda: modulus_factor("chewing gum", 20.0), "material must be one of"),
        (lambda: Memory(FOUR, 0.0).step(-1.0, 0.0), "duration must be finite and >= 0"),
        (lambda: Memory(FOUR, 0.0).step(1.0, [0.0]), r"response must have shape \(\)"),
        (lambda: Memory(FOUR, np.nan), "settled must be finite"),
        (lambda: creep(FOUR, [0.0, -1.0], [0.0, 0.0]), "never fall"),
        (lambda: creep(FOUR, [0.0, 1.0], [0.0]), "same length"),
        (lambda: creep(FOUR, [], []), "at least 1"),
        (lambda: creep(FOUR, [0.0, np.inf], [0.0, 0.0]), "times must be finite"),
        (lambda: Memory(FOUR, 0.0).step(np.inf, 0.0), "duration must be finite and >= 0"),
    ],
)
def test_wrong_use(call, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        call()
