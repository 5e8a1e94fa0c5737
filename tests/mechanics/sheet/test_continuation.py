"""Equilibria that grow with the load, alone and where the iteration with fixed tangent fails."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.mechanics.sheet.touches import Touches
from textbook_sheet import inner_force, outer_force

pytest.importorskip("jax")
from smoskin.mechanics.sheet import continuation, equilibrium
from smoskin.mechanics.sheet.continuation import Press, Standing, follow
from smoskin.mechanics.sheet.equilibrium import Loads


def test_following_the_load_finds_the_same_equilibria(sheet, cases):
    model, equilibrium = sheet, sheet._equilibrium
    pressed = model.press(cases, tolerance=1e-10)
    loads = model._loads(cases)
    for row in (0, 1):
        press = equilibrium.one_press(loads, row)
        found = follow(equilibrium.tangent, press, 1e-10)
        assert found is not None
        scale = np.abs(found.motion).max()
        np.testing.assert_allclose(found.motion, pressed.displacements[row], atol=1e-9 * scale)
        assert found.steps < 10  # none past the answer


def test_what_the_fixed_tangent_loses_is_followed(sheet, monkeypatch):
    """A deep press with a large drag: an equilibrium by `follow` alone, and found all the same."""
    touches = Touches(position=[[(0.03, 0.04)]] * 2, force=[[(0.0, 3.0, -6.0)], [(0.0, 0.0, -0.3)]])
    pressed = sheet.press(touches)
    assert pressed.converged.all()
    assert pressed.residual.max() <= 1e-8
    loads = outer_force(sheet, touches, pressed, 0)
    unbalanced = inner_force(sheet.lattice, pressed.displacements[0]) - loads
    assert np.linalg.norm(unbalanced) <= 2e-8 * np.linalg.norm(loads)
    assert pressed.iterations[0] > 2 * equilibrium._STEPS  # its steps come on top of those lost
    monkeypatch.setattr(equilibrium, "follow", lambda *_: None)
    assert sheet.press(touches).converged.tolist() == [False, True]


def test_a_load_too_large_for_one_step_is_taken_in_parts(sheet, cases, monkeypatch):
    loads = sheet._loads(cases)
    tangent = sheet._equilibrium.tangent
    press = sheet._equilibrium.one_press(loads._replace(force=5 * loads.force), 0)
    whole = follow(tangent, press, 1e-10)
    monkeypatch.setattr(continuation, "_NEWTON_STEPS", 4)
    shares = []
    newton = continuation._newton

    def noted(tangent, press, load, tolerance, state):
        shares.append(load)
        return newton(tangent, press, load, tolerance, state)

    monkeypatch.setattr(continuation, "_newton", noted)
    parts = follow(tangent, press, 1e-10)
    # A share that fails is halved; one that succeeds is followed by a step twice as large.
    assert shares == [1.0, 0.5, 0.25, 0.75, 0.5, 1.0, 0.75, 1.0]
    assert parts.steps > whole.steps
    assert parts.residual <= 1e-10
    scale = np.abs(whole.motion).max()
    np.testing.assert_allclose(parts.motion, whole.motion, atol=1e-9 * scale)
    np.testing.assert_allclose(parts.reaction, whole.reaction, atol=1e-8)
    monkeypatch.setattr(continuation, "_ALL_STEPS", 5)
    assert follow(tangent, press, 1e-10) is None
    monkeypatch.setattr(continuation, "_ALL_STEPS", 200)
    monkeypatch.setattr(continuation, "_NEWTON_STEPS", 2)
    shares.clear()
    assert follow(tangent, press, 1e-10) is None
    assert shares == [2.0**-k for k in range(7)]


def test_a_load_that_would_crush_the_columns_is_not_followed(sheet):
    top = sheet.lattice.loaded.ravel()
    lone = Loads(
        shares=np.full((1, 1, len(top)), 1 / len(top)),
        force=np.zeros((1, 1, 3)),
        held=np.array([[False]]),
        link=1e-12 * np.eye(2)[None],
    )
    sunk = sheet.lattice.ground[sheet.lattice.feet, 2].sum() * sheet.lattice.stroke
    for deep, follows in ((0.3, True), (60.0, False)):
        push = np.array([[[0.0, 0.0, -deep * sunk]]])
        press = sheet._equilibrium.one_press(lone._replace(force=push), 0)
        found = follow(sheet._equilibrium.tangent, press, 1e-8)
        assert (found is not None) == follows


@pytest.mark.parametrize(("cost", "reached"), [(1, True), (2, False)])
def test_a_press_is_given_up_after_200_steps(sheet, cases, monkeypatch, cost, reached):
    """Where every share beyond 1/64 fails, and is tried again: 132 shares in all."""

    def newton(tangent, press, load, tolerance, state):
        tries.append(load)
        good = load - done[-1] <= 1 / 64
        done.extend([load] * good)
        return replace(state, steps=state.steps + cost, residual=0.0 if good else np.inf)

    tries, done = [], [0.0]
    monkeypatch.setattr(continuation, "_newton", newton)
    press = sheet._equilibrium.one_press(sheet._loads(cases), 0)
    found = follow(sheet._equilibrium.tangent, press, 1e-10)
    assert (found is not None) == reached
    assert len(tries) == (132 if reached else 100)


def test_a_share_is_given_up_after_16_newton_steps(monkeypatch):
    asked = []

    class Stubborn:
        """A tangent whose forces never balance."""

        elements = SimpleNamespace(stiffness=np.ones((1, 1)))
        lattice = SimpleNamespace(feet=np.array([0]), stroke=1.0)

        def at(self, motion, force):
            asked.append(motion)
            return SimpleNamespace(inner=np.zeros((1, 2, 3)), blocks=SimpleNamespace(strain=0.0))

        def strain_change(self, place, move):
            return 0.0

    monkeypatch.setattr(
        continuation, "constrained_solve", lambda *_: (np.zeros((2, 3)), np.zeros(0))
    )
    press = Press(dead=np.ones((2, 3)), pulls=np.zeros((2, 3, 0)), link=np.zeros((0, 0)))
    state = Standing(
        motion=np.zeros((2, 3)), reaction=np.zeros(0), force=np.zeros(1), residual=0.0, steps=7
    )
    left = continuation._newton(Stubborn(), press, 1.0, 1e-8, state)
    assert left.residual == pytest.approx(1.0)
    assert (len(asked), left.steps) == (16, 7 + 16)
    # A load lighter than 10 mN is measured by 10 mN.
    faint = Press(dead=np.full((2, 3), 1e-4), pulls=press.pulls, link=press.link)
    left = continuation._newton(Stubborn(), faint, 1.0, 1e-8, state)
    assert left.residual == pytest.approx(1e-4 * np.sqrt(6) / 0.01)


@pytest.mark.parametrize(("sunk", "crushed"), [(3.9, False), (4.1, True)])
def test_no_answer_lies_where_a_foot_sank_by_four_columns(sunk, crushed):
    lattice = SimpleNamespace(feet=np.array([1, 2]), stroke=5e-3)
    motion = np.zeros((4, 3))
    motion[2, 2], motion[3, 2] = -sunk * 5e-3, -1.0
    assert continuation._crushed(SimpleNamespace(lattice=lattice), motion) is crushed


def test_a_followed_equilibrium_takes_its_row_and_its_steps_come_on_top():
    relaxed = equilibrium.Relaxed(
        displacements=np.zeros((3, 4, 3)),
        reaction=np.full((3, 3, 2), 9.0),
        residual=np.full(3, np.inf),
        iterations=np.array([24, 25, 3]),
    )
    found = Standing(
        motion=np.arange(12.0).reshape(4, 3),
        reaction=np.array([0.1, 0.2, 0.3, 0.4]),
        force=np.zeros(2),
        residual=1e-11,
        steps=17,
    )
    equilibrium._put(relaxed, 1, np.array([True, False, True]), found)
    assert relaxed.iterations.tolist() == [24, 25 + 17, 3]
    assert relaxed.residual.tolist() == [np.inf, 1e-11, np.inf]
    np.testing.assert_array_equal(relaxed.displacements[1], found.motion)
    np.testing.assert_array_equal(relaxed.reaction[1], [[0.1, 0.2], [0.0, 0.0], [0.3, 0.4]])
    assert not relaxed.displacements[[0, 2]].any()
    assert (relaxed.reaction[[0, 2]] == 9.0).all()
