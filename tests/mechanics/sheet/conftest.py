"""A small sheet and its touches, shared by the tests of the whole sheet."""

import numpy as np
import pytest

from skins import with_magnets


@pytest.fixture(scope="session")
def small(planar):
    """A skin of 3 x 3 cells."""
    return with_magnets(planar, [(2, 1)], (3, 3))


@pytest.fixture(scope="session")
def sheet(small):
    """Its nonlinear sheet, to which touches stick."""
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.model import BarHinge

    return BarHinge(small)


@pytest.fixture(scope="session")
def cases():
    """A dozen double touches with drags."""
    from smoskin.mechanics.sheet.touches import Touches

    rng = np.random.default_rng(3)
    whole = np.array([0.060, 0.080]) - 1e-4
    force = rng.uniform([-0.1, -0.1, -0.6], [0.1, 0.1, -0.1], (12, 2, 3))
    force[:4, :, :2] = 0.0
    force[::5, 1] = 0.0
    return Touches(position=rng.uniform(1e-4, whole, (12, 2, 2)), force=force)
