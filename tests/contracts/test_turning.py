"""A skin on an arm that turns it, with its own weight and in the Earth's field, and what drifts."""

from dataclasses import dataclass
from functools import cache
from typing import final

import numpy as np
import pytest

import smoskin as smo
from smoskin.magnetics.arrangement import rotation_matrix
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.records import Contact, Motion, Status
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.signals.estimator import FOLLOWING, ON_AN_ARM
from smoskin.twin.rig import drifting_readings
from smoskin.twin.whole import Twin
from smoskin.twin.world.arm import TURNING, Arm, Gravity
from smoskin.twin.world.effect import World
from smoskin.twin.world.fields import Earth
from smoskin.twin.world.worlds import HARD

pytest.importorskip("jax")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Crank(Arm):
    """Turns to and fro as usual once, then from one reading to the next about another axis."""

    speed: float = 0.2

    def turns(self, axis, times):
        other = np.array([-axis[1], axis[0], 0.0])
        late = np.maximum(times - TURNING.period, 0.0)[:, None]
        again = rotation_matrix(self.speed * late * other)
        return np.where(late[..., None] > 0, again, TURNING.turns(axis, times))


PLACE, SEED = (0.05, 0.09), 31
WORLD = World(name="arm", effects=(Earth(), Gravity()))
CRANKED = World(name="crank", effects=(Earth(arm=Crank()), Gravity(arm=Crank())))


@cache
def known(design):
    """The made skin and its table, by eight touches of it."""
    rig = smo.VirtualRig(design, seed=SEED)
    table = smo.calibrate(smo.load_response_table(design.name), rig, design=design, count=8).table
    return Twin(design, seed=SEED, manufactured=True), table


def stream(
    design, times, held, forces=((PLACE, 0.5),), *, world=WORLD, begin=0.0, warm=0.0, drift=0.3e-6
):
    """Readings at times (T,) of touches while they are held; the arm turns from `begin`."""
    twin = known(design)[0]
    touches = [Contact(position=place, force=(0.0, 0.0, -press)) for place, press in forces]
    cold, hot = (twin.motion(touches, temperature=degrees) for degrees in (25.0, 25.0 + warm))
    share = held * np.linspace(0.0, 1.0, len(times))
    motion = Motion(
        magnets=(held - share)[:, None, None] * cold.magnets + share[:, None, None] * hot.magnets,
        board=(held - share)[:, None] * cold.board + share[:, None] * hot.board,
    )
    run = world.run(twin, (SEED, 1))
    around = run.around(times - begin)
    steps, rng = np.diff(times, prepend=times[0]), np.random.default_rng(3)
    readings, _ = drifting_readings(
        twin,
        run.moved(times - begin, motion),
        times,
        steps,
        rng,
        temperature=25.0 + warm * np.linspace(0.0, 1.0, len(times)),
        drift=drift,
        around=around,
    )
    return readings


def answers(design, readings, zeros=20, tracking=ON_AN_ARM):
    """What is told of readings after those of the zero."""
    skin = smo.BayesEstimator(
        design,
        known(design)[1],
        priors=TouchPriors(drag_spread=0.0),
        creep=ELASTIC,
        tracking=tracking,
    )
    skin.zero(readings[:zeros], force=True)
    return [skin.step(reading) for reading in readings]


def errors(estimates):
    """Distances from the place, mm, and shares of the force that are missed, of touches found."""
    contacts = [estimate.contacts[0] for estimate in estimates]
    away = [1e3 * np.hypot(*(contact.position - PLACE)) for contact in contacts]
    return np.array(away), np.array([contact.normal_force for contact in contacts])


@pytest.mark.parametrize("rate", [10.0, 50.0])
def test_a_turning_board_makes_no_touch(design, rate):
    """A quarter turn to and fro in 20 s: 60 uT and a board that slides by 1.3 mm."""
    times = np.arange(-2.0, 40.0, 1 / rate)
    readings = stream(design, times, 0.0 * times)
    assert {estimate.status for estimate in answers(design, readings)} == {Status.NO_CONTACT}


@pytest.mark.parametrize("rate", [10.0, 50.0])
def test_a_board_that_turns_about_another_axis_at_once_makes_no_touch(design, rate):
    """Its zero knows by then what turns about the first change, and nothing else."""
    times = np.arange(-2.0, 25.0, 1 / rate)
    readings = stream(design, times, 0.0 * times, world=CRANKED)
    assert {estimate.status for estimate in answers(design, readings)} == {Status.NO_CONTACT}


@pytest.mark.slow
@pytest.mark.parametrize("design", ["planar"], indirect=True)
def test_an_hour_on_an_arm_in_the_hard_world_makes_no_touch(design):
    """It turns by a quarter and back in 20 s beside a motor and steel, and loses as it moves."""
    times = np.arange(-2.0, 3600.0, 0.1)
    readings = stream(design, times, 0.0 * times, world=HARD)
    assert {estimate.status for estimate in answers(design, readings)} == {Status.NO_CONTACT}


def test_a_light_touch_is_found_once_a_turn_was_seen(design):
    """0.1 N, each for 0.3 s, while the arm turns on: as loud as its weight in a tenth of that."""
    times = np.arange(-2.0, 40.0, 0.1)
    held = ((times > 20.95) & (times % 1.0 < 0.35)).astype(float)
    estimates = answers(design, stream(design, times, held, ((PLACE, 0.1),)))
    statuses = np.array([estimate.status for estimate in estimates])
    assert (statuses[held == 0] == Status.NO_CONTACT).all()
    assert np.mean(statuses[held > 0] == Status.CONTACT) > 0.95


def test_a_touch_on_a_turning_board_is_found_and_leaves_none(design):
    """Each held for 0.3 s, ten readings a second: found to a millimetre, and to 2 % of force."""
    times = np.arange(-2.0, 20.0, 0.1)
    held = ((times > 0.95) & (times % 1.0 < 0.35)).astype(float)
    estimates = answers(design, stream(design, times, held))
    statuses = np.array([estimate.status for estimate in estimates])
    assert (statuses[held > 0] == Status.CONTACT).all()
    assert (statuses[held == 0] == Status.NO_CONTACT).all()
    away, force = errors(
        [estimate for estimate, there in zip(estimates, held, strict=True) if there]
    )
    assert away.mean() < 1.0
    assert np.abs(force - 0.5).mean() < 0.01


@pytest.mark.parametrize("rate", [10.0, 50.0])
def test_the_earths_field_moves_a_touch_by_less_than_a_third_of_a_millimetre(design, rate):
    """Where it were read for still, 20 uT would move this touch by three."""
    times = np.arange(-2.0, 12.0, 1 / rate)
    held = ((times > 0.95) & (times % 1.0 < 0.301)).astype(float)
    where = []
    for world in (World(name="plain"), World(name="earth", effects=(Earth(),))):
        estimates = answers(design, stream(design, times, held, world=world), tracking=FOLLOWING)
        touched = [estimate for estimate, there in zip(estimates, held, strict=True) if there]
        places = np.array([estimate.contacts[0].position for estimate in touched])
        where.append(places.reshape(11, -1, 2).mean(axis=1))
    moved = 1e3 * np.hypot(*(where[1] - where[0]).T)
    assert moved.mean() < 0.3
    assert moved.max() < 0.6


def test_a_board_that_begins_to_turn_under_a_touch_is_followed(design):
    """For 1.7 s; what the weight then moves looks like the touch."""
    times = np.arange(-2.0, 12.0, 0.1)
    held = ((times > 0.95) & (times < 3.75)).astype(float)
    estimates = answers(design, stream(design, times, held, begin=2.0))
    statuses = np.array([estimate.status for estimate in estimates])
    assert (statuses[held > 0] == Status.CONTACT).all()
    assert (statuses[held == 0] == Status.NO_CONTACT).all()


def test_a_zero_taken_on_a_board_that_hangs_askew_serves(design):
    """As an arm stands when the skin is switched on: a quarter turned, at rest for a moment."""
    times = np.arange(0.0, 20.0, 0.1)
    held = ((times > 4.95) & (times % 1.0 < 0.35)).astype(float)
    askew = stream(design, times, held, begin=-10.0)
    estimates = answers(design, askew, zeros=4)
    statuses = np.array([estimate.status for estimate in estimates])
    assert (statuses[held > 0] == Status.CONTACT).all()
    assert (statuses[held == 0] == Status.NO_CONTACT).all()


def test_a_long_touch_that_warms_stays_where_it_is(design):
    """0.3 N for half an hour, while the skin warms by 5 degrees; then nothing is left."""
    times = np.arange(-20.0, 1830.0, 1.0)
    held = ((times > 0.0) & (times <= 1800.0)).astype(float)
    forces = ((PLACE, 0.3),)
    plain = World(name="plain")
    estimates = answers(
        design, stream(design, times, held, forces, world=plain, warm=5.0, drift=0.05e-6)
    )
    away, force = errors(
        [estimate for estimate, there in zip(estimates, held, strict=True) if there]
    )
    assert away[:100].mean() < 1.0
    assert away[-100:].mean() < 1.5
    # Noise of single readings is 0.7 %.
    np.testing.assert_allclose(force, 0.3, rtol=0.03)
    assert np.mean(np.abs(force / 0.3 - 1) < 0.02) > 0.99
    left = [
        estimate.status for estimate, time in zip(estimates, times, strict=True) if time > 1800.0
    ]
    assert set(left) == {Status.NO_CONTACT}


@pytest.mark.parametrize("place", [PLACE, (0.06, 0.08), (0.02, 0.14), (0.11, 0.02)])
def test_a_light_touch_of_a_still_board_is_found_at_ten_readings_a_second(design, place):
    times = np.arange(-2.0, 4.0, 0.1)
    held = ((times > 0.95) & (times < 2.95)).astype(float)
    readings = stream(design, times, held, ((place, 0.1),), world=World(name="plain"))
    statuses = np.array([estimate.status for estimate in answers(design, readings)])
    assert (statuses[held > 0] == Status.CONTACT).all()
    assert (statuses[held == 0] == Status.NO_CONTACT).all()


def test_two_touches_of_a_turning_board_are_two(design):
    times = np.arange(-2.0, 12.0, 0.1)
    held = ((times > 0.95) & (times % 1.0 < 0.35)).astype(float)
    forces = (((0.03, 0.04), 0.6), ((0.09, 0.12), 0.6))
    estimates = answers(design, stream(design, times, held, forces))
    counts = np.array([len(estimate.contacts) for estimate in estimates])
    assert (counts[held == 0] == 0).all()
    assert np.mean(counts[held > 0] == 2) > 0.9
