"""How fast and how surely a descent comes to the likeliest touch."""

import numpy as np
import pytest

from smoskin.sensing.bayes.posterior import TouchProblem
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.signals.signals import signal_noise

WHERE, SLANTED = np.array([0.05, 0.07]), np.array([0.21, -0.13, -0.4])


@pytest.fixture(scope="module")
def solver(table, skin):
    return TouchSolver(table, signal_noise(skin), TouchPriors())


def begun(solver, away, harder=1.0):
    """The problem of one touch, its signals, and unknowns so far from it."""
    problem = solver._problem(1)
    signals = solver.table.signals([WHERE], [SLANTED])[0]
    start = np.array([[*(WHERE + away), 0.1, 0.0, -0.4 * harder]])
    return problem, signals, problem.unknowns(start)


@pytest.mark.parametrize("away", [(3e-3, -2e-3), (-4e-3, 0.0)])
def test_near_the_answer_a_step_of_gauss_and_newton_is_nearly_all(solver, away):
    problem, signals, start = begun(solver, away)
    best = problem.descend(signals, start)
    # Steps end where they lower the cost by less than a thousandth: here 4 um, where noise leaves
    # 170 um.
    np.testing.assert_allclose(best.unknowns[:2], WHERE, atol=5e-6)
    for steps, left in ((1, 0.03), (2, 0.003)):
        end = problem.descend(signals, start, steps=steps)
        off = np.linalg.norm(end.unknowns[:2] - best.unknowns[:2])
        assert off < left * np.linalg.norm(away)


@pytest.mark.parametrize("away", [(50e-3, -50e-3), (-45e-3, 80e-3), (60e-3, 80e-3)])
def test_no_step_leads_uphill_however_far_it_starts(solver, away):
    problem, signals, start = begun(solver, away, harder=0.1)
    costs = [problem.descend(signals, start, steps=steps).cost for steps in range(1, 25)]
    # Weights follow the force in the first six steps; from there on it only falls.
    assert (np.diff(costs[6:]) <= 1e-9).all()
    assert costs[-1] < 0.1 * costs[0] or costs[-1] < 5


def test_a_step_moves_a_place_by_3_cm_and_a_force_by_a_factor_of_e_at_most(solver):
    problem, signals, start = begun(solver, (-45e-3, 80e-3), harder=0.1)
    for steps in range(1, 20):
        before = problem.descend(signals, start, steps=steps).unknowns
        after = problem.descend(signals, start, steps=steps + 1).unknowns
        assert np.abs(after - before)[:2].max() <= 0.03 + 1e-12
        assert abs(after - before)[4] <= 1.0 + 1e-12


class Bent:
    """A problem of a straight touch whose signals bend so that whole steps lead uphill."""

    touch = np.array([0.05, 0.07, -0.9])
    mix = np.random.default_rng(5).normal(size=(3, 9)) / [[0.01], [0.01], [0.3]]

    def __init__(self, table, noise, slope=1.0):
        self.asked, self._slope = 0, slope
        priors = TouchPriors(drag_spread=0.0)
        self.problem = TouchProblem(self, 1, table, noise, 1e-12 * np.eye(9), priors)

    def __call__(self, at):
        self.asked += 1
        bent = (at - self.touch) @ self.mix
        return 1e-4 * np.arctan(bent), self._slope * 1e-4 * self.mix / (1 + bent[..., None, :] ** 2)

    def descend(self, start, **steps):
        signals, _ = self(self.touch)
        self.asked = 0
        return self.problem.descend(signals, np.array(start), **steps)

    def cost(self, start, **steps):
        return self.descend(start, **steps).cost


@pytest.mark.parametrize(
    ("start", "costs"),
    [
        ((0.06, 0.05, -1.5), [6943.304, 6063.969, *[6508.939] * 3, 1410.611, 318.076, 5.241931]),
        ((0.07, 0.09, -2.0), [7120.899, 6714.489, *[6533.63] * 3, 1993.644, 251.8253, 0.394117]),
    ],
)
def test_signals_that_bend_are_followed_in_the_same_steps_as_ever(table, skin, start, costs):
    bent = Bent(table, signal_noise(skin))
    taken = [bent.cost(start, steps=steps) for steps in range(1, 9)]
    np.testing.assert_allclose(taken, costs, rtol=2e-5)


def test_a_descent_that_finds_no_way_down_ends_after_ten_tries(table, skin):
    bent = Bent(table, signal_noise(skin), slope=-1.0)
    start = (0.06, 0.05, -1.5)
    assert bent.cost(start) == bent.cost(start, steps=1)
    bent.cost(start)
    assert bent.asked == 1 + 10


@pytest.mark.parametrize(("gain", "asked"), [(0.95e-3, 1), (1.05e-3, 2)])
def test_a_step_is_worth_taking_for_a_thousandth_of_a_nat(table, skin, gain, asked):
    bent, away = Bent(table, signal_noise(skin)), np.array([1e-9, 2e-9, 3e-8])
    costs = bent.cost(bent.touch + away)  # as small as the square of how far it is away
    bent.cost(bent.touch + away * np.sqrt(gain / costs))
    assert bent.asked == asked


def test_what_is_not_settled_after_fifteen_steps_is_left(table, skin):
    """Slopes that are told ten times too steep lead a tenth of the way each time."""
    bent = Bent(table, signal_noise(skin), slope=10.0)
    bent.descend((0.053, 0.068, -1.0))
    assert bent.asked == 1 + 15


def test_a_blind_skin_knows_what_was_known_beforehand(table, skin):
    """A place anywhere on it, and of the force's logarithm next to nothing."""
    blind = Bent(table, signal_noise(skin), slope=0.0)
    known = blind.problem.posterior(blind.descend((0.05, 0.07, -0.9)))
    spread = np.sqrt(known.covariance[0].diagonal())
    np.testing.assert_allclose(spread[:2], table.basis.extent / np.sqrt(12))
    np.testing.assert_allclose(spread[2:], [0.0, 0.0, np.exp(-0.9) / np.sqrt(1e-9)])


def test_descents_together_end_where_each_ends_alone(solver):
    problem, signals, _ = begun(solver, (0.0, 0.0))
    starts = np.stack(
        [
            begun(solver, away, harder)[2]
            for away, harder in (
                ((3e-3, -2e-3), 1.0),
                ((50e-3, -50e-3), 0.1),
                ((-45e-3, 80e-3), 0.1),
                ((0.0, 1e-3), 1.0),
            )
        ]
    )
    for steps in (3, 15):
        together = problem.descend_all(signals, starts, steps=steps)
        for start, end in zip(starts, together, strict=True):
            alone = problem.descend(signals, start, steps=steps)
            np.testing.assert_allclose(end.unknowns, alone.unknowns, rtol=1e-8, atol=1e-10)
            assert end.cost == pytest.approx(alone.cost, rel=1e-8)
            assert end.misfit == pytest.approx(alone.misfit, rel=1e-8)


def test_when_a_descent_ends_well_the_others_take_two_more_steps(solver):
    problem, signals, near = begun(solver, (1e-4, 0.0))
    there = problem.descend(signals, near)
    far = begun(solver, (-45e-3, 80e-3), harder=0.1)[2]
    both = np.stack([there.unknowns, far])
    for good, steps in ((0.0, 15), (there.cost, 15), (there.cost + 1e-9, 2)):
        first, other = problem.descend_all(signals, both, good=good)
        assert first.cost == pytest.approx(there.cost)
        # Weighed by the force of the last step or of the one before.
        alone = problem.descend(signals, far, steps=steps).cost
        assert other.cost == pytest.approx(alone, rel=1e-3)
    assert other.cost > 10 * problem.descend(signals, far).cost
