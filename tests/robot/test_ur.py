"""A UR arm by the library that people use, against a controller's ports byte for byte."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from smoskin.errors import ArgumentError, SourceError
from smoskin.robot.chain import Chain
from smoskin.robot.ur import UrArm
from ur_robot import robot

pytest.importorskip("rtde_control")
if not sys.platform.startswith("linux"):
    pytest.skip("ports on loopback addresses of their own", allow_module_level=True)

MANY = 0.5
"""s for which a speed is kept up in tests."""


def chain(joints: int = 6) -> Chain:
    """Joints in a row, one above the other."""
    every = np.ones(joints)
    return Chain(
        axes=np.tile([0.0, 0.0, 1.0], (joints, 1)),
        anchors=np.arange(3.0 * joints).reshape(joints, 3),
        lower=-3 * every,
        upper=3 * every,
        speed=1.5 * every,
        acceleration=10.0 * every,
        carriers=joints,
        origin=np.zeros(3),
        turn=np.eye(3),
        corners=np.zeros((1, 3)),
        moved_by=np.array([joints]),
    )


def until(holds, deadline=5.0):
    end = time.monotonic() + deadline
    while not holds():
        assert time.monotonic() < end, "did not come true"
        time.sleep(0.002)


def test_it_moves_as_it_is_told_and_tells_what_it_does():
    wanted = np.array([0.2, -0.1, 0.0, 0.3, 0.0, 0.05])
    with robot() as controller, UrArm(controller.host, chain()) as arm:
        assert arm.chain.joints == 6
        assert not arm.state().speeds.any()
        end = time.monotonic() + MANY
        while time.monotonic() < end:
            np.testing.assert_array_equal(arm.move(wanted), wanted)
            state = arm.state()
            time.sleep(0.01)
        np.testing.assert_allclose(state.speeds, wanted)
        np.testing.assert_allclose(state.angles, controller.get("angles"), atol=0.03)
        assert (state.angles[wanted > 0] > 0.3 * MANY * wanted[wanted > 0]).all()
        assert arm.move(np.full(6, 9.0)).max() == 1.5  # no joint faster than it may
        arm.stop()
        until(lambda: not arm.state().speeds.any())
        arm.close()
        until(lambda: not controller.get("running"))
    with pytest.raises(SourceError, match="closed"):
        arm.state()


def test_a_standing_arm_is_kept_and_a_speed_that_is_not_asked_anew_ends():
    with robot() as controller, UrArm(controller.host, chain()) as arm:
        assert controller.get("watched") == 20.0
        end = time.monotonic() + 0.3
        while time.monotonic() < end:  # six times what its watchdog waits for
            arm.state()
            time.sleep(0.01)
        arm.move(np.full(6, 0.2))
        begun = time.monotonic()
        with pytest.raises(SourceError, match="runs our program no more"):
            until(lambda: arm.state() is None, 1.0)
        until(lambda: not controller.get("speeds").any(), 0.5)
        moved = [moment for moment, speeds in controller.get("history") if speeds.any()]
        assert moved[-1] - begun < 0.25


def test_silence_of_our_own_ends_its_program():
    with robot() as controller, UrArm(controller.host, chain()) as arm:
        arm.move(np.full(6, 0.2))
        until(lambda: not controller.get("running"))
        with pytest.raises(SourceError, match="missed us for 50 ms"):
            until(lambda: arm.state() is None, 1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"safety_mode": 3}, "a protective stop; clear it at the arm"),
        ({"safety_mode": 7}, "an emergency stop"),
        ({"robot_mode": 5}, r"not ready \(mode 5\): switch it on"),
        ({"frozen": True}, "tells nothing any more"),
    ],
)
def test_what_stops_the_arm_is_an_error_with_its_cause(change, words):
    with robot() as controller, UrArm(controller.host, chain()) as arm:
        arm.state()
        controller.set(**change)
        with pytest.raises(SourceError, match=words):
            until(lambda: arm.state() is None, 1.0)


def test_an_arm_that_cannot_be_moved_is_refused():
    with pytest.raises(ArgumentError, match="must have the arm's 6 joints; got 7"):
        UrArm("127.0.0.1", chain(7))
    with pytest.raises(SourceError, match=r"UR at 127.0.0.79: it cannot be moved"):
        UrArm("127.0.0.79", chain())
    for change, words in (({"remote": False}, "remote"), ({"safety_mode": 3}, "protective stop")):
        with robot() as controller:
            controller.set(**change)
            with pytest.raises(SourceError, match=words):
                UrArm(controller.host, chain())


MASTER = """
    import sys, time
    import numpy as np
    sys.path[:0] = {paths!r}
    from test_ur import UrArm, chain
    arm = UrArm({host!r}, chain())
    print("moves", flush=True)
    while True:
        arm.move(np.full(6, 0.2))
        arm.state()
        time.sleep(0.01)
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_killed_or_stopped_master_leaves_a_standing_arm_within_a_tenth_of_a_second(number):
    paths = [str(Path(__file__).parent), str(Path(__file__).parents[1])]
    with robot() as controller:
        code = textwrap.dedent(MASTER.format(paths=paths, host=controller.host))
        master = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
        try:
            assert master.stdout.readline() == "moves\n"
            until(lambda: np.allclose(controller.get("speeds"), 0.2))
            time.sleep(0.3)
            assert controller.get("running")
            os.kill(master.pid, number)
            killed = time.monotonic()
            until(lambda: not controller.get("speeds").any())
            moved = [moment for moment, speeds in controller.get("history") if speeds.any()]
            assert 0.0 < moved[-1] - killed < 0.1
        finally:
            master.kill()
            master.wait()
            master.stdout.close()


def test_a_client_by_others_reads_the_controller():
    receive = pytest.importorskip("rtde_receive")
    with robot() as controller:
        controller.set(angles=np.arange(6.0))
        client = receive.RTDEReceiveInterface(controller.host, -1.0, ["timestamp", "actual_q"])
        until(lambda: client.getTimestamp() > 0)
        np.testing.assert_array_equal(client.getActualQ(), np.arange(6.0))
        client.disconnect()


def test_the_client_of_the_robots_maker_reads_and_writes_the_controller():
    """Universal Robots' RTDE_Python_Client_Library is in no package index: put it on the path."""
    rtde = pytest.importorskip("rtde.rtde", reason="UR's own RTDE client is not installed")
    outputs = [("timestamp", "DOUBLE"), ("actual_q", "VECTOR6D"), ("runtime_state", "UINT32")]
    with robot() as controller:
        controller.set(angles=np.arange(6.0))
        client = rtde.RTDE(controller.host)
        client.connect()
        assert client.get_controller_version() == (5, 11, 0, 108249)
        names, types = map(list, zip(*outputs, strict=True))
        assert client.send_output_setup(names, types, frequency=500)
        asked = client.send_input_setup(
            ["input_int_register_0", "input_double_register_0"], ["INT32", "DOUBLE"]
        )
        assert client.send_start()
        first = client.receive()
        assert first.actual_q == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
        assert first.runtime_state == 1
        until(lambda: client.receive().timestamp > first.timestamp)
        # A watchdog of 20 Hz, which a running program takes.
        controller.set(running=True)
        asked.input_int_register_0, asked.input_double_register_0 = 35, 20.0
        assert client.send(asked)
        until(lambda: controller.get("watched") == 20.0)
        until(lambda: client.receive().runtime_state == 1)  # nobody kicks it
        assert client.send_pause()
        client.disconnect()
