"""The bound over the skin."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.sensing.bound import bound_map
from smoskin.sensing.few_touch import plan_touches
from smoskin.sensing.posterior import TouchSolver
from smoskin.sensing.signals import signal_noise
from smoskin.sensing.touch_priors import TouchPriors
from tables_of_response import plain, reduced_table, table_with_modes


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def test_half_the_noise_is_half_the_bound_where_the_place_can_be_told(skin):
    table, noise = reduced_table(skin), signal_noise(skin)
    whole, half = (bound_map(table, one, drags=False) for one in (noise, noise / 4))
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


def test_the_rim_is_named_blind(skin):
    found = bound_map(reduced_table(skin), signal_noise(skin), drags=False)
    assert found.blind[0].all()
    assert found.blind[:, -1].all()
    # The outermost vertices lie 10 and 13.3 mm within the rim.
    named = found.blind_regions()
    assert any(one.startswith("x <=") for one in named)
    assert any(one.startswith("y >=") for one in named)
    assert 0.2 < found.blind.mean() < 0.6
    assert found.super_resolution.area > 1
    assert found.super_resolution.spacing > 1


def test_the_solver_meets_the_bound(skin):
    table, noise = reduced_table(skin), signal_noise(skin)
    rng = np.random.default_rng(2)
    place, force = np.array([0.047, 0.071]), np.array([0.0, 0.0, -0.5])
    exact = table.signals(place[None], force[None])[0]
    solver = TouchSolver(table, noise, TouchPriors(drag_spread=0.0))
    said = [solver.one(exact + rng.multivariate_normal(np.zeros(9), noise)) for _ in range(300)]
    error = np.stack([one.values[0, :2] for one in said]) - place
    stated = np.sqrt(np.einsum("bii->b", [one.covariance[0, :2, :2] for one in said]).mean())
    reached = np.sqrt(np.mean((error**2).sum(axis=1)))
    assert reached == pytest.approx(stated, rel=0.25)
    slopes = table.slopes(place[None], force[None])[0][:, [0, 1, 4]]
    bound = np.linalg.inv(slopes.T @ np.linalg.inv(noise) @ slopes)
    assert reached > 0.9 * np.sqrt(np.trace(bound[:2, :2]))
    assert reached < 1.5 * np.sqrt(np.trace(bound[:2, :2]))


def test_wrong_use_is_refused(skin):
    table, noise = reduced_table(skin), signal_noise(skin)
    with pytest.raises(ArgumentError, match="force and places must be positive"):
        bound_map(table, noise, force=0.0)
    assert len(plan_touches(table_with_modes(skin), 2, noise)) == 2
