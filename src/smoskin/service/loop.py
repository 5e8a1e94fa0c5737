"""The loop at run time: source to estimator to sinks, with counters.

Decides the order of things (read, estimate, hand to every sink, yield) and what is closed when. The
loop waits for its sinks: one that may be slow takes what it is given in a thread of its own, as the
live page does, and counts what it passes over.
"""

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, final

import numpy as np

from smoskin.arguments import typed
from smoskin.errors import ArgumentError
from smoskin.records import Estimate, Status
from smoskin.roles import Estimator, Resource, Sink, Source

_LOG: Final = logging.getLogger(__name__)
_WINDOW: Final = 1000
"""Number of last readings that rate and latency are told of."""


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

    def __iter__(self) -> Iterator[Estimate]:
        """Estimates, one for each reading, until the source ends or misses the deadline."""
        try:
            while (reading := self._source.read(self._deadline)) is not None:
                arrival = self._clock()
                estimate = self._estimator.step(reading)
                for sink in self._sinks:
                    sink.write(reading, estimate)
                with self._lock:
                    self._statuses[estimate.status] += 1
                    self._arrivals.append(arrival)
                    self._latencies.append(self._clock() - arrival)
                yield estimate
        finally:
            self.close()

    @property
    def counters(self) -> Counters:
        """What has been done so far; may be asked from any thread."""
        with self._lock:
            statuses = dict(self._statuses)
            arrivals, latencies = list(self._arrivals), list(self._latencies)
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


def run(
    source: Source,
    estimator: Estimator,
    *,
    sinks: Sequence[Sink] = (),
    deadline: float = 1.0,
) -> Iterator[Estimate]:
    """Estimates of a source's readings, one by one, until the source ends.

    Takes and closes what `Loop` does, which has counters beside, and raises the same errors.
    """
    return iter(Loop(source, estimator, sinks=sinks, deadline=deadline))
