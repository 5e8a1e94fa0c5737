"""One test an erratum: the printed form fails, the corrected one holds (docs/errata.md)."""

import math

import numpy as np
import pytest

from paper.models.finite_press import exact_change
from paper.models.ideal_magnet import ideal_field
from smoskin.design.materials import FILMS
from smoskin.design.skin import Creases, Magnet, MiuraCell
from smoskin.magnetics.centripetal import amplitude
from smoskin.magnetics.sector import field
from smoskin.mechanics.plate import crease_stiffness
from smoskin.mechanics.reduced.attenuation import cell_change
from smoskin.mechanics.reduced.stiffness import cell_layers, relative_stiffness_map, shear_gain
from smoskin.origami.cell import fold_angle, poisson_ratios, size
from smoskin.origami.geometry import geometry

MU_0 = 4e-7 * math.pi


def ten_mm_cell() -> MiuraCell:
    return MiuraCell(
        panel_a=0.01, panel_b=0.01, sector_angle=math.radians(60), fold_angle=math.radians(40)
    )


def test_e1_in_plane_poisson_ratio():
    cell, step = ten_mm_cell(), 1e-7
    less, more = size(cell, cell.fold_angle - step), size(cell, cell.fold_angle + step)
    now = size(cell)
    measured = -((more.length - less.length) / now.length) / ((more.width - less.width) / now.width)
    assert poisson_ratios(cell).nu_12 == pytest.approx(measured, rel=1e-6)
    assert -(math.cos(cell.fold_angle) ** 2) != pytest.approx(measured, rel=0.1)


def centripetal_film_field(x: float, z: float, k: float, thickness: float, m_0: float) -> float:
    """B_x above a film of m_x = m_0 sin kx by summing its charge -div M, layer by layer.

    A sheet of charge density s cos kx has the potential s cos kx e^(-k|z|) / (2k).
    """
    depths = (np.arange(20000) + 0.5) / 20000 * thickness
    charge = -m_0 * k * np.cos(0.0)
    potential_slope = np.mean(charge * np.exp(-k * (z + depths)) / (2 * k)) * thickness
    return MU_0 * potential_slope * k * math.sin(k * x)


def test_e2_amplitude_needs_mu_0():
    k, d, m_0, z, x = 300.0, 2e-3, 8.04e5, 4e-3, 1e-3
    measured = abs(centripetal_film_field(x, z, k, d, m_0))
    printed = m_0 * (1 - math.exp(-k * d)) / 2 * math.exp(-k * z) * math.sin(k * x)
    assert measured == pytest.approx(MU_0 * printed, rel=1e-4)
    assert measured < 1e-5 * printed


def test_e3_third_line_of_s5():
    amplitude, kx, ky = 0.04, 0.31, 0.12
    b_x, b_y = -amplitude * math.sin(kx), -amplitude * math.sin(ky)
    b_z = amplitude * (math.cos(kx) + math.cos(ky))

    def third_line(inner: float) -> float:
        return math.hypot(b_z - inner / (2 * b_z), b_y)

    assert third_line(b_z**2 + b_y**2 - b_x**2) == pytest.approx(amplitude, rel=1e-12)
    assert third_line(b_z**2 + b_y**2 + b_x**2) != pytest.approx(amplitude, rel=1e-3)


def test_e4_s7_is_first_order():
    cell = MiuraCell(
        panel_a=0.01, panel_b=0.01, sector_angle=math.radians(60), fold_angle=math.radians(45)
    )

    def excess(press: float) -> float:
        exact = exact_change(cell, press).dl
        return float(cell_change(cell, press).dl / exact - 1)

    assert excess(-1e-4) == pytest.approx(0.04, abs=0.005)
    assert excess(-1e-3) == pytest.approx(0.43, abs=0.01)


def test_e5_length_and_width_give_different_folds(planar):
    cell, v = planar.cell, planar.coefficients.attenuation[0]
    change, extent = cell_change(cell, -1e-4), size(planar.cell)
    off_diagonal = (
        fold_angle(cell, length=extent.length + v * change.dl),
        fold_angle(cell, width=extent.width + change.dw),
    )
    assert abs(off_diagonal[0] - off_diagonal[1]) > 0.5 * abs(off_diagonal[1] - cell.fold_angle)
    loaded = (
        fold_angle(cell, length=extent.length + exact_change(cell, -1e-4).dl),
        fold_angle(cell, width=extent.width + exact_change(cell, -1e-4).dw),
    )
    assert loaded[0] == pytest.approx(loaded[1], rel=1e-9)


def test_e7_a_signal_must_name_one_zone():
    printed = ["----", "--+-", "+-+-", "-+--", "--+-", "+++-", "-+-+", "-+++", "++++"]
    corrected = [*printed[:4], "-++-", *printed[5:]]
    assert len(set(printed)) < 9
    assert len(set(corrected)) == 9


def test_e9_the_lower_correction_is_the_stronger():
    shear = [0.3, 0.0]
    assert shear_gain(shear, (0.6, 1.0)) > shear_gain(shear, (0.9, 1.0))


def test_e11_s3_points_away_from_the_centre():
    magnet = Magnet(
        name="M", mount="sheet", corner=(0, 0), radius=5e-3, height=2e-3, remanence=8e5, polarity=1
    )
    towards_centre = field(magnet, [0.0, 0.0, -5e-3])[2]
    printed = ideal_field([0.0, 0.0, -4e-3], amplitude(8e5, 250.0, 2e-3), 250.0)[2]
    corrected = ideal_field([0.0, 0.0, -4e-3], amplitude(-8e5, 250.0, 2e-3), 250.0)[2]
    assert np.sign(printed) != np.sign(towards_centre) == np.sign(corrected)


def crease_sum(design, vertex_wise: bool) -> tuple[float, float]:
    """Sum of k L / 2 over a-creases and b-creases, k = 1: of one top vertex, or of a period."""
    sheet, (n, m) = geometry(design).sheet, design.cells
    top = sheet.loaded[n // 2, m // 2]
    # The period: the top vertex's own creases and those of the bottom vertex beside it.
    vertices = [top] if vertex_wise else [top, top + 1 + 2 * m + 1]
    chosen = np.isin(sheet.creases, vertices).any(axis=1)
    ends = sheet.vertices[sheet.creases[chosen]]
    half_length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2
    along = sheet.along_a[chosen]
    return float(half_length[along].sum()), float(half_length[~along].sum())


def test_e12_energy_of_the_creases_at_a_top_vertex(planar):
    a, b = planar.cell.panel_a, planar.cell.panel_b
    assert crease_sum(planar, vertex_wise=True) == pytest.approx((a, b), rel=1e-12)
    assert crease_sum(planar, vertex_wise=True) != pytest.approx((2 * a, 2 * b), rel=0.1)
    assert crease_sum(planar, vertex_wise=False) == pytest.approx((2 * a, 2 * b), rel=1e-12)


def test_e13_crease_stiffness_follows_the_gap(planar):
    film, turn = Creases(thickness=50e-6, gap=1e-3, material="polyimide"), 0.1
    # Energy of a film of unit width bent evenly by `turn` over the gap, layer by layer.
    z = ((np.arange(10000) + 0.5) / 10000 - 0.5) * film.thickness
    modulus = FILMS[film.material].young_modulus
    energy = np.mean(modulus * (z * turn / film.gap) ** 2 / 2) * film.thickness * film.gap
    assert crease_stiffness(film) == pytest.approx(2 * energy / turn**2, rel=1e-6)
    printed = modulus * film.thickness**3 / 12 / planar.cell.panel_a
    assert printed < 0.1 * crease_stiffness(film)


def test_e14_creases_that_end_on_the_rim(planar):
    n, m = planar.cells
    along = geometry(planar).sheet.along_a
    assert (along.sum(), (~along).sum()) == (
        2 * n * m + 2 * (n - 1) * m,
        2 * n * m + 2 * n * (m - 1),
    )
    assert along.sum() == (~along).sum() == 132
    assert 2 * n * m + 2 * (n - 1) * (m - 1) == 122


#: Columns: two reference directions of unequal length, not at right angles.
SKEW = np.array([[1.0, 0.6], [0.0, 1.4]])


def test_e15_curvatures_in_skew_coordinates():
    curvatures = (0.7, -0.3)
    metric, form = SKEW.T @ SKEW, SKEW.T @ np.diag(curvatures) @ SKEW
    mixed = np.linalg.solve(metric, form)
    right = curvatures[0] ** 2 + curvatures[1] ** 2
    assert np.trace(mixed @ mixed) == pytest.approx(right, rel=1e-12)
    assert np.sum(form * form) != pytest.approx(right, rel=0.1)


def test_e16_stretches_in_skew_coordinates():
    stretches = np.array([1.2, 0.9])
    third = 1 / stretches.prod()  # an incompressible sheet
    right = float((stretches**2).sum() + third**2)
    orthonormal = np.diag(stretches**2)
    assert np.trace(orthonormal) + 1 / np.linalg.det(orthonormal) == pytest.approx(right, rel=1e-12)
    metric, skewed = SKEW.T @ SKEW, SKEW.T @ orthonormal @ SKEW
    corrected = np.trace(np.linalg.solve(metric, skewed))
    corrected += np.linalg.det(metric) / np.linalg.det(skewed)
    assert corrected == pytest.approx(right, rel=1e-12)
    assert np.trace(skewed) + 1 / np.linalg.det(skewed) != pytest.approx(right, rel=0.1)


def best_radius(side: float, tau: float) -> float:
    """Radius that S30 gives a square sheet pulled 1 % long on a cylinder that it may widen."""
    radius = side * np.linspace(0.5, 20, 20000)
    squares = np.stack([np.full_like(radius, 1.01**2), (1 + 0.2 * side / radius) ** 2])
    stretching = squares.sum(axis=0) + 1 / squares.prod(axis=0) - 3
    energy = side**2 * (tau * stretching + (1 / radius - 1 / side) ** 2)
    return float(radius[np.argmin(energy)] / side)


def test_e17_tau_carries_one_over_length_squared():
    shape = best_radius(0.1, 300.0)
    assert 0.6 < shape < 19
    assert best_radius(0.2, 300.0 / 4) == pytest.approx(shape, rel=1e-3)
    assert best_radius(0.2, 300.0) != pytest.approx(shape, rel=0.05)


def test_e18_one_fold_angle_folds_fully(planar):
    """Bending energy l w / R^2 of cells on a cylinder: no least value for one phi, one for many."""

    def energy(phi) -> float:
        extent = size(planar.cell, phi)
        return float(np.mean(extent.length * extent.width))

    folds = np.linspace(0.02, 0.999 * planar.cell.sector_angle, 200)
    assert np.all(np.diff([energy(phi) for phi in folds]) > 0)

    rng = np.random.default_rng(0)
    for _ in range(20):
        change = rng.uniform(-0.1, 0.1, 36)
        field_of_phi = planar.cell.fold_angle + change - change.mean()
        assert energy(field_of_phi) > energy(planar.cell.fold_angle)


def test_e26_the_sheet_is_symmetric_across_x_alone(planar):
    for v in (1.0, 0.7, 0.4, 0.2):
        stiffness = relative_stiffness_map(planar.cell, planar.cells, (v, v))
        np.testing.assert_allclose(stiffness, stiffness[::-1], rtol=1e-12)
        assert 1.13 < stiffness[0, -1] / stiffness[0, 0] < 1.16
    outer = stiffness[cell_layers(planar.cells) == 0].mean()
    assert stiffness[0, 0] < stiffness[2, 2] < outer
