"""Faults put in between chips and arm: how soon it is told to stand, and how it comes back."""

from functools import cache

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, SourceError
from smoskin.records import ChipFlag, Contact, Reading
from smoskin.robot.driver import Driver
from smoskin.robot.follow import Follow, State
from smoskin.robot.reasons import Reason
from smoskin.robot.simulated import SimulatedArm
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.twin.reduced import ReducedTwin
from tests.arms import IdealArm, forearm_chain

PERIOD = 0.01
DESIGN = read_design("planar")
PLACE = (0.045, 0.08)


@cache
def motion_under(force):
    contacts = (Contact(position=PLACE, force=(0.0, 0.0, -force)),) * (force > 0)
    return ReducedTwin(DESIGN, seed=1).motion(contacts)


class Rig:
    """A skin read at a steady rate, an estimator, a driver, an arm; time goes step by step."""

    def __init__(self, simulated=False):
        self.now = 0.0
        self.arm = (
            SimulatedArm(DESIGN, lambda: self.now) if simulated else IdealArm(forearm_chain())
        )
        self.advance = (lambda seconds: None) if simulated else self.arm.advance
        self.follow = Follow(self.arm.chain, DESIGN)
        self.driver = Driver(self.arm, self.follow, clock=lambda: self.now)
        self.twin = ReducedTwin(DESIGN, seed=1)
        self.estimator = ZeroFirst(ClosedFormEstimator(DESIGN))
        self.spoil = lambda reading: reading

    def turn(self, force=0.0, steps=1):
        commands = []
        for _ in range(steps):
            self.now += PERIOD
            reading = self.spoil(self.twin.sense(motion_under(force), time=self.now))
            if reading is not None:
                self.driver.write(reading, self.estimator.step(reading))
            commands.append(self.driver.look())
            self.advance(PERIOD)
        return commands

    def place(self):
        """Where the touched place is, m."""
        return self.arm.chain.posture(self.arm.state().angles).on_skin([*PLACE, 0.0])

    def moving(self):
        """The rig with its arm armed and moving under a touch."""
        self.turn(steps=75)
        self.driver.arm()
        commands = self.turn(0.8, steps=15)
        assert commands[-1].state is State.MOVING
        return self


def changed(reading, **parts):
    values = {"time": reading.time, "field": reading.field, "flags": reading.flags}
    return Reading(**(values | {"temperature": reading.temperature} | parts))


def with_flag(flag):
    return lambda reading: changed(reading, flags=[int(flag), 0, 0])


def without_numbers(reading):
    field = reading.field.copy()
    field[1] = np.nan
    return changed(reading, field=field)


def throws(*_):
    raise SourceError("gone")


FAULTS = {
    "source dies": (lambda reading: None, Reason.SILENT),
    "no numbers": (without_numbers, Reason.CHIP_MISSING),
    "saturated": (with_flag(ChipFlag.SATURATED), Reason.SATURATED),
    "chip missing": (with_flag(ChipFlag.MISSING), Reason.CHIP_MISSING),
    "chips have nothing new": (
        lambda reading: changed(reading, flags=[int(ChipFlag.OLD)] * 3),
        Reason.STALE,
    ),
    "clock forward": (lambda reading: changed(reading, time=reading.time + 60.0), Reason.CLOCK),
    "clock back": (lambda reading: changed(reading, time=reading.time - 0.5), Reason.CLOCK),
    "arm takes nothing": ("move", Reason.ARM),
    "arm tells nothing": ("state", Reason.ARM),
}


@pytest.mark.parametrize("simulated", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_stops_the_arm_within_20_ms_of_being_seen(fault, simulated):
    if simulated:
        pytest.importorskip("mujoco")
    rig = Rig(simulated).moving()
    spoil, reason = FAULTS[fault]
    if callable(spoil):
        rig.spoil = spoil
    else:
        works = getattr(rig.arm, spoil)
        setattr(rig.arm, spoil, throws)
    if reason is Reason.SILENT:
        rig.turn(0.8, steps=5)  # readings may stay away for so long
    commands = rig.turn(0.8, steps=2)  # 20 ms
    assert rig.follow.fault is reason
    assert not commands[-1].speeds.any()
    if not callable(spoil):
        setattr(rig.arm, spoil, works)
    # It stands after v / a more, and within 5 mm, though the touch goes on.
    state, place = rig.arm.state(), rig.place()
    slowing = np.abs(state.speeds / rig.arm.chain.acceleration).max()
    after = rig.turn(0.8, steps=round(slowing / PERIOD) + 3)
    assert not any(command.speeds.any() for command in after)
    assert np.abs(rig.arm.state().speeds).max() < 0.02
    assert np.linalg.norm(rig.place() - place) <= 0.005
    # What was wrong is mended, the touch has gone: that alone moves nothing again.
    rig.spoil = lambda reading: reading
    rig.turn(steps=10)
    rig.turn(0.8, steps=5)
    assert rig.follow.fault is reason
    rig.estimator.reset()
    rig.turn(steps=75)
    with pytest.raises(ArgumentError, match="reset"):
        rig.driver.arm()
    rig.driver.reset()
    assert not any(command.speeds.any() for command in rig.turn(0.8, steps=5))
    rig.turn(steps=60)
    rig.driver.arm()
    assert rig.turn(0.8, steps=15)[-1].state is State.MOVING


def test_a_chip_that_sticks_stops_the_arm_as_soon_as_it_is_told():
    rig = Rig().moving()
    stuck = rig.twin.sense(motion_under(0.8), time=0.0).field[0]

    def stick(reading):
        return changed(reading, field=[stuck, *reading.field[1:]])

    rig.spoil = stick
    commands = [rig.turn(force)[0] for force in (0.7, 0.8, 0.9, 0.8) * 30]
    assert rig.follow.fault is Reason.CHIP_MISSING
    first = next(k for k, command in enumerate(commands) if command.state is State.FAULT)
    assert not any(command.speeds.any() for command in commands[first:])


def test_readings_that_come_again_to_the_bit_stop_a_moving_arm():
    rig = Rig().moving()
    last = rig.twin.sense(motion_under(0.8), time=0.0).field
    rig.spoil = lambda reading: changed(reading, field=last)
    assert all(command.speeds.any() for command in rig.turn(0.8, steps=5))
    commands = rig.turn(0.8, steps=3)
    assert rig.follow.fault is Reason.STALE
    assert not commands[-1].speeds.any()
    # One that stands is not stopped by a quiet skin.
    rig = Rig()
    rig.turn(steps=75)
    rig.driver.arm()
    rest = rig.twin.sense(motion_under(0.0), time=0.0).field
    rig.spoil = lambda reading: changed(reading, field=rest)
    rig.turn(steps=50)
    assert rig.follow.state is State.STANDING


def test_an_arm_that_throws_is_stopped_and_stays_so_until_reset():
    rig = Rig().moving()
    works = rig.arm.state

    def throws():
        raise SourceError("gone")

    rig.arm.state = throws
    (command,) = rig.turn(0.8)
    assert (command.state, command.reason) == (State.FAULT, Reason.ARM)
    assert not rig.arm.asked.any()
    rig.arm.state = works
    rig.turn(0.8, steps=20)
    assert rig.follow.fault is Reason.ARM
    with pytest.raises(ArgumentError):
        rig.driver.reset()
    rig.turn(steps=100)
    rig.driver.reset()
    assert rig.follow.state is State.DISARMED
    rig.turn(0.8, steps=20)
    assert not rig.arm.asked.any()


def test_disarming_and_closing_stop_it_at_once():
    rig = Rig().moving()
    rig.driver.disarm()
    assert not rig.arm.asked.any()
    rig = Rig().moving()
    rig.driver.close()
    assert not rig.arm.asked.any()


def test_its_own_thread_looks_again_and_again():
    commands = []
    arm = IdealArm(forearm_chain())
    with Driver(arm, Follow(arm.chain, DESIGN), on_command=commands.append) as driver:
        driver.start(200.0)
        while len(commands) < 5:
            pass
    count = len(commands)
    assert count >= 5
    assert commands[-1].reason is Reason.DISARMED
