"""An xArm at the boundary of its maker's library: calls are checked against its own signatures."""

import gc
import io
from contextlib import redirect_stdout
from unittest.mock import PropertyMock, create_autospec

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, SourceError
from smoskin.robot.driver import Driver
from smoskin.robot.follow import Follow
from smoskin.robot.reasons import Reason
from smoskin.robot.simulated import SimulatedArm
from smoskin.robot.xarm import XArm, _open

pytest.importorskip("mujoco")
pytest.importorskip("xarm")
with redirect_stdout(io.StringIO()):
    from xarm.wrapper import XArmAPI

DESIGN = read_design("curved")


class Controller:
    """What the arm behind the library does: speeds that end, errors, others who take it over."""

    def __init__(self, joints):
        self.now, self.joints = 0.0, joints
        self.angles, self.speeds, self.until = np.zeros(7), np.zeros(7), 0.0
        self.firmware, self.error, self.state, self.mode = (2, 1, 0), 0, 4, 0
        self.connected, self.codes, self.commands = True, {}, []
        kind = type("Api", (XArmAPI,), {})
        self.api = create_autospec(kind, instance=True, spec_set=False)
        own = {
            "version_number": lambda: self.firmware,
            "axis": lambda: self.joints,
            "error_code": lambda: self.error,
            "state": lambda: self.state,
            "mode": lambda: self.mode,
            "connected": lambda: self.connected,
        }
        for name, tells in own.items():
            setattr(type(self.api), name, PropertyMock(side_effect=tells))
        self.api.motion_enable.side_effect = lambda **_: self.codes.get("enable", 0)
        self.api.set_mode.side_effect = self.set_mode
        self.api.set_state.side_effect = self.set_state
        self.api.vc_set_joint_velocity.side_effect = self.velocity
        self.api.get_joint_states.side_effect = self.joint_states

    def set_mode(self, mode=0, detection_param=0):
        self.mode = mode
        return self.codes.get("mode", 0)

    def set_state(self, state=0):
        self.state = 2 if state == 0 else state
        if state == 4:
            self.speeds = np.zeros(7)
        return self.codes.get("state", 0)

    def velocity(self, speeds, is_radian=None, is_sync=True, duration=-1, **kwargs):
        self.commands.append((speeds, duration))
        if code := self.codes.get("velocity", 0):
            return code
        assert is_radian is True
        self.speeds = np.pad(np.array(speeds), (0, 7 - len(speeds)))
        self.until = self.now + duration if duration > 0 else np.inf
        return 0

    def wait(self, seconds):
        moving = max(0.0, min(self.until - self.now, seconds))
        self.angles = self.angles + moving * self.speeds
        self.now += seconds
        if self.now >= self.until:
            self.speeds = np.zeros(7)

    def joint_states(self, is_radian=None, num=3):
        assert is_radian is True
        joints = [self.angles.tolist(), self.speeds.tolist(), [0.0] * 7]
        return self.codes.get("joints", 0), joints


@pytest.fixture
def chain():
    with SimulatedArm(DESIGN, lambda: 0.0) as arm:
        return arm.chain


@pytest.fixture
def controller(chain):
    return Controller(chain.joints)


def test_it_moves_as_it_is_asked_and_tells_what_it_does(controller, chain):
    with XArm("192.168.1.1", chain, connect=lambda host: controller.api) as arm:
        asked = np.array([0.2, -0.1, 0.3, 99.0])
        commanded = arm.move(asked)
        np.testing.assert_allclose(commanded, [0.2, -0.1, 0.3, chain.speed[3]])
        controller.wait(0.05)
        state = arm.state()
        np.testing.assert_allclose(state.speeds, commanded)
        np.testing.assert_allclose(state.angles, 0.05 * commanded)
        arm.stop()
        assert not arm.state().speeds.any()
    assert controller.api.disconnect.call_count == 1
    assert controller.api.set_timeout.call_args.args == (0.1,)


def test_an_arm_whose_master_is_gone_stands_within_a_tenth_of_a_second(controller, chain):
    """Whatever kills this process, the last speed that the arm was told has its own end."""
    arm = XArm("192.168.1.1", chain, connect=lambda host: controller.api)
    for _ in range(5):
        arm.move(np.full(chain.joints, 0.3))
        controller.wait(0.02)
    del arm  # nothing is called any more
    controller.wait(0.1)
    assert not controller.speeds.any()
    assert controller.angles[0] <= 0.3 * (4 * 0.02 + 0.1) + 1e-12
    assert all(0.0 < duration <= 0.1 for _, duration in controller.commands)


@pytest.mark.parametrize("firmware", [(1, 7, 9), (1, 8, 0), (0, 9, 9)])
def test_firmware_whose_speeds_do_not_end_is_refused_before_anything_moves(
    controller, chain, firmware
):
    controller.firmware = firmware
    has = ".".join(map(str, firmware))
    with pytest.raises(SourceError, match=rf"firmware 1\.9\.0 or newer.*it runs {has}"):
        XArm("192.168.1.1", chain, connect=lambda host: controller.api)
    assert controller.commands == []
    assert controller.api.disconnect.called


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("enable", "did not be enabled: code 9"),
        ("mode", "did not take speeds: code 9"),
        ("state", "did not begin: code 9"),
    ],
)
def test_an_arm_that_does_not_obey_is_not_taken(controller, chain, step, sentence):
    controller.codes[step] = 9
    with pytest.raises(SourceError, match=sentence):
        XArm("192.168.1.1", chain, connect=lambda host: controller.api)


def test_an_arm_of_other_joints_in_error_or_out_of_reach_is_refused(controller, chain):
    controller.joints = 7
    with pytest.raises(ArgumentError, match="chain must have the arm's 7 joints; got 4"):
        XArm("192.168.1.1", chain, connect=lambda host: controller.api)
    controller.joints, controller.error = chain.joints, 22
    with pytest.raises(SourceError, match="shows error 22: clear it at the arm"):
        XArm("192.168.1.1", chain, connect=lambda host: controller.api)

    def nobody(host):
        raise Exception("connect socket failed")

    with pytest.raises(SourceError, match=r"xArm at 10\.0\.0\.9 cannot be reached: connect socket"):
        XArm("10.0.0.9", chain, connect=nobody)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_makers_own_library_says_in_time_that_nobody_answers():
    with pytest.raises(Exception, match="connect socket failed"):
        _open("127.0.0.1")
    gc.collect()  # the library leaves its socket to the collector, which warns of it


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"error": 31}, "shows error 31"),
        ({"connected": False}, "is not connected any more"),
        ({"state": 4}, "taken out of our hands: its state is 4, its mode 4"),
        ({"mode": 2}, "taken out of our hands: its state is 2, its mode 2"),
        ({"codes": {"joints": 3}}, "did not tell its joints: code 3"),
        ({"angles": np.full(7, np.nan)}, "joints that are no numbers"),
    ],
)
def test_what_goes_wrong_on_the_way_is_a_fault_and_the_arm_stands(
    controller, chain, change, sentence
):
    arm = XArm("192.168.1.1", chain, connect=lambda host: controller.api)
    driver = Driver(arm, Follow(chain, DESIGN), clock=lambda: controller.now)
    assert driver.look().reason is not Reason.ARM
    arm.move(np.full(chain.joints, 0.3))
    for name, value in change.items():
        setattr(controller, name, value)
    with pytest.raises(SourceError, match=sentence):
        arm.state()
    assert driver.look().reason is Reason.ARM
    assert not controller.speeds.any()
    driver.close()
    with pytest.raises(SourceError, match="the arm is closed"):
        arm.state()


def test_an_arm_that_takes_no_speed_any_more_is_told_to_stop(controller, chain):
    arm = XArm("192.168.1.1", chain, connect=lambda host: controller.api)
    arm.move(np.full(chain.joints, 0.3))
    controller.codes["velocity"] = 1
    with pytest.raises(SourceError, match="did not move: code 1"):
        arm.move(np.full(chain.joints, 0.3))
    arm.stop()
    assert controller.state == 4
    assert not controller.speeds.any()
    controller.codes["state"] = 1
    with pytest.raises(SourceError, match="did not stop: code 1"):
        arm.stop()
    with pytest.raises(SourceError, match="did not stop: code 1"):
        arm.close()
    assert controller.api.disconnect.called
    arm.close()
