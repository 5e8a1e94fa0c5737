"""Coarse places from which a search begins: at the touch's own, it begins with nearly its force."""

import numpy as np
import pytest

from smoskin.origami.geometry import middles_of_fields, places_to_the_rim
from smoskin.sensing.bayes.priors import TouchPriors
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
    solver.two(signals)
    start = solver._pair_starts.best(signals, 1, None)[0]
    order = np.argsort(start[:, 4])[::-1]
    assert np.allclose(start[order, :2], place, rtol=0, atol=1e-9)
    assert start[order, 2:] == pytest.approx(force, abs=0.02)
