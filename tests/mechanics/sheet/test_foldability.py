"""How much of a press folds its cell, against the whole model of the planar sheet."""

from dataclasses import replace

import numpy as np

from smoskin.mechanics.sheet.foldability import fold_shares
from smoskin.mechanics.sheet.lattice import springs_of
from smoskin.origami.surface.analytic import Cylinder, Plane
from smoskin.origami.tessellation.tessellate import tessellate


def shares(surface, design, springs):
    made = tessellate(surface, design.cell, design.cells, refold=False)
    return fold_shares(made.sheet, made.normals, springs)


def test_rigid_columns_leave_nothing_but_folding(planar):
    springs = replace(springs_of(planar), column_axial=1e9)
    np.testing.assert_allclose(shares(Plane(), planar, springs), 1.0, atol=1e-4)


def test_a_sheet_that_is_one_rigid_plate_hardly_folds(planar):
    springs = replace(springs_of(planar), crease=1e6, panel_bending=1e6)
    share = shares(Plane(), planar, springs)
    assert abs(share.mean()) < 0.005
    assert np.abs(share).max() < 0.07  # it tilts


def test_a_press_on_a_cylinder_folds_nearly_as_much_as_on_a_plane(planar):
    springs = springs_of(planar)
    flat, bent = (shares(surface, planar, springs).mean() for surface in (Plane(), Cylinder(0.1)))
    assert 0.28 < flat < 0.30  # 29.0 % in the whole model, for vertices that slide
    assert 0.75 * flat < bent < flat
