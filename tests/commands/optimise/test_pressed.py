"""Signals and slopes straight from presses of the twin."""

import math
from dataclasses import replace

import numpy as np
import pytest

from searches_of_designs import COARSE
from smoskin.commands.optimise import design_bound
from smoskin.commands.optimise.pressed import rated_touches, unknown_of
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry, places_to_the_rim
from smoskin.records import Motion
from smoskin.sensing.response.bound import bound_of_slopes
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import draw
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
        assert near[some, :, k] == pytest.approx(
            exact[..., k], abs=0.025 * abs(exact[..., k]).max()
        )


def test_the_rated_touches_press_and_drag_every_way(planar):
    where, push = rated_touches(places_to_the_rim(geometry(planar).extent, (2, 3)))
    assert where.shape == (30, 2)
    assert (push[:, 2] == -1.0).all()
    assert sorted({tuple(drag) for drag in push[:, :2].tolist()}) == [
        (-0.5, 0.0), (0.0, -0.5), (0.0, 0.0), (0.0, 0.5), (0.5, 0.0)
    ]  # fmt: skip


def test_a_design_has_a_bound_without_a_table(planar, sheet):
    bound = design_bound(planar, places=COARSE)
    slopes = sheet.slopes(planar)[1]
    direct = bound_of_slopes(sheet.x, sheet.y, slopes, signal_noise(planar))
    assert bound.location == pytest.approx(direct.location, rel=1e-3)
    assert not bound.blind.any()
    straight = design_bound(planar, places=COARSE, drags=False)
    assert (straight.location < bound.location).all()


def test_a_made_skin_is_bounded_much_like_its_design(planar):
    made = draw(planar, np.random.default_rng(5))
    whole, drawn = design_bound(planar, places=COARSE), design_bound(planar, made, places=COARSE)
    ratio = drawn.location / whole.location
    assert (abs(ratio - 1) > 1e-3).any()
    assert ((ratio > 0.5) & (ratio < 2)).all()


@pytest.mark.slow
def test_a_row_of_cells_is_blind_across_it(planar):
    magnets = [
        replace(m, corner=c) for m, c in zip(planar.magnets, [(3, 0), (4, 1), (2, 1)], strict=True)
    ]
    row = replace(planar, cells=(6, 1), magnets=tuple(magnets))
    bound = design_bound(row, places=COARSE)
    assert bound.blind.all()
    assert bound.place[..., 1] == pytest.approx(bound.y[-1] / math.sqrt(12), rel=1e-3)


def test_a_share_of_each_signal_is_unknown_by_the_inverse_square_of_the_gap(planar):
    signals = np.arange(1.0, 10.0) * 1e-4
    far = replace(planar, halls=tuple(replace(site, gap=11e-3) for site in planar.halls))
    spread = unknown_of(far, signals, 0.02)
    assert spread == pytest.approx(np.diag((0.02 / 4 * signals) ** 2))
