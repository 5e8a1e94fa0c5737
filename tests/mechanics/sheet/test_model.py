"""Touches on the nonlinear sheet: what holds, what slides, what counts, and its derivatives."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ArgumentError, MissingExtraError
from smoskin.mechanics.reduced.stiffness import board_stiffness, yaw_stiffness
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sliding, Sticking, Touches
from smoskin.origami.cell import size
from smoskin.origami.geometry import geometry
from textbook_sheet import outer_force

pytest.importorskip("jax")
from smoskin.mechanics.sheet.model import STIFFNESSES, BarHinge


def arms_of(sheet, loads):
    """From the board's middle to each patch at rest, (B, K, 2), m."""
    places = geometry(sheet.design)
    return loads.shares @ (places.tops.reshape(-1, 2) - places.extent / 2)


def test_a_sticking_touch_stands_still_over_the_ground(sheet, cases):
    """Where it does not drag: the patch's motion on the sheet undoes that of the board."""
    pressed = sheet.press(cases)
    case = sheet._loads(cases)
    top = sheet.lattice.loaded.ravel()
    for row in range(4):
        for k in np.flatnonzero(cases.pressed[row]):
            patch = case.shares[row, k] @ pressed.displacements[row, top, :2]
            x, y = arms_of(sheet, case)[row, k]
            slide, yaw = pressed.board[row, :2], pressed.board[row, 2]
            np.testing.assert_allclose(patch + slide + yaw * np.array([-y, x]), 0, atol=2e-12)
        assert np.abs(pressed.reaction[row, 0]).max() > 1e-3


def test_the_board_carries_what_the_touches_push_sideways(sheet, small, cases):
    pressed = sheet.press(cases)
    push = cases.force[..., :2] + pressed.reaction
    np.testing.assert_allclose(pressed.board[:, :2], push.sum(axis=1) / board_stiffness(small))
    arms = arms_of(sheet, sheet._loads(cases))
    moment = (arms[..., 0] * push[..., 1] - arms[..., 1] * push[..., 0]).sum(axis=1)
    np.testing.assert_allclose(pressed.board[:, 2] * yaw_stiffness(small), moment)
    # The sheet's own springs pass on all of it.
    lattice = sheet.lattice
    carried = (lattice.ground[:, :2] * pressed.displacements[..., :2]).sum(axis=1)
    np.testing.assert_allclose(carried, push.sum(axis=1), atol=1e-8)


def test_a_drag_is_taken_up_where_the_press_has_come_to(sheet, cases, monkeypatch):
    relax, begun, ended = sheet._equilibrium.relax, [], []

    def noted(loads, *, tolerance, start=None):
        begun.append(start)
        ended.append(relax(loads, tolerance=tolerance, start=start).displacements)
        return relax(loads, tolerance=tolerance, start=start)

    monkeypatch.setattr(sheet._equilibrium, "relax", noted)
    sheet.press(cases)
    assert begun[0] is None
    np.testing.assert_array_equal(begun[1], ended[0][4:])  # the first four do not drag


def test_a_drag_comes_on_top_of_the_straight_presss_reaction(sheet, cases):
    straight = Touches(position=cases.position, force=cases.force * [0.0, 0.0, 1.0])
    held = cases.force[..., 2] < 0
    np.testing.assert_allclose(
        sheet.press(cases).reaction[held], sheet.press(straight).reaction[held], atol=1e-10
    )


def test_friction_cuts_the_sideways_force(small, sheet, cases):
    sliding = BarHinge(small, grip=Sliding(friction=0.6)).press(cases)
    assert sliding.converged.all()
    push = np.linalg.norm(cases.force[..., :2] + sliding.reaction, axis=-1)
    most = -0.6 * cases.force[..., 2]
    assert (push <= most * (1 + 1e-12)).all()
    assert 0 < (push < most * (1 - 1e-9)).sum() < push.size
    endless = BarHinge(small, grip=Sliding(friction=1e6)).press(cases)
    stuck = sheet.press(cases)
    np.testing.assert_array_equal(endless.displacements, stuck.displacements)
    straight = Touches(position=cases.position, force=cases.force * [0.0, 0.0, 1.0])
    slick = BarHinge(small, grip=Sliding(friction=0.0)).press(straight)
    free = BarHinge(small, grip=Frictionless()).press(straight)
    np.testing.assert_allclose(slick.displacements, free.displacements, atol=1e-10)
    np.testing.assert_array_equal(free.reaction, 0.0)


def test_cover_panels_hold_their_own_vertex_and_lead_drags_into_the_board(small, cases):
    model = BarHinge(small, grip=Covered())
    pressed = model.press(cases)
    case = model._loads(cases)
    top = small_top = model.lattice.loaded.ravel()
    for row, k in np.argwhere(cases.pressed):
        vertex = small_top[np.argmax(case.shares[row, k])]
        np.testing.assert_allclose(pressed.displacements[row, vertex, :2], 0, atol=2e-12)
    np.testing.assert_allclose(
        pressed.board[:, :2], cases.force[..., :2].sum(axis=1) / board_stiffness(small)
    )
    dragless = Touches(position=cases.position, force=cases.force * [0.0, 0.0, 1.0])
    straight = model.press(dragless)
    np.testing.assert_array_equal(straight.displacements, pressed.displacements)
    assert len(top) == 9


def test_a_drag_without_a_press_goes_through_the_cover_into_the_board(small):
    """No guide holds a vertex that is not pressed, whatever else is pressed in the batch."""
    model = BarHinge(small, grip=Covered())
    drag, press = [(0.2, -0.1, 0.0)], [(0.0, 0.0, -0.3)]
    alone = model.press(Touches(position=[[(0.03, 0.04)]], force=[drag]))
    beside = model.press(Touches(position=[[(0.03, 0.04)]] * 2, force=[drag, press]))
    for pressed in (alone, beside):
        assert not pressed.displacements[0].any()
        assert not pressed.reaction[0].any()
        slide = np.array([0.2, -0.1]) / board_stiffness(small)
        np.testing.assert_allclose(pressed.board[0, :2], slide)


@pytest.mark.parametrize("grip", [Sticking(), Sliding(friction=0.1), Frictionless(), Covered()])
def test_a_mirrored_press_gives_the_mirrored_answer(small, cases, grip):
    """The zigzag sheet of whole cells has one mirror, x to -x."""
    model = BarHinge(small, grip=grip)
    length = 3 * float(size(small.cell).length)
    mirrored = Touches(
        position=[length, 0.0] + [-1.0, 1.0] * cases.position, force=cases.force * [-1.0, 1.0, 1.0]
    )
    one, other = model.press(cases, tolerance=1e-10), model.press(mirrored, tolerance=1e-10)
    grid = one.displacements.reshape(len(cases), 7, 7, 3)
    image = other.displacements.reshape(len(cases), 7, 7, 3)[:, ::-1] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(grid, image, atol=1e-9 * np.abs(grid).max())
    np.testing.assert_allclose(one.board, other.board * [-1.0, 1.0, -1.0], atol=1e-11)
    np.testing.assert_allclose(one.reaction, other.reaction * [-1.0, 1.0], atol=1e-8)


def test_small_loads_are_reciprocal(small):
    """Betti: load A does on B's motion the work that B does on A's."""
    model = BarHinge(small, grip=Frictionless())
    position = [[(0.013, 0.022)], [(0.045, 0.061)]]
    force = 1e-4 * np.array([[(0.3, -0.2, -1.0)], [(-0.1, 0.4, -0.7)]])
    touches = Touches(position=position, force=force)
    pressed = model.press(touches)
    loads = [outer_force(model, touches, pressed, row) for row in range(2)]
    work = [(loads[a] * pressed.displacements[b]).sum() for a, b in ((0, 1), (1, 0))]
    assert work[0] == pytest.approx(work[1], rel=1e-3)
    assert work[0] != 0


@pytest.mark.parametrize("grip", [Sticking(), Sliding(friction=0.06), Frictionless(), Covered()])
def test_derivatives_are_those_of_presses_solved_anew(small, grip):
    position = np.array([[(0.0213, 0.0312), (0.0475, 0.0633)]])
    force = np.array([[(0.06, -0.05, -0.5), (0.0, 0.02, -0.3)]])
    model = BarHinge(small, grip=grip)

    def moved(model, where, push):
        pressed = model.press(Touches(position=where, force=push), tolerance=1e-11)
        assert pressed.converged.all()
        return np.concatenate([pressed.displacements[0].ravel(), pressed.board[0]])

    def check(found, board, more, less, step):
        slope = (more - less) / (2 * step)
        exact = np.concatenate([found.ravel(), board])
        np.testing.assert_allclose(exact, slope, atol=2e-6 * max(np.abs(slope).max(), 1e-12))

    slopes = model.sensitivity(Touches(position=position, force=force))
    for k, axis in np.ndindex(2, 5):
        places, pushes = np.zeros_like(position), np.zeros_like(force)
        step = 2e-7 if axis < 2 else 1e-4
        if axis < 2:
            places[0, k, axis] = step
        else:
            pushes[0, k, axis - 2] = step
        check(
            slopes.displacements[0, k, axis],
            slopes.board[0, k, axis],
            moved(model, position + places, force + pushes),
            moved(model, position - places, force - pushes),
            step,
        )
    springs = springs_of(small)
    for index, name in enumerate(STIFFNESSES):
        changed = [
            BarHinge(
                small,
                grip=grip,
                lattice=build_lattice(
                    small, replace(springs, **{name: getattr(springs, name) * (1 + sign * 1e-4)})
                ),
            )
            for sign in (1, -1)
        ]
        check(
            slopes.displacements_by_stiffness[0, index],
            slopes.board_by_stiffness[0, index],
            *(moved(one, position, force) for one in changed),
            1e-4,
        )


def test_absurd_forces_are_flagged_and_never_answered(sheet):
    force = np.zeros((3, 1, 3))
    force[:, 0, 2] = [-0.3, -40.0, -1e6]
    pressed = sheet.press(Touches(position=np.full((3, 1, 2), 0.035), force=force))
    assert pressed.converged.tolist() == [True, False, False]
    for part in (pressed.displacements, pressed.board, pressed.reaction):
        assert np.isfinite(part[0]).all()
        assert np.isnan(part[1:]).all()
    slopes = sheet.sensitivity(Touches(position=[[(0.03, 0.04)]], force=[[(0, 0, -1e6)]]))
    assert np.isnan(slopes.displacements).all()


def test_answers_count_until_a_column_is_half_as_high(sheet):
    """In equilibrium all of them; 5.9 N leaves the columns half their height, 6.0 N does not."""
    touches = Touches(position=[[(0.03, 0.04)]] * 2, force=[[(0, 0, -5.9)], [(0, 0, -6.0)]])
    pressed = sheet.press(touches)
    assert (pressed.residual <= 1e-8).all()
    assert pressed.converged.tolist() == [True, False]
    deepest = pressed.displacements[0, sheet.lattice.feet, 2].min()
    assert -0.5 < deepest / sheet.lattice.stroke < -0.49
    for part in (pressed.displacements, pressed.board, pressed.reaction):
        assert np.isnan(part[1]).all()
    slopes = sheet.sensitivity(touches)
    assert np.isfinite(slopes.displacements[0]).all()
    assert np.isnan(slopes.displacements[1]).all()


def test_a_corner_sinks_sooner(planar):
    touches = Touches(
        position=[[(0.002, 0.002)]] * 2, force=[[(0.0, 0.75, -2.5)], [(0.0, 0.9, -3.0)]]
    )
    assert BarHinge(planar).press(touches).converged.tolist() == [True, False]


def test_columns_pulled_off_their_base_are_said(small, cases):
    lattice = build_lattice(small)
    weak = replace(lattice, bond_limit=1e-3)
    pressed = BarHinge(small, lattice=weak).press(cases)
    assert pressed.pulled.any()
    feet = lattice.feet
    pull = (pressed.displacements[:, feet, 2] * lattice.ground[feet, 2]).max()
    for share, torn in ((0.999, True), (1.001, False)):
        strong = BarHinge(small, lattice=replace(lattice, bond_limit=share * pull))
        assert strong.press(cases).pulled.any() == torn
    lost = Touches(position=[[(0.03, 0.04)]], force=[[(0, 0, -40.0)]])
    assert not BarHinge(small, lattice=weak).press(lost).pulled.any()


def test_wrong_arguments_are_refused(sheet, cases):
    for wrong in (0, 1.0, -1e-8):
        with pytest.raises(ArgumentError, match=rf"tolerance must lie in \(0, 1\); got {wrong}"):
            sheet.press(cases, tolerance=wrong)
    off = Touches(position=[[(0.2, 0.0)]], force=[[(0.0, 0.0, -0.1)]])
    with pytest.raises(ArgumentError, match="position must lie on the skin"):
        sheet.press(off)


def test_without_jax_the_extra_is_named(monkeypatch):
    mine = ("model", "equilibrium", "tangent", "continuation", "elements")
    for name in mine:
        monkeypatch.delitem(sys.modules, f"smoskin.mechanics.sheet.{name}", raising=False)
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(MissingExtraError, match=r"needs the extra 'twin'"):
        __import__("smoskin.mechanics.sheet.model")
    for name in mine:
        monkeypatch.delitem(sys.modules, f"smoskin.mechanics.sheet.{name}", raising=False)
