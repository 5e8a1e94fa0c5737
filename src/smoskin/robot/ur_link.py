"""The process that speaks to a UR arm for `smoskin.robot.ur`, over a pipe.

Decides that the arm stops by itself where it is not told anew within a twentieth of a second: a
speed would go on for ever. Hides `ur_rtde`, which may wait for minutes and lets nothing else run in
its process meanwhile; who asks gives up sooner and ends this one.
"""

import json
import math
import sys
import time
from multiprocessing.connection import Connection
from typing import Any, Final

WATCHDOG: Final = 20.0
"""Least frequency, 1/s, at which the robot must hear of us: else its program ends, it stands."""
_KEPT: Final = 0.1
"""Time after which a speed is not kept up any more unless it is asked for again, s."""
_SILENT: Final = 0.1
"""Time after which a state that does not come anew is none, s."""
_BEGUN: Final = 2.0
"""Time that the robot has to tell its first state, s."""
_TOLD: Final = ["timestamp", "actual_q", "actual_qd", "robot_mode", "safety_mode"]
_RUNNING: Final = 7
"""Its mode of an arm with power and free brakes."""
_SAFE: Final = (1, 2)
"""Its modes of safety in which it may move: normal and reduced."""
_STOPPED: Final = {
    3: "a protective stop",
    5: "the system's own emergency stop",
    6: "its own emergency stop",
    7: "an emergency stop",
}


class Link:
    """Both of the library's connections to an arm; a `RuntimeError` says what is wrong."""

    def __init__(self, host: str) -> None:
        from rtde_control import RTDEControlInterface
        from rtde_receive import RTDEReceiveInterface

        self._moving, self._asked = False, -math.inf
        self._stamp, self._heard = 0.0, -math.inf
        self._receive: Any = RTDEReceiveInterface(host, -1.0, _TOLD)
        until = time.monotonic() + _BEGUN
        while not self._receive.getTimestamp() and time.monotonic() < until:
            time.sleep(0.01)
        self._check_ready()
        self._control: Any = RTDEControlInterface(host)
        # From here on silence stops it.
        self._done("watch us", self._control.setWatchdog(WATCHDOG))

    def state(self) -> list[list[float]]:
        """Angles, rad, and speeds, rad/s."""
        self._check()
        # What was asked for long ago is not kept up.
        if not self._moving or time.monotonic() - self._asked < _KEPT:
            self._done("hear us", self._control.kickWatchdog())
        return [list(self._receive.getActualQ()), list(self._receive.getActualQd())]

    def move(self, speeds: list[float], acceleration: float) -> None:
        """Turn at these speeds, rad/s, of joints that change them by so many rad/s^2."""
        self._check()
        self._done("move", self._control.speedJ(speeds, acceleration, 0.0))
        self._moving, self._asked = True, time.monotonic()

    def stop(self, acceleration: float) -> None:
        """Turn at no speed."""
        self._check()
        self._done("stop", self._control.speedStop(acceleration))
        self._moving = False

    def close(self) -> None:
        """End the program on the robot, which stops it, and both connections."""
        if self._control.isConnected():
            self._control.stopScript()
        self._control.disconnect()
        self._receive.disconnect()

    def _check(self) -> None:
        """Raise unless the arm may move and does as we say."""
        self._check_ready()
        if not self._control.isProgramRunning():
            raise RuntimeError(
                f"it runs our program no more: it has missed us for {1e3 / WATCHDOG:.0f} ms, or "
                "another one was started"
            )

    def _check_ready(self) -> None:
        """Raise unless the arm tells what it does and may move."""
        now, stamp = time.monotonic(), self._receive.getTimestamp()
        if stamp != self._stamp:
            self._stamp, self._heard = stamp, now
        if not self._receive.isConnected() or now - self._heard > _SILENT:
            raise RuntimeError("it tells nothing any more")
        safety, mode = self._receive.getSafetyMode(), self._receive.getRobotMode()
        if safety not in _SAFE:
            why = _STOPPED.get(safety, f"safety mode {safety}")
            raise RuntimeError(f"it was stopped: {why}; clear it at the arm")
        if mode != _RUNNING:
            raise RuntimeError(f"it is not ready (mode {mode}): switch it on, free its brakes")

    def _done(self, what: str, answer: bool) -> None:
        """Raise for an answer that means that something was not done."""
        if not answer:
            raise RuntimeError(f"it did not {what}")


def main(host: str, pipe: Connection) -> None:
    """Do what is asked over the pipe until whoever asks is gone: then the arm stops."""
    try:
        link = Link(host)
    except RuntimeError as error:
        pipe.send_bytes(json.dumps({"error": f"it cannot be moved: {error}"}).encode())
        return
    pipe.send_bytes(b"{}")
    try:
        while True:
            what, *numbers = json.loads(pipe.recv_bytes())
            try:
                answer: dict[str, object] = {"answer": getattr(link, what)(*numbers)}
            except RuntimeError as error:
                answer = {"error": str(error)}
            pipe.send_bytes(json.dumps(answer).encode())
    except (EOFError, OSError):
        link.close()


if __name__ == "__main__":
    main(sys.argv[1], Connection(int(sys.argv[2])))
