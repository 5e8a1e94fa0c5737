"""Training: the search's gradient, what a Gaussian process obeys, and honesty of figures."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from smoskin.errors import ArgumentError
from smoskin.sensing.learned.gaussian_process import Output
from smoskin.sensing.learned.inputs import Encoding, Form
from smoskin.sensing.learned.training import (
    Effort,
    Examples,
    choose_encoding,
    negative_log_posterior,
    train,
)

LITTLE = Effort(rows=600, evidence_rows=150, iterations=15)
CHIPS = np.array([[0.0, 0.0], [0.02, 0.0], [0.01, 0.02]])


def press_field(place, depth):
    """Field of a press under each chip, T: along the line to it, falling with distance."""
    away = np.concatenate(
        [place[:, None, :] - CHIPS, np.full((len(place), len(CHIPS), 1), 0.01)], axis=2
    )
    fall = np.linalg.norm(away, axis=2, keepdims=True) ** 3
    return 4e-8 * depth[:, None, None] * away / fall


def presses(passes=3, side=9, seed=0, noise=1e-6):
    """Presses of random depth on a grid of places, a group a place."""
    rng = np.random.default_rng(seed)
    axis = np.linspace(0.0, 0.02, side)
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    place = np.tile(grid, (passes, 1))
    field = press_field(place, rng.uniform(1.0, 3.0, len(place)))
    return Examples(
        time=np.arange(len(place), dtype=float),
        field=field + noise * rng.normal(size=field.shape),
        targets=place,
        outputs=(Output.X, Output.Y),
        group=np.tile(np.arange(len(grid)), passes),
        run=np.zeros(len(place), dtype=int),
    )


def cycles(runs=2, seed=0):
    """Load cycles whose force lags behind the field, one place; every third row unread."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 0.1)
    swing = np.sin(time * 2 * np.pi / 12) ** 2
    rate = np.gradient(swing, time)
    fields, forces = [], []
    for _ in range(runs):
        push = swing[:, None, None] * press_field(np.full((1, 2), 0.01), np.full(1, 3.0))
        fields.append(push + 1e-6 * rng.normal(size=push.shape))
        forces.append(-(10 * swing + 2 * rate))
    targets = np.concatenate(forces)[:, None]
    targets[::3] = np.nan
    return Examples(
        time=np.tile(time, runs),
        field=np.concatenate(fields),
        targets=targets,
        outputs=(Output.FZ,),
        group=np.repeat(np.arange(5 * runs), len(time) // 5),
        run=np.repeat(np.arange(runs), len(time)),
    )


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
    prior = 0.5 * ((vector[:4] - usual) ** 2).sum()
    expected = (-log_density - 25 * np.log(2 * np.pi) + prior) / 25
    assert negative_log_posterior(*problem)[0] == pytest.approx(expected, rel=1e-9)


def test_location_is_found_at_places_never_seen():
    examples = presses()
    apart = examples.group % 7 == 3
    encoding = Encoding(chips=(0, 1, 2), form=Form.DIRECTION)
    model = train(examples.where(~apart), encoding, effort=LITTLE)
    said = model.predict(examples.encode(encoding)[apart])
    miss = np.linalg.norm(said.values - examples.targets[apart], axis=1)
    assert miss.mean() < 0.3e-3  # on places 2.5 mm apart
    metrics = {metric.name: metric for metric in model.metrics}
    assert set(metrics) == {"rmse_x", "rmse_y", "mean_error"}
    assert metrics["mean_error"].unit == "m"
    assert 0.2 < metrics["mean_error"].value / miss.mean() < 5
    # The stated covariance is of the order of the error made.
    inverse = np.linalg.inv(said.covariance)
    error = said.values - examples.targets[apart]
    assert 0.1 < np.einsum("ti,tij,tj->t", error, inverse, error).mean() / 2 < 10


def test_faint_fields_are_said_to_be_less_certain():
    examples = presses(noise=5e-6)
    encoding = Encoding(chips=(0, 1, 2), form=Form.DIRECTION)
    model = train(examples, encoding, effort=LITTLE)
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
        model = train(examples.where(first), encoding, effort=LITTLE, place=(0.01, 0.01))
        other = ~first & examples.known
        said = model.predict(examples.encode(encoding)[other]).values
        errors.append(np.sqrt(np.mean((said - examples.targets[other]) ** 2)))
    assert errors[1] < 0.2 * errors[0]
    assert [metric.name for metric in model.metrics] == ["rmse_fz"]


def test_the_same_seed_gives_the_same_model_and_another_seed_another():
    examples, encoding = presses(passes=2), Encoding(chips=(0, 1), form=Form.DIRECTION)
    first, again, other = (
        train(examples, encoding, effort=LITTLE, seed=seed) for seed in (4, 4, 5)
    )
    assert np.array_equal(first.weights, again.weights)
    assert first.metrics == again.metrics
    assert first.data_sha256 == other.data_sha256
    assert not np.array_equal(first.scale, other.scale)
    changed = replace(examples, field=examples.field * 1.0000001)
    assert changed.sha256() != examples.sha256()


def test_rows_beyond_the_limit_are_left_out():
    model = train(presses(), Encoding(chips=(0,)), effort=replace(LITTLE, rows=50))
    assert model.support.shape == (50, 3)


def test_progress_ends_complete():
    heard = []
    train(
        presses(passes=1),
        Encoding(chips=(0,)),
        effort=LITTLE,
        progress=lambda what, share: heard.append((what, share)),
    )
    assert heard[-1] == ("final fit", 1.0)
    assert all(0 <= share <= 1 for _, share in heard)
    assert ("lengths and noise", 0.0) in heard


@pytest.mark.slow
def test_the_encoding_that_knows_what_matters_is_chosen():
    examples = cycles(runs=1)
    chips = (0, 2)
    blind, seeing, other = (
        Encoding(chips=chips, time_constants=times) for times in ((), (1.0,), (50.0,))
    )
    for order in ((blind, seeing, other), (other, seeing, blind)):
        assert choose_encoding(examples, order, effort=LITTLE) is seeing
    assert choose_encoding(examples, (blind,), effort=LITTLE) is blind


@pytest.mark.slow
def test_rows_without_an_answer_and_other_runs_have_no_say_in_the_choice():
    examples = cycles(runs=2)
    wrong = np.where(examples.run[:, None] == 1, np.nan, examples.targets)
    encodings = [Encoding(chips=(0, 2), time_constants=times) for times in ((), (1.0,))]
    assert (
        choose_encoding(replace(examples, targets=wrong), encodings, effort=LITTLE)
        is (encodings[1])
    )


def test_nothing_to_choose_from_is_refused():
    examples = cycles(runs=1)
    two = [Encoding(chips=(0,)), Encoding(chips=(1,))]
    with pytest.raises(ArgumentError, match="encodings must hold at least one; got none"):
        choose_encoding(examples, [])
    with pytest.raises(ArgumentError, match="runs of at least three groups"):
        choose_encoding(replace(examples, group=np.minimum(examples.group, 1)), two)


def test_wrong_examples_are_refused():
    examples = presses(passes=1)
    encoding = Encoding(chips=(0,))
    with pytest.raises(ArgumentError, match="at least two groups with known answers; got 1"):
        train(replace(examples, group=np.zeros(81, dtype=int)), encoding)
    with pytest.raises(ArgumentError, match="every output must take more than one value"):
        train(replace(examples, targets=np.ones((81, 2))), encoding)
    with pytest.raises(ArgumentError, match=r"targets must have shape \(..., 81, 2\)"):
        replace(examples, targets=np.ones((81, 3)))
    with pytest.raises(ArgumentError, match="group must be 81 whole numbers; got float64"):
        replace(examples, group=np.zeros(81))
    with pytest.raises(ArgumentError, match="field and time must be finite"):
        replace(examples, field=np.full((81, 3, 3), np.nan))
    with pytest.raises(ArgumentError, match=r"field must have the chips \(7,\); got 3 chips"):
        train(examples, Encoding(chips=(7,)))
    with pytest.raises(ArgumentError, match="rows must be at least 1; got 0"):
        Effort(rows=0)
