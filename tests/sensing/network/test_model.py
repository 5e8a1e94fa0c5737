"""Networks at run time: what an ensemble says, what is believed, files, and the estimator."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors.numpy import load_file, save_file

from networks import random_network, tiny_network
from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.records import Contact, Reading, Status
from smoskin.sensing.learned.gaussian_process import Prediction
from smoskin.sensing.learned.inputs import direction_and_strength
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import Ensemble, Layer, load_network
from smoskin.sensing.signals.loops import Loops
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import plain

TOUCH = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))


def test_weights_are_copies_that_nobody_changes():
    model = random_network()
    for part in (part for layer in model.layers for part in layer):
        assert part.dtype == np.float32
        assert not part.flags.writeable
    given = [Layer(*(np.array(part) for part in layer)) for layer in model.layers]
    kept = replace(model, layers=tuple(given))
    given[0].weights[:] = 0.0
    np.testing.assert_array_equal(kept.layers[0].weights, model.layers[0].weights)


@pytest.mark.parametrize(("weight", "kept"), [(0.99e6, True), (-1.01e6, False), (1.01e6, False)])
@pytest.mark.parametrize("part", [0, 1])
def test_weights_reach_a_million(weight, kept, part):
    model = random_network()
    layers = [[np.array(array) for array in layer] for layer in model.layers]
    layers[1][part].flat[3] = weight
    heavy = tuple(Layer(*layer) for layer in layers)
    if kept:
        assert replace(model, layers=heavy).layers[1][part].flat[3] == np.float32(weight)
        return
    with pytest.raises(ModelError, match=r"network: weights must lie within -1e\+06 and 1e\+06"):
        replace(model, layers=heavy)


def some_signals(count, columns=6, seed=1):
    return 1e-3 * np.random.default_rng(seed).normal(size=(count, columns))


def one_by_one(model, signals, temperature):
    """Each member for itself, in double precision, and the moments of their mixture."""
    length = np.sqrt(signals @ signals + model.floor**2)
    row = (np.array([*signals / length, np.log(length)]) - model.centre) / model.scale
    count = len(model.middle)
    means, squares = [], []
    for member in range(model.members):
        hidden = row
        for layer in model.layers[:-1]:
            sums = hidden @ layer.weights[member].astype(float) + layer.bias[member, 0]
            hidden = sums / (1 + np.exp(-sums))
        last = model.layers[-1]
        outputs = hidden @ last.weights[member].astype(float) + last.bias[member, 0]
        factor = np.eye(count)
        shares = iter(outputs[2 * count :])
        for i in range(count):
            for j in range(i):
                factor[i, j] = next(shares)
        factor *= np.exp(np.clip(outputs[count : 2 * count], -9, 2))[:, None]
        means.append(outputs[:count])
        squares.append(factor @ factor.T)
    mean = np.mean(means, axis=0)
    spread = np.mean(squares, axis=0) + np.cov(np.array(means).T, ddof=0)
    natural = model.middle + model.size * mean
    strength = length * (1 + model.softening * (temperature - 25.0))
    force = -strength * np.exp(natural[-1])
    turn = [1, 1, *([strength] * 2 if model.drag else []), force] * model.size * model.stretch
    drags = strength * natural[2:4] if model.drag else np.zeros(2)
    covariance = np.zeros((5, 5))
    covariance[np.ix_(model.rows, model.rows)] = spread * np.outer(turn, turn)
    return np.array([*natural[:2], *drags, force]), covariance


@pytest.mark.parametrize("drag", [0.0, 0.5])
@pytest.mark.parametrize("temperature", [25.0, 12.0])
def test_an_ensemble_says_the_moments_of_its_members_mixture(drag, temperature):
    model, signals = random_network(drag=drag), some_signals(5)
    moments = model.predict(signals, temperature)
    for k, row in enumerate(signals):
        values, covariance = one_by_one(model, row, temperature)
        size = np.sqrt(np.diag(covariance))
        assert moments.values[k] == pytest.approx(values, rel=1e-5, abs=1e-6)
        assert np.abs(moments.covariance[k] - covariance).max() <= 1e-5 * np.outer(size, size).max()


@given(
    drag=st.sampled_from([0.0, 0.4]),
    members=st.integers(1, 5),
    width=st.integers(1, 20),
    depth=st.integers(2, 4),
    chips=st.sampled_from([(1, 2), (0, 1, 2), (0, 1, 2, 3)]),
    seed=st.integers(0, 99),
)
def test_one_touch_at_a_time_is_the_same(drag, members, width, depth, chips, seed):
    model = random_network(drag, members, width, depth, chips, seed)
    signals = some_signals(3, 3 * len(chips), seed)
    many, ensemble = model.predict(signals, 31.0), Ensemble(model)
    for k, row in enumerate(signals):
        values, covariance, novelty = (part[0] for part in ensemble.predict(row[None], 31.0))
        size = np.sqrt(np.diag(many.covariance[k]))
        assert values == pytest.approx(many.values[k], rel=1e-5, abs=1e-6)
        assert (np.abs(covariance - many.covariance[k]) <= 1e-4 * np.outer(size, size)).all()
        assert novelty == pytest.approx(many.novelty[k])
        assert np.linalg.eigvalsh(covariance).min() >= -1e-9 * size.max() ** 2


def test_harder_and_warmer_touches_keep_their_direction():
    signals = some_signals(4)
    soft, hard = (direction_and_strength(factor * signals, 1e-9)[0] for factor in (1.0, 20.0))
    assert hard[:, :6] == pytest.approx(soft[:, :6], abs=1e-9)
    assert hard[:, 6] - soft[:, 6] == pytest.approx(np.log(20.0))
    model = random_network(drag=0.5)
    cold, warm = model.predict(signals, 25.0), model.predict(signals, 35.0)
    assert warm.values[:, :2] == pytest.approx(cold.values[:, :2])
    assert warm.values[:, 2:] == pytest.approx(1.03 * cold.values[:, 2:])


def test_no_signal_at_all_is_finite():
    predicted = random_network().predict(np.zeros((1, 6)))
    assert all(np.isfinite(part).all() for part in predicted)


def test_a_file_holds_the_whole_model(tmp_path):
    model, path = random_network(drag=0.3, depth=3), tmp_path / "network.safetensors"
    model.save(path)
    again = load_network(path)
    for name in ("design_hash", "chips", "reach", "forces", "drag", "floor", "softening",
                 "data_sha256", "split", "metrics"):  # fmt: skip
        assert getattr(again, name) == getattr(model, name)
    before, after = (network.predict(some_signals(5), 20.0) for network in (model, again))
    for old, new in zip(before, after, strict=True):
        assert np.array_equal(old, new)


def test_other_and_damaged_files_are_refused(tmp_path):
    path = tmp_path / "network.safetensors"
    with pytest.raises(ModelError, match="cannot be read as a network file"):
        load_network(path)
    save_file({"a": np.zeros(3)}, path, metadata={"x": "y"})
    with pytest.raises(ModelError, match="a network file of this package must be given"):
        load_network(path)
    random_network().save(path)
    arrays = load_file(path)
    for text, message in (("{", "damaged"), (json.dumps({"format": 9}), "format must be 1"),
                       (json.dumps({"format": 1}), "damaged")):  # fmt: skip
        save_file(arrays, path, metadata={"smoskin_network": text})
        with pytest.raises(ModelError, match=message):
            load_network(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"centre": np.zeros(6)}, "centre must have shape"),
        ({"size": np.array([1.0, np.nan, 1.0])}, "size must be finite"),
        ({"scale": np.zeros(7)}, "scale must be positive"),
        ({"reach": 0.0}, "reach must be positive"),
        ({"forces": (1.0, 0.5)}, "forces must rise"),
        ({"layers": ()}, "two or more hidden layers"),
        ({"layers": random_network(chips=(0, 1, 2)).layers}, "must have 7 inputs"),
        ({"drag": 0.5}, "middle must have shape"),
    ],
)
def test_a_model_that_does_not_fit_itself_is_refused(change, message):
    with pytest.raises(ModelError, match=message):
        replace(random_network(), **change)


def test_weights_that_are_not_numbers_are_refused():
    layers = random_network().layers
    broken = Layer(np.full_like(layers[0].weights, np.nan), layers[0].bias)
    with pytest.raises(ModelError, match="weights must be finite"):
        replace(random_network(), layers=(broken, *layers[1:]))


def test_wrong_use_is_refused(planar):
    model = random_network(design_hash=planar.content_hash)
    with pytest.raises(ArgumentError, match="signals must have shape"):
        model.predict(np.zeros((2, 9)))
    with pytest.raises(ArgumentError, match="false_alarms"):
        NetworkEstimator(planar, model, false_alarms=1.0)
    with pytest.raises(ModelError, match="model must be of the design"):
        NetworkEstimator(planar, random_network())


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def zeroed(skin, model):
    """The estimator of a network, creep left as it is."""
    estimator = NetworkEstimator(skin, model, creep=ELASTIC)
    estimator.zero([ReducedTwin(skin, seed=None).read()])
    return estimator


@pytest.mark.slow
def test_it_tells_touches_from_none(skin):
    twin = ReducedTwin(skin, seed=3)
    estimator = NetworkEstimator(skin, tiny_network(skin), creep=ELASTIC)
    estimator.zero([twin.read(time=-1 + 0.01 * k) for k in range(50)])
    for k in range(20):
        assert estimator.step(twin.read(time=0.2 * k)).status is Status.NO_CONTACT
        estimate = estimator.step(twin.read([TOUCH], time=0.2 * k + 0.1))
        assert estimate.status is Status.CONTACT
        (contact,), (spread,) = estimate.contacts, estimate.covariance
        off = contact.position - TOUCH.position
        assert np.abs(off).max() < 5e-3
        assert contact.normal_force == pytest.approx(0.5, rel=0.08)
        assert contact.force[:2].tolist() == [0.0, 0.0]
        assert off @ np.linalg.solve(spread[:2, :2], off) < 16
        assert not spread[2:4].any()
        assert 0 < spread[4, 4] < 0.05**2


def test_readings_are_believed_up_to_a_novelty_of_one(skin, monkeypatch):
    model, reading = tiny_network(skin), ReducedTwin(skin, seed=None).read([TOUCH])
    seen, whole = [], Ensemble.predict

    def predict(self, *given):
        seen.append(whole(self, *given))
        return seen[-1]

    monkeypatch.setattr(Ensemble, "predict", predict)
    assert zeroed(skin, model).step(reading).status is Status.CONTACT
    distance = seen[-1].novelty[0] * model.reach
    for reach, status in ((1.001, Status.CONTACT), (0.999, Status.OUT_OF_RANGE)):
        own = replace(model, reach=reach * distance)
        estimator = zeroed(skin, own)
        estimate = estimator.step(reading)
        assert estimate.status is status
        assert len(estimate.contacts) == (status is Status.CONTACT)


def test_hysteresis_of_its_skin_is_undone(skin, tmp_path):
    reading = ReducedTwin(skin, seed=None).read([TOUCH])
    elastic = zeroed(skin, tiny_network(skin))
    bend = elastic._signals.straightening
    straight = bend.straightened(elastic._signals.step(reading).values.ravel())
    # A touch far past all plays draws each along, a play behind it.
    loops = Loops(weights=[0.06, 0.08], plays=[0.1, 0.3], reach=np.abs(straight) / 2)
    model = replace(tiny_network(skin), loops=loops)
    whole = bend.bent((1 + (0.06 * 0.1 + 0.08 * 0.3) / 2) * straight)
    expected = model.predict(whole[None]).values[0]
    model.save(tmp_path / "looped")
    kept = load_network(tmp_path / "looped")
    assert kept.loops.as_json() == loops.as_json()
    (contact,) = zeroed(skin, kept).step(reading).contacts
    assert [*contact.position, *contact.force] == pytest.approx(expected, rel=1e-6)
    assert contact.normal_force > -1.01 * model.predict(bend.bent(straight)[None]).values[0, 4]
    with pytest.raises(ModelError, match="network: loops must be of its 9 signals; got 6"):
        replace(model, loops=loops.of_signals(list(range(6))))


def test_numbers_that_are_none_are_no_answer(skin, monkeypatch):
    estimator = zeroed(skin, tiny_network(skin))
    answer = Prediction(np.full((1, 5), np.nan), np.eye(5)[None], np.zeros(1))
    monkeypatch.setattr(Ensemble, "predict", lambda self, *given: answer)
    reading = ReducedTwin(skin, seed=None).read([TOUCH])
    assert estimator.step(reading).status is Status.OUT_OF_RANGE


def test_signals_unlike_those_of_training_are_not_believed(skin):
    twin = ReducedTwin(skin, seed=None)
    estimator = zeroed(skin, tiny_network(skin))
    usual = twin.read([TOUCH])
    assert estimator.step(usual).status is Status.CONTACT
    # As strong as a touch, on one chip alone.
    field = twin.read().field.copy()
    field[0] += [0.0, 0.0, 10e-3]
    strange = Reading(time=1.0, field=field, temperature=usual.temperature)
    assert estimator.step(strange).status is Status.OUT_OF_RANGE
