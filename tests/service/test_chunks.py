"""Chunks of a recording: packed in every way, damaged, out of proportion, and of two sizes."""

import io
import struct
import zlib

import numpy as np
import pytest

pytest.importorskip("mcap")
import lz4.frame
import zstandard

from smoskin.service import mcap
from smoskin.service.mcap import Span, load

RNG = np.random.default_rng(0)
DATA = RNG.integers(0, 4, 5000, dtype=np.uint8).tobytes()
PACKED = {
    "": DATA,
    "zstd": zstandard.compress(DATA),
    "lz4": lz4.frame.compress(DATA),
    "lz4 untold": lz4.frame.compress(DATA, store_size=False),
    "zstd untold": zstandard.ZstdCompressor(write_content_size=False).compress(DATA),
}
SIZE, CRC, BEFORE = len(DATA), zlib.crc32(DATA), 11


def chunk(packed, name, size=SIZE, crc=CRC, opcode=6, more=0):
    """A file that holds a chunk after eleven bytes, and the chunk's place in it."""
    name = name.split()[0] if name else ""
    head = struct.pack("<QQQI", 0, 0, size, crc) + struct.pack("<I", len(name)) + name.encode()
    body = head + struct.pack("<Q", len(packed)) + packed
    record = struct.pack("<BQ", opcode, len(body) + more) + body
    return io.BytesIO(bytes(BEFORE) + record + b"more"), Span(BEFORE, len(record))


@pytest.mark.parametrize("name", PACKED)
def test_records_come_out_as_they_were_packed(name):
    assert load(*chunk(PACKED[name], name)) == DATA


@pytest.mark.parametrize("name", PACKED)
@pytest.mark.parametrize("size", [0, 1, len(DATA) - 1, len(DATA) + 1])
def test_no_more_is_unpacked_than_a_chunk_says_that_it_holds(name, size, monkeypatch):
    unpacked = []
    plain = mcap._unpacked

    def noted(chunk):
        unpacked.append(plain(chunk))
        return unpacked[-1]

    monkeypatch.setattr(mcap, "_unpacked", noted)
    loaded = load(*chunk(PACKED[name], name, size=size))
    if name and size < len(DATA):
        assert loaded is None
        assert all(len(data) <= max(size, 1) for data in unpacked)


@pytest.mark.parametrize("name", PACKED)
def test_a_chunk_with_another_checksum_is_damaged(name):
    assert load(*chunk(PACKED[name], name, crc=CRC ^ 1)) is None


@pytest.mark.parametrize("change", [{"opcode": 5}, {"opcode": 7}, {"more": 1}, {"more": -1}])
def test_a_record_that_is_no_chunk_of_its_length_is_damaged(change):
    assert load(*chunk(DATA, "", **change)) is None


def test_a_chunk_that_the_file_cuts_or_nobody_knows_to_unpack_is_damaged():
    file, span = chunk(DATA, "")
    assert load(file, span._replace(length=span.length + 5)) is None
    assert load(file, Span(BEFORE, 8)) is None  # not even a record
    assert load(file, Span(BEFORE + 10**6, span.length)) is None
    assert load(*chunk(DATA, "zip")) is None
    assert load(*chunk(DATA, "zstd")) is None
    assert load(*chunk(DATA, "lz4")) is None


@pytest.mark.parametrize("length", [400, 5000, 300_000])
def test_a_chunk_unpacks_to_64_kib_and_256_times_its_size_and_64_mib_at_most(length, monkeypatch):
    asked = []
    monkeypatch.setattr(mcap, "_unpacked", lambda chunk: asked.append(chunk) or b"")
    _, span = chunk(bytes(length), "")
    most = min(2**16 + 256 * span.length, 2**26)
    for size, tried in ((most, 1), (most + 1, 0)):
        asked.clear()
        load(*chunk(bytes(length), "", size=size))
        assert len(asked) == tried


def test_a_chunk_of_more_than_64_mib_is_not_even_read():
    class Long(io.BytesIO):
        def read(self, size=-1):
            asked.append(size)
            return b""

    asked = []
    for length, read in ((2**26, [2**26]), (2**26 + 1, [])):
        asked.clear()
        assert load(Long(), Span(0, length)) is None
        assert asked == read
