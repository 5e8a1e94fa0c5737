"""How the sheet gives way where it is gripped, against presses of the whole sheet."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Frictionless, Touches
from smoskin.origami.geometry import geometry

pytest.importorskip("jax")
from smoskin.mechanics.board import carried
from smoskin.mechanics.sheet.compliance import grip_compliance, load_coupling
from smoskin.mechanics.sheet.model import BarHinge


@pytest.mark.parametrize("soft", [pytest.param(False, marks=pytest.mark.slow), True])
def test_small_forces_move_vertices_as_the_whole_sheet_says(small, soft):
    """Over the ground: the sheet on its board, which slides and turns on its pillars."""
    lattice = None
    if soft:
        springs = springs_of(small)
        lattice = build_lattice(
            small, replace(springs, column_lateral=0.5 * springs.column_lateral)
        )
    compliance = grip_compliance(small, lattice)
    assert compliance.shape == (9, 2, 9, 3)
    model = BarHinge(small, grip=Frictionless(), lattice=lattice)
    tops = geometry(small).tops.reshape(-1, 2)
    force = 1e-6
    for vertex, axis in ((0, 0), (0, 1), (5, 0), (5, 2), (7, 1)):
        push = np.zeros(3)
        # A touch must press: what pressing alone does is taken off.
        push[2] = -force
        both = [push, push.copy()]
        if axis < 2:
            both[0][axis] = force
        touches = Touches(
            position=[[tops[vertex]]] * 2, force=[[load] for load in both], radius=1e-9
        )
        pressed = model.press(touches, tolerance=1e-7)
        moved = pressed.displacements[:, model.lattice.loaded.ravel(), :2]
        places = geometry(small).sheet.vertices[model.lattice.loaded.ravel()]
        shift = np.einsum("hdb,rb->rhd", carried(model.board, places)[:, :2], pressed.board)
        moved = moved + shift
        response = moved[0] - moved[1] if axis < 2 else moved[0]
        scale = np.abs(compliance[:, :, vertex, axis]).max()
        np.testing.assert_allclose(
            response / force, compliance[:, :, vertex, axis], atol=2e-3 * scale
        )


@pytest.mark.slow
def test_two_small_presses_move_besides_what_the_second_order_says(small):
    """Second differences of presses of the whole sheet, of readings of any motion of it."""
    model, rng = BarHinge(small, grip=Frictionless()), np.random.default_rng(3)
    readings = rng.normal(size=(2, *geometry(small).sheet.vertices.shape))
    coupling = load_coupling(small, readings)
    assert coupling.shape == (9, 3, 9, 3, 2)
    turned = coupling.transpose(2, 3, 0, 1, 4)
    np.testing.assert_allclose(turned, coupling, atol=1e-6 * np.abs(coupling).max())
    tops, force = geometry(small).tops.reshape(-1, 2), 2e-3
    pairs = ((0, 4, (0, 0)), (1, 8, (1, 0)), (3, 5, (0, 1)))
    for first, other, drag in pairs:
        loads = np.zeros((3, 2, 3))
        loads[:2, 0] = *np.multiply(drag, force), -force
        loads[[0, 2], 1, 2] = -force
        touches = Touches(position=[[tops[first], tops[other]]] * 3, force=loads, radius=1e-9)
        pressed = model.press(touches, tolerance=1e-9)
        seen = np.tensordot(pressed.displacements, readings, ((1, 2), (1, 2)))
        besides = (seen[0] - seen[1] - seen[2]) / force**2
        expected = coupling[first, 2, other, 2] + coupling[first, :2, other, 2].T @ drag
        np.testing.assert_allclose(besides, expected, rtol=0.03, atol=0.01 * np.abs(expected).max())
