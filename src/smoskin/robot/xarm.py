"""A UFACTORY xArm, moved by speeds of its joints through the maker's own library.

Decides that every speed ends by itself after a tenth of a second, and in what states the arm is
not moved. Hides the library's codes. It has met a stand-in of that library only, no arm.
"""

import io
from collections.abc import Callable
from contextlib import redirect_stdout
from typing import Any, Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError, SourceError, require
from smoskin.robot.arm import Arm, ArmState
from smoskin.robot.chain import Chain

_DURATION: Final = 0.1
"""Time after which the arm takes a speed for zero unless it is asked again, s."""
_FIRMWARE: Final = (1, 9, 0)
"""Oldest firmware: from 1.8.0 on speeds end by themselves, from 1.9.0 joints tell theirs."""
_ANSWER: Final = 0.1
"""Time that the arm has to answer, s."""
_BY_SPEED: Final = 4
"""The library's mode of joints that are asked for speeds."""
_STANDS: Final = 4
"""Its state of an arm that stops and takes no more."""


def _open(host: str) -> Any:
    """The maker's interface to an arm, which prints as it is imported and connects."""
    require("moving an xArm", "xarm", "xarm")
    with redirect_stdout(io.StringIO()):
        from xarm.wrapper import XArmAPI

        return XArmAPI(host, is_radian=True)


@final
class XArm(Arm):
    """An xArm that stands until it is asked to move; closing it stops it.

    Parameters
    ----------
    host : str
        Its address in the network.
    chain : Chain
        Its joints and the place of the skin.
    connect : callable
        Function of the address that gives the maker's interface.

    Raises
    ------
    ArgumentError
        If the chain has another number of joints than the arm.
    SourceError
        If it cannot be reached, runs a firmware below 1.9.0 (below 1.8.0 a speed goes on for ever),
        shows an error, or refuses to be moved by speeds.
    MissingExtraError
        If the extra ``xarm`` is not installed.
    """

    def __init__(self, host: str, chain: Chain, *, connect: Callable[[str], Any] = _open) -> None:
        self._host, self._chain = host, chain
        try:
            self._api = connect(host)
        except OSError as error:
            raise SourceError(f"xArm at {host} cannot be reached: {error}") from error
        except Exception as error:  # the library raises nothing narrower
            if type(error) is not Exception:
                raise
            raise SourceError(f"xArm at {host} cannot be reached: {error}") from error
        self._closed = False
        try:
            self._begin()
        except BaseException:
            self._closed = True
            self._api.disconnect()
            raise

    def _begin(self) -> None:
        """Check the arm, and have it take speeds."""
        api, host = self._api, self._host
        firmware = tuple(api.version_number)
        if firmware < _FIRMWARE:
            needed, has = (".".join(map(str, version)) for version in (_FIRMWARE, firmware))
            raise SourceError(
                f"xArm at {host} must run firmware {needed} or newer, whose speeds end by "
                f"themselves; it runs {has}"
            )
        if api.axis != self._chain.joints:
            raise ArgumentError(
                f"chain must have the arm's {api.axis} joints; got {self._chain.joints}"
            )
        self._check_errors()
        api.set_timeout(_ANSWER)
        self._done("be enabled", api.motion_enable(enable=True))
        self._done("take speeds", api.set_mode(_BY_SPEED))
        self._done("begin", api.set_state(0))
        self.stop()

    @property
    def chain(self) -> Chain:
        """Its joints and the place of the skin."""
        return self._chain

    def state(self) -> ArmState:
        """Angles and speeds as the arm tells them.

        It raises a `SourceError` if the arm does not answer, shows an error, stands by somebody
        else's order (an emergency stop among them), or is moved by another program.
        """
        self._check_errors()
        if self._api.state == _STANDS or self._api.mode != _BY_SPEED:
            raise SourceError(
                f"xArm at {self._host} was taken out of our hands: its state is "
                f"{self._api.state}, its mode {self._api.mode}"
            )
        code, joints = self._api.get_joint_states(is_radian=True)
        self._done("tell its joints", code)
        angles, speeds = (np.array(part[: self._chain.joints], dtype=float) for part in joints[:2])
        if not (np.isfinite(angles).all() and np.isfinite(speeds).all()):
            raise SourceError(f"xArm at {self._host} tells joints that are no numbers: {joints}")
        return ArmState(angles=angles, speeds=speeds)

    def move(self, speeds: Floats) -> Floats:
        """Turn at these speeds, within those of the joints, for the next tenth of a second."""
        self._check_open()
        commanded = np.clip(speeds, -self._chain.speed, self._chain.speed)
        self._done("move", self._speed(commanded))
        return commanded

    def stop(self) -> None:
        """Turn at no speed; an arm that does not take that is told to stop and take no more."""
        self._check_open()
        if self._speed(np.zeros(self._chain.joints)) != 0:
            self._done("stop", self._api.set_state(_STANDS))

    def close(self) -> None:
        """Stop, and let go of the arm; any number of times."""
        if self._closed:
            return
        try:
            self.stop()
        finally:
            self._closed = True
            self._api.disconnect()

    def _speed(self, speeds: Floats) -> int:
        return int(
            self._api.vc_set_joint_velocity(speeds.tolist(), is_radian=True, duration=_DURATION)
        )

    def _check_open(self) -> None:
        if self._closed:
            raise SourceError("the arm is closed")

    def _check_errors(self) -> None:
        """Raise unless the arm is there and well."""
        self._check_open()
        if not self._api.connected:
            raise SourceError(f"xArm at {self._host} is not connected any more")
        if self._api.error_code:
            raise SourceError(
                f"xArm at {self._host} shows error {self._api.error_code}: clear it at the arm"
            )

    def _done(self, what: str, code: int) -> None:
        """Raise for a code that means that something was not done."""
        if code != 0:
            raise SourceError(f"xArm at {self._host} did not {what}: code {code}")
