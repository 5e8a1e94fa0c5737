"""Likelihood of labelled touches against the joint normal density, written out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from smoskin.sensing.response.calibrate import LabelledTouches, label_noise
from smoskin.sensing.response.evidence import STRETCHES, Evidence
from tables_of_response import random_table, random_touches

NOISE = 1e-12 * (np.eye(9) + 0.3)


@pytest.fixture(scope="module")
def joint():
    """Touches, their evidence, and the mean and covariance of all signals at a stretch of 4."""
    table = random_table()
    place, force = random_touches(6, seed=4)
    rng = np.random.default_rng(0)
    signals = table.signals(place, force)
    signals = signals + 1e-6 * rng.normal(size=signals.shape)
    touches = LabelledTouches(
        position=place,
        force=force,
        signals=signals.reshape(6, -1, 3),
        place_spread=2e-4,
        force_spread=5e-3,
    )
    flat = table.mode_signals(place, force).swapaxes(1, 2).reshape(54, -1)
    covariance = flat @ flat.T
    own = NOISE + label_noise(table, place, force, (2e-4, 5e-3))
    own = own + 16 * (force**2).sum(axis=1)[:, None, None] * table.misfit
    for n in range(6):
        part = slice(9 * n, 9 * n + 9)
        covariance[part, part] += own[n]
    mean = table.signals(place, force).ravel()
    return signals, Evidence(table, touches, NOISE), mean, covariance


def test_evidence_is_the_joint_density(joint):
    signals, evidence, mean, covariance = joint
    stretch = STRETCHES.tolist().index(4.0)
    other = signals + 1e-6
    got = evidence.of(np.array([signals, other]))[:, stretch]
    density = multivariate_normal(mean, covariance, allow_singular=True)
    constant = 27 * np.log(2 * np.pi)
    want = [density.logpdf(given.ravel()) + constant for given in (signals, other)]
    assert_allclose(got, want, rtol=1e-6)


def test_what_the_others_foretell_is_the_conditional_normal(joint):
    signals, evidence, mean, covariance = joint
    left = evidence.left_out(signals, STRETCHES.tolist().index(4.0))
    mine, rest = np.arange(18, 27), np.r_[0:18, 27:54]
    gain = covariance[np.ix_(mine, rest)] @ np.linalg.inv(covariance[np.ix_(rest, rest)])
    off = signals.ravel() - mean
    size = np.abs(off).max()
    assert_allclose(left.residual[2], off[mine] - gain @ off[rest], atol=1e-6 * size)
    want = covariance[np.ix_(mine, mine)] - gain @ covariance[np.ix_(rest, mine)]
    assert_allclose(left.covariance[2], want, rtol=1e-5, atol=1e-6 * np.abs(want).max())
    white = left.residual[2] @ np.linalg.solve(want, left.residual[2])
    assert left.squared[2] == pytest.approx(white, rel=1e-4)


@pytest.mark.parametrize("odd", [1e2, 1e4, 1e6])
def test_without_its_label_a_touch_may_be_off_by_10_to_1000_deviations(joint, odd):
    signals, evidence, mean, covariance = joint
    stretch = STRETCHES.tolist().index(4.0)
    left = evidence.left_out(signals, stretch)
    rest = np.r_[0:18, 27:54]
    away = np.sqrt(odd) * np.linalg.cholesky(left.covariance[2]).sum(axis=1)
    spoilt = signals.copy()
    spoilt[2] += away - left.residual[2]
    got = evidence.without_label(spoilt)[2, stretch]
    others = multivariate_normal(
        mean[rest], covariance[np.ix_(rest, rest)], allow_singular=True
    ).logpdf(signals.ravel()[rest])
    wide = [
        multivariate_normal(np.zeros(9), factor * left.covariance[2]).logpdf(away)
        for factor in (1e2, 1e4, 1e6)
    ]
    assert np.argmax(wide) == {1e2: 0, 1e4: 1, 1e6: 2}[odd]
    assert got == pytest.approx(others + max(wide) + 27 * np.log(2 * np.pi), rel=1e-5)
