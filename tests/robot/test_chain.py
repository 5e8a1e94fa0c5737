"""Where an arm's parts are, against closed forms of a planar arm, and how they move."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from smoskin.errors import ArgumentError
from smoskin.robot.chain import Carriage
from tests.arms import FORE, SHOULDER, UPPER, forearm_chain

CHAIN = forearm_chain()
ANGLES = arrays(float, 3, elements=st.floats(-3.0, 3.0).map(lambda angle: round(angle, 9)))


def closed_form(angles, along, across):
    """A place of the forearm, so far along it and above its axis, by sines and cosines."""
    yaw, shoulder, elbow = angles
    bend = shoulder + elbow
    reach = UPPER * np.cos(shoulder) + along * np.cos(bend) - across * np.sin(bend)
    height = SHOULDER + UPPER * np.sin(shoulder) + along * np.sin(bend) + across * np.cos(bend)
    return np.array([reach * np.cos(yaw), reach * np.sin(yaw), height])


@settings(max_examples=30)
@given(ANGLES)
def test_places_on_the_skin_follow_sines_and_cosines(angles):
    posture = CHAIN.posture(angles)
    place = posture.on_skin([0.05, 0.08, 0.02])
    assert place == pytest.approx(closed_form(angles, 0.17, 0.10), abs=1e-9)
    assert np.linalg.norm(posture.of_skin([0.6, 0.0, 0.8])) == pytest.approx(1.0)


@settings(max_examples=30)
@given(ANGLES)
def test_the_jacobian_is_the_change_of_place(angles):
    step = 1e-6
    place = np.array([0.02, 0.1, 0.0])
    posture = CHAIN.posture(angles)
    jacobian = posture.jacobian(posture.on_skin(place))
    for joint, turn in enumerate(step * np.eye(3)):
        more, less = (CHAIN.posture(angles + sign * turn).on_skin(place) for sign in (1, -1))
        assert jacobian[:, joint] == pytest.approx((more - less) / (2 * step), abs=1e-8)


def test_a_carried_skin_has_the_acceleration_of_its_path():
    """A circle, by both its curvature and its change of speed; a pause in between tells none."""
    middle, rate, dt = np.array([0.05, 0.08, 0.02]), 0.8, 1e-3
    carriage = Carriage(CHAIN, middle)
    away = np.hypot(*CHAIN.posture([0.0, 0.4, -1.2]).on_skin(middle)[:2])
    for time in np.arange(0.0, 0.5, dt):
        angles = np.array([0.5 * rate * time**2, 0.4, -1.2])
        pose = carriage.look(time, angles, np.array([rate * time, 0.0, 0.0]))
    expected = away * np.hypot(rate, (rate * time) ** 2)
    assert np.linalg.norm(pose.acceleration) == pytest.approx(expected, rel=5e-3)
    assert pose.turn == pytest.approx(CHAIN.posture(angles).of_skin(np.eye(3)).T)
    later = carriage.look(time + 10.0, angles, np.zeros(3))
    assert not later.acceleration.any()
    assert carriage.pose is later


def test_corners_are_moved_by_the_joints_before_them_alone():
    posture = CHAIN.posture([0.2, 0.5, -1.0])
    assert not posture.corner_motions[:8, :, 1:].any()
    assert not posture.corner_motions[8:16, :, 2].any()
    assert np.abs(posture.corner_motions[16:]).max() < UPPER + FORE + SHOULDER


@pytest.mark.parametrize(
    "change",
    [
        {"axes": [[0, 0, 2], [0, 1, 0], [0, 1, 0]]},
        {"lower": [4.0, 0.0, 0.0]},
        {"speed": [0.0, 1.0, 1.0]},
        {"carriers": 4},
        {"anchors": np.zeros((2, 3))},
    ],
)
def test_what_is_no_chain_is_refused(change):
    parts = {name: getattr(CHAIN, name) for name in CHAIN.__dataclass_fields__}
    with pytest.raises(ArgumentError):
        type(CHAIN)(**(parts | change))
