"""The Bayesian estimator: touches of the reduced model's skin, and what decides their number."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from skins import unlike_a_turn
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.nonlinearity import field_curvature, straightened
from smoskin.mechanics.viscoelasticity import ELASTIC, Prony, elastomer_prony
from smoskin.origami.geometry import middles_of_fields
from smoskin.records import Contact, Reading, Status
from smoskin.sensing.bayes.estimator import BayesEstimator, LoneTouch
from smoskin.sensing.bayes.priors import TouchPosterior, TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.response.fit import table_curvature
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.estimator import ON_AN_ARM
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import reduced_table

STRAIGHT = TouchPriors(drag_spread=0.0)
WHERE = np.array([[0.033, 0.05], [0.085, 0.11]])
FORCE = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, -0.7]])


@pytest.fixture(scope="module")
def table(skin):
    known = reduced_table(skin)
    return replace(known, curvature=table_curvature(known))


def estimator(skin, table=None, **options):
    bayes = BayesEstimator(skin, table or reduced_table(skin), **({"creep": ELASTIC} | options))
    bayes.zero([ReducedTwin(skin, seed=None).read()])
    return bayes


def raised(skin, time, signals, temperature=25.0) -> Reading:
    """The skin at rest and these signals, (9,), T."""
    rest = ReducedTwin(skin, seed=None).read(time=time, temperature=temperature)
    own = np.einsum("sji,sj->si", mlx90393.rotations(skin.halls), signals.reshape(3, 3))
    return Reading(time=time, field=rest.field + own, temperature=rest.temperature)


def test_an_estimator_that_nobody_has_any_more_is_gone_at_once(skin):
    """Its table is megabytes, which Python's own search for circles does not see."""
    bayes = estimator(skin)
    bayes.step(ReducedTwin(skin, seed=0).read(time=1.0))
    gone = weakref.ref(bayes)
    gc.disable()
    try:
        del bayes
        assert gone() is None
    finally:
        gc.enable()


def test_it_finds_place_force_and_drag(skin):
    twin, bayes = ReducedTwin(skin, seed=0), estimator(skin)
    rng = np.random.default_rng(3)
    squared = []
    for k in range(60):
        place = rng.uniform([0.02, 0.03], [0.10, 0.13])
        force = np.array([*rng.uniform(-0.2, 0.2, 2), -rng.uniform(0.3, 1.0)])
        estimate = bayes.step(twin.read([Contact(position=place, force=force)], time=float(k)))
        assert estimate.status is Status.CONTACT
        assert len(estimate.contacts) == 1
        values = np.concatenate([estimate.contacts[0].position, estimate.contacts[0].force])
        error = values - np.concatenate([place, force])
        assert np.abs(error[4]) < 0.05 * -force[2]
        squared.append(error**2 / np.diag(estimate.covariance[0]))
    means = np.mean(squared, axis=0)
    # Drags are stated with what the zero may have moved, which here it has not.
    assert (means > 0.25).all()
    assert (means < 2.0).all()


def test_by_default_one_in_a_million_readings_is_a_false_alarm(skin):
    change, limit = unlike_a_turn(skin), chi2.isf(1e-6, 9)
    for share, status in ((0.99, Status.NO_CONTACT), (1.03, Status.CONTACT)):
        bayes = estimator(skin)
        bayes.zero([raised(skin, 0.0, np.zeros(9))])
        assert bayes.step(raised(skin, 1.0, change * np.sqrt(share * limit))).status is status


def test_a_touch_that_is_gone_leaves_none(skin):
    """Where a table says that a twentieth of a newton's signals may stay, and only after one."""
    known = reduced_table(skin)
    touch = known.signals(WHERE[:1], FORCE[:1])[0]
    left = 3e-2 * np.diff(known.signals(WHERE, np.array([[0.0, 0.0, -1.0]] * 2)), axis=0)[0]
    for share, after in ((0.0, Status.CONTACT), (5e-2, Status.NO_CONTACT)):
        bayes = estimator(skin, replace(known, residue=share))
        assert bayes.step(raised(skin, 1.0, left)).status is Status.CONTACT
        bayes = estimator(skin, replace(known, residue=share))
        bayes.step(raised(skin, 1.1, touch))
        assert bayes.step(raised(skin, 1.2, left)).status is after
    # The zero follows what is left, so that the next touch is read from there.
    for k in range(8):
        bayes.step(raised(skin, 1.3 + 0.1 * k, left))
    assert bayes.drift.ravel() == pytest.approx(left, abs=0.02 * np.abs(left).max())


def test_three_tenths_of_what_a_touch_leaves_is_noise_of_the_next(skin):
    known = replace(reduced_table(skin), residue=2e-2)
    bayes, plain = estimator(skin, known), estimator(skin)
    touch = known.signals(WHERE[:1], FORCE[:1])[0]
    stated = [each.step(raised(skin, 1.0, touch)).covariance[0] for each in (bayes, plain)]
    # The zero is of 20 readings.
    chips = np.repeat([np.trace(known.newton[k : k + 3, k : k + 3]) / 3 for k in (0, 3, 6)], 3)
    noise = signal_noise(skin) * 1.05 + 0.3 * 4e-4 * (known.newton + np.diag(chips)) / 2
    expected = TouchSolver(known, noise).single(touch).covariance[0]
    assert stated[0] == pytest.approx(expected, rel=5e-3, abs=1e-10)
    assert stated[0][0, 0] > 1.2 * stated[1][0, 0]


def test_creep_of_the_columns_is_undone_by_default(skin):
    columns = elastomer_prony(skin.columns.material)
    default = BayesEstimator(skin, reduced_table(skin))
    np.testing.assert_array_equal(default.creep.moduli, columns.moduli)


def test_what_undoing_creep_misses_is_misfit(skin):
    """Forces that creep do not move in proportion: late shares of what half the force lacks."""
    table, prony = reduced_table(skin), Prony(moduli=[0.05, 0.1], times=[0.1, 3.0])
    places = middles_of_fields(table.basis.extent, (7, 7))
    whole, half = (
        straightened(
            field_curvature(skin), table.signals(places, np.tile([0.0, 0.0, -force], (49, 1)))
        )
        for force in (0.5, 0.25)
    )
    lacking = 2 * (whole - 2 * half) * 0.15 / 0.5
    expected = lacking.T @ lacking / 49
    np.testing.assert_allclose(
        estimator(skin, creep=prony).misfit - estimator(skin).misfit, expected,
        rtol=1e-6, atol=1e-9 * np.abs(expected).max(),
    )  # fmt: skip
    np.testing.assert_allclose(
        estimator(skin).misfit, TouchSolver(table, signal_noise(skin)).misfit, rtol=1e-12
    )


def test_two_chips_are_enough_for_a_straight_touch(skin):
    two = estimator(skin, reduced_table(skin).of_chips((1, 2)), priors=STRAIGHT)
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    estimate = two.step(ReducedTwin(skin, seed=0).read([touch]))
    assert estimate.contacts[0].position == pytest.approx(touch.position, abs=2e-3)
    assert estimate.contacts[0].normal_force == pytest.approx(0.5, rel=0.02)


def test_a_chip_that_reports_no_temperature_moves_nothing(skin):
    """Left out for the magnets and for the rubber, whose stiffness scales every force."""
    touch = Contact(position=(0.05, 0.0667), force=(0.0, 0.0, -0.5))
    twin, forces = ReducedTwin(skin, seed=None), []
    for report in (25.0, np.nan):
        bayes = estimator(skin, priors=STRAIGHT)
        for k in range(40):
            reading = twin.read([touch], time=0.01 * k)
            degrees = [25.0, report, 25.0]
            last = bayes.step(Reading(time=reading.time, field=reading.field, temperature=degrees))
        forces.append(last.contacts[0].normal_force)
    assert forces[0] == forces[1]


class StatedSolver:
    """Gives what it is told to: misfit of one touch, evidence of one and two."""

    def __init__(self, misfit, evidence):
        self.misfit, self.evidence = misfit, evidence
        self.guesses, self.enough, self.standing, self.warmed = [], [], [], []

    def warm_to(self, temperature):
        self.warmed.append(temperature)

    def single(self, signals, guess=None, *, enough=0.0):
        values = np.array([[*WHERE[0], *FORCE[0]]])
        evidence = -np.inf if self.turns else self.evidence[0]
        if not self.turns:
            self.guesses.append(guess)
            self.enough.append(enough)
        return TouchPosterior(values, 1e-6 * np.eye(5)[None], self.misfit, evidence)

    def add_noise(self, more):
        self.turns = more.trace() > 1e-9

    def whitener(self, posterior):
        return 1e12 * np.eye(9)

    def pair(self, signals, guess=None, standing=None, *, enough=0.0):
        self.standing.append(standing)
        values = np.concatenate([WHERE, FORCE], axis=1)
        return TouchPosterior(values, np.tile(1e-6 * np.eye(5), (2, 1, 1)), 1.0, self.evidence[1])


def stated(skin, monkeypatch, misfit, evidence, **options):
    """An estimator with such a solver."""
    options = {"tracking": ON_AN_ARM} | options
    bayes, solver = estimator(skin, **options), StatedSolver(misfit, evidence)
    monkeypatch.setattr(bayes, "_solver", solver)
    return bayes, solver


STRONG = np.full(9, 1e-3)


@pytest.mark.parametrize(
    ("misfit", "evidence", "asked", "count"),
    [
        (25 * 9 - 0.1, (-9.0, 0.0), 0, 1),
        (25 * 9 + 0.1, (-9.0, 0.0), 1, 2),
        (25 * 9 + 0.1, (0.0, -9.0), 1, 1),
    ],
)
def test_two_are_tried_where_one_fits_badly(skin, monkeypatch, misfit, evidence, asked, count):
    bayes, solver = stated(skin, monkeypatch, misfit, evidence)
    estimate = bayes.step(raised(skin, 1.0, STRONG))
    assert len(solver.standing) == asked
    assert len(estimate.contacts) == count
    assert estimate.covariance.shape == (count, 5, 5)


def test_two_are_never_tried_where_they_cannot_be(skin, monkeypatch):
    priors = TouchPriors(chances=(0.5, 0.5, 0.0))
    bayes, solver = stated(skin, monkeypatch, 1e3, (-9.0, 0.0), priors=priors)
    assert len(bayes.step(raised(skin, 1.0, STRONG)).contacts) == 1
    assert not solver.standing


@pytest.mark.parametrize("harder", [False, True])
def test_a_pair_with_a_touch_harder_than_what_is_known_is_no_answer(skin, monkeypatch, harder):
    bayes, solver = stated(skin, monkeypatch, 1e3, (-9.0, 0.0))
    presses = -np.array(FORCE)[:, 2]
    monkeypatch.setattr(bayes, "_most", float(presses.max()) * (0.99 if harder else 1.01))
    estimate = bayes.step(raised(skin, 1.0, STRONG))
    assert solver.standing
    assert len(estimate.contacts) == (1 if harder else 2)


def test_what_nothing_explains_is_out_of_range(skin, monkeypatch):
    for misfit, status in ((400 * 9 - 1, Status.CONTACT), (400 * 9 + 1, Status.OUT_OF_RANGE)):
        bayes, solver = stated(skin, monkeypatch, misfit, (0.0, -9.0))
        assert bayes.step(raised(skin, 1.0, STRONG)).status is status
        bayes.step(raised(skin, 2.0, STRONG))
        assert (solver.guesses[1] is None) == (status is Status.OUT_OF_RANGE)


def test_signals_that_nothing_explains_are_not_searched_again_at_once(skin, monkeypatch):
    bayes, solver = stated(skin, monkeypatch, 400 * 9 + 1, (0.0, -9.0))
    searched = []
    for time, force in ((1.0, 1.0), (1.1, 1.02), (1.2, 1.5), (1.3, 1.52), (2.3, 1.5)):
        assert bayes.step(raised(skin, time, force * STRONG)).status is Status.OUT_OF_RANGE
        searched.append(len(solver.guesses))
    once = searched[0]
    assert searched == [once, once, 2 * once, 2 * once, 3 * once]


def test_the_last_touch_is_the_first_guess_until_the_skin_is_let_go(skin, monkeypatch):
    bayes, solver = stated(skin, monkeypatch, 9.0, (0.0, -9.0))
    for k, signals in enumerate((STRONG, STRONG, np.zeros(9), STRONG)):
        bayes.step(raised(skin, float(k), signals))
    assert [guess is not None for guess in solver.guesses] == [False, True, False]
    np.testing.assert_array_equal(solver.guesses[1], [[[*WHERE[0], *FORCE[0]]]])


@pytest.mark.parametrize(("change", "enough"), [(0.099, 125.0), (0.101, 0.0)])
def test_a_search_serves_while_the_signals_stay_about_its_own(skin, monkeypatch, change, enough):
    """What fits a quarter worse than the search did, within a tenth of its signals, is followed."""
    bayes, solver = stated(skin, monkeypatch, 100.0, (0.0, -9.0))
    bayes.step(raised(skin, 1.0, STRONG))
    for k in (2.0, 3.0):  # the second change is from the signals that were searched, too
        bayes.step(raised(skin, k, (1 + change * (k - 1) / 2) * STRONG))
    assert solver.enough[-1] == pytest.approx(enough)


@pytest.mark.parametrize(("later", "enough"), [(0.049, 125.0), (0.051, 0.0)])
def test_a_search_serves_for_a_twentieth_of_a_second(skin, monkeypatch, later, enough):
    bayes, solver = stated(skin, monkeypatch, 100.0, (0.0, -9.0))
    bayes.step(raised(skin, 1.0, STRONG))
    bayes.step(raised(skin, 1.0 + later, 2 * STRONG))
    assert solver.enough[-1] == pytest.approx(enough)


@pytest.mark.parametrize(("misfit", "enough"), [(124.9, 125.0), (125.1, 1.25 * 125.1)])
def test_another_search_is_the_measure_from_then_on(skin, monkeypatch, misfit, enough):
    bayes, solver = stated(skin, monkeypatch, 100.0, (0.0, -9.0))
    bayes.step(raised(skin, 1.0, STRONG))
    solver.misfit = misfit
    for k in (2.0, 3.0):
        bayes.step(raised(skin, k, STRONG))
    assert solver.enough == pytest.approx([0.0, 125.0, enough])


def test_the_table_is_warmed_a_quarter_of_a_degree_at_a_time(skin, monkeypatch):
    bayes, solver = stated(skin, monkeypatch, 9.0, (0.0, -9.0))
    for k, warmth in enumerate((25.0, 29.0, 29.0)):  # smoothed: 25.0, 25.2, 25.39
        bayes.step(raised(skin, float(k), STRONG, warmth))
    assert len(solver.warmed) == 2
    assert solver.warmed == pytest.approx([25.0, 25.39], abs=0.02)


def test_a_touch_that_was_alone_may_have_moved_since():
    covariance = np.zeros((1, 5, 5))
    alone = LoneTouch(3.0, TouchPosterior(np.array([[*WHERE[0], *FORCE[0]]]), covariance, 1.0, 0.0))
    soon, late = (alone.standing(3.0 + later, 5e-3) for later in (1.0, 4.0))
    np.testing.assert_array_equal(soon.place, WHERE[0])
    np.testing.assert_allclose(soon.precision, np.eye(2) / 25e-6)
    np.testing.assert_allclose(late.precision, soon.precision / 4)
    covariance[0, 0, 1] = covariance[0, 1, 0] = 1e-6
    covariance[0, 0, 0] = covariance[0, 1, 1] = 2e-6
    known = alone.standing(2.0, 5e-3).precision
    np.testing.assert_allclose(np.linalg.inv(known), 1e-6 * (np.eye(2) + 1))
    assert alone.standing(9.0, np.inf) is None


def test_only_a_touch_that_fitted_alone_stands(skin, monkeypatch):
    bayes, solver = stated(skin, monkeypatch, 9.0, (-9.0, 0.0))
    bayes.step(raised(skin, 1.0, STRONG))
    solver.misfit = 300.0
    bayes.step(raised(skin, 2.0, STRONG))
    bayes.step(raised(skin, 3.0, STRONG))
    spreads = [1 / standing.precision[0, 0] for standing in solver.standing]
    assert spreads == pytest.approx([26e-6, 51e-6])
    bayes.step(raised(skin, 4.0, np.zeros(9)))
    bayes.step(raised(skin, 5.0, STRONG))
    assert solver.standing[-1] is None


def test_the_second_touch_joins_the_first(planar):
    """The one that was there comes first; known well, it makes the other better known."""
    shipped = load_response_table("planar")
    bare = {"modes": shipped.modes[:0], "grip_modes": shipped.grip_modes[:0], "warp_modes": None}
    skin, table = planar, replace(shipped, **bare)
    turns = {}
    single = table.signals(WHERE[:1], FORCE[:1])[0]
    pair = table.together(WHERE[None], FORCE[None])[0]
    for name, before in (("led", single), ("at once", np.zeros(9))):
        bayes = estimator(skin, table, priors=STRAIGHT)
        bayes.zero([raised(skin, 0.0, np.zeros(9))])
        bayes.step(raised(skin, 1.0, before))
        turns[name] = bayes.step(raised(skin, 1.2, pair))
    led, once = turns["led"], turns["at once"]
    assert led.status is once.status is Status.CONTACT
    assert len(led.contacts) == len(once.contacts) == 2
    assert led.contacts[0].position == pytest.approx(WHERE[0], abs=2e-3)
    assert led.contacts[1].position == pytest.approx(WHERE[1], abs=5e-3)
    assert np.trace(led.covariance[1, :2, :2]) < max(
        np.trace(part[:2, :2]) for part in once.covariance
    )


def test_wrong_use_is_refused(skin, long_planar):
    with pytest.raises(ModelError, match="table must be of the design '4x5'"):
        BayesEstimator(long_planar, reduced_table(skin))
    with pytest.raises(ArgumentError, match="false_alarms must lie in"):
        estimator(skin, false_alarms=0.0)


def test_a_covariance_is_that_of_all_touches_that_are_as_likely(skin, table):
    """About the touches that are answered, by samples."""
    bayes, rng = BayesEstimator(skin, table), np.random.default_rng(3)
    values = np.concatenate([WHERE, FORCE], axis=1)
    root = 1e-2 * rng.normal(size=(2, 2, 5, 5))
    spread = root @ root.swapaxes(-1, -2)
    there = values + 0.02 * rng.normal(size=(2, 5))
    posterior = TouchPosterior(values, spread[0], 1.0, 0.0, 0.7)
    posterior = posterior._replace(others=(TouchPosterior(there, spread[1], 1.0, 0.0, 0.3),))
    answered, covariance = bayes._touches(posterior)
    np.testing.assert_array_equal(answered, values)
    for k in (0, 1):
        parts = [
            rng.multivariate_normal(at[k], of[k], count) - values[k]
            for at, of, count in ((values, spread[0], 70_000), (there, spread[1], 30_000))
        ]
        samples = np.concatenate(parts)
        np.testing.assert_allclose(
            covariance[k], samples.T @ samples / len(samples), atol=0.02 * covariance[k].max()
        )
