"""Elements and stiffness of the sheet against its textbook energy; sheets that nothing holds."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import DesignError
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from textbook_sheet import angles, energy, inner_force

pytest.importorskip("jax")
from smoskin.mechanics.sheet import tangent as tangent_module
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.tangent import Tangent


def test_the_fold_angle_is_atan2_to_the_last_digits_and_smooth_through_flat():
    import jax

    from smoskin.mechanics.sheet import elements

    turn = np.concatenate([np.linspace(-3.1, 3.1, 601), [-1e-9, 0.0, 1e-9]])
    wings = np.stack([0.4 + 0 * turn, np.cos(turn), np.sin(turn)], axis=-1)
    places = np.zeros((4, len(turn), 3))
    places[1, :, 0], places[2], places[3] = 2.0, [0.7, 1.3, 0.0], wings * [1, -1, -1]
    with jax.enable_x64(True):
        arms = (places[1:] - places[0])[..., None]
        fold_angles = np.asarray(elements.fold(arms, np.zeros((4, *arms.shape[1:]))).angle)[:, 0]
    np.testing.assert_allclose(
        fold_angles, angles(np.moveaxis(places, 0, 1)), rtol=1e-14, atol=2e-15
    )
    np.testing.assert_allclose(np.abs(fold_angles), np.abs(turn), rtol=1e-9)


def test_forces_and_tangent_are_derivatives_of_the_energy(sheet, cases):
    """Taylor: the remainder falls as h^2 without the tangent, as h^3 with it."""
    lattice, tangent = sheet.lattice, sheet._equilibrium.tangent
    motion = sheet.press(cases).displacements[0]
    step = np.random.default_rng(0).normal(scale=3e-6, size=motion.shape)
    place = tangent.at(motion, np.zeros(6))
    # x' K x from the factor L of the band: |L' x|^2.
    flat = np.empty(step.size)
    flat[tangent._where] = step.ravel()
    along = np.zeros(step.size)
    for k, row in enumerate(place.factor):
        along[: step.size - k] += row[: step.size - k] * flat[k:]
    first, second = (place.blocks.pushes.sum(axis=0) * step).sum(), along @ along
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
    pushes = sheet._equilibrium.tangent.blocks(motion, np.zeros(6)).pushes.sum(axis=0)
    expected = inner_force(sheet.lattice, motion)
    np.testing.assert_allclose(pushes, expected, atol=1e-10 * np.abs(expected).max())


def test_a_band_in_blocks_gives_the_same_equilibria_as_the_whole_inverse(
    small, sheet, cases, monkeypatch
):
    monkeypatch.setattr(tangent_module, "_WHOLE", 0)
    blocks = BarHinge(small)
    tangent = Tangent(sheet.lattice, sheet.board)
    rest = tangent.rest_inverse(tangent.blocks(np.zeros_like(sheet.lattice.nodes), np.zeros(6)))
    assert len(rest.inverse) > 1
    whole, banded = (model.press(cases, tolerance=1e-10) for model in (sheet, blocks))
    scale = np.abs(whole.displacements).max()
    np.testing.assert_allclose(whole.displacements, banded.displacements, atol=1e-9 * scale)
    np.testing.assert_array_equal(whole.converged, banded.converged)
    # In as many steps, too: what they lose is followed, which would find the same.
    np.testing.assert_allclose(whole.iterations, banded.iterations, atol=1)


def test_a_sheet_that_nothing_holds_is_refused(small):
    springs = replace(springs_of(small), crease=0.0, column_lateral=0.0)
    with pytest.raises(DesignError, match="the sheet must hold its shape; some motion"):
        BarHinge(small, lattice=build_lattice(small, springs))
    # Soft columns alone are enough.
    BarHinge(small, lattice=build_lattice(small, replace(springs, column_lateral=0.1)))
