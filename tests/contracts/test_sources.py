"""What every source promises, asked of each of them."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from boards import BoardAndReader
from chip_fake import Clock, FakeBus, FakeChip
from firmware_board import FirmwareOnPort
from smoskin.design.document import read_design
from smoskin.errors import SourceError
from smoskin.hardware.board import VirtualBoard
from smoskin.hardware.i2c import ChipSource
from smoskin.records import Reading
from smoskin.roles import Source
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.service.replay import ReplaySource
from smoskin.service.source import TwinSource, open_source
from smoskin.twin.creep import Creep
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

DESIGN = read_design("planar")

#: Makes a source that gives a reading every so many seconds, at least ten of them.
Factory = Callable[[float], Source]


#: Seconds by which the clock of a source may be off the pace on a busy machine: none, or a board's.
OFF = dict.fromkeys(("chips", "board", "firmware"), 0.2)


@pytest.fixture(
    params=[
        "replay",
        "reduced twin",
        "whole twin",
        "chips",
        "board",
        "firmware",
        "replay by URL",
        "twin by URL",
    ]
)
def make(request: pytest.FixtureRequest, tmp_path: Path) -> Factory:
    def recorded(period: float) -> Path:
        path = tmp_path / "touch.mcap"
        with Recorder(path, DESIGN) as sink:
            for index in range(10):
                shape = (len(DESIGN.halls), 3)
                sink.write(Reading(time=period * index, field=np.zeros(shape)))
        return path

    def make_one(period: float) -> Source:
        match request.param:
            case "replay":
                recording = open_recording(recorded(period))
                return ReplaySource(recording, longest_gap=2 * period)
            case "reduced twin":
                return TwinSource(ReducedTwin(DESIGN), rate=1 / period)
            case "whole twin":
                return TwinSource(
                    Twin(DESIGN, manufactured=True), rate=1 / period, creep=Creep(DESIGN)
                )
            case "chips":
                chips = {site.address: FakeChip(time.monotonic) for site in DESIGN.halls}
                # Chips that convert in 5 ms cannot be read every 2 ms.
                return ChipSource(DESIGN, FakeBus(Clock(), chips), rate=1 / max(period, 0.01))
            case "board":
                board = VirtualBoard(TwinSource(ReducedTwin(DESIGN), rate=1 / period))
                return BoardAndReader(board, lambda port: open_source(f"serial://{port}"))
            case "firmware":
                firmware = FirmwareOnPort(1 / max(period, 0.01))
                return BoardAndReader(firmware, lambda port: open_source(f"serial://{port}"))
            case "replay by URL":
                return open_source(f"replay:{recorded(period)}?gap={2 * period}")
            case _:
                return open_source(f"twin://planar?rate={1 / period}")

    return make_one


def test_every_reading_has_the_promised_chips(make: Factory) -> None:
    with make(0.002) as source:
        for _ in range(5):
            reading = source.read()
            assert reading is not None
            assert len(reading.field) == source.chips == len(DESIGN.halls)


def test_the_design_of_the_skin_is_named(make: Factory) -> None:
    with make(0.002) as source:
        assert source.design_hash == DESIGN.content_hash


def test_iterating_ends_when_closed(make: Factory) -> None:
    with make(0.002) as source:
        count = 0
        for _ in source:
            count += 1
            if count == 3:
                source.close()
            if count > 100:
                break
    assert count == 3


def test_closing_is_for_good_and_may_be_repeated(make: Factory) -> None:
    source = make(0.002)
    assert source.read() is not None
    source.close()
    source.close()
    assert source.read() is None
    assert list(source) == []


def test_closing_before_the_first_reading(make: Factory) -> None:
    source = make(0.002)
    source.close()
    assert source.read() is None


def test_leaving_the_context_closes_even_after_an_error(make: Factory) -> None:
    source = make(0.002)
    with pytest.raises(ZeroDivisionError), source:
        raise ZeroDivisionError
    assert source.read() is None


def test_a_late_reading_raises_in_time_and_is_not_lost(
    make: Factory, request: pytest.FixtureRequest
) -> None:
    off = OFF.get(request.node.callspec.params["make"], 0.0)
    with make(0.5) as source:
        first = source.read()
        assert first is not None
        start = time.monotonic()
        with pytest.raises(SourceError, match=r"no reading within 0\.05 s"):
            source.read(timeout=0.05)
        assert 0.04 <= time.monotonic() - start < 0.45
        second = source.read(timeout=2.0)
        assert second is not None
        assert second.time == pytest.approx(first.time + 0.5, rel=1e-6, abs=off)


def test_closing_from_another_thread_wakes_a_waiting_read(make: Factory) -> None:
    with make(30.0) as source:
        assert source.read() is not None
        closing = threading.Timer(0.05, source.close)
        start = time.monotonic()
        closing.start()
        assert source.read(timeout=20.0) is None
        assert time.monotonic() - start < 10.0
        closing.join(5.0)


def test_readings_come_at_their_pace(make: Factory) -> None:
    with make(0.02) as source:
        start = time.monotonic()
        for _ in range(6):
            source.read()
        # Never early; how late depends on the machine.
        assert 0.099 <= time.monotonic() - start < 5.0
