"""Training: the search's gradient, what a Gaussian process obeys, and honesty of figures."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from learned_examples import cycles, presses
from smoskin.errors import ArgumentError
from smoskin.sensing.learned.gaussian_process import Output
from smoskin.sensing.learned.inputs import Encoding, Form, Past
from smoskin.sensing.learned.training import (
    FittingEffort,
    _judge,
    negative_log_posterior,
    train_model,
)

LITTLE = FittingEffort(rows=600, evidence_rows=150, iterations=15)


@pytest.fixture
def problem():
    rng = np.random.default_rng(1)
    return (
        rng.normal(0.0, 0.4, 8),
        rng.normal(size=(25, 4)),
        rng.normal(size=(25, 2)),
        rng.uniform(0.2, 3.0, 25),
        0.7,
    )


def test_the_gradient_is_that_of_the_value(problem):
    vector, *rest = problem
    _, gradient = negative_log_posterior(vector, *rest)
    steps = 1e-6 * np.eye(len(vector))
    differences = [
        (
            negative_log_posterior(vector + h, *rest)[0]
            - negative_log_posterior(vector - h, *rest)[0]
        )
        / 2e-6
        for h in steps
    ]
    np.testing.assert_allclose(gradient, differences, atol=1e-8)


def test_the_value_is_the_density_of_a_multivariate_normal(problem):
    vector, x, y, faintness, usual = problem
    lengths, (amplitude, linear, floor, faint) = np.exp(vector[:4]), np.exp(vector[4:])
    r = np.linalg.norm((x[:, None] - x[None]) / lengths, axis=-1)
    covariance = amplitude**2 * (1 + r) * np.exp(-r) + linear**2 * (1 + x @ x.T)
    covariance += np.diag(floor**2 + faint**2 * faintness + 1e-8)
    log_density = multivariate_normal(np.zeros(25), covariance).logpdf(y.T).sum()
    # Lengths are usual ones, and the noise 5 % of the targets, each to a factor of e.
    prior = 0.5 * (((vector[:4] - usual) ** 2).sum() + ((vector[-2:] + 3.0) ** 2).sum())
    expected = (-log_density - 25 * np.log(2 * np.pi) + prior) / 25
    assert negative_log_posterior(*problem)[0] == pytest.approx(expected, rel=1e-9)


def test_location_is_found_at_places_never_seen():
    examples = presses()
    apart = examples.group % 7 == 3
    encoding = Encoding(chips=(0, 1, 2), form=Form.DIRECTION)
    model = train_model(examples.where(~apart), encoding, effort=LITTLE)
    predicted = model.predict(examples.encode(encoding)[apart])
    miss = np.linalg.norm(predicted.values - examples.targets[apart], axis=1)
    assert miss.mean() < 0.3e-3  # on places 2.5 mm apart
    metrics = {metric.name: metric for metric in model.metrics}
    assert set(metrics) == {"rmse_x", "rmse_y", "mean_error"}
    assert metrics["mean_error"].unit == "m"
    assert 0.5 < metrics["mean_error"].value / miss.mean() < 2


def test_faint_fields_are_said_to_be_less_certain():
    examples = presses(noise=5e-6)
    encoding = Encoding(chips=(0, 1, 2), form=Form.DIRECTION)
    model = train_model(examples, encoding, effort=LITTLE)
    inputs = model.encoding.encode(
        np.zeros(2), examples.field[:1] * np.array([1, 0.3])[:, None, None]
    )
    variance = model.predict(inputs).covariance[:, 0, 0]
    assert variance[1] > 3 * variance[0]


def test_the_past_shows_what_the_present_field_does_not():
    examples = cycles()
    first = examples.run == 0
    errors = []
    for memory in ((), (1.0,)):
        encoding = Encoding(chips=(0, 2), time_constants=memory)
        model = train_model(examples.where(first), encoding, effort=LITTLE, place=(0.01, 0.01))
        other = ~first & examples.known
        predicted = model.predict(examples.encode(encoding)[other]).values
        errors.append(np.sqrt(np.mean((predicted - examples.targets[other]) ** 2)))
    assert errors[1] < 0.2 * errors[0]
    assert [metric.name for metric in model.metrics] == ["rmse_fz"]


def test_the_same_seed_gives_the_same_model_and_another_seed_another():
    examples, encoding = presses(passes=2), Encoding(chips=(0, 1), form=Form.DIRECTION)
    first, again, other = (
        train_model(examples, encoding, effort=LITTLE, seed=seed) for seed in (4, 4, 5)
    )
    assert np.array_equal(first.weights, again.weights)
    assert first.metrics == again.metrics
    assert first.data_sha256 == other.data_sha256
    assert not np.array_equal(first.scale, other.scale)
    changed = replace(examples, field=examples.field * 1.0000001)
    assert changed.sha256() != examples.sha256()


@pytest.mark.parametrize("outputs", [(Output.X,), (Output.X, Output.Y, Output.FZ)])
def test_a_distance_is_told_where_both_of_x_and_y_are(outputs):
    examples = presses(passes=1)
    columns = np.column_stack([examples.targets, examples.field[:, 0, 2]])
    model = train_model(
        replace(examples, targets=columns[:, : len(outputs)], outputs=outputs),
        Encoding(chips=(0,)),
        effort=LITTLE,
    )
    names = [metric.name for metric in model.metrics]
    assert names == [f"rmse_{output.name.lower()}" for output in outputs] + ["mean_error"] * (
        len(outputs) == 3
    )


def test_rows_beyond_the_limit_are_left_out():
    model = train_model(presses(), Encoding(chips=(0,)), effort=replace(LITTLE, rows=50))
    assert model.support.shape == (50, 3)


def test_progress_ends_complete():
    heard = []
    train_model(
        presses(passes=1),
        Encoding(chips=(0,)),
        effort=LITTLE,
        progress=lambda what, share: heard.append((what, share)),
    )
    assert heard[-1] == ("final fit", 1.0)
    assert all(0 <= share <= 1 for _, share in heard)
    steps = [share for what, share in heard if what == "lengths and noise"]
    np.testing.assert_allclose(steps, np.arange(len(steps)) / LITTLE.iterations)
    begun = [what for what, share in heard if share == 0]
    assert list(dict.fromkeys(begun)) == ["lengths and noise", "held-out figures", "final fit"]


def test_stated_covariance_reach_and_figures_are_those_of_what_was_held_out():
    examples, encoding = presses(passes=2, noise=5e-6), Encoding(chips=(0, 2), form=Form.DIRECTION)
    blank = replace(train_model(examples, encoding, effort=LITTLE), residual=np.eye(2), reach=1.0)
    fresh = presses(passes=2, seed=8, noise=5e-6)
    inputs = fresh.encode(encoding)
    judged = _judge(blank, inputs, fresh.targets)
    predicted = judged.predict(inputs)
    error = predicted.values - fresh.targets
    squared = np.einsum("ti,tij,tj->t", error, np.linalg.inv(predicted.covariance), error)
    assert squared.mean() == pytest.approx(2.0)
    # Both ends of the noise: faint fields and strong ones.
    strong = predicted.covariance[:, 0, 0] < np.median(predicted.covariance[:, 0, 0])
    assert 1.2 < squared[strong].mean() < 2.8
    assert np.mean(predicted.novelty <= 1 / 1.5) == pytest.approx(0.99, abs=0.01)
    figures = {metric.name: metric.value for metric in judged.metrics}
    assert figures["rmse_x"] == pytest.approx(np.sqrt(np.mean(error[:, 0] ** 2)))
    assert figures["rmse_y"] == pytest.approx(np.sqrt(np.mean(error[:, 1] ** 2)))
    assert figures["mean_error"] == pytest.approx(np.linalg.norm(error, axis=1).mean())


def test_a_training_comes_to_the_same_numbers_as_ever():
    encoding = Encoding(
        chips=(0, 2), form=Form.DIRECTION, time_constants=(1.0,), past=Past.STRENGTH
    )
    effort = FittingEffort(rows=300, evidence_rows=80, iterations=10)
    model = train_model(
        cycles(), encoding, effort=effort, seed=2, place=(0.01, 0.02), touch_field=1e-5
    )
    assert [metric.name for metric in model.metrics] == ["rmse_fz"]
    assert model.metrics[0].value == pytest.approx(0.180221, rel=1e-3)
    assert model.scale == pytest.approx(
        [1.79559, 1.79022, 2.1631, 2.20282, 1.74731, 1.87934, 1.67432, 2.62491], rel=1e-3
    )
    assert model.reach == pytest.approx(36.7202, rel=1e-3)
    assert model.residual == pytest.approx(np.array([[54.5915]]), rel=1e-3)
    assert model.noise == pytest.approx([1.49612e-4, 1.47926e-13], rel=1e-3)
    assert model.intercept == pytest.approx([-4.99503], rel=1e-3)
    assert model.slope[[0, 5], 0] == pytest.approx([-0.229912, -0.721085], rel=2e-3)
    assert (model.place.tolist(), model.touch_field) == ([0.01, 0.02], 1e-5)
    assert model.split == "2 of 10 groups held out whole, drawn with seed 2"
    usual = FittingEffort()
    assert (usual.rows, usual.evidence_rows, usual.iterations) == (4000, 500, 30)


def test_held_out_are_whole_groups_and_the_final_model_sees_all():
    examples = presses(passes=2, side=6)
    model = train_model(examples, Encoding(chips=(0, 1, 2)), effort=replace(LITTLE, rows=10_000))
    assert model.split == "5 of 36 groups held out whole, drawn with seed 0"
    assert len(model.support) == 72
    assert model.place.tolist() == [0.0, 0.0]
    assert model.touch_field == 30e-6
    # Without noise to speak of the mean goes nearly through the examples.
    predicted = model.predict(examples.encode(model.encoding))
    assert np.abs(predicted.values - examples.targets).max() < 1e-3


def test_wrong_examples_are_refused():
    examples = presses(passes=1)
    encoding = Encoding(chips=(0,))
    with pytest.raises(ArgumentError, match="at least two groups with known answers; got 1"):
        train_model(replace(examples, group=np.zeros(81, dtype=int)), encoding)
    with pytest.raises(ArgumentError, match="every output must take more than one value"):
        train_model(replace(examples, targets=np.ones((81, 2))), encoding)
    with pytest.raises(ArgumentError, match=r"targets must have shape \(..., 81, 2\)"):
        replace(examples, targets=np.ones((81, 3)))
    with pytest.raises(ArgumentError, match=r"group must be whole numbers; got array\(\[0\."):
        replace(examples, group=np.zeros(81))
    with pytest.raises(ArgumentError, match="field and time must be finite"):
        replace(examples, field=np.full((81, 3, 3), np.nan))
    with pytest.raises(ArgumentError, match="field and time must be finite"):
        replace(examples, time=np.append(examples.time[:-1], np.inf))
    with pytest.raises(ArgumentError, match=r"field must have the chips \(7,\); got 3 chips"):
        train_model(examples, Encoding(chips=(7,)))
    with pytest.raises(ArgumentError, match="rows must be at least 1; got 0"):
        FittingEffort(rows=0)
