"""Geometry of one cell against explicit 3-D panels, and against finite differences."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError
from smoskin.origami.cell import dihedral_angles, fold_angle, poisson_ratios, size
from smoskin.origami.sheet import vertex_positions

CELLS = st.builds(
    lambda a, b, alpha, share: MiuraCell(
        panel_a=a, panel_b=b, sector_angle=alpha, fold_angle=alpha * share
    ),
    a=st.floats(2e-3, 0.05),
    b=st.floats(2e-3, 0.05),
    alpha=st.floats(0.3, 1.4),
    share=st.floats(0.1, 0.97),
)


@given(cell=CELLS)
def test_panels_keep_their_edges_and_corner(cell):
    p = vertex_positions(cell, (1, 1))
    along_a, along_b = p[0, 1] - p[0, 0], p[1, 0] - p[0, 0]
    assert np.linalg.norm(along_a) == pytest.approx(cell.panel_a, rel=1e-12)
    assert np.linalg.norm(along_b) == pytest.approx(cell.panel_b, rel=1e-12)
    corner = math.acos(abs(along_a @ along_b) / cell.panel_a / cell.panel_b)
    assert corner == pytest.approx(cell.sector_angle, abs=1e-9)
    planarity = np.linalg.det([along_a, along_b, p[1, 1] - p[0, 0]])
    assert abs(planarity) < 1e-12 * cell.panel_a * cell.panel_b * cell.panel_a + 1e-22


@given(cell=CELLS)
def test_dihedrals_match_the_panels_normals(cell):
    p = vertex_positions(cell, (2, 2))

    def normal(i: int, j: int) -> np.ndarray:
        n = np.cross(p[i + 1, j] - p[i, j], p[i, j + 1] - p[i, j])
        return n / np.linalg.norm(n)

    def interior(first: np.ndarray, second: np.ndarray) -> float:
        return math.pi - 2 * math.asin(np.linalg.norm(first - second) / 2)

    at_a, at_b = dihedral_angles(cell)
    assert interior(normal(0, 0), normal(1, 0)) == pytest.approx(float(at_a), abs=1e-7)
    assert interior(normal(0, 0), normal(0, 1)) == pytest.approx(float(at_b), abs=1e-7)


@given(cell=CELLS)
def test_every_inverse_undoes_its_function(cell):
    phi = cell.fold_angle
    extent = size(cell)
    assert fold_angle(cell, length=extent.length) == pytest.approx(phi, rel=1e-9)
    assert fold_angle(cell, width=extent.width) == pytest.approx(phi, rel=1e-6)
    assert fold_angle(cell, height=extent.height) == pytest.approx(phi, rel=1e-6)


@given(cell=CELLS)
def test_poisson_ratios_are_the_ratios_of_the_sizes_changes(cell):
    step = 1e-6 * cell.fold_angle
    less, more = size(cell, cell.fold_angle - step), size(cell, cell.fold_angle + step)
    now = size(cell)
    strain = [(b - a) / c for a, b, c in zip(less, more, now, strict=True)]
    nu = poisson_ratios(cell)
    assert nu.nu_12 == pytest.approx(-strain[0] / strain[1], rel=1e-5)
    assert nu.nu_13 == pytest.approx(-strain[0] / strain[2], rel=1e-5)
    assert nu.nu_23 == pytest.approx(-strain[1] / strain[2], rel=1e-5)


def test_unit_poisson_ratios_at_60_and_45_degrees():
    cell = MiuraCell(
        panel_a=0.01, panel_b=0.01, sector_angle=math.radians(60), fold_angle=math.radians(45)
    )
    nu = poisson_ratios(cell)
    assert abs(nu.nu_13 - 1) < 1e-12
    assert abs(nu.nu_23 - 1) < 1e-12


def test_a_flat_cell_has_no_height(planar):
    assert size(planar.cell, planar.cell.sector_angle).height == pytest.approx(0, abs=1e-9)


def test_wrong_use_is_named(planar):
    with pytest.raises(ArgumentError, match=r"fold_angle must lie in \(0, alpha\]"):
        size(planar.cell, 1.2)
    with pytest.raises(ArgumentError, match="exactly one of length, width and height"):
        fold_angle(planar.cell, length=0.02, width=0.02)
    with pytest.raises(ArgumentError, match=r"height must lie in \[0, 12.29\] mm"):
        fold_angle(planar.cell, height=0.02)


def test_a_cell_folds_between_flat_on_the_board_and_closed(planar):
    """At either end of each extent there is a fold angle, a hair beyond it none."""
    cell = planar.cell
    a, b, alpha = cell.panel_a, cell.panel_b, cell.sector_angle
    ends = {
        "length": ((0.0, 0.0), (2 * b * math.sin(alpha), alpha)),
        "width": ((2 * a * math.cos(alpha), 0.0), (2 * a, alpha)),
        "height": ((0.0, alpha), (a * math.sin(alpha), 0.0)),
    }
    for name, limits in ends.items():
        for side, (extent, angle) in zip((-1, 1), limits, strict=True):
            assert fold_angle(cell, **{name: extent}) == pytest.approx(angle, abs=1e-7)
            with pytest.raises(ArgumentError, match=f"{name} must lie in"):
                fold_angle(cell, **{name: extent + side * 1e-9})
