"""The likeliest touch, or two, from one reading, wherever the search starts."""

import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.sensing.bayes.posterior import Descent
from smoskin.sensing.bayes.priors import Standing, TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.signals import signal_noise
from tables_of_response import reduced_table, table_with_modes

WHERE = np.array([[0.033, 0.05], [0.085, 0.11]])
FORCE = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, -0.7]])
STRAIGHT = TouchPriors(drag_spread=0.0)


@pytest.fixture(scope="module")
def solver(skin, table):
    return TouchSolver(table, signal_noise(skin), STRAIGHT)


def apart(places, true=WHERE):
    """Mean distance of the places, in the better order."""
    return min(np.hypot(*(places - turned).T).mean() for turned in (true, true[::-1]))


def pairs(count, seed):
    rng = np.random.default_rng(seed)
    while count:
        where = rng.uniform([0.015, 0.02], [0.105, 0.14], (2, 2))
        if np.hypot(*(where[0] - where[1])) > 0.04:
            count -= 1
            yield where, np.array([[0, 0, -f] for f in rng.uniform(0.3, 1.0, 2)])


def test_pairs_are_found_wherever_they_are(table, solver):
    """The reduced model tells pairs poorly: what is found is as good as noise lets anything be."""
    for where, force in pairs(8, seed=1):
        exact = table.together(where[None], force[None])[0]
        pair = solver.pair(exact)
        assert pair.misfit < 4.0
        assert pair.evidence > solver.single(exact).evidence
        led = solver.pair(exact, np.concatenate([where + 2e-3, force], axis=1))
        assert led.misfit < 0.5
        assert apart(led.values[:, :2], where) < 2e-3


def test_a_touch_that_stood_there_tells_the_other(planar):
    """On the shipped table, which tells pairs better than the reduced model."""
    shipped = load_response_table("planar")
    bare = {"modes": shipped.modes[:0], "grip_modes": shipped.grip_modes[:0], "warp_modes": None}
    table = replace(shipped, **bare)
    solver = TouchSolver(table, signal_noise(planar), STRAIGHT)
    exact = table.together(WHERE[None], FORCE[None])[0]
    free = solver.pair(exact, np.concatenate([WHERE, FORCE], axis=1))
    standing = Standing(WHERE[1], 1e6 * np.eye(2))
    led = solver.pair(exact, standing=standing)
    assert led.values[0, :2] == pytest.approx(WHERE[1], abs=1e-3)
    assert apart(led.values[:, :2]) < 1e-3
    other = np.hypot(*(free.values[:, :2] - WHERE[0]).T).argmin()
    sure = [np.trace(part[:2, :2]) for part in (led.covariance[1], free.covariance[other])]
    assert sure[0] < sure[1]
    # Where it cannot have stood, the reading has it.
    astray = solver.pair(exact, standing=Standing(np.array([0.1, 0.02]), 1e8 * np.eye(2)))
    assert astray.misfit < free.misfit + 0.5


def test_nothing_explains_signals_of_no_touch(solver):
    """Where no start has forces that press, an answer is given all the same."""
    posterior = solver.pair(-1e-3 * np.ones(9))
    assert np.isfinite(posterior.values).all()
    assert posterior.misfit > 1000


def test_the_first_guess_does_not_decide(skin):
    table = reduced_table(skin)
    solver = TouchSolver(table, signal_noise(skin))
    place, force = np.array([0.081, 0.052]), np.array([0.05, 0.0, -0.6])
    exact = table.signals(place[None], force[None])[0]
    free = solver.single(exact)
    for guess in ([0.08, 0.05, 0.0, 0.0, -0.5], [0.02, 0.14, 0.3, 0.3, -0.1]):
        led = solver.single(exact, np.array([guess]))
        # Steps end where they lower the cost by less than a thousandth.
        assert led.values[0] == pytest.approx(free.values[0], abs=5e-5)
    assert free.values[0, :2] == pytest.approx(place, abs=1e-4)
    assert free.values[0, 2:] == pytest.approx(force, abs=2e-3)


def test_places_on_the_rim_are_told(skin):
    table = reduced_table(skin)
    solver = TouchSolver(table, signal_noise(skin), TouchPriors(drag_spread=0.0))
    for place in ([0.002, 0.08], [0.118, 0.003]):
        exact = table.signals([place], [[0.0, 0.0, -0.5]])[0]
        assert solver.single(exact).values[0, :2] == pytest.approx(place, abs=1e-4)


def test_how_many_touches_there_are(skin):
    table = reduced_table(skin)
    noise = signal_noise(skin)
    solver = TouchSolver(table, noise, STRAIGHT)
    rng = np.random.default_rng(8)
    single = table.signals([[0.045, 0.06]], [[0.0, 0.0, -0.6]])[0]
    pair = table.together(WHERE[None], FORCE[None])[0]
    for _ in range(5):
        noisy = rng.multivariate_normal(np.zeros(9), noise)
        assert solver.single(single + noisy).evidence > solver.pair(single + noisy).evidence
        assert solver.pair(pair + noisy).evidence > solver.single(pair + noisy).evidence
    # Nine signals of six unknowns: what was put in must at least be explained.
    assert solver.pair(pair).misfit < 9


class StatedProblem:
    """Ends each descent at the next of these costs, and says where it began."""

    def __init__(self, *costs):
        self.costs, self.begun = list(costs), []

    def unknowns(self, values):
        return values

    def descend(self, signals, start, standing=None, steps=15):
        self.begun.append((start, standing, steps))
        cost = self.costs.pop(0)
        return Descent(np.full(1, cost), 0.0, np.zeros((1, 9)), 2 * cost, cost)

    def descend_all(self, signals, starts, standing=None, steps=15, good=0.0):
        return [self.descend(signals, start, standing, steps) for start in starts]

    def posteriors(self, ends, standing=None):
        return ends[0].cost

    def posterior(self, end, standing=None):
        return end.cost


@pytest.mark.parametrize(
    ("costs", "taken", "best"),
    [((17.9,), 1, 17.9), ((18.1, 8.9, 20.0, 9.5), 4, 8.9), ((18.1, 9.9, 20.0, 9.5), 4, 9.5)],
)
def test_a_guess_is_followed_where_it_fits_and_else_the_likeliest_starts(
    skin, monkeypatch, costs, taken, best
):
    """Four a signal is fit for a guess; else three starts are tried and the best is taken."""
    table = reduced_table(skin)
    solver, problem = TouchSolver(table, signal_noise(skin)), StatedProblem(*costs)
    exact = table.signals(WHERE[:1], FORCE[:1])[0]
    monkeypatch.setitem(solver._problems.of, 1, problem)
    guess = np.array([[0.1, 0.02, 0.0, 0.0, -0.2]])
    assert solver.single(exact, guess) == best
    assert len(problem.begun) == taken
    np.testing.assert_array_equal(problem.begun[0][0], guess)
    if taken > 1:  # the nearest places of the grid
        assert math.dist(problem.begun[1][0][0, :2], WHERE[0]) < 8e-3


@pytest.mark.parametrize(("cost", "taken"), [(49.9, 1), (50.1, 4)])
def test_a_guess_is_followed_as_well_where_its_misfit_is_enough(skin, monkeypatch, cost, taken):
    table = reduced_table(skin)
    solver, problem = TouchSolver(table, signal_noise(skin)), StatedProblem(cost, 60.0, 60.0, 60.0)
    monkeypatch.setitem(solver._problems.of, 1, problem)
    exact = table.signals(WHERE[:1], FORCE[:1])[0]
    solver.single(exact, np.array([[0.1, 0.02, 0.0, 0.0, -0.2]]), enough=100.0)
    assert len(problem.begun) == taken


def test_of_a_pair_three_starts_or_six_are_followed(table, skin, monkeypatch):
    solver = TouchSolver(table, signal_noise(skin), STRAIGHT)
    exact = table.together(WHERE[None], FORCE[None])[0]
    solver.pair(exact)
    for ends, taken in (((9.0, 4.4, 6.0), 3), ((4.6, 5.0, 4.6, 4.7, 7.0, 4.3), 6)):
        problem = StatedProblem(*ends)
        monkeypatch.setitem(solver._problems.of, 2, problem)
        assert solver.pair(exact) == min(ends)
        assert [row[2] for row in problem.begun] == [10] * taken


def test_a_touch_that_cannot_have_stood_there_is_let_go(table, skin, monkeypatch):
    solver = TouchSolver(table, signal_noise(skin), STRAIGHT)
    exact = table.together(WHERE[None], FORCE[None])[0]
    solver.pair(exact)
    standing = Standing(WHERE[0], 1e6 * np.eye(2))
    for cost, let_go in ((17.9, False), (18.1, True)):
        problem = StatedProblem(*[cost] * 60)
        monkeypatch.setitem(solver._problems.of, 2, problem)
        solver.pair(exact, None, standing)
        assert (problem.begun[-1][1] is None) == let_go
        np.testing.assert_array_equal(problem.begun[0][0][0, :2], WHERE[0])


def test_forces_end_at_a_fifth_and_three_times_those_of_the_table(skin):
    table = reduced_table(skin)
    solver = TouchSolver(table, signal_noise(skin), STRAIGHT)
    least, most = table.forces
    exact = table.signals([[0.05, 0.06]], [[0.0, 0.0, -0.5]])[0]
    assert solver.single(1e-4 * exact).values[0, 4] == pytest.approx(-least / 5)
    assert solver.single(20 * exact).values[0, 4] == pytest.approx(-3 * most)


def test_warm_rubber_needs_more_force_of_one_and_of_two(table, skin):
    stiff = replace(table, softening=0.01, warmth=np.zeros_like(table.warmth))
    solver = TouchSolver(stiff, signal_noise(skin), STRAIGHT)
    single = stiff.signals(WHERE[:1], FORCE[:1])[0]
    pair = stiff.together(WHERE[None], FORCE[None])[0]
    guess = np.concatenate([WHERE, FORCE], axis=1)
    for temperature, factor in ((25.0, 1.0), (35.0, 1.1), (25.0, 1.0)):
        solver.warm_to(temperature)
        assert solver.single(single).values[0, 4] == pytest.approx(factor * FORCE[0, 2], rel=1e-2)
        led = solver.pair(pair, guess * [1, 1, 1, 1, factor])
        assert led.values[:, 4] == pytest.approx(factor * FORCE[:, 2], rel=3e-2)


def test_modes_that_are_left_are_misfit_of_a_newton(skin):
    table = table_with_modes(skin)
    added = TouchSolver(table, signal_noise(skin)).misfit - table.misfit
    where = np.random.default_rng(0).uniform([0, 0], table.basis.extent, (400, 2))
    modes = table.mode_signals(where, np.tile([0.0, 0.0, -1.0], (400, 1)))
    expected = np.einsum("bkc,bkd->cd", modes, modes) / 400
    # The base chip hardly reads a press.
    np.testing.assert_allclose(np.diag(added)[3:], np.diag(expected)[3:], rtol=0.2)


@pytest.mark.parametrize("drag", [(0.2, 0.1), (-0.2, 0.1), (0.1, -0.2), (-0.1, -0.2)])
def test_a_single_touch_starts_near_itself_whichever_way_it_drags(skin, drag):
    table = reduced_table(skin)
    solver = TouchSolver(table, signal_noise(skin))
    exact = table.signals(WHERE[:1], [[*drag, -0.5]])[0]
    (start,) = solver._single_starts.best(exact, 1, None)
    assert math.dist(start[0, :2], WHERE[0]) < 8e-3
    assert start[0, 4] == pytest.approx(-0.5, rel=0.25)
    assert np.sign(start[0, 2:4]).tolist() == np.sign(drag).tolist()
