"""Boards on serial ports: readings, times, faults that are named, and ports that vanish."""

import re
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from boards import BoardAndReader, Line, Readings
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.board import VirtualBoard, scan_of
from smoskin.hardware.serial import SerialSource, recognised
from smoskin.hardware.wire.foreign import anyskin_frame, eflesh_frame
from smoskin.hardware.wire.framing import Framer
from smoskin.hardware.wire.messages import BoardScan, Kind, read_set, reading_frame
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag, Reading
from smoskin.service.source import TwinSource, open_source
from smoskin.twin.reduced import ReducedTwin

pytest.importorskip("serial")


LONG = 20.0
"""Seconds that a busy machine may take for what is due at once."""


def complaint(source: SerialSource, text: str) -> None:
    """Read until the source says this of its silence, as a busy machine may hear late."""
    end = time.monotonic() + LONG
    while True:
        with pytest.raises(SourceError) as error:
            source.read(timeout=0.3)
        if re.search(text, str(error.value)) or time.monotonic() > end:
            break
    assert re.search(text, str(error.value))


def frames(design: SkinDesign, count: int, first: int = 0, rate: float = 200.0) -> list[bytes]:
    """Frames of a board of a design, each of whose fields tells its number."""
    setting = design.hall_setting
    addresses = tuple(site.address for site in design.halls)
    sent = []
    for number in range(first, first + count):
        counts = np.full((len(addresses), 3), number % 8000)
        reading = Reading(
            time=0.0, field=mlx90393.tesla(counts, setting), temperature=[25.0] * len(addresses)
        )
        scan = scan_of(reading, design, 3.0 + number / rate)
        board = BoardScan(sequence=number % 65536, scan=scan, addresses=addresses, setting=setting)
        sent.append(reading_frame(board))
    return sent


def numbers(readings, design: SkinDesign) -> list[int]:
    step = mlx90393.sensitivity(design.hall_setting)[0]
    return [round(float(reading.field[0, 0] / step)) for reading in readings]


def test_what_a_board_sends_is_read(planar: SkinDesign) -> None:
    with Line() as line, SerialSource(line.port, design=planar) as source:
        line.send(b"".join(frames(planar, 50)))
        readings = [source.read(LONG) for _ in range(50)]
        assert numbers(readings, planar) == list(range(50))
        assert source.chips == 3
        assert source.design_hash == planar.content_hash
        assert source.counters.readings == 50
        assert source.counters.lost == source.counters.corrupt == source.counters.dropped == 0
        times = [reading.time for reading in readings]
        assert (np.diff(times) > 0).all()
        assert_allclose(np.diff(times), 5e-3, rtol=0.03)


def test_a_board_is_greeted_and_asked_for_its_rate(planar: SkinDesign) -> None:
    with Line() as line, SerialSource(line.port, design=planar, rate=125.0):
        time.sleep(0.1)
        asked = Framer().feed(line.received())
    assert [frame.kind for frame in asked] == [Kind.IDENTIFY, Kind.SET]
    assert read_set(asked[1]) == (planar.hall_setting, 125.0)


def test_chips_come_in_the_order_of_the_design(planar: SkinDesign) -> None:
    halls = planar.halls
    swapped = SkinDesign(
        **{name: getattr(planar, name) for name in planar.__slots__ if name != "halls"},
        halls=(halls[2], halls[0], halls[1]),
    )
    reading = Reading(time=0.0, field=np.diag([1e-3, 2e-3, 3e-3]), temperature=[20.0, 30.0, 40.0])
    frame = reading_frame(
        BoardScan(
            sequence=0,
            scan=scan_of(reading, planar, 1.0),
            addresses=tuple(site.address for site in halls),
            setting=planar.hall_setting,
        )
    )
    with Line() as line, SerialSource(line.port, design=swapped) as source:
        line.send(frame)
        read = source.read(LONG)
        assert_allclose(read.temperature, [40.0, 20.0, 30.0], atol=0.02)
        assert_allclose(read.field[0], [0, 0, 3e-3], atol=3e-6)


def test_boards_by_others_are_read_with_their_own_formats() -> None:
    counts = np.random.default_rng(0).integers(-900, 900, (30, 5, 3))
    warm = np.full(5, 25.0)
    any_field = mlx90393.tesla(counts, setting_of(6, 0))
    with Line() as line, SerialSource(line.port, format="anyskin") as source:
        line.send(b"".join(anyskin_frame(field, warm) for field in any_field))
        readings = [source.read(LONG) for _ in range(30)]
    assert_allclose([reading.field for reading in readings], any_field, rtol=1e-6)
    assert (np.diff([reading.time for reading in readings]) > 0).all()
    field = mlx90393.tesla(counts, setting_of(4, 3))
    with Line() as line, open_source(f"serial://{line.port}?format=eflesh") as source:
        line.send(b"".join(eflesh_frame(row, k) for k, row in enumerate(field)))
        readings = [source.read(LONG) for _ in range(30)]
    assert_allclose([reading.field for reading in readings], field, rtol=1e-6)
    assert source.design is None


def setting_of(gain: int, resolution: int):
    from smoskin.design.skin import HallSetting

    return HallSetting(gain_selection=gain, resolution=resolution, oversampling=0, digital_filter=2)


def test_a_port_that_vanishes_is_opened_again(
    planar: SkinDesign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from smoskin.hardware import serial

    monkeypatch.setattr(serial, "_AGAIN", 0.01)
    link = str(tmp_path / "board")
    line = Line(link)
    with SerialSource(link, design=planar) as source:
        first = 0
        last = 0.0
        for _ in range(20):
            line.send(b"".join(frames(planar, 10, first)))
            readings = [source.read(LONG) for _ in range(10)]
            assert numbers(readings, planar) == list(range(first, first + 10))
            assert readings[0].time > last
            last = readings[-1].time
            # Half a frame is lost with the port.
            line.send(frames(planar, 1, first + 10)[0][:20])
            time.sleep(0.01)
            line.hang_up()
            line = Line(link)
            first += 300
            deadline = time.monotonic() + LONG
            while source.counters.reconnections < first // 300 and time.monotonic() < deadline:
                time.sleep(0.005)
        assert source.counters.reconnections == 20
        assert source.counters.lost == 0
    line.hang_up()


@pytest.mark.slow
def test_nothing_is_lost_at_200_and_500_readings_a_second(planar: SkinDesign) -> None:
    def send(line: Line, rate: float) -> None:
        start = time.monotonic()
        for number, frame in enumerate(frames(planar, round(10 * rate), rate=rate)):
            time.sleep(max(0.0, start + number / rate - time.monotonic()))
            line.deliver(frame)

    with Line() as first, Line() as second:
        rates = {first: 200.0, second: 500.0}
        sources = {line: SerialSource(line.port, design=planar) for line in rates}
        sending = [threading.Thread(target=send, args=given) for given in rates.items()]
        for thread in sending:
            thread.start()
        for line, rate in rates.items():
            with sources[line] as source:
                readings = [source.read(LONG) for _ in range(round(10 * rate))]
                assert numbers(readings, planar) == [k % 8000 for k in range(round(10 * rate))]
                counters = source.counters
                assert counters.lost == counters.corrupt == counters.dropped == 0
                assert (np.diff([reading.time for reading in readings]) > 0).all()
        for thread in sending:
            thread.join()


def test_a_port_that_stays_away_is_told(planar: SkinDesign, tmp_path: Path) -> None:
    # By a name of its own: the next terminal of any program may get the number of this one.
    line = Line(str(tmp_path / "board"))
    with SerialSource(line.port, design=planar, patience=0.3) as source:
        line.hang_up()
        complaint(source, r"is gone: is the board plugged in\?")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is open and silent: is it the right port"),
        (b"hello world\r\n" * 20, "260 bytes came and none is of the format smoskin: is baud"),
        ("anyskin", "the board speaks the format anyskin: use format=anyskin$"),
        ("three", "the board speaks the format anyskin&chips=3: use format=anyskin&chips=3"),
        ("eflesh", "the board speaks the format eflesh: use format=eflesh"),
    ],
)
def test_silence_is_explained(planar: SkinDesign, data: bytes | str, message: str) -> None:
    rng = np.random.default_rng(0)
    field = mlx90393.tesla(rng.integers(-900, 900, (20, 5, 3)), setting_of(6, 0))
    lines = {
        "anyskin": b"".join(anyskin_frame(row, np.full(5, 25.0)) for row in field),
        "three": b"".join(anyskin_frame(row[:3], np.full(3, 25.0)) for row in field),
        "eflesh": b"".join(eflesh_frame(row, k) for k, row in enumerate(field)),
    }
    with Line() as line, SerialSource(line.port, design=planar) as source:
        line.send(lines[data] if isinstance(data, str) else data)
        complaint(source, rf"no reading within 0\.3 s; .*{message}")


def test_chips_at_other_addresses_are_named(planar: SkinDesign) -> None:
    scan = scan_of(ReducedTwin(planar).read(), planar, 1.0)
    board = BoardScan(
        sequence=0, scan=scan, addresses=(0x10, 0x11, 0x12), setting=planar.hall_setting
    )
    with Line() as line, SerialSource(line.port, design=planar) as source:
        line.send(reading_frame(board))
        message = r"must have chips at 0x0c 0x0d 0x0e, as the design has; it has 0x10 0x11 0x12"
        with pytest.raises(SourceError, match=message):
            source.read(LONG)


def test_chips_at_another_setting_are_told_or_waited_for(planar: SkinDesign) -> None:
    other = replace(planar, hall_setting=replace(planar.hall_setting, gain_selection=0))
    with Line() as line, SerialSource(line.port, design=planar) as source:
        line.send(frames(other, 1)[0])
        with pytest.raises(SourceError, match=r"must have its chips at the setting of the design"):
            source.read(LONG)
    with Line() as line, SerialSource(line.port, design=planar, rate=100.0) as source:
        line.send(b"".join(frames(other, 5) + frames(planar, 5, 5)))
        assert numbers([source.read(LONG) for _ in range(5)], planar) == [5, 6, 7, 8, 9]


def test_readings_that_nobody_asks_for_are_dropped_and_counted(planar: SkinDesign) -> None:
    with Line() as line, SerialSource(line.port, design=planar) as source:
        assert source.room == 10_000
        source.room = 20
        for start in range(0, 100, 10):
            line.send(b"".join(frames(planar, 10, start)))
            time.sleep(0.02)
        while source.counters.readings < 100:
            time.sleep(0.01)
        assert source.counters.dropped == 80
        assert numbers([source.read(LONG)], planar) == [80]


def test_a_late_frame_is_counted_and_keeps_its_time(planar: SkinDesign) -> None:
    sent = frames(planar, 30, rate=100.0)
    with Line() as line, SerialSource(line.port, design=planar) as source:
        times = []
        for number, frame in enumerate(sent):
            if number != 20:
                line.send(frame)
            if number == 25:
                time.sleep(0.01)
            time.sleep(0.01)
        line.send(sent[20])
        readings = [source.read(LONG) for _ in range(29)]
        times = [reading.time for reading in readings]
    assert (np.diff(times) > 0).all()
    assert source.counters.lost == 1
    assert source.counters.repeated == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": "morse"}, "format must be one of smoskin, anyskin, eflesh; got 'morse'"),
        ({}, "design must be given for a board of the format smoskin"),
        ({"format": "eflesh", "chips": 65}, r"chips must lie in 1\.\.64"),
        ({"format": "eflesh", "patience": -1.0}, "patience must be >= 0 s"),
    ],
)
def test_wrong_use_is_named(options, message: str) -> None:
    with Line() as line, pytest.raises(ArgumentError, match=message):
        SerialSource(line.port, **options)


def test_design_and_chips_agree(planar: SkinDesign) -> None:
    with Line() as line, pytest.raises(ArgumentError, match="chips must be the design's 3; got 5"):
        SerialSource(line.port, format="anyskin", design=planar, chips=5)


def test_a_port_that_is_not_there_says_what_to_do(planar: SkinDesign) -> None:
    with pytest.raises(SourceError, match=r"cannot be opened: .*is the board plugged in"):
        SerialSource("/dev/ttyNone7", design=planar)
    with pytest.raises(SourceError, match="no board of USB serial 'E66' is plugged in"):
        SerialSource("usb:E66", design=planar)


def test_two_readers_of_one_port_are_too_many(planar: SkinDesign) -> None:
    with (
        Line() as line,
        SerialSource(line.port, design=planar),
        pytest.raises(SourceError, match="another program reads it"),
    ):
        SerialSource(line.port, design=planar)


def test_a_virtual_board_sends_what_the_twin_reads(planar: SkinDesign) -> None:
    twin = ReducedTwin(planar, seed=3)
    made = [twin.read(time=0.01 * k) for k in range(20)]
    board = VirtualBoard(Readings(planar, made))
    with BoardAndReader(board, lambda port: SerialSource(port, design=planar)) as source:
        read = [source.read(LONG) for _ in range(20)]
    # The twin's readings are whole counts already.
    assert_allclose([r.field for r in read], [r.field for r in made], rtol=0, atol=1e-15)
    assert_allclose([r.temperature for r in read], [r.temperature for r in made], atol=1e-9)
    assert_array_equal([r.flags for r in read], [r.flags for r in made])


def test_what_chips_cannot_say_travels_as_a_flag(planar: SkinDesign) -> None:
    good = ReducedTwin(planar).read()
    field = good.field.copy()
    field[1] = np.nan
    spoilt = Reading(time=0.0, field=field, temperature=good.temperature, flags=[1, 16, 0])
    board = VirtualBoard(Readings(planar, [spoilt]))
    with BoardAndReader(board, lambda port: SerialSource(port, design=planar)) as source:
        read = source.read(LONG)
    assert_array_equal(read.flags, [ChipFlag.MISSING, ChipFlag.OLD, 0])
    assert np.isnan(read.field[:2]).all()


def test_a_virtual_board_answers_commands(planar: SkinDesign) -> None:
    board = VirtualBoard(TwinSource(ReducedTwin(planar), rate=50.0))
    with BoardAndReader(board, lambda port: SerialSource(port, design=planar, rate=50.0)) as source:
        for _ in range(5):
            source.read(LONG)
        decoder = source.reader.decoder
        assert decoder.identity["board"] == "smoskin"
        assert decoder.identity["chips"] == "0c 0d 0e"
        assert decoder.refusals == []
    with pytest.raises(ArgumentError, match="source must know the design of its skin"):
        VirtualBoard(SourceWithout())


class SourceWithout(Readings):
    """Readings of no known skin."""

    def __init__(self) -> None:
        super().__init__(None, [])


@pytest.mark.parametrize("format", ["anyskin", "eflesh"])
def test_a_virtual_board_speaks_the_formats_of_others(planar: SkinDesign, format: str) -> None:
    twin = ReducedTwin(planar, seed=3)
    made = [twin.read(time=0.01 * k) for k in range(20)]
    board = VirtualBoard(Readings(planar, made), format=format)
    with BoardAndReader(
        board, lambda port: SerialSource(port, format=format, design=planar)
    ) as source:
        read = [source.read(LONG) for _ in range(20)]
    assert_allclose([r.field for r in read], [r.field for r in made], rtol=2e-7, atol=1e-12)


def test_formats_are_recognised_by_a_few_frames(planar: SkinDesign) -> None:
    assert recognised(b"".join(frames(planar, 5))) == ("smoskin",)
    assert recognised(b"") == ()
    assert recognised(np.random.default_rng(0).bytes(4096)) == ()


@pytest.mark.parametrize("package", ["reskin_sensor", "anyskin"])
def test_programs_of_others_read_a_virtual_board(planar: SkinDesign, package: str) -> None:
    """The unmodified readers of PyPI, on a virtual board in their format."""
    others = pytest.importorskip(f"{package}.sensor")
    base = others.ReSkinBase if package == "reskin_sensor" else others.AnySkinBase
    twin = ReducedTwin(planar, seed=3)
    rest = twin.read()
    board = VirtualBoard(TwinSource(twin, rate=100.0), format="anyskin")
    sending = threading.Thread(target=lambda: [None for _ in iter(board.step, False)], daemon=True)
    sending.start()
    reader = base(num_mags=3, port=board.port, temp_filtered=True)
    try:
        samples = reader.get_data(num_samples=20)
        fields = [s.data if package == "reskin_sensor" else s[1:] for s in samples]
        read = np.array(fields).reshape(-1, 3, 3)
    finally:
        reader.close()
        board.close()
        sending.join(5.0)
    assert_allclose(read.mean(axis=0), rest.field * 1e6, atol=30.0)
