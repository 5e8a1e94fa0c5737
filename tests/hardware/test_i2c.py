"""Chips on the computer's own bus, through an object of smbus2's kind."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from chip_fake import Clock, FakeBus, FakeChip
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.i2c import ChipSource, SmbusBus
from smoskin.pace import Pace
from smoskin.records import ChipFlag
from smoskin.service.source import open_source

smbus2 = pytest.importorskip("smbus2")


class FakeSmbus:
    """An open `smbus2.SMBus`, which takes a write and a read as messages."""

    def __init__(self, bus: FakeBus) -> None:
        self.bus = bus

    def i2c_rdwr(self, *messages) -> None:
        write, read = messages
        assert write.addr == read.addr
        for place, byte in enumerate(self.bus.transfer(write.addr, bytes(list(write)), read.len)):
            read.buf[place] = bytes([byte])

    def close(self) -> None:
        self.bus.close()


def source_of(design: SkinDesign, bus: FakeBus, **options) -> ChipSource:
    clock = bus.clock
    pace = Pace(clock, clock.sleep)
    return ChipSource(
        design, SmbusBus(FakeSmbus(bus)), pace=pace, clock=clock, sleep=clock.sleep, **options
    )


def test_readings_come_at_their_rate_with_the_chips_field(planar: SkinDesign, bus: FakeBus) -> None:
    with source_of(planar, bus, rate=100.0) as source:
        readings = [source.read() for _ in range(50)]
    assert source.chips == 3
    assert source.design_hash == planar.content_hash
    assert all(reading is not None and not reading.flags.any() for reading in readings)
    times = np.array([reading.time for reading in readings if reading])
    assert_allclose(np.diff(times), 0.01, atol=1e-9)
    assert 0.0 < times[0] < 0.01
    assert_allclose(readings[0].field[2], [150e-6, -300e-6, 726e-6], atol=2.5e-6)


def test_the_end_leaves_chips_at_rest_and_lets_the_bus_go(planar: SkinDesign, bus: FakeBus) -> None:
    source = source_of(planar, bus)
    source.read()
    closing = threading.Thread(target=source.close)
    closing.start()
    closing.join(5.0)
    assert source.read() is None
    assert bus.closed
    assert {chip.mode for chip in bus.chips.values()} == {0}


def test_faults_are_marked_and_counted(planar: SkinDesign, bus: FakeBus) -> None:
    with source_of(planar, bus) as source:
        source.read()
        bus.chips[0x0C].brown_out()
        assert source.read().flags[0] & ChipFlag.INVALID
        assert_array_equal(source.read().flags, 0)
        assert source.resets == 1
        bus.chips.clear()
        assert_array_equal(source.read().flags, ChipFlag.MISSING)


def test_a_board_that_is_not_there_is_told_at_once(planar: SkinDesign, clock: Clock) -> None:
    bus = FakeBus(clock, {})
    with pytest.raises(SourceError, match=r"chip 0x0c: It does not answer\. Look at its supply"):
        source_of(planar, bus)


def test_a_rate_that_the_setting_does_not_allow_is_refused(planar: SkinDesign, bus) -> None:
    message = r"at most 146 Hz .* got 200 Hz, which oversampling 0 and digital_filter 3 allow"
    with pytest.raises(ArgumentError, match=message):
        source_of(planar, bus, rate=200.0)
    faster = replace(planar.hall_setting, oversampling=0, digital_filter=2)
    with source_of(replace(planar, hall_setting=faster), bus, rate=450.0, mode="burst") as source:
        flags = [source.read().flags for _ in range(300)]
    assert not np.any(flags[1:])


def test_a_device_that_cannot_be_opened_says_why() -> None:
    with pytest.raises(SourceError, match=r"/dev/i2c-none cannot be opened: No such file"):
        SmbusBus("/dev/i2c-none")


def test_a_url_names_device_design_rate_and_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    chips = {0x0C + k: FakeChip(time.monotonic) for k in range(3)}
    opened, buses = [], []

    def device(path: str) -> FakeSmbus:
        opened.append(path)
        buses.append(FakeBus(Clock(), chips))
        return FakeSmbus(buses[-1])

    monkeypatch.setattr(smbus2, "SMBus", device)
    with open_source("i2c:///dev/i2c-7?design=planar&rate=50&mode=burst") as source:
        assert source.read().field.shape == (3, 3)
        assert {chip.mode for chip in chips.values()} == {0x80}
    assert opened == ["/dev/i2c-7"]
    assert buses[0].closed
    chips.clear()
    with pytest.raises(SourceError, match="chip 0x0c: It does not answer"):
        open_source("i2c:///dev/i2c-7")
    assert buses[-1].closed
    with pytest.raises(ArgumentError, match="mode must be one of single, burst"):
        open_source("i2c:///dev/i2c-7?mode=fast")
