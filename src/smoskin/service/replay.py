"""Recordings played back: at their own pace, from any place, with pauses.

Decides when each reading comes, and that what follows the readings is never led astray by a jump:
it gets every reading from the first one on. Hides waiting and the file's iterator.
"""

import math
import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final, final

from smoskin.errors import RecordingError, SourceError
from smoskin.pace import SPEEDS, Pace, require_between
from smoskin.records import Estimate, Reading
from smoskin.roles import Source

if TYPE_CHECKING:
    from smoskin.design.skin import SkinDesign
    from smoskin.service.recording import Recording

_GAPS: Final = (1e-6, 1e6)
"""Least and most that the wait for a reading may be cut to, s."""
_SAME: Final = 1e-6
"""s by which places may differ that are the same but for rounding."""
_LOOK: Final = 0.2
"""s after which a standing source looks whether it still is to stand."""


@final
class ReplaySource(Source):
    """A recording's readings, with its own timing times a speed, which may be infinite.

    Times are passed on as recorded. The pace follows them where they go forward by no more
    than `longest_gap`, s; it never goes back. `pause`, `seek` and `speed` may be used from any
    thread. With `as_recorded` the `estimate` of each reading is kept as well.
    """

    def __init__(
        self,
        recording: "Recording",
        *,
        speed: float = 1.0,
        longest_gap: float = 0.5,
        pace: Pace | None = None,
        as_recorded: bool = False,
    ) -> None:
        require_between("longest_gap", longest_gap, *_GAPS)
        self.speed = speed
        self.estimate: Estimate | None = None
        """What was recorded of the last reading; kept where it is played `as_recorded`."""
        self.on_rewind: Callable[[], object] = lambda: None
        """Called within `read`, before it gives the first reading again."""
        self.stays: Callable[[], bool] = lambda: False
        """Whether `read` waits behind the last reading for a `seek`."""
        self._recording, self._as_recorded = recording, as_recorded
        self._readings: Iterator[Reading] = self._from_the_first()
        self._longest_gap = longest_gap
        self._pace = Pace() if pace is None else pace
        self._waiting: Reading | None = None
        self._reached: float | None = None
        self._start: float | None = None
        self._position = 0.0
        self._number = -1
        self._asked: deque[float] = deque(maxlen=1)
        self._goal: float | None = None
        self._paused = self._ended = False
        self._stirred = threading.Event()

    @property
    def chips(self) -> int:
        """Number of chips in every reading."""
        return self._recording.description.chips

    @property
    def design(self) -> "SkinDesign":
        """Design of the skin that was recorded; raises `DesignError` where it cannot be told."""
        return self._recording.design

    @property
    def design_hash(self) -> str:
        """Content hash of the design of the skin that was recorded."""
        return self._recording.description.design_hash

    @property
    def recording(self) -> "Recording":
        """What is played."""
        return self._recording

    @property
    def speed(self) -> float:
        """Pace over the recorded one; from 0.001 to 1000, or infinite."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        require_between("speed", speed, *SPEEDS, unless=math.inf)
        self._speed = speed

    @property
    def position(self) -> float:
        """Time of the last reading since that of the first, s."""
        return self._position

    @property
    def number(self) -> int:
        """Place of the last reading in the recording, from 0."""
        return self._number

    @property
    def goal(self) -> float | None:
        """Position that is sought, s, while readings come unpaced; else None."""
        return self._asked[-1] if self._asked else self._goal

    @property
    def paused(self) -> bool:
        """Whether the playing stands still."""
        return self._paused

    @property
    def ended(self) -> bool:
        """Whether `read` waits behind the last reading."""
        return self._ended

    def pause(self, paused: bool = True) -> None:
        """Stand still, or go on; a source that stands is not silent: `read` waits without end."""
        self._paused = paused
        self._stirred.set()

    def seek(self, position: float) -> None:
        """Go to the first reading that is so many seconds or more after the recording's first.

        All readings before it come too, unpaced: those behind the present one, or, to go back,
        all from the first one on, so that who follows them knows what there is to be known. A
        paused source gives the reading that was sought and stands again.
        """
        require_between("position", position, 0.0, math.inf)
        self._asked.append(float(position))
        self._stirred.set()

    def read(self, timeout: float = 1.0) -> Reading | None:
        """The next reading, when its time has come; None at the end or when closed."""
        if self._waiting is None:
            self._stand(lambda: self._paused and self._goal is None)
            self._heed()
            while (reading := self._next()) is None:
                self._goal, self._ended = None, True
                self._stand(self.stays)
                self._ended = False
                if self._pace.closed or not self._asked:
                    return None
                self._heed()
            self._waiting = reading
            self._pace.advance(self._step(reading.time))
        if self._pace.closed or (self._goal is None and not self._pace.wait(timeout)):
            return None
        reading, self._waiting = self._waiting, None
        self._start = reading.time if self._start is None else self._start
        self._position = reading.time - self._start
        self._number += 1
        if self._goal is not None and self._position >= self._goal - _SAME:
            self._goal = None
            self._pace.restart()
        return reading

    def close(self) -> None:
        """End the playing; a waiting `read` returns."""
        self._pace.close()
        self._stirred.set()
        # Lets go of the file; another thread's `read` may still be in the old iterator.
        self._readings = iter(())

    def _stand(self, asked: Callable[[], bool]) -> None:
        """Wait while it is asked for, until something is sought or the source is closed."""
        stood = False
        while asked() and not self._asked and not self._pace.closed:
            stood = True
            self._stirred.wait(_LOOK)
            self._stirred.clear()
        if stood:
            self._pace.restart()

    def _heed(self) -> None:
        """Seek what was asked for last: from the first reading on, if it has been passed."""
        if not self._asked:
            return
        self._goal = self._asked.pop()
        if self._start is None or self._goal > self._position:
            return
        self._readings = self._from_the_first()
        self._reached, self._position, self._number = None, 0.0, -1
        self.on_rewind()

    def _from_the_first(self) -> Iterator[Reading]:
        """All readings, in order; before one is given, `estimate` becomes its own."""
        if not self._as_recorded:
            yield from self._recording.readings()
            return
        for reading, estimate in self._recording:
            self.estimate = estimate
            yield reading

    def _next(self) -> Reading | None:
        try:
            return None if self._pace.closed else next(self._readings, None)
        except RecordingError as error:
            raise SourceError(str(error)) from error

    def _step(self, moment: float) -> float:
        """Seconds to wait from the last reading to this one."""
        before = moment if self._reached is None else self._reached
        step = moment - before
        # Slightly out of order: the readings ahead of it have used up its time already. Far
        # back: the recorded clock was set anew.
        if step >= 0.0 or step < -self._longest_gap:
            self._reached = moment
        return min(max(step, 0.0) / self._speed, self._longest_gap)
