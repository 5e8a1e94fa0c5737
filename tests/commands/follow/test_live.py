"""A source that an arm follows: which arm, and what people may say meanwhile."""

import queue

import numpy as np
import pytest

from smoskin.commands.follow import live
from smoskin.errors import ArgumentError
from smoskin.robot.arm import Arm, ArmState
from smoskin.robot.holding import Holding
from touch_recordings import record

pytest.importorskip("mujoco")


class Asked(Arm):
    """Notes what it is asked."""

    def __init__(self, host, chain):
        self.host, self._chain, self.closed = host, chain, False

    @property
    def chain(self):
        return self._chain

    def state(self):
        still = np.zeros(self._chain.joints)
        return ArmState(angles=still, speeds=still)

    def move(self, speeds):
        return speeds

    def stop(self):
        pass

    def close(self):
        self.closed = True


def test_a_real_arm_is_told_by_the_model_and_held_by_empty_lines(tmp_path, monkeypatch):
    made, signs, messages = [], [], []
    monkeypatch.setattr(live, "XArm", lambda *given: made.append(Asked(*given)) or made[-1])
    monkeypatch.setattr(Holding, "sign", lambda self: signs.append(True))
    words = queue.Queue()
    for word in ("", "", "dance"):
        words.put(word)
    url = f"replay:{record(tmp_path / 'touch.mcap', 6)}?speed=max"
    counters = live.follow_source(url, robot="xarm:10.0.0.7", words=words, say=messages.append)
    (arm,) = made
    assert (arm.host, arm.chain.joints, arm.closed) == ("10.0.0.7", 4, True)
    assert counters.readings == 6
    assert len(signs) == 2
    assert messages[0] == live.WARNING
    assert "Say one of arm, disarm, reset, zero, quit; got 'dance'" in messages


@pytest.mark.parametrize("robot", ["abb:10.0.0.7", "ur", "xarm:", ""])
def test_another_robot_is_refused(tmp_path, robot):
    url = f"replay:{record(tmp_path / 'touch.mcap', 6)}"
    with pytest.raises(ArgumentError, match=f"robot must be ur:HOST or xarm:HOST; got '{robot}'"):
        live.follow_source(url, robot=robot)
