"""The Bayesian estimator on the reduced model's skin: touches, their number, drift and creep."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.viscoelasticity import Memory, Prony
from smoskin.records import Contact, Reading, Status
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.signals.conditioning import ZeroTracking
from smoskin.sensing.signals.signals import Settling, Signals, signal_noise
from smoskin.twin.readout import Motion, Readout
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import plain, reduced_table

TOUCH = Contact(position=(0.05, 0.0667), force=(0.1, -0.05, -0.5))


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def estimator(skin, **options):
    return BayesEstimator(skin, reduced_table(skin), **options)


def test_it_finds_place_force_and_drag(skin):
    twin, said = ReducedTwin(skin, seed=0), estimator(skin)
    rng = np.random.default_rng(3)
    for k in range(30):
        place = rng.uniform([0.02, 0.03], [0.10, 0.13])
        force = np.array([*rng.uniform(-0.2, 0.2, 2), -rng.uniform(0.3, 1.0)])
        twin_reading = twin.read([Contact(position=place, force=force)], time=float(k))
        estimate = said.step(twin_reading)
        assert estimate.status is Status.CONTACT
        assert len(estimate.contacts) == 1
        values = np.concatenate([estimate.contacts[0].position, estimate.contacts[0].force])
        error = values - np.concatenate([place, force])
        spread = np.sqrt(np.diag(estimate.covariance[0]))
        assert (np.abs(error) < 6 * spread).all()
        assert np.abs(error[4]) < 0.05 * -force[2]


def test_the_first_guess_does_not_decide(skin):
    table = reduced_table(skin)
    solver = TouchSolver(table, signal_noise(skin))
    place, force = np.array([0.081, 0.052]), np.array([0.05, 0.0, -0.6])
    exact = table.signals(place[None], force[None])[0]
    free = solver.one(exact)
    for guess in ([0.08, 0.05, 0.0, 0.0, -0.5], [0.02, 0.14, 0.3, 0.3, -0.1]):
        led = solver.one(exact, np.array(guess))
        assert led.values[0] == pytest.approx(free.values[0], abs=2e-5)
    assert free.values[0, :2] == pytest.approx(place, abs=1e-4)
    assert free.values[0, 2:] == pytest.approx(force, abs=2e-3)


def test_places_on_the_rim_are_told(skin):
    table = reduced_table(skin)
    solver = TouchSolver(table, signal_noise(skin), TouchPriors(drag_spread=0.0))
    for place in ([0.002, 0.08], [0.118, 0.003]):
        exact = table.signals([place], [[0.0, 0.0, -0.5]])[0]
        assert solver.one(exact).values[0, :2] == pytest.approx(place, abs=1e-4)


def test_how_many_touches_there_are(skin):
    table = reduced_table(skin)
    noise = signal_noise(skin)
    solver = TouchSolver(table, noise, TouchPriors(drag_spread=0.0))
    rng = np.random.default_rng(8)
    one = table.signals([[0.045, 0.06]], [[0.0, 0.0, -0.6]])[0]
    where = np.array([[[0.033, 0.05], [0.085, 0.11]]])
    push = np.array([[[0.0, 0.0, -0.5], [0.0, 0.0, -0.7]]])
    two = table.together(where, push)[0]
    for _ in range(5):
        noisy = rng.multivariate_normal(np.zeros(9), noise)
        calm = solver.silence(noisy)[1]
        assert calm > solver.one(noisy).evidence
        said = one + noisy
        assert solver.one(said).evidence > max(solver.two(said).evidence, solver.silence(said)[1])
        said = two + noisy
        assert solver.two(said).evidence > solver.one(said).evidence
    # Nine signals of six unknowns: what was put in must at least be explained.
    assert solver.two(two).misfit < 9


def test_untouched_readings_are_no_contact_at_the_chosen_rate(skin):
    twin = ReducedTwin(skin, seed=5)
    strict, loose = estimator(skin), estimator(skin, false_alarms=0.2)
    still = [twin.read(time=0.01 * k) for k in range(400)]
    counts = []
    for one in (strict, loose):
        one.zero(still[:100])
        counts.append(sum(one.step(r).status is Status.CONTACT for r in still[100:]))
    assert counts[0] == 0
    assert 10 < counts[1] < 110


def test_the_zero_follows_drift_up_to_a_bound(skin):
    twin = ReducedTwin(skin, seed=6)
    tracking = ZeroTracking(hold=0.05, time_constant=0.2, drift_bound=10e-6)
    said = estimator(skin, tracking=tracking)
    seen = []
    for k in range(900):
        reading = twin.read(time=0.01 * k)
        field = reading.field + 0.02e-6 * k * np.array([1.0, 0.0, 0.0])
        seen.append(said.step(Reading(time=reading.time, field=field)).status)
    assert seen[300] is Status.NO_CONTACT
    assert np.abs(said.drift).max() > 10e-6
    assert seen[-1] is Status.NOT_CALIBRATED
    said.reset()
    assert said.step(twin.read(time=0.0)).status is Status.NO_CONTACT


@pytest.mark.parametrize("seed", range(3))
def test_settling_undoes_creep(seed):
    rng = np.random.default_rng(seed)
    prony = Prony(moduli=[0.05, 0.1], times=[0.1, 3.0])
    memory, settling = Memory(prony, np.zeros(4)), Settling(prony)
    for duration in rng.uniform(0, 1, 50):
        elastic = rng.normal(size=4)
        crept = memory.step(duration, elastic)
        assert settling.step(duration, crept) == pytest.approx(elastic)
    settling.reset()
    assert settling.step(1.0, np.zeros(4)) == pytest.approx(np.zeros(4))


def test_creeping_touches_read_as_settled(skin):
    """Motions creep; the fields that they make are freed of it, though not linear in them."""
    prony = Prony(moduli=[0.1], times=[1.0])
    exact, readout = ReducedTwin(skin, seed=None), Readout(skin)
    pressed, rest = exact.motion([TOUCH]), exact.motion([])
    magnets, board = Memory(prony, rest.magnets), Memory(prony, rest.board)
    creeping, plain = Signals(skin, creep=prony), Signals(skin)
    for one in (creeping, plain):
        one.zero([exact.read(time=-1.0)])
    for k in range(1, 30):
        held = pressed if k > 5 else rest
        moved = Motion(
            magnets=magnets.step(0.02, held.magnets),
            board=board.step(0.02, held.board),
            valid=held.valid,
        )
        reading = readout.read(moved, None, time=0.02 * k)
        last = [one.step(reading).values for one in (creeping, plain)]
    settled = plain.step(exact.read([TOUCH], time=1.0)).values
    undone, left = (np.abs(values - settled).max() for values in last)
    assert left > 0.01 * np.abs(settled).max()
    assert undone < 0.03 * left


def test_two_chips_are_enough_for_a_straight_touch(skin):
    table = reduced_table(skin).of_chips((1, 2))
    said = BayesEstimator(skin, table, priors=TouchPriors(drag_spread=0.0))
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    estimate = said.step(ReducedTwin(skin, seed=0).read([touch]))
    assert estimate.contacts[0].position == pytest.approx(touch.position, abs=2e-3)
    assert estimate.contacts[0].normal_force == pytest.approx(0.5, rel=0.02)


def test_wrong_use_is_refused(skin, long_planar):
    with pytest.raises(ModelError, match="table must be of the design '4x5'"):
        BayesEstimator(long_planar, reduced_table(skin))
    with pytest.raises(ArgumentError, match="false_alarms must lie in"):
        estimator(skin, false_alarms=0.0)
    with pytest.raises(ArgumentError, match="drag_spread must be finite"):
        TouchPriors(drag_spread=-1.0)
    with pytest.raises(ArgumentError, match="slide must be positive"):
        TouchPriors(slide=0.0)
    with pytest.raises(ArgumentError, match="chances must add up to 1"):
        TouchPriors(chances=(0.5, 0.5, 0.5))
