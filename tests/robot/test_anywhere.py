"""An arm that yields, held anywhere: how it goes near singular poses, and where it begins to."""

from collections import Counter

import numpy as np
import pytest

import smoskin as smo
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Motion, Pose, Status
from smoskin.robot.follow import Follow, Seen
from smoskin.robot.law import turned_away
from smoskin.robot.simulated import SimulatedArm
from smoskin.sensing.estimators import ZeroFirst
from smoskin.twin.creep import Creep

pytest.importorskip("mujoco")
pytest.importorskip("jax")
DESIGN = read_design("curved")
PERIOD = 0.01
SURE = 1e-6 * np.eye(5)[None]


def touch_of(rng, size):
    """A touch anywhere but at the rim, of this size, N, dragged by up to a third."""
    place = 0.01 + rng.uniform(size=2) * (geometry(DESIGN).extent - 0.02)
    bearing, drag = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.35)
    way = np.array([drag * np.cos(bearing), drag * np.sin(bearing), -1.0])
    return Contact(position=place, force=size * way / np.linalg.norm(way))


def any_angles(chain, rng, number):
    """Joints at random; of every third pose one is all but at its end, where arms are singular."""
    angles = rng.uniform(np.maximum(chain.lower, -3.0), np.minimum(chain.upper, 3.0))
    if number % 3 == 0:
        joint = rng.integers(chain.joints)
        angles[joint] = 0.97 * (chain.upper if rng.random() < 0.5 else chain.lower)[joint]
    return angles


def pushed(arm, clock, touch):
    """Least singular value of the touched place's Jacobian, m, and how the place then moved.

    Angles between its velocity and the force, degrees, from 0.15 s after the arm began to move.
    """
    follow, roll = Follow(arm.chain, DESIGN), geometry(DESIGN).roll
    for _ in range(60):
        clock[0] += PERIOD
        nothing = Estimate(time=clock[0], status=Status.NO_CONTACT)
        follow.step(clock[0], Seen(nothing, clock[0]), arm.state())
    follow.arm()
    began, away, least = None, [], np.inf
    for _ in range(60):
        clock[0] += PERIOD
        state = arm.state()
        posture = arm.chain.posture(state.angles)
        place = posture.on_skin(roll.places(np.array([*touch.position, 0.0])))
        push = posture.of_skin(roll.axes(touch.position[1]) @ touch.force)
        jacobian = posture.jacobian(place)
        least = min(least, np.linalg.svd(jacobian, compute_uv=False)[-1])
        estimate = Estimate(
            time=clock[0], status=Status.CONTACT, contacts=(touch,), covariance=SURE
        )
        command = follow.step(clock[0], Seen(estimate, clock[0]), state)
        arm.push(place, push)
        if not command.speeds.any():
            arm.stop()
            continue
        arm.move(command.speeds)
        began = clock[0] if began is None else began
        velocity = jacobian @ state.speeds
        if clock[0] - began >= 0.15 and np.linalg.norm(velocity) > 5e-3:
            away.append(turned_away(velocity, push))
    return least, away


@pytest.mark.slow
def test_the_touched_place_goes_along_the_force_in_any_pose_or_stands():
    """Near-singular poses included: where the joints cannot go that way, it stands."""
    rng, clock, pushes, refused = np.random.default_rng(7), [0.0], [], Counter()
    for number in range(150):
        with SimulatedArm(DESIGN, lambda: clock[0]) as arm:
            arm.pose(any_angles(arm.chain, rng, number))
            try:
                pushes.append(pushed(arm, clock, touch_of(rng, rng.uniform(0.6, 1.2))))
            except ArgumentError as error:  # it meets itself or the ground there
                refused[str(error)] += 1
    moved = [(least, max(away)) for least, away in pushes if away]
    assert len(pushes) > 60, refused
    assert len(moved) > 40
    assert sum(least < 0.05 for least, _ in moved) >= 5
    assert max(angle for _, angle in moved) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_an_arm_begins_and_ends_to_move_about_half_a_newton_on_a_noiseless_skin(seed):
    """A force that grows by 0.5 N a second, and lessens again: 0.55 N and 0.45 N are the limits."""
    rng, clock, twin = np.random.default_rng(seed), [0.0], smo.Twin(DESIGN)
    estimator = ZeroFirst(smo.BayesEstimator(DESIGN, smo.load_response_table("curved")))
    estimator.carried_by(lambda: Pose(turn=np.eye(3)))
    creep, touch = Creep(DESIGN), touch_of(rng, 1.0)
    with SimulatedArm(DESIGN, lambda: clock[0]) as arm:
        follow = Follow(arm.chain, DESIGN)

        def moves(force):
            """Whether the arm moves under so many newtons of that touch."""
            clock[0] += PERIOD
            touches = [Contact(position=touch.position, force=force * touch.force)]
            motion = twin.motion(touches if force else [])
            motion = Motion(magnets=motion.magnets[None], board=motion.board[None])
            late = creep.steps(np.array([PERIOD]), motion)[0]
            reading = twin.readout.read(late, None, time=clock[0])
            command = follow.step(clock[0], Seen(estimator.step(reading), clock[0]), arm.state())
            if command.speeds.any():
                arm.move(command.speeds)
            else:
                arm.stop()
            return bool(command.speeds.any())

        for _ in range(80):
            assert not moves(0.0)
        follow.arm()
        forces = np.arange(0.005, 0.7, 0.005)
        begin = next(force for force in forces if moves(force))
        end = next(force for force in np.arange(begin, 0.0, -0.005) if not moves(force))
    assert begin == pytest.approx(0.55, abs=0.025)
    assert end == pytest.approx(0.45, abs=0.025)
