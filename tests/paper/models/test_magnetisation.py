"""Magnets that lose magnetisation: the loop, working points and losses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.special import jv

from paper.models.magnetisation import (
    OERSTED,
    MagnetisationLoop,
    disc_factor,
    irreversible_loss,
    sector_factor,
    working_point,
)
from smoskin.design.skin import Magnet
from smoskin.errors import ArgumentError
from smoskin.magnetics import sector
from smoskin.magnetics.temperature import (
    TEMPERATURE_COEFFICIENT,
)

DISC = Magnet(name="m", mount="sheet", corner=(0, 0), radius=5e-3, height=2e-3, remanence=8.04e5)
loops = st.builds(
    MagnetisationLoop,
    remanence=st.floats(1e5, 1e6),
    coercivity=st.floats(1e5, 2e6),
    recoil=st.floats(0.0, 0.04),
    width=st.floats(0.05, 1.5),
)


def test_the_loop_runs_through_the_printed_points() -> None:
    loop = MagnetisationLoop()
    # 0.804 emu/mm3 = 804 emu/cm3 = 804 kA/m; 5227.78 Oe = 416 kA/m.
    assert_allclose(loop.descending(0.0), 0.804e6, rtol=1e-14)
    assert_allclose(loop.descending(-5227.78 * OERSTED), 0.0, atol=1e-6)
    assert_allclose(loop.coercivity, 416.0e3, rtol=1e-4)


@given(loops)
def test_any_loop_runs_through_its_points_and_rises(loop: MagnetisationLoop) -> None:
    assert_allclose(loop.descending(0.0), loop.remanence, rtol=1e-12)
    assert_allclose(loop.descending(-loop.coercivity), 0.0, atol=1e-9 * loop.remanence)
    field = np.linspace(-5, 5, 101) * loop.coercivity
    assert (np.diff(loop.descending(field)) >= 0).all()
    assert (loop.descending(field) >= loop.ascending(field)).all()
    assert_allclose(loop.ascending(field), -loop.descending(-field))
    assert 0 < loop.knee < loop.coercivity
    assert_allclose(loop.descending(-loop.knee), 0.9 * loop.remanence, rtol=1e-6)


def test_a_cycle_costs_work() -> None:
    # The area between the branches, in closed form: the recoil line drops out.
    loop = MagnetisationLoop()
    area, _ = quad(lambda h: float(loop.descending(h) - loop.ascending(h)), -5e6, 5e6, limit=200)
    assert_allclose(area, 4 * loop.plateau * loop.centre, rtol=1e-6)


def test_disc_factor_is_the_published_one() -> None:
    # D.-X. Chen, J. A. Brug and R. B. Goldfarb, IEEE Trans. Magn. 27, 3601 (1991), at chi = 0.
    assert_allclose(disc_factor(0.5, 1.0), (1 - 0.3116) / 2, atol=5e-5)
    assert disc_factor(1.0, 1e-4) < 1e-3
    assert_allclose(disc_factor(1.0, 1e3), 0.5, atol=1e-3)


@pytest.mark.parametrize("slender", [0.1, 0.4, 1.0, 5.0])
def test_disc_factor_against_its_integral_in_fourier_space(slender: float) -> None:
    # N along the axis: mean of k_z^2/k^2 over the shape's spectrum, k_z done by hand.
    def density(k: float) -> float:
        thick = 2 * slender * k
        return 2 * jv(1, k) ** 2 / k * -np.expm1(-thick) / thick

    along = sum(quad(density, a, b, limit=200)[0] for a, b in ((0, 20), (20, 100), (100, 400)))
    assert_allclose(disc_factor(1.0, 2 * slender), (1 - along) / 2, atol=2e-4)


def test_sector_factor_is_the_mean_of_the_exact_field() -> None:
    rng = np.random.default_rng(0)
    count = 60_000
    r, turn = 5e-3 * np.sqrt(rng.uniform(size=count)), rng.uniform(0, np.pi / 2, count)
    places = np.stack([r * np.cos(turn), r * np.sin(turn), rng.uniform(-1e-3, 1e-3, count)], 1)
    inside = sector.field(DISC, places) / sector.VACUUM_PERMEABILITY
    opposing = inside @ -np.sqrt([0.5, 0.5, 0.0]) - DISC.remanence
    spread = opposing.std() / np.sqrt(count) / DISC.remanence
    assert_allclose(sector_factor(DISC), -opposing.mean() / DISC.remanence, atol=4 * spread)
    # Size alone does not matter, nor strength.
    twice = Magnet(name="m", mount="base", corner=(1, 1), radius=1e-2, height=4e-3, remanence=1.0)
    assert_allclose(sector_factor(twice), sector_factor(DISC), rtol=1e-9)


@given(loops, st.floats(0.0, 1.0), st.floats(-2e6, 2e6))
@settings(max_examples=50)
def test_the_working_point_lies_on_the_loop_and_on_the_load_line(
    loop: MagnetisationLoop, factor: float, applied: float
) -> None:
    point = working_point(loop, factor, applied=applied)
    assert_allclose(point.field, applied - factor * point.magnetisation, atol=1e-3)
    assert_allclose(point.magnetisation, loop.descending(point.field), atol=1e-3)


def test_without_poles_a_magnet_works_at_its_remanence() -> None:
    assert_allclose(working_point(MagnetisationLoop(), 0.0), (0.0, 0.804e6), atol=1e-3)


def test_loss_begins_past_the_working_point_and_grows() -> None:
    loop, factor = MagnetisationLoop(), disc_factor(5e-3, 2e-3)
    assert irreversible_loss(loop, factor) == 0.0
    assert irreversible_loss(loop, factor, applied=1e5) == 0.0  # helped, not opposed
    assert irreversible_loss(loop, factor, temperature=0.0) == 0.0
    against = [irreversible_loss(loop, factor, applied=-h) for h in np.linspace(0, 1.5e6, 20)]
    assert (np.diff(against) > 0).all()
    # Driven through, it comes back reversed, and more saturated than it was.
    before = loop.kept(working_point(loop, factor).field)
    assert_allclose(against[-1], 1 + 1 / before, rtol=1e-3)
    hot = [irreversible_loss(loop, factor, temperature=t) for t in (25, 50, 75, 100, 150)]
    assert (np.diff(hot) > 0).all()


def test_loss_in_closed_form_without_poles() -> None:
    loop = MagnetisationLoop(recoil=0.0)
    width = 0.4 * loop.coercivity
    assert_allclose(loop.centre, loop.coercivity)
    expected = 1 - np.tanh((loop.coercivity - 2e5) / width) / np.tanh(loop.coercivity / width)
    assert_allclose(irreversible_loss(loop, 0.0, applied=-2e5), expected, rtol=1e-9)


def test_a_warm_loop_is_the_loop_of_its_warm_points() -> None:
    warm = MagnetisationLoop().at(75.0)
    assert_allclose(warm.descending(0.0), 0.804e6 * (1 - 0.0011 * 50))
    assert_allclose(warm.descending(-5227.78 * OERSTED * 0.75), 0.0, atol=1e-6)


def test_the_skins_magnets_weaken_on_heating_nearly_as_fast_as_printed() -> None:
    # An evenly magnetised disc would weaken by 1.5 % in ten degrees, four sectors by 3.4 %.
    loop, factor = MagnetisationLoop(), sector_factor(DISC)
    warmth = np.linspace(25.0, 75.0, 6)
    working = [working_point(loop, factor, temperature=float(t)).magnetisation for t in warmth]
    slope, start = np.polyfit(warmth - 25.0, np.array(working) / working[0], 1)
    assert_allclose(start + slope * (warmth - 25.0), np.array(working) / working[0], atol=3e-3)
    assert_allclose(slope, -0.0034, rtol=0.05)
    assert 1.0 < TEMPERATURE_COEFFICIENT / slope < 2.0
    assert_allclose(irreversible_loss(loop, factor, temperature=75.0), 0.124, atol=0.005)
    assert_allclose(working[0] / loop.remanence, 0.70, atol=0.01)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: MagnetisationLoop(remanence=0.0), "remanence must be positive"),
        (lambda: MagnetisationLoop(width=np.nan), "width must be positive"),
        (lambda: MagnetisationLoop(recoil=2.0), r"recoil must lie in 0\.\.1\.93"),
        (lambda: MagnetisationLoop().at(300.0), "temperature must leave the magnet"),
        (lambda: disc_factor(0.0, 1.0), "radius and height must be positive"),
        (lambda: working_point(MagnetisationLoop(), 1.5), r"factor must lie in 0\.\.1"),
        (lambda: working_point(MagnetisationLoop(), 0.1, applied=np.nan), "applied must be finite"),
    ],
)
def test_wrong_use(call, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        call()
