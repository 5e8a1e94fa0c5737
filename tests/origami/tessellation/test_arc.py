"""The closed form on cylinders, against its own panels and the planar sheet."""

from math import inf

import numpy as np
import pytest

from smoskin.errors import DesignError
from smoskin.origami.sheet import build_sheet, vertex_positions
from smoskin.origami.surface.analytic import Cylinder, Plane
from smoskin.origami.tessellation.arc import arc_sheet, zigzag_angles
from smoskin.origami.tessellation.conditions import net_of, sector_angles, warps
from smoskin.origami.tessellation.solve import places

CELLS = (6, 6)


def lying(cell, radius, cells=CELLS):
    """Vertices of the sheet on a cylinder, (V, 3); those of a negative radius lie inside."""
    parameters, heights = arc_sheet(cell, cells, radius)
    layers = np.column_stack([parameters.reshape(-1, 2), heights.ravel()])
    if np.isinf(radius):
        return places(Plane(), layers)
    if radius > 0:
        return places(Cylinder(radius), layers)
    x, y, z = layers.T  # inside: the axis lies above
    turn, reach = y / -radius, -radius - z
    return np.column_stack([x, reach * np.sin(turn), -radius - reach * np.cos(turn)])


@pytest.mark.parametrize("radius", [1e4, 10.0, 0.267, 0.1, 0.0534, 0.03, -0.3, -0.1])
def test_panels_are_plane_and_the_sheet_unfolds_and_folds_flat(planar, radius):
    vertices = lying(planar.cell, radius)
    net = net_of(build_sheet(planar.cell, CELLS).facets)
    angles = sector_angles(net, vertices)
    assert np.abs(warps(net, vertices)).max() < 1e-14
    assert np.abs(net.around @ angles - 2 * np.pi).max() < 1e-13
    assert np.abs(net.opposite @ angles - np.pi).max() < 1e-13


def test_a_plane_has_the_regular_sheet(planar):
    regular = vertex_positions(planar.cell, CELLS).reshape(-1, 3)
    off = lying(planar.cell, inf) - regular
    np.testing.assert_allclose(off, np.broadcast_to(off[0], off.shape), atol=1e-16)
    assert off[0, 2] == 0.0


def test_the_difference_from_a_plane_falls_as_the_curvature(planar):
    flat = lying(planar.cell, inf)
    off = [np.abs(lying(planar.cell, radius) - flat).max() for radius in (10.0, 100.0, 1000.0)]
    slopes = np.diff(np.log10(off))
    np.testing.assert_allclose(slopes, -1.0, atol=0.05)


def test_the_sheet_is_the_same_all_along_the_axis(planar):
    grid = lying(planar.cell, 0.08).reshape(13, 13, 3)
    step = grid[2:] - grid[:-2]
    np.testing.assert_allclose(step, np.broadcast_to(step[0, 0], step.shape), atol=1e-16)
    np.testing.assert_allclose(step[0, 0, 1:], 0.0, atol=1e-16)


def test_bottom_vertices_lie_on_the_cylinder_and_top_ones_a_height_above(planar):
    grid = lying(planar.cell, 0.08).reshape(13, 13, 3)
    reach = np.hypot(grid[..., 1], grid[..., 2] + 0.08)
    np.testing.assert_allclose(reach[:, ::2], 0.08, atol=1e-16)
    np.testing.assert_allclose(reach[:, 1::2], 0.08 + 7.969286e-3, atol=1e-8)


def test_zigzags_satisfy_the_printed_equation(planar):
    bottom, top = zigzag_angles(planar.cell, 0.06)
    ratio, half = 1 + 7.969285658e-3 / 0.06, 26.6666085e-3 / 0.12
    left = ratio**2 * np.sin(top) - 2 * ratio * np.cos(half) * np.sin((bottom + top) / 2)
    assert abs(left + np.sin(bottom)) < 1e-9
    assert 0 < top < bottom


def test_a_cylinder_that_a_cell_cannot_follow_is_refused(planar):
    with pytest.raises(DesignError, match="cannot follow a cylinder of radius 5 mm; take smaller"):
        zigzag_angles(planar.cell, 0.005)
