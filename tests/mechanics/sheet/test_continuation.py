"""Equilibria that grow with the load, alone and where the iteration with fixed tangent fails."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.mechanics.sheet.touches import Frictionless, Touches
from textbook_sheet import inner_force, outer_force

pytest.importorskip("jax")
from smoskin.mechanics.sheet import continuation, equilibrium
from smoskin.mechanics.sheet.continuation import Press, Standing, follow
from smoskin.mechanics.sheet.equilibrium import Loads
from smoskin.mechanics.sheet.model import BarHinge


def test_following_the_load_finds_the_same_equilibria(sheet, cases):
    model, equilibrium = sheet, sheet._equilibrium
    pressed = model.press(cases, tolerance=1e-10)
    loads = model._loads(cases)
    for row in (0, 1):
        press = equilibrium.one_press(loads, row)
        standing = follow(equilibrium.tangent, press, 1e-10, equilibrium.rest)
        assert standing is not None
        scale = np.abs(standing.motion).max()
        np.testing.assert_allclose(standing.motion, pressed.displacements[row], atol=1e-9 * scale)
        assert standing.steps < 10  # none past the answer


def test_what_the_fixed_tangent_loses_is_followed(small, monkeypatch):
    """Two touches that hold nothing: an equilibrium by `follow` alone, and found all the same."""
    model = BarHinge(small, grip=Frictionless())
    position = [[(0.0213, 0.0312), (0.0475, 0.0633)], [(0.03, 0.04), (0.01, 0.01)]]
    force = [[(0.12, -0.1, -1.0), (0.0, 0.04, -0.6)], [(0.0, 0.0, -0.1), (0.0, 0.0, 0.0)]]
    touches = Touches(position=position, force=force)
    monkeypatch.setattr(equilibrium, "_STEPS", 14)
    pressed = model.press(touches)
    assert pressed.converged.all()
    assert pressed.residual.max() <= 1e-8
    loads = outer_force(model, touches, pressed, 0)
    unbalanced = inner_force(model.lattice, pressed.displacements[0]) - loads
    assert np.linalg.norm(unbalanced) <= 2e-8 * np.linalg.norm(loads)
    assert pressed.iterations[0] > pressed.iterations[1]  # its steps come on top of those lost
    monkeypatch.setattr(equilibrium, "follow", lambda *_: None)
    assert model.press(touches).converged.tolist() == [False, True]


def test_a_load_too_large_for_one_step_is_taken_in_parts(sheet, cases, monkeypatch):
    loads = sheet._loads(cases)
    tangent = sheet._equilibrium.tangent
    press = sheet._equilibrium.one_press(loads._replace(force=6 * loads.force), 0)
    rest = sheet._equilibrium.rest
    whole = follow(tangent, press, 1e-10, rest)
    monkeypatch.setattr(continuation, "_NEWTON_STEPS", 5)
    shares = []
    newton = continuation._newton

    def noted(tangent, press, load, *others):
        shares.append(load)
        return newton(tangent, press, load, *others)

    monkeypatch.setattr(continuation, "_newton", noted)
    parts = follow(tangent, press, 1e-10, rest)
    # A share that fails is halved; one that succeeds is followed by a step twice as large.
    assert shares[:2] == [1.0, 0.5]
    assert shares[-1] == 1.0
    assert parts.steps > whole.steps
    assert parts.residual <= 1e-10
    scale = np.abs(whole.motion).max()
    np.testing.assert_allclose(parts.motion, whole.motion, atol=1e-9 * scale)
    np.testing.assert_allclose(parts.reaction, whole.reaction, atol=1e-8)
    monkeypatch.setattr(continuation, "_ALL_STEPS", 5)
    assert follow(tangent, press, 1e-10, rest) is None
    monkeypatch.setattr(continuation, "_ALL_STEPS", 200)
    monkeypatch.setattr(continuation, "_NEWTON_STEPS", 2)
    shares.clear()
    assert follow(tangent, press, 1e-10, rest) is None
    assert shares == [2.0**-k for k in range(7)]


def test_a_load_that_would_crush_the_columns_is_not_followed(sheet):
    top = sheet.lattice.loaded.ravel()
    lone = Loads(
        shares=np.full((1, 1, len(top)), 1 / len(top)),
        force=np.zeros((1, 1, 3)),
        held=np.array([[False]]),
        on_board=np.zeros((1, 6)),
        reach=np.zeros((1, 2, 6)),
    )
    supports = sheet.lattice.supports
    sunk = (supports.axial * supports.height).sum()
    # The columns sway together from 0.05 on; the last is past everything.
    for deep, follows in ((0.005, True), (0.2, False), (60.0, False)):
        push = np.array([[[0.0, 0.0, -deep * sunk]]])
        press = sheet._equilibrium.one_press(lone._replace(force=push), 0)
        standing = follow(sheet._equilibrium.tangent, press, 1e-8, sheet._equilibrium.rest)
        assert (standing is not None) == follows


@pytest.mark.parametrize(("cost", "reached"), [(1, True), (2, False)])
def test_a_press_is_given_up_after_200_steps(sheet, cases, monkeypatch, cost, reached):
    """Where every share beyond 1/64 fails, and is tried again: 132 shares in all."""

    def newton(tangent, press, load, tolerance, state, settling):
        tries.append(load)
        good = load - done[-1] <= 1 / 64
        done.extend([load] * good)
        return replace(state, steps=state.steps + cost, residual=0.0 if good else np.inf)

    tries, done = [], [0.0]
    monkeypatch.setattr(continuation, "_newton", newton)
    press = sheet._equilibrium.one_press(sheet._loads(cases), 0)
    standing = follow(sheet._equilibrium.tangent, press, 1e-10, sheet._equilibrium.rest)
    assert (standing is not None) == reached
    assert len(tries) == (132 if reached else 100)


def test_a_share_is_given_up_after_16_newton_steps(monkeypatch):
    asked = []

    class Stubborn:
        """A tangent whose forces never balance."""

        elements = SimpleNamespace(stiffness=np.ones((1, 1)))
        lattice = SimpleNamespace(
            supports=SimpleNamespace(height=np.ones(1)), sunk=lambda motion: -motion[:1, 2]
        )

        def at(self, motion, board, force, fold):
            asked.append(motion)
            blocks = SimpleNamespace(strain=0.0, pushes=np.zeros((1, 2, 3)))
            return SimpleNamespace(blocks=blocks, board_push=np.zeros(6))

        def strain_change(self, place, move):
            return 0.0

    monkeypatch.setattr(
        continuation,
        "constrained_solve",
        lambda *_: (np.zeros((2, 3)), np.zeros(6), np.zeros(0)),
    )
    press = Press(
        dead=np.ones((2, 3)),
        on_board=np.zeros(6),
        pulls=np.zeros((2, 3, 0)),
        reach=np.zeros((0, 6)),
        place=np.zeros(0),
        link=np.zeros((0, 0)),
    )
    state = Standing(
        motion=np.zeros((2, 3)),
        board=np.zeros(6),
        reaction=np.zeros(0),
        force=np.zeros(1),
        residual=0.0,
        steps=7,
    )
    left = continuation._newton(Stubborn(), press, 1.0, 1e-8, state, False)
    assert left.residual == pytest.approx(1.0)
    assert (len(asked), left.steps) == (16, 7 + 16)
    # A load lighter than 10 mN is measured by 10 mN.
    faint = replace(press, dead=np.full((2, 3), 1e-4))
    left = continuation._newton(Stubborn(), faint, 1.0, 1e-8, state, False)
    assert left.residual == pytest.approx(1e-4 * np.sqrt(6) / 0.01)


@pytest.mark.parametrize(("sunk", "crushed"), [(3.9, False), (4.1, True)])
def test_no_answer_lies_where_a_foot_sank_by_four_columns(sunk, crushed):
    supports = SimpleNamespace(height=np.array([5e-3, 5e-3]))
    lattice = SimpleNamespace(supports=supports, sunk=lambda motion: -motion[[1, 2], 2])
    motion = np.zeros((4, 3))
    motion[2, 2], motion[3, 2] = -sunk * 5e-3, -1.0
    assert continuation._crushed(SimpleNamespace(lattice=lattice), motion) is crushed


def test_a_followed_equilibrium_takes_its_row_and_its_steps_come_on_top():
    relaxed = equilibrium.Relaxed(
        displacements=np.zeros((3, 4, 3)),
        board=np.zeros((3, 6)),
        compression=np.zeros((3, 2)),
        reaction=np.full((3, 3, 2), 9.0),
        residual=np.full(3, np.inf),
        iterations=np.array([24, 25, 3]),
    )
    standing = Standing(
        motion=np.arange(12.0).reshape(4, 3),
        board=np.arange(6.0),
        reaction=np.array([0.1, 0.2, 0.3, 0.4]),
        force=np.zeros(2),
        residual=1e-11,
        steps=17,
    )
    blocks = SimpleNamespace(compression=np.array([0.5, 0.6]))
    tangent = SimpleNamespace(blocks=lambda *_: blocks)
    solver = SimpleNamespace(tangent=tangent)
    equilibrium.Equilibrium._put(solver, relaxed, 1, np.array([True, False, True]), standing)
    assert relaxed.iterations.tolist() == [24, 25 + 17, 3]
    assert relaxed.residual.tolist() == [np.inf, 1e-11, np.inf]
    np.testing.assert_array_equal(relaxed.displacements[1], standing.motion)
    np.testing.assert_array_equal(relaxed.reaction[1], [[0.1, 0.2], [0.0, 0.0], [0.3, 0.4]])
    np.testing.assert_array_equal(relaxed.board[1], standing.board)
    np.testing.assert_array_equal(relaxed.compression[1], [0.5, 0.6])
    assert not relaxed.displacements[[0, 2]].any()
    assert (relaxed.reaction[[0, 2]] == 9.0).all()
