"""The law: its closed form, its damping, and that no limit is ever exceeded."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from smoskin.errors import ArgumentError
from smoskin.robot import law
from smoskin.robot.law import Limits
from tests.arms import forearm_chain

CHAIN = forearm_chain()
LIMITS = Limits()
INSIDE = arrays(float, 3, elements=st.floats(0.0, 1.0)).map(
    lambda share: CHAIN.lower + share * (CHAIN.upper - CHAIN.lower)
)
SPEEDS = arrays(float, 3, elements=st.floats(-3.0, 3.0))


@pytest.mark.parametrize(
    ("force", "before", "pushed"),
    [(0.449, True, False), (0.451, True, True), (0.549, False, False), (0.55, False, True)],
)
def test_the_dead_band_has_two_edges(force, before, pushed):
    assert law.is_pushed(force, before, LIMITS) is pushed


@settings(max_examples=30)
@given(arrays(float, 3, elements=st.floats(-2.0, 2.0)))
def test_speed_grows_with_the_force_over_the_band_along_it(force):
    velocity = law.yielding(force, LIMITS)
    size = np.linalg.norm(force)
    expected = np.clip((size - 0.45) / 6.0, 0.0, 0.1)
    assert np.linalg.norm(velocity) == pytest.approx(expected, abs=1e-12)
    assert np.cross(velocity, force) == pytest.approx(np.zeros(3), abs=1e-12)
    assert velocity @ force >= 0.0


@settings(max_examples=30)
@given(INSIDE, arrays(float, 3, elements=st.floats(-0.1, 0.1)))
def test_joints_move_the_place_as_wanted_or_damping_holds_them(angles, wanted):
    posture = CHAIN.posture(angles)
    jacobian = posture.jacobian(posture.on_skin([0.06, 0.08, 0.0]))
    speeds = law.joint_speeds(jacobian, wanted)
    if np.linalg.svd(jacobian, compute_uv=False)[-1] >= 0.05:
        assert jacobian @ speeds == pytest.approx(wanted, abs=1e-12)
    # The damped inverse never gains more than 1 / (2 lambda) nor more than 1 / sigma_0.
    assert np.linalg.norm(speeds) <= 31.0 * np.linalg.norm(wanted) + 1e-12


def test_where_a_way_is_lost_the_velocity_turns_away():
    flat = np.diag([1.0, 1.0, 0.0])
    wanted = np.array([0.0, 0.05, 0.05])
    reached = flat @ law.joint_speeds(flat, wanted)
    assert law.turned_away(reached, wanted) == pytest.approx(45.0, abs=0.1)
    assert law.turned_away(np.zeros(3), wanted) == 180.0


@settings(max_examples=30)
@given(INSIDE, SPEEDS)
def test_no_part_of_the_arm_passes_its_speed(angles, speeds):
    posture = CHAIN.posture(angles)
    allowed = law.speed_factor(CHAIN, posture, speeds, LIMITS) * speeds
    assert np.linalg.norm(posture.corner_motions @ allowed, axis=1).max() <= 0.1 + 1e-12
    assert (np.abs(allowed) <= CHAIN.speed + 1e-12).all()
    # Any point of a link lies between the corners of its box: no faster than the fastest corner.
    shares = np.random.default_rng(1).dirichlet(np.ones(8), 20)
    between = np.einsum("sp,pcj->scj", shares, posture.corner_motions[16:])
    assert np.linalg.norm(between @ allowed, axis=1).max() <= 0.1 + 1e-12


@settings(max_examples=30)
@given(INSIDE, SPEEDS)
def test_every_joint_can_stop_inside_its_range(angles, speeds):
    allowed = law.range_factor(CHAIN, angles, speeds, LIMITS) * speeds
    braking = allowed * np.abs(allowed) / CHAIN.acceleration
    stopped = angles + LIMITS.cycle * allowed + braking
    assert (stopped <= CHAIN.upper + 1e-12).all()
    assert (stopped >= CHAIN.lower - 1e-12).all()


@settings(max_examples=30)
@given(INSIDE, SPEEDS)
def test_place_and_parts_can_stop_in_the_workspace(angles, speeds):
    posture = CHAIN.posture(angles)
    place = posture.on_skin([0.06, 0.08, 0.0])
    velocity = posture.jacobian(place) @ speeds
    factor = law.workspace_factor(posture, place, velocity, speeds, LIMITS)
    moving = factor * velocity
    stopped = place + LIMITS.cycle * moving + moving * np.abs(moving) / (2 * LIMITS.braking)
    outward = (place > LIMITS.high) & (moving > 0) | (place < LIMITS.low) & (moving < 0)
    assert not outward.any()
    inside = (place <= LIMITS.high) & (place >= LIMITS.low)
    assert (stopped[inside] <= LIMITS.high[inside] + 1e-12).all()
    assert (stopped[inside] >= LIMITS.low[inside] - 1e-12).all()
    sinking = factor * (posture.corner_motions[:, 2] @ speeds)
    low = posture.corners[:, 2] <= LIMITS.floor
    assert (sinking[low] >= -1e-12).all()


@settings(max_examples=30)
@given(INSIDE, SPEEDS, SPEEDS)
def test_speed_is_gained_no_faster_than_allowed(angles, before, wanted):
    posture = CHAIN.posture(angles)
    gained = law.gained(CHAIN, posture, before, wanted, 0.01, LIMITS) - before
    assert np.linalg.norm(posture.corner_motions @ gained, axis=1).max() <= 0.01 + 1e-12
    assert (np.abs(gained) <= 0.01 * CHAIN.acceleration + 1e-12).all()
    assert np.cross(gained, wanted - before) == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize(
    "wrong",
    [
        {"speed": 0.3},
        {"begin": 0.4},
        {"excessive": 0.5},
        {"patience": 0.0},
        {"release_speed": 0.2},
        {"low": (3.0, 0.0, 0.0)},
        {"resistance": float("nan")},
    ],
)
def test_limits_out_of_their_range_are_refused(wrong):
    with pytest.raises(ArgumentError):
        Limits(**wrong)
