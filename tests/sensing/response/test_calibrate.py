"""Calibration from a few labelled touches, and the choice of the next."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.sensing.response.calibrate import (
    LabelledTouches,
    TouchPlanner,
    calibrate_touches,
    plan_touches,
)
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import draw
from smoskin.twin.readout import Readout
from tables_of_response import motions, plain, presses, signals, table_with_modes


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


@pytest.fixture(scope="module")
def noise(skin):
    return signal_noise(skin)


def made_signals(skin, where, push, noise, seed=0):
    """Of a skin with other magnets and chips, as chips read them."""
    rng = np.random.default_rng(seed)
    readout = Readout(skin, draw(skin, np.random.default_rng([77, seed])))
    exact = signals(skin, readout, motions(skin, where, push))
    spoilt = rng.multivariate_normal(np.zeros(9), noise, len(where)).reshape(-1, 3, 3)
    return exact + spoilt, exact


def touch_planned(skin, table, noise, count, seed=0):
    plan = plan_touches(table, count, noise)
    where = np.stack([one.position for one in plan])
    push = np.stack([one.force for one in plan])
    said, _ = made_signals(skin, where, push, noise, seed)
    return LabelledTouches(position=where, force=push, signals=said)


def missed(skin, table, noise):
    where, push = presses(skin, 100, seed=5)
    _, exact = made_signals(skin, where, push, noise)
    return float(np.sqrt(np.mean((table.signals(where, push) - exact.reshape(100, -1)) ** 2)))


def test_touches_bring_the_table_to_the_skin(skin, noise):
    table = table_with_modes(skin)
    errors = [missed(skin, table, noise)]
    for count in (5, 30):
        touches = touch_planned(skin, table, noise, count)
        errors.append(missed(skin, calibrate_touches(table, touches, noise), noise))
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.1 * errors[0]


def test_touches_all_at_once_or_one_by_one_come_to_the_same(skin, noise):
    # All but the misfit, which is found along with the weights: regression does not care.
    table = table_with_modes(skin)
    table = replace(table, misfit=table.misfit * 1e3)
    touches = touch_planned(skin, table, noise, 6)
    whole, step = calibrate_touches(table, touches, noise), table
    for k in range(6):
        part = slice(k, k + 1)
        one = LabelledTouches(
            position=touches.position[part],
            force=touches.force[part],
            signals=touches.signals[part],
        )
        step = replace(calibrate_touches(step, one, noise), misfit=table.misfit)
    size = np.abs(whole.mean - table.mean).max()
    assert np.abs(whole.mean - step.mean).max() < 0.05 * size


def test_what_stays_open_shrinks_with_every_touch(skin, noise):
    table = table_with_modes(skin)
    where, push = presses(skin, 30, seed=8)
    open_ways = [np.sum(table.mode_signals(where, push) ** 2)]
    for count in (3, 10, 30):
        touches = touch_planned(skin, table, noise, count)
        left = calibrate_touches(table, touches, noise)
        open_ways.append(np.sum(left.mode_signals(where, push) ** 2))
    assert np.all(np.diff(open_ways) < 0)


def test_each_planned_touch_lowers_the_expected_error(skin, noise):
    table = table_with_modes(skin)
    plan = plan_touches(table, 8, noise)
    errors = [one.error for one in plan]
    assert errors == sorted(errors, reverse=True)
    assert TouchPlanner(table, noise).next().error == pytest.approx(errors[0])
    # After the first touch the tool proposes the second of the plan.
    touches = touch_planned(skin, table, noise, 1)
    after = replace(calibrate_touches(table, touches, noise), misfit=table.misfit)
    assert TouchPlanner(after, noise).next().error == pytest.approx(errors[1], rel=0.05)


def test_the_planner_knows_what_every_touch_leaves_open(skin, noise):
    """The updates after each touch against regression done at one stroke."""
    table = table_with_modes(skin)
    planner = TouchPlanner(table, noise, place_spread=1e-4, force_spread=5e-3)
    told = []
    for _ in range(5):
        target = planner.next()
        planner.made(target.position, target.force)
        told.append((target.position, target.force))
        assert planner.error == pytest.approx(target.error)
    where, push = (np.stack(one) for one in zip(*told, strict=True))
    slopes, ways = table.slopes(where, push), table.mode_signals(where, push)
    off = np.array([1e-4] * 2 + [5e-3] * 3) ** 2
    spoilt = (
        noise
        + (push**2).sum(axis=1)[:, None, None] * table.misfit
        + np.einsum("nck,k,ndk->ncd", slopes, off, slopes)
    )
    told_in_all = np.einsum("nkc,ncd,nld->kl", ways, np.linalg.inv(spoilt), ways)
    open_still = np.linalg.inv(np.eye(len(table.modes)) + told_in_all)
    root = np.linalg.cholesky(open_still)
    left = replace(table, modes=np.tensordot(root.T, table.modes, 1))
    assert TouchPlanner(left, noise).error == pytest.approx(planner.error, rel=1e-6)


def test_barred_touches_are_not_proposed_again_nor_harder(skin, noise):
    planner = TouchPlanner(table_with_modes(skin), noise, drag=0.0)
    first = planner.next()
    planner.bar(first)
    then = planner.next()
    here = np.allclose(then.position, first.position)
    assert not here or np.linalg.norm(then.force) < np.linalg.norm(first.force)
    while not planner.exhausted:
        planner.bar(planner.next())
    with pytest.raises(ArgumentError, match="no touch is left"):
        planner.next()


def test_planned_touches_beat_as_many_in_the_middle(skin, noise):
    table = table_with_modes(skin)
    planner, middle = TouchPlanner(table, noise), TouchPlanner(table, noise)
    for shift in (-1e-3, 0.0, 1e-3, 2e-3):
        target = planner.next()
        planner.made(target.position, target.force)
        middle.made(table.basis.extent / 2 + shift, target.force)
    assert planner.error < 0.7 * middle.error


def test_labels_that_are_off_are_believed_less(skin, noise):
    table = table_with_modes(skin)
    sharp = touch_planned(skin, table, noise, 20)
    rng = np.random.default_rng(1)
    off = {"position": sharp.position + 5e-4 * rng.normal(size=(20, 2)), "force": sharp.force}
    off["position"] = np.clip(off["position"], 0, table.basis.extent)
    trusting = LabelledTouches(signals=sharp.signals, **off)
    knowing = LabelledTouches(signals=sharp.signals, place_spread=5e-4, **off)
    errors = [
        missed(skin, calibrate_touches(table, one, noise), noise) for one in (trusting, knowing)
    ]
    assert errors[1] < errors[0]


def test_wrong_use_is_refused(skin, noise):
    table = table_with_modes(skin)
    good = {"position": [[0.05, 0.05]], "force": [[0.0, 0.0, -0.5]], "signals": np.zeros((1, 3, 3))}
    with pytest.raises(ArgumentError, match="force must press"):
        LabelledTouches(**(good | {"force": [[0.0, 0.0, 0.5]]}))
    with pytest.raises(ArgumentError, match="signals must be finite"):
        LabelledTouches(**(good | {"signals": np.full((1, 3, 3), np.nan)}))
    with pytest.raises(ArgumentError, match="place_spread and force_spread"):
        LabelledTouches(**good, place_spread=-1.0)
    with pytest.raises(ArgumentError, match="with 2 chips; got 1 with 3"):
        calibrate_touches(table.of_chips((1, 2)), LabelledTouches(**good), noise)
    with pytest.raises(ArgumentError, match="count must be positive"):
        plan_touches(table, 0, noise)
    with pytest.raises(ArgumentError, match="force must be positive, drag and spreads"):
        TouchPlanner(table, noise, drag=-0.1)
    bare = replace(table, modes=table.modes[:0], grip_modes=table.grip_modes[:0])
    with pytest.raises(ArgumentError, match="table must have modes"):
        TouchPlanner(bare, noise)
