"""The loop: who gets what, who waits for whom, and that everything is closed at the end."""

import gc
import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from smoskin.arrays import Floats
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, SmoskinError, SourceError
from smoskin.records import ChipFlag, Estimate, Reading, Status
from smoskin.roles import Estimator, Sink, Source
from smoskin.service import loop as loop_module
from smoskin.service.loop import Aside, Loop, run
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording

CHIPS = 3


class ListSource(Source):
    """Gives readings from a list; an exception in it is raised."""

    def __init__(self, items: Iterable[Reading | Exception]) -> None:
        self._items: Iterator[Reading | Exception] = iter(items)
        self.timeouts: list[float] = []
        self.closed = False

    @property
    def chips(self) -> int:
        return CHIPS

    def read(self, timeout: float = 1.0) -> Reading | None:
        self.timeouts.append(timeout)
        item = None if self.closed else next(self._items, None)
        if isinstance(item, Exception):
            raise item
        return item

    def close(self) -> None:
        self.closed = True


class FlagEstimator(Estimator):
    """Judges by the chips' flags and order of times alone."""

    def __init__(self) -> None:
        self._last = -math.inf

    def step(self, reading: Reading) -> Estimate:
        if len(reading.field) != CHIPS:
            raise ArgumentError(f"reading must have {CHIPS} chips; got {len(reading.field)}")
        flags = int(np.bitwise_or.reduce(reading.flags))
        status = Status.NO_CONTACT
        if flags & ChipFlag.SATURATED:
            status = Status.SATURATED
        if flags & ChipFlag.MISSING or not np.isfinite(reading.field).all():
            status = Status.CHIP_MISSING
        if reading.time <= self._last:
            status = Status.STALE
        self._last = max(self._last, reading.time)
        return Estimate(time=reading.time, status=status)

    @property
    def drift(self) -> Floats:
        return np.zeros((CHIPS, 3))

    def unzero(self) -> None:
        raise NotImplementedError

    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Flags need no zero."""

    def reset(self) -> None:
        self._last = -math.inf


class ListSink(Sink):
    """Keeps what it gets."""

    def __init__(self, on_write: Callable[[], object] = lambda: None) -> None:
        self.taken: list[tuple[Reading, Estimate | None]] = []
        self.closings = 0
        self._on_write = on_write

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        self._on_write()
        self.taken.append((reading, estimate))

    def close(self) -> None:
        self.closings += 1


def at(moment: float, flags: object = None, field: object = None) -> Reading:
    return Reading(time=moment, field=np.zeros((CHIPS, 3)) if field is None else field, flags=flags)


def ticks(count: int) -> list[Reading]:
    return [at(0.01 * index) for index in range(count)]


# ---------------------------------------------------------------- what the loop does


def test_every_reading_becomes_an_estimate_in_every_sink() -> None:
    source, sinks = ListSource(ticks(5)), [ListSink(), ListSink()]
    estimates = list(run(source, FlagEstimator(), sinks=sinks))
    assert [estimate.time for estimate in estimates] == [0.01 * index for index in range(5)]
    for sink in sinks:
        assert [reading for reading, _ in sink.taken] == ticks(5)
        assert [estimate for _, estimate in sink.taken] == estimates
        assert sink.closings == 1
    assert source.closed


def test_bad_measurements_pass_and_are_counted() -> None:
    nan, inf = np.full((CHIPS, 3), np.nan), np.full((CHIPS, 3), np.inf)
    readings = [
        at(0.0),
        at(0.1, field=nan),
        at(0.2, field=inf),
        at(0.3, flags=[ChipFlag.MISSING, 0, 0]),
        at(0.4, flags=[0, ChipFlag.SATURATED, 0]),
        at(0.2),
        at(0.4),
        at(0.5),
    ]
    loop = Loop(ListSource(readings), FlagEstimator())
    assert len(list(loop)) == 8
    counters = loop.counters
    assert counters.readings == 8
    assert counters.statuses[Status.NO_CONTACT] == 2
    assert counters.statuses[Status.CHIP_MISSING] == 3
    assert counters.statuses[Status.SATURATED] == 1
    assert counters.statuses[Status.STALE] == 2
    assert counters.statuses[Status.CONTACT] == 0
    assert sum(counters.statuses.values()) == counters.readings


def test_the_recorder_gets_every_one(tmp_path: Path) -> None:
    design = read_design("planar")
    readings = [*ticks(20), at(0.05), at(0.3, flags=[1, 2, 4], field=np.full((CHIPS, 3), np.nan))]
    recorder = Recorder(tmp_path / "touch.mcap", design)
    estimates = list(run(ListSource(readings), FlagEstimator(), sinks=[recorder]))
    recording = open_recording(tmp_path / "touch.mcap")
    assert not recording.truncated
    assert list(recording) == list(zip(readings, estimates, strict=True))


def test_rate_and_latency_are_measured() -> None:
    now = [0.0]

    def pass_time(seconds: float) -> None:
        now[0] += seconds

    class SlowSource(ListSource):
        def read(self, timeout: float = 1.0) -> Reading | None:
            pass_time(0.006)
            return super().read(timeout)

    work = iter([0.004] * 99 + [0.104])
    sink = ListSink(lambda: pass_time(next(work)))
    source = SlowSource(ticks(100))
    loop = Loop(source, FlagEstimator(), sinks=[sink], clock=lambda: now[0])
    assert math.isnan(loop.counters.rate)
    assert math.isnan(loop.counters.latency_median)
    assert math.isnan(loop.latest)
    list(loop)
    assert loop.latest == now[0] - 0.006  # of the last reading, not of the source's end
    counters = loop.counters
    assert counters.rate == pytest.approx(100.0)
    assert counters.latency_median == pytest.approx(0.004)
    assert 0.004 <= counters.latency_p99 <= 0.104


def test_the_rate_is_that_of_the_last_thousand_readings() -> None:
    """The first 500 come ten times as slowly and are forgotten; two readings have one interval."""
    moments = np.cumsum([*[0.1] * 500, *[0.01] * 1000]).tolist()
    clock = iter([moment for moment in moments for _ in range(3)])  # at arrival, estimated, done
    loop = Loop(ListSource(ticks(1500)), FlagEstimator(), clock=lambda: next(clock))
    rates = []
    for _ in loop:
        rates.append(loop.counters.rate)
    assert math.isnan(rates[0])
    assert rates[1] == pytest.approx(10.0)
    assert rates[-1] == pytest.approx(100.0)
    assert rates[-3] < 99.99 < rates[-2]


def test_what_sinks_pass_over_is_summed_up() -> None:
    class Picky(ListSink):
        @property
        def dropped(self) -> int:
            return 2 * len(self.taken)

    loop = Loop(ListSource(ticks(4)), FlagEstimator(), sinks=[Picky(), ListSink(), Picky()])
    list(loop)
    assert loop.counters.dropped == 16


def test_counters_may_be_asked_from_another_thread() -> None:
    loop = Loop(ListSource(ticks(3000)), FlagEstimator())
    stop, asked = threading.Event(), []

    def ask() -> None:
        while not stop.is_set():
            asked.append(loop.counters.readings)

    asking = threading.Thread(target=ask)
    asking.start()
    try:
        list(loop)
    finally:
        stop.set()
        asking.join(5.0)
    assert asked
    assert asked == sorted(asked)
    assert loop.counters.readings == 3000


# ---------------------------------------------------------------- how it ends


def test_a_dead_source_raises_after_everything_is_closed() -> None:
    source = ListSource([at(0.0), SourceError("no reading within 0.2 s")])
    sink = ListSink()
    estimates = run(source, FlagEstimator(), sinks=[sink], deadline=0.2)
    next(estimates)
    with pytest.raises(SourceError, match="no reading within"):
        next(estimates)
    assert source.timeouts == [0.2, 0.2]
    assert (source.closed, sink.closings) == (True, 1)


def test_breaking_off_closes_everything() -> None:
    source, sink = ListSource(ticks(5)), ListSink()
    for _ in run(source, FlagEstimator(), sinks=[sink]):
        break
    gc.collect()
    assert (source.closed, sink.closings) == (True, 1)


def test_the_log_tells_of_a_loop_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", "smoskin")
    with Loop(ListSource([]), FlagEstimator()) as loop:
        list(loop)
        loop.close()
    assert len(caplog.messages) == 1


def test_the_context_closes_even_a_loop_that_never_ran() -> None:
    source, sink = ListSource(ticks(5)), ListSink()
    with Loop(source, FlagEstimator(), sinks=[sink]):
        pass
    assert (source.closed, sink.closings) == (True, 1)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
@pytest.mark.parametrize("place", ["source", "estimator", "sink", "user"])
def test_whatever_interrupts_closes_everything(error: type[BaseException], place: str) -> None:
    def fail() -> None:
        raise error

    source, sinks = ListSource(ticks(3)), [ListSink(), ListSink()]
    estimator = FlagEstimator()
    if place == "source":
        source.read = lambda timeout=1.0: fail()  # type: ignore[method-assign]
    elif place == "estimator":
        estimator.step = lambda reading: fail()  # type: ignore[method-assign]
    elif place == "sink":
        sinks[0] = ListSink(fail)

    def use() -> None:
        with Loop(source, estimator, sinks=sinks) as loop:
            for _ in loop:
                fail()

    with pytest.raises(error):
        use()
    assert source.closed
    assert all(sink.closings >= 1 for sink in sinks)


def test_a_sink_that_fails_to_close_does_not_keep_others_open() -> None:
    class Stubborn(ListSink):
        def close(self) -> None:
            raise SmoskinError("stuck")

    source, last = ListSource(ticks(2)), ListSink()
    with pytest.raises(SmoskinError, match="stuck"):
        list(run(source, FlagEstimator(), sinks=[Stubborn(), last]))
    assert (source.closed, last.closings) == (True, 1)


def test_a_sink_that_stands_still_aside_does_not_hold_up_the_loop() -> None:
    go = threading.Event()
    sink = ListSink(lambda: go.wait(10.0))
    readings = ticks(50)
    with Aside(sink, room=8) as aside:
        loop = Loop(ListSource(readings), FlagEstimator(), sinks=[aside])
        estimates = iter(loop)
        for _ in readings:  # all of them, while not a single one is written
            next(estimates)
        assert sink.taken == []
        assert loop.counters.dropped in (41, 42)  # one may be in the sink's hands
        go.set()
        assert list(estimates) == []
    assert [reading for reading, _ in sink.taken] == readings[: 50 - aside.dropped]
    assert sink.closings == 1


def test_what_can_wait_loses_nothing_aside() -> None:
    sink, readings = ListSink(lambda: time.sleep(1e-4)), ticks(300)
    with Loop(
        ListSource(readings), FlagEstimator(), sinks=[Aside(sink, room=2, patience=10.0)]
    ) as loop:
        list(loop)
    assert [reading for reading, _ in sink.taken] == readings
    assert loop.counters.dropped == 0


def test_what_a_sink_raises_aside_is_raised_where_it_is_written() -> None:
    def fail() -> None:
        raise SmoskinError("full of readings")

    sink = ListSink(fail)
    aside = Aside(sink)

    def write_until_it_raises() -> None:
        for moment in range(10_000):
            aside.write(at(float(moment)))
            time.sleep(1e-3)

    with pytest.raises(SmoskinError, match="full of readings"):
        write_until_it_raises()
    with pytest.raises(SmoskinError, match="full of readings"):
        aside.close()
    aside.close()
    assert sink.closings == 1
    with pytest.raises(ArgumentError, match=r"room must be >= 1 and patience .*; got 0 and"):
        Aside(sink, room=0)


def test_a_sink_that_never_moves_again_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop_module, "_CLOSE_DEADLINE", 0.05)
    go = threading.Event()
    aside = Aside(ListSink(lambda: go.wait(10.0)))
    aside.write(at(0.0))
    aside.write(at(1.0))
    with pytest.raises(SmoskinError, match=r"ListSink has not taken . readings within 0\.05 s"):
        aside.close()
    go.set()


def test_the_wrong_number_of_chips_is_wrong_use() -> None:
    source, sink = ListSource([Reading(time=0.0, field=np.zeros((4, 3)))]), ListSink()
    with pytest.raises(ArgumentError, match="reading must have 3 chips; got 4"):
        list(run(source, FlagEstimator(), sinks=[sink]))
    assert (source.closed, sink.closings, sink.taken) == (True, 1, [])


@pytest.mark.parametrize("deadline", [0.0, -1.0, math.inf, math.nan])
def test_nothing_runs_without_a_deadline(deadline: float) -> None:
    with pytest.raises(ArgumentError, match="deadline must be positive and finite"):
        run(ListSource([]), FlagEstimator(), deadline=deadline)
