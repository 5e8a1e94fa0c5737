"""What every estimator must do, whatever is inside it."""

from collections.abc import Callable

import numpy as np
import pytest

from networks import tiny_network
from smoskin.errors import ArgumentError
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import reduced_table

TOUCH = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))


def bayes_estimator(design) -> Estimator:
    return BayesEstimator(design, reduced_table(design))


def network_estimator(design) -> Estimator:
    return NetworkEstimator(design, tiny_network(design, drag=0.4))


@pytest.fixture(
    params=[ClosedFormEstimator, bayes_estimator, network_estimator], ids=lambda make: make.__name__
)
def make(request, planar) -> Callable[[], Estimator]:
    return lambda: request.param(planar)


def spoilt(reading: Reading, **changes: object) -> Reading:
    values = {name: getattr(reading, name) for name in ("time", "field", "temperature", "flags")}
    return Reading(**(values | changes))


def test_every_estimate_carries_its_readings_time_and_fits_itself(make, planar):
    twin, estimator = ReducedTwin(planar, seed=0), make()
    for k in range(40):
        estimate = estimator.step(twin.read([TOUCH] if k % 2 else [], time=0.1 * k))
        assert isinstance(estimate, Estimate)
        assert estimate.time == 0.1 * k
        assert estimate.status is (Status.CONTACT if k % 2 else Status.NO_CONTACT)
        assert len(estimate.contacts) == k % 2
        for spread in estimate.covariance:
            known = spread[np.isfinite(spread).all(axis=1)][:, np.isfinite(spread).all(axis=1)]
            assert np.all(np.linalg.eigvalsh(known) >= 0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, -1e300])
def test_no_field_makes_it_raise(make, planar, value):
    twin = ReducedTwin(planar, seed=0)
    for s in range(3):
        for axis in range(3):
            field = twin.read([TOUCH]).field.copy()
            field[s, axis] = value
            estimate = make().step(spoilt(twin.read(), field=field))
            assert estimate.status not in (Status.CONTACT, Status.NO_CONTACT)
            assert estimate.contacts == ()


def test_zero_fields_are_no_touch_to_believe(make):
    estimate = make().step(Reading(time=0.0, field=np.zeros((3, 3))))
    assert estimate.status not in (Status.CONTACT, Status.NO_CONTACT)


@pytest.mark.parametrize(
    ("flag", "status"),
    [
        (ChipFlag.MISSING, Status.CHIP_MISSING),
        (ChipFlag.INVALID, Status.CHIP_MISSING),
        (ChipFlag.SATURATED, Status.SATURATED),
        (ChipFlag.WRAPPED, Status.SATURATED),
    ],
)
@pytest.mark.parametrize("chip", [0, 1, 2])
def test_a_bad_chip_is_named_by_the_status(make, planar, chip, flag, status):
    flags = np.zeros(3, dtype=int)
    flags[chip] = flag
    estimate = make().step(spoilt(ReducedTwin(planar).read([TOUCH]), flags=flags))
    assert estimate.status is status
    assert estimate.contacts == ()


def test_it_recovers_after_bad_readings(make, planar):
    twin, estimator = ReducedTwin(planar, seed=0), make()
    assert estimator.step(twin.read([TOUCH], time=0.0)).status is Status.CONTACT
    estimator.step(spoilt(twin.read(), time=0.1, field=np.full((3, 3), np.nan)))
    estimator.step(spoilt(twin.read(), time=0.2, flags=[1, 0, 0]))
    assert estimator.step(twin.read([TOUCH], time=0.3)).status is Status.CONTACT


def test_shuffled_time_is_stale_and_reset_forgets_it(make, planar):
    twin, estimator = ReducedTwin(planar, seed=0), make()
    estimator.step(twin.read(time=5.0))
    assert estimator.step(twin.read([TOUCH], time=4.0)).status is Status.STALE
    estimator.reset()
    assert estimator.step(twin.read([TOUCH], time=4.0)).status is Status.CONTACT


@pytest.mark.parametrize("chips", [0, 1, 2, 4, 5])
def test_another_number_of_chips_is_wrong_use(make, chips):
    with pytest.raises(ArgumentError, match=f"got {chips}"):
        make().step(Reading(time=0.0, field=np.zeros((chips, 3))))
