"""What every estimator must do, whatever is inside it, on a flat skin and round a forearm."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from networks import tiny_network
from skins import unlike_a_turn
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.mechanics.viscoelasticity import ELASTIC, elastomer_prony
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, LearnedModel, Output
from smoskin.sensing.learned.inputs import Encoding, Form
from smoskin.sensing.learned.training import Examples, FittingEffort, train_model
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import reduced_table

TOUCH = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))


def at_rest(design) -> Reading:
    return ReducedTwin(design, seed=None).read()


def zeroed(estimator: Estimator, design) -> Estimator:
    estimator.zero([at_rest(design)])
    return estimator


def bayes_estimator(design) -> Estimator:
    return zeroed(BayesEstimator(design, reduced_table(design), creep=ELASTIC), design)


def network_estimator(design) -> Estimator:
    return zeroed(NetworkEstimator(design, tiny_network(design, drag=0.4), creep=ELASTIC), design)


@cache
def learned_model(design) -> LearnedModel:
    """A Gaussian process of a few presses near `TOUCH`."""
    twin, rng = ReducedTwin(design, seed=1), np.random.default_rng(1)
    targets = np.stack([*rng.uniform([0.04, 0.055], [0.06, 0.075], (40, 2)).T,
                        -rng.uniform(0.3, 0.7, 40)], axis=1)  # fmt: skip
    field = [twin.read([Contact(position=row[:2], force=(0, 0, row[2]))]).field for row in targets]
    examples = Examples(
        time=np.arange(40.0),
        field=np.stack(field) - ReducedTwin(design, seed=None).read().field,
        targets=targets,
        outputs=(Output.X, Output.Y, Output.FZ),
        group=np.arange(40),
        run=np.zeros(40, dtype=int),
    )
    encoding = Encoding(chips=tuple(range(len(design.halls))), form=Form.DIRECTION)
    return train_model(examples, encoding, effort=FittingEffort(iterations=3))


def learned_estimator(design) -> Estimator:
    return LearnedEstimator(learned_model(design), ReducedTwin(design, seed=None).read().field)


ESTIMATORS = [ClosedFormEstimator, bayes_estimator, network_estimator, learned_estimator]


def both(estimators):
    """A test that is asked of both designs each time, but for networks, which must be trained."""
    cases = [
        pytest.param(make, name, marks=pytest.mark.slow if slow else ())
        for make in estimators
        for name in ("planar", "curved")
        for slow in [name == "curved" and make is network_estimator]
    ]
    return pytest.mark.parametrize(("make", "design"), cases, indirect=True)


@pytest.fixture(params=ESTIMATORS, ids=lambda make: make.__name__)
def make(request, design) -> Callable[[], Estimator]:
    return lambda: request.param(design)


def to_chips(design, signals):
    """Fields (..., 3) along the local axes at chips, in the chips' own."""
    turned = np.broadcast_to(signals, (len(design.halls), 3))
    return np.einsum("sji,sj->si", mlx90393.rotations(design.halls), turned)


def earth_at(design, field):
    """A field (3,) that is the same everywhere, in the axes of each chip, (S, 3)."""
    return to_chips(design, np.einsum("sji,j->si", geometry(design).chip_axes, field))


def of_one(design, value, others=0, chip=1):
    """A number of each chip, one of which is another."""
    numbers = [others] * len(design.halls)
    numbers[chip] = value
    return numbers


def spoilt(reading: Reading, **changes: object) -> Reading:
    values = {name: getattr(reading, name) for name in ("time", "field", "temperature", "flags")}
    return Reading(**(values | changes))


@both(ESTIMATORS)
def test_every_estimate_carries_its_readings_time_and_fits_itself(make, design):
    twin, estimator = ReducedTwin(design, seed=0), make()
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
def test_no_field_makes_it_raise(make, design, value):
    twin = ReducedTwin(design, seed=0)
    for s in range(len(design.halls)):
        for axis in range(3):
            field = twin.read([TOUCH]).field.copy()
            field[s, axis] = value
            estimate = make().step(spoilt(twin.read(), field=field))
            assert estimate.status not in (Status.CONTACT, Status.NO_CONTACT)
            assert estimate.contacts == ()


def test_zero_fields_are_no_touch_to_believe(make, design):
    estimate = make().step(Reading(time=0.0, field=np.zeros((len(design.halls), 3))))
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
@pytest.mark.parametrize("chip", [0, 1, -1])
def test_a_bad_chip_is_named_by_the_status(make, design, chip, flag, status):
    flags = of_one(design, flag, chip=chip)
    estimate = make().step(spoilt(ReducedTwin(design).read([TOUCH]), flags=flags))
    assert estimate.status is status
    assert estimate.contacts == ()


def test_it_recovers_after_bad_readings(make, design):
    twin, estimator = ReducedTwin(design, seed=0), make()
    assert estimator.step(twin.read([TOUCH], time=0.0)).status is Status.CONTACT
    estimator.step(spoilt(twin.read(), time=0.1, field=np.full((len(design.halls), 3), np.nan)))
    estimator.step(spoilt(twin.read(), time=0.2, flags=of_one(design, 1)))
    assert estimator.step(twin.read([TOUCH], time=0.3)).status is Status.CONTACT


def test_shuffled_time_is_stale_and_reset_forgets_it(make, design):
    twin, estimator = ReducedTwin(design, seed=0), make()
    estimator.step(twin.read(time=5.0))
    assert estimator.step(twin.read([TOUCH], time=4.0)).status is Status.STALE
    zeroed(estimator, design)
    assert estimator.step(twin.read([TOUCH], time=4.0)).status is Status.STALE
    estimator.reset()
    zeroed(estimator, design)
    assert estimator.step(twin.read([TOUCH], time=4.0)).status is Status.CONTACT


@both(ESTIMATORS)
def test_the_zero_takes_an_offset_off_and_tells_no_drift(make, design):
    twin, plain, moved = ReducedTwin(design, seed=None), make(), make()
    offset = 1e-6 * np.arange(3.0 * len(design.halls)).reshape(-1, 3)
    shifted = [spoilt(twin.read(time=0.1 * k), field=twin.read().field + offset) for k in range(9)]
    plain.zero([twin.read(time=0.1 * k) for k in range(9)])
    moved.zero([*shifted, spoilt(twin.read(), flags=of_one(design, 1))])
    touched = twin.read([TOUCH], time=1.0)
    expected = plain.step(touched)
    answer = moved.step(spoilt(touched, field=touched.field + offset))
    assert expected.status is answer.status is Status.CONTACT
    for name in ("position", "force"):
        there, here = (getattr(estimate.contacts[0], name) for estimate in (expected, answer))
        # From the untouched field theory reads where magnets rest too, to some nanometres.
        rtol, atol = (3e-4, 1e-8) if isinstance(moved, ClosedFormEstimator) else (1e-6, 1e-8)
        np.testing.assert_allclose(there, here, rtol=rtol, atol=atol)
    assert moved.drift.shape == offset.shape
    assert not moved.drift.any()
    moved.reset()
    other = moved.step(spoilt(touched, field=touched.field + offset))
    assert other != answer


def test_a_zero_needs_a_good_reading_of_the_same_chips(make, design):
    twin, estimator = ReducedTwin(design, seed=None), make()
    for unusable in ([], [spoilt(twin.read(), flags=of_one(design, 1))]):
        with pytest.raises(ArgumentError, match=f"readings must .*got {len(unusable)} readings"):
            estimator.zero(unusable)
    with pytest.raises(ArgumentError, match="got 5"):
        estimator.zero([twin.read(), Reading(time=0.0, field=np.zeros((5, 3)))])
    assert estimator.step(twin.read([TOUCH])).status is Status.CONTACT


def touched_and(design, **changes):
    """An estimator's answer to a touch of which something is changed."""
    return spoilt(ReducedTwin(design, seed=None).read([TOUCH], time=1.0), **changes)


@pytest.mark.parametrize("degrees", [1e9, -273.0, 130.0, -41.0, 41.0])
def test_no_touch_is_told_by_a_chip_whose_temperature_cannot_be(make, design, degrees):
    estimate = make().step(touched_and(design, temperature=of_one(design, degrees, 25.0)))
    assert estimate.status is Status.CHIP_MISSING


def test_a_temperature_does_not_jump(make, design):
    estimator = make()
    for k, (degrees, status) in enumerate(
        [(25.0, Status.CONTACT), (31.0, Status.CHIP_MISSING), (25.4, Status.CONTACT)]
    ):
        reading = touched_and(design, time=0.1 * k, temperature=of_one(design, degrees, 25.0))
        assert estimator.step(reading).status is status


@pytest.mark.parametrize("flag", [32, 4096, -1])
def test_a_flag_that_nobody_knows_is_bad(make, design, flag):
    assert (
        make().step(touched_and(design, flags=of_one(design, flag))).status is Status.CHIP_MISSING
    )


@both(ESTIMATORS)
def test_a_chip_that_freezes_is_missed_once_the_others_move(make, design):
    twin, estimator, still = ReducedTwin(design, seed=0), make(), at_rest(design).field[1]
    for k in range(30):
        reading = twin.read([TOUCH] if k >= 20 else [], time=0.1 * k)
        field = reading.field.copy()
        field[1] = still
        status = estimator.step(spoilt(reading, field=field)).status
        assert status is (Status.CHIP_MISSING if k >= 20 else Status.NO_CONTACT)
    assert estimator.step(twin.read([TOUCH], time=3.0)).status is Status.CONTACT


@pytest.mark.parametrize("make", ESTIMATORS[:3])
def test_a_chip_at_its_rail_is_saturated_without_a_flag(make, design):
    for axis in range(3):
        field = at_rest(design).field.copy()
        field[-1, axis] = mlx90393.full_scale(design.hall_setting)[axis]
        assert make(design).step(touched_and(design, field=field)).status is Status.SATURATED


@pytest.mark.parametrize("start", [5.0, 1e9, 1e300])
def test_a_clock_that_starts_again_is_followed_after_one_reading(make, design, start):
    twin, estimator = ReducedTwin(design, seed=None), make()
    for time, status in (
        (start - 1.0, Status.NO_CONTACT),
        (start, Status.CONTACT if start < 1e300 else Status.STALE),
        (0.1, Status.STALE),
        (0.2, Status.NO_CONTACT),
        (0.3, Status.CONTACT),
        (0.1, Status.STALE),
        (0.4, Status.CONTACT),
    ):
        contacts = [TOUCH] if status is Status.CONTACT else []
        assert estimator.step(twin.read(contacts, time=time)).status is status


def test_a_zero_is_not_taken_of_a_touch_and_can_be_taken_back(make, design):
    twin, estimator = ReducedTwin(design, seed=0), make()
    still = [twin.read(time=0.01 * k) for k in range(20)]
    held = [twin.read([TOUCH], time=0.01 * k) for k in range(20)]
    estimator.zero(still, force=True)
    for readings in (held, still[:10] + held[:10]):
        with pytest.raises(ArgumentError, match="nothing touches: let go first; got"):
            estimator.zero(readings)
    assert estimator.step(twin.read(time=1.0)).status is Status.NO_CONTACT
    estimator.zero(held, force=True)
    assert estimator.step(twin.read([TOUCH], time=2.0)).status is Status.NO_CONTACT
    estimator.unzero()
    assert estimator.step(twin.read([TOUCH], time=3.0)).status is Status.CONTACT
    with pytest.raises(ArgumentError, match="zero must have been set"):
        estimator.unzero()


@pytest.mark.parametrize("make", ESTIMATORS)
def test_the_first_zero_waits_until_the_skin_rests(make, design):
    twin, estimator = ReducedTwin(design, seed=0), ZeroFirst(make(design), count=5)
    for k in range(12):
        force = (0.0, 0.0, -0.1 - 0.05 * k)
        moving = [Contact(position=TOUCH.position, force=force)]
        status = estimator.step(twin.read(moving, time=0.1 * k)).status
        assert status is Status.NOT_CALIBRATED
    for k in range(12, 18):
        status = estimator.step(twin.read(time=0.1 * k)).status
    assert status is Status.NO_CONTACT
    assert estimator.step(twin.read([TOUCH], time=3.0)).status is Status.CONTACT


@pytest.mark.parametrize("kind", ["bayes", "network"])
def test_without_a_zero_nothing_is_told(kind, design):
    made = {"bayes": BayesEstimator(design, reduced_table(design)),
            "network": NetworkEstimator(design, tiny_network(design))}[kind]  # fmt: skip
    twin = ReducedTwin(design, seed=0)
    for contacts in ([], [TOUCH]):
        reading = twin.read(contacts, time=float(len(contacts)))
        assert made.step(reading).status is Status.NOT_CALIBRATED


@both(ESTIMATORS[:3])
@pytest.mark.parametrize("field", [20e-6, 40e-6, 60e-6])
def test_a_skin_that_turns_in_the_earths_field_is_not_touched(make, design, field):
    twin, rng = ReducedTwin(design, seed=1), np.random.default_rng(0)
    estimator = zeroed(make(), design)
    still = [twin.read() for _ in range(20)]
    for k in range(400):
        if k % 40 == 0:
            way = rng.normal(size=3)
            earth = earth_at(design, field * way / np.linalg.norm(way))
        reading = spoilt(still[k % 20], time=0.01 * k, field=still[k % 20].field + earth)
        assert estimator.step(reading).status is Status.NO_CONTACT


def test_no_reading_is_wrong_use(make):
    for reading in (None, "reading", np.zeros((3, 3))):
        with pytest.raises(ArgumentError, match="reading must be a Reading; got"):
            make().step(reading)


@pytest.mark.parametrize("make", [bayes_estimator, network_estimator])
def test_by_default_one_in_a_million_idle_readings_counts_as_touched(make, design):
    rest, change = ReducedTwin(design, seed=None).read(), unlike_a_turn(design)
    limit = chi2.isf(1e-6, 3 * len(design.halls))
    for share, idle in ((0.99, True), (1.03, False)):
        estimator = make(design)
        estimator.zero([rest])
        own = to_chips(design, (change * np.sqrt(share * limit)).reshape(-1, 3))
        status = estimator.step(spoilt(rest, time=1.0, field=rest.field + own)).status
        assert (status is Status.NO_CONTACT) == idle


@pytest.mark.parametrize("kind", ["bayes", "network"])
def test_by_default_creep_is_undone_and_drift_followed(kind, design):
    """A press that comes at once shows the prompt share of what it settles at."""
    made = {
        "bayes": lambda **o: BayesEstimator(design, reduced_table(design), **o),
        "network": lambda **o: NetworkEstimator(design, tiny_network(design, drag=0.4), **o),
    }[kind]
    twin, forces = ReducedTwin(design, seed=None), []
    for options in ({}, {"creep": ELASTIC}):
        estimator = made(**options)
        estimator.zero([twin.read()])
        estimator.step(twin.read(time=1.0))
        forces.append(estimator.step(twin.read([TOUCH], time=1.001)).contacts[0].normal_force)
    late = elastomer_prony(design.columns.material).retardation_shares.sum()
    assert forces[0] / forces[1] == pytest.approx(1 / (1 - late), rel=0.03)
    estimator = zeroed(made(), design)
    for k in range(50):
        reading = twin.read(time=0.1 * k)
        estimator.step(spoilt(reading, field=reading.field + 1e-6))
    assert np.abs(estimator.drift).min() > 0.3e-6


@pytest.mark.parametrize("other", range(5))
def test_another_number_of_chips_is_wrong_use(make, design, other):
    chips = other + (other >= len(design.halls))
    with pytest.raises(ArgumentError, match=f"got {chips}"):
        make().step(Reading(time=0.0, field=np.zeros((chips, 3))))
