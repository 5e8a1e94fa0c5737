"""Training networks: the loss, what is held out, what a killed training goes on to."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from networks import TINY, random_network, tiny_network
from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.sensing.network.samples import Lessons, TouchSource, TouchSpread, TrainingEffort
from smoskin.sensing.network.training import HeldOut, Trained, likelihood_loss, train_network
from smoskin.sensing.signals.signals import signal_noise
from tables_of_response import plain, reduced_table, table_with_modes

SHORT = replace(TINY, epochs=3, steps=5)


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def touches(skin, seed=77, drag=0.0, table=None):
    """That no training has seen."""
    table = table or reduced_table(skin)
    source = TouchSource(table, signal_noise(skin), TouchSpread(drag=drag, margin=0.0))
    return source.draw(np.random.default_rng(seed), 40, 40)


class Killed(Exception):
    pass


def killer(after):
    """A progress that kills the training after so many epochs."""
    calls = []

    def progress(what, share):
        calls.append(what)
        if len(calls) > after:
            raise Killed

    return progress


@pytest.mark.parametrize("drag", [0.0, 0.5])
def test_the_loss_is_the_normal_likelihood(drag):
    model = random_network(drag=drag, members=2)
    rng = np.random.default_rng(3)
    # Near the middle, where random weights state moderate spreads.
    inputs = 0.1 * rng.normal(size=(6, 7)).astype(np.float32)
    targets = rng.normal(size=(6, len(model.middle))).astype(np.float32)
    count, expected = len(model.middle), []
    for member in range(2):
        hidden = inputs.astype(float)
        for layer in model.layers[:-1]:
            sums = hidden @ layer.weights[member] + layer.bias[member]
            hidden = sums / (1 + np.exp(-sums))
        outputs = hidden @ model.layers[-1].weights[member] + model.layers[-1].bias[member]
        for row, target in zip(outputs, targets, strict=True):
            factor = np.eye(count)
            factor[np.tril_indices(count, -1)] = row[2 * count :]
            factor *= np.exp(np.clip(row[count : 2 * count], -9, 2))[:, None]
            normal = multivariate_normal(row[:count], factor @ factor.T)
            expected.append(-normal.logpdf(target))
    loss = float(likelihood_loss([tuple(layer) for layer in model.layers], inputs, targets))
    assert loss == pytest.approx(np.mean(expected), rel=1e-4)


def test_some_seconds_of_training_find_touches(skin):
    model, drawn = tiny_network(skin), touches(skin)
    predicted = model.predict(drawn.signals)
    apart = np.hypot(*(predicted.values - drawn.values)[:, :2].T)
    # Whoever knows nothing is off by some 50 mm.
    assert np.median(apart) < 5e-3
    force = np.abs(predicted.values[:, 4] / drawn.values[:, 4] - 1)
    assert np.median(force) < 0.1
    assert model.design_hash == skin.content_hash
    assert [metric.unit for metric in model.metrics] == ["m", "1", "1"]
    assert model.metrics[0].value < 10e-3
    assert (predicted.novelty < 1).all()


def test_a_network_far_worse_than_can_be_is_warned_of(skin):
    model = tiny_network(skin)
    error = model.metrics[0].value
    nothing = HeldOut(np.zeros((0, 2)), np.zeros((0, 5)), np.zeros((0, 5)))
    fine, poor = (Trained(model, (), "", error / part, nothing) for part in (2, 4))
    assert fine.warning == ""
    text = f"held-out touches are {1e3 * error:.2f} mm off, where noise and the spread of skins "
    assert poor.warning == f"{text}leave {250 * error:.2f} mm; train longer"


@pytest.mark.slow
def test_what_is_attainable_is_the_bound_of_noise_and_spread(skin):
    table, effort = table_with_modes(skin), replace(SHORT, epochs=1)
    wide = train_network(skin, table, effort=effort)
    close = train_network(skin, reduced_table(skin), effort=effort)
    dragged = train_network(skin, table, spread=TouchSpread(drag=0.3), effort=effort)
    assert 1e-5 < close.attainable < wide.attainable < dragged.attainable < 0.05
    assert wide.as_json()["attainable_place_error_mm"] == round(1e3 * wide.attainable, 4)


def test_stated_regions_hold_what_they_state(skin):
    model, drawn = tiny_network(skin), touches(skin, seed=78)
    predicted = model.predict(drawn.signals)
    apart = predicted.values - drawn.values
    place = np.linalg.solve(predicted.covariance[:, :2, :2], apart[:, :2, None])[..., 0]
    inside = (place * apart[:, :2]).sum(axis=1) <= 4.605
    assert 0.86 < inside.mean() < 0.94
    sure = np.abs(apart[:, 4]) <= 1.645 * np.sqrt(predicted.covariance[:, 4, 4])
    assert 0.86 < sure.mean() < 0.94


def test_drags_are_told_where_they_are_trained(skin):
    model, drawn = tiny_network(skin, drag=0.4), touches(skin, seed=79, drag=0.4)
    predicted = model.predict(drawn.signals)
    off = np.hypot(*(predicted.values - drawn.values)[:, 2:4].T)
    firm = drawn.values[:, 4] < -0.3
    assert np.median(off[firm]) < 0.1
    assert [metric.name for metric in model.metrics][-1] == "mean error of the drag"


def test_fewer_chips_are_enough(skin):
    model = tiny_network(skin, chips=(1, 2))
    assert model.chips == (1, 2)
    drawn = touches(skin, table=reduced_table(skin))
    predicted = model.predict(drawn.signals[:, 3:])
    assert np.median(np.hypot(*(predicted.values - drawn.values)[:, :2].T)) < 10e-3


def test_held_out_touches_are_of_skins_that_no_lesson_holds(skin):
    source = TouchSource(table_with_modes(skin), signal_noise(skin))
    lessons = Lessons(skin, source, SHORT, None)
    taught = {row.tobytes() for k in range(3) for row in lessons.epoch(k)[1].reshape(-1, 3)}
    assert len(taught) == 3 * SHORT.steps * SHORT.batch
    sets = [lessons.held_out(which).values for which in range(3)]
    kept = {row.tobytes() for values in sets for row in values}
    assert len(kept) == sum(len(values) for values in sets)
    assert not taught & {row.tobytes() for row in lessons.judges[1]}


@pytest.mark.slow
def test_a_killed_training_goes_on_to_the_same_numbers(skin, tmp_path):
    whole = train_network(skin, reduced_table(skin), effort=SHORT)
    checkpoint, curve = tmp_path / "checkpoint", tmp_path / "curve.jsonl"
    with pytest.raises(Killed):
        train_network(
            skin, reduced_table(skin), effort=SHORT, checkpoint=checkpoint, progress=killer(0)
        )
    assert not checkpoint.exists()
    with pytest.raises(Killed):
        train_network(
            skin,
            reduced_table(skin),
            effort=SHORT,
            checkpoint=checkpoint,
            curve=curve,
            progress=killer(2),
        )
    assert len(curve.read_text().splitlines()) == 2
    resumed = train_network(
        skin, reduced_table(skin), effort=SHORT, checkpoint=checkpoint, curve=curve
    )
    for old, new in zip(whole.model.layers, resumed.model.layers, strict=True):
        assert np.array_equal(old.weights, new.weights)
        assert np.array_equal(old.bias, new.bias)
    assert np.array_equal(whole.model.stretch, resumed.model.stretch)
    assert whole.model.metrics == resumed.model.metrics
    points = [json.loads(line) for line in curve.read_text().splitlines()]
    assert [point["epoch"] for point in points] == [1, 2, 3]
    assert [point["held_out"] for point in points] == [point.held_out for point in whole.curve]
    assert resumed.ended == "all 3 epochs are done"
    again = train_network(skin, reduced_table(skin), effort=SHORT, checkpoint=checkpoint)
    assert len(again.curve) == 3


def test_a_training_comes_to_the_same_numbers_as_ever(skin):
    trained = train_network(
        skin,
        table_with_modes(skin),
        spread=TouchSpread(drag=0.4),
        creep=Prony(moduli=[0.2], times=[1.0]),
        effort=replace(SHORT, seed=3),
    )
    curve = np.array([(point.rate, point.training, point.held_out) for point in trained.curve])
    assert curve == pytest.approx(
        np.array(
            [[0.03, 6.387930, 7.042854], [0.0225, 4.293190, 6.687706], [0.0075, 3.259781, 6.355938]]
        ),
        rel=2e-3,
    )
    model, held_out = trained.model, trained.held_out
    assert trained.attainable == pytest.approx(6.1455580e-3, rel=1e-5)
    apart = np.hypot(*held_out.errors[:, :2].T)
    assert apart.mean() == pytest.approx(model.metrics[0].value)
    stated = held_out.errors[:, 4] / held_out.scaled[:, 4]
    assert (stated > 0).all()
    assert 0.86 < (np.abs(held_out.scaled[:, 4]) <= 1.645).mean() < 0.94  # regions of 90 %
    assert model.stretch == pytest.approx([0.8294, 0.8294, 1.0387, 1.0141, 0.9680], rel=0.01)
    assert model.reach == pytest.approx(8.9591, rel=1e-3)
    assert np.abs(model.whitener).sum() == pytest.approx(16.3152, rel=1e-3)
    assert model.middle == pytest.approx(
        [0.060674, 0.080426, 0.383672, -0.395121, 5.972017], rel=1e-4
    )
    assert model.size == pytest.approx([0.036296, 0.047826, 103.1005, 104.8064, 0.803747], rel=1e-3)
    figures = [metric.value for metric in model.metrics]
    assert figures == pytest.approx([0.047646, 0.353946, 0.913768, 0.146439], rel=0.01)
    assert (model.drag, model.floor) == (0.4, 1e-6)
    table = table_with_modes(skin)
    assert (model.forces, model.softening) == (table.forces, table.softening)
    assert model.split == (
        "skins of their own: 128 to end training, 128 for the spread, 128 for the figures, of 96 "
        "touches each"
    )


def test_usual_sizes_are_those_that_are_told():
    usual = TrainingEffort()
    assert (usual.members, usual.width, usual.depth) == (4, 64, 3)
    assert (usual.epochs, usual.steps, usual.batch, usual.touches) == (60, 200, 1024, 64)
    assert (usual.rate, usual.patience, usual.seconds, usual.seed) == (1e-2, 12, np.inf, 0)
    spread = TouchSpread()
    assert (spread.margin, spread.drag, spread.straight, spread.uneven) == (2.5e-3, 0.0, 0.4, 0.5)
    assert (spread.temperatures, spread.drift) == ((15.0, 35.0), 0.5e-6)


def test_a_checkpoint_of_another_training_is_refused(skin, tmp_path):
    checkpoint = tmp_path / "checkpoint"
    train_network(skin, reduced_table(skin), effort=SHORT, checkpoint=checkpoint)
    for change in ({"effort": replace(SHORT, seed=1)}, {"spread": TouchSpread(drift=1e-6)}):
        with pytest.raises(ModelError, match="must be of this training"):
            train_network(
                skin, reduced_table(skin), checkpoint=checkpoint, **({"effort": SHORT} | change)
            )
    more = train_network(
        skin, reduced_table(skin), effort=replace(SHORT, seconds=1e6), checkpoint=checkpoint
    )
    assert len(more.curve) == 3


def test_it_ends_when_nothing_is_gained(skin):
    flat = replace(SHORT, epochs=50, rate=1e-12, patience=3)
    ended = train_network(skin, reduced_table(skin), effort=flat)
    assert len(ended.curve) < 50
    assert ended.ended == "3 epochs gained nothing on held-out skins"


def brief(skin, seconds, **files):
    """A training whose clock goes on by a second whenever it is looked at."""
    effort, ticks = replace(SHORT, epochs=50, seconds=seconds), itertools.count()
    table = reduced_table(skin)
    return train_network(skin, table, effort=effort, clock=lambda: float(next(ticks)), **files)


def test_it_leaves_time_for_its_end_as_its_beginning_took(skin, tmp_path):
    heard = []
    trained = brief(
        skin, 10.0, checkpoint=tmp_path / "checkpoint", progress=lambda *event: heard.append(event)
    )
    assert [what for what, _ in heard] == [
        "learning",
        *(
            f"epoch {point.epoch}, {point.held_out:.3f} nats on held-out skins"
            for point in trained.curve[:-1]
        ),
        "stopped: its 10 s are over",
    ]
    assert [share for _, share in heard] == sorted(share for _, share in heard)
    # Held-out touches took one second, the end takes three, each epoch one.
    assert [point.seconds for point in trained.curve] == [2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    assert trained.ended == "its 10 s are over"
    assert trained.curve[-1].rate < 0.3 * trained.curve[0].rate
    more = brief(skin, 15.0, checkpoint=tmp_path / "checkpoint")
    assert [point.seconds for point in more.curve[6:]] == [9.0, 10.0, 11.0, 12.0]
    events = []
    short = brief(skin, 4.0, progress=lambda what, share: events.append((what, share)))
    assert len(short.curve) == 1
    assert events == [("learning", pytest.approx(0.0, abs=0.5)), (f"stopped: {short.ended}", 1.0)]
    assert short.ended == "its 4 s are over: the first epoch, which compiles, took most of them"


def test_one_goes_on_from_another(skin):
    first = tiny_network(skin)
    gentle = replace(SHORT, epochs=1, rate=1e-4)
    fresh = train_network(skin, reduced_table(skin), effort=gentle)
    tuned = train_network(skin, reduced_table(skin), effort=gentle, start=first)
    assert tuned.curve[-1].held_out < fresh.curve[-1].held_out - 1
    assert tuned.model.members == first.members
    assert np.array_equal(tuned.model.centre, first.centre)
    for wrong, message in (
        (random_network(chips=(0, 1, 2)), "start must be of the same design"),
        (random_network(design_hash=skin.content_hash, chips=(0, 1)), "and chips"),
        (random_network(drag=0.1, design_hash=skin.content_hash, chips=(0, 1, 2)), "know drags"),
    ):
        with pytest.raises(ModelError, match=message):
            train_network(skin, reduced_table(skin), effort=gentle, start=wrong)


def test_wrong_use_is_refused(skin, planar):
    with pytest.raises(ModelError, match="table must be of the design"):
        train_network(planar, reduced_table(skin), effort=SHORT)
    for change, message in (
        ({"members": 0}, "members must be at least 1"),
        ({"depth": 1}, "depth must be at least 2"),
        ({"rate": 0.0}, "rate must be"),
        ({"seconds": -1.0}, "seconds must be"),
        ({"touches": 77}, "whole skins"),
    ):
        with pytest.raises(ArgumentError, match=message):
            TrainingEffort(**change)
