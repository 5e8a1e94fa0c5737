"""Readings, identities and commands: the documented bytes, and what a stream may do to them."""

import random
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError
from smoskin.hardware.registers import Scan
from smoskin.hardware.wire.framing import Frame, decoded, encoded
from smoskin.hardware.wire.messages import (
    BoardDecoder,
    BoardScan,
    Kind,
    command,
    read_reading,
    read_set,
    reading_frame,
    set_command,
)
from smoskin.records import ChipFlag

PLANAR = HallSetting(gain_selection=3, resolution=2, oversampling=1, digital_filter=3)
DOCUMENT = Path(__file__).parents[3] / "docs" / "wire.md"


def board_scan(sequence: int = 7, time: float = 1.0) -> BoardScan:
    """The documented reading."""
    return BoardScan(
        sequence=sequence % 65536,
        scan=Scan(
            time=time,
            status=[0x23, 0x23, 0xFF],
            words=[[0xB4A4, 0x8190, 0x7CE0, 0x84B0], [0xB4D1, 0x8000, 0x8001, 0x7FFF], [0] * 4],
        ),
        addresses=(0x0C, 0x0D, 0x0E),
        setting=PLANAR,
    )


def stream(numbers, rate: float = 200.0) -> list[bytes]:
    return [reading_frame(board_scan(number, 5.0 + number / rate)) for number in numbers]


def test_the_documents_vectors_are_what_is_sent() -> None:
    blocks = re.findall(r"```text\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    documented = [bytes.fromhex(block) for block in blocks]
    refusal = Frame(kind=Kind.REFUSAL, sequence=9, body=b"rate must be at most 146 Hz")
    assert documented == [
        reading_frame(board_scan()),
        set_command(PLANAR, 200.0) + command(Kind.IDENTIFY) + command(Kind.RESET),
        encoded(refusal),
    ]


def test_a_reading_survives() -> None:
    sent = board_scan()
    read = read_reading(decoded(reading_frame(sent)[:-1]))
    assert (read.sequence, read.addresses, read.setting) == (7, (12, 13, 14), PLANAR)
    assert read.scan.time == sent.scan.time
    assert_array_equal(read.scan.words, sent.scan.words)
    assert_array_equal(read.scan.status, sent.scan.status)


def test_a_packet_says_what_the_chips_said() -> None:
    (packet,) = BoardDecoder().feed(reading_frame(board_scan()))
    assert packet.time == 1.0
    assert_array_equal(packet.flags, [0, 0, ChipFlag.MISSING])
    assert_allclose(packet.field[0] * 1e6, [400 * 1.5, -800 * 1.5, 1200 * 2.42])
    assert_allclose(packet.field[1] * 1e6, [0, 1.5, -2.42])
    assert np.isnan(packet.field[2]).all()
    assert_allclose(packet.temperature, [25.0, 26.0, np.nan], atol=0.01)


@given(st.floats(0.1, 2000.0))
def test_commands_survive(rate: float) -> None:
    frame = decoded(set_command(PLANAR, rate).strip(b"\0"))
    assert frame.kind == Kind.SET
    setting, given_rate = read_set(frame)
    assert setting == PLANAR
    assert given_rate == pytest.approx(rate, abs=1e-6 * rate * rate)


@pytest.mark.parametrize("rate", [0.0, -1.0, 0.09, 2100.0])
def test_a_rate_that_no_board_can_have_is_refused(rate: float) -> None:
    with pytest.raises(ArgumentError, match=r"rate must be from 0\.1 to 2000 Hz"):
        set_command(PLANAR, rate)


@pytest.mark.parametrize("body", [b"", bytes(10), b"\x88\x13\0\0\x3c\0\0\0\xcd\x05", bytes(11)])
def test_a_setting_that_would_read_falsely_is_refused(body: bytes) -> None:
    assert read_set(Frame(kind=Kind.SET, sequence=0, body=body)) is None


def test_gaps_are_lost_frames_and_copies_come_once() -> None:
    decoder = BoardDecoder()
    frames = stream(range(65530, 65560))
    kept = [k for k in range(30) if k not in (3, 10, 11, 12)]
    blocks = [frames[k] for k in kept]
    blocks[15:15] = blocks[10:15]  # a block that came twice
    sequences = [packet.sequence for packet in decoder.feed(b"".join(blocks))]
    assert sequences == [(65530 + k) % 65536 for k in kept]
    assert (decoder.lost, decoder.repeated, decoder.corrupt) == (4, 5, 0)


def test_a_board_that_starts_again_has_lost_nothing() -> None:
    decoder = BoardDecoder()
    decoder.feed(b"".join(stream(range(500, 700))))
    again = [reading_frame(board_scan(k, k / 200)) for k in range(5)]
    assert [packet.sequence for packet in decoder.feed(b"".join(again))] == [0, 1, 2, 3, 4]
    assert (decoder.lost, decoder.repeated, decoder.restarts) == (0, 0, 1)


def test_identity_and_refusals_are_kept() -> None:
    decoder = BoardDecoder()
    lines = b"board=smoskin\nserial=e660=5\nnonsense\nchips=0c 0d"
    decoder.feed(encoded(Frame(kind=Kind.IDENTITY, sequence=0, body=lines)))
    assert decoder.identity == {"board": "smoskin", "serial": "e660=5", "chips": "0c 0d"}
    for number in range(12):
        body = f"refusal {number} \xff".encode("latin-1")
        decoder.feed(encoded(Frame(kind=Kind.REFUSAL, sequence=0, body=body)))
    assert len(decoder.refusals) == 10
    assert decoder.refusals[-1] == "refusal 11 \ufffd"


@pytest.mark.parametrize(
    "change",
    [
        lambda body: body[:-1],
        lambda body: body + bytes(10),
        lambda body: body[:14] + b"\x00" + body[15:],
        lambda body: body[:8] + b"\x30" + body[9:],
        lambda body: b"",
    ],
)
def test_whole_frames_that_say_nothing_known_are_counted(change) -> None:
    decoder = BoardDecoder()
    body = decoded(reading_frame(board_scan())[:-1]).body
    assert decoder.feed(encoded(Frame(kind=1, sequence=0, body=change(body)))) == []
    assert decoder.feed(encoded(Frame(kind=99, sequence=0, body=body))) == []
    assert decoder.corrupt == 2


def test_every_truncation_is_in_step_within_two_frames() -> None:
    frames = stream(range(6))
    whole = b"".join(frames)
    for cut in range(len(frames[0]) * 2):
        decoder = BoardDecoder()
        sequences = [packet.sequence for packet in decoder.feed(whole[cut:])]
        assert sequences[-4:] == [2, 3, 4, 5]


@pytest.mark.parametrize("count", [1_000, pytest.param(75_000, marks=pytest.mark.slow)])
def test_a_bad_line_gives_only_what_was_sent(count: int) -> None:
    """Changed bits, lost and doubled blocks: some 10 million bytes in the slow tier."""
    rng = random.Random(3)
    decoder, times, fields = BoardDecoder(), [], []
    whole = 0
    for number in range(count):
        data = bytearray(reading_frame(board_scan(number, 5.0 + number / 200)))
        fault = rng.randrange(10)
        whole += fault > 2
        if fault == 0:
            for _ in range(1 + rng.randrange(4)):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif fault == 1:
            start = rng.randrange(len(data))
            del data[start : start + rng.randrange(1, 40)]
        elif fault == 2:
            data += rng.randbytes(rng.randrange(700))
        elif fault == 3:
            data *= 2
        for packet in decoder.feed(bytes(data)):
            times.append(packet.time)
            fields.append(packet.field[0])
    assert_array_equal(np.rint(np.array(fields) * 1e6), [[600, -1200, 2904]] * len(fields))
    assert (np.diff(times) > 0).all()
    # A frame behind a spoilt one may go with it.
    assert len(times) >= 0.7 * whole
    assert decoder.lost == round((times[-1] - times[0]) * 200) + 1 - len(times)
