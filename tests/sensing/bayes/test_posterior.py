"""Covariance and evidence against what the equations say, by other means than the solver's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.sensing.bayes.priors import Standing, TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.signals.signals import signal_noise

WHERE = np.array([[0.033, 0.05], [0.085, 0.11]])
FORCE = np.array([[0.0, 0.0, -0.3], [0.0, 0.0, -1.0]])
SLANTED = np.array([0.21, -0.13, -0.4])


@pytest.fixture(scope="module")
def table(table):
    """A table that misses something, more in some signals than in others."""
    factor = np.random.default_rng(5).normal(size=(9, 9)) * 2e-6
    return replace(
        table,
        misfit=factor @ factor.T,
        pair_misfit=np.diag(np.arange(1.0, 10.0)) * 1e-12,
    )


@pytest.fixture(scope="module")
def noise(skin):
    return signal_noise(skin)


def solver_of(table, noise, drag=0.3):
    return TouchSolver(table, noise, TouchPriors(drag_spread=drag))


def spread_of(table, noise, force):
    """N + F^2 M of touches with these forces (K, 3), whose sum is F."""
    misfit = table.misfit + (table.pair_misfit if len(force) == 2 else 0)
    return noise + np.linalg.norm(force, axis=1).sum() ** 2 * misfit


def signals_of(table, values):
    """Signals (B, 9) of touches (B, K, 5)."""
    if values.shape[1] == 1:
        return table.signals(values[:, 0, :2], values[:, 0, 2:])
    return table.together(values[..., :2], values[..., 2:])


def expected_covariance(table, noise, values, rows, drag, standing=None):
    """H^-1 of touches (K, 5) by differences of the table's signals."""
    steps = np.array([1e-6, 1e-6, 1e-5, 1e-5, 1e-5])
    slopes = []
    for k in range(len(values)):
        for row in rows:
            moved = np.tile(values, (2, 1, 1))
            moved[:, k, row] += steps[row] * np.array([1, -1])
            high, low = signals_of(table, moved)
            slopes.append((high - low) / (2 * steps[row]))
    slopes = np.array(slopes)
    information = slopes @ np.linalg.solve(spread_of(table, noise, values[:, 2:]), slopes.T)
    level = {0: 12 / table.basis.extent[0] ** 2, 1: 12 / table.basis.extent[1] ** 2}
    prior = [level.get(row, drag**-2 if row in (2, 3) else 0.0) for row in rows]
    information += np.diag(np.tile(prior, len(values)))
    if standing is not None:
        information[:2, :2] += standing.precision
    return np.linalg.inv(information)


@pytest.mark.parametrize("drag", [0.3, 0.0])
def test_the_covariance_of_one_touch_is_that_of_the_linear_problem(table, noise, drag):
    rows = [0, 1, 2, 3, 4] if drag else [0, 1, 4]
    force = SLANTED if drag else np.array([0.0, 0.0, -0.4])
    exact = table.signals([WHERE[0]], [force])[0]
    posterior = solver_of(table, noise, drag).single(exact)
    expected = expected_covariance(table, noise, posterior.values, rows, drag)
    np.testing.assert_allclose(
        posterior.covariance[0][np.ix_(rows, rows)], expected, rtol=0.02, atol=0.02 * expected.max()
    )
    np.testing.assert_allclose(np.diag(posterior.covariance[0])[rows], np.diag(expected), rtol=0.02)
    if not drag:
        assert not posterior.covariance[0, 2:4].any()


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("stands", [False, True])
def test_the_covariance_of_two_touches_is_that_of_the_linear_problem(table, noise, first, stands):
    order = [first, 1 - first]
    values = np.concatenate([WHERE, FORCE], axis=1)[order]
    known = np.linalg.inv([[4e-6, 1e-6], [1e-6, 2e-6]])
    standing = Standing(WHERE[order[0]], known) if stands else None
    exact = table.together(WHERE[order][None], FORCE[order][None])[0]
    posterior = solver_of(table, noise).pair(exact, values, standing)
    expected = expected_covariance(table, noise, posterior.values, [0, 1, 4], 0.0, standing)
    for k in (0, 1):
        stated = np.diag(posterior.covariance[k])[[0, 1, 4]]
        block = expected[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(stated, np.diag(block), rtol=0.03)
        correlation = posterior.covariance[k][np.ix_([0, 1, 4], [0, 1, 4])]
        np.testing.assert_allclose(
            correlation / np.sqrt(np.outer(stated, stated)),
            block / np.sqrt(np.outer(np.diag(block), np.diag(block))),
            atol=0.03,
        )


def log_joint(table, noise, signals, values, drag):
    """log p(s, u | K) of touches (B, K, 5): normal signals, level places and log forces."""
    away = signals - signals_of(table, values)
    area, range_ = np.prod(table.basis.extent), math.log(table.forces[1] / table.forces[0])
    total = np.full(len(values), -values.shape[1] * math.log(area * range_))
    for row, (gap, force) in enumerate(zip(away, values[..., 2:], strict=True)):
        spread = spread_of(table, noise, force)
        total[row] -= 0.5 * gap @ np.linalg.solve(spread, gap)
        total[row] -= 0.5 * np.linalg.slogdet(2 * np.pi * spread)[1]
        if drag:
            total[row] -= 0.5 * (force[0, :2] ** 2).sum() / drag**2
            total[row] -= math.log(2 * np.pi * drag**2)
    return total


@pytest.mark.parametrize(("touches", "drag"), [(1, 0.3), (1, 0.0), (2, 0.3)])
def test_the_evidence_is_the_integral_of_the_likelihood(table, noise, touches, drag):
    """By importance sampling; both orders of two touches are one answer."""
    rng = np.random.default_rng(2)
    if touches == 2:  # which are told so poorly that their posterior is no normal
        noise = noise / 900
        table = replace(table, misfit=table.misfit / 900, pair_misfit=table.pair_misfit / 900)
    solver = solver_of(table, noise, drag)
    rows = [0, 1, 2, 3, 4] if drag and touches == 1 else [0, 1, 4]
    force = FORCE[:touches].copy()
    force[0] = SLANTED if len(rows) == 5 else force[0]
    true = np.concatenate([WHERE[:touches], force], axis=1)
    exact = signals_of(table, true[None])[0]
    signals = exact + np.linalg.cholesky(noise) @ rng.normal(size=9)
    posterior = solver.single(signals) if touches == 1 else solver.pair(signals, true)
    whole = expected_covariance(table, noise, posterior.values, rows, drag)
    at = posterior.values[:, rows].copy()
    scale = np.tile([1.0] * (len(rows) - 1) + [0.0], touches)
    scale[len(rows) - 1 :: len(rows)] = 1 / at[:, -1]
    at[:, -1] = np.log(-at[:, -1])
    factor = np.linalg.cholesky(1.3 * whole * np.outer(scale, scale))
    draws = rng.normal(size=(3000, at.size))
    unknowns = (at.ravel() + draws @ factor.T).reshape(3000, touches, -1)
    values = np.zeros((3000, touches, 5))
    values[..., rows] = unknowns
    values[..., 4] = -np.exp(unknowns[..., -1])
    log_density = (
        -0.5 * (draws**2).sum(axis=1)
        - np.log(np.diag(factor)).sum()
        - 0.5 * at.size * math.log(2 * np.pi)
    )
    inside = ((values[..., :2] >= 0) & (values[..., :2] <= table.basis.extent)).all(axis=(1, 2))
    weights = log_joint(table, noise, signals, values, drag if len(rows) == 5 else 0.0)
    weights = np.where(inside, weights - log_density, -np.inf)
    top = weights.max()
    integral = top + math.log(np.exp(weights - top).mean()) + math.log(touches)
    chance = math.log(TouchPriors().chances[touches])
    assert posterior.evidence == pytest.approx(integral + chance, abs=0.25)


@pytest.mark.parametrize("drag", [0.3, 0.02])
def test_what_is_found_is_the_likeliest(table, noise, drag):
    """Half a standard deviation away on any axis the posterior is lower by an eighth or more."""
    signals = table.signals([WHERE[0]], [SLANTED])[0]
    posterior = solver_of(table, noise, drag).single(signals)
    best = log_joint(table, noise, signals, posterior.values[None], drag)[0]
    for row, spread in enumerate(np.sqrt(np.diag(posterior.covariance[0]))):
        for sign in (-0.5, 0.5):
            moved = posterior.values.copy()
            moved[0, row] += sign * spread
            assert log_joint(table, noise, signals, moved[None], drag)[0] < best - 0.09


@pytest.mark.parametrize("drag", [0.25, 0.0])
def test_errors_are_as_large_as_stated_for_each_number(table, noise, drag):
    """Chi-square of many touches drawn as the priors say, from both sides."""
    rng = np.random.default_rng(4)
    solver = solver_of(table, noise, drag)
    rows = [0, 1, 2, 3, 4] if drag else [0, 1, 4]
    whitened, single = [], []
    for _ in range(250):
        force = np.array([*rng.normal(0, drag, 2), -math.exp(rng.uniform(-1.6, 0.0))])
        place = rng.uniform([0.03, 0.04], [0.09, 0.12])
        spread = spread_of(table, noise, force[None])
        signals = table.signals([place], [force])[0]
        posterior = solver.single(signals + np.linalg.cholesky(spread) @ rng.normal(size=9))
        error = (posterior.values[0] - np.concatenate([place, force]))[rows]
        covariance = posterior.covariance[0][np.ix_(rows, rows)]
        whitened.append(error @ np.linalg.solve(covariance, error))
        single.append(error**2 / np.diag(covariance))
    assert np.mean(whitened) == pytest.approx(len(rows), rel=0.2)
    np.testing.assert_allclose(np.mean(single, axis=0), 1.0, atol=0.3)


def test_misfit_counts_residuals_and_drags_in_their_spread(table, noise):
    force = np.array([0.3, 0.0, -0.5])
    posterior = solver_of(table, noise, 0.1).single(table.signals([WHERE[0]], [force])[0])
    values = posterior.values
    gap = table.signals([WHERE[0]], [force])[0] - signals_of(table, values[None])[0]
    spread = spread_of(table, noise, values[:, 2:])
    expected = gap @ np.linalg.solve(spread, gap) + (values[0, 2:4] ** 2).sum() / 0.1**2
    assert posterior.misfit == pytest.approx(expected, rel=1e-2)
    assert posterior.misfit > 1.0


def test_two_touches_nearer_than_two_centimetres_are_no_pair(table, noise):
    solver = solver_of(table, noise)
    for gap, pair in ((0.0195, False), (0.0205, True)):
        where = np.array([[0.05, 0.06], [0.05 + gap, 0.06]])
        exact = table.together(where[None], FORCE[None])[0]
        standing = Standing(where[0], 1e14 * np.eye(2))
        posterior = solver.pair(exact, np.concatenate([where, FORCE], axis=1), standing)
        assert np.isfinite(posterior.evidence) == pair


@pytest.mark.parametrize("noise", [-np.eye(9), np.zeros((9, 9))])
def test_noise_must_be_a_covariance(table, noise):
    with pytest.raises(ArgumentError, match="noise must be a covariance"):
        TouchSolver(table, noise)


def test_touches_found_twice_in_any_order_are_one_answer(table, noise):
    """Another answer counts by its height and breadth, if it is no more than 5 nats less likely."""
    problem, _ = solver_of(table, noise).ready_for_pair()
    values = np.concatenate([WHERE, FORCE], axis=1)
    exact = table.together(WHERE[None], FORCE[None])[0]
    begun = np.stack([problem.unknowns(values), problem.unknowns(values[::-1])])
    first, again = problem.descend_all(exact, begun)
    assert not problem.posteriors([first, again]).others
    moved = first.unknowns + np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.0])
    broad = first._replace(
        unknowns=moved[[3, 4, 5, 0, 1, 2]],
        slopes=0.5 * first.slopes[[3, 4, 5, 0, 1, 2]],
        cost=first.cost + 2.0,
    )
    posterior = problem.posteriors([first, broad])
    (other,) = posterior.others
    np.testing.assert_allclose(other.values[:, :2] - posterior.values[:, :2], [[0.02, 0], [0, 0]])
    breadth = 0.5 * np.subtract(
        *(
            np.linalg.slogdet(end.slopes @ end.slopes.T + np.diag(problem._curvature))[1]
            for end in (first, broad)
        )
    )
    assert other.share / posterior.share == pytest.approx(math.exp(breadth - 2.0))
    assert other.share + posterior.share == pytest.approx(1.0)
    unlikely = broad._replace(slopes=first.slopes, cost=first.cost + 5.1)
    assert not problem.posteriors([first, unlikely]).others
