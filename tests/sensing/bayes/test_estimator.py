"""The Bayesian estimator on the reduced model's skin: touches, their number, drift and creep."""

import numpy as np
import pytest

from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.records import Contact, Status
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import plain, reduced_table

TOUCH = Contact(position=(0.05, 0.0667), force=(0.1, -0.05, -0.5))


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


def estimator(skin, **options):
    return BayesEstimator(skin, reduced_table(skin), **({"creep": ELASTIC} | options))


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


def test_two_chips_are_enough_for_a_straight_touch(skin):
    table = reduced_table(skin).of_chips((1, 2))
    said = BayesEstimator(skin, table, priors=TouchPriors(drag_spread=0.0), creep=ELASTIC)
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
