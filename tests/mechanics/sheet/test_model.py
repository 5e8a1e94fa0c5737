"""The nonlinear sheet: its energy, its equilibria and what moves them."""

import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from barhinge_oracle import hinge_gradient
from skins import with_magnets
from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError, DesignError, MissingExtraError
from smoskin.mechanics.reduced.stiffness import board_stiffness
from smoskin.mechanics.sheet import tangent as tangent_module
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sliding, Sticking, Touches
from smoskin.origami.cell import dihedral_angles, size
from smoskin.origami.sheet import vertex_positions

pytest.importorskip("jax")
from smoskin.mechanics.sheet.continuation import follow
from smoskin.mechanics.sheet.model import STIFFNESSES, BarHinge, yaw_stiffness
from smoskin.mechanics.sheet.tangent import Tangent


@pytest.fixture(scope="module")
def small(planar):
    """A skin of 3 x 3 cells."""
    return with_magnets(planar, [(2, 1)], (3, 3))


@pytest.fixture(scope="module")
def sheet(small):
    return BarHinge(small)


@pytest.fixture(scope="module")
def cases(small):
    """A dozen double touches with drags."""
    rng = np.random.default_rng(3)
    whole = np.array([0.060, 0.080]) - 1e-4
    force = rng.uniform([-0.1, -0.1, -0.6], [0.1, 0.1, -0.1], (12, 2, 3))
    force[:4, :, :2] = 0.0
    force[::5, 1] = 0.0
    return Touches(position=rng.uniform(1e-4, whole, (12, 2, 2)), force=force)


def angles(points):
    """Of hinges between two triangles, (H, 4, 3) to (H,)."""
    start, end, one, other = np.moveaxis(points, 1, 0)
    axis = end - start
    left, right = np.cross(axis, one - start), np.cross(other - start, axis)
    sine = (np.cross(left, right) * axis).sum(axis=1) / np.linalg.norm(axis, axis=1)
    return np.arctan2(sine, (left * right).sum(axis=1))


def energy(lattice, motion):
    """Of all springs, J; by the textbook."""
    moved = lattice.nodes + motion
    rest, growth = (np.diff(part[lattice.bars], axis=1)[:, 0] for part in (lattice.nodes, motion))
    stretch = ((2 * rest + growth) * growth).sum(axis=1) / (2 * np.linalg.norm(rest, axis=1))
    turn = angles(moved[lattice.hinges]) - angles(lattice.nodes[lattice.hinges])
    return 0.5 * (
        (lattice.bar_stiffness * stretch**2).sum()
        + (lattice.hinge_stiffness * turn**2).sum()
        + (lattice.ground * motion**2).sum()
    )


def inner_force(lattice, motion):
    """Of all springs at the nodes, N, with the oracle's derivative of an angle."""
    moved = lattice.nodes + motion
    force = lattice.ground * motion
    for (i, j), k in zip(lattice.bars, lattice.bar_stiffness, strict=True):
        rest, now = lattice.nodes[j] - lattice.nodes[i], moved[j] - moved[i]
        length = np.linalg.norm(rest)
        push = k * (now @ now - rest @ rest) / (2 * length) * now / length
        force[j] += push
        force[i] -= push
    turn = angles(moved[lattice.hinges]) - angles(lattice.nodes[lattice.hinges])
    for nodes, k, by in zip(lattice.hinges, lattice.hinge_stiffness, turn, strict=True):
        # The oracle's angle has the other sign.
        force[nodes] -= k * by * hinge_gradient(moved[nodes])
    return force


def outer_force(model, touches, pressed, row):
    """Of the touches at the nodes, N."""
    case = model._case(touches)
    force = touches.force[row].copy()
    force[:, :2] += pressed.reaction[row]
    loads = np.zeros_like(model.lattice.nodes)
    loads[model.lattice.loaded.ravel()] = case.shares[row].T @ force
    return loads


# --- elements and tangent


def test_the_fold_angle_is_atan2_to_the_last_digits_and_smooth_through_flat():
    import jax

    from smoskin.mechanics.sheet import elements

    turn = np.concatenate([np.linspace(-3.1, 3.1, 601), [-1e-9, 0.0, 1e-9]])
    wings = np.stack([0.4 + 0 * turn, np.cos(turn), np.sin(turn)], axis=-1)
    places = np.zeros((4, len(turn), 3))
    places[1, :, 0], places[2], places[3] = 2.0, [0.7, 1.3, 0.0], wings * [1, -1, -1]
    with jax.enable_x64(True):
        arms = (places[1:] - places[0])[..., None]
        found = np.asarray(elements.fold(arms, np.zeros((4, *arms.shape[1:]))).angle)[:, 0]
    np.testing.assert_allclose(found, angles(np.moveaxis(places, 0, 1)), rtol=1e-14, atol=2e-15)
    np.testing.assert_allclose(np.abs(found), np.abs(turn), rtol=1e-9)


def test_forces_and_tangent_are_derivatives_of_the_energy(sheet, cases):
    """Taylor: the remainder falls as h^2 without the tangent, as h^3 with it."""
    lattice, tangent = sheet.lattice, sheet._equilibrium.tangent
    motion = sheet.press(cases).displacements[0]
    step = np.random.default_rng(0).normal(scale=3e-6, size=motion.shape)
    place = tangent.at(motion)
    # x' K x from the factor L of the band: |L' x|^2.
    flat = np.empty(step.size)
    flat[tangent._where] = step.ravel()
    along = np.zeros(step.size)
    for k, row in enumerate(place.factor):
        along[: step.size - k] += row[: step.size - k] * flat[k:]
    first, second = (place.inner.sum(axis=0) * step).sum(), along @ along
    base = energy(lattice, motion)
    sizes = 2.0 ** -np.arange(5)
    rest = np.array([energy(lattice, motion + h * step) - base - h * first for h in sizes])
    order = np.log2(np.abs(rest[:-1] / rest[1:]))
    np.testing.assert_allclose(order, 2, atol=0.15)
    rest -= sizes**2 / 2 * second
    order = np.log2(np.abs(rest[:-1] / rest[1:]))
    np.testing.assert_allclose(order, 3, atol=0.25)


def test_inner_forces_agree_with_the_textbook(sheet):
    motion = np.random.default_rng(2).normal(scale=1e-4, size=sheet.lattice.nodes.shape)
    found = sheet._equilibrium.tangent.at(motion, np.zeros(84 + 36 + 36)).inner.sum(axis=0)
    expected = inner_force(sheet.lattice, motion)
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


# --- equilibria


def test_presses_are_in_equilibrium(sheet, cases):
    """Against forces that are computed apart from the solver; 1e-8 of the load is asked for."""
    pressed = sheet.press(cases, tolerance=1e-8)
    assert pressed.converged.all()
    assert pressed.residual.max() <= 1e-8
    for row in range(len(cases)):
        loads = outer_force(sheet, cases, pressed, row)
        unbalanced = inner_force(sheet.lattice, pressed.displacements[row]) - loads
        assert np.linalg.norm(unbalanced) <= 2e-8 * np.linalg.norm(loads)


def test_a_sticking_touch_stands_still_over_the_ground(sheet, cases):
    """Where it does not drag: the patch's motion on the sheet undoes that of the board."""
    pressed = sheet.press(cases)
    case = sheet._case(cases)
    top = sheet.lattice.loaded.ravel()
    for row in range(4):
        for k in np.flatnonzero(cases.pressed[row]):
            patch = case.shares[row, k] @ pressed.displacements[row, top, :2]
            x, y = case.arms[row, k]
            slide, yaw = pressed.board[row, :2], pressed.board[row, 2]
            np.testing.assert_allclose(patch + slide + yaw * np.array([-y, x]), 0, atol=2e-12)
        assert np.abs(pressed.reaction[row, 0]).max() > 1e-3


def test_the_board_carries_what_the_touches_push_sideways(sheet, small, cases):
    pressed = sheet.press(cases)
    push = cases.force[..., :2] + pressed.reaction
    np.testing.assert_allclose(pressed.board[:, :2], push.sum(axis=1) / board_stiffness(small))
    arms = sheet._case(cases).arms
    moment = (arms[..., 0] * push[..., 1] - arms[..., 1] * push[..., 0]).sum(axis=1)
    np.testing.assert_allclose(pressed.board[:, 2] * yaw_stiffness(small), moment)
    # The sheet's own springs pass on all of it.
    lattice = sheet.lattice
    carried = (lattice.ground[:, :2] * pressed.displacements[..., :2]).sum(axis=1)
    np.testing.assert_allclose(carried, push.sum(axis=1), atol=1e-8)


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
    case = model._case(cases)
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


def test_numbering_does_not_matter(small, sheet, cases):
    rng = np.random.default_rng(5)
    lattice = sheet.lattice
    new = rng.permutation(len(lattice.nodes))  # old node i is node new[i]
    old = np.argsort(new)
    bars = rng.permutation(len(lattice.bars))
    panels = rng.permutation(lattice.panel_hinges)
    rest = len(lattice.hinges) - lattice.panel_hinges
    hinges = np.concatenate([panels, lattice.panel_hinges + rng.permutation(rest)])
    shuffled = replace(
        lattice,
        nodes=lattice.nodes[old],
        bars=new[lattice.bars[bars]][:, ::-1],
        bar_stiffness=lattice.bar_stiffness[bars],
        # Turned end for end, the wings trade places: the angle stays.
        hinges=new[lattice.hinges[hinges]][:, [1, 0, 3, 2]],
        hinge_stiffness=lattice.hinge_stiffness[hinges],
        ground=lattice.ground[old],
        frame=lattice.frame[old],
        loaded=new[lattice.loaded],
        feet=rng.permutation(new[lattice.feet]),
    )
    plain = sheet.press(cases, tolerance=1e-10)
    other = BarHinge(small, lattice=shuffled).press(cases, tolerance=1e-10)
    moved = other.displacements[:, new]
    scale = np.abs(plain.displacements).max()
    np.testing.assert_allclose(moved, plain.displacements, atol=1e-9 * scale)


def test_a_rows_answer_does_not_hang_on_its_neighbours(sheet, cases):
    order = np.random.default_rng(0).permutation(len(cases))
    shuffled = Touches(position=cases.position[order], force=cases.force[order])
    whole = sheet.press(cases)
    np.testing.assert_array_equal(sheet.press(shuffled).displacements, whole.displacements[order])
    alone = sheet.press(Touches(position=cases.position[5:6], force=cases.force[5:6]))
    np.testing.assert_allclose(
        alone.displacements[0],
        whole.displacements[5],
        atol=1e-8 * np.abs(alone.displacements).max(),
    )


def test_a_start_near_the_answer_saves_steps(sheet, cases):
    cold = sheet.press(cases)
    warm = sheet.press(cases, start=cold.displacements)
    assert warm.iterations.sum() < cold.iterations.sum()
    np.testing.assert_allclose(warm.displacements, cold.displacements, atol=1e-10)
    lost = np.full_like(cold.displacements, np.nan)
    np.testing.assert_array_equal(sheet.press(cases, start=lost).displacements, cold.displacements)


def test_a_touch_lighter_than_rounding_is_solved_as_quickly(sheet):
    touches = Touches(
        position=np.full((3, 1, 2), 0.03), force=[[[0, 0, -f]] for f in (1e-17, 1e-9, 0.1)]
    )
    found = sheet.press(touches)
    assert found.converged.all()
    assert (found.iterations[:2] <= found.iterations[2]).all()
    sunk = found.displacements[..., 2].min(axis=1)
    assert sunk[1] == pytest.approx(1e-8 * sunk[2], rel=0.1)


def test_no_touch_moves_nothing(sheet):
    touches = Touches(position=np.zeros((2, 2, 2)), force=np.zeros((2, 2, 3)))
    pressed = sheet.press(touches)
    assert pressed.converged.all()
    assert not pressed.displacements.any()
    assert not pressed.board.any()


# --- against independent solutions


def ten_mm_cell() -> MiuraCell:
    return MiuraCell(
        panel_a=0.01, panel_b=0.01, sector_angle=math.radians(60), fold_angle=math.radians(45)
    )


@pytest.mark.parametrize(("count", "expected"), [(3, 18.808e3), (6, 184.41e3)])
def test_the_rigid_limit_is_the_closed_form(planar, count, expected):
    """Near-rigid panels on columns that cannot sink, a small free press: 0.1 %."""
    design = with_magnets(replace(planar, cell=ten_mm_cell()), [(1, 1)], (count, count))
    springs = replace(
        springs_of(design),
        column_shear=63.0,
        column_axial=1e11,
        frame=0.0,
        panel_bending=1e4,
        panel_membrane=1e11,
    )
    model = BarHinge(design, grip=Frictionless(), lattice=build_lattice(design, springs))
    extent = size(design.cell)
    force = -5e-7 * expected
    for n, m in ((0, 0), (count // 2, count // 2)):
        position = [[((n + 0.5) * float(extent.length), (m + 0.5) * float(extent.width))]]
        touches = Touches(position=position, force=[[(0.0, 0.0, force)]], radius=1e-9)
        pressed = model.press(touches, tolerance=1e-5)
        assert pressed.converged.all()
        sunk = pressed.displacements[0, model.lattice.loaded[n, m], 2]
        assert force / sunk == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("sticks", [False, True])
def test_one_cell_of_rigid_panels_folds_as_its_one_degree_of_freedom_says(planar, sticks):
    """S1's motion exactly, the least energy over fold angle, place and pose, by SciPy."""
    design = with_magnets(planar, [(0, 0)], (1, 1))
    springs = replace(
        springs_of(design), panel_bending=1e4, panel_membrane=1e10, crease=0.5, column_axial=200.0
    )
    grip = Sticking() if sticks else Frictionless()
    lattice = build_lattice(design, springs)
    model = BarHinge(design, grip=grip, lattice=lattice)
    force = 0.9
    rest = lattice.nodes
    top, feet = int(lattice.loaded[0, 0]), lattice.feet
    creases = lattice.hinges[lattice.panel_hinges :, :2]
    rigidity = lattice.hinge_stiffness[lattice.panel_hinges :]
    along_x = np.abs(rest[creases[:, 1], 0] - rest[creases[:, 0], 0]) > 1e-6
    cell = design.cell

    def places(state):
        folded = replace(cell, fold_angle=cell.fold_angle + state[0])
        shape = vertex_positions(folded, (1, 1)).reshape(-1, 3)
        shape = shape - shape[top]
        turned = Rotation.from_rotvec(state[1:4]).apply(shape)
        return rest[top] + 1e-3 * state[4:7] + turned, dihedral_angles(folded)

    before = dihedral_angles(cell)

    def total(state):
        now, bent = places(state)
        turn = np.where(along_x, bent.at_b - before.at_b, bent.at_a - before.at_a)
        motion = now - rest
        spent = 0.5 * (lattice.ground[feet] * motion[feet] ** 2).sum()
        spent += 0.5 * (rigidity * turn**2).sum() + force * motion[top, 2]
        if sticks:
            spent += 0.5 * board_stiffness(design) * (motion[top, :2] ** 2).sum()
        return 1e3 * spent

    least = minimize(total, np.zeros(7), method="BFGS", options={"gtol": 1e-9, "maxiter": 2000})
    expected = places(least.x)[0] - rest
    touches = Touches(position=[[rest[top, :2]]], force=[[(0.0, 0.0, -force)]])
    pressed = model.press(touches)
    assert pressed.converged.all()
    found = pressed.displacements[0]
    assert -found[top, 2] > 0.1 * rest[top, 2]  # far from linear
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


def test_following_the_load_finds_the_same_equilibria(sheet, cases):
    model, equilibrium = sheet, sheet._equilibrium
    pressed = model.press(cases, tolerance=1e-10)
    case = model._case(cases)
    for row in (0, 1):
        press = equilibrium.one_press(
            case.shares[row], cases.force[row], case.held[row], case.link[row]
        )
        found = follow(equilibrium.tangent, press, 1e-10)
        assert found is not None
        scale = np.abs(found.motion).max()
        np.testing.assert_allclose(found.motion, pressed.displacements[row], atol=1e-9 * scale)


def test_a_band_in_blocks_gives_the_same_equilibria_as_the_whole_inverse(
    small, sheet, cases, monkeypatch
):
    monkeypatch.setattr(tangent_module, "_WHOLE", 0)
    blocks = BarHinge(small)
    rest = Tangent(sheet.lattice).at_rest()
    assert len(rest.inverse) > 1
    one, other = (model.press(cases, tolerance=1e-10) for model in (sheet, blocks))
    scale = np.abs(one.displacements).max()
    np.testing.assert_allclose(one.displacements, other.displacements, atol=1e-9 * scale)
    np.testing.assert_array_equal(one.converged, other.converged)


# --- derivatives


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


# --- what is refused or flagged


def test_a_sheet_that_nothing_holds_is_refused(small):
    springs = replace(springs_of(small), frame=0.0, crease=0.0, column_shear=0.0)
    with pytest.raises(DesignError, match="the sheet must hold its shape; some motion"):
        BarHinge(small, lattice=build_lattice(small, springs))
    # Soft columns alone are enough.
    BarHinge(small, lattice=build_lattice(small, replace(springs, column_shear=0.1)))


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


def test_columns_pulled_off_their_base_are_said(small, cases):
    lattice = build_lattice(small)
    weak = replace(lattice, bond_limit=1e-3)
    assert BarHinge(small, lattice=weak).press(cases).pulled.any()
    assert not BarHinge(small, lattice=replace(lattice, bond_limit=1e3)).press(cases).pulled.any()


def test_wrong_arguments_are_refused(sheet, cases):
    with pytest.raises(ArgumentError, match=r"tolerance must lie in \(0, 1\); got 0"):
        sheet.press(cases, tolerance=0)
    off = Touches(position=[[(0.2, 0.0)]], force=[[(0.0, 0.0, -0.1)]])
    with pytest.raises(ArgumentError, match="position must lie on the skin"):
        sheet.press(off)


def test_jax_keeps_its_own_precision(sheet, cases):
    import jax

    sheet.press(cases)
    assert not jax.config.jax_enable_x64


def test_without_jax_the_extra_is_named(monkeypatch):
    mine = ("model", "equilibrium", "tangent", "continuation", "elements")
    for name in mine:
        monkeypatch.delitem(sys.modules, f"smoskin.mechanics.sheet.{name}", raising=False)
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(MissingExtraError, match=r"needs the extra 'twin'"):
        __import__("smoskin.mechanics.sheet.model")
    for name in mine:
        monkeypatch.delitem(sys.modules, f"smoskin.mechanics.sheet.{name}", raising=False)


@pytest.mark.slow
def test_the_number_of_threads_changes_no_digit():
    program = (
        "import hashlib, numpy as np\n"
        "from smoskin import load_design\n"
        "from smoskin.mechanics.sheet.model import BarHinge\n"
        "from smoskin.mechanics.sheet.touches import Touches\n"
        "rng = np.random.default_rng(0)\n"
        "place = rng.uniform(0, [0.12, 0.16], (200, 1, 2))\n"
        "force = rng.uniform([-0.2, -0.2, -1.5], [0.2, 0.2, -0.1], (200, 1, 3))\n"
        "pressed = BarHinge(load_design('planar')).press(Touches(position=place, force=force))\n"
        "print(hashlib.sha256(pressed.displacements.tobytes()).hexdigest())\n"
    )
    digests = set()
    for threads in ("1", "2"):
        environment = os.environ | {
            "OMP_NUM_THREADS": threads,
            "OPENBLAS_NUM_THREADS": threads,
            "XLA_FLAGS": f"--xla_cpu_multi_thread_eigen={threads != '1'}".lower(),
        }
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
            timeout=200,
        )
        digests.add(done.stdout)
    assert len(digests) == 1
