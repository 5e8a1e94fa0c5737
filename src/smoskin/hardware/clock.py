"""A board's clock on the host's: which offset and drift, from arrivals that are late by chance.

Decides that the least late frame of each second tells the offset, since nothing arrives early, and
that times of readings never jump: they run a little fast or slow until they agree.
"""

from collections import deque
from typing import Final, final

import numpy as np

_WINDOW: Final = 1.0
"""Seconds of which the least late frame counts."""
_WINDOWS: Final = 120
"""Windows that are remembered."""
_LEAST: Final = 5
"""Windows from which a drift is told."""
_DRIFT: Final = 1e-3
"""Largest drift, s a second, that two quartzes or RC oscillators in calibration can have."""
_SLEW: Final = 0.02
"""Share by which a step between readings may be stretched to catch up."""
_ANEW: Final = 0.5
"""Seconds of disagreement from which the two clocks are taken to have nothing in common."""


@final
class BoardClock:
    """Times of the board, s, as times of the host, s; both rise.

    The arrival of a frame is its time on the board, plus offset and drift, plus a delay that is
    not negative. The line through the least delayed frame of each of the last 120 seconds is the
    map; the delay of those stays in it.
    """

    def __init__(self) -> None:
        self.forget()

    @property
    def drift(self) -> float:
        """How much faster the host's clock runs, s a second; 0 until five seconds have passed."""
        return self._drift

    def forget(self) -> None:
        """Begin anew, as after the board was unplugged or has started again."""
        self._minima: deque[tuple[float, float]] = deque(maxlen=_WINDOWS)
        self._best: tuple[float, float] | None = None
        self._window = self._drift = 0.0
        self._line = (0.0, 0.0)
        self._last: tuple[float, float] | None = None

    def host_time(self, board: float, arrival: float) -> float:
        """Time on the host's clock at which the board's clock showed this time."""
        late = arrival - board
        if self._best is None:
            self._window, self._best = board, (board, late)
            self._line = board, late
        if late < self._best[1]:
            self._best = board, late
        if board - self._window >= _WINDOW:
            self._minima.append(self._best)
            self._window, self._best = board, (board, late)
            self._fit()
        start, offset = self._line
        if not self._minima:
            offset = self._best[1]
        wanted = board + offset + self._drift * (board - start)
        if self._last is None or abs(wanted - self._last[1]) > _ANEW + board - self._last[0]:
            self._last = board, wanted
            return wanted
        step = board - self._last[0]
        time = self._last[1] + min(
            max(wanted - self._last[1], (1 - _SLEW) * step), (1 + _SLEW) * step
        )
        self._last = board, time
        return time

    def _fit(self) -> None:
        """Draw the line through the minima."""
        board, late = np.array(self._minima).T
        if len(board) >= _LEAST:
            middle = board.mean()
            away = board - middle
            slope = float(away @ (late - late.mean()) / (away @ away))
            self._drift = min(max(slope, -_DRIFT), _DRIFT)
            self._line = float(middle), float(late.mean())
        else:
            self._line = float(board[-1]), float(late.min())
