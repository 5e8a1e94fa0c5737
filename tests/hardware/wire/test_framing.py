"""Frames in streams of bytes: stuffing, checks, and getting back into step."""

import random
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from smoskin.errors import ArgumentError
from smoskin.hardware.wire.framing import (
    LONGEST,
    Frame,
    Framer,
    decoded,
    encoded,
    stuffed,
    unstuffed,
)

FRAMES = st.builds(
    Frame,
    kind=st.integers(0, 255),
    sequence=st.integers(0, 65535),
    body=st.binary(max_size=480),
)


@pytest.mark.parametrize(
    ("plain", "wire"),
    [
        # The examples of the paper by Cheshire and Baker, as they are usually given.
        ("00", "01 01"),
        ("00 00", "01 01 01"),
        ("00 11 00", "01 02 11 01"),
        ("11 22 00 33", "03 11 22 02 33"),
        ("11 22 33 44", "05 11 22 33 44"),
        ("11 00 00 00", "02 11 01 01 01"),
    ],
)
def test_stuffing_is_the_published_one(plain: str, wire: str) -> None:
    assert stuffed(bytes.fromhex(plain)) == bytes.fromhex(wire)
    assert unstuffed(bytes.fromhex(wire)) == bytes.fromhex(plain)


@given(st.one_of(st.binary(max_size=700), st.integers(250, 515).map(lambda n: b"\x01" * n)))
def test_stuffed_data_has_no_zero_and_comes_back(data: bytes) -> None:
    wire = stuffed(data)
    assert 0 not in wire
    assert len(wire) <= len(data) + len(data) // 254 + 1
    assert unstuffed(wire) == data


def test_runs_of_254_may_end_without_an_empty_block() -> None:
    """Other encoders leave the last block out where nothing follows a full one."""
    data = bytes(range(1, 255))
    assert unstuffed(b"\xff" + data) == data
    assert unstuffed(b"\xff" + data + b"\x01") == data


@pytest.mark.parametrize("wire", ["", "00", "05 11", "03 11 00", "02 11 00"])
def test_what_is_not_stuffed_is_refused(wire: str) -> None:
    assert unstuffed(bytes.fromhex(wire)) is None


@given(FRAMES)
def test_a_frame_survives(frame: Frame) -> None:
    wire = encoded(frame)
    assert wire.endswith(b"\0")
    assert wire.count(b"\0") == 1
    assert decoded(wire[:-1]) == frame


@given(FRAMES, st.data())
def test_a_changed_bit_or_a_lost_end_is_noticed(frame: Frame, data: st.DataObject) -> None:
    wire = bytearray(encoded(frame)[:-1])
    place, bit = data.draw(st.integers(0, len(wire) - 1)), data.draw(st.integers(0, 7))
    wire[place] ^= 1 << bit
    assert decoded(bytes(wire)) != frame
    assert decoded(encoded(frame)[:place]) is None


@given(st.lists(FRAMES, max_size=6), st.integers(1, 40))
def test_pieces_of_any_size_give_the_same_frames(frames: list[Frame], size: int) -> None:
    stream = b"".join(map(encoded, frames))
    framer = Framer()
    received = []
    for start in range(0, len(stream), size):
        received += framer.feed(stream[start : start + size])
    assert received == frames
    assert framer.corrupt == 0


@given(st.lists(FRAMES, min_size=3, max_size=6), st.binary(max_size=2000), st.data())
def test_noise_costs_no_frame_but_the_one_it_runs_into(
    frames: list[Frame], noise: bytes, data: st.DataObject
) -> None:
    stream = [encoded(frame) for frame in frames]
    place = data.draw(st.integers(0, len(frames)))
    stream.insert(place, noise)
    framer = Framer()
    received = framer.feed(b"".join(stream))
    assert received[:place] == frames[:place]
    behind = frames[place + 1 :]
    assert received[len(received) - len(behind) :] == behind


def test_a_stream_cut_at_any_byte_is_in_step_at_the_next_zero() -> None:
    frames = [Frame(kind=1, sequence=k, body=bytes([k, 0, 255 - k] * 9)) for k in range(4)]
    stream = b"".join(map(encoded, frames))
    for cut in range(len(stream)):
        framer = Framer()
        received = framer.feed(stream[cut:])
        whole = [k for k in range(4) if len(b"".join(map(encoded, frames[:k]))) >= cut]
        assert [frame.sequence for frame in received] == whole
        assert framer.corrupt <= 1


def test_noise_without_an_end_is_not_kept() -> None:
    framer = Framer()
    for _ in range(1000):
        assert framer.feed(b"\x01" * 1000) == []
    assert framer.corrupt == 1
    assert len(framer._rest) <= LONGEST
    frame = Frame(kind=1, sequence=0, body=b"x")
    assert framer.feed(b"\0" + encoded(frame)) == [frame]


def test_a_frame_of_another_version_is_left_out() -> None:
    plain = bytes([2, 1, 0, 0]) + b"body"
    assert decoded(stuffed(plain + crc32(plain).to_bytes(4, "little"))) is None


def test_wrong_use_is_named() -> None:
    with pytest.raises(ArgumentError, match=r"kind must lie in 0\.\.255"):
        encoded(Frame(kind=256, sequence=0, body=b""))
    with pytest.raises(ArgumentError, match="frame must have at most 512 bytes"):
        encoded(Frame(kind=1, sequence=0, body=bytes(600)))


@pytest.mark.parametrize("count", [20_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_random_bodies_are_never_taken_for_frames(count: int) -> None:
    """Frames of the right length, well stuffed, of this version, and with random bytes in them."""
    rng = random.Random(1)
    for _ in range(count):
        plain = b"\x01\x01" + rng.randbytes(51)
        assert decoded(stuffed(plain)) is None
