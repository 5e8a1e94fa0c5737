"""What the chips read while the rig works, kept until the touch is over."""

import threading
import time
from collections import deque
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import SourceError
from smoskin.hardware.clock import BoardClock
from smoskin.records import Reading
from smoskin.roles import Resource, Source

_SILENCE: Final = 1.0
"""Seconds for which a skin may be silent."""
_KEPT: Final = 200_000
"""Readings that are kept, at most."""
_LEAST: Final = 5
"""Readings that a window holds at least."""


@final
class Listener(Resource):
    """Takes the readings of a source as they come, in a thread of its own; closes the source."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._readings: deque[Reading] = deque(maxlen=_KEPT)
        self._board, self._pairs = BoardClock(), deque[tuple[float, float]](maxlen=_KEPT)
        self._lock = threading.Lock()
        self._fault: SourceError | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="smoskin rig", daemon=True)
        self._thread.start()

    def clock(self, moments: Floats) -> Floats:
        """Times of the host's monotonic clock, s, on the clock of the readings.

        Nothing arrives early, so the least late readings tell; their delay stays in it.
        """
        with self._lock:
            board, host = np.reshape(self._pairs, (-1, 2)).T
        before, after = np.minimum(moments - host[0], 0.0), np.maximum(moments - host[-1], 0.0)
        return np.asarray(np.interp(moments, host, board) + before + after)

    def check(self) -> None:
        """Raise if the skin is read no more."""
        if self._fault is not None:
            raise SourceError(f"the skin is not read: {self._fault}")

    def now(self) -> float:
        """Time of the latest reading, s; waits for the first."""
        end = time.monotonic() + 2 * _SILENCE
        while not self._readings:
            self.check()
            if time.monotonic() > end:
                raise SourceError("the skin is not read: no reading has come")
            time.sleep(0.005)
        return self._readings[-1].time

    def window(self, begun: float, seconds: float) -> tuple[float, float] | None:
        """First and last time of all readings since; None where they are too few or too short."""
        self.check()
        with self._lock:
            times = [each.time for each in self._readings if each.time > begun]
        if len(times) < _LEAST or times[-1] - times[0] < seconds:
            return None
        return times[0], times[-1]

    def take(self) -> tuple[Reading, ...]:
        """All readings since they were last taken; the latest stays, as the clock's hand."""
        with self._lock:
            taken = tuple(self._readings)
            self._readings = deque(taken[-1:], maxlen=_KEPT)
        return taken

    def close(self) -> None:
        """End the readings."""
        self._closing.set()
        self._source.close()
        self._thread.join(2.0)

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                reading = self._source.read(_SILENCE)
                if reading is None:
                    raise SourceError("its readings have ended")
                host = self._board.host_time(reading.time, time.monotonic())
                with self._lock:
                    self._readings.append(reading)
                    self._pairs.append((reading.time, host))
        except SourceError as error:
            self._fault = error
        except Exception as error:
            self._fault = SourceError(f"{type(error).__name__}: {error}")
