"""Calibration from a few labelled touches, and the choice of the next."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.origami.geometry import places_to_the_rim
from smoskin.sensing.response import calibrate
from smoskin.sensing.response.calibrate import (
    LabelledTouches,
    TouchPlanner,
    calibrate_touches,
    label_noise,
)
from smoskin.sensing.response.fit import table_curvature
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import draw
from smoskin.twin.readout import Readout
from tables_of_response import (
    BASIS,
    motions,
    plain,
    presses,
    random_table,
    random_touches,
    signals,
    table_with_modes,
)


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
    plan = TouchPlanner(table, noise).plan(count)
    where = np.stack([target.position for target in plan])
    push = np.stack([target.force for target in plan])
    read, _ = made_signals(skin, where, push, noise, seed)
    return LabelledTouches(position=where, force=push, signals=read)


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
        single = LabelledTouches(
            position=touches.position[part],
            force=touches.force[part],
            signals=touches.signals[part],
        )
        step = replace(calibrate_touches(step, single, noise), misfit=table.misfit)
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
    plan = TouchPlanner(table, noise).plan(8)
    errors = [target.error for target in plan]
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
    made = []
    for _ in range(5):
        target = planner.next()
        planner.made(target.position, target.force)
        made.append((target.position, target.force))
        assert planner.error == pytest.approx(target.error)
    where, push = (np.stack(column) for column in zip(*made, strict=True))
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
        missed(skin, calibrate_touches(table, given, noise), noise) for given in (trusting, knowing)
    ]
    assert errors[1] < errors[0]


FLOOR = 1e-12 * (np.eye(9) + 0.3)
"""T^2: noise of chips that are off together."""


def labelled(table, weights, count=12, temperature=REFERENCE_TEMPERATURE, off=0.0, **spreads):
    """Touches of the skin with these weights, off by so much of each signal."""
    place, force = random_touches(count, seed=4)
    y = table.signals(place, force, temperature)
    y = y + np.einsum("k,nkc->nc", weights, table.mode_signals(place, force)) + off
    return LabelledTouches(
        position=place, force=force, signals=y.reshape(count, -1, 3), temperature=temperature,
        **spreads,
    )  # fmt: skip


def test_weights_are_those_of_linear_regression():
    """Against the same posterior by the signals' joint covariance, at other places."""
    table = random_table()
    touches = labelled(
        table, [0.3, -0.2, 0.1], temperature=31.0, place_spread=2e-4, force_spread=5e-3
    )
    skin = calibrate_touches(table, touches, FLOOR)
    place, force = touches.position, touches.force
    modes, slopes = table.mode_signals(place, force), table.slopes(place, force)
    off = np.array([2e-4, 2e-4, 5e-3, 5e-3, 5e-3]) ** 2
    spoilt = np.einsum("nck,k,ndk->ncd", slopes, off, slopes) + FLOOR
    spoilt += (force**2).sum(axis=1)[:, None, None] * table.misfit
    flat = modes.swapaxes(1, 2).reshape(-1, 3)
    joint = flat @ flat.T
    for n in range(12):
        joint[9 * n : 9 * n + 9, 9 * n : 9 * n + 9] += spoilt[n]
    residual = touches.signals.reshape(-1) - table.signals(place, force, 31.0).ravel()
    weights = flat.T @ np.linalg.solve(joint, residual)
    covariance = np.eye(3) - flat.T @ np.linalg.solve(joint, flat)
    assert_allclose(skin.misfit, table.misfit, rtol=1e-12)
    assert_allclose(skin.mean, table.mean + np.tensordot(weights, table.modes, 1), atol=1e-11)
    assert_allclose(skin.grip, table.grip + np.tensordot(weights, table.grip_modes, 1), rtol=1e-9)
    late = random_touches(20, seed=6)
    new, old = skin.mode_signals(*late), table.mode_signals(*late)
    expected = np.einsum("akc,kl,ald->acd", old, covariance, old)
    size = np.abs(expected).max()
    assert_allclose(np.einsum("akc,akd->acd", new, new), expected, atol=1e-9 * size)
    # The grip goes along with each mode.
    expected = np.einsum("k...,kl,alc->...ac", table.grip_modes, covariance, old)
    together = np.einsum("k...,akc->...ac", skin.grip_modes, new)
    assert_allclose(together, expected, atol=1e-9 * np.abs(expected).max())
    bent = table_curvature(skin) - table_curvature(table)
    assert np.abs(bent).max() > 0
    assert_allclose(skin.curvature, table.curvature + bent, rtol=1e-9)


@pytest.mark.parametrize(("over", "share"), [(0.9, 0.0), (1.25, 0.75), (5.0, 24**0.5)])
def test_what_touches_leave_is_counted_past_the_noise(over, share):
    """In noise of 2 uT, of signals of a newton: a share of theirs, whatever their size."""
    table = random_table()
    noise = (2e-6) ** 2 * np.eye(table.count)
    where, push = random_touches(12)
    touches = LabelledTouches(
        position=where,
        force=push,
        signals=table.signals(where, push).reshape(12, -1, 3),
        left=over * 2e-6,
    )
    own = calibrate_touches(table, touches, noise)
    size = np.sqrt(np.trace(table.newton) / table.count)
    assert own.residue * size == pytest.approx(share * 2e-6)
    # Touches of which that is unknown leave it as it was.
    again = calibrate_touches(own, replace(touches, left=0.0), noise)
    assert again.residue == own.residue


def test_the_misfit_of_each_signal_grows_to_what_it_misses():
    table = random_table()
    table = replace(table, misfit=np.diag(np.diag(table.misfit)))
    force = random_touches(400, seed=4)[1]
    size = np.sqrt(np.diag(table.misfit))
    factor = np.array([1.0, 3.0, 1.0, 1.0, 1.0, 0.3, 1.0, 1.0, 6.0])
    off = np.random.default_rng(3).normal(size=(400, 9)) * size * factor
    off *= np.linalg.norm(force, axis=1)[:, None]
    touches = labelled(table, np.zeros(3), count=400, off=off)
    skin = calibrate_touches(table, touches, 1e-18 * np.eye(9))
    grown = np.sqrt(np.diag(skin.misfit)) / size
    # What fits better than the table says is not believed to do so everywhere.
    assert_allclose(grown, np.maximum(factor, 1.0), rtol=0.1)
    assert_allclose(skin.misfit, table.misfit * grown[:, None] * grown, rtol=1e-9)
    far = labelled(table, np.zeros(3), count=400, off=1e3 * off)
    grown = np.sqrt(np.diag(calibrate_touches(table, far, 1e-18 * np.eye(9)).misfit)) / size
    assert_allclose(grown, 1e3 * factor, rtol=0.1)


def test_the_likelihood_of_touches_is_the_joint_density():
    table = random_table()
    noise = 1e-12 * (np.eye(9) + 0.3)
    touches = labelled(table, np.array([0.5, -1.0, 0.2]), count=8)
    posterior = calibrate._posterior_weights(table, touches, noise)
    place, force, flat = touches.position, touches.force, touches.signals.reshape(8, 9)
    own = noise + (force**2).sum(axis=1)[:, None, None] * posterior.misfit
    own += label_noise(table, place, force, (touches.place_spread, touches.force_spread))
    modes = table.mode_signals(place, force).swapaxes(1, 2).reshape(72, -1)
    density = multivariate_normal(
        table.signals(place, force).ravel(), block_diag(*own) + modes @ modes.T
    )
    constant = 36 * np.log(2 * np.pi)
    assert posterior.evidence == pytest.approx(density.logpdf(flat.ravel()) + constant, rel=1e-6)


def expected_error(table, noise, covariance):
    """Root mean square of where straight touches of 0.5 N are found, one place after the other."""
    squares = []
    for place in places_to_the_rim(table.basis.extent, (11, 14)):
        shift, spread, _ = shift_at(table, noise, place)
        squares.append(np.trace(spread[:2, :2]) + np.trace((shift @ covariance @ shift.T)[:2, :2]))
    return np.sqrt(np.mean(squares))


def shift_at(table, noise, place):
    touch = place[None], np.array([[0.0, 0.0, -0.5]])
    slopes = table.slopes(*touch)[0][:, [0, 1, 4]]
    precision = np.linalg.inv(noise + 0.25 * table.misfit)
    level = np.diag([*12 / table.basis.extent**2, 0.0])
    spread = np.linalg.inv(slopes.T @ precision @ slopes + level)
    shift = spread @ slopes.T @ precision @ table.mode_signals(*touch)[0].T
    return shift, spread, np.diag([1.0, 1.0, 0.05 / 0.5])


def covariance_after(table, noise, covariance, place, force, off):
    """What is open of the weights after one more touch."""
    slopes = table.slopes(place[None], force[None])[0]
    spoilt = noise + (force @ force) * table.misfit + (slopes * off) @ slopes.T
    modes = table.mode_signals(place[None], force[None])[0]
    more = modes @ np.linalg.inv(spoilt) @ modes.T
    return np.linalg.inv(np.linalg.inv(covariance) + more)


def test_the_next_touch_is_the_best_of_all_that_may_be_made():
    table = random_table(seed=2)
    planner = TouchPlanner(table, FLOOR, force=0.9, drag=0.2, place_spread=1e-4, force_spread=4e-3)
    aim = np.zeros((3, 3))
    for place in places_to_the_rim(BASIS.extent, (11, 14)):
        shift, _, weight = shift_at(table, FLOOR, place)
        aim += (weight @ shift).T @ (weight @ shift)
    pushes = np.array([[0, 0, -0.9], [0, 0, -0.36], [0.2, 0, -0.9], [-0.2, 0, -0.9],
                       [0, 0.2, -0.9], [0, -0.2, -0.9]])  # fmt: skip
    places = places_to_the_rim(BASIS.extent, (17, 23))
    off = np.array([1e-4, 1e-4, 4e-3, 4e-3, 4e-3]) ** 2
    open_still, made = np.eye(3), []
    assert planner.error == pytest.approx(expected_error(table, FLOOR, open_still), rel=1e-9)
    for _ in range(3):
        after = [
            (covariance_after(table, FLOOR, open_still, place, force, off), place, force)
            for force in pushes
            for place in places
            if tuple(place) not in made
        ]
        open_still, place, force = min(after, key=lambda option: np.sum(aim * option[0]))
        target = planner.next()
        assert_allclose([*target.position, *target.force], [*place, *force], atol=1e-12)
        assert target.error == pytest.approx(expected_error(table, FLOOR, open_still), rel=1e-8)
        planner.made(target.position, target.force)
        made.append(tuple(place))
        assert planner.error == pytest.approx(target.error, rel=1e-9)


@pytest.mark.parametrize("drag_spread", [0.0, 0.2])
def test_the_expected_error_is_that_of_presses_whose_drags_are_known_or_not(drag_spread):
    """By least squares with what is believed of drags beforehand, one place after the other."""
    table = random_table(seed=2)
    squares, rows = [], [0, 1, 4, 2, 3] if drag_spread else [0, 1, 4]
    for place in places_to_the_rim(table.basis.extent, (11, 14)):
        touch = place[None], np.array([[0.0, 0.0, -0.5]])
        slopes = table.slopes(*touch)[0][:, rows]
        precision = np.linalg.inv(FLOOR + 0.25 * table.misfit)
        believed = [*12 / table.basis.extent**2, 0.0]
        believed += [drag_spread**-2] * 2 if drag_spread else []
        spread = np.linalg.inv(slopes.T @ precision @ slopes + np.diag(believed))
        shift = spread @ slopes.T @ precision @ table.mode_signals(*touch)[0].T
        squares.append(np.trace(spread[:2, :2]) + (shift[:2] ** 2).sum())
    error = calibrate.expected_error(table, FLOOR, drag_spread=drag_spread)
    assert error == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)


def test_the_usual_rig_is_a_good_one_that_presses_with_0_8_newton():
    table = random_table(seed=2)
    usual = TouchPlanner(table, FLOOR)
    stated = TouchPlanner(table, FLOOR, force=0.8, drag=0.3, place_spread=20e-6, force_spread=2e-3)
    for target, plan in zip(TouchPlanner(table, FLOOR).plan(4), (usual, stated, usual, stated),
                            strict=True):  # fmt: skip
        assert plan.next().error == target.error
        for planner in (usual, stated):
            planner.made(target.position, target.force)
    assert usual.error == stated.error


@pytest.mark.parametrize(("away", "again"), [(1.9e-3, False), (2.1e-3, True)])
def test_a_place_is_not_touched_again_within_two_millimetres(away, again):
    table = random_table(seed=3, modes=1)
    planner = TouchPlanner(table, 1e-4 * np.eye(9), drag=0.0)
    first = planner.next()
    # A touch that tells next to nothing, near the best one.
    near = np.clip(first.position - away * np.array([1.0, 0.0]), -1.0, BASIS.extent)
    planner.made(near, 1e-6 * first.force)
    assert (np.abs(planner.next().position - first.position).max() < 1e-9) == again


@pytest.mark.slow
def test_touches_that_may_end_a_range_as_one_did_are_barred_until_one_of_them_is_made():
    """Against the rule, written out for every touch that may be proposed."""
    table = random_table(seed=3)
    planner = TouchPlanner(table, FLOOR, drag=0.0)
    grid = places_to_the_rim(BASIS.extent, (17, 23))
    places, presses = np.tile(grid, (2, 1)), np.repeat([0.8, 0.32], len(grid))

    def signed(places, presses):
        signals = table.signals(places, -np.outer(presses, [0.0, 0.0, 1.0]))
        return np.concatenate([signals, -signals], axis=1)

    values = signed(places, presses)
    large, reached = 0.6 * values.max(axis=0), np.full(18, -np.inf)
    harder, failures = np.zeros(len(places), dtype=bool), []
    for step in range(len(places) + 3):
        allowed = ~harder
        for failed in failures:
            suspect = (failed > large) & (failed > reached)
            allowed &= ~(values[:, suspect] >= failed[suspect] - 1e-12).any(axis=1)
        assert planner.exhausted == (not allowed.any())
        if planner.exhausted:
            break
        target = planner.next()
        here = np.hypot(*(places - target.position).T) < 1e-9
        (index,) = np.flatnonzero(here & np.isclose(presses, -target.force[2]))
        assert allowed[index]
        # Some succeed: what those have reached is no longer suspect.
        if step in (2, 5):
            planner.made(target.position, target.force)
            reached = np.maximum(reached, values[index])
            continue
        planner.bar(target)
        harder |= here & (presses >= presses[index] - 1e-9)
        failures.append(values[index])
    assert planner.exhausted
    assert step > 5
    with pytest.raises(ArgumentError, match="no touch is left"):
        planner.next()


def test_labels_take_one_temperature_for_all_and_the_reference_by_default():
    place, force = random_touches(3)
    given = {"position": place, "force": force, "signals": np.zeros((3, 2, 3))}
    assert_allclose(LabelledTouches(**given).temperature, [REFERENCE_TEMPERATURE] * 3)
    assert_allclose(LabelledTouches(**given, temperature=30.0).temperature, [30.0] * 3)
    touches = LabelledTouches(**given, temperature=[1.0, 2.0, 3.0])
    assert_allclose(touches.temperature, [1.0, 2.0, 3.0])
    assert len(touches) == 3
    assert (touches.place_spread, touches.force_spread) == (0.0, 0.0)
    with pytest.raises(ArgumentError, match="temperature must have shape"):
        LabelledTouches(**given, temperature=[1.0, 2.0])
    with pytest.raises(ArgumentError, match="temperature must be finite"):
        LabelledTouches(**given, temperature=np.nan)
    for wrong in (-1e-9, np.inf, np.nan):
        with pytest.raises(ArgumentError, match="place_spread and force_spread"):
            LabelledTouches(**given, force_spread=wrong)


def test_wrong_use_is_refused(skin, noise):
    table = table_with_modes(skin)
    good = {"position": [[0.05, 0.05]], "force": [[0.0, 0.0, -0.5]], "signals": np.zeros((1, 3, 3))}
    for upwards in (0.5, 0.0):
        with pytest.raises(ArgumentError, match="force must press"):
            LabelledTouches(**(good | {"force": [[0.0, 0.0, upwards]]}))
    with pytest.raises(ArgumentError, match="signals must be finite"):
        LabelledTouches(**(good | {"signals": np.full((1, 3, 3), np.nan)}))
    with pytest.raises(ArgumentError, match="place_spread and force_spread"):
        LabelledTouches(**good, place_spread=-1.0)
    with pytest.raises(ArgumentError, match="left must be finite and >= 0; got -1e-06 T"):
        LabelledTouches(**good, left=-1e-6)
    with pytest.raises(ArgumentError, match="with 2 chips; got 1 with 3"):
        calibrate_touches(table.of_chips((1, 2)), LabelledTouches(**good), noise)
    with pytest.raises(ArgumentError, match="count must be positive"):
        TouchPlanner(table, noise).plan(0)
    for wrong in ("drag", "place_spread", "force_spread"):
        with pytest.raises(ArgumentError, match="force must be positive, drag and spreads"):
            TouchPlanner(table, noise, **{wrong: -1e-9})
    with pytest.raises(ArgumentError, match="force must be positive, drag and spreads"):
        TouchPlanner(table, noise, force=0.0)
    none = {name: np.array(values)[:0] for name, values in good.items()}
    with pytest.raises(ArgumentError, match="at least one, with 3 chips; got 0"):
        calibrate_touches(table, LabelledTouches(**none), noise)
    bare = replace(table, modes=table.modes[:0], grip_modes=table.grip_modes[:0])
    with pytest.raises(ArgumentError, match="table must have modes"):
        TouchPlanner(bare, noise)
