"""Campaigns of a rig: what is kept of a touch, and that an interruption costs and doubles none."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError, SourceError
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.records import ChipFlag, HeldTouch, Reading
from smoskin.roles import Rig
from smoskin.service.campaign import press_plan
from smoskin.service.guided import grid_plan

PLAN = grid_plan(30e-3, 20e-3, 6, force=0.4)
QUIET, TOUCHED = 1e-3, 2e-3
"""Fields at rest and under a touch, T."""


class Arm(Rig):
    """A second of rest and a second of hold for each touch; the power goes after some."""

    place_spread, force_spread = 2e-5, 2e-3

    def __init__(self, lasts=1000, chips=2, missing=()):
        self.lasts, self.chips, self.missing = lasts, chips, missing
        self.pressed = []

    def press(self, contact, timeout=30.0):
        if len(self.pressed) == self.lasts:
            raise SourceError("the power is gone")
        begin = 7.0 + 10.0 * len(self.pressed)
        self.pressed.append(contact.position)
        readings = []
        for k, level in enumerate([QUIET, QUIET, 9.0, TOUCHED, TOUCHED + 2e-6]):
            flags = np.zeros(self.chips, int)
            if len(self.pressed) in self.missing and level > QUIET:
                flags[0] = int(ChipFlag.MISSING)
            field = np.full((self.chips, 3), level)
            readings.append(Reading(time=begin + k, field=field, flags=flags))
        seen = replace(contact, position=contact.position + 1e-5)
        rest, held = (begin, begin + 1), (begin + 3, begin + 4)
        return HeldTouch(contact=seen, readings=tuple(readings), rest=rest, held=held)

    def close(self):
        raise AssertionError("the rig is the caller's")


def test_each_touch_is_kept_with_the_rest_before_it():
    heard, kept = [], []
    table = press_plan(
        Arm(), PLAN, keep=kept.append, every=0.0, progress=lambda *event: heard.append(event)
    )
    assert table.touched.tolist() == 6 * [False, True]
    assert_allclose(table.position[1::2], PLAN.position + 1e-5)
    assert_allclose(table.force[1::2, 2], -0.4)
    assert_allclose(table.field[0::2], QUIET)
    assert_allclose(table.field[1::2], TOUCHED + 1e-6)
    assert_allclose(table.held[:4], [[0, 1], [3, 4], [10, 11], [13, 14]])
    assert [len(each.held) for each in kept] == [2, 4, 6, 8, 10, 12, 12]
    assert heard[0] == ("touch 1 of 6", 0.0)
    assert heard[-1] == ("done", 1.0)


def test_what_is_interrupted_goes_on_and_presses_nothing_twice(tmp_path):
    file, arms = tmp_path / "touches.csv", []
    for lasts in (2, 0, 3, 1000):
        arms.append(Arm(lasts))
        made = read_touches(file)[0] if file.exists() else None
        goes = nullcontext() if lasts == 1000 else pytest.raises(SourceError, match="is gone")
        with goes:
            done = press_plan(
                arms[-1], PLAN, made=made, keep=lambda table: write_touches(file, table)
            )
    pressed = np.concatenate([arm.pressed for arm in arms if arm.pressed])
    assert_allclose(pressed, PLAN.position)
    assert_allclose(done.position[1::2], PLAN.position + 1e-5)
    assert_allclose(read_touches(file)[0].held, done.held)
    assert (np.diff(done.held.ravel()) > 0).all()
    # Whoever asks again presses nothing.
    again = press_plan(Arm(0), PLAN, made=done)
    assert_allclose(again.field, done.field)


def test_a_touch_that_a_chip_could_not_read_is_not_pressed_again():
    done = press_plan(Arm(missing=(2,)), PLAN)
    assert np.isfinite(done.field).all(axis=(1, 2)).tolist() == 2 * [True] + 2 * [False] + 8 * [
        True
    ]
    assert np.isfinite(done.held).all()
    assert press_plan(Arm(0), PLAN, made=done).made.all()


def test_another_plan_or_board_is_refused():
    done = press_plan(Arm(), PLAN)
    other = grid_plan(30e-3, 20e-3, 6, seed=1)
    with pytest.raises(ArgumentError, match="those of the plan; touch 1 is not at"):
        press_plan(Arm(), other, made=done)
    fewer = PLAN.rows(np.arange(4))
    with pytest.raises(ArgumentError, match="plan must hold the 6 touches made; got 4"):
        press_plan(Arm(), fewer, made=done)
    with pytest.raises(ArgumentError, match=r"one board; got boards of \[2, 3\] chips"):
        press_plan(Arm(chips=3), PLAN, made=done.rows(np.arange(6)))
    nothing = TouchTable(position=[[np.nan, np.nan]], force=[[0, 0, 0]], field=np.zeros((1, 2, 3)))
    with pytest.raises(ArgumentError, match="plan must hold at least one touch"):
        press_plan(Arm(), nothing)
