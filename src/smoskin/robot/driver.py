"""Moves an arm by what a loop estimates, in a thread and at a pace of its own.

Decides that whatever the arm raises is a fault, and that an arm is stopped before anything is told.
"""

import logging
import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import SourceError
from smoskin.records import Estimate, Pose, Reading
from smoskin.robot.arm import Arm, ArmState
from smoskin.robot.chain import Carriage
from smoskin.robot.follow import Command, Follow, Seen
from smoskin.robot.reasons import Reason
from smoskin.roles import Sink

_LOG: Final = logging.getLogger(__name__)
_APART: Final = 4e-3
"""Shortest time between two looks, s: the arm takes no more."""


@final
class Driver(Sink):
    """A sink that moves an arm; it owns the arm, and closing it stops that.

    Parameters
    ----------
    arm : Arm
    follow : Follow
        Made for the arm's chain.
    clock : callable
        A monotonic clock in s.
    on_command : callable
        Function told every command, in the thread that looks.
    held : callable
        Function that tells whether the switch is held without which the arm must stand.
    """

    def __init__(
        self,
        arm: Arm,
        follow: Follow,
        *,
        clock: Callable[[], float] = time.monotonic,
        on_command: Callable[[Command], object] = lambda command: None,
        held: Callable[[], bool] = lambda: True,
    ) -> None:
        self._arm, self._follow, self._clock = arm, follow, clock
        self._on_command, self._held = on_command, held
        self._lock = threading.RLock()
        self._seen: Seen | None = None
        self._field: Floats | None = None
        self._carriage = Carriage(arm.chain, follow.middle)
        self.newest: tuple[ArmState, Command] | None = None
        """Arm and command of the newest look that the arm answered."""
        self._ended, self._news = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def pose(self) -> Pose:
        """How the arm held and moved the skin at the newest look."""
        return self._carriage.pose

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Take the newest estimate; the one before is forgotten."""
        if estimate is not None:
            with self._lock:
                now, before = self._clock(), self._seen
                again = self._field is not None and np.array_equal(reading.field, self._field)
                news = before.news if again and before is not None else now
                self._field = reading.field
                self._seen = Seen(estimate, now, news)
            self._news.set()

    def arm(self) -> None:
        """As `Follow.arm`."""
        with self._lock:
            self._follow.arm()

    def disarm(self) -> None:
        """As `Follow.disarm`; the arm stands at once."""
        with self._lock:
            self._follow.disarm()
            self._stop()

    def reset(self) -> None:
        """As `Follow.reset`."""
        with self._lock:
            self._follow.reset()

    def set_threshold(self, begin: float) -> None:
        """As `Follow.set_threshold`."""
        with self._lock:
            self._follow.set_threshold(begin)

    def look(self) -> Command:
        """Look once at estimate and arm, and tell the arm what to do."""
        with self._lock:
            command = self._look()
        self._on_command(command)
        return command

    def _look(self) -> Command:
        try:
            state = self._arm.state()
            now = self._clock()
            command = self._follow.step(now, self._seen, state, run=self._held())
            self._carriage.look(now, state.angles, state.speeds)
            self.newest = state, command
            if command.speeds.any():
                self._arm.move(command.speeds)
            else:
                self._arm.stop()
        except Exception as error:  # whatever it is, the arm must stand
            command = self._follow.fail(Reason.ARM)
            self._stop()
            _LOG.warning("the arm failed: %s", error)
        return command

    def start(self, rate: float = 125.0) -> None:
        """Look at every new estimate, and at least so many times a second, until closed."""
        self._thread = threading.Thread(target=self._run, args=(1.0 / rate,), daemon=True)
        self._thread.start()

    def _run(self, period: float) -> None:
        looked = -math.inf
        while not self._ended.wait(max(0.0, looked + _APART - time.monotonic())):
            self._news.clear()
            looked = time.monotonic()
            self.look()
            self._news.wait(max(0.0, looked + period - time.monotonic()))

    def _stop(self) -> None:
        """Stop the arm, whatever it answers."""
        with suppress(Exception):
            self._arm.stop()

    def close(self) -> None:
        """Stop the arm, and let go of it."""
        self._ended.set()
        self._news.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=1.0)
        with self._lock:
            self._stop()
            with suppress(SourceError):
                self._arm.close()
