"""The pace of a source: decides when its next reading is due, and that closing ends a wait."""

import math
import threading
import time
from collections.abc import Callable
from typing import Final, final

import numpy as np

from smoskin.errors import ArgumentError, SourceError

SPEEDS: Final = (1e-3, 1e3)
"""Least and most that a pace may be of real time, unless it is infinite."""


@final
class Pace:
    """Waits until the next reading is due, catching up where one was late.

    `clock` is a monotonic one in s; `sleep` waits for so many seconds, by default until closed.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] | None = None,
    ) -> None:
        self._clock = clock
        self._closed = threading.Event()
        self._sleep = self._closed.wait if sleep is None else sleep
        self._due: float | None = None

    @property
    def closed(self) -> bool:
        """Whether `close` has been called."""
        return self._closed.is_set()

    @property
    def lateness(self) -> float:
        """Seconds since the reading was due."""
        return 0.0 if self._due is None else max(self._clock() - self._due, 0.0)

    def advance(self, step: float) -> None:
        """Make the next reading due so many seconds after the last; the first is at once."""
        if self._due is not None:
            self._due += step

    def restart(self) -> None:
        """Make the next reading due at once: the time before does not count."""
        self._due = None

    def wait(self, timeout: float) -> bool:
        """Whether the reading is due, after waiting for it so long at most; False when closed."""
        start = self._clock()
        end = start + timeout
        due = self._due = start if self._due is None else self._due
        while not self._closed.is_set() and (now := self._clock()) < due:
            if now >= end:
                raise SourceError(
                    f"no reading within {timeout} s; the next is due in {due - now:.3f} s"
                )
            self._sleep(min(due, end) - now)
        return not self._closed.is_set()

    def close(self) -> None:
        """End every wait, for good."""
        self._closed.set()


def require_between(
    name: str, value: float, least: float, most: float, *, unless: float = math.nan
) -> None:
    """Raise `ArgumentError` for what is no number between these two, nor that other one."""
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not (number and (least <= value <= most or value == unless)):
        other = "" if math.isnan(unless) else f" or {unless:g}"
        raise ArgumentError(f"{name} must be from {least:g} to {most:g}{other}; got {value!r}")
