"""Judging estimators in sessions of touches, and tables from presses of the twin."""

from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.commands.score.errors import together
from smoskin.commands.score.evaluate import Session, _matched, judge, readings
from smoskin.mechanics.sheet.touches import Touches
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.twin.readout import Readout
from tables_of_response import motions, plain, presses, reduced_table


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


@pytest.fixture(scope="module")
def twin(skin):
    """As much of a twin as a session of known motions needs."""
    readout = Readout(skin)
    return SimpleNamespace(
        design=skin,
        sample=lambda motion, rng, temperature: readout.sample(motion, rng, temperature),
    )


def session(skin, count, temperature=25.0):
    where, push = presses(skin, count, seed=21, drag=0.0)
    where = 0.03 + 0.5 * where
    return Session(
        touches=Touches(position=where[:, None], force=push[:, None]),
        motion=motions(skin, where, push),
        temperature=temperature,
    )


def test_every_touch_of_a_session_is_judged(skin, twin):
    estimator = BayesEstimator(
        skin,
        reduced_table(skin),
    )
    found = judge(estimator, twin, session(skin, 12), np.random.default_rng(0))
    assert (found.count == 1).all()
    assert (found.idle == 0).all()
    assert np.median(found.distance) < 2e-3
    assert (np.abs(found.error[:, 4] / found.truth[:, 4]) < 0.05).all()
    both = together([found, found])
    assert len(both.count) == 24
    assert np.array_equal(both.error, np.concatenate([found.error, found.error]))


def test_pairs_are_matched_by_place_whatever_their_order():
    truth = np.array([[0.02, 0.02, 0, 0, -0.3], [0.09, 0.12, 0, 0, -0.6]])
    for order in ([0, 1], [1, 0]):
        values = truth[order] + 1e-3
        assert np.array_equal(values[_matched(values, truth)], truth + 1e-3)


def test_another_number_of_touches_is_an_error_of_count_and_no_place(skin, twin):
    silent = SimpleNamespace(
        reset=lambda: None,
        zero=lambda untouched, force: None,
        step=lambda reading: SimpleNamespace(status=None, contacts=()),
    )
    found = judge(silent, twin, session(skin, 3), np.random.default_rng(0))
    assert (found.count == -1).all()
    assert np.isnan(found.error).all()
    assert not (found.confidence((0, 1)) <= 0.9).any()


def test_creep_and_drift_spoil_readings(skin, twin):
    one = session(skin, 2)
    calm, crept, drifted = (
        np.stack([r.field for r in readings(twin, one, np.random.default_rng(4), **how)])
        for how in (
            {"creep": False, "drift": 0.0},
            {"creep": True, "drift": 0.0},
            {"creep": False, "drift": 50e-6},
        )
    )
    # The first touch is read for the second time at 22, 0.3 s after it came.
    rise = np.linalg.norm(calm[22] - calm[19])
    assert 0.02 * rise < np.linalg.norm(crept[22] - calm[22]) < 0.1 * rise
    assert np.abs(drifted[-1] - calm[-1]).max() > 20e-6
