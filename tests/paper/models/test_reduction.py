"""The reduced model fitted to presses: round trips, and the whole sheet's rigid limit."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from paper.models.reduction import (
    LEAST_ATTENUATION,
    UnitPresses,
    cells_named,
    fit_columns,
    fit_magnets,
    fit_stiffness,
    signs_agree,
    unit_presses,
)
from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.reduced.attenuation import (
    column_displacements,
    magnet_displacements,
    profiles,
)
from smoskin.mechanics.reduced.stiffness import column_stiffness, relative_stiffness_map
from smoskin.mechanics.sheet.lattice import build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Covered, Sticking
from smoskin.origami.geometry import geometry

ATTENUATIONS = st.tuples(st.floats(0.02, 0.99), st.floats(0.02, 0.99))


def reduced_presses(design, attenuation, *, scale=1.0, sink=0.0, variation=1.0):
    """Presses of a sheet that is the reduced model; its columns all sink alike."""
    n, m = design.cells
    parts = profiles(design.cell, design.cells, attenuation, -1.0)
    columns = np.full((n, m, 2 * n + 1, m + 1, 3), -sink)
    for loaded in np.ndindex(n, m):
        columns[loaded][..., :2] = scale * column_displacements(parts, loaded)
    magnets = np.zeros((n, m, len(design.magnets), 6))
    for g, magnet in enumerate(design.magnets):
        if magnet.mount == "sheet":
            magnets[:, :, g, :2] = scale * magnet_displacements(parts, magnet.corner)
    relative = relative_stiffness_map(design.cell, design.cells, attenuation)
    return UnitPresses(
        design=design,
        columns=columns,
        magnets=magnets,
        stiffness=variation * column_stiffness(design) * relative,
    )


@settings(max_examples=8)
@given(attenuation=ATTENUATIONS, scale=st.floats(0.05, 1.5))
def test_fits_find_the_model_that_made_the_presses(planar, attenuation, scale):
    presses = reduced_presses(planar, attenuation, scale=scale)
    for fit in (fit_columns, fit_magnets):
        fitted = fit(presses)
        assert_allclose(fitted.attenuation, attenuation, rtol=1e-5, atol=1e-6)
        assert_allclose(fitted.scale, scale, rtol=1e-5)
        assert fitted.residual < 1e-6
        assert_allclose(fitted.cell_residual, 0.0, atol=1e-5)
    assert signs_agree(presses).all()


@settings(max_examples=8)
@given(attenuation=st.floats(0.05, 0.95), variation=st.floats(0.3, 3.0))
def test_stiffness_of_three_cells_gives_both_coefficients(planar, attenuation, variation):
    presses = reduced_presses(planar, (attenuation, attenuation), variation=variation)
    fitted = fit_stiffness(presses)
    assert_allclose(fitted.attenuation, attenuation, atol=1e-3)
    assert_allclose(fitted.scale, variation, rtol=5e-3)
    assert fitted.residual < 2e-3


def test_a_scale_that_is_held_is_kept(planar):
    presses = reduced_presses(planar, (0.4, 0.6), scale=0.25)
    held = fit_columns(presses, scale=1.0)
    assert held.scale == 1.0
    assert held.residual > 0.5
    assert min(held.attenuation) == pytest.approx(LEAST_ATTENUATION, abs=1e-3)


def test_residual_is_what_no_attenuation_can_explain(planar):
    presses = reduced_presses(planar, (0.5, 0.5))
    moved = presses.columns.copy()
    # Over one column, motion to and fro leaves every mean as it was.
    moved[2, 2, 6, 3, 0] += 2.0
    whole = np.linalg.norm(presses.columns[2, 2, ..., :2])
    fitted = fit_columns(replace(presses, columns=moved))
    assert fitted.cell_residual[2, 2] == pytest.approx(2 / np.hypot(whole, 2), rel=0.1)
    assert fitted.cell_residual.argmax() == 2 * planar.cells[1] + 2


def test_folding_is_what_is_left_of_the_sink(planar):
    presses = reduced_presses(planar, (0.5, 0.5), sink=0.3)
    assert_allclose(presses.folding, 0.7, rtol=1e-12)


def test_a_magnet_that_moves_the_other_way_disagrees_there(planar):
    presses = reduced_presses(planar, (0.5, 0.5))
    magnets = presses.magnets.copy()
    magnets[3, 1, 2, 1] *= -1
    agree = signs_agree(replace(presses, magnets=magnets))
    assert np.argwhere(~agree).tolist() == [[3, 1, 1, 1]]


def test_other_layouts_fit_as_well(long_planar):
    fitted = fit_columns(reduced_presses(long_planar, (0.7, 0.3), scale=0.4))
    assert_allclose([*fitted.attenuation, fitted.scale], [0.7, 0.3, 0.4], rtol=1e-5)


@pytest.mark.slow
def test_a_rigid_sheet_on_rigid_columns_is_the_reduced_model(planar):
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge

    springs = springs_of(planar)
    rigid = replace(
        springs,
        column_axial=1e4 * springs.column_axial,
        panel_bending=1e4 * springs.panel_bending,
        panel_membrane=100 * springs.panel_membrane,
        stop=0.0,
    )
    sheet = BarHinge(planar, grip=Covered(), lattice=build_lattice(planar, rigid))
    presses = unit_presses(sheet, force=0.5)
    fitted = fit_columns(presses)
    assert_allclose([*fitted.attenuation, fitted.scale], 1.0, atol=0.02)
    assert fitted.residual < 0.06
    assert presses.folding.min() > 0.99
    assert signs_agree(presses).all()
    # What is left is the sheet's turn about the pressed vertex, which S10 does not have.
    places = geometry(planar).sheet.vertices[geometry(planar).sheet.columns, :2]
    theory = reduced_presses(planar, (1.0, 1.0)).columns[..., :2]
    left = presses.columns[..., :2] - theory
    for n, m in np.ndindex(planar.cells):
        away = places - geometry(planar).tops[n, m]
        turn = np.stack([-away[..., 1], away[..., 0]], axis=-1)
        left[n, m] -= np.vdot(turn, left[n, m]) / np.vdot(turn, turn) * turn
    assert np.linalg.norm(left) < 0.01 * np.linalg.norm(theory)


@pytest.mark.slow
def test_unit_presses_are_linear_and_have_the_sheets_mirror(planar):
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge

    sheet = BarHinge(planar)
    soft, hard = (unit_presses(sheet, force=force) for force in (5e-3, 10e-3))
    assert_allclose(hard.stiffness, soft.stiffness, rtol=2e-3)
    assert np.linalg.norm(hard.columns - soft.columns) < 2e-3 * np.linalg.norm(soft.columns)
    assert_allclose(soft.stiffness[::-1], soft.stiffness, rtol=1e-4)
    mirrored = soft.columns[::-1, :, ::-1] * (-1, 1, 1)
    assert np.linalg.norm(mirrored - soft.columns) < 1e-4 * np.linalg.norm(soft.columns)


def test_a_press_without_an_answer_is_refused(planar):
    converged = np.ones(36, dtype=bool)
    converged[7] = False
    lost = SimpleNamespace(
        design=planar, press=lambda touches, tolerance: SimpleNamespace(converged=converged)
    )
    with pytest.raises(ModelError, match=r"equilibrium for a press on each cell; not on \(2,2\)$"):
        unit_presses(lost)
    for force in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ArgumentError, match=r"force must be positive and finite; got"):
            unit_presses(lost, force=force)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "choice", "signs", "named", "stiffness"),
    [
        ("creases", {}, (36, 35), (35, 32), (2.37, 5.88, 9.05)),
        ("creases", {"vertex_hole": 1.03e-3}, (36, 34), (35, 31), (2.36, 5.87, 9.04)),
        ("creases", {"vertex_rubber": 1.0}, (36, 34), (35, 29), (2.37, 5.94, 9.28)),
        ("columns", {"rim_share": 11 / 13}, (36, 34), (35, 28), (2.60, 6.51, 10.10)),
        ("columns", {"rim_share": 9 / 13}, (35, 32), (33, 22), (2.94, 7.40, 11.46)),
    ],
)
def test_what_vertices_and_rim_columns_decide(planar, part, choice, signs, named, stiffness):
    """As docs/derivations_sheet.md has it: sticking and covered, and N/mm of (1,1) to (3,3)."""
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge

    design = replace(planar, **{part: replace(getattr(planar, part), **choice)})
    presses = [unit_presses(BarHinge(design, grip=grip)) for grip in (Sticking(), Covered())]
    assert tuple(int(signs_agree(each).all(axis=(2, 3)).sum()) for each in presses) == signs
    counts = [cells_named(each, (0.55, 0.55)) for each in presses]
    assert_allclose(counts, named, atol=1)  # some cells lie on a line that divides names
    layer = np.arange(3)
    assert_allclose(presses[0].stiffness[layer, layer] / 1e3, stiffness, atol=0.006)
