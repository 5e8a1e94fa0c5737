"""How fast chips can be read, and which setting suits a skin and a rate."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.design.skin import HallSetting, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.feasibility import MARGIN, check_design, field_extent
from smoskin.hardware.budget import propose_setting, time_budget
from smoskin.magnetics import mlx90393

PLANAR = HallSetting(gain_selection=3, resolution=2, oversampling=1, digital_filter=3)
FAST = replace(PLANAR, oversampling=0, digital_filter=2)


def test_a_transfer_takes_nine_bits_a_byte() -> None:
    budget = time_budget(PLANAR, 4)
    assert_allclose(budget.read, 4 * (12 * 9 + 3) / 400e3)
    assert_allclose(budget.start, 4 * (4 * 9 + 3) / 400e3)
    assert_allclose(time_budget(PLANAR, 4, bus=100e3).read, 4 * budget.read)


def test_rates_of_the_planar_board() -> None:
    assert 145 < time_budget(PLANAR, 3).rate < 150
    assert 255 < time_budget(FAST, 3).rate < 260
    assert 490 < time_budget(FAST, 3, mode="burst").rate < 494
    # Eight chips take longer to read than one takes to measure.
    assert_allclose(time_budget(FAST, 8, mode="burst").rate, 1 / (8 * 111 / 400e3))


@pytest.mark.parametrize("rate", [20.0, 100.0, 146.0, 200.0, 257.0])
def test_a_proposed_setting_is_fast_and_wide_enough(planar: SkinDesign, rate: float) -> None:
    setting = propose_setting(planar, rate)
    assert time_budget(setting, 3).rate >= rate
    check_design(replace(planar, hall_setting=setting))
    assert not mlx90393.wraps(setting)
    for site in planar.halls:
        largest = field_extent(planar, site).largest
        assert (largest <= MARGIN * mlx90393.full_scale(setting)).all()


def test_no_setting_that_is_as_fast_and_wide_has_less_noise(planar: SkinDesign) -> None:
    chosen = propose_setting(planar, 150.0)
    best = np.linalg.norm(mlx90393.noise(chosen))
    largest = np.max([field_extent(planar, site).largest for site in planar.halls], axis=0)
    for gain in range(8):
        for over in range(4):
            for smooth in range(8):
                other = replace(
                    chosen, gain_selection=gain, oversampling=over, digital_filter=smooth
                )
                wide = (largest <= MARGIN * mlx90393.full_scale(other)).all()
                fast = time_budget(other, 3).rate >= 150.0
                if wide and fast and mlx90393.settles(other):
                    assert np.linalg.norm(mlx90393.noise(other)) > 0.99 * best


def test_the_shipped_design_has_the_setting_for_its_rate(planar: SkinDesign) -> None:
    # Magnets of made skins come nearer than designed ones, by two fifths of their field: the
    # shipped range is two steps wider.
    proposed = propose_setting(planar, 145.0)
    assert proposed.gain_selection == 5
    assert replace(proposed, gain_selection=3) == planar.hall_setting


def test_wrong_use_is_named(planar: SkinDesign) -> None:
    with pytest.raises(ArgumentError, match="rate must be at most 257 Hz for 3 chips in single"):
        propose_setting(planar, 300.0)
    assert propose_setting(planar, 300.0, mode="burst").oversampling == 1
    with pytest.raises(ArgumentError, match="rate must be positive"):
        propose_setting(planar, 0.0)
    with pytest.raises(ArgumentError, match="chips must be at least 1"):
        time_budget(PLANAR, 0)
    with pytest.raises(ArgumentError, match="bus must be above 0 and at most 400000 Hz"):
        time_budget(PLANAR, 3, bus=1e6)
    near = replace(planar, halls=tuple(replace(site, gap=1e-3) for site in planar.halls))
    with pytest.raises(ArgumentError, match="design must have fields that a chip can read"):
        propose_setting(near, 100.0)
