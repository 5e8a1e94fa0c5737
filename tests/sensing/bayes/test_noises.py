"""Which noises of a solver count as the same, and how many of them it keeps."""

import numpy as np
import pytest

from smoskin.sensing.bayes import solver as solving
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.signals.signals import signal_noise


@pytest.fixture
def made(skin, table, monkeypatch):
    """A solver, and the noises whose problems it has made."""
    noises, kept = [], solving._Problems

    def made(noise):
        noises.append(noise)
        return kept(noise)

    monkeypatch.setattr(solving, "_Problems", made)
    return TouchSolver(table, signal_noise(skin)), noises


@pytest.mark.parametrize(("share", "alike"), [(0.09, True), (0.11, False)])
@pytest.mark.parametrize("entry", [(0, 0), (4, 4), (1, 5)])
def test_noises_are_the_same_up_to_a_tenth_of_their_variances(made, skin, share, alike, entry):
    solver, noises = made
    rest = signal_noise(skin)
    more = np.zeros_like(rest)
    more[entry] = more[entry[::-1]] = share * np.sqrt(
        rest[entry[0], entry[0]] * rest[entry[1], entry[1]]
    )
    solver.add_noise(more)
    assert len(noises) == (1 if alike else 2)
    np.testing.assert_array_equal(noises[-1], rest if alike else rest + more)


def test_three_noises_are_kept(made, skin):
    solver, noises = made
    rest = signal_noise(skin)
    for factor, count in ((1.0, 2), (2.0, 3), (1.0, 3), (0.0, 3), (3.0, 4), (2.0, 4), (0.0, 5)):
        solver.add_noise(factor * rest)
        assert len(noises) == count
    # Another temperature needs all of them anew.
    solver.warm_to(30.0)
    assert len(noises) == 6
    solver.add_noise(2.0 * rest)
    assert len(noises) == 7
