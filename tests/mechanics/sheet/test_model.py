"""Touches on the nonlinear sheet: what holds, what slides, what counts, and its derivatives."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import ArgumentError, MissingExtraError
from smoskin.mechanics.board import carried
from smoskin.mechanics.reduced.stiffness import board_stiffness
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sliding, Sticking, Touches
from smoskin.origami.cell import size
from textbook_sheet import column_loads, outer_force

pytest.importorskip("jax")
from smoskin.mechanics.sheet.model import STIFFNESSES, BarHinge


def patches(sheet, touches):
    """Motion of each patch with each of the board's motions, (B, K, 3, 6)."""
    shares = sheet._loads(touches).shares
    return carried(sheet.board, shares @ sheet.lattice.nodes[sheet.lattice.loaded.ravel()])


def test_a_sticking_touch_stands_still_over_the_ground(sheet, cases):
    """Where it does not drag: the patch's motion on the sheet undoes that of the board."""
    pressed, shares = sheet.press(cases), sheet._loads(cases).shares
    top = sheet.lattice.loaded.ravel()
    by_board = np.einsum("bkds,bs->bkd", patches(sheet, cases), pressed.board)
    for row in range(4):
        for k in np.flatnonzero(cases.pressed[row]):
            patch = shares[row, k] @ pressed.displacements[row, top]
            np.testing.assert_allclose((patch + by_board[row, k])[:2], 0, atol=2e-12)
        assert np.abs(pressed.reaction[row, 0]).max() > 1e-3


def test_the_board_carries_what_the_touches_push(sheet, small, cases):
    """Slides, sinks and tilts alike: forces and moments about its middle over its stiffness."""
    pressed = sheet.press(cases)
    push = cases.force.copy()
    push[..., :2] += pressed.reaction
    moments = np.einsum("bkds,bkd->bs", patches(sheet, cases), push)
    np.testing.assert_allclose(pressed.board, moments / sheet.board.stiffness, atol=1e-15)
    assert sheet.board.stiffness[0] == board_stiffness(small)
    # The columns pass on all of it.
    lattice = sheet.lattice
    inner = sheet._equilibrium.tangent.blocks(pressed.displacements[2], np.zeros(6)).pushes[3:]
    np.testing.assert_allclose(inner.sum(axis=(0, 1)), push[2].sum(axis=0), atol=1e-8)
    assert len(lattice.feet) == 28


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
        pressed.board[:, :3], cases.force.sum(axis=1) / model.board.stiffness[:3]
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
        assert np.abs(pressed.displacements[0]).max() < 1e-15
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
    direct, reflected = model.press(cases, tolerance=1e-10), model.press(mirrored, tolerance=1e-10)
    grid = direct.displacements.reshape(len(cases), 7, 7, 3)
    image = reflected.displacements.reshape(len(cases), 7, 7, 3)[:, ::-1] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(grid, image, atol=1e-9 * np.abs(grid).max())
    np.testing.assert_allclose(direct.board, reflected.board * [-1, 1, 1, 1, -1, -1], atol=1e-11)
    np.testing.assert_allclose(direct.reaction, reflected.reaction * [-1.0, 1.0], atol=1e-8)


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


@pytest.mark.parametrize(
    ("grip", "load_share"),
    [
        (Sticking(), 0.0),
        (Sticking(), 1.0),
        (Sliding(friction=0.06), 0.0),
        (Frictionless(), 0.0),
        (Covered(), 0.0),
    ],
)
def test_derivatives_are_those_of_presses_solved_anew(small, grip, load_share):
    """On pillars that load softens too."""
    small = replace(small, shear_layer=replace(small.shear_layer, load_share=load_share))
    position = np.array([[(0.0213, 0.0312), (0.0475, 0.0633)]])
    force = np.array([[(0.06, -0.05, -0.5), (0.0, 0.02, -0.3)]])
    model = BarHinge(small, grip=grip)

    def moved(model, where, push):
        pressed = model.press(Touches(position=where, force=push), tolerance=3e-11)
        assert pressed.converged.all()
        return np.concatenate([pressed.displacements[0].ravel(), pressed.board[0]])

    def check(displacements, board, more, less, step):
        slope = (more - less) / (2 * step)
        exact = np.concatenate([displacements.ravel(), board])
        np.testing.assert_allclose(exact, slope, atol=4e-6 * max(np.abs(slope).max(), 1e-12))

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
            *(moved(variant, position, force) for variant in changed),
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


def test_answers_count_until_a_column_is_half_as_high(small, cases, monkeypatch):
    lattice = build_lattice(small)
    soft = replace(lattice.supports, axial=0.5 * lattice.supports.axial)
    model = BarHinge(small, lattice=replace(lattice, supports=soft))
    pressed = model.press(cases)
    assert pressed.converged.all()
    deepest = -pressed.displacements[:, lattice.feet, 2].min() / small.columns.height
    for share, counts in ((1.001, True), (0.999, False)):
        monkeypatch.setattr("smoskin.mechanics.sheet.model._DEEPEST", share * deepest)
        assert model.press(cases).converged.all() == counts


def test_how_far_columns_are_from_buckling_is_said(planar):
    """A corner comes first; no load is infinitely far."""
    force = np.zeros((4, 1, 3))
    force[:, 0, 2] = [-0.5, -1.0, -1.0, 0.0]
    where = [[(0.0, 0.0)], [(0.0, 0.0)], [(0.06, 0.08)], [(0.0, 0.0)]]
    model = BarHinge(planar)
    pressed = model.press(Touches(position=where, force=force))
    corner, harder, middle, none = pressed.buckling_margin
    assert corner > harder > 2.0
    assert middle > harder
    assert none == np.inf
    load = column_loads(model.lattice, pressed.displacements[1])[0]
    part = np.max(load / model.lattice.supports.buckling_load)
    assert harder == pytest.approx(float(1 / part), rel=1e-6)


def test_columns_pulled_off_their_base_are_said(small, cases):
    lattice = build_lattice(small)
    weak = replace(lattice, bond_limit=1e-3)
    pressed = BarHinge(small, lattice=weak).press(cases)
    assert pressed.pulled.any()
    loads = [column_loads(lattice, motion)[0] for motion in pressed.displacements]
    pull = -float(np.min(loads))
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
