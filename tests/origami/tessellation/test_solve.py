"""The search for the vertices: derivatives, exactness, fairness, and giving up."""

import time
from unittest import mock

import numpy as np
import pytest

from smoskin.origami.cell import size
from smoskin.origami.sheet import build_sheet
from smoskin.origami.surface.analytic import Cone, Cylinder, Sphere
from smoskin.origami.tessellation import solve
from smoskin.origami.tessellation.arc import arc_sheet
from smoskin.origami.tessellation.conditions import net_of
from smoskin.origami.tessellation.hinges import frame_of
from smoskin.origami.tessellation.solve import (
    Problem,
    Weights,
    conditions,
    place_slopes,
    placed,
    places,
    settle,
    settle_further,
)

CELLS = (3, 4)


def posed(cell, surface, radius, *, foldable=True, pull=3e3):
    """A problem and its start."""
    parameters, heights = arc_sheet(cell, CELLS, radius)
    start = np.column_stack([parameters.reshape(-1, 2), heights.ravel()])
    sheet = build_sheet(cell, CELLS)
    problem = Problem(
        surface=surface,
        net=net_of(sheet.facets),
        frame=frame_of(places(surface, start), sheet.facets, sheet.creases),
        shape=(7, 9),
        bottom=heights.ravel() == 0,
        scale=float(size(cell).length),
        flat_foldable=foldable,
        sharpest=np.radians(110),
        depth=float(size(cell).height),
        weights=Weights(),
        pull=pull,
    )
    return problem, start


def test_derivatives_are_those_of_places_and_conditions(planar):
    problem, start = posed(planar.cell, Sphere(0.15), 0.15)
    rng = np.random.default_rng(0)
    layers = start + 3e-4 * rng.normal(size=start.shape)
    way, step = rng.normal(size=start.shape), 1e-7
    for of in (
        lambda x: place_slopes(problem.surface, x),
        lambda x: conditions(problem, placed(problem, x)),
    ):
        after, before = (np.ravel(of(layers + s * step * way)[0]) for s in (1, -1))
        slopes = of(layers)[1] @ way.ravel()
        np.testing.assert_allclose(slopes, (after - before) / (2 * step), rtol=1e-5, atol=1e-5)
    vertices, _ = place_slopes(problem.surface, layers)
    np.testing.assert_array_equal(vertices, places(problem.surface, layers))


def test_what_meets_the_conditions_stays_where_it_is(planar):
    problem, start = posed(planar.cell, Cylinder(0.1), 0.1)
    solution = settle(problem, start)
    assert solution.reached == 1.0
    np.testing.assert_allclose(solution.layers, start, atol=1e-12)


@pytest.mark.parametrize("foldable", [True, False])
def test_conditions_are_met_to_rounding(planar, foldable):
    problem, start = posed(planar.cell, Cone(0.07, 0.09, 0.12), 0.08, foldable=foldable)
    solution = settle(problem, start)
    assert solution.reached == 1.0
    assert solution.residual < 1e-12
    heights = np.abs(solution.layers[problem.bottom, 2])
    assert heights.max() == 0.0 if not foldable else 0.0 < heights.max() < 1e-5


def test_a_search_that_goes_on_comes_to_the_fairest_sheet(planar):
    problem, start = posed(planar.cell, Sphere(0.3), 0.3, foldable=False)
    fairest = settle(problem, start)
    with mock.patch.object(solve, "_FAIR", 1):
        early = settle(problem, start)
    assert np.abs(early.layers - fairest.layers).max() > 1e-3 * problem.scale
    later = settle_further(problem, start, early)
    assert later.residual < 1e-12
    np.testing.assert_allclose(later.layers, fairest.layers, atol=2e-4 * problem.scale)
    assert settle_further(problem, start, early, deadline=0.0).layers == pytest.approx(early.layers)


def test_a_firmer_pull_keeps_bottom_vertices_nearer(planar):
    def off(pull):
        problem, start = posed(planar.cell, Sphere(0.3), 0.3, pull=pull)
        solution = settle(problem, start)
        assert solution.residual < 1e-9
        return np.abs(solution.layers[problem.bottom, 2]).max()

    assert off(1e3) < 0.5 * off(1.0)


def test_the_search_ends_at_its_deadline_and_reports_on_the_way(planar):
    problem, start = posed(planar.cell, Sphere(0.15), 0.15, foldable=False)
    shares = []
    settle(problem, start, progress=lambda what, share: shares.append(share))
    assert shares == sorted(shares)
    assert 0.0 < shares[0] <= shares[-1] <= 1.0
    stopped = settle(problem, start, deadline=time.monotonic() - 1.0)
    assert stopped.reached == 0.0
    np.testing.assert_array_equal(stopped.layers, start)
    assert stopped.residual > 1e-3
