"""What is asked of every energy that holds against a press."""

from collections.abc import Callable

import numpy as np
import pytest

from paper.models.finite_press import PressResponse


@pytest.fixture(scope="session")
def assert_derivatives() -> Callable[[Callable[[float], PressResponse], float], None]:
    """Force and stiffness of a response are its energy's derivatives by the press."""

    def check(respond: Callable[[float], PressResponse], press: float) -> None:
        step = 1e-6
        less, now, more = (respond(press + s) for s in (-step, 0.0, step))
        steepest = np.abs(now.stiffness).max()
        force, tangent = (
            (less.energy - more.energy) / (2 * step),
            (less.force - more.force) / (2 * step),
        )
        np.testing.assert_allclose(now.force, force, rtol=1e-5, atol=1e-8 * steepest)
        np.testing.assert_allclose(now.stiffness, tangent, atol=5e-5 * steepest)
        assert np.all(now.energy >= 0)

    return check
