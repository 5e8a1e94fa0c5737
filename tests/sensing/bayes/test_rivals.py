"""What a single touch could still say of two, without a search for it."""

import numpy as np
import pytest

from smoskin.magnetics import mlx90393
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.records import Reading
from smoskin.sensing.bayes.estimator import BayesEstimator, Rival
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.reduced import ReducedTwin

STRAIGHT = TouchPriors(drag_spread=0.0)
WHERE = np.array([[0.033, 0.05], [0.085, 0.11]])
FORCE = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, -0.7]])
TURNS = np.log(0.01)


@pytest.mark.parametrize("turning", [0.0, 3.0, 30.0])
def test_no_search_finds_a_likelier_single_touch_than_the_bound(skin, table, turning):
    """Of a still skin or one that turns: noise that is alike at all chips, in deviations."""
    noise = signal_noise(skin)
    turn = turning**2 * noise.diagonal().mean() * np.kron(np.ones((3, 3)), np.eye(3))
    still, turned = (TouchSolver(table, noise + more, STRAIGHT) for more in (0 * turn, turn))
    signals = table.together(WHERE[None], FORCE[None])[0]
    posterior = still.single(signals)
    rival = Rival(1.0, signals, still.whitener(posterior), posterior)
    assert rival.misfit(signals) == pytest.approx(posterior.misfit)
    rng = np.random.default_rng(0)
    for size in (0.0, 1e-3, 2e-3, 4e-3):
        where = WHERE + rng.normal(0, size, WHERE.shape)
        moved = table.together(where[None], FORCE[None] * (1 + 10 * size))[0]
        at_rest, after_turn = still.single(moved), turned.single(moved)
        best = rival.at_best(moved, turn)
        # The misfit is weighed by forces, which are about the same.
        assert rival.misfit(moved) < 1.01 * at_rest.misfit
        assert at_rest.evidence < best + 0.01 * at_rest.misfit
        assert after_turn.evidence + TURNS < best + 0.01 * after_turn.misfit


def test_two_that_go_on_are_followed_alone_until_one_of_them_ends(skin, table, monkeypatch):
    """At 100 Hz a single touch is sought again a fifth of a second later, or once it may fit."""
    bayes = BayesEstimator(skin, table, priors=STRAIGHT, creep=ELASTIC)
    rest, turns = ReducedTwin(skin, seed=None), mlx90393.rotations(skin.halls)
    bayes.zero([rest.read()])
    sought, single = [], TouchSolver.single
    monkeypatch.setattr(
        TouchSolver,
        "single",
        lambda self, *args, **more: sought.append(0) or single(self, *args, **more),
    )

    def step(time, signals):
        sought.clear()
        own = np.einsum("sji,sj->si", turns, signals.reshape(3, 3))
        still = rest.read(time=time)
        estimate = bayes.step(Reading(time=time, field=still.field + own))
        return len(estimate.contacts), len(sought)

    counts = []
    for k in range(45):
        where = WHERE + 1e-4 * k
        counts.append(step(1 + 0.01 * k, table.together(where[None], FORCE[None])[0]))
    assert {count for count, _ in counts} == {2}
    gaps = np.diff([k for k, (_, searches) in enumerate(counts) if searches], prepend=0)
    assert gaps[0] == 0
    assert len(gaps) >= 3
    assert all(10 < gap <= 20 for gap in gaps[1:])
    assert step(1.45, table.signals(where[:1], FORCE[:1])[0]) == (1, 1)
