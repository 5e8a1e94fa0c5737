"""Creep undone."""

import numpy as np
import pytest

from smoskin.mechanics.viscoelasticity import ELASTIC, Memory, Prony
from smoskin.sensing.signals.settling import Settling


@pytest.mark.parametrize("seed", range(3))
def test_settling_undoes_creep(seed):
    rng = np.random.default_rng(seed)
    prony = Prony(moduli=[0.05, 0.1], times=[0.1, 3.0])
    memory, settling = Memory(prony, np.zeros(4)), Settling(prony)
    for duration in rng.uniform(0, 1, 50):
        elastic = rng.normal(size=4)
        crept = memory.step(duration, elastic)
        assert settling.step(duration, crept) == pytest.approx(elastic)


def test_after_a_reset_the_skin_has_rested():
    prony = Prony(moduli=[0.05, 0.1], times=[0.1, 3.0])
    settling, fresh = Settling(prony), Settling(prony)
    for _ in range(9):
        settling.step(0.3, np.ones(4))
    settling.reset()
    for duration in (0.2, 0.1):
        expected = fresh.step(duration, np.ones(4))
        assert settling.step(duration, np.ones(4)) == pytest.approx(expected)


def test_time_that_goes_back_is_no_time():
    settling, other = (Settling(Prony(moduli=[0.1], times=[1.0])) for _ in range(2))
    for duration in (0.5, -3.0):
        last = settling.step(duration, np.ones(1)), other.step(max(duration, 0.0), np.ones(1))
    assert last[0] == last[1]


def test_nothing_is_undone_of_a_solid_that_does_not_creep():
    settling = Settling(ELASTIC)
    for value in (1.0, 3.0, 0.0):
        assert settling.step(0.1, np.full(2, value)) == pytest.approx(np.full(2, value))
