"""The MCAP container, read from files that may be cut off or damaged.

Decides which chunks of a file can be trusted: each is found through the file's own index where
that is whole, else by walking from record to record, and counts only if its checksum holds.
Everything that a recording says stands inside chunks, so nothing unchecked gets through.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, BinaryIO, Final, NamedTuple

from smoskin.errors import MissingExtraError, RecordingError

if TYPE_CHECKING:
    from mcap.records import Chunk

_MAGIC: Final = b"\x89MCAP0\r\n"
_RECORD: Final = struct.Struct("<BQ")  # opcode, length of what follows
_FOOTER: Final = struct.Struct("<BQQQI")  # a whole record: starts of the summary, checksum
_MESSAGE: Final = struct.Struct("<HIQQ")  # channel, sequence, log and publish time
_CHUNK_HEAD: Final = 8 + 8 + 8 + 4 + 4 + 8
"""Bytes of a chunk beside its records and the name of their packing: times, sizes, checksum."""

_UNPACKING: Final = (struct.error, ValueError, RuntimeError, OverflowError, MemoryError)
"""Errors that damaged bytes raise in unpacking, beside the libraries' own."""
_SIZE_UNTOLD: Final = -1
"""Size that zstandard tells of a frame that does not hold it."""
_LARGEST: Final = 2**26
"""Bytes of the largest chunk or index that is read, packed or not; a recorder's are of 1 MB."""
_GROWTH: Final = 256
"""How many times its own size a chunk may unpack to; readings unpack to some ten times theirs."""
_ALLOWED: Final = 2**16
"""Bytes that any chunk may unpack to, however small it is."""


class Span(NamedTuple):
    """Place of a chunk in the file, bytes, its record's opcode and length included."""

    offset: int
    length: int


class UnbegunError(RecordingError):
    """A recording that was cut off before it held anything."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What stands where in a file."""

    spans: tuple[Span, ...]
    """The chunks, in the file's order, not yet checked."""
    topics: Mapping[int, str]
    """Topic of each channel, as far as the file's index tells."""
    counts: Mapping[int, int]
    """Messages of each channel, as far as the file's index tells."""
    truncated: bool
    """Whether the file ends before its end."""


def survey(file: BinaryIO) -> Layout:
    """The layout of a file.

    Raises an `UnbegunError` if it ends before its header, a `RecordingError` if it is no MCAP.
    """
    try:
        import mcap.records  # noqa: F401 - the first use of mcap in reading
    except ImportError as error:
        raise MissingExtraError("recording and replaying", "recording") from error
    file.seek(0)
    magic = file.read(len(_MAGIC))
    if not magic:
        raise UnbegunError("the file is empty")
    if not _MAGIC.startswith(magic):
        raise RecordingError(f"not an MCAP file: it begins with {magic!r}")
    if magic != _MAGIC:
        raise UnbegunError("the file ends before its header")
    return _indexed(file) or _walked(file)


def load(file: BinaryIO, span: Span) -> bytes | None:
    """The records in a chunk, unpacked; None if the chunk is damaged or out of proportion."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    from mcap.records import Chunk
    from zstandard import ZstdError

    if not _RECORD.size <= span.length <= _LARGEST:
        return None
    file.seek(span.offset)
    raw = file.read(span.length)
    if len(raw) != span.length:
        return None
    if _RECORD.unpack_from(raw) != (Opcode.CHUNK, span.length - _RECORD.size):
        return None
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(raw[_RECORD.size :])))
        # A head of zeros reads as a chunk without records, whose checksum holds.
        head = _RECORD.size + _CHUNK_HEAD + len(chunk.compression.encode())
        if head + len(chunk.data) != span.length:
            return None
        if chunk.uncompressed_size > min(_ALLOWED + _GROWTH * len(raw), _LARGEST):
            return None
        data = _unpacked(chunk)
    except (McapError, ZstdError, *_UNPACKING):
        return None
    return data if zlib.crc32(data) == chunk.uncompressed_crc else None


def _unpacked(chunk: "Chunk") -> bytes:
    """The records of a chunk, of which no more are unpacked than it says that it holds."""
    from lz4.frame import LZ4FrameDecompressor
    from zstandard import ZstdDecompressor, frame_content_size

    most = max(chunk.uncompressed_size, 1)  # no limit is written as none
    match chunk.compression:
        case "zstd":
            # The size that the frame tells comes before the limit.
            if frame_content_size(chunk.data) not in (chunk.uncompressed_size, _SIZE_UNTOLD):
                raise ValueError("two sizes of one chunk")
            return ZstdDecompressor().decompress(chunk.data, max_output_size=most)
        case "lz4":
            return bytes(LZ4FrameDecompressor().decompress(chunk.data, max_length=most))
        case "":
            return chunk.data
        case other:
            raise ValueError(f"packed by {other!r}")


def messages(data: bytes, topics: dict[int, str]) -> Iterator[tuple[str, bytes]]:
    """The messages in an unpacked chunk; adds the channels that it declares to `topics`."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    from mcap.records import Channel

    position = 0
    while position < len(data):
        if position + _RECORD.size > len(data):
            raise RecordingError("a chunk ends within a record")
        opcode, length = _RECORD.unpack_from(data, position)
        start = position + _RECORD.size
        position = start + length
        if position > len(data):
            raise RecordingError("a chunk ends within a record")
        if opcode == 0:
            raise RecordingError("a chunk holds something else than records")
        if opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
            topic = topics.get(_MESSAGE.unpack_from(data, start)[0])
            # Without a topic, its channel was declared in a chunk that is lost.
            if topic is not None:
                yield topic, data[start + _MESSAGE.size : position]
        elif opcode == Opcode.CHANNEL:
            try:
                declared = Channel.read(ReadDataStream(BytesIO(data[start:position])))
            except (McapError, *_UNPACKING) as error:
                raise RecordingError(f"a channel cannot be read: {error}") from error
            topics[declared.id] = declared.topic


def _indexed(file: BinaryIO) -> Layout | None:
    """The layout by the summary at the file's end; None unless its checksum holds."""
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    from mcap.records import Channel, ChunkIndex, Statistics
    from mcap.stream_reader import StreamReader

    tail = _FOOTER.size + len(_MAGIC)
    end = file.seek(0, 2) - tail
    if end < len(_MAGIC):
        return None
    file.seek(end)
    footer = file.read(tail)
    opcode, length, start, _, checksum = _FOOTER.unpack_from(footer)
    sound = (
        footer.endswith(_MAGIC)
        and opcode == Opcode.FOOTER
        and length == _FOOTER.size - _RECORD.size
        and max(len(_MAGIC), end - _LARGEST) <= start < end
    )
    if not sound:
        return None
    file.seek(start)
    summary = file.read(end - start)
    # The checksum runs on over the footer up to itself.
    if zlib.crc32(footer[: _FOOTER.size - 4], zlib.crc32(summary)) != checksum:
        return None
    try:
        records = list(StreamReader(BytesIO(summary + footer), skip_magic=True).records)
    except (McapError, *_UNPACKING):
        return None
    chunks = [record for record in records if isinstance(record, ChunkIndex)]
    if not chunks:
        return None
    statistics = (record for record in records if isinstance(record, Statistics))
    counts = next((record.channel_message_counts for record in statistics), {})
    return Layout(
        spans=tuple(Span(chunk.chunk_start_offset, chunk.chunk_length) for chunk in chunks),
        topics={record.id: record.topic for record in records if isinstance(record, Channel)},
        counts=counts,
        truncated=False,
    )


def _walked(file: BinaryIO) -> Layout:
    """The layout by going from record to record, as far as they make sense."""
    from mcap.opcode import Opcode

    size = file.seek(0, 2)
    position = len(_MAGIC)
    spans: list[Span] = []
    opcode = 0
    while position + _RECORD.size <= size:
        file.seek(position)
        opcode, length = _RECORD.unpack(file.read(_RECORD.size))
        if opcode == 0 or position + _RECORD.size + length > size:
            break
        if opcode == Opcode.CHUNK:
            spans.append(Span(position, _RECORD.size + length))
        position += _RECORD.size + length
        if opcode == Opcode.FOOTER:
            break
    file.seek(position)
    ended = opcode == Opcode.FOOTER and file.read(len(_MAGIC) + 1) == _MAGIC
    return Layout(spans=tuple(spans), topics={}, counts={}, truncated=not ended)
