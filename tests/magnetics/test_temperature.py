"""Warmth and magnets: weakening and bounds of service."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import (
    check_temperature,
    chip_factor,
    magnet_factor,
    temperature_factor,
)


def test_magnets_lose_five_percent_in_ten_degrees() -> None:
    assert_allclose(temperature_factor([25.0, 35.0, 15.0]), [1.0, 0.95, 1.05])
    assert np.isnan(temperature_factor(np.nan))


def test_service_ends_where_the_paper_saw_it_end() -> None:
    assert_allclose(check_temperature([-40.0, 25.0, 75.0]), [-40.0, 25.0, 75.0])
    for wrong in (75.01, -40.01, np.nan, [25.0, np.inf]):
        with pytest.raises(ArgumentError, match=r"temperature must lie in -40\.\.75 degC"):
            check_temperature(wrong)


def test_nearly_all_of_the_loss_is_the_chips() -> None:
    warmth = np.array([-40.0, 15.0, 25.0, 35.0, 75.0])
    assert_allclose(chip_factor(warmth), [1.2925, 1.045, 1.0, 0.955, 0.775])
    assert_allclose(chip_factor(warmth) * magnet_factor(warmth), temperature_factor(warmth))
    assert_allclose(magnet_factor([35.0, 45.0]), [0.9948, 0.9890], atol=1e-4)
