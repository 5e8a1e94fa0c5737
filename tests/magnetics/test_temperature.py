"""Warmth and magnets: weakening and bounds of service."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import check_temperature, temperature_factor


def test_magnets_lose_five_percent_in_ten_degrees() -> None:
    assert_allclose(temperature_factor([25.0, 35.0, 15.0]), [1.0, 0.95, 1.05])
    assert np.isnan(temperature_factor(np.nan))


def test_service_ends_where_the_paper_saw_it_end() -> None:
    assert_allclose(check_temperature([-40.0, 25.0, 75.0]), [-40.0, 25.0, 75.0])
    for wrong in (75.01, -40.01, np.nan, [25.0, np.inf]):
        with pytest.raises(ArgumentError, match=r"temperature must lie in -40\.\.75 degC"):
            check_temperature(wrong)
