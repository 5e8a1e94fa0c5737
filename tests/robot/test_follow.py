"""The state machine on a small arm: who arms it, what moves it, and all that stops it."""

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.errors import ArgumentError
from smoskin.records import Contact, Estimate, Status
from smoskin.robot.follow import Follow, Seen, State
from smoskin.robot.law import Limits, turned_away
from smoskin.robot.reasons import Reason
from tests.arms import BENT, IdealArm, forearm_chain

PERIOD = 0.01
DESIGN = read_design("planar")
PLACE = (0.06, 0.08)
SURE = 1e-6 * np.eye(5)
PRESS = np.array([0.0, 0.0, -1.0])


class Bench:
    """An arm, what follows on it, and a skin whose estimates are perfect."""

    def __init__(self, angles=BENT, limits=None):
        self.arm = IdealArm(forearm_chain(), angles)
        self.follow = Follow(self.arm.chain, DESIGN, limits)
        self.now = 0.0
        self.path = 0.0
        self.command = None

    def turn(self, force=None, *, seconds=PERIOD, estimate=None, run=True, late=0.0, slow=0.0):
        """Go on for so many seconds under this force; commands on the way."""
        commands = []
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD + slow
            seen = Seen(estimate or self.estimate(force), self.now - late)
            before = self.place()
            self.command = self.follow.step(self.now, seen, self.arm.state(), run=run)
            self.arm.move(self.command.speeds)
            self.arm.advance(PERIOD)
            self.path += np.linalg.norm(self.place() - before)
            commands.append(self.command)
        return commands

    def estimate(self, force=None):
        if force is None:
            return Estimate(time=self.now, status=Status.NO_CONTACT)
        contact = Contact(position=PLACE, force=force)
        return Estimate(
            time=self.now, status=Status.CONTACT, contacts=(contact,), covariance=SURE[None]
        )

    def place(self):
        return self.arm.chain.posture(self.arm.angles).on_skin([*PLACE, 0.0])

    def ready(self):
        self.turn(seconds=0.6)
        self.follow.arm()
        return self


def test_it_is_disarmed_at_first_and_moves_nothing():
    bench = Bench()
    bench.turn(seconds=0.6)
    assert not any(c.speeds.any() for c in bench.turn(PRESS, seconds=1.0))
    assert bench.command.reason is Reason.DISARMED


def test_it_is_armed_only_at_rest_and_untouched():
    bench = Bench()
    with pytest.raises(ArgumentError, match="must rest"):
        bench.follow.arm()
    bench.turn(0.1 * PRESS, seconds=1.0)
    with pytest.raises(ArgumentError, match="untouched"):
        bench.follow.arm()
    bench.turn(seconds=0.4)
    with pytest.raises(ArgumentError):
        bench.follow.arm()
    bench.turn(seconds=0.2)
    bench.arm.speeds = np.array([0.1, 0.0, 0.0])
    bench.turn()
    with pytest.raises(ArgumentError):
        bench.follow.arm()
    bench.ready()
    assert bench.follow.state is State.STANDING
    bench.follow.disarm()
    assert bench.turn(PRESS)[0].state is State.DISARMED


def test_a_ramp_moves_it_from_0_55_and_until_0_45_newtons():
    bench = Bench().ready()
    up = np.arange(0.0, 0.7, 0.005)
    began = next(f for f in up if bench.turn(f * PRESS)[0].speeds.any())
    ended = next(f for f in up[::-1] if not bench.turn(f * PRESS)[0].speeds.any())
    assert began == pytest.approx(0.55, abs=0.0051)
    assert ended == pytest.approx(0.45, abs=0.0051)


@pytest.mark.parametrize("force", [(0.0, 0.0, -0.8), (0.5, 0.0, -0.6), (-0.3, 0.5, -0.6)])
def test_the_touched_place_moves_along_the_force_at_the_law_s_speed(force):
    bench = Bench().ready()
    bench.turn(force, seconds=0.5)
    state = bench.arm.state()
    posture = bench.arm.chain.posture(state.angles)
    velocity = posture.jacobian(bench.place()) @ state.speeds
    assert turned_away(velocity, posture.of_skin(force)) < 1.0
    speed, asked = np.linalg.norm(velocity), (np.linalg.norm(force) - 0.45) / 6.0
    fastest = np.linalg.norm(posture.corner_motions @ state.speeds, axis=1).max()
    assert speed == pytest.approx(asked, rel=0.02) or fastest == pytest.approx(0.1, rel=0.02)
    assert max(fastest, speed) <= 0.1 + 1e-3


def test_one_touch_moves_it_no_farther_than_100_mm_and_lets_go_of_that_by_release():
    bench = Bench().ready()
    bench.turn(PRESS, seconds=4.0)
    assert bench.command.reason is Reason.DISTANCE
    assert 0.08 < bench.path <= 0.1
    bench.turn(seconds=0.1)
    assert any(c.speeds.any() for c in bench.turn(PRESS, seconds=0.1))


def test_one_touch_moves_it_no_longer_than_5_s():
    bench = Bench().ready()
    bench.turn(0.5 * PRESS + [0.25, 0.0, 0.0], seconds=5.2)
    assert bench.command.reason is Reason.DURATION
    assert bench.path < 0.1


@pytest.mark.parametrize(
    ("status", "reason"),
    [
        (Status.STALE, Reason.STALE),
        (Status.SATURATED, Reason.SATURATED),
        (Status.CHIP_MISSING, Reason.CHIP_MISSING),
        (Status.NOT_CALIBRATED, Reason.NOT_CALIBRATED),
        (Status.OUT_OF_RANGE, Reason.OUT_OF_RANGE),
    ],
)
def test_flagged_data_stop_it_for_good(status, reason):
    bench = Bench().ready()
    bench.turn(PRESS, seconds=0.3)
    (command,) = bench.turn(estimate=Estimate(time=bench.now + PERIOD, status=status))
    assert (command.state, command.reason) == (State.FAULT, reason)
    assert not command.speeds.any()
    before = bench.path
    bench.turn(PRESS, seconds=0.5)
    assert bench.follow.fault is reason
    assert bench.path - before <= 0.005
    with pytest.raises(ArgumentError):
        bench.follow.reset()
    bench.turn(seconds=0.6)
    with pytest.raises(ArgumentError, match="reset"):
        bench.follow.arm()
    bench.follow.reset()
    assert bench.follow.state is State.DISARMED
    bench.follow.arm()
    assert any(c.speeds.any() for c in bench.turn(PRESS, seconds=0.1))


def test_what_is_not_known_well_enough_stops_it_while_it_lasts():
    bench = Bench().ready()
    contact = Contact(position=PLACE, force=PRESS)
    for spread, reason in ((9e-5, Reason.WIDE), (np.nan, Reason.WIDE)):
        bench.turn(PRESS, seconds=0.2)
        covariance = spread * np.eye(5)[None]
        estimate = Estimate(
            time=bench.now + PERIOD, status=Status.CONTACT, contacts=(contact,),
            covariance=covariance,
        )  # fmt: skip
        (command,) = bench.turn(estimate=estimate)
        assert command.reason is reason
        assert not command.speeds.any()
    for contacts, status, reason in (
        ((contact,) * 2, Status.CONTACT, Reason.TWO_TOUCHES),
        ((), Status.AMBIGUOUS, Reason.AMBIGUOUS),
    ):
        estimate = Estimate(
            time=bench.now + PERIOD, status=status, contacts=contacts,
            covariance=np.zeros((len(contacts), 5, 5)),
        )  # fmt: skip
        assert bench.turn(estimate=estimate)[0].reason is reason
    assert bench.turn(PRESS)[0].speeds.any()


def test_an_excessive_force_is_given_way_to_a_little_and_then_it_stands():
    bench = Bench().ready()
    bench.turn(0.3 * PRESS, seconds=0.2)
    commands = bench.turn(1.3 * PRESS, seconds=1.0)
    assert commands[0].state is State.RELEASING
    assert 0.005 < bench.path <= 0.010
    assert bench.follow.fault is Reason.FORCE


def test_the_switch_that_must_be_held_stops_it():
    bench = Bench().ready()
    bench.turn(PRESS, seconds=0.2)
    (command,) = bench.turn(PRESS, run=False)
    assert command.reason is Reason.SWITCH
    assert not command.speeds.any()
    assert bench.turn(PRESS)[0].speeds.any()


def test_without_the_switch_it_does_not_give_way_either():
    bench = Bench().ready()
    commands = bench.turn(1.3 * PRESS, seconds=0.5, run=False)
    assert not any(command.speeds.any() for command in commands)
    assert (bench.path, bench.follow.fault) == (0.0, Reason.FORCE)
    bench = Bench().ready()
    assert bench.turn(1.3 * PRESS, seconds=0.1)[-1].state is State.RELEASING
    (command,) = bench.turn(1.3 * PRESS, run=False)
    assert (command.state, bench.follow.fault) == (State.FAULT, Reason.FORCE)
    assert not command.speeds.any()


def test_silence_and_a_late_loop_stop_it():
    bench = Bench().ready()
    assert bench.turn(PRESS, late=0.06)[0].reason is Reason.SILENT
    bench = Bench().ready()
    assert bench.turn(PRESS, slow=0.03)[0].reason is Reason.DEADLINE


def test_a_jump_of_either_clock_stops_it():
    for shift in (-3.0, 0.5, 1e9):
        bench = Bench().ready()
        shifted = Estimate(time=bench.now + shift, status=Status.NO_CONTACT)
        assert bench.turn(estimate=shifted)[0].reason is Reason.CLOCK
    bench = Bench().ready()
    seen = Seen(bench.estimate(), bench.now)
    assert bench.follow.step(bench.now - 1.0, seen, bench.arm.state()).reason is Reason.CLOCK


def test_contact_of_the_arm_or_one_that_goes_its_own_way_stops_it():
    bench = Bench().ready()
    bench.turn(PRESS, seconds=0.1)
    bench.arm.meets = "forearm and ground"
    assert bench.turn(PRESS)[0].reason is Reason.COLLISION
    bench = Bench().ready()
    bench.arm.speeds = np.array([np.nan, 0.0, 0.0])
    assert bench.turn()[0].reason is Reason.ARM
    bench = Bench().ready()
    bench.arm.move = lambda speeds: speeds  # it takes speeds, and stays
    assert bench.turn(PRESS, seconds=0.6)[-1].state is State.FAULT
    assert bench.follow.fault is Reason.ASTRAY


def test_where_joints_cannot_go_that_way_it_stands_and_says_so():
    above, along = 0.08, 0.18
    stretched = np.array([0.3, 0.6, -np.arctan2(above, along)])  # shoulder, elbow, place in a line
    bench = Bench(stretched).ready()
    away = 0.8 * np.array([along, 0.0, above]) / np.hypot(along, above)
    bench.turn(away, seconds=0.3)
    assert bench.command.reason is Reason.NO_WAY
    assert bench.path < 1e-6
    bench.turn(seconds=0.1)
    across = 0.8 * np.array([above, 0.0, -along]) / np.hypot(along, above)
    bench.turn(across, seconds=0.3)
    assert bench.command.reason is Reason.MOVING


def test_it_stops_before_the_end_of_range_and_workspace():
    bench = Bench(np.array([0.0, 2.4, -1.6])).ready()
    bench.turn([-0.9, 0.0, 0.0], seconds=1.5)
    assert bench.command.reason in (Reason.JOINT_RANGE, Reason.DISTANCE, Reason.NO_WAY)
    assert (bench.arm.angles <= bench.arm.chain.upper).all()
    low = Bench().place()[2] - 0.03
    bench = Bench(limits=Limits(low=(-2.0, -2.0, low))).ready()
    bench.turn(PRESS, seconds=2.0)
    assert bench.command.reason is Reason.WORKSPACE
    assert low - 1e-4 <= bench.place()[2] < low + 0.01
