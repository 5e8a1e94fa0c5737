"""From a chunk to its rows: the skin, temperature and noise that the sweep asks for."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.datasets import simulation
from smoskin.datasets.patterns import Grid, Sweep
from smoskin.datasets.simulation import Simulation
from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.touches import Frictionless
from smoskin.records import ChipFlag
from smoskin.twin.manufacture import Tolerances
from smoskin.twin.reduced import ReducedTwin

SWEEP = Sweep(
    presses=Grid(forces=(0.4,), places=(2, 3), drags=((0.1, 0.0),)),
    temperatures=(25.0, 45.0),
    skins=(3, 8),
    grip=Frictionless(),
    presses_per_chunk=4,
    seed=6,
)


@pytest.fixture
def made(planar, monkeypatch):
    """What the whole sheet's twins are made with; the reduced model answers in their place."""
    asked = []

    def twin(design, **options):
        asked.append(options)
        return ReducedTwin(design, seed=None)

    monkeypatch.setattr(simulation, "Twin", twin)
    return asked


def test_each_skin_is_made_once_as_the_sweep_says(planar, made):
    compute = Simulation(planar, SWEEP)
    skins = [compute(chunk).skin.tolist() for chunk in range(SWEEP.chunks)]
    assert [row for rows in skins for row in rows] == [3] * 12 + [8] * 12
    usual = {"manufactured": True, "tolerances": None, "grip": Frictionless()}
    assert made == [{"seed": k, **usual} for k in (3, 8)]
    tighter = replace(SWEEP, tolerances=Tolerances(remanence=0.01))
    Simulation(planar, tighter)(0)
    assert made[-1] == {"seed": 3, **usual, "tolerances": tighter.tolerances}


def test_without_seeds_the_skin_is_as_designed(planar, made):
    rows = Simulation(planar, replace(SWEEP, skins=()))(0)
    assert rows.skin.tolist() == [-1] * 4
    assert made == [
        {"seed": None, "manufactured": False, "tolerances": None, "grip": Frictionless()}
    ]


def test_rows_hold_what_the_skin_does_at_their_temperature(planar, made):
    twin = ReducedTwin(planar, seed=None)
    for chunk, degrees in ((1, 25.0), (2, 45.0)):
        rows, touches = Simulation(planar, SWEEP)(chunk), SWEEP.touches(planar, chunk)
        motion = twin.motions(touches, temperature=degrees)
        sample = twin.sample(motion, SWEEP.noise(chunk), temperature=degrees)
        assert len(rows) == len(touches)
        assert rows.temperature.tolist() == [degrees] * len(touches)
        assert_array_equal(rows.position, touches.position)
        assert_array_equal(rows.force, touches.force)
        assert_array_equal(rows.radius, touches.radius)
        assert_array_equal(rows.magnet_shift, motion.magnets[..., :3])
        assert_array_equal(rows.magnet_turn, motion.magnets[..., 3:])
        assert_array_equal(rows.board_shift, motion.board[:, :3])
        assert_array_equal(rows.board_turn, motion.board[:, 3:])
        assert_array_equal(rows.motion.magnets, motion.magnets)
        assert_array_equal(rows.motion.board, motion.board)
        assert_allclose(rows.field, twin.field(motion, degrees), rtol=1e-12)
        assert_array_equal(rows.reading, mlx90393.tesla(sample.counts, planar.hall_setting))
        assert_array_equal(rows.flags, sample.flags)
        assert rows.valid.all()


def test_rows_without_an_equilibrium_hold_no_number(planar, monkeypatch):
    class Lost(ReducedTwin):
        def motions(self, touches, *, temperature):
            return super().motions(touches, temperature=temperature).where(np.arange(4) != 2)

    monkeypatch.setattr(simulation, "Twin", lambda design, **options: Lost(design))
    rows = Simulation(planar, SWEEP)(0)
    assert rows.valid.tolist() == [True, True, False, True]
    for values in (rows.field, rows.reading, rows.magnet_shift, rows.board_shift, rows.board_turn):
        assert np.isnan(values[2]).all()
        assert np.isfinite(values[[0, 1, 3]]).all()
    assert (rows.flags[2] == int(ChipFlag.INVALID)).all()
