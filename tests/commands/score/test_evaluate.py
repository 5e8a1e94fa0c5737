"""Judging estimators in sessions of touches, and tables from presses of the twin."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.commands.score.errors import together
from smoskin.commands.score.evaluate import Session, _matched, judge, readings
from smoskin.mechanics.sheet.touches import Touches
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.twin.readout import Readout
from smoskin.twin.world.effect import Effect, World
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
    answers = judge(estimator, twin, session(skin, 12), np.random.default_rng(0))
    assert (answers.count == 1).all()
    assert (answers.idle == 0).all()
    assert np.median(answers.distance) < 2e-3
    assert (np.abs(answers.error[:, 4] / answers.truth[:, 4]) < 0.05).all()
    both = together([answers, answers])
    assert len(both.count) == 24
    assert np.array_equal(both.error, np.concatenate([answers.error, answers.error]))


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
    answers = judge(silent, twin, session(skin, 3), np.random.default_rng(0))
    assert (answers.count == -1).all()
    assert np.isnan(answers.error).all()
    assert not (answers.confidence((0, 1)) <= 0.9).any()


def test_creep_and_drift_spoil_readings(skin, twin):
    pair = session(skin, 2)
    calm, crept, drifted = (
        np.stack([r.field for r in readings(twin, pair, np.random.default_rng(4), **how).readings])
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


def test_in_other_worlds_readings_come_as_a_stream(skin, twin):
    plain = session(skin, 3)
    other = replace(plain, world=World(name="stream", effects=(Effect(),)), seed=(1,))
    few, many = (readings(twin, s, np.random.default_rng(0)) for s in (plain, other))
    assert (len(few.readings), len(many.readings)) == (20 + 3 * 4, 29 + 3 * 12)
    for heard in (few, many):
        assert heard.idle.sum() == heard.judged.sum() == 3
        at = [heard.readings[k].time for k in np.flatnonzero(heard.judged)]
        assert np.allclose(at, [1.3, 2.3, 3.3])
        assert heard.row[heard.judged].tolist() == heard.row[heard.idle].tolist() == [0, 1, 2]
    assert np.diff([reading.time for reading in many.readings]).max() < 0.11


@pytest.mark.parametrize("plain", [True, False])
@pytest.mark.parametrize(("after", "alone"), [(0.02, (1, 1)), (0.15, (3, 2)), (0.3, (4, 2))])
def test_the_first_touch_of_a_pair_in_turn_is_alone_for_a_time(skin, twin, plain, after, alone):
    both = session(skin, 3)
    first = session(skin, 2).motion[[0, 1, 0]]
    world = {} if plain else {"world": World(name="stream", effects=(Effect(),)), "seed": (1,)}
    pairs = replace(both, before=first, after=after, **world)
    begins = 1.0 + (1.0 + after) * np.arange(3)
    counts = alone[plain], 2 if plain else 4
    heard = readings(twin, pairs, np.random.default_rng(0), creep=False, drift=0.0)
    times = np.array([reading.time for reading in heard.readings])
    fields = np.stack([reading.field for reading in heard.readings])
    assert np.allclose(times[heard.judged], begins + after + 0.3)
    assert np.allclose(times[heard.idle], begins)
    assert heard.row[heard.judged].tolist() == [0, 1, 2]
    rest = fields[:20].mean(axis=0)
    for row, begin in enumerate(begins):
        end = begin + after + 0.001
        within = zip([(begin + 0.01, end), (end, end + 0.3)], (first, both.motion), strict=True)
        for ((since, until), motion), count in zip(within, counts, strict=True):
            some = fields[(times > since) & (times < until)]
            assert len(some) == count
            read = Readout(skin).read(motion[row], None).field
            assert np.abs(some - read).max() < 30e-6 < np.abs(read - rest).max()
        released = fields[(times > end + 0.31) & (times < end + 0.9)]
        assert np.abs(released - rest).max() < 30e-6


def test_a_reading_that_does_not_arrive_leaves_the_answer_before_it(skin, twin):
    class Losing(Effect):
        """Loses the readings at which touches count, and all of the last touch."""

        def arrived(self, readings, rng):
            lost = [29 + 12 * k + 4 for k in range(3)] + list(range(29 + 24 + 1, 29 + 36))
            return [None if k in lost else reading for k, reading in enumerate(readings)]

    lossy = replace(session(skin, 3), world=World(name="lossy", effects=(Losing(),)), seed=(1,))
    estimator = BayesEstimator(skin, reduced_table(skin))
    answers = judge(estimator, twin, lossy, np.random.default_rng(0))
    assert answers.count.tolist() == [1, 1, -1]
    assert answers.idle.tolist() == [0, 0, 0]
    assert (answers.distance[:2] < 5e-3).all()
