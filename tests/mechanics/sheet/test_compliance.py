"""How the sheet gives way where it is gripped, against presses of the whole sheet."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Frictionless, Touches
from smoskin.origami.geometry import geometry

pytest.importorskip("jax")
from smoskin.mechanics.sheet.compliance import grip_compliance
from smoskin.mechanics.sheet.model import BarHinge


@pytest.mark.parametrize("soft", [False, True])
def test_small_forces_move_vertices_as_the_whole_sheet_says(small, soft):
    """Over the ground: the sheet on its board, which slides and turns on its pillars."""
    lattice = None
    if soft:
        springs = springs_of(small)
        lattice = build_lattice(small, replace(springs, frame=0.5 * springs.frame))
    compliance = grip_compliance(small, lattice)
    assert compliance.shape == (9, 2, 9, 3)
    model = BarHinge(small, grip=Frictionless(), lattice=lattice)
    places = geometry(small).tops.reshape(-1, 2)
    arms = places - geometry(small).extent / 2
    force = 1e-6
    for vertex, axis in ((0, 0), (0, 1), (5, 0), (5, 2), (7, 1)):
        push = np.zeros(3)
        # A touch must press: what pressing alone does is taken off.
        push[2] = -force
        both = [push, push.copy()]
        if axis < 2:
            both[0][axis] = force
        touches = Touches(
            position=[[places[vertex]]] * 2, force=[[one] for one in both], radius=1e-9
        )
        pressed = model.press(touches, tolerance=1e-7)
        moved = pressed.displacements[:, model.lattice.loaded.ravel(), :2]
        turned = np.stack([-arms[:, 1], arms[:, 0]], axis=-1)
        moved = moved + pressed.board[:, None, :2] + pressed.board[:, 2:, None] * turned
        one = moved[0] - moved[1] if axis < 2 else moved[0]
        scale = np.abs(compliance[:, :, vertex, axis]).max()
        np.testing.assert_allclose(one / force, compliance[:, :, vertex, axis], atol=2e-3 * scale)
