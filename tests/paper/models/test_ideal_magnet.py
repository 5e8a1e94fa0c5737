"""The ideal plate's field, by Maxwell's equations."""

import numpy as np
from numpy.testing import assert_allclose

from paper.models.ideal_magnet import ideal_field

K, WAVE = 0.2, 300.0


def test_ideal_field_has_neither_source_nor_curl() -> None:
    points = np.random.default_rng(1).uniform(-4e-3, 0.0, (50, 3))
    h = 1e-6
    slope = np.stack(
        [
            (ideal_field(points + step, K, WAVE) - ideal_field(points - step, K, WAVE)) / (2 * h)
            for step in h * np.eye(3)
        ],
        axis=-1,
    )
    assert_allclose(np.trace(slope, axis1=1, axis2=2), 0.0, atol=1e-5)
    assert_allclose(slope, slope.swapaxes(1, 2), atol=1e-5)
