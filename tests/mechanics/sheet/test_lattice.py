"""The sheet as bars, hinges and springs: which there are, and how stiff."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from barhinge_oracle import hinge_gradient
from skins import with_magnets
from smoskin.design.materials import FILMS
from smoskin.errors import DesignError
from smoskin.mechanics.beam import beam, prop
from smoskin.mechanics.plate import (
    bending_stiffness,
    shear_stiffness,
    shifting_factor,
    twist_stiffness,
)
from smoskin.mechanics.sheet.lattice import (
    BOND_STRENGTH,
    FOLDED_RUBBER,
    Springs,
    build_lattice,
    column_beam,
    springs_of,
    swaying_stiffness,
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
    bar_lengths = lengths(lattice, lattice.bars)
    np.testing.assert_allclose(bar_lengths[edges:], short)
    assert sorted(set(bar_lengths[:edges].round(9))) == pytest.approx(sorted((a, b)), abs=1e-9)


def test_hinges_span_two_different_triangles(lattice):
    for nodes in lattice.hinges:
        assert len(set(nodes.tolist())) == 4
    diagonals = {frozenset(pair) for pair in lattice.hinges[: lattice.panel_hinges, :2].tolist()}
    bars = {frozenset(pair) for pair in lattice.bars.tolist()}
    assert diagonals < bars
    for p, q, r, s in lattice.hinges.tolist():
        assert {frozenset(side) for side in ((p, r), (q, r), (p, s), (q, s))} <= bars


def test_columns_hold_the_feet_as_the_stiffness_of_sliding_says(planar, lattice):
    supports = lattice.supports
    assert supports.lateral.sum() == pytest.approx(swaying_stiffness(planar))
    own = beam(planar.columns.radius, planar.columns.height, 25e3)
    assert column_beam(planar) == own
    np.testing.assert_allclose(supports.axial, own.axial)
    np.testing.assert_allclose(supports.height, planar.columns.height)
    assert len(set(lattice.feet.tolist())) == 91
    np.testing.assert_allclose(supports.unit * 12 / (1 + 12 * own.shear_share), own.lateral)


def test_the_frame_stops_every_rim_column_outward(planar, lattice):
    """A corner on both sides; the sway that it leaves is the clearance over the prop's lever."""
    stops = lattice.stops
    assert len(stops.nodes) == 2 * (13 + 7)
    assert len(set(stops.nodes.tolist())) == 36
    middle = lattice.nodes[lattice.feet].mean(axis=0)
    outward = (lattice.nodes[stops.nodes] - middle) * stops.normal
    assert (outward.sum(axis=1) > 0).all()
    own = column_beam(planar)
    held = prop(own.lateral, own.shear_share, 0.5)
    np.testing.assert_allclose(stops.free, planar.frame.clearance / held.lever)
    np.testing.assert_allclose(stops.stiffness, held.stiffness)
    np.testing.assert_allclose(stops.places[:, 2], -0.5 * planar.columns.height)
    assert not stops.on_base
    based = replace(planar, frame=replace(planar.frame, stands_on="base"))
    assert build_lattice(based).stops.on_base


def test_a_magnet_in_place_of_a_column_takes_it_away(planar):
    magnets = (planar.magnets[0], replace(planar.magnets[1], driver="vertex"), planar.magnets[2])
    supports = build_lattice(replace(planar, magnets=magnets)).supports
    assert (supports.lateral == 0).sum() == (supports.axial == 0).sum() == 1
    assert np.isinf(supports.buckling_load).sum() == 1


def test_sliding_plates_and_shifting_strips_soften_panels(planar):
    loose = replace(planar, panels=replace(planar.panels, bonding=0.25))
    plain = springs_of(planar).panel_bending
    assert springs_of(loose).panel_bending == pytest.approx(plain / 4)
    shifting = replace(planar, creases=replace(planar.creases, strip_shift=1.0))
    factor = shifting_factor(shifting)
    assert springs_of(shifting).panel_bending == pytest.approx(plain * factor)
    # In series with 12 D L / (3 g^3), D of the film: twice the film is eight times the strip.
    thick = replace(shifting, creases=replace(shifting.creases, thickness=50e-6))
    assert 1 / factor - 1 == pytest.approx(8 * (1 / shifting_factor(thick) - 1))
    twist = twist_stiffness(planar.cell, planar.panels)
    film = 2.5e9 * (25e-6) ** 3 / (12 * (1 - 0.34**2))
    edge = (planar.cell.panel_a + planar.cell.panel_b) / 2
    assert 1 / factor - 1 == pytest.approx(twist / (12 * film * edge / (3 * 1.2e-3**3)))


def test_a_panel_pulled_along_its_edges_is_as_stiff_as_its_plate(planar, lattice):
    """Two edges of half the plate each: E t A / L^2 together, of a panel with no neighbours."""
    single = build_lattice(with_magnets(planar, [(0, 0)], (1, 1)))
    panel = planar.panels
    membrane = FILMS[panel.material].young_modulus * panel.thickness
    area = planar.cell.panel_a * planar.cell.panel_b * math.sin(planar.cell.sector_angle)
    extent = lengths(single, single.bars)
    edges = len(single.bars) - single.panel_hinges
    # Every edge of the 1 x 1 sheet has one panel beside it or two.
    beside = single.bar_stiffness[:edges] / (membrane * area / (2 * extent[:edges] ** 2))
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
    start, end, left, right = lattice.hinges[0]
    points = lattice.nodes[[start, end, left, right]]
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
    parts = {
        "bar_stiffness": lambda built: built.bar_stiffness,
        "hinge_stiffness": lambda built: built.hinge_stiffness,
        "lateral": lambda built: built.supports.lateral,
        "axial": lambda built: built.supports.axial,
        "stops": lambda built: built.stops.stiffness,
    }
    touched = {
        "column_lateral": {"lateral"},
        "column_axial": {"axial"},
        "stop": {"stops"},
        "crease": {"hinge_stiffness"},
        "panel_bending": {"hinge_stiffness"},
        "panel_membrane": {"bar_stiffness"},
    }
    assert {spring.name for spring in fields(Springs)} == set(touched)
    change = {name: np.zeros_like(part(lattice)) for name, part in parts.items()}
    for name, expected in touched.items():
        doubled = build_lattice(planar, replace(springs, **{name: 2 * getattr(springs, name)}))
        differs = {p for p, part in parts.items() if np.any(part(doubled) != part(lattice))}
        assert differs == expected
        for p, part in parts.items():
            change[p] += part(doubled) - part(lattice)
    for p, part in parts.items():
        np.testing.assert_allclose(change[p], part(lattice), rtol=1e-9)


def test_bonds_hold_their_strength_over_the_columns_section(planar, lattice):
    assert lattice.bond_limit == pytest.approx(BOND_STRENGTH * math.pi * planar.columns.radius**2)


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_springs_that_cannot_be_are_refused(planar, value):
    springs = springs_of(planar)
    for name in ("column_lateral", "column_axial", "stop", "crease", "panel_bending"):
        assert getattr(replace(springs, **{name: 0.0}), name) == 0.0
        with pytest.raises(DesignError, match=rf"springs\.{name} must be finite and >= 0; got"):
            replace(springs, **{name: value})


def test_holes_take_their_share_of_creases_and_panels(planar):
    """A panel inside loses one disc of its area, one at the sheet's corner a quarter of it."""
    hole = 1e-3
    holed = replace(planar, creases=replace(planar.creases, vertex_hole=hole))
    before, after = build_lattice(planar), build_lattice(holed)
    panels = before.panel_hinges
    lost = 1 - (after.hinge_stiffness / before.hinge_stiffness)
    a, b = planar.cell.panel_a, planar.cell.panel_b
    disc = math.pi * hole**2 / (a * b * math.sin(planar.cell.sector_angle))
    assert set((lost[:panels] / disc).round(9)) == {1.0, 0.5, 0.25}
    length = lengths(before, before.hinges[panels:, :2])
    assert set((lost[panels:] * length / hole).round(9)) == {1.0, 2.0}


def test_rubber_on_vertices_resists_two_folds_in_full(planar):
    """Half of a fold's moment at each crease's end: four ends at a column or a scale's patch."""
    creases = replace(planar.creases, vertex_rubber=0.5)
    before, after = build_lattice(planar), build_lattice(replace(planar, creases=creases))
    more = after.hinge_stiffness - before.hinge_stiffness
    assert not more[: before.panel_hinges].any()
    ends = before.hinges[before.panel_hinges :, :2]
    column, patch = 0.5 * FOLDED_RUBBER * 25e3 * 3.5e-3**3, 0.5 * FOLDED_RUBBER * 25e3 * 2e-3**3
    kinds = np.zeros(len(before.nodes))
    kinds[before.feet], kinds[before.loaded.ravel()] = column, patch
    np.testing.assert_allclose(more[before.panel_hinges :], kinds[ends].sum(axis=1) / 2, rtol=1e-9)
    four = np.bincount(ends.ravel(), minlength=len(kinds))[before.loaded.ravel()]
    assert (four == 4).all()


def test_finite_elements_of_rubber_across_a_fold():
    """Bonded on a fold that opens, its foot held, its height free: 0.35 G r^3 a radian."""
    felupe = pytest.importorskip("felupe")
    ratio = 3.0
    mesh = felupe.Circle(n=4, radius=1.0).expand(n=13, z=ratio)
    mesh.points[:, 2] = ratio * (1 - (1 - mesh.points[:, 2] / ratio) ** 1.5)  # finer at the top
    field = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(mesh), dim=3)])
    rubber = felupe.SolidBodyNearlyIncompressible(felupe.NeoHooke(mu=1.0), field, bulk=500.0)
    whole = rubber.assemble.matrix().tocsc()
    top = np.isclose(mesh.points[:, 2], ratio)
    held = np.repeat(top | np.isclose(mesh.points[:, 2], 0.0), 3)
    moved = np.zeros((mesh.npoints, 3, 2))
    moved[top, 2] = np.stack([np.abs(mesh.points[top, 1]) / 2, np.ones(top.sum())], axis=-1)
    shape = moved.reshape(-1, 2)
    shape[~held] = splu(whole[~held][:, ~held]).solve(-whole[~held][:, held] @ shape[held])
    (fold, both), (_, sink) = shape.T @ (whole @ shape)
    assert fold - both**2 / sink == pytest.approx(FOLDED_RUBBER, rel=0.02)


def test_rim_columns_free_over_a_share_of_their_height_are_beams_of_it(planar):
    """Below is their own foot; the frame meets them as high as before."""
    short = replace(planar, columns=replace(planar.columns, rim_share=0.8))
    lattice, usual = build_lattice(short), build_lattice(planar)
    made, rim = lattice.supports, np.isin(lattice.feet, lattice.stops.nodes)
    own = beam(3.5e-3, 0.8 * 13e-3, 25e3)
    for name, value in (
        ("lateral", own.lateral),
        ("axial", own.axial),
        ("height", 0.8 * 13e-3),
        ("shear_share", own.shear_share),
    ):
        np.testing.assert_allclose(getattr(made, name)[rim], value)
        np.testing.assert_array_equal(
            getattr(made, name)[~rim], getattr(usual.supports, name)[~rim]
        )
    assert made.lateral.sum() == pytest.approx(swaying_stiffness(short))
    held = prop(own.lateral, own.shear_share, (6.5 - 0.2 * 13) / (0.8 * 13))
    np.testing.assert_allclose(lattice.stops.free, planar.frame.clearance / held.lever)
    np.testing.assert_allclose(lattice.stops.stiffness, held.stiffness)
    np.testing.assert_array_equal(lattice.stops.places, usual.stops.places)
