"""Bounds without a table, and what a search makes small."""

import math
from dataclasses import replace

import numpy as np
import pytest

from searches_of_designs import AIM, COARSE
from smoskin.commands.optimise import Limits, design_bound
from smoskin.commands.optimise.objective import design_information, try_design, unknown_of
from smoskin.sensing.response.bound import bound_of_information, bound_of_slopes, figures
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import draw


def test_a_design_has_a_bound_without_a_table(planar, sheet):
    found = design_bound(planar, places=COARSE)
    slopes = sheet.slopes(planar)[1]
    direct = bound_of_slopes(sheet.x, sheet.y, slopes, signal_noise(planar))
    assert found.location == pytest.approx(direct.location, rel=1e-3)
    assert not found.blind.any()
    straight = design_bound(planar, places=COARSE, drags=False)
    assert (straight.location < found.location).all()


def test_a_made_skin_is_bounded_much_like_its_design(planar):
    made = draw(planar, np.random.default_rng(5))
    whole, one = design_bound(planar, places=COARSE), design_bound(planar, made, places=COARSE)
    ratio = one.location / whole.location
    assert (abs(ratio - 1) > 1e-3).any()
    assert ((ratio > 0.5) & (ratio < 2)).all()


def test_a_row_of_cells_is_blind_across_it(planar):
    magnets = [
        replace(m, corner=c) for m, c in zip(planar.magnets, [(3, 0), (4, 1), (2, 1)], strict=True)
    ]
    row = replace(planar, cells=(6, 1), magnets=tuple(magnets))
    found = design_bound(row, places=COARSE)
    assert found.blind.all()
    assert found.place[..., 1] == pytest.approx(found.y[-1] / math.sqrt(12), rel=1e-3)


def test_broken_limits_weigh_on_a_design(planar, sheet):
    trial = try_design(planar, sheet, AIM, Limits())
    assert trial.merit == trial.value
    strict = try_design(planar, sheet, AIM, Limits(crush=0.01))
    broken = sum(max(-one.slack, 0.0) for one in (*strict.own, *strict.stood))
    assert broken > 1
    assert strict.merit == pytest.approx(strict.value * (1 + 20 * broken))
    straight, free = (
        figures(bound_of_information(sheet.x, sheet.y, informed, 3, drags=drags).location)
        for informed in [design_information(planar, sheet, AIM.unmodelled)]
        for drags in (False, True)
    )
    both = [one.mean + AIM.worst_weight * one.worst for one in (straight, free)]
    assert trial.value == pytest.approx(np.mean(both))


def test_a_share_of_each_signal_is_unknown_by_the_inverse_square_of_the_gap(planar):
    signals = np.arange(1.0, 10.0) * 1e-4
    far = replace(planar, halls=tuple(replace(site, gap=11e-3) for site in planar.halls))
    spread = unknown_of(far, signals, 0.02)
    assert spread == pytest.approx(np.diag((0.02 / 4 * signals) ** 2))
