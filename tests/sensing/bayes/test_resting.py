"""A touch that rests: known where it was read best, given up where it slides, never overstated."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.magnetics import mlx90393
from smoskin.records import Pose, Reading
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.bayes.resting import Resting
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.estimator import ON_AN_ARM
from smoskin.sensing.signals.signals import rest_field
from smoskin.sensing.signals.turning import turning

PLACE = np.array([0.050, 0.070])
EYE = np.eye(2)
sizes = st.floats(0.1, 5.0)


@pytest.fixture(scope="module")
def table():
    pytest.importorskip("safetensors")
    return load_response_table("planar")


def covariance(along, across, turn):
    cosine, sine = math.cos(turn), math.sin(turn)
    axes = np.array([[cosine, -sine], [sine, cosine]])
    return (axes * np.array([along, across]) ** 2 * 1e-6) @ axes.T


@given(*[sizes] * 4, st.floats(0.0, 3.0), st.floats(0.0, 3.0), st.floats(0.01, 5.0))
def test_what_is_joined_is_no_less_sure_than_the_reading(a, b, c, d, turn, other, later):
    resting = Resting(1e-3)
    resting.joined(0.0, PLACE, covariance(a, b, turn))
    spread = covariance(c, d, other)
    place, joined = resting.joined(later, PLACE, spread)
    np.testing.assert_allclose(place, PLACE, rtol=1e-9)
    assert joined.trace() <= spread.trace() * (1 + 1e-9)
    assert np.linalg.eigvalsh(joined).min() > 0.0
    # No surer than both would be whose errors have nothing in common.
    both = np.linalg.inv(covariance(a, b, turn) + 1e-6 * later * EYE) + np.linalg.inv(spread)
    assert np.linalg.eigvalsh(joined - np.linalg.inv(both)).min() >= -1e-9 * joined.trace()


@pytest.mark.parametrize("rate", [10, 200])
def test_the_best_reading_counts_at_any_rate(rate):
    """Errors that grow as the zero is lost: the place stays within the best reading's."""
    rng, first, last, stated = np.random.default_rng(1), [], [], []
    for _ in range(300):
        resting, error = Resting(1e-3), rng.normal(0.0, 0.7e-3, 2)
        goes = rng.normal(0.0, 6e-3, 2)  # m/s: how the zero's loss moves the place
        for k in range(rate // 2 + 1):
            time = k / rate
            spread = (0.7e-3**2 + (6e-3 * time) ** 2) * EYE
            place, joined = resting.joined(time, PLACE + error + goes * time, spread)
        first.append(error)
        last.append(place - PLACE)
        stated.append((place - PLACE) @ np.linalg.solve(joined, place - PLACE) < 4.605)
    without = math.hypot(0.7, 6 * 0.5)
    size = 1e3 * np.sqrt(np.mean(np.square(last)))
    assert 1e3 * np.sqrt(np.mean(np.square(first))) * 0.95 < size < 0.5 * without
    # Wander and luck, which are allowed for, did not take place here.
    assert np.mean(stated) > 0.9
    assert 1e6 * joined.trace() / 2 < 0.5 * without**2


@pytest.mark.parametrize("speed", [0.02, 0.1])
def test_a_touch_that_slides_is_where_it_is_read(speed):
    resting, spread = Resting(1e-3), 0.3e-3**2 * EYE
    for k in range(50):
        where = PLACE + np.array([speed * k / 50, 0.0])
        place, joined = resting.joined(k / 50, where, (1 + 1e-3 * k) * spread)
        np.testing.assert_array_equal(place, where)
        np.testing.assert_array_equal(joined, (1 + 1e-3 * k) * spread)


def test_another_touch_begins_anew():
    """A surer place that was forgotten does not count."""
    resting, less_sure = Resting(1e-3), 25e-6 * EYE
    resting.joined(0.0, PLACE, 1e-8 * EYE)
    assert (resting.joined(0.1, PLACE + 1e-3, less_sure)[0] != PLACE + 1e-3).all()
    resting.forget()
    place, spread = resting.joined(0.1, PLACE + 1e-3, less_sure)
    assert (place == PLACE + 1e-3).all()
    assert (spread == less_sure).all()


def test_every_reading_of_an_arm_that_tells_its_pose_stands_for_itself(planar, table):
    bayes = BayesEstimator(planar, table)
    bayes.carried_by(lambda: Pose(turn=np.eye(3)))
    for time, spread in ((0.0, 1e-8 * EYE), (0.1, 25e-6 * EYE)):
        assert bayes._resting.joined(time, PLACE, spread)[1] is spread


def test_every_reading_stands_for_itself_without_bound():
    resting = Resting(math.inf)
    resting.joined(0.0, PLACE, 1e-8 * EYE)
    place, spread = resting.joined(0.0, PLACE + 1e-4, 25e-6 * EYE)
    assert (place == PLACE + 1e-4).all()
    assert (spread == 25e-6 * EYE).all()


def test_a_force_follows_its_place(planar, table):
    """Gaussian conditioning, sampled: forces of those whose place is drawn anew."""
    bayes = BayesEstimator(planar, table)
    root = np.tril(np.random.default_rng(3).normal(size=(5, 5)))
    spread = (root @ root.T + np.eye(5)) * 1e-6
    bayes._resting.joined(0.0, PLACE, spread[:2, :2] / 30)
    read = np.array([*(PLACE + 1e-4), 0.1, 0.0, -0.5])
    touch, stated = read.copy(), spread.copy()
    bayes._rest(0.2, touch, stated)
    assert stated[:2, :2].trace() < 0.5 * spread[:2, :2].trace()
    rng = np.random.default_rng(0)
    places = rng.multivariate_normal(touch[:2], stated[:2, :2], 200_000)
    slope = spread[2:, :2] @ np.linalg.inv(spread[:2, :2])
    left = spread[2:, 2:] - slope @ spread[:2, 2:]
    forces = read[2:] + (places - read[:2]) @ slope.T
    forces += rng.multivariate_normal(np.zeros(3), left, 200_000)
    drawn = np.hstack([places, forces])
    np.testing.assert_allclose(drawn.mean(axis=0), touch, atol=2e-5)
    np.testing.assert_allclose(np.cov(drawn.T), stated, atol=0.02 * np.abs(stated).max())


def test_a_touch_on_a_turning_arm_stays_as_sure_as_it_landed(planar, table):
    """Weight moves the skin as it turns, by millitesla a radian, so that the zero is lost."""
    modes = {name: getattr(table, name)[:0] for name in ("modes", "grip_modes", "warp_modes")}
    table = replace(table, **modes, misfit=1e-14 * np.eye(9))
    chips = mlx90393.rotations(planar.halls)
    power, axes = np.linalg.eigh(turning(planar).whole)
    weight = (math.sqrt(power[-1]) * axes[:, -1]).reshape(-1, 3)
    touch = table.signals(PLACE[None], np.array([[0.0, 0.0, -0.5]]))[0].reshape(-1, 3)
    spreads = {}
    for wander in (1e-3, math.inf):
        priors = TouchPriors(drag_spread=0.0, wander=wander)
        bayes = BayesEstimator(planar, table, priors=priors, tracking=ON_AN_ARM)
        estimates = []
        for k in range(88):
            turn = 0.8 * (1 - math.cos(0.3 * max(0.1 * k - 2.0, 0.0)))
            field = rest_field(planar) + turn * weight + (k >= 80) * touch
            reading = Reading(time=0.1 * k, field=np.einsum("sji,sj->si", chips, field))
            if k == 0:
                bayes.zero([reading])
            estimates.append(bayes.step(reading))
        assert [len(estimate.contacts) for estimate in estimates] == [0] * 80 + [1] * 8
        spreads[wander] = [estimate.covariance[0][:2, :2].trace() for estimate in estimates[80:]]
    assert spreads[1e-3][0] == spreads[math.inf][0]
    assert spreads[1e-3][-1] < 0.5 * spreads[math.inf][-1]
