"""The loop at run time: source to estimator to sinks, with counters.

Decides the order of things (read, estimate, hand to every sink, yield) and what is closed when. The
loop waits for its sinks: one that may be slow takes what it is given in a thread of its own, as the
live page does, or `Aside` does for it, and counts what it passes over.
"""

import logging
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from queue import Full, Queue
from types import MappingProxyType
from typing import Final, final

import numpy as np

from smoskin.arguments import typed
from smoskin.errors import ArgumentError, SmoskinError
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Estimator, Resource, Sink, Source

_LOG: Final = logging.getLogger(__name__)
_WINDOW: Final = 1000
"""Number of last readings that rate and latency are told of."""
_DECADES: Final = (-6, 1)
"""Powers of ten, s, between which durations are told apart."""
_PER_DECADE: Final = 80
"""Classes of durations a decade; neighbours differ by 3 %."""
_CLOSE_DEADLINE: Final = 10.0
"""s for a sink to write what waits for it at the end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """How long a stage of the loop has taken since its begin, s; NaN before the first reading."""

    median: float
    p99: float
    p999: float
    """99.9th percentile."""
    worst: float


class Histogram:
    """Durations since the begin, in classes that are 3 % wide: its size stays what it is."""

    def __init__(self) -> None:
        low, high = _DECADES
        self._counts = np.zeros((high - low) * _PER_DECADE + 1, dtype=np.int64)
        self._worst = math.nan

    def add(self, duration: float) -> None:
        """Count a duration, s; shorter and longer ones than a class tells go to the ends."""
        decades = math.log10(max(duration, 1e-12)) - _DECADES[0]
        index = min(max(math.ceil(decades * _PER_DECADE), 0), len(self._counts) - 1)
        self._counts[index] += 1
        self._worst = max(duration, self._worst) if self._worst == self._worst else duration

    @property
    def latency(self) -> Latency:
        """What is counted; percentiles are the upper ends of their classes, at most the worst."""
        total = np.cumsum(self._counts)
        if not total[-1]:
            return Latency(median=math.nan, p99=math.nan, p999=math.nan, worst=math.nan)
        classes = np.searchsorted(total, np.array([0.5, 0.99, 0.999]) * total[-1])
        ends = np.minimum(10.0 ** (_DECADES[0] + classes / _PER_DECADE), self._worst)
        return Latency(
            **dict(zip(("median", "p99", "p999"), ends.tolist(), strict=True)), worst=self._worst
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Counters:
    """What a loop has done so far."""

    readings: int
    """Readings taken from the source."""
    statuses: Mapping[Status, int]
    """Estimates of each status; they sum up to the readings."""
    dropped: int
    """Readings that sinks passed over, summed over the sinks."""
    rate: float
    """Rate over the last thousand readings, Hz; NaN before the second."""
    latency_median: float
    """Time from a reading's arrival until every sink has it, over the last thousand, s; NaN at
    first."""
    latency_p99: float
    """The 99th percentile of that time, s."""
    stages: Mapping[str, Latency]
    """How long estimating and handing to the sinks have taken since the begin: ``estimate`` from a
    reading's arrival to its estimate, ``sinks`` from there until every sink has it."""


@final
class Loop(Resource):
    """Runs a source through an estimator into sinks; iterate for the estimates.

    The loop owns what it is given: when it ends, in whatever way, source and sinks are closed.

    Parameters
    ----------
    source : Source
    estimator : Estimator
        Made for the source's number of chips.
    sinks : sequence of Sink
        Each gets every reading with its estimate, before the estimate is yielded.
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

        with Loop(source, estimator, sinks=[recorder, view]) as loop:
            for estimate in loop:
                robot.follow(estimate)
            print(loop.counters.rate)
    """

    @typed
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
        self._closed = False
        self._lock = threading.Lock()
        self._statuses: Counter[Status] = Counter()
        self._arrivals: deque[float] = deque(maxlen=_WINDOW)
        self._latencies: deque[float] = deque(maxlen=_WINDOW)
        self._stages = {"estimate": Histogram(), "sinks": Histogram()}
        self._done = math.nan

    def __iter__(self) -> Iterator[Estimate]:
        """Estimates, one for each reading, until the source ends or misses the deadline."""
        try:
            while (reading := self._source.read(self._deadline)) is not None:
                arrival = self._clock()
                estimate = self._estimator.step(reading)
                estimated = self._clock()
                for sink in self._sinks:
                    sink.write(reading, estimate)
                with self._lock:
                    self._done = self._clock()
                    self._statuses[estimate.status] += 1
                    self._arrivals.append(arrival)
                    self._latencies.append(self._done - arrival)
                    self._stages["estimate"].add(estimated - arrival)
                    self._stages["sinks"].add(self._done - estimated)
                yield estimate
        finally:
            self.close()

    @property
    def counters(self) -> Counters:
        """What has been done so far; may be asked from any thread."""
        with self._lock:
            statuses = dict(self._statuses)
            arrivals, latencies = list(self._arrivals), list(self._latencies)
            stages = {name: histogram.latency for name, histogram in self._stages.items()}
        elapsed = arrivals[-1] - arrivals[0] if arrivals else 0.0
        median, p99 = np.percentile(latencies, [50, 99]) if latencies else (np.nan, np.nan)
        return Counters(
            readings=sum(statuses.values()),
            statuses=MappingProxyType({status: statuses.get(status, 0) for status in Status}),
            dropped=sum(sink.dropped for sink in self._sinks),
            rate=(len(arrivals) - 1) / elapsed if elapsed > 0.0 else float("nan"),
            latency_median=float(median),
            latency_p99=float(p99),
            stages=MappingProxyType(stages),
        )

    @property
    def latest(self) -> float:
        """When the last reading was done with, s on the loop's clock; NaN before the first."""
        return self._done

    def stop(self) -> None:
        """End the source, from any thread: iterating ends, and closes the sinks, soon after."""
        self._source.close()

    def close(self) -> None:
        """Close the source and every sink, whatever any of them raises."""
        if not self._closed and _LOG.isEnabledFor(logging.INFO):
            done = self.counters
            _LOG.info(
                "%d readings at %.1f Hz, %.2f ms to the sinks, %d dropped",
                *(done.readings, done.rate, 1e3 * done.latency_median, done.dropped),
            )
        self._closed = True
        with ExitStack() as stack:
            for sink in reversed(self._sinks):
                stack.callback(sink.close)
            stack.callback(self._source.close)


@final
class Aside(Sink):
    """A sink in a thread of its own: a disk that stands still does not hold up the loop.

    Readings wait for it in their order. Where as many as there is room for wait already, `write`
    waits in its turn, and what has found no room in time is passed over and counted; a sink that
    has kept it waiting so once is waited for again when it has moved. What the sink raises is
    raised by the next `write`, or by `close`.

    Parameters
    ----------
    sink : Sink
        Closed with this one, behind the last reading.
    room : int
        Readings that may wait.
    patience : float
        s for room to be made: 0 for readings that come by a clock.
    """

    @typed
    def __init__(self, sink: Sink, *, room: int = 4096, patience: float = 0.0) -> None:
        if room < 1 or not 0.0 <= patience < float("inf"):
            raise ArgumentError(
                f"room must be >= 1 and patience finite and >= 0; got {room} and {patience} s"
            )
        self._sink, self._patience = sink, patience
        self._waiting: Queue[tuple[Reading, Estimate | None] | None] = Queue(room)
        self._passed, self._stands, self._closed = 0, False, False
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="smoskin-aside", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Readings that found no room, and those that the sink itself passed over."""
        return self._passed + self._sink.dropped

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Let the sink take a reading when it can; raises what it raised before."""
        self._raise_failure()
        if self._closed:
            raise SmoskinError(f"{type(self._sink).__name__} is closed")
        patience = 0.0 if self._stands else self._patience
        try:
            self._waiting.put((reading, estimate), block=patience > 0.0, timeout=patience)
            self._stands = False
        except Full:
            self._stands = True
            self._passed += 1

    def close(self) -> None:
        """Close the sink when it has taken what waits; `SmoskinError` if it does not in 10 s."""
        if self._closed:
            return
        self._closed = True
        end = time.monotonic() + _CLOSE_DEADLINE
        with suppress(Full):
            self._waiting.put(None, timeout=_CLOSE_DEADLINE)
        self._thread.join(max(0.0, end - time.monotonic()))
        if self._thread.is_alive():
            raise SmoskinError(
                f"{type(self._sink).__name__} has not taken {self._waiting.qsize()} readings "
                f"within {_CLOSE_DEADLINE} s"
            )
        self._sink.close()
        self._raise_failure()

    def _run(self) -> None:
        while (item := self._waiting.get()) is not None:
            if self._failure is None:
                try:
                    self._sink.write(*item)
                except Exception as error:  # for the thread that writes
                    self._failure = error

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure


def run(
    source: Source, estimator: Estimator, *, sinks: Sequence[Sink] = (), deadline: float = 1.0
) -> Iterator[Estimate]:
    """Estimates of a source's readings, one by one, until the source ends.

    Takes and closes what `Loop` does, which has counters beside, and raises the same errors.
    """
    return iter(Loop(source, estimator, sinks=sinks, deadline=deadline))
