"""One test an erratum: the printed form fails, the corrected one holds (docs/errata.md)."""

import math

import numpy as np
import pytest

from smoskin.design.skin import MiuraCell
from smoskin.mechanics.attenuation import cell_change
from smoskin.mechanics.stiffness import shear_gain
from smoskin.origami.cell import fold_angle, poisson_ratios, size

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
        exact = cell_change(cell, press, "exact").dl
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
        fold_angle(cell, length=extent.length + cell_change(cell, -1e-4, "exact").dl),
        fold_angle(cell, width=extent.width + cell_change(cell, -1e-4, "exact").dw),
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
