"""Coarse places from which a search begins: at the touch's own, it begins with nearly its force."""

import numpy as np
import pytest

from smoskin.origami.geometry import middles_of_fields, places_to_the_rim
from smoskin.sensing.bayes.priors import Standing, TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.signals.signals import signal_noise


@pytest.mark.parametrize("drag_spread", [0.0, 0.3])
def test_a_single_start_is_at_the_touch_with_its_press(skin, table, drag_spread):
    solver = TouchSolver(table, signal_noise(skin), TouchPriors(drag_spread=drag_spread))
    places = places_to_the_rim(table.basis.extent, (16, 20))[[37, 150, 215, 290]]
    for place in places:
        signals = table.signals(place[None], np.array([[0.0, 0.0, -0.5]]))[0]
        start = solver._single_starts.best(signals, 1, None)[0]
        assert np.allclose(start[0, :2], place, rtol=0, atol=1e-9)
        assert start[0, 2:] == pytest.approx([0.0, 0.0, -0.5], abs=2e-3)


def test_a_pair_starts_at_the_touches_with_their_presses(skin, table):
    solver = TouchSolver(table, signal_noise(skin), TouchPriors(drag_spread=0.0))
    place = middles_of_fields(table.basis.extent, (8, 10))[[13, 57]]
    force = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, -0.7]])
    signals = table.together(place[None], force[None])[0]
    solver.pair(signals)
    start = solver._pair_starts.best(signals, 1, None)[0]
    order = np.argsort(start[:, 4])[::-1]
    assert np.allclose(start[order, :2], place, rtol=0, atol=1e-9)
    assert start[order, 2:] == pytest.approx(force, abs=0.02)


@pytest.mark.parametrize("drag_spread", [0.0, 0.02, 0.3])
def test_a_single_starts_with_the_likeliest_forces_there(skin, table, drag_spread):
    """By least squares, of slopes at half a newton, with what is known of drags beforehand."""
    solver = TouchSolver(table, signal_noise(skin), TouchPriors(drag_spread=drag_spread))
    signals = table.signals([[0.05, 0.07]], [[0.2, -0.1, -0.4]])[0]
    start = solver._single_starts.best(signals, 1, None)[0][0]
    white = solver._problem(1).whitener(0.5**2)
    slopes = white @ table.slopes([start[:2]], [[0.0, 0.0, -0.5]])[0][:, 2:]
    force = np.zeros(3)
    if drag_spread:
        known = np.diag([drag_spread**-2, drag_spread**-2, 0.0])
        force = np.linalg.solve(slopes.T @ slopes + known, slopes.T @ white @ signals)
    else:
        force[2] = (slopes[:, 2] @ white @ signals) / (slopes[:, 2] @ slopes[:, 2])
    np.testing.assert_allclose(start[2:], force, rtol=1e-6, atol=1e-9)


STARTS = {
    False: [
        [(0.0675, 0.088, -0.529963), (0.1125, 0.104, -0.0978274)],
        [(0.0525, 0.072, -0.375225), (0.0825, 0.104, -0.308759)],
        [(0.0225, 0.152, -0.468771), (0.0825, 0.056, -0.850110)],
    ],
    True: [
        [(0.085, 0.11, -0.107204), (0.0675, 0.088, -0.519634)],
        [(0.085, 0.11, -0.577258), (0.0375, 0.056, -0.327585)],
        [(0.085, 0.11, -0.842305), (0.0225, 0.024, -0.303109)],
    ],
}
"""Place and press of both touches, the likeliest pair first."""


@pytest.mark.parametrize("stands", [False, True])
def test_pairs_start_where_they_have_ever_since(skin, table, stands):
    place, force = np.array([[0.034, 0.045], [0.085, 0.11]]), np.zeros((2, 3))
    force[:, 2] = -0.5, -0.8
    signals = table.together(place[None], force[None])[0]
    solver = TouchSolver(table, signal_noise(skin))
    solver.pair(signals)
    standing = Standing(place[1], 1e6 * np.eye(2)) if stands else None
    starts = np.array(solver._pair_starts.best(signals, 3, standing))
    assert not starts[:, :, 2:4].any()
    np.testing.assert_allclose(starts[:, :, [0, 1, 4]], STARTS[stands], rtol=1e-5)
