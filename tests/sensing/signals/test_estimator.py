"""What estimators on signals share, by one that only counts: touched or not, and its zero."""

import numpy as np
import pytest
from scipy.stats import chi2

from skins import unlike_a_turn
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.mechanics.viscoelasticity import ELASTIC, Prony, elastomer_prony
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.sensing.signals.estimator import FOLLOWING, SignalEstimator
from smoskin.sensing.signals.signals import Signals, signal_noise
from smoskin.sensing.signals.zero import ZeroTracking
from smoskin.twin.reduced import ReducedTwin


class Counting(SignalEstimator):
    """Keeps the signals of touched readings; forgotten counts how often nothing touched."""

    def __init__(self, design, chips=(0, 1, 2), **options):
        given = {"creep": ELASTIC, "false_alarms": 1e-6, "tracking": None, "zeroed": True}
        given |= options
        super().__init__(design, chips, **given)
        self.forgotten, self.read = 0, []

    def _forget(self):
        self.forgotten += 1

    def _read(self, time, signals, temperature):
        self.read.append((signals, temperature))
        contact = Contact(position=(0.0, 0.0), force=(0.0, 0.0, -1.0))
        return Estimate(
            time=time, status=Status.CONTACT, contacts=(contact,), covariance=np.zeros((1, 5, 5))
        )


@pytest.fixture
def rest(planar):
    return ReducedTwin(planar, seed=None).read()


def raised(design, rest, time, signals) -> Reading:
    """The skin at rest and these signals, (3, 3), T."""
    boards = mlx90393.rotations(design.halls)
    own = np.einsum("sji,sj->si", boards, signals)
    return Reading(time=time, field=rest.field + own, temperature=rest.temperature)


@pytest.mark.parametrize("chips", [(0, 1, 2), (1, 2)])
def test_a_skin_counts_as_touched_past_the_quantile_of_its_noise(planar, rest, chips):
    change, limit = unlike_a_turn(planar, chips), chi2.isf(1e-6, 3 * len(chips))
    for share, status in ((0.99, Status.NO_CONTACT), (1.03, Status.CONTACT)):
        for sign in (-1, 1):
            signals = np.zeros((3, 3))
            signals[list(chips)] = (sign * np.sqrt(share * limit) * change).reshape(-1, 3)
            estimator = Counting(planar, chips)
            estimator.zero([rest])
            assert estimator.step(raised(planar, rest, 1.0, signals)).status is status


def test_the_signals_of_the_chips_that_are_read_come_in_their_order(planar, rest):
    estimator = Counting(planar, (2, 0))
    estimator.zero([rest])
    signals = 1e-4 * np.arange(1.0, 10.0).reshape(3, 3)
    estimator.step(raised(planar, rest, 1.0, signals))
    values, temperature = estimator.read[0]
    np.testing.assert_allclose(values, 1e-4 * np.array([7, 8, 9, 1, 2, 3]), atol=1e-9)
    assert temperature == 25.0


def test_untouched_readings_are_touched_no_more_often_than_chosen(planar):
    twin = ReducedTwin(planar, seed=5)
    still = [twin.read(time=0.01 * k) for k in range(500)]
    for rate, most in ((0.9, 380), (0.2, 110), (1e-6, 0)):
        estimator = Counting(planar, false_alarms=rate)
        estimator.zero(still[:100])
        touched = sum(estimator.step(r).status is Status.CONTACT for r in still[100:])
        assert touched <= most
        assert estimator.forgotten == 401 - touched


def test_by_default_creep_of_the_columns_is_undone_and_drift_followed(planar, rest):
    estimator = Counting(planar, creep=None)
    np.testing.assert_array_equal(
        estimator.creep.times, elastomer_prony(planar.columns.material).times
    )
    assert Counting(planar, creep=ELASTIC).creep is ELASTIC
    prony = Prony(moduli=[0.2], times=[1.0])
    touch = 1e-4 * np.array([[1.0], [2.0], [1.0]]) * np.ones(3)
    sizes = []
    for creep in (prony, ELASTIC):
        counting = Counting(planar, creep=creep)
        counting.zero([rest])
        counting.step(raised(planar, rest, 1.0, np.zeros((3, 3))))
        counting.step(raised(planar, rest, 1.0 + 1e-6, touch))
        sizes.append(counting.read[0][0].mean())
    # At once four fifths of a step show; what shows is a step that much larger.
    assert sizes[0] / sizes[1] == pytest.approx(1 / 0.8, rel=0.01)
    for k in range(400):
        estimator.step(raised(planar, rest, 0.1 * k, np.full((3, 3), 2e-9 * k)))
    assert estimator.drift.min() > 0.7e-6
    known = (FOLLOWING.hold, FOLLOWING.time_constant, FOLLOWING.drift_bound)
    assert known == (0.2, 2.0, 500e-6)
    assert (FOLLOWING.widening_rate, FOLLOWING.widening_limit) == (0.1e-6, 10e-6)


@pytest.mark.parametrize("creep", [ELASTIC, Prony(moduli=[0.2, 0.2], times=[0.3, 5.0])])
def test_its_noise_is_that_of_signals_with_creep_undone(planar, rest, creep):
    rng = np.random.default_rng(4)
    factor = np.linalg.cholesky(signal_noise(planar))
    estimator, seen, read = Counting(planar, creep=creep), Signals(planar, creep=creep), []
    for k in range(1, 2001):
        noise = (factor @ rng.normal(size=9)).reshape(3, 3)
        read.append(seen.step(raised(planar, rest, 0.01 * k, noise)).values.ravel())
    lengths = np.einsum("kc,cd,kd->k", read, np.linalg.inv(estimator.noise), read)
    assert lengths.mean() == pytest.approx(9, rel=0.05)


def test_after_a_touch_idleness_holds_anew(planar, rest):
    """The zero stays until the skin has been idle for `hold` after the touch."""
    estimator = Counting(planar, tracking=ZeroTracking(hold=1.0, time_constant=0.1))
    faint, touch = np.full((3, 3), 1e-6), np.full((3, 3), 1e-3)
    estimator.zero([rest])
    for k in range(9):
        estimator.step(raised(planar, rest, 0.1 * k, faint))
    assert estimator.step(raised(planar, rest, 0.9, touch)).status is Status.CONTACT
    for k in range(10, 20):
        assert estimator.step(raised(planar, rest, 0.1 * k, faint)).status is Status.NO_CONTACT
        assert not estimator.drift.any()
    estimator.step(raised(planar, rest, 2.05, faint))
    assert (estimator.drift > 0).all()


def test_past_its_bound_the_zero_is_not_believed(planar, rest):
    """What a turn by some radians explains is within it, whatever it is."""
    tracking = ZeroTracking(hold=0.0, time_constant=0.05, drift_bound=10e-6, arm=True)
    change = unlike_a_turn(planar, weight=True)
    step = 1e-6 * change.reshape(3, 3) / np.abs(change).max()
    bounds = {}
    for way in (step, np.tile([1e-6, 0.0, 0.0], (3, 1))):
        estimator = Counting(planar, tracking=tracking)
        for k in range(2000):
            status = estimator.step(raised(planar, rest, 0.01 * k, k * (way + 1e-10))).status
            if status is not Status.NO_CONTACT:
                break
        bounds[way[1, 0]] = np.abs(estimator.drift).max()
        assert status is Status.NOT_CALIBRATED or bounds[way[1, 0]] > 500e-6
        estimator.reset()
        assert not estimator.drift.any()
        still = raised(planar, rest, 0.0, np.zeros((3, 3)))
        assert estimator.step(still).status is Status.NO_CONTACT
    assert bounds[1e-6] > 500e-6


def test_a_zero_that_moved_under_a_long_touch_is_found_again(planar, rest):
    """20 s of touch let it move 20 uT unseen where it may; by default 2 uT."""
    change = unlike_a_turn(planar).reshape(3, 3)
    moved, touch = 12 * change, np.diag([1e-3, -1e-3, 1e-3])
    fast = ZeroTracking(hold=0.1, time_constant=1.0, widening_rate=1e-6, widening_limit=20e-6)
    ends = {}
    for tracking in (None, fast):
        estimator = Counting(planar, tracking=tracking)
        estimator.zero([rest])
        for k in range(200):
            estimator.step(raised(planar, rest, 0.1 * k, touch))
        ends[tracking] = [
            estimator.step(raised(planar, rest, 20.0 + 0.1 * k, moved)).status for k in range(100)
        ]
    assert set(ends[fast]) == {Status.NO_CONTACT}
    assert ends[None][0] is Status.CONTACT
    assert estimator.drift == pytest.approx(moved, abs=1e-6)


def test_the_chance_of_false_alarms_is_one(planar):
    for chance in (0.0, 1.0):
        with pytest.raises(ArgumentError, match=r"false_alarms must lie in \(0, 1\)"):
            Counting(planar, false_alarms=chance)


def test_by_default_the_zero_follows_after_02_s_and_with_2_s():
    assert (
        ZeroTracking(hold=0.2, time_constant=2.0, widening_rate=0.1e-6, widening_limit=10e-6)
        == FOLLOWING
    )


class Placed(Counting):
    """Finds one touch, wherever it is told to."""

    contact = Contact(position=(0.0, 0.0), force=(0.0, 0.0, -1.0))

    def _read(self, time, signals, temperature):
        return Estimate(
            time=time,
            status=Status.CONTACT,
            contacts=(self.contact,),
            covariance=np.zeros((1, 5, 5)),
        )


@pytest.mark.parametrize(
    ("beyond", "force", "believed"),
    [
        (4.9e-3, (0.0, 0.0, -1.0), True),
        (5.1e-3, (0.0, 0.0, -1.0), False),
        (0.0, (0.0, 0.0, -1.24), True),
        (0.0, (0.0, 0.0, -1.26), False),
        (0.0, (1.24, -1.24, -1.24), True),
        (0.0, (-1.26, 0.0, -0.1), False),
    ],
)
@pytest.mark.parametrize("side", [(-1, 0), (0, -1), (1, 0), (0, 1)])
def test_touches_5_mm_off_the_skin_or_a_quarter_past_the_known_forces_are_not_believed(
    planar, rest, side, beyond, force, believed
):
    estimator = Placed(planar, most=1.0)
    estimator.zero([rest])
    middle = geometry(planar).extent / 2
    place = middle + np.array(side) * (middle + beyond)
    estimator.contact = Contact(position=place, force=force)
    estimate = estimator.step(raised(planar, rest, 1.0, np.diag([1e-3, -1e-3, 0.5e-3])))
    assert estimate.status is (Status.CONTACT if believed else Status.OUT_OF_RANGE)


@pytest.mark.parametrize(("change", "refused"), [(59e-6, False), (61e-6, True)])
def test_a_zero_may_drift_by_60_ut_whatever_it_looks_like(planar, rest, change, refused):
    estimator = Counting(planar)
    estimator.zero([rest])
    # What all chips see alike does not count.
    moved = raised(planar, rest, 1.0, np.outer([change, 0, -change], [1, 0, 0]) + 30e-6)
    if refused:
        with pytest.raises(ArgumentError, match="got what reads as a touch"):
            estimator.zero([moved])
    estimator.zero([moved], force=refused)
