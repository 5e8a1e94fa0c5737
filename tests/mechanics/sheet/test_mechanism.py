"""A press on cell (1,1) of a skin without a frame, against an independent dense linear model.

That model has bars, hinges and columns that bend, clamped at both ends of their height; it was
written apart from this package, and printed what it found for columns of 1.5 by 10 mm, panels of
1 mm and film of 50 um over 1 mm. Its board does not tilt, and its columns' ends are Timoshenko's,
2.92 N/m.
"""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.mechanics.board import board_of
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sticking, Touches
from smoskin.origami.geometry import geometry

pytest.importorskip("jax")
from smoskin.mechanics.sheet.model import BarHinge


@pytest.fixture(scope="module")
def slender(planar):
    return replace(
        planar,
        columns=replace(planar.columns, radius=1.5e-3, height=10e-3),
        panels=replace(planar.panels, thickness=1e-3),
        creases=replace(planar.creases, thickness=50e-6, gap=1e-3),
        frame=replace(planar.frame, clearance=0.5, held_height=5e-3),
    )


def timoshenko(design):
    """The lattice with columns of 1.5 by 10 mm whose ends bending does not stiffen."""
    lattice = build_lattice(design, replace(springs_of(design), column_lateral=2.9212))
    share = np.full(lattice.feet.size, 0.01875)
    return replace(lattice, supports=replace(lattice.supports, shear_share=share))


@pytest.mark.parametrize(
    ("grip", "second", "third", "stiffness", "within"),
    [
        (Frictionless(), (181, -126), (-142, 269), (0.62, 1.39, 2.31), 3.0),
        (Covered(), (449, 342), (225, 524), (0.67, 1.46, 2.33), 1.0),
        (Sticking(), (428, 304), (195, 503), (0.66, 1.45, 2.33), 1.0),
    ],
)
def test_magnets_move_and_cells_yield_as_in_a_linear_model(
    slender, grip, second, third, stiffness, within
):
    soft = board_of(slender)
    sliding = 1885.0  # that model's board: pillars in shear, S26, that neither sink nor tilt
    yaw = sliding * (geometry(slender).extent ** 2).sum() / 12
    level = np.array([sliding, sliding, 1e9, 1e9, 1e9, yaw])
    model = BarHinge(
        slender, grip=grip, lattice=timoshenko(slender), board=replace(soft, stiffness=level)
    )
    cells, force = [0, 7, 14], 0.01
    tops = geometry(slender).tops.reshape(-1, 2)[cells]
    push = np.zeros((3, 1, 3))
    push[..., 2] = -force
    pressed = model.press(Touches(position=tops[:, None], force=push, radius=1e-9))
    assert pressed.converged.all()
    motion = np.einsum("gkvd,vd->gk", holder_matrix(slender), pressed.displacements[0])
    compliance = motion[1:, :2] / force * 1e6
    np.testing.assert_allclose(compliance, [second, third], atol=within)
    sunk = -pressed.displacements[[0, 1, 2], model.lattice.loaded.ravel()[cells], 2]
    np.testing.assert_allclose(force / sunk / 1e3, stiffness, atol=0.006)


def test_a_press_of_a_newton_softens_the_middle(slender):
    """The review's nonlinear model: K33 from 2.33 to 2.07 N/mm, columns losing stiffness."""
    model = BarHinge(slender, grip=Covered(), lattice=timoshenko(slender))
    where = geometry(slender).tops[2, 2]
    pressed = model.press(Touches(position=[[where]], force=[[(0, 0, -1.0)]], radius=1e-9))
    sunk = -pressed.displacements[0, model.lattice.loaded[2, 2], 2]
    assert 1e-3 / sunk == pytest.approx(2.07, abs=0.02)
