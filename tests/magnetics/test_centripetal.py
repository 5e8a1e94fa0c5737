"""The inverse of the ideal field (S4 to S6), and how far the corrected inverse is true."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad

from paper.models.ideal_magnet import ideal_field
from smoskin.arrays import Floats
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics.centripetal import (
    LinearCorrection,
    amplitude,
    displacement,
    fit_correction,
    ideal_inverse,
    usable_range,
)
from smoskin.magnetics.sector import VACUUM_PERMEABILITY, field

MAGNET = Magnet(name="M", mount="sheet", corner=(0, 0), radius=5e-3, height=2e-3, remanence=8.04e5)
GAP = 6e-3
K, WAVE = 0.2, 300.0

lateral = st.floats(-0.49 * np.pi, 0.49 * np.pi)


def at_chip(magnet: Magnet, gap: float, moved: Floats) -> Floats:
    """Exact field at the chip when the magnet has moved."""
    side = -1.0 if magnet.mount == "sheet" else 1.0
    return field(magnet, [0.0, 0.0, side * (0.5 * magnet.height + gap)] - moved)


@given(kx=lateral, ky=lateral, kz=st.floats(-6.0, 0.0), strength=st.sampled_from([0.2, -0.2]))
def test_inverse_undoes_the_ideal_field(kx: float, ky: float, kz: float, strength: float) -> None:
    seen = ideal_field(np.array([kx, ky, kz]) / WAVE, strength, WAVE)
    phase_x, phase_y, decayed = ideal_inverse(*seen)
    assert_allclose([phase_x, phase_y], [kx, ky], atol=1e-9)
    assert_allclose(decayed, abs(strength) * np.exp(kz), rtol=1e-9)


@given(kx=lateral, ky=lateral)
def test_inverse_agrees_with_the_printed_first_two_lines(kx: float, ky: float) -> None:
    bx, by, bz = ideal_field([kx / WAVE, ky / WAVE, -1e-3], K, WAVE)
    phase_x, phase_y, _ = ideal_inverse(bx, by, bz)
    assert_allclose(np.tan(phase_x), -bx / (bz - (bz**2 - by**2 + bx**2) / (2 * bz)), rtol=1e-6)
    assert_allclose(np.tan(phase_y), -by / (bz - (bz**2 + by**2 - bx**2) / (2 * bz)), rtol=1e-6)


def test_printed_third_line_fails_and_the_corrected_one_holds() -> None:
    place = np.array([1.0e-3, -0.6e-3, -2e-3])
    bx, by, bz = ideal_field(place, K, WAVE)
    true = K * np.exp(WAVE * place[2])
    printed = np.hypot(bz - (bz**2 + by**2 + bx**2) / (2 * bz), by)  # the sign of bx^2 is lost
    corrected = np.hypot(bz - (bz**2 + by**2 - bx**2) / (2 * bz), by)
    assert abs(printed / true - 1.0) > 0.04
    assert_allclose(corrected, true, rtol=1e-12)


def test_no_displacement_is_finite_where_the_corrected_bz_vanishes_and_only_there() -> None:
    correction = fit_correction(MAGNET, GAP, 1e-3)
    level = 2.0**-6  # T: a power of two, so the product is exact and Bz vanishes to the bit
    c_c = np.array([*correction.c_c[:2], -level * correction.k_c[2]])
    correction = replace(correction, c_c=c_c)
    moved = displacement(correction, [[1e-3, 2e-3, level], [1e-3, 2e-3, level + 5e-3]])
    assert not np.isfinite(moved[0]).all()
    assert np.isfinite(moved[1]).all()


def test_amplitude_is_that_of_the_plate_layer_by_layer() -> None:
    # A layer of charge s cos(kx) at height h has Bz = -mu_0 s/2 exp(k(z - h)) cos(kx) below it;
    # m_0 sin(kx) is a charge of -m_0 k cos(kx) a volume.
    layers = quad(lambda h: 0.5 * VACUUM_PERMEABILITY * 8.04e5 * WAVE * np.exp(-WAVE * h), 0, 2e-3)
    assert_allclose(amplitude(8.04e5, WAVE, 2e-3), layers[0], rtol=1e-10)


@pytest.mark.parametrize("mount", ["sheet", "base"])
@pytest.mark.parametrize("polarity", [1, -1])
def test_corrected_inverse_finds_the_magnet(mount: str, polarity: int) -> None:
    magnet = replace(MAGNET, mount=mount, polarity=polarity)
    correction = fit_correction(magnet, GAP, 1e-3)
    moved = np.array([[0.5e-3, 0, 0], [0, -0.5e-3, 0], [0, 0, -0.4e-3], [0.4e-3, -0.3e-3, 0.2e-3]])
    recovered = displacement(correction, at_chip(magnet, GAP, moved))
    assert_allclose(recovered, moved, atol=6e-6)
    assert_allclose(displacement(correction, at_chip(magnet, GAP, moved[3])), recovered[3])


def test_fit_respects_the_symmetry_of_the_disc() -> None:
    correction = fit_correction(MAGNET, GAP, 1e-3)
    assert correction.k_c[0] == correction.k_c[1]
    assert_allclose(correction.c_c[:2], 0.0)
    assert_allclose(
        correction.amplitude, amplitude(MAGNET.remanence, correction.wave_number, MAGNET.height)
    )


def test_correction_brings_the_exact_field_to_the_ideal_one() -> None:
    correction = fit_correction(MAGNET, GAP, 1e-3)
    moved = np.random.default_rng(2).uniform(-0.5e-3, 0.5e-3, (200, 3))
    corrected = correction.k_c * at_chip(MAGNET, GAP, moved) + correction.c_c
    ideal = ideal_field([0.0, 0.0, -GAP] - moved, correction.amplitude, correction.wave_number)
    scale = np.linalg.norm(ideal, axis=1).max()
    assert np.abs(corrected - ideal).max() < 5e-3 * scale


@pytest.mark.parametrize("tolerance", [2e-6, 10e-6, 50e-6])
def test_usable_range_is_where_the_error_passes_the_tolerance(tolerance: float) -> None:
    correction = fit_correction(MAGNET, GAP, 1e-3)
    reach = usable_range(MAGNET, GAP, correction, tolerance)
    rng = np.random.default_rng(3)
    towards = rng.normal(size=(4000, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    moved = reach * np.cbrt(rng.uniform(0.0, 1.0, (4000, 1))) * towards
    within = np.linalg.norm(displacement(correction, at_chip(MAGNET, GAP, moved)) - moved, axis=1)
    assert within.max() < 1.02 * tolerance
    moved = 1.1 * reach * towards
    beyond = np.linalg.norm(displacement(correction, at_chip(MAGNET, GAP, moved)) - moved, axis=1)
    assert beyond.max() > tolerance


def test_usable_range_reaches_a_millimetre() -> None:
    correction = fit_correction(MAGNET, GAP, 1e-3)
    assert usable_range(MAGNET, GAP, correction, 20e-6) > 1e-3
    assert usable_range(MAGNET, GAP, correction, 1e-12) == 0.0
    assert usable_range(MAGNET, GAP, correction, 1.0) == pytest.approx(0.95 * GAP)


def test_wrong_use_is_named() -> None:
    with pytest.raises(ArgumentError, match=r"stroke must lie in \(0, gap\)"):
        fit_correction(MAGNET, GAP, 7e-3)
    with pytest.raises(ArgumentError, match="tolerance must be positive; got 0"):
        usable_range(MAGNET, GAP, fit_correction(MAGNET, GAP, 1e-3), 0.0)
    with pytest.raises(ArgumentError, match="gap must be positive; got 0"):
        usable_range(MAGNET, 0.0, fit_correction(MAGNET, GAP, 1e-3), 1e-6)
    for stroke in (0.0, GAP):
        with pytest.raises(ArgumentError, match=r"stroke must lie in \(0, gap\)"):
            fit_correction(MAGNET, GAP, stroke)
    for wave_number, thickness in ((-1.0, 2e-3), (0.0, 2e-3)):
        with pytest.raises(ArgumentError, match="wave_number must be positive"):
            amplitude(8.04e5, wave_number, thickness)
    with pytest.raises(ArgumentError, match="thickness must be positive; got 0"):
        amplitude(8.04e5, 300.0, 0.0)
    numbers = {"wave_number": 300.0, "amplitude": 0.2, "gap": GAP, "side": 1.0}
    for name in ("wave_number", "amplitude", "gap"):
        with pytest.raises(ArgumentError, match=f"{name} must be positive; got 0"):
            LinearCorrection(k_c=np.ones(3), c_c=np.zeros(3), **numbers | {name: 0.0})
    with pytest.raises(ArgumentError, match="side must be -1"):
        LinearCorrection(
            k_c=np.ones(3), c_c=np.zeros(3), wave_number=300.0, amplitude=0.2, gap=GAP, side=0.0
        )
