"""The paper's energies: their derivatives, and sheets that need none."""

import numpy as np
import pytest

from smoskin.origami.cell import size
from smoskin.origami.surface.analytic import Cylinder, Plane, Sphere
from smoskin.origami.surface.surface import forms
from smoskin.origami.tessellation.arc import arc_sheet
from smoskin.origami.tessellation.attachment import Energy, attach, attached_sheet


def test_derivatives_of_the_energy_are_its_differences(planar):
    energy = Energy(Sphere(0.1), planar.cell, (2, 3))
    rng = np.random.default_rng(0)
    nodes = energy.lattice.ravel() / 0.02
    at = np.concatenate([nodes + 0.05 * rng.normal(size=nodes.size), 0.05 * rng.normal(size=24)])
    way = rng.normal(size=at.size)
    way.reshape(-1)[[34, 35, 49]] = 0.0  # what is held: the middle and its row's direction
    after, before = (energy.value(at + s * 1e-6 * way, 0.02)[0] for s in (1, -1))
    _, slopes = energy.value(at, 0.02)
    np.testing.assert_allclose(slopes @ way, (after - before) / 2e-6, rtol=1e-6)


@pytest.mark.parametrize("surface", [Plane(), Cylinder(0.1)])
def test_surfaces_without_stretch_take_the_lattice_as_it_is(planar, surface):
    attached = attach(surface, planar.cell, (2, 3))
    lattice = Energy(surface, planar.cell, (2, 3)).lattice
    np.testing.assert_allclose(attached.parameters, lattice, atol=4e-5)
    np.testing.assert_allclose(attached.folds, planar.cell.fold_angle, atol=4e-3)


def test_on_a_sphere_the_rim_opens_less_than_the_middle_along_its_own_way(planar):
    attached = attach(Sphere(0.133), planar.cell, (6, 6))
    start = Energy(Sphere(0.133), planar.cell, (6, 6)).value
    assert (
        attached.energy
        < start(
            np.r_[Energy(Sphere(0.133), planar.cell, (6, 6)).lattice.ravel() / 0.02, np.zeros(144)],
            0.02,
        )[0]
        / 144
        / 5
    )
    np.testing.assert_allclose(attached.folds.mean(), planar.cell.fold_angle, atol=1e-12)
    assert np.ptp(attached.folds) > np.radians(2)
    # Lengths come out as asked, where the chart alone would shrink them by a tenth.
    at = forms(Sphere(0.133), attached.parameters).places
    rows = np.linalg.norm(np.diff(at, axis=0), axis=-1)
    np.testing.assert_allclose(rows.mean(), size(planar.cell).length / 2, rtol=0.02)


def test_a_lattice_without_stretch_gives_the_closed_form(planar):
    attached = attach(Plane(), planar.cell, (2, 3))
    parameters, heights = arc_sheet(planar.cell, (2, 3), np.inf)
    across = np.arange(-3, 4) * float(size(planar.cell).width) / 2
    mine = attached_sheet(attached, planar.cell, parameters[..., 1] - across)
    np.testing.assert_allclose(mine[0], parameters, atol=1e-4)
    np.testing.assert_allclose(mine[1], heights, atol=1e-4)
