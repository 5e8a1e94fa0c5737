"""The sheet as bars, hinges and springs: which there are, and how stiff."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from barhinge_oracle import hinge_gradient
from skins import with_magnets
from smoskin.design.materials import FILMS
from smoskin.errors import DesignError
from smoskin.mechanics.reduced.stiffness import column_stiffness, sheet_stiffness
from smoskin.mechanics.sheet.lattice import (
    BOND_STRENGTH,
    Springs,
    axial_stiffness,
    bending_stiffness,
    build_lattice,
    shear_stiffness,
    springs_of,
    twist_stiffness,
)


@pytest.fixture(scope="module")
def lattice(planar):
    return build_lattice(planar)


def lengths(lattice, pairs):
    ends = lattice.nodes[pairs]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def test_a_panel_is_edges_a_diagonal_and_a_hinge(planar, lattice):
    n, m = planar.cells
    edges = 2 * n * (2 * m + 1) + 2 * m * (2 * n + 1)
    panels, creases = 4 * n * m, 2 * (2 * n - 1) * m + 2 * n * (2 * m - 1)
    assert len(lattice.bars) == len({frozenset(pair) for pair in lattice.bars.tolist()})
    assert len(lattice.bars) == edges + panels
    assert lattice.panel_hinges == panels
    assert len(lattice.hinges) == panels + creases
    a, b = planar.cell.panel_a, planar.cell.panel_b
    short = math.sqrt(a**2 + b**2 - 2 * a * b * math.cos(planar.cell.sector_angle))
    found = lengths(lattice, lattice.bars)
    np.testing.assert_allclose(found[edges:], short)
    assert sorted(set(found[:edges].round(9))) == pytest.approx(sorted((a, b)), abs=1e-9)


def test_hinges_span_two_different_triangles(lattice):
    for nodes in lattice.hinges:
        assert len(set(nodes.tolist())) == 4
    diagonals = {frozenset(pair) for pair in lattice.hinges[: lattice.panel_hinges, :2].tolist()}
    bars = {frozenset(pair) for pair in lattice.bars.tolist()}
    assert diagonals < bars
    for p, q, r, s in lattice.hinges.tolist():
        assert {frozenset(side) for side in ((p, r), (q, r), (p, s), (q, s))} <= bars


def test_the_ground_holds_the_feet_as_the_stiffness_of_sliding_says(planar, lattice):
    total = lattice.ground.sum(axis=0)
    np.testing.assert_allclose(total[:2], sheet_stiffness(planar))
    assert total[2] == pytest.approx(lattice.feet.size * axial_stiffness(planar.columns))
    assert np.flatnonzero(lattice.ground.any(axis=1)).tolist() == lattice.feet.tolist()
    assert lattice.frame.sum() == pytest.approx(36 * planar.frame.stiffness)
    columns = lattice.ground[lattice.feet, 0] - lattice.frame[lattice.feet]
    np.testing.assert_allclose(columns, column_stiffness(planar))


def test_a_column_is_three_times_as_stiff_along_its_axis(planar):
    """E = 3 G of a rubber; a squat cylinder between bonded faces holds more."""
    slim = replace(planar.columns, radius=1e-4)
    flat = replace(planar.columns, radius=20e-3, height=10e-3)
    shear = {}
    for columns in (slim, flat):
        shear[columns] = column_stiffness(replace(planar, columns=columns))
    assert axial_stiffness(slim) == pytest.approx(3 * shear[slim], rel=1e-4)
    assert axial_stiffness(flat) == pytest.approx(3 * (1 + 2 * 1.0**2) * shear[flat])


def test_a_panel_pulled_along_its_edges_is_as_stiff_as_its_plate(planar, lattice):
    """Two edges of half the plate each: E t A / L^2 together, of a panel with no neighbours."""
    one = build_lattice(with_magnets(planar, [(0, 0)], (1, 1)))
    panel = planar.panels
    membrane = FILMS[panel.material].young_modulus * panel.thickness
    area = planar.cell.panel_a * planar.cell.panel_b * math.sin(planar.cell.sector_angle)
    extent = lengths(one, one.bars)
    edges = len(one.bars) - one.panel_hinges
    # Every edge of the 1 x 1 sheet has one panel beside it or two.
    beside = one.bar_stiffness[:edges] / (membrane * area / (2 * extent[:edges] ** 2))
    assert set(beside.round(9)) == {1.0, 2.0}
    assert beside.sum() == pytest.approx(4 * 4)


def test_the_diagonal_holds_what_shearing_the_plate_costs(planar, lattice):
    """Edges keep their lengths while the corner opens; the diagonal's growth by differences."""
    a, b, step = planar.cell.panel_a, planar.cell.panel_b, 1e-6

    def diagonal(corner):
        return math.sqrt(a**2 + b**2 - 2 * a * b * math.cos(corner))

    alpha = planar.cell.sector_angle
    rate = (diagonal(alpha + step) - diagonal(alpha - step)) / (2 * step)
    stiffness = lattice.bar_stiffness[-1] * rate**2
    assert stiffness == pytest.approx(shear_stiffness(planar.cell, planar.panels), rel=1e-6)


def test_the_panels_hinge_holds_what_warping_the_plate_costs(planar, lattice):
    """A corner that leaves the plane of the others by d turns the hinge; by its exact gradient."""
    start, end, one, other = lattice.hinges[0]
    points = lattice.nodes[[start, end, one, other]]
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    turn = hinge_gradient(points)[2] @ (normal / np.linalg.norm(normal))
    stiffness = lattice.hinge_stiffness[0] * turn**2
    assert stiffness == pytest.approx(twist_stiffness(planar.cell, planar.panels), rel=1e-9)
    assert lattice.hinge_stiffness[0] == bending_stiffness(planar.cell, planar.panels)


def test_creases_are_as_stiff_as_they_are_long(planar, lattice):
    creases = lattice.hinges[lattice.panel_hinges :, :2]
    per_length = lattice.hinge_stiffness[lattice.panel_hinges :] / lengths(lattice, creases)
    np.testing.assert_allclose(per_length, springs_of(planar).crease)


def test_springs_scale_their_own_elements(planar, lattice):
    """Twice a spring is twice the elements it names, and none else."""
    springs = springs_of(planar)
    parts = ("bar_stiffness", "hinge_stiffness", "ground")
    touched = {
        "column_shear": {"ground"},
        "column_axial": {"ground"},
        "frame": {"ground"},
        "crease": {"hinge_stiffness"},
        "panel_bending": {"hinge_stiffness"},
        "panel_membrane": {"bar_stiffness"},
    }
    assert {one.name for one in fields(Springs)} == set(touched)
    change = {part: np.zeros_like(getattr(lattice, part)) for part in parts}
    for name, expected in touched.items():
        doubled = build_lattice(planar, replace(springs, **{name: 2 * getattr(springs, name)}))
        differs = {p for p in parts if np.any(getattr(doubled, p) != getattr(lattice, p))}
        assert differs == expected
        for part in parts:
            change[part] += getattr(doubled, part) - getattr(lattice, part)
    for part in parts:
        np.testing.assert_allclose(change[part], getattr(lattice, part), rtol=1e-9)


def test_bonds_hold_their_strength_over_the_columns_section(planar, lattice):
    assert lattice.bond_limit == pytest.approx(BOND_STRENGTH * math.pi * 1.5e-3**2)
    assert lattice.stroke == planar.columns.height


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_springs_that_cannot_be_are_refused(planar, value):
    springs = springs_of(planar)
    for name in ("column_shear", "column_axial", "frame", "crease", "panel_bending"):
        assert getattr(replace(springs, **{name: 0.0}), name) == 0.0
        with pytest.raises(DesignError, match=rf"springs\.{name} must be finite and >= 0; got"):
            replace(springs, **{name: value})
