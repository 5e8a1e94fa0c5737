"""The loop at run time: source to estimator to sinks, with counters.

Decides the order of things (read, estimate, hand to every sink, yield), who waits for whom and
what is closed when. A sink that may be slow is wrapped in `Latest` and then gets the newest
value only; every other sink gets every one.
"""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, final

import numpy as np

from smoskin.errors import ArgumentError, SmoskinError
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Estimator, Resource, Sink, Source

#: Rate and latency are those of this many last readings.
_WINDOW: Final = 1000


@final
class Latest(Sink):
    """Gives a slow sink the newest value whenever it is ready; counts those it passed over.

    The sink runs in a thread of its own, so `write` never waits for it. What the sink raises
    is raised by the next `write`, or by `close`.

    Parameters
    ----------
    sink : Sink
        The slow one, such as a view; closed with this one.
    patience : float
        s that `close` waits for the sink to finish its last value.
    """

    def __init__(self, sink: Sink, *, patience: float = 5.0) -> None:
        if not 0.0 < patience < float("inf"):
            raise ArgumentError(f"patience must be positive and finite; got {patience}")
        self._sink = sink
        self._patience = patience
        self._changed = threading.Condition()
        self._value: tuple[Reading, Estimate | None] | None = None
        self._error: Exception | None = None
        self._error_told = False
        self._dropped = 0
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="smoskin-latest", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How many readings were overtaken by newer ones."""
        return self._dropped

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Leave a value for the sink, in place of one that it has not taken yet."""
        with self._changed:
            if self._error is not None:
                self._error_told = True
                raise self._error
            if self._closing:
                raise SmoskinError("the sink is closed")
            if self._value is not None:
                self._dropped += 1
            self._value = (reading, estimate)
            self._changed.notify()

    def close(self) -> None:
        """Let the sink take the last value, then close it.

        Raises
        ------
        SmoskinError
            If the sink does not finish within `patience`.
        """
        with self._changed:
            if self._closing:
                return
            self._closing = True
            self._changed.notify()
        self._thread.join(self._patience)
        # Closed even where it hangs: that may be what sets it free.
        self._sink.close()
        if self._thread.is_alive():
            raise SmoskinError(
                f"{type(self._sink).__name__} has not finished within {self._patience} s"
            )
        if self._error is not None and not self._error_told:
            raise self._error

    def _work(self) -> None:
        """Feed the sink until closed and nothing is left."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._value is not None or self._closing)
                value, self._value = self._value, None
            if value is None:
                return
            try:
                self._sink.write(*value)
            except Exception as error:  # handed over to the thread that writes, not swallowed
                self._error = error
                return


@dataclass(frozen=True, slots=True, kw_only=True)
class Counters:
    """What a loop has done so far."""

    readings: int
    """Readings taken from the source."""
    statuses: Mapping[Status, int]
    """Estimates of each status; they sum up to the readings."""
    dropped: int
    """Readings that slow sinks passed over, summed over the sinks."""
    rate: float
    """Hz, over the last thousand readings; NaN before the second."""
    latency_median: float
    """s, from a reading's arrival until every sink has it, over the last thousand; NaN at first."""
    latency_p99: float
    """s, its 99th percentile."""


@final
class Loop(Resource):
    """Runs a source through an estimator into sinks; iterate for the estimates.

    The loop owns what it is given: when it ends, in whatever way, source and sinks are closed.

    Parameters
    ----------
    source : Source
        Where readings come from.
    estimator : Estimator
        Made for the same number of chips.
    sinks : sequence of Sink
        Each gets every reading with its estimate, before the estimate is yielded; wrap slow
        ones in `Latest`.
    deadline : float
        s after which a silent source is given up.
    clock : callable
        A monotonic clock in s.

    Raises
    ------
    ArgumentError
        If the deadline is not positive and finite.

    Examples
    --------
    ::

        with Loop(source, estimator, sinks=[recorder, Latest(view)]) as loop:
            for estimate in loop:
                robot.follow(estimate)
            print(loop.counters.rate)
    """

    def __init__(
        self,
        source: Source,
        estimator: Estimator,
        *,
        sinks: Sequence[Sink] = (),
        deadline: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not 0.0 < deadline < float("inf"):
            raise ArgumentError(f"deadline must be positive and finite; got {deadline}")
        self._source = source
        self._estimator = estimator
        self._sinks = tuple(sinks)
        self._deadline = deadline
        self._clock = clock
        self._lock = threading.Lock()
        self._statuses: Counter[Status] = Counter()
        self._arrivals: deque[float] = deque(maxlen=_WINDOW)
        self._latencies: deque[float] = deque(maxlen=_WINDOW)

    def __iter__(self) -> Iterator[Estimate]:
        """Estimates, one for each reading, until the source ends.

        Raises
        ------
        SourceError
            If no reading comes within the deadline.
        """
        try:
            while (reading := self._source.read(self._deadline)) is not None:
                arrival = self._clock()
                estimate = self._estimator.step(reading)
                for sink in self._sinks:
                    sink.write(reading, estimate)
                self._count(estimate.status, arrival)
                yield estimate
        finally:
            self.close()

    @property
    def counters(self) -> Counters:
        """What has been done so far; may be asked from any thread."""
        with self._lock:
            statuses = dict(self._statuses)
            arrivals = list(self._arrivals)
            latencies = list(self._latencies)
        elapsed = arrivals[-1] - arrivals[0] if arrivals else 0.0
        median, p99 = np.percentile(latencies, [50, 99]) if latencies else (np.nan, np.nan)
        return Counters(
            readings=sum(statuses.values()),
            statuses=MappingProxyType({status: statuses.get(status, 0) for status in Status}),
            dropped=sum(sink.dropped for sink in self._sinks),
            rate=(len(arrivals) - 1) / elapsed if elapsed > 0.0 else float("nan"),
            latency_median=float(median),
            latency_p99=float(p99),
        )

    def close(self) -> None:
        """Close the source and every sink, whatever any of them raises."""
        with ExitStack() as stack:
            for sink in reversed(self._sinks):
                stack.callback(sink.close)
            stack.callback(self._source.close)

    def _count(self, status: Status, arrival: float) -> None:
        latency = self._clock() - arrival
        with self._lock:
            self._statuses[status] += 1
            self._arrivals.append(arrival)
            self._latencies.append(latency)


def run(
    source: Source,
    estimator: Estimator,
    *,
    sinks: Sequence[Sink] = (),
    deadline: float = 1.0,
) -> Iterator[Estimate]:
    """Estimates of a source's readings, one by one; use `Loop` where counters are wanted.

    Parameters
    ----------
    source : Source
        Where readings come from; closed at the end.
    estimator : Estimator
        Made for the same number of chips.
    sinks : sequence of Sink
        Each gets every reading with its estimate; closed at the end.
    deadline : float
        s after which a silent source is given up.

    Returns
    -------
    iterator of Estimate
        One for each reading, until the source ends.

    Raises
    ------
    ArgumentError
        If the deadline is not positive and finite.
    SourceError
        If no reading comes within the deadline.
    """
    return iter(Loop(source, estimator, sinks=sinks, deadline=deadline))
