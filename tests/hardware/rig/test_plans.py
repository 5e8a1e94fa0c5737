"""Campaigns as sheets: what each kind asks, the touch that is made again, and what is held out."""

import hashlib
from collections import Counter

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.hardware.rig.plans import campaign_plan, held_out
from smoskin.measurement import read_touches, write_touches


def test_a_grid_has_every_place_with_every_force_and_one_touch_again_and_again() -> None:
    plan = campaign_plan("grid", 0.12, 0.16)
    counted = Counter((*c.position.tolist(), c.normal_force) for c in plan.contacts)
    middle = (*plan.position[0].tolist(), 0.6)
    assert counted.pop(middle) == 1 + 2475 // 25 + 1
    assert set(counted.values()) == {1}
    assert len(counted) == 2475 - 1
    assert_allclose(middle[:2], (0.06, 0.08), atol=3e-3)
    # 25 other touches lie between two of them.
    again = [k for k, c in enumerate(plan.contacts) if (*c.position, c.normal_force) == middle]
    assert Counter(np.diff(again).tolist())[26] >= 97
    assert again[-1] == len(plan.contacts) - 1
    bare = campaign_plan("grid", 0.12, 0.16, reference_every=0)
    assert len(bare.contacts) == 2475
    other = campaign_plan("grid", 0.12, 0.16, reference_every=0, seed=1)
    assert not np.array_equal(bare.position, other.position)
    assert {*map(tuple, bare.position)} == {*map(tuple, other.position)}


def test_other_kinds_ask_what_they_are_named_for() -> None:
    small = {"columns": 3, "rows": 4, "reference_every": 0, "forces": (0.4, 0.8)}
    sheared = campaign_plan("shear", 0.12, 0.16, drag=0.25, angles=6, **small)
    assert len(sheared.contacts) == 12 * 2 * 7
    aside = np.linalg.norm(sheared.force[:, :2], axis=1)
    dragged = aside > 0
    assert dragged.mean() == pytest.approx(6 / 7)
    assert_allclose(aside[dragged], -0.25 * sheared.force[dragged, 2], rtol=1e-5)
    ways = np.degrees(np.arctan2(*sheared.force[dragged, 1::-1].T)) % 360
    assert {*ways.round(3)} == {0, 60, 120, 180, 240, 300}
    cycled = campaign_plan("cycles", 0.12, 0.16, repeats=2, **small)
    levels = -cycled.force[:, 2].reshape(12, 2, 7)
    assert_allclose(levels, np.broadcast_to([0.2, 0.4, 0.6, 0.8, 0.6, 0.4, 0.2], (12, 2, 7)))
    assert (np.ptp(cycled.position.reshape(12, 14, 2), axis=1) == 0).all()
    again = campaign_plan("recovery", 0.12, 0.16, repeats=3, **small)
    assert_allclose(again.force[:, 2], -0.8)
    assert len(again.contacts) == 36
    anywhere = campaign_plan("random", 0.12, 0.16, **small)
    assert len({*map(tuple, anywhere.position)}) == 12
    assert (anywhere.position > 0).all()
    assert (anywhere.position < [0.12, 0.16]).all()


def test_what_is_held_out_follows_from_the_places_alone(tmp_path) -> None:
    plan = campaign_plan("grid", 0.12, 0.16)
    numbers = held_out(plan, 0.15)
    out = {tuple(plan.position[k]) for k in numbers}
    for number, place in enumerate(map(tuple, plan.position)):
        assert (number in numbers) == (place in out)
    # About the share: 124 of 825 places, give or take three deviations of 10.
    assert 93 <= len(out) <= 155
    assert out <= {tuple(plan.position[k]) for k in held_out(plan, 0.3)}
    assert held_out(plan, 0.0) == ()
    # As anybody may compute it, of the sheet that was written too.
    write_touches(tmp_path / "plan.csv", plan)
    assert held_out(read_touches(tmp_path / "plan.csv")[0], 0.15) == numbers
    x, y = np.rint(1e5 * plan.position[numbers[0]]).astype(int)
    digest = hashlib.sha256(f"{x},{y}".encode()).hexdigest()
    assert int(digest[:16], 16) < 0.15 * 2**64
    with pytest.raises(ArgumentError, match=r"share must be from 0 to 0\.9; got 1"):
        held_out(plan, 1)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"kind": "spiral"}, "kind must be one of grid, random, shear, cycles, recovery"),
        ({"width": 0.0}, "width must be positive and finite"),
        ({"forces": (0.3, -0.1)}, "forces must be positive"),
        ({"forces": ()}, "there must be forces"),
        ({"reference_every": -1}, "none or positive; got -1"),
        ({"columns": 1000, "rows": 1000}, "at most 100000 touches"),
    ],
)
def test_a_wrong_plan_is_refused(words, message) -> None:
    with pytest.raises(ArgumentError, match=message):
        campaign_plan(**({"kind": "grid", "width": 0.12, "height": 0.16} | words))
