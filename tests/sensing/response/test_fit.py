"""Tables fitted to presses whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.magnetics.nonlinearity import cross_signals
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.viscoelasticity import modulus_factor
from smoskin.sensing.response.basis import TouchBasis
from smoskin.sensing.response.fit import (
    _first_fit,
    _fit_curvature,
    add_coupling,
    add_modes,
    add_warmth,
    fit_response_table,
    table_curvature,
)
from tables_of_response import BASIS, random_table, random_touches

LATE = random_touches(40, seed=9)
SIZES = {
    "warmth": 0.00166469001787,
    "mean": 0.000250633574846,
    "modes": 0.00161049905279,
    "misfit": 9.01268491807e-10,
    "shown": 113.593333572,
    "curvature": 212.087762977,
    "pair_misfit": 1.31273714186e-07,
}
"""What fits of little data come to; it changes only with what is believed beforehand."""


@pytest.fixture(scope="module")
def true():
    return random_table()


@pytest.fixture
def small(monkeypatch):
    """Fits that take the small skin's functions, whatever the design."""
    monkeypatch.setattr(TouchBasis, "of", classmethod(lambda cls, design, radius: BASIS))


def flat(table, touches, temperature=REFERENCE_TEMPERATURE):
    return table.signals(*touches, temperature)


def test_the_first_fit_finds_the_table_and_its_misfit(planar, small, true):
    place, force = random_touches(6000)
    strength = np.linalg.norm(force, axis=1)[:, None]
    rng = np.random.default_rng(0)
    exact = flat(true, (place, force))
    table = fit_response_table(planar, place, force, exact.reshape(-1, 3, 3))
    assert_allclose(flat(table, LATE), flat(true, LATE), atol=1e-9)
    assert np.abs(table.misfit).max() < 1e-16
    assert table.forces == (-force[:, 2].max(), -force[:, 2].min())
    assert table.chips == (0, 1, 2)
    assert table.design_hash == planar.content_hash
    factor = modulus_factor(planar.columns.material, [REFERENCE_TEMPERATURE + 1])[0]
    assert table.softening == pytest.approx(factor - 1)
    for name in ("warmth", "grip", "curvature", "pair_misfit", "modes"):
        assert not getattr(table, name).any()
    missed = strength * rng.multivariate_normal(np.zeros(9), true.misfit, len(place))
    table = fit_response_table(planar, place, force, (exact + missed).reshape(-1, 3, 3))
    size = np.sqrt(np.diag(true.misfit))
    # Presses held out, fitted by 225 functions from 5400 others: 4 % more than the truth.
    assert_allclose(table.misfit / np.outer(size, size) * 5400 / 5650,
                    true.misfit / np.outer(size, size), atol=0.25)  # fmt: skip
    assert np.trace(table.misfit) == pytest.approx(1.04 * np.trace(true.misfit), rel=0.1)


def test_presses_that_cannot_be_are_refused(planar, small, true):
    place, force = random_touches(450)
    signals = flat(true, (place, force)).reshape(-1, 3, 3)
    assert fit_response_table(planar, place, force, signals).basis is BASIS
    for wrong in (
        (place[:449], force[:449], signals[:449]),
        (place, force, signals[:449]),
    ):
        with pytest.raises(ArgumentError, match="the same presses, at least 450"):
            fit_response_table(planar, *wrong)
    level = force.copy()
    level[7, 2] = 0.0
    with pytest.raises(ArgumentError, match="every touch must press"):
        fit_response_table(planar, place, level, signals)
    signals[3, 1, 2] = np.nan
    with pytest.raises(ArgumentError, match="signals must be finite"):
        fit_response_table(planar, place, force, signals)


def test_warmth_is_what_a_degree_changes_besides_softening(true):
    place, force = random_touches(200)
    warmer, colder = (
        flat(true, (place, force), REFERENCE_TEMPERATURE + degrees) for degrees in (10.0, -10.0)
    )
    bare = replace(true, warmth=0 * true.warmth)
    table = add_warmth(bare, place, force, ((warmer - colder) / 20).reshape(-1, 3, 3))
    change = flat(true, LATE, 33.0) - flat(bare, LATE, 33.0)
    left = flat(true, LATE, 33.0) - flat(table, LATE, 33.0)
    assert np.linalg.norm(left) < 0.05 * np.linalg.norm(change)


@pytest.fixture(scope="module")
def skins(true):
    """Thirty skins that differ in three ways, and presses of each."""
    weights = np.random.default_rng(5).normal((0.5, 0.0, 0.0), size=(30, 3))
    place, force = random_touches(300, seed=3)
    deviations = np.einsum("lk,bkc->lbc", weights, true.mode_signals(place, force))
    grips = true.grip + np.tensordot(weights, true.grip_modes, 1)
    return weights, place, force, deviations.reshape(30, -1, 3, 3), grips


def test_modes_have_the_covariance_of_the_skins(true, skins):
    weights, place, force, deviations, grips = skins
    bare = replace(true, modes=true.modes[:0], grip_modes=true.grip_modes[:0])
    table = add_modes(bare, place, force, deviations, grips)
    assert len(table.modes) == 3
    ways, fitted = true.mode_signals(*LATE), table.mode_signals(*LATE)
    size = np.abs(ways).max()
    middle = np.einsum("k,bkc->bc", weights.mean(axis=0), ways)
    assert_allclose(flat(table, LATE) - flat(true, LATE), middle, atol=0.01 * size)
    spread = np.cov(weights.T)
    expected = np.einsum("akc,kl,bld->acbd", ways, spread, ways, optimize=True)
    covariance = np.einsum("akc,bkd->acbd", fitted, fitted)
    assert_allclose(covariance, expected, atol=0.02 * np.abs(expected).max())
    # What grips do goes along with each mode.
    assert_allclose(table.grip, grips.mean(axis=0), rtol=1e-12)
    expected = np.einsum("kl,k...,blc->...bc", spread, true.grip_modes, ways)
    together = np.einsum("k...,bkc->...bc", table.grip_modes, fitted)
    assert_allclose(together, expected, atol=0.02 * np.abs(expected).max())
    # Without grips of their own skins have the table's.
    table = add_modes(bare, place, force, deviations)
    assert_allclose(table.grip, true.grip, rtol=1e-12)
    assert np.abs(table.grip_modes).max() < 1e-12 * np.abs(true.grip).max()
    assert table.grip_modes.shape == (3, *true.grip.shape)


def test_modes_too_small_to_matter_are_left_out(true):
    place, force = random_touches(80)
    mode = true.mode_signals(place, force)[:, 0]
    mode = mode / np.sqrt(np.mean(mode**2))
    for size, kept in ((0.49e-6, 0), (0.51e-6, 1)):
        # Two skins a and -a have the standard deviation sqrt(2) a.
        pair = size / np.sqrt(2) * np.stack([mode, -mode]).reshape(2, -1, 3, 3)
        assert len(add_modes(true, place, force, pair).modes) == kept
        assert len(add_modes(true, place, force, 4 * pair, least=2e-6).modes) == kept
    with pytest.raises(ArgumentError, match="at least two skins; got 1"):
        add_modes(true, place, force, pair[:1])


def test_what_modes_miss_of_other_skins_is_misfit(true):
    place, force = random_touches(400)
    strength = np.linalg.norm(force, axis=1)[:, None]
    rng = np.random.default_rng(8)
    known = true.mode_signals(place, force)
    deviations = np.einsum("lk,bkc->lbc", rng.normal(size=(16, 3)), known)
    exact = add_modes(true, place, force, deviations.reshape(16, -1, 3, 3))
    own = rng.multivariate_normal(np.zeros(9), true.misfit, (2, 400))
    deviations[14:] += own * strength
    table = add_modes(true, place, force, deviations.reshape(16, -1, 3, 3), least=8e-6)
    # Two of sixteen skins are held out and then, with all, change the modes a little.
    more = np.trace(table.misfit - exact.misfit) / np.trace(true.misfit)
    assert 0.95 < more < 1.6
    fewer = add_modes(true, place, force, deviations[10:].reshape(6, -1, 3, 3), least=1.0)
    apart = np.trace(fewer.misfit) / np.trace(true.misfit)
    assert apart == pytest.approx(1.0, abs=0.3)


def test_a_table_bent_in_its_motion_shows_its_curvature(true):
    """Signals z + kappa(z, z) / 2 of a motion z that is linear in the force."""
    rng = np.random.default_rng(1)
    curvature = rng.normal(size=(3, 3, 3, 3))
    curvature = 5.0 * (curvature + curvature.swapaxes(1, 2))
    motion = 1e-4 * (np.tile(np.eye(3), 3) + 0.3 * rng.normal(size=(3, 9)))
    mean = np.zeros_like(true.mean)
    # Shares add up to 1, so that every place has the same signals.
    n, m = len(BASIS.lines_x), len(BASIS.lines_y)
    for d, powers in enumerate(BASIS.exponents):
        axes = np.repeat(np.arange(3), powers)
        if len(axes) == 1:
            mean[:n, :m, d] = motion[axes[0]]
        elif len(axes) == 2:
            twice = 1.0 if axes[0] == axes[1] else 2.0
            mean[:n, :m, d] = (
                0.5 * twice * cross_signals(curvature, motion[axes[0]], motion[axes[1]])
            )
    table = replace(true, mean=mean)
    assert_allclose(table_curvature(table), curvature, atol=0.02 * np.abs(curvature).max())


def test_a_chip_that_no_touch_moves_stays_straight_and_the_others_bend(true):
    rng = np.random.default_rng(3)
    bent = rng.normal(size=(3, 3, 3, 3))
    bent = 5.0 * (bent + bent.swapaxes(1, 2))
    first, second = 1e-4 * rng.normal(size=(2, 200, 9))
    first[:, :3] = second[:, :3] = 0.0
    prior = np.zeros_like(bent)
    fitted = _fit_curvature(first, second, cross_signals(bent, first, second), prior, 1e-6)
    assert not fitted[0].any()
    assert_allclose(fitted[1:], bent[1:], atol=1e-3 * np.abs(bent).max())


def test_coupling_states_what_pairs_miss(true):
    rng = np.random.default_rng(6)
    place, force = rng.uniform(0, BASIS.extent, (300, 2, 2)), np.zeros((300, 2, 3))
    force[..., 2] = -rng.uniform(0.1, 1.0, (300, 2))
    off = 2e-6 * rng.normal(size=(300, 9)) * np.linalg.norm(force[..., 2], axis=1)[:, None]
    both = true.together(place, force) + off
    bare = replace(true, grip=0 * true.grip, pair_misfit=0 * true.pair_misfit)
    table = add_coupling(bare, true.grip, place, force, both.reshape(-1, 3, 3))
    assert_allclose(table.grip, true.grip)
    first, second = table.dragged(place, force)
    late = np.arange(300) % 10 == 0
    added = sum(table.signals(place[:, k], force[:, k]) for k in (0, 1))
    strength = np.sqrt((force[late, :, 2] ** 2).sum(axis=1))[:, None]
    parts = [both - table.together(place, force), 0.015 * (first + second - added)]
    parts.append(0.03 * (both - first - second))
    expected = sum((p[late] / strength).T @ (p[late] / strength) / 30 for p in parts)
    assert_allclose(table.pair_misfit, expected, rtol=1e-9, atol=1e-20)
    # Others than those held out are fitted.
    again = both.copy()
    again[late] += 1e-5
    other = add_coupling(bare, true.grip, place, force, again.reshape(-1, 3, 3))
    assert_allclose(other.curvature, table.curvature, rtol=1e-9)


def test_what_little_data_leaves_open_is_settled_as_ever(true):
    """Numbers of fits that hang on how large coefficients, noise and errors are taken to be."""
    rng = np.random.default_rng(12)
    place, force = random_touches(60, seed=5)
    strength = np.linalg.norm(force, axis=1)[:, None]
    warm = add_warmth(true, place, force, 1e-6 * rng.normal(size=(60, 3, 3)))
    deviations = np.einsum("lk,bkc->lbc", rng.normal(size=(15, 3)), true.mode_signals(place, force))
    deviations += 3e-6 * rng.normal(size=(15, 60, 9)) * strength
    modes = add_modes(true, place, force, deviations.reshape(15, -1, 3, 3))
    place, force = rng.uniform(0, BASIS.extent, (60, 2, 2)), np.zeros((60, 2, 3))
    force[..., 2] = -rng.uniform(0.1, 1.0, (60, 2))
    both = true.together(place, force) + 1e-5 * rng.normal(size=(60, 9))
    pairs = add_coupling(true, true.grip, place, force, both.reshape(-1, 3, 3))
    size = {
        "warmth": np.linalg.norm(warm.signals(*LATE, 35.0) - true.signals(*LATE)),
        "mean": np.linalg.norm(modes.signals(*LATE) - true.signals(*LATE)),
        "modes": np.linalg.norm(modes.mode_signals(*LATE)),
        "misfit": np.trace(modes.misfit),
        "shown": np.linalg.norm(table_curvature(true)),
        "curvature": np.linalg.norm(pairs.curvature),
        "pair_misfit": np.trace(pairs.pair_misfit),
    }
    assert size == pytest.approx(SIZES, rel=1e-6, abs=0)


def test_a_function_that_no_press_loads_is_left_at_zero():
    rows = np.random.default_rng(0).normal(size=(50, 4)) * [1.0, 2.0, 0.0, 0.5]
    true = np.array([[1.0, -1.0], [0.5, 0.0], [7.0, 7.0], [0.0, 2.0]]) * 1e-4
    weights, misfit = _first_fit(rows, rows @ true, np.ones(50))
    assert_allclose(weights, true * [[1], [1], [0], [1]], atol=1e-11)
    assert_allclose(misfit, 0, atol=1e-20)
