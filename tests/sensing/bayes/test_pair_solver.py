"""Two touches at once from one reading, and when one of them was there before."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.mechanics.sheet.compliance import grip_compliance
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.records import Contact, Reading, Status
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import Standing, TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.response.fit import table_curvature
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import plain, reduced_table

WHERE = np.array([[0.033, 0.05], [0.085, 0.11]])
FORCE = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, -0.7]])
STRAIGHT = TouchPriors(drag_spread=0.0)


@pytest.fixture(scope="module")
def skin(planar):
    return plain(planar)


@pytest.fixture(scope="module")
def table(skin):
    known = replace(reduced_table(skin), grip=grip_compliance(skin))
    return replace(known, curvature=table_curvature(known))


@pytest.fixture(scope="module")
def solver(skin, table):
    return TouchSolver(table, signal_noise(skin), STRAIGHT)


def apart(said, true=WHERE):
    """Mean distance of the places, in the better order."""
    return min(np.hypot(*(said - turned).T).mean() for turned in (true, true[::-1]))


def pairs(count, seed):
    rng = np.random.default_rng(seed)
    while count:
        where = rng.uniform([0.015, 0.02], [0.105, 0.14], (2, 2))
        if np.hypot(*(where[0] - where[1])) > 0.04:
            count -= 1
            yield where, np.array([[0, 0, -f] for f in rng.uniform(0.3, 1.0, 2)])


def test_pairs_are_found_wherever_they_are(table, solver):
    """The reduced model tells pairs poorly: what is found is as good as noise lets anything be."""
    for where, force in pairs(8, seed=1):
        exact = table.together(where[None], force[None])[0]
        found = solver.two(exact)
        assert found.misfit < 4.0
        assert found.evidence > solver.one(exact).evidence
        led = solver.two(exact, np.concatenate([where + 2e-3, force], axis=1))
        assert led.misfit < 0.5
        assert apart(led.values[:, :2], where) < 2e-3


def test_pairs_say_how_sure_they_are(skin, table, solver):
    rng = np.random.default_rng(5)
    noise = signal_noise(skin)
    squared = []
    for where, force in pairs(12, seed=2):
        said = table.together(where[None], force[None])[0] + rng.multivariate_normal(
            np.zeros(9), noise
        )
        found = solver.two(said, np.concatenate([where, force], axis=1))
        for k in (0, 1):
            off = found.values[k, :2] - where[k]
            squared.append(off @ np.linalg.solve(found.covariance[k, :2, :2], off))
    # Two degrees of freedom a place; the misfit that is allowed for is not there.
    assert np.mean(squared) < 3.0


def test_a_touch_that_stood_there_tells_the_other(table, solver):
    exact = table.together(WHERE[None], FORCE[None])[0]
    free = solver.two(exact)
    standing = Standing(WHERE[1], 1e-6 * np.eye(2))
    led = solver.two(exact, standing=standing)
    assert led.values[0, :2] == pytest.approx(WHERE[1], abs=1e-3)
    assert apart(led.values[:, :2]) < 1e-3
    other = np.hypot(*(free.values[:, :2] - WHERE[0]).T).argmin()
    sure = [np.trace(part[:2, :2]) for part in (led.covariance[1], free.covariance[other])]
    assert sure[0] < sure[1]
    # Where it cannot have stood, the reading has it.
    astray = solver.two(exact, standing=Standing(np.array([0.1, 0.02]), 1e-8 * np.eye(2)))
    assert astray.misfit < free.misfit + 0.5


def test_nothing_explains_signals_of_no_touch(solver):
    """Where no start has forces that press, an answer is given all the same."""
    found = solver.two(-1e-3 * np.ones(9))
    assert np.isfinite(found.values).all()
    assert found.misfit > 1000


def test_the_second_touch_joins_the_first(skin, table):
    """The estimator says first the one that was there; sure of it, it is surer of the other."""
    twin = ReducedTwin(skin, seed=None)
    alone = replace(table, grip=np.zeros_like(table.grip))
    first, second = (Contact(position=w, force=f) for w, f in zip(WHERE, FORCE, strict=True))
    rest = twin.read(time=0.0)
    turns = {}
    for name, before in (("led", [first]), ("at once", [])):
        said = BayesEstimator(skin, alone, priors=STRAIGHT, creep=ELASTIC)
        said.zero([rest])
        said.step(twin.read(before, time=1.0))
        turns[name] = said.step(both(twin, skin, alone, first, second))
    led, once = turns["led"], turns["at once"]
    assert led.status is once.status is Status.CONTACT
    assert len(led.contacts) == len(once.contacts) == 2
    assert led.contacts[0].position == pytest.approx(WHERE[0], abs=2e-3)
    assert led.contacts[1].position == pytest.approx(WHERE[1], abs=5e-3)
    assert np.trace(led.covariance[1, :2, :2]) < max(
        np.trace(part[:2, :2]) for part in once.covariance
    )


def both(twin, skin, table, first, second):
    """What the chips read under both, by the table."""
    from smoskin.magnetics import mlx90393

    where, force = (np.stack([getattr(one, name) for one in (first, second)])
                    for name in ("position", "force"))  # fmt: skip
    rise = table.together(where[None], force[None]).reshape(-1, 3)
    rest = twin.read(time=1.2)
    turned = np.einsum("sji,sj->si", mlx90393.rotations(skin.halls), rise)
    return Reading(time=1.2, field=rest.field + turned, temperature=rest.temperature)
