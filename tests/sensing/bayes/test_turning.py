"""A skin that begins to turn under a touch: when that is believed, when two touches.

The chance of it is one in a hundred: its evidence must be greater by log 100 = 4.605.
"""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.commands.calibrate import calibrate
from smoskin.datasets.patterns import far_pairs
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.origami.geometry import geometry
from smoskin.records import Reading
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPosterior
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.estimator import ON_AN_ARM
from smoskin.sensing.signals.signals import rest_field, signal_noise
from smoskin.sensing.signals.turning import turning
from smoskin.service.source import open_source
from smoskin.twin.hand import HOLD, PERIOD, RAMP, scripted_hand
from smoskin.twin.rig import VirtualRig

ALONE, TURNED, FIRST, SECOND = (0.03, 0.03), (0.04, 0.04), (0.05, 0.05), (0.09, 0.12)
COUNT = 9


class Stated:
    """Solutions as a test states them: misfit and evidence of one touch, one turned, and two."""

    def __init__(self, single, turned, two):
        self.stated, self.asked = {"one": single, "turned": turned, "two": two}, []

    def warm_to(self, temperature):
        pass

    def _answer(self, name, *places):
        self.asked.append(name)
        misfit, evidence = self.stated[name]
        values = np.array([[*place, 0.0, 0.0, -0.5] for place in places])
        covariance = np.tile(1e-6 * np.eye(5), (len(places), 1, 1))
        return TouchPosterior(values, covariance, misfit, evidence)

    def add_noise(self, more):
        self.turns = more.trace() > 1e-9

    def whitener(self, posterior):
        return 1e12 * np.eye(COUNT)

    def single(self, signals, guess=None, **_):
        return self._answer("turned", TURNED) if self.turns else self._answer("one", ALONE)

    def pair(self, signals, guess=None, standing=None, **_):
        return self._answer("two", FIRST, SECOND)


@pytest.fixture(scope="module")
def table():
    pytest.importorskip("safetensors")
    return load_response_table("planar")


def known_skin(table, misfit=1e-7):
    """The table of a skin that is known to a misfit, T/N."""
    modes = {name: getattr(table, name)[:0] for name in ("modes", "grip_modes", "warp_modes")}
    return replace(table, **modes, misfit=misfit**2 * np.eye(9))


def stated(planar, table, monkeypatch, single, turned=(1.0, -np.inf), two=(1.0, -np.inf)):
    bayes = BayesEstimator(planar, table, tracking=ON_AN_ARM)
    solver = Stated(single, turned, two)
    monkeypatch.setattr(bayes, "_solver", solver)
    rest = np.einsum("sji,sj->si", mlx90393.rotations(planar.halls), rest_field(planar))
    bayes.zero([Reading(time=0.0, field=rest)])

    def step(time):
        touched = rest + np.arange(COUNT).reshape(-1, 3)[: len(rest)] * 2e-4
        solver.asked.clear()
        estimate = bayes.step(Reading(time=time, field=touched))
        return [tuple(contact.position.tolist()) for contact in estimate.contacts], solver.asked[:]

    return bayes, solver, step


@pytest.mark.parametrize(
    ("misfit", "evidence", "asked", "place"),
    [
        (4 * COUNT - 0.1, 50.0, ["one"], ALONE),  # what fits needs no other reason
        (4 * COUNT + 0.1, 4.5, ["one", "turned"], ALONE),
        (4 * COUNT + 0.1, 4.7, ["one", "turned"], TURNED),
    ],
)
def test_a_skin_may_have_turned_where_a_touch_fits_badly(
    planar, table, monkeypatch, misfit, evidence, asked, place
):
    _, _, step = stated(planar, table, monkeypatch, (misfit, 0.0), (1.0, evidence))
    assert step(1.0) == ([place], asked)


@pytest.mark.parametrize(("evidence", "two"), [(5.3, False), (5.5, True)])
def test_two_touches_are_likelier_than_a_turn_by_its_chance(
    planar, table, monkeypatch, evidence, two
):
    bad = 25 * COUNT + 0.1
    _, _, step = stated(planar, table, monkeypatch, (bad, 0.0), (bad, 10.0), (1.0, evidence))
    assert step(1.0) == ([FIRST, SECOND] if two else [TURNED], ["one", "two", "turned"])


def test_a_skin_that_turns_under_a_touch_is_followed_from_then_on(planar, table, monkeypatch):
    bad = 25 * COUNT + 0.1
    bayes, _, step = stated(planar, table, monkeypatch, (bad, 0.0), (1.0, 10.0), (1.0, 0.0))
    before = bayes._signals.followed.covariance.trace()
    assert step(1.0) == ([TURNED], ["one", "two", "turned"])
    assert bayes._signals.followed.covariance.trace() > 100 * before
    # However well a turn fits, two that are likelier are two.
    bayes, _, step = stated(planar, table, monkeypatch, (bad, 0.0), (1.0, 10.0), (1.0, 15.0))
    before = bayes._signals.followed.covariance.trace()
    assert step(1.0) == ([FIRST, SECOND], ["one", "two", "turned"])
    assert bayes._signals.followed.covariance.trace() < 2 * before


def test_what_the_zero_is_unsure_of_is_noise_of_a_touch(planar, table):
    """A field of 90 uT alike at all chips moves a touch that is read for a still skin's."""
    known = known_skin(table)
    solver = TouchSolver(known, signal_noise(planar))
    place, force = np.array([[0.05, 0.07]]), np.array([[0.05, 0.0, -0.5]])
    still = known.signals(place, force)[0]
    moved = still + np.tile([40e-6, -70e-6, 50e-6], 3)
    sure = solver.single(moved)
    solver.add_noise(turning(planar).field)
    unsure = solver.single(moved)
    np.testing.assert_allclose(unsure.values[0, :2], place[0], atol=1.5e-3)
    assert unsure.misfit < sure.misfit / 20
    assert unsure.evidence > sure.evidence + 10
    less_sure = solver.single(still)
    solver.add_noise(np.zeros((9, 9)))
    assert solver.single(still).evidence > less_sure.evidence
    with pytest.raises(ArgumentError, match="noise must be a covariance"):
        TouchSolver(table, -signal_noise(planar))


def test_pairs_are_no_turns_however_few_readings_there_are(planar, table):
    """One reading before each pair, two under it and one after, once a second."""
    bayes = BayesEstimator(planar, known_skin(table, 9e-6), creep=ELASTIC)
    rng = np.random.default_rng(5)
    where = far_pairs(geometry(planar).extent, 0.05, 10, rng)
    push = np.zeros((10, 2, 3))
    push[..., 2] = -rng.uniform(0.4, 1.0, (10, 2))
    rest = rest_field(planar)
    turn = np.swapaxes(mlx90393.rotations(planar.halls), 1, 2)
    spread = np.linalg.cholesky(signal_noise(planar))

    def read(time, signals):
        noisy = (signals + spread @ rng.normal(size=COUNT)).reshape(-1, 3)
        return Reading(time=time, field=(turn @ (rest + noisy)[:, :, None])[:, :, 0])

    bayes.zero([read(0.05 * k, np.zeros(COUNT)) for k in range(20)])
    counts = []
    for k, signals in enumerate(table.together(where, push)):
        for after, now in ((0.0, 0.0), (0.02, 1.0), (0.3, 1.0), (0.32, 0.0)):
            estimate = bayes.step(read(2.0 + k + after, now * signals))
            counts.append((now, len(estimate.contacts)))
    assert counts == 10 * [(0.0, 0), (1.0, 2), (1.0, 2), (0.0, 0)]


def test_an_ordinary_hand_is_no_turn_of_the_skin(planar, table):
    """Presses and releases of a sixth of a second, at ninety readings a second."""
    for module in ("jax", "safetensors"):
        pytest.importorskip(module)
    skin = calibrate(table, VirtualRig(planar, seed=0), count=15)
    hand, off = scripted_hand(planar, 60.0, 0), []
    bayes = BayesEstimator(planar, skin.table)
    name = "twin://planar?manufactured=yes&seed=0&hand=yes&speed=max&rate=90"
    with open_source(name) as source:
        bayes.zero([source.read() for _ in range(20)])
        while True:
            reading = source.read()
            estimate = bayes.step(reading)
            number, since = divmod(reading.time - 0.25, PERIOD)
            if number >= 11:
                break
            if number >= 0 and RAMP + 0.1 < since < RAMP + HOLD - 0.05:
                assert len(estimate.contacts) == 1
                off.append(estimate.contacts[0].position - hand[int(number)].position)
    assert np.linalg.norm(off, axis=1).mean() < 0.8e-3
    assert np.abs(bayes.drift).max() < 5e-6
