"""The bound over the skin."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.response.bound import bound_map, bound_of_slopes, figures, information
from smoskin.sensing.signals.signals import signal_noise
from tables_of_response import BASIS, plain, random_table, reduced_table, table_with_modes


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def test_half_the_noise_is_half_the_bound_where_the_place_can_be_told(skin):
    table, noise = reduced_table(skin), signal_noise(skin)
    whole, half = (bound_map(table, spread, drags=False) for spread in (noise, noise / 4))
    seen = whole.location < 1e-3
    assert seen.any()
    assert half.location[seen] == pytest.approx(whole.location[seen] / 2, rel=1e-2)
    assert half.force[seen] == pytest.approx(whole.force[seen] / 2, rel=1e-2)


def test_more_unknowns_or_fewer_chips_know_less(skin):
    table, noise = reduced_table(skin), signal_noise(skin)
    straight = bound_map(table, noise, drags=False, places=(13, 17))
    dragged = bound_map(table, noise, places=(13, 17))
    assert (dragged.location >= straight.location - 1e-12).all()
    assert (straight.drag == 0).all()
    assert (dragged.drag > 0).all()
    fewer = bound_map(table.of_chips((1, 2)), noise[3:, 3:], drags=False, places=(13, 17))
    assert (fewer.location >= straight.location - 1e-12).all()


def test_a_table_that_knows_less_of_the_skin_bounds_higher(skin):
    table, noise = table_with_modes(skin), signal_noise(skin)
    blank, known = (bound_map(table, noise, misfit=m, places=(13, 17)) for m in (True, False))
    assert (blank.location >= known.location - 1e-12).all()
    assert np.median(blank.location) > 2 * np.median(known.location)


def test_every_place_of_the_reference_design_can_be_told(skin):
    bound = bound_map(reduced_table(skin), signal_noise(skin), drags=False)
    assert not bound.blind.any()
    assert bound.super_resolution.area > 1
    assert bound.super_resolution.spacing > 1


def test_one_chip_is_blind_to_a_drag_and_a_place_at_once(skin):
    table, noise = reduced_table(skin).of_chips((1,)), signal_noise(skin, (1,))
    bound = bound_map(table, noise, places=(13, 17))
    assert bound.blind.all()
    assert bound.super_resolution == (0.0, 0.0)


def test_a_place_that_is_not_known_at_all_is_known_to_lie_on_the_skin():
    x, y = np.linspace(0.0, 0.1, 11), np.linspace(0.0, 0.2, 21)
    bound = bound_of_slopes(x, y, np.zeros((11, 21, 3, 5)), 1e-12 * np.eye(3), drags=False)
    np.testing.assert_allclose(bound.place, np.broadcast_to([0.1, 0.2], (11, 21, 2)) / 12**0.5)
    assert bound.force == pytest.approx(1e3)


def test_slopes_of_a_table_bound_as_the_table_does(skin):
    table, noise = reduced_table(skin), signal_noise(skin)
    direct = bound_map(table, noise, places=(5, 7))
    at = np.stack(np.meshgrid(direct.x, direct.y, indexing="ij"), axis=-1).reshape(-1, 2)
    slopes = table.slopes(at, np.tile([0.0, 0.0, -0.5], (len(at), 1)))
    given = bound_of_slopes(direct.x, direct.y, slopes.reshape(5, 7, 9, 5), noise)
    assert given.location == pytest.approx(direct.location)
    assert given.drag == pytest.approx(direct.drag)
    assert given.super_resolution == pytest.approx(direct.super_resolution)


def test_what_chips_tell_adds_up(skin):
    rng = np.random.default_rng(0)
    slopes, noise = rng.normal(size=(2, 3, 9, 5)), signal_noise(skin)
    parts = sum(
        information(slopes[..., rows, :], noise[rows, rows])
        for rows in (slice(0, 3), slice(3, 6), slice(6, 9))
    )
    assert parts == pytest.approx(information(slopes, noise))


def test_figures_of_a_map():
    assert figures(np.arange(0.0, 101.0) ** 2) == (3350.0, 2500.0, 9801.0, 10000.0)


def test_the_solver_meets_the_bound(skin):
    table, noise = reduced_table(skin), signal_noise(skin)
    rng = np.random.default_rng(2)
    place, force = np.array([0.047, 0.071]), np.array([0.0, 0.0, -0.5])
    exact = table.signals(place[None], force[None])[0]
    solver = TouchSolver(table, noise, TouchPriors(drag_spread=0.0))
    fits = [solver.single(exact + rng.multivariate_normal(np.zeros(9), noise)) for _ in range(300)]
    error = np.stack([fit.values[0, :2] for fit in fits]) - place
    stated = np.sqrt(np.einsum("bii->b", [fit.covariance[0, :2, :2] for fit in fits]).mean())
    reached = np.sqrt(np.mean((error**2).sum(axis=1)))
    assert reached == pytest.approx(stated, rel=0.25)
    slopes = table.slopes(place[None], force[None])[0][:, [0, 1, 4]]
    bound = np.linalg.inv(slopes.T @ np.linalg.inv(noise) @ slopes)
    assert reached > 0.9 * np.sqrt(np.trace(bound[:2, :2]))
    assert reached < 1.5 * np.sqrt(np.trace(bound[:2, :2]))


@pytest.mark.parametrize("drags", [True, False])
@pytest.mark.parametrize("misfit", [True, False])
def test_the_bound_is_the_inverse_of_the_information(misfit, drags):
    """At one place under 0.3 N, all components, from slopes taken by differences."""
    table, noise, force = random_table(), 1e-12 * (np.eye(9) + 0.3), 0.3
    bound = bound_map(table, noise, force=force, misfit=misfit, drags=drags, places=(4, 5))
    assert_allclose(bound.x, np.linspace(0, BASIS.extent[0], 4))
    assert_allclose(bound.y, np.linspace(0, BASIS.extent[1], 5))
    assert bound.chips == 3
    at = np.array([bound.x[1], bound.y[3], 0.0, 0.0, -force])
    steps = np.diag([1e-7, 1e-7, 1e-6, 1e-6, 1e-6])
    ends = [table.signals((at + s * steps)[:, :2], (at + s * steps)[:, 2:]) for s in (1, -1)]
    slopes = ((ends[0] - ends[1]) / (2 * steps.sum(axis=0))[:, None]).T
    spread = noise.copy()
    if misfit:
        modes = table.mode_signals(at[None, :2], at[None, 2:])[0]
        spread += force**2 * table.misfit + modes.T @ modes
    free = [0, 1, 2, 3, 4] if drags else [0, 1, 4]
    level = np.diag([*12 / BASIS.extent**2, 1e-6, 1e-6, 1e-6])[np.ix_(free, free)]
    fisher = slopes[:, free].T @ np.linalg.inv(spread) @ slopes[:, free] + level
    expected = np.zeros(5)
    expected[free] = np.sqrt(np.diag(np.linalg.inv(fisher)))
    reached = [*bound.place[1, 3], *bound.drag[1, 3], bound.force[1, 3]]
    assert_allclose(reached, expected, rtol=1e-5)
    assert bound.location[1, 3] == pytest.approx(np.hypot(*expected[:2]), rel=1e-5)


def test_the_usual_bound_is_of_half_a_newton_with_drags_on_the_skin_as_known():
    table, noise = random_table(), 1e-12 * np.eye(9)
    usual = bound_map(table, noise)
    assert usual.place.shape == (49, 65, 2)
    stated = bound_map(table, noise, force=0.5, drags=True, misfit=False, places=(49, 65))
    assert_allclose(usual.place, stated.place)


def test_a_place_is_blind_from_five_millimetres():
    x, y = np.linspace(0.0, 2.0, 3), np.linspace(0.0, 3.0, 4)
    # Of a metre's skin, so that the prior of the place says nothing.
    slopes = np.zeros((3, 4, 3, 5))
    slopes[..., 0, 0] = slopes[..., 1, 1] = slopes[..., 2, 4] = 1.0
    slopes[1, 2, 1, 1] = 0.25
    seen = 0.003
    for far, blind in ((3.99e-3, False), (4.01e-3, True)):
        noise = np.diag([seen**2, (far / 4) ** 2, 1e-6])
        bound = bound_of_slopes(x, y, slopes, noise, drags=False)
        assert bound.location[1, 2] == pytest.approx(np.hypot(seen, far), rel=1e-4)
        assert bound.blind[1, 2] == blind
        assert bound.blind.sum() == blind
        squared = bound.location[~bound.blind] ** 2
        area = 6.0 / 1
        assert bound.super_resolution.area == pytest.approx(area / squared.mean())
        mean = np.sqrt(squared).mean() * np.sqrt(np.pi) / 2
        assert bound.super_resolution.spacing == pytest.approx(np.sqrt(area) / mean)


def test_wrong_use_is_refused(skin):
    table, noise = reduced_table(skin), signal_noise(skin)
    with pytest.raises(ArgumentError, match="force must be positive and places two or more"):
        bound_map(table, noise, force=0.0)
    with pytest.raises(ArgumentError, match="force must be positive and places two or more"):
        bound_map(table, noise, places=(2, 1))
    assert bound_map(table, noise, places=(2, 2)).place.shape == (2, 2, 2)
    with pytest.raises(ArgumentError, match="two places or more"):
        bound_of_slopes(np.zeros(1), np.zeros(2), np.zeros((1, 2, 9, 5)), noise)
    with pytest.raises(ArgumentError, match="slopes"):
        bound_of_slopes(np.zeros(2), np.zeros(2), np.zeros((2, 2, 9, 4)), noise)
