"""Crease energies against explicit meshes, crease by crease."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paper.models.finite_press import crease_response, exact_change
from paper.models.fold_energies import (
    DihedralChanges,
    Split,
    crease_product,
    dihedral_rates,
    fading_folds,
    inner_product,
    relative_crease_stiffness_map,
)
from paper.models.stiffness_terms import stiffness_terms
from smoskin.design.skin import Creases
from smoskin.errors import DesignError
from smoskin.mechanics.plate import crease_stiffness
from smoskin.mechanics.reduced.stiffness import column_stiffness
from smoskin.origami.cell import dihedral_angles, fold_angle, size
from smoskin.origami.sheet import build_sheet, vertex_positions

FOLDS = ("length", "width", "mean")
FADES = st.tuples(st.floats(0.1, 1.0), st.floats(0.1, 1.0))


def resized(planar, cells):
    magnets = tuple(replace(magnet, corner=(0, 0)) for magnet in planar.magnets)
    return replace(planar, cells=cells, magnets=magnets)


def dihedrals(cell, phi):
    """At an a- and a b-crease, from the normals of explicit panels."""
    p = vertex_positions(replace(cell, fold_angle=phi), (1, 1))

    def normal(i, j):
        return np.cross(p[i + 1, j] - p[i, j], p[i, j + 1] - p[i, j])

    def interior(first, second):
        return math.pi - math.atan2(np.linalg.norm(np.cross(first, second)), first @ second)

    at_a, at_b = interior(normal(0, 0), normal(1, 0)), interior(normal(0, 0), normal(0, 1))
    return np.array([at_a, at_b])


def cell_changes(cell, cells, v, press, loaded, fold_from):
    """Dihedral changes of every cell, (N, M, 2), each from its own size (S10)."""
    change, extent = exact_change(cell, press), size(cell)
    rest, out = dihedrals(cell, cell.fold_angle), np.zeros((*cells, 2))
    weights = {"length": (1, 0), "width": (0, 1), "mean": (0.5, 0.5)}[fold_from]
    for n, m in np.ndindex(*cells):
        dl = change.dl * v[0] ** abs(n - loaded[0])
        dw = change.dw * v[1] ** abs(m - loaded[1])
        by_length = dihedrals(cell, float(fold_angle(cell, length=extent.length + dl))) - rest
        by_width = dihedrals(cell, float(fold_angle(cell, width=extent.width + dw))) - rest
        out[n, m] = weights[0] * by_length + weights[1] * by_width
    return out


def explicit_energy(cell, cells, v, press, loaded, fold_from):
    """Of creases of 1 N: each crease of the mesh turns as its two panels' cells do on average."""
    sheet = build_sheet(cell, cells)
    changes = cell_changes(cell, cells, v, press, loaded, fold_from)
    panels_at = {}
    for f, corners in enumerate(sheet.facets):
        i, j = divmod(f, 2 * cells[1])
        for start, end in zip(corners, np.roll(corners, 1), strict=True):
            panels_at.setdefault(frozenset((start, end)), []).append((i // 2, j // 2))
    energy = 0.0
    for ends, along_a in zip(sheet.creases, sheet.along_a, strict=True):
        owners = panels_at[frozenset(ends)]
        turn = np.mean([changes[owner][0 if along_a else 1] for owner in owners])
        length = np.linalg.norm(sheet.vertices[ends[1]] - sheet.vertices[ends[0]])
        energy += 0.5 * length * turn**2
    return float(energy)


@pytest.mark.parametrize("fold_from", FOLDS)
@pytest.mark.parametrize(
    ("cells", "v"), [((3, 2), (0.3, 0.7)), ((1, 3), (1, 0.4)), ((2, 1), (1, 1))]
)
def test_energy_of_every_crease_of_the_mesh(planar, fold_from, cells, v):
    skin, k = resized(planar, cells), crease_stiffness(planar.creases)
    deep = crease_response(skin, v, -1.1e-3, fold_from=fold_from)
    for load in np.ndindex(*cells):
        energy = explicit_energy(planar.cell, cells, v, -1.1e-3, load, fold_from)
        assert deep.energy[load] == pytest.approx(k * energy, rel=1e-9)


@pytest.mark.parametrize("fold_from", FOLDS)
def test_stiffness_is_the_second_derivative_of_the_explicit_energy(planar, fold_from):
    cells, v, step = (3, 2), (0.4, 0.6), 2e-6
    stiffness = relative_crease_stiffness_map(planar.cell, cells, v, fold_from=fold_from)
    for load in np.ndindex(*cells):
        less, more = (
            explicit_energy(planar.cell, cells, v, s, load, fold_from) for s in (-step, step)
        )
        assert stiffness[load] == pytest.approx((less + more) / step**2, rel=1e-5)


@given(press=st.floats(-3e-3, 2e-3), v=FADES, fold_from=st.sampled_from(FOLDS))
def test_force_and_tangent_are_the_energys_derivatives(
    planar, assert_derivatives, press, v, fold_from
):
    assert_derivatives(lambda dh: crease_response(planar, v, dh, fold_from=fold_from), press)


@pytest.mark.parametrize("count", ["each_once", "printed"])
def test_at_rest_the_exact_response_is_the_linear_one(planar, count):
    v, k = planar.coefficients.attenuation, crease_stiffness(planar.creases)
    linear = k * relative_crease_stiffness_map(planar.cell, planar.cells, v, count=count)
    rest = crease_response(planar, v, 0.0, count=count)
    np.testing.assert_allclose(rest.stiffness, linear, rtol=1e-12)
    first = crease_response(planar, v, -1e-3, count=count, kinematics="first_order")
    np.testing.assert_allclose(first.energy, linear * 1e-6 / 2, rtol=1e-12)
    np.testing.assert_allclose(first.force, linear * 1e-3, rtol=1e-12)


def uniform(cells, at_a, at_b):
    """Every cell turned alike, whichever is loaded."""
    flat = [np.ones((count, count)) for count in cells]
    whole = Split(flat[0], 0 * flat[1])
    return DihedralChanges(at_a=whole.scaled(at_a), at_b=whole.scaled(at_b))


@pytest.mark.parametrize("cells", [(6, 6), (1, 1), (4, 2)])
def test_crease_counts(planar, cells):
    """What is printed counts N M + (N - 1)(M - 1) fours, each at twice its energy."""
    (n, m), a = cells, planar.cell.panel_a
    turned = uniform(cells, 1.0, 0.0)
    once = crease_product(planar.cell, turned, turned, "each_once")
    printed = crease_product(planar.cell, turned, turned, "printed")
    np.testing.assert_allclose(once / a, 2 * n * m + 2 * (n - 1) * m)
    np.testing.assert_allclose(printed / a, 2 * (2 * n * m + 2 * (n - 1) * (m - 1)))
    assert build_sheet(planar.cell, cells).along_a.sum() == 2 * n * m + 2 * (n - 1) * m


def test_printed_count_misses_ten_creases_of_each_kind_on_six_by_six(planar):
    turned = uniform((6, 6), 1.0, 0.0)
    counts = [
        crease_product(planar.cell, turned, turned, count)[0, 0] / planar.cell.panel_a
        for count in ("each_once", "printed")
    ]
    assert counts == pytest.approx([132, 2 * 122])


def test_four_creases_hold_half_of_the_printed_energy(planar):
    """One free cell: its four creases, 1/2 k L dphi^2 each, against S16."""
    skin, press, k = resized(planar, (1, 1)), -1e-3, crease_stiffness(planar.creases)
    turns = cell_changes(planar.cell, (1, 1), (1, 1), press, (0, 0), "length")[0, 0]
    a, b = planar.cell.panel_a, planar.cell.panel_b
    springs = sum(
        0.5 * k * length * turn**2
        for length, turn in zip((a, a, b, b), turns.repeat(2), strict=True)
    )
    assert crease_response(skin, (1, 1), press).energy.item() == pytest.approx(springs, rel=1e-9)
    printed = 2 * k * a * turns[0] ** 2 + 2 * k * b * turns[1] ** 2
    assert printed == pytest.approx(2 * springs)
    assert crease_response(skin, (1, 1), press, count="printed").energy.item() == pytest.approx(
        printed, rel=1e-9
    )


def test_a_crease_is_a_bent_strip_of_film(planar):
    """Bent evenly by an angle over its gap: E t^3 / 24 of curvature squared per area."""
    film, turn = planar.creases, 0.2
    curvature = turn / film.gap
    energy = 2.5e9 * film.thickness**3 / 24 * curvature**2 * film.gap
    assert 0.5 * crease_stiffness(film) * turn**2 == pytest.approx(energy)
    assert crease_stiffness(film) == pytest.approx(0.0027, abs=5e-5)


def test_the_reference_creases_hold_a_hundredth_of_what_the_columns_do(planar):
    """As the SI has it; film twice as thick on slender columns would count."""
    terms = stiffness_terms(planar, planar.coefficients.attenuation)
    ratio = terms.creases / terms.columns
    assert 0.007 < ratio.min() < ratio.max() < 0.011
    slender = replace(planar, columns=replace(planar.columns, radius=1.75e-3))
    assert column_stiffness(planar) == pytest.approx(4 * column_stiffness(slender))
    thick = replace(slender, creases=replace(planar.creases, thickness=50e-6))
    ratio = stiffness_terms(thick, planar.coefficients.attenuation)
    assert (ratio.creases / ratio.columns).min() > 0.2


@given(v=FADES, n=st.integers(1, 5), m=st.integers(1, 5), fold_from=st.sampled_from(FOLDS))
def test_maps_are_positive_and_symmetric(planar, v, n, m, fold_from):
    stiffness = relative_crease_stiffness_map(planar.cell, (n, m), v, fold_from=fold_from)
    assert np.all(stiffness > 0)
    np.testing.assert_allclose(stiffness, stiffness[::-1], rtol=1e-12)
    np.testing.assert_allclose(stiffness, stiffness[:, ::-1], rtol=1e-12)


@given(thickness=st.floats(10e-6, 200e-6), gap=st.floats(0.2e-3, 3e-3), more=st.floats(1.01, 3.0))
def test_thicker_film_and_narrower_gaps_are_stiffer(thickness, gap, more):
    film = Creases(thickness=thickness, gap=gap, material="polyimide")
    assert crease_stiffness(replace(film, thickness=more * thickness)) == pytest.approx(
        more**3 * crease_stiffness(film)
    )
    assert crease_stiffness(replace(film, gap=more * gap)) < crease_stiffness(film)


@given(v=FADES, fold_from=st.sampled_from(FOLDS))
def test_split_sums_are_those_of_the_grid(v, fold_from):
    first, second = fading_folds((3, 4), v, fold_from), fading_folds((3, 4), v[::-1], "mean")
    product = inner_product(first, second)
    for n, m in np.ndindex(3, 4):
        grids = [part.along[n][:, None] + part.across[m][None, :] for part in (first, second)]
        assert product[n, m] == pytest.approx((grids[0] * grids[1]).sum())
        assert grids[1][n, m] == pytest.approx(1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gap": 0.0}, "creases.gap must be positive and finite; got 0.0"),
        ({"material": "paper"}, "creases.material must be one of acrylic, polyimide; got 'paper'"),
    ],
)
def test_wrong_creases_are_named(planar, change, message):
    with pytest.raises(DesignError, match=message):
        replace(planar.creases, **change)


@given(share=st.floats(0.1, 0.97), alpha=st.floats(0.3, 1.4))
def test_dihedral_rates_by_finite_differences(planar, share, alpha):
    cell = replace(planar.cell, sector_angle=alpha, fold_angle=alpha * share)
    h = float(size(cell).height)
    step = 1e-6 * h
    angles = [dihedral_angles(cell, fold_angle(cell, height=h + s)) for s in (-step, step)]
    for rate, less, more in zip(dihedral_rates(cell), *angles, strict=True):
        assert rate == pytest.approx((more - less) / (2 * step), rel=1e-4)
