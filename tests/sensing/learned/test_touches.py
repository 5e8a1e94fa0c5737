"""Learning from a sheet of touches: what is learned, how it is judged, and that it holds."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pads import REST, pressed
from smoskin.errors import ArgumentError
from smoskin.measurement import TouchTable
from smoskin.records import Reading, Status
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, Output
from smoskin.sensing.learned.touches import (
    examples_of,
    judge_touches,
    learn_touches,
    places_of,
)


def sheet(count: int, *, seed: int = 0, force=None, drift: float = 0.0, place=None) -> TouchTable:
    """A rest and a touch, again and again, of a pad of 30 mm."""
    rng = np.random.default_rng(seed)
    position, forces, fields = [], [], []
    for number in range(count):
        spot = rng.uniform(3e-3, 27e-3, 2) if place is None else np.array(place)
        push = rng.uniform(0.3, 1.0) if force is None else force
        rest = REST + drift * number
        for where, pressing in ((np.full(2, np.nan), 0.0), (spot, push)):
            change = pressed(spot, pressing)
            position.append(where)
            forces.append([0.0, 0.0, -pressing])
            fields.append(rest + change + rng.normal(0, 0.7e-6, (5, 3)))
    return TouchTable(position=position, force=forces, field=fields)


def test_examples_are_touches_less_the_rest_before_them() -> None:
    table = sheet(12, drift=20e-6)
    examples = examples_of([table])
    assert examples.outputs == (Output.X, Output.Y, Output.FZ)
    assert_allclose(examples.targets[:, :2], table.position[1::2])
    assert_allclose(examples.targets[:, 2], table.force[1::2, 2])
    true = [pressed(c.position, c.normal_force) for c in table.contacts]
    assert_allclose(examples.field, true, atol=6e-6)
    assert len(np.unique(examples.group)) == 12


def test_only_what_varies_is_learned() -> None:
    assert examples_of([sheet(8, force=0.5)]).outputs == (Output.X, Output.Y)
    alone = examples_of([sheet(8, place=(0.01, 0.01))])
    assert alone.outputs == (Output.FZ,)
    assert len(np.unique(alone.group)) == 8
    # A gauge's noise is no force to learn, and spoils nothing that is.
    table = sheet(30, force=0.5)
    noise = 0.004 * np.random.default_rng(0).standard_normal(table.force.shape)
    read = replace(table, force=table.force + np.where(table.touched[:, None], noise, 0.0))
    assert examples_of([read]).outputs == (Output.X, Output.Y)
    drags = np.where(table.touched[:, None], [0.0, 0.05, 0.0], 0.0)
    drags[: len(drags) // 2] *= -1
    dragged = replace(read, force=read.force + drags)
    assert examples_of([dragged]).outputs == (Output.X, Output.Y, Output.FY)


def test_a_hundred_touches_are_learned_and_honestly_judged() -> None:
    learned = learn_touches([sheet(60), sheet(40, seed=1)])
    figures = {metric.name: metric.value for metric in learned.metrics}
    assert figures["mean_error"] < 0.8e-3
    assert figures["rmse_fz"] < 0.05
    assert 0.75 < figures["inside_90_percent_region"] <= 1.0
    assert 0.75 < figures["inside_90_percent_range_fz"] <= 1.0
    assert learned.split == "5 folds of 100 places, drawn with seed 0"
    estimator = LearnedEstimator(learned)
    estimator.zero([Reading(time=0.01 * k, field=REST) for k in range(20)], force=True)
    fresh = sheet(40, seed=5)
    misses = []
    for number, contact in enumerate(fresh.contacts):
        field = REST + pressed(contact.position, contact.normal_force)
        estimate = estimator.step(Reading(time=1.0 + number, field=field))
        if estimate.status is Status.CONTACT:
            misses.append(np.linalg.norm(estimate.contacts[0].position - contact.position))
    assert len(misses) >= 36
    # The error that was told is that of touches to come.
    assert 0.3 < np.mean(misses) / figures["mean_error"] < 1.5
    rest = estimator.step(Reading(time=100.0, field=REST))
    assert rest.status is Status.NO_CONTACT


def test_touches_of_another_day_are_judged_by_themselves() -> None:
    model = learn_touches([sheet(60)])
    day = {metric.name: metric.value for metric in judge_touches(model, [sheet(40, seed=1)])}
    stated = {metric.name: metric.value for metric in model.metrics}
    assert set(day) == {*stated, "refused"}
    assert 0.3 < day["mean_error"] / stated["mean_error"] < 1.5
    assert 0.75 < day["inside_90_percent_region"] <= 1.0
    assert day["refused"] < 0.1
    # A skin put on again two millimetres beside its marks, pressed as before.
    moved = sheet(40, seed=1)
    moved = replace(moved, position=moved.position + np.array([2e-3, 0.0]))
    off = {metric.name: metric.value for metric in judge_touches(model, [moved])}
    assert_allclose(off["mean_error"], 2e-3, rtol=0.2)
    assert off["inside_90_percent_region"] < 0.5
    # A gauge that reads 0.2 N more, which is far beyond what force is off otherwise.
    more = replace(moved, force=moved.force - np.where(moved.touched[:, None], [0, 0, 0.2], 0))
    ranges = [
        next(
            m.value for m in judge_touches(model, [table]) if m.name == "inside_90_percent_range_fz"
        )
        for table in (moved, more)
    ]
    assert ranges[0] > 0.75
    assert ranges[1] < 0.25
    assert off["rmse_fz"] == day["rmse_fz"]
    shy = judge_touches(replace(model, reach=1e-6), [moved])
    assert {metric.name: metric.value for metric in shy}["refused"] == 1.0
    with pytest.raises(ArgumentError, match="of a board with 5 chips; got 4"):
        judge_touches(model, [replace(moved, field=moved.field[:, :4], temperature=None)])


def test_a_board_with_swapped_chips_is_refused_and_a_sound_one_is_not() -> None:
    """From sixty touches on; where two chips alone are swapped, some touches look the same."""
    model, fresh = learn_touches([sheet(60)]), sheet(200, seed=50)
    refused = []
    for order in ([0, 1, 2, 3, 4], [4, 3, 2, 1, 0], [1, 0, 2, 3, 4], [0, 1, 2, 4, 3]):
        swapped = replace(fresh, field=fresh.field[:, order])
        figures = {metric.name: metric.value for metric in judge_touches(model, [swapped])}
        refused.append(figures["refused"])
    sound, reversed_, first, last = refused
    assert sound <= 0.01
    assert reversed_ > 0.9
    assert first > 0.5
    assert last > 0.9


def test_chosen_chips_alone_are_read() -> None:
    table = sheet(40)
    model = learn_touches([table], chips=(0, 3))
    assert model.encoding.chips == (0, 3)
    assert model.chips_in_reading == 5
    spoilt = table.field.copy()
    spoilt[:, [1, 2, 4]] += np.random.default_rng(0).normal(0.0, 1e-3, (len(spoilt), 3, 3))
    assert judge_touches(model, [replace(table, field=spoilt)]) == judge_touches(model, [table])
    figures = {metric.name: metric.value for metric in model.metrics}
    assert figures["mean_error"] < 1e-3
    with pytest.raises(ArgumentError, match="field must have the chips"):
        learn_touches([table], chips=(0, 5))


@pytest.mark.parametrize("seed", [0, 9, 23])
def test_sixteen_touches_are_not_taken_for_exact(seed: int) -> None:
    # As many inputs as touches: a plane meets them all, and is off by far between them.
    rng, zero = np.random.default_rng(seed), np.zeros((5, 3))
    x = np.linspace(3.75e-3, 26.25e-3, 4)
    rows: list[tuple[np.ndarray, np.ndarray]] = []
    for at in np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2):
        touch = pressed(at + rng.normal(0, 0.3e-3, 2), rng.normal(0.5, 0.015))
        rows += [(np.full(2, np.nan), zero), (at, touch + rng.normal(0, 0.3e-6, (5, 3)))]
    table = TouchTable(
        position=[at for at, _ in rows],
        force=np.tile([[0.0, 0.0, 0.0], [0.0, 0.0, -0.5]], (16, 1)),
        field=[field for _, field in rows],
    )
    estimator = LearnedEstimator(learn_touches([table]), zero)
    middle = np.array([15e-3, 15e-3])
    estimate = estimator.step(Reading(time=0.0, field=pressed(middle, 0.5)))
    assert_allclose(estimate.contacts[0].position, middle, atol=1.5e-3)


def test_the_same_sheets_give_the_same_model() -> None:
    first, second = learn_touches([sheet(15)]), learn_touches([sheet(15)])
    assert first.metrics == second.metrics
    assert_allclose(first.weights, second.weights, rtol=0)


@pytest.mark.parametrize("count", [5, 9])
def test_few_touches_are_learned_with_their_error(count: int) -> None:
    model = learn_touches([sheet(count)])
    assert {"mean_error", "inside_90_percent_region"} <= {metric.name for metric in model.metrics}
    assert (np.linalg.eigvalsh(model.residual) > 0).all()


def test_wrong_sheets_are_named() -> None:
    table = sheet(8)
    with pytest.raises(ArgumentError, match="row 1 must come after a row of the untouched skin"):
        examples_of([table.rows(table.touched)])
    with pytest.raises(ArgumentError, match="touches must hold some that were read; got none"):
        examples_of([table.rows(~table.touched)])
    few = sheet(4)
    with pytest.raises(ArgumentError, match="touches must be at 5 places or more; got 4"):
        learn_touches([few])
    same = sheet(8, place=(0.01, 0.01), force=0.5)
    with pytest.raises(ArgumentError, match="touches must differ in place or force"):
        examples_of([same])
    other = TouchTable(
        position=table.position, force=table.force, field=table.field[:, :4], temperature=None
    )
    with pytest.raises(ArgumentError, match="touches must be of boards with as many chips each"):
        examples_of([table, other])


def test_touches_of_one_place_are_one_group_however_a_stage_tells_them() -> None:
    rng = np.random.default_rng(0)
    spots = np.stack(np.meshgrid(np.arange(20), np.arange(30)), axis=-1).reshape(-1, 2) * 2e-3
    places = np.repeat(spots, 3, axis=0) + rng.normal(0.0, 20e-6, (3 * len(spots), 2))
    number = places_of(places)
    assert (number.reshape(-1, 3) == number[::3, None]).mean() > 0.99
    assert len(np.unique(number)) <= 1.01 * len(spots)
