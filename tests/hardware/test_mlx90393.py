"""The driver against chips that behave, byte for byte, as their data sheet says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from chip_fake import BlinkaBus, Clock, FakeBus, FakeChip
from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.budget import time_budget
from smoskin.hardware.mlx90393 import Chips, Mode, present
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag

PLANAR = HallSetting(gain_selection=3, resolution=2, oversampling=1, digital_filter=3)
FAST = HallSetting(gain_selection=3, resolution=2, oversampling=0, digital_filter=2)
ADDRESSES = (0x0C, 0x0D, 0x0E)


def driver(bus: FakeBus, setting: HallSetting = PLANAR, mode: Mode = "single") -> Chips:
    clock = bus.clock
    chips = Chips(bus, ADDRESSES, setting, mode=mode, clock=clock, sleep=clock.sleep)
    chips.begin()
    return chips


def ramp(time: float) -> tuple[int, int, int]:
    """A field that tells its own time: 10,000 counts of RES 0 a second, from 100 s on."""
    return round((time - 100.0) * 2.5e4), 0, 0


def test_every_setting_reads_what_the_chip_is_in(bus: FakeBus) -> None:
    for gain in range(8):
        for resolution in range(4):
            setting = HallSetting(
                gain_selection=gain, resolution=resolution, oversampling=0, digital_filter=2
            )
            reading = driver(bus, setting).scan().reading(setting)
            assert_array_equal(reading.flags, 0)
            field = np.array([1000, -2000, 3000]) * [0.15e-6, 0.15e-6, 0.242e-6]
            assert_allclose(
                reading.field, np.tile(field, (3, 1)), atol=1.01 * mlx90393.sensitivity(setting)[2]
            )
            assert_allclose(reading.temperature, 25.0)


def test_all_chips_are_started_before_one_is_waited_for(bus: FakeBus) -> None:
    chips = driver(bus)
    bus.log.clear()
    start = bus.clock()
    chips.scan()
    commands = [(address, data[0]) for address, data in bus.log]
    assert commands[:6] == [
        *((address, 0x3F) for address in ADDRESSES),
        *((address, 0x4F) for address in ADDRESSES),
    ]
    assert commands[6][1] == 0x50
    assert len(commands) == 7
    assert_allclose(bus.clock() - start, 1 / time_budget(PLANAR, 3).rate, rtol=1e-9)


@pytest.mark.parametrize("mode", ["single", "burst"])
@pytest.mark.parametrize("oscillator", [0.9, 0.95, 1.0, 1.05, 1.1])
@pytest.mark.parametrize("setting", [PLANAR, FAST])
def test_nothing_stale_is_read_at_any_tolerance(
    bus: FakeBus, oscillator: float, mode: Mode, setting: HallSetting
) -> None:
    for place, chip in enumerate(bus.chips.values()):
        chip.oscillator = (oscillator, 1.0, 2.0 - oscillator)[place]
        chip.waking = 1.0 + 2 * (chip.oscillator - 1.0)
        chip.field = ramp
    chips = driver(bus, setting, mode)
    readings = [chips.scan().reading(setting) for _ in range(200)]
    assert not any(reading.flags.any() for reading in readings)
    for chip in bus.chips.values():
        # Every measurement that was given is a new one.
        assert (np.diff(chip.reads) > 0).all()
    stamped = np.array([reading.time for reading in readings])
    field = np.array([reading.field[:, 0] for reading in readings])
    true = 100.0 + field / (2.5e4 * 0.15e-6)
    # A single measurement is over half of its time after its middle; in burst mode one may be
    # nearly a period old when it is read.
    single, burst = mlx90393.conversion_time, mlx90393.burst_period
    share, lasting = {"single": (0.75, single), "burst": (1.3, burst)}[mode]
    most = share * lasting(setting, 0, worst=True)
    assert np.abs(true - stamped[:, None]).max() < most


def test_three_chips_in_burst_give_450_readings_a_second(bus: FakeBus) -> None:
    for chip, oscillator in zip(bus.chips.values(), (0.9, 1.0, 1.1), strict=True):
        chip.oscillator = oscillator
    chips = driver(bus, FAST, "burst")
    chips.scan()
    start = bus.clock()
    flags = [chips.scan().reading(FAST).flags for _ in range(900)]
    assert 900 / (bus.clock() - start) >= 450
    assert not np.any(flags)


def test_the_time_of_a_reading_is_the_middle_of_its_measurement(bus: FakeBus) -> None:
    chips = driver(bus)
    start = bus.clock()
    scan = chips.scan()
    assert_allclose(scan.time - start, (0.29e-3 + 4.98e-3) / 2, atol=0.05e-3)


def test_a_chip_that_is_unplugged_is_missing_and_comes_back(bus: FakeBus) -> None:
    chips = driver(bus)
    bus.chips[0x0D].answering = False
    for _ in range(5):
        reading = chips.scan().reading(PLANAR)
        assert_array_equal(reading.flags, [0, ChipFlag.MISSING, 0])
        assert np.isnan(reading.field[1]).all()
    bus.chips[0x0D].answering = True
    bus.chips[0x0D].brown_out()
    assert chips.scan().reading(PLANAR).flags[1] & ChipFlag.INVALID
    assert_array_equal(chips.scan().reading(PLANAR).flags, 0)
    assert chips.resets == 1


@pytest.mark.parametrize("mode", ["single", "burst"])
def test_a_chip_that_loses_its_supply_is_marked_and_set_anew(bus: FakeBus, mode: Mode) -> None:
    chips = driver(bus, mode=mode)
    sound = chips.scan().reading(PLANAR)
    for _ in range(3):
        bus.chips[0x0E].brown_out()
        reading = chips.scan().reading(PLANAR)
        assert reading.flags[2] & ChipFlag.INVALID
        assert np.isnan(reading.field[2]).all()
        assert_allclose(reading.field[:2], sound.field[:2])
        again = chips.scan().reading(PLANAR)
        assert_array_equal(again.flags, 0)
        assert_allclose(again.field, sound.field)
    assert chips.resets == 3


def test_a_supply_lost_during_a_conversion_is_noticed(bus: FakeBus) -> None:
    chips = driver(bus)
    victim, sleep, lost = bus.chips[0x0C], bus.clock.sleep, []

    def waits(seconds: float) -> None:
        if seconds > 3e-3 and not lost:
            victim.brown_out()
            lost.append(seconds)
        sleep(seconds)

    chips._sleep = waits
    assert chips.scan().reading(PLANAR).flags[0] & ChipFlag.INVALID
    assert_array_equal(chips.scan().reading(PLANAR).flags, 0)


def test_a_register_that_changes_in_silence_is_found_within_nine_scans(bus: FakeBus) -> None:
    chips = driver(bus)
    bus.chips[0x0D].registers[0] = 0x007C
    flags = [int(chips.scan().reading(PLANAR).flags[1]) for _ in range(10)]
    assert flags.count(int(ChipFlag.INVALID)) == 1
    assert bus.chips[0x0D].registers[0] == 0x003C
    assert chips.resets == 1


def test_a_chip_slower_than_its_limits_is_old_not_false(bus: FakeBus) -> None:
    bus.chips[0x0C].oscillator = 2.0
    chips = driver(bus)
    reading = chips.scan().reading(PLANAR)
    assert reading.flags[0] & ChipFlag.OLD
    assert np.isnan(reading.field[0]).all()
    assert_array_equal(reading.flags[1:], 0)


def test_chips_that_do_not_answer_or_keep_are_named_at_the_start(bus: FakeBus) -> None:
    del bus.chips[0x0D]
    bus.chips[0x0E].stuck = 0x80
    with pytest.raises(SourceError, match=r"chip 0x0d: It does not answer\. .*chip 0x0e: Its reg"):
        driver(bus)


def test_burst_ends_when_asked(bus: FakeBus) -> None:
    chips = driver(bus, mode="burst")
    assert {chip.mode for chip in bus.chips.values()} == {0x80}
    chips.end()
    assert {chip.mode for chip in bus.chips.values()} == {0}


@pytest.mark.parametrize(
    ("addresses", "setting", "message"),
    [
        ((), PLANAR, "addresses must be different ones"),
        ((12, 12), PLANAR, "addresses must be different ones"),
        ((200,), PLANAR, "addresses must lie in"),
        (
            (12,),
            HallSetting(gain_selection=7, resolution=0, oversampling=0, digital_filter=0),
            "setting must leave the chip's filter time",
        ),
    ],
)
def test_wrong_use_is_named(bus: FakeBus, addresses, setting, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Chips(bus, addresses, setting)


def examined(bus: FakeBus) -> list[str]:
    clock = bus.clock
    chips = Chips(bus, ADDRESSES, PLANAR, clock=clock, sleep=clock.sleep)
    return [str(finding) for finding in chips.examine()]


def noisy(seed: int, counts: float):
    rng = np.random.default_rng(seed)

    def field(time: float) -> tuple[int, int, int]:
        return tuple(int(v) for v in np.rint(rng.normal([4e3, 8e3, 3e4], counts)))

    return field


def test_sound_chips_have_no_findings(bus: FakeBus) -> None:
    for seed, chip in enumerate(bus.chips.values()):
        chip.field = noisy(seed, 12.0)  # 1.8 uT
    assert examined(bus) == []


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (lambda chip: setattr(chip, "answering", False), "It does not answer."),
        (lambda chip: setattr(chip, "stuck", 0x80), "Its register 0 does not keep 0x003c."),
        (lambda chip: setattr(chip, "oscillator", 2.0), "It has nothing new to say"),
        (lambda chip: setattr(chip, "word", lambda t: 60000), "It reports 329 degC."),
        (lambda chip: setattr(chip, "field", lambda t: (9, 9, 9)), "It says the same to the bit"),
        (lambda chip: setattr(chip, "field", noisy(9, 200.0)), "Its noise in"),
        (lambda chip: setattr(chip, "field", lambda t: (4e5, 0, 0)), "at the end of its range"),
    ],
)
def test_each_fault_of_a_chip_is_found(bus: FakeBus, spoil, problem: str) -> None:
    for seed, chip in enumerate(bus.chips.values()):
        chip.field = noisy(seed, 12.0)
    spoil(bus.chips[0x0D])
    findings = examined(bus)
    assert len(findings) == 1
    assert findings[0].startswith(f"chip 0x0d: {problem}") or problem in findings[0]


def test_chips_are_found_at_their_addresses(bus: FakeBus) -> None:
    bus.chips[0x18] = FakeChip(bus.clock)
    assert present(bus) == (0x0C, 0x0D, 0x0E, 0x18)


def test_the_driver_of_others_reads_these_chips(
    clock: Clock, bus: FakeBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The unmodified driver of PyPI, whose times are those of the fake's clock."""
    others = pytest.importorskip("adafruit_mlx90393")
    passing = type("Time", (), {"sleep": staticmethod(clock.sleep), "monotonic": clock})
    monkeypatch.setattr(others, "time", passing)
    for gain, resolution in ((7, 0), (3, 2), (0, 3)):
        chip = others.MLX90393(
            BlinkaBus(bus), address=0x0D, gain=gain, resolution=resolution, oversampling=1, filt=5
        )
        assert_allclose(chip.magnetic, [150.0, -300.0, 726.0], atol=9.7)
        assert not chip.last_status & 0x10
        setting = HallSetting(
            gain_selection=gain, resolution=resolution, oversampling=1, digital_filter=5
        )
        reading = driver(bus, setting).scan().reading(setting)
        assert_allclose(reading.field[1] * 1e6, chip.magnetic, rtol=2e-3)
