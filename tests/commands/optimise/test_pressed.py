"""Signals and slopes straight from presses of the twin."""

import numpy as np
import pytest

from searches_of_designs import COARSE
from smoskin.commands.optimise.pressed import rated_touches
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry, places_to_the_rim
from smoskin.records import Motion
from smoskin.twin.readout import Readout


def exact_slopes(design, position, force=0.5):
    """Slopes of the signals as designed at B places, (B, 2) m; shape (B, C, 5), T/m and T/N.

    Mechanics by the implicit function theorem; the field along them by central differences.
    """
    push = np.tile([0.0, 0.0, -force], (len(position), 1))
    solver = BarHinge(design)
    touches = Touches(position=position[:, None], force=push[:, None])
    pressed, rates = solver.press(touches, tolerance=1e-10), solver.sensitivity(touches)
    holders = holder_matrix(design)
    flat = holders.reshape(-1, pressed.displacements[0].size).T

    def magnets(displacements):
        joined = displacements.reshape(*displacements.shape[:-2], -1)
        return np.asarray((joined @ flat).reshape(*joined.shape[:-1], -1, 6))

    at, along = magnets(pressed.displacements), magnets(rates.displacements[:, 0])
    readout, slopes = Readout(design), []
    for k, span in enumerate(0.05 * np.array([1e-3, 1e-3, 0.1, 0.1, 0.1])):
        signals = [
            readout.risen(
                Motion(
                    magnets=at + side * span * along[:, k],
                    board=pressed.board + side * span * rates.board[:, 0, k],
                )
            ).reshape(len(at), -1)
            for side in (1.0, -1.0)
        ]
        slopes.append((signals[0] - signals[1]) / (2 * span))
    return np.stack(slopes, axis=-1)


def test_differences_of_presses_meet_the_exact_slopes(planar, sheet):
    near = sheet.slopes(planar)[1].reshape(-1, 9, 5)
    some = [0, 4, 7, 11]
    exact = exact_slopes(planar, places_to_the_rim(geometry(planar).extent, COARSE)[some])
    for k in range(5):
        assert near[some, :, k] == pytest.approx(exact[..., k], abs=0.02 * abs(exact[..., k]).max())


def test_the_rated_touches_press_and_drag_every_way(planar):
    where, push = rated_touches(places_to_the_rim(geometry(planar).extent, (2, 3)))
    assert where.shape == (30, 2)
    assert (push[:, 2] == -1.0).all()
    assert sorted({tuple(one) for one in push[:, :2].tolist()}) == [
        (-0.5, 0.0), (0.0, -0.5), (0.0, 0.0), (0.0, 0.5), (0.5, 0.0)
    ]  # fmt: skip
