"""Equilibria of the sheet: balance, independence of numbering, neighbours and start."""

import itertools
import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from skins import with_magnets
from smoskin.design.skin import MiuraCell
from smoskin.mechanics.board import carried
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Frictionless, Sticking, Touches
from smoskin.origami.cell import dihedral_angles
from smoskin.origami.geometry import geometry
from smoskin.origami.sheet import vertex_positions
from textbook_sheet import inner_force, outer_force

pytest.importorskip("jax")
from smoskin.mechanics.sheet.model import BarHinge


def test_presses_are_in_equilibrium(sheet, cases):
    """Against forces that are computed apart from the solver; 1e-8 of the load is asked for."""
    pressed = sheet.press(cases, tolerance=1e-8)
    assert pressed.converged.all()
    assert pressed.residual.max() <= 1e-8
    for row in range(len(cases)):
        loads = outer_force(sheet, cases, pressed, row)
        unbalanced = inner_force(sheet.lattice, pressed.displacements[row]) - loads
        assert np.linalg.norm(unbalanced) <= 2e-8 * np.linalg.norm(loads)


def test_what_is_left_unbalanced_is_stated_over_the_load(sheet, cases):
    """Of coarse answers, where rounding says nothing, to the presses without drag."""
    pressed, loads = sheet.press(cases, tolerance=3e-3), sheet._loads(cases)
    for row in range(4):
        loaded = outer_force(sheet, cases, pressed, row)
        unbalanced = inner_force(sheet.lattice, pressed.displacements[row]) - loaded
        stated = pressed.residual[row] * np.linalg.norm(loads.shares[row].T @ loads.force[row])
        assert stated == pytest.approx(np.linalg.norm(unbalanced), rel=1e-4)
    assert pressed.residual[:4].max() > 1e-4


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
        crease_set=lattice.crease_set,
        supports=replace(lattice.supports, feet=new[lattice.feet]),
        stops=replace(lattice.stops, nodes=new[lattice.stops.nodes]),
        loaded=new[lattice.loaded],
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


def test_presses_of_like_depth_are_solved_side_by_side(sheet):
    """Two touches each, at three pairs of places, with eight forces: 24 presses in any order."""
    rng = np.random.default_rng(1)
    places = geometry(sheet.design).tops.reshape(-1, 2)[[[0, 8], [3, 5], [1, 7]]]
    force = np.multiply.outer(np.linspace(0.02, 0.16, 8), [0.0, 0.0, -1.0])
    order = rng.permutation(24)
    position = np.repeat(places, 8, axis=0)[order]
    touches = Touches(position=position, force=np.tile(force, (3, 1))[order][:, None].repeat(2, 1))
    loads = sheet._loads(touches)
    down = sheet.press(touches).displacements[:, sheet.lattice.loaded.ravel(), 2]
    depth = -np.einsum("bkt,bt->b", loads.shares, down)
    chunks = [depth[rows] for rows in sheet._equilibrium._chunks(loads, 6)]
    assert [len(chunk) for chunk in chunks] == [6, 6, 6, 6]
    for shallow, deep in itertools.pairwise(chunks):
        assert shallow.max() <= 1.25 * deep.min()  # one touch leans on the other
    assert [len(rows) for rows in sheet._equilibrium._chunks(loads, 24)] == [24]


def test_a_start_near_the_answer_saves_steps(sheet, cases):
    cold = sheet.press(cases)
    warm = sheet.press(cases, start=cold.displacements)
    assert warm.iterations.sum() < cold.iterations.sum()
    np.testing.assert_allclose(warm.displacements, cold.displacements, atol=1e-10)
    lost = np.full_like(cold.displacements, np.nan)
    np.testing.assert_array_equal(sheet.press(cases, start=lost).displacements, cold.displacements)


@pytest.mark.slow
def test_a_touch_lighter_than_rounding_is_solved_as_quickly(sheet):
    touches = Touches(
        position=np.full((3, 1, 2), 0.03), force=[[[0, 0, -f]] for f in (1e-17, 1e-9, 0.1)]
    )
    pressed = sheet.press(touches)
    assert pressed.converged.all()
    assert (pressed.iterations[:2] <= pressed.iterations[2]).all()
    sunk = pressed.displacements[..., 2].min(axis=1)
    assert sunk[1] == pytest.approx(1e-8 * sunk[2], rel=0.1)


def test_no_touch_moves_nothing(sheet):
    touches = Touches(position=np.zeros((2, 2, 2)), force=np.zeros((2, 2, 3)))
    pressed = sheet.press(touches)
    assert pressed.converged.all()
    assert not pressed.displacements.any()
    assert not pressed.board.any()


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
        column_lateral=63.0,
        column_axial=1e11,
        crease=0.02604,
        panel_bending=1e4,
        panel_membrane=1e11,
    )
    lattice = build_lattice(design, springs)
    # So tall that they sway without sinking, which nothing else would let them.
    tall = replace(lattice.supports, height=1e3 * np.ones(lattice.feet.size))
    model = BarHinge(design, grip=Frictionless(), lattice=replace(lattice, supports=tall))
    extent = geometry(design).cell
    force = -5e-7 * expected
    for n, m in ((0, 0), (count // 2, count // 2)):
        position = [[((n + 0.5) * float(extent.length), (m + 0.5) * float(extent.width))]]
        touches = Touches(position=position, force=[[(0.0, 0.0, force)]], radius=1e-9)
        pressed = model.press(touches, tolerance=1e-5)
        assert pressed.converged.all()
        sunk = pressed.displacements[0, model.lattice.loaded[n, m], 2]
        assert force / sunk == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("sticks", [False, True])
def test_one_cell_of_rigid_panels_folds_as_its_one_degree_of_freedom_says(planar, sticks):
    """S1's motion exactly, the least energy over fold angle, place and pose, by SciPy."""
    design = with_magnets(planar, [(0, 0)], (1, 1))
    springs = replace(
        springs_of(design), panel_bending=1e4, panel_membrane=1e10, crease=0.5, column_axial=200.0
    )
    grip = Sticking() if sticks else Frictionless()
    lattice = build_lattice(design, springs)
    # So tall that they sway without sinking, and the frame far away.
    tall = replace(lattice.supports, height=1e3 * np.ones(lattice.feet.size))
    far = replace(lattice.stops, free=lattice.stops.free + 1.0)
    lattice = replace(lattice, supports=tall, stops=far)
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
        spent = 0.5 * tall.lateral @ (motion[feet, :2] ** 2).sum(axis=1)
        spent += 0.5 * tall.axial @ motion[feet, 2] ** 2
        spent += 0.5 * (rigidity * turn**2).sum() + force * motion[top, 2]
        if sticks:
            gap = motion[top, :2] + tilted
            spent += 0.5 * (gap @ np.linalg.solve(give, gap))
        return 1e3 * spent

    # The board under the patch: it slides, and tilts and turns with the patch's arm.
    arm = carried(model.board, rest[top])
    soft = arm / model.board.stiffness
    give, tilted = soft[:2] @ arm[:2].T, soft[:2] @ (-force * arm[2])
    least = minimize(total, np.zeros(7), method="BFGS", options={"gtol": 1e-9, "maxiter": 2000})
    expected = places(least.x)[0] - rest
    touches = Touches(position=[[rest[top, :2]]], force=[[(0.0, 0.0, -force)]])
    pressed = model.press(touches)
    assert pressed.converged.all()
    displaced = pressed.displacements[0]
    assert -displaced[top, 2] > 0.1 * rest[top, 2]  # far from linear
    np.testing.assert_allclose(displaced, expected, atol=2e-3 * np.abs(expected).max())


def test_jax_keeps_its_own_precision(sheet, cases):
    import jax

    sheet.press(cases)
    assert not jax.config.jax_enable_x64


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
