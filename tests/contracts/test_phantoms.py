"""Readings of a made skin that nobody touches, and zeros that people ask for at any moment."""

from functools import cache

import numpy as np
import pytest

import smoskin as smo
from networks import tiny_network
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.records import Contact, Motion, Reading, Status
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.twin.readout import Readout
from smoskin.twin.surroundings import Surroundings
from smoskin.twin.whole import Twin

pytest.importorskip("jax")
EARTH, RATE = 60e-6, 100.0


@cache
def skin_table(design):
    """A table calibrated by five touches of the skin that is made by seed 3."""
    shipped, rig = smo.load_response_table(design.name), smo.VirtualRig(design, seed=3)
    return smo.calibrate(shipped, rig, design=design, count=5).table


ESTIMATORS = {
    "none calibrated": smo.ClosedFormEstimator,
    "table": lambda design: smo.BayesEstimator(design, skin_table(design)),
    "network": lambda design: NetworkEstimator(design, tiny_network(design)),
}


def turning(design, count, rng):
    """Readings of an untouched made skin on an arm that turns and stops in the Earth's field."""
    made = Twin(design, seed=3, manufactured=True).deviations
    rest = Motion.rest(len(design.magnets))
    bare = Readout(design, made).seen(rest)
    answers = np.stack(
        [
            Readout(design, made, Surroundings(earth=way)).seen(rest) - bare
            for way in np.eye(3) * 1e-6
        ]
    )
    # The skin's attitude: turns of up to 2 rad/s about slowly changing axes, at rest in between.
    speed = np.repeat(rng.normal(size=(count // 500 + 1, 3)), 500, axis=0)[:count]
    speed *= (np.arange(count) // 500 % 3 > 0)[:, None]
    earth, way = np.empty((count, 3)), np.array([0.6, 0.0, -0.8]) * EARTH
    for k in range(count):
        way = way + np.cross(way, speed[k]) / RATE
        earth[k] = way = way * (EARTH / np.linalg.norm(way))
    seen = bare + np.einsum("nd,dsj->nsj", earth - earth[0], answers) / 1e-6
    sample = mlx90393.measure(seen, design.hall_setting, temperature=24.0, rng=rng)
    field = mlx90393.tesla(sample.counts, design.hall_setting)
    degrees = mlx90393.degrees(sample.temperature_counts)
    for k in range(count):
        yield Reading(time=k / RATE, field=field[k], temperature=degrees[k], flags=sample.flags[k])


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("design", "kind", "count"),
    [
        *(pytest.param("planar", kind, 2_000) for kind in ESTIMATORS),
        *(pytest.param("planar", kind, 100_000, marks=SLOW) for kind in ESTIMATORS),
        pytest.param("curved", "table", 2_000, marks=SLOW),
    ],
    indirect=["design"],
)
def test_an_untouched_skin_on_a_turning_arm_is_never_touched(design, kind, count):
    estimator = ZeroFirst(ESTIMATORS[kind](design))
    statuses = [
        estimator.step(reading).status
        for reading in turning(design, count, np.random.default_rng(7))
    ]
    assert set(statuses[:20]) == {Status.NOT_CALIBRATED}
    assert set(statuses[-count // 2 :]) == {Status.NO_CONTACT}
    assert Status.CONTACT not in statuses


def refused(estimator, readings) -> str:
    """Why these readings are no zero, if they are not."""
    try:
        estimator.zero(readings)
    except ArgumentError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    ("design", "cycles"),
    [
        ("planar", 5),
        pytest.param("planar", 50, marks=SLOW),
        pytest.param("curved", 5, marks=SLOW),
    ],
    indirect=["design"],
)
def test_a_zero_asked_for_at_any_moment_makes_no_touch(design, cycles):
    """A hand touches for a second and is away for three; in each cycle someone asks for a zero."""
    rng = np.random.default_rng(11)
    twin = Twin(design, seed=3, manufactured=True)
    rest = Motion.rest(len(design.magnets))
    places = rng.uniform(0.1, 0.9, (cycles, 2)) * [0.12, 0.16]
    estimator = ZeroFirst(smo.BayesEstimator(design, skin_table(design), creep=ELASTIC))
    time, latest, refusals, phantoms, missed = 0.0, [], 0, 0, 0
    for place in places:
        motion = twin.motion([Contact(position=place, force=(0.0, 0.0, -0.5))])
        asked = rng.integers(0, 400)
        for k in range(400):
            held = 200 <= k < 300
            reading = twin.sense(motion if held else rest, time=time)
            latest, time = [*latest[-19:], reading], time + 1 / RATE
            status = estimator.step(reading).status
            if k == asked and len(latest) == 20:
                touched = any(200 <= step < 300 for step in range(k - 19, k + 1))
                refusal = refused(estimator, latest)
                refusals += touched
                assert ("let go first" in refusal) == touched
            phantoms += not held and status is Status.CONTACT
            missed += held and status is not Status.CONTACT
    assert (phantoms, missed) == (0, 0)
    assert cycles < 50 or 5 <= refusals <= 25
