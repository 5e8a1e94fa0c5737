"""A switch that must be held while an arm moves, told by signs that come again and again."""

import threading
import time
from collections.abc import Callable
from typing import Final, final

from smoskin.errors import ArgumentError

DEADLINE: Final = 0.2
"""Time without a sign after which a switch counts as released, s."""


@final
class Holding:
    """Whether somebody holds a switch; asked and told from any thread.

    A single sign holds nothing: a second one must come within the deadline, and then the next. So a
    key that repeats is held from its first repetition on, and released when that ends, whoever or
    whatever ends it.

    Parameters
    ----------
    deadline : float
        Time without a sign after which the switch counts as released, s.
    clock : callable
        A monotonic clock in s.

    Raises
    ------
    ArgumentError
        If the deadline is not positive and finite.

    Examples
    --------
    >>> moments = iter([0.0, 0.1, 0.15, 0.4])
    >>> key = Holding(clock=lambda: next(moments))
    >>> key.sign(), key.sign(), key(), key()
    (None, None, True, False)
    """

    def __init__(
        self, *, deadline: float = DEADLINE, clock: Callable[[], float] = time.monotonic
    ) -> None:
        if not 0.0 < deadline < float("inf"):
            raise ArgumentError(f"deadline must be positive and finite; got {deadline}")
        self._deadline, self._clock = deadline, clock
        self._lock = threading.Lock()
        self._last = self._before = -float("inf")

    def sign(self) -> None:
        """Somebody holds it now."""
        now = self._clock()
        with self._lock:
            self._before, self._last = self._last, now

    def __call__(self) -> bool:
        """Whether it is held."""
        now = self._clock()
        with self._lock:
            return max(now - self._last, self._last - self._before) <= self._deadline
