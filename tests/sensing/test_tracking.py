"""A touch followed over time."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.tracking import Agility, TrackingEstimator

SPREAD = np.diag([1e-6, 1e-6, 1e-4, 1e-4, 1e-4])


class Sliding(Estimator):
    """Says a noisy touch that slides at 20 mm/s, and none after two seconds."""

    def __init__(self) -> None:
        self.rng = np.random.default_rng(0)

    def reset(self) -> None:
        self.rng = np.random.default_rng(0)

    def step(self, reading: Reading) -> Estimate:
        if reading.time > 2.0:
            return Estimate(time=reading.time, status=Status.NO_CONTACT)
        true = np.array([0.02 + 0.02 * reading.time, 0.05, 0.0, 0.0, -0.5])
        said = true + self.rng.multivariate_normal(np.zeros(5), SPREAD)
        return Estimate(
            time=reading.time,
            status=Status.CONTACT,
            contacts=(Contact(position=said[:2], force=said[2:]),),
            covariance=SPREAD[None],
        )


def reading(time):
    return Reading(time=time, field=np.zeros((3, 3)))


def test_a_track_is_surer_than_its_readings_and_knows_how_fast_it_goes():
    raw, tracked = Sliding(), TrackingEstimator(Sliding())
    errors = []
    for k in range(400):
        one, both = raw.step(reading(0.005 * k)), tracked.step(reading(0.005 * k))
        true = 0.02 + 0.02 * 0.005 * k
        errors.append([e.contacts[0].position[0] - true for e in (one, both)])
    spread = np.std(errors[100:], axis=0)
    assert spread[1] < 0.7 * spread[0]
    assert np.all(np.linalg.eigvalsh(both.covariance[0]) > 0)
    assert both.covariance[0, 0, 0] < 0.5 * SPREAD[0, 0]
    # Agile as it takes touches to be, it finds the speed no better than so.
    assert tracked.velocity == pytest.approx([0.02, 0.0], abs=0.1)


def test_the_end_of_a_touch_ends_the_track():
    tracked = TrackingEstimator(Sliding())
    tracked.step(reading(1.99))
    assert tracked.step(reading(2.01)).status is Status.NO_CONTACT
    tracked.reset()
    fresh = tracked.step(reading(0.5))
    assert fresh.covariance[0] == pytest.approx(SPREAD)


def test_wrong_agility_is_refused():
    with pytest.raises(ArgumentError, match="force_rate must be positive"):
        Agility(force_rate=0.0)
