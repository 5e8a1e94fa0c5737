"""A Universal Robots arm, moved by speeds of its joints through `ur_rtde` in a process of its own.

Decides how long an arm may take to answer; one that takes longer is given up, and its watchdog
stops it. It has met a controller's ports in tests, with the library itself, and no arm.
"""

import json
import socket
import subprocess
import sys
from multiprocessing.connection import Connection
from typing import Any, Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError, SourceError, require
from smoskin.robot.arm import Arm, ArmState
from smoskin.robot.chain import Chain

_JOINTS: Final = 6
_BEGUN: Final = 20.0
"""Time that the robot has to load our program, s."""
_ANSWER: Final = 0.1
"""Time that it has to answer, s."""
_GONE: Final = 1.0
"""Time that it has to end our program, s."""


@final
class UrArm(Arm):
    """A UR arm that stands until it is asked to move; closing it stops it.

    Parameters
    ----------
    host : str
        Its address in the network.
    chain : Chain
        Its joints and the place of the skin.

    Raises
    ------
    ArgumentError
        If the chain has no six joints.
    SourceError
        If it cannot be reached, is not in remote control, or is not ready to move.
    MissingExtraError
        If the extra ``ur`` is not installed.
    """

    def __init__(self, host: str, chain: Chain) -> None:
        if chain.joints != _JOINTS:
            raise ArgumentError(f"chain must have the arm's {_JOINTS} joints; got {chain.joints}")
        require("moving a UR arm", "ur", "rtde_control")
        self._host, self._chain = host, chain
        own, other = socket.socketpair()
        self._process: subprocess.Popen[bytes] | None = subprocess.Popen(
            [sys.executable, "-m", "smoskin.robot.ur_link", host, str(other.fileno())],
            pass_fds=(other.fileno(),),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is ours to hear; the arm then stops in order
        )
        other.close()
        self._pipe = Connection(own.detach())
        try:
            self._answer(_BEGUN)
        except BaseException:
            self.close()
            raise

    @property
    def chain(self) -> Chain:
        """Its joints and the place of the skin."""
        return self._chain

    def state(self) -> ArmState:
        """Angles and speeds as the arm tells them.

        It raises a `SourceError` if the arm falls silent, has no power, was stopped by its safety
        or by a person, or its program has ended: by its watchdog, or for another one.
        """
        angles, speeds = (np.array(part, dtype=float) for part in self._ask("state"))
        if not (np.isfinite(angles).all() and np.isfinite(speeds).all()):
            raise SourceError(f"UR at {self._host} tells joints that are no numbers: {angles}")
        return ArmState(angles=angles, speeds=speeds)

    def move(self, speeds: Floats) -> Floats:
        """Turn at these speeds, within those of the joints, for the next tenth of a second."""
        commanded = np.clip(speeds, -self._chain.speed, self._chain.speed)
        leading = self._chain.acceleration[np.abs(commanded).argmax()]
        self._ask("move", commanded.tolist(), float(leading))
        return commanded

    def stop(self) -> None:
        """Turn at no speed."""
        self._ask("stop", float(self._chain.acceleration.min()))

    def close(self) -> None:
        """Stop, and let go of the arm; any number of times."""
        if self._process is None:
            return
        self._pipe.close()
        try:
            self._process.wait(_GONE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None

    def _ask(self, what: str, *numbers: object) -> Any:
        """The arm's answer."""
        if self._process is None:
            raise SourceError("the arm is closed")
        try:
            self._pipe.send_bytes(json.dumps([what, *numbers]).encode())
        except OSError as error:
            raise SourceError(f"UR at {self._host}: our link to it has ended") from error
        return self._answer(_ANSWER)

    def _answer(self, within: float) -> Any:
        """What comes back within so many seconds; else the arm is let go, which stops it."""
        try:
            if not self._pipe.poll(within):
                raise SourceError(f"UR at {self._host} did not answer within {within:g} s")
            reply = json.loads(self._pipe.recv_bytes())
        except (SourceError, EOFError, OSError) as error:
            if self._process is not None:
                self._process.kill()
            self.close()
            if isinstance(error, SourceError):
                raise
            raise SourceError(f"UR at {self._host}: our link to it has ended") from error
        if "error" in reply:
            raise SourceError(f"UR at {self._host}: {reply['error']}")
        return reply.get("answer")
