"""Recordings: every reading and estimate, to the last bit, in a file that robotics tools open.

Decides the layout of a recording (MCAP, ROS 2 messages, one chunk a second) and what survives
a kill, a cut or a damaged byte. Hides topics, time stamps, chunks and checksums.
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, Final, final

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError, RecordingError
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Sink
from smoskin.service import mcap, ros
from smoskin.service.mcap import Span
from smoskin.service.ros import Codec, Description

DESCRIPTION_TOPIC: Final = "/skin/description"
READING_TOPIC: Final = "/skin/reading"
ESTIMATE_TOPIC: Final = "/skin/estimate"
WRENCH_TOPIC: Final = "/skin/wrench"

_CHUNK_BYTES: Final = 1_000_000
"""Size at which a chunk is written at the latest, bytes."""
_LAST_STAMP: Final = 2**31 * 1_000_000_000 - 1
"""Latest wall clock time that both MCAP and ROS 2 can hold, ns."""
_WRENCH_KNOWN: Final = (Status.CONTACT, Status.NO_CONTACT, Status.AMBIGUOUS)
"""Statuses of estimates that tell the wrench on the skin."""


@final
class Recorder(Sink):
    """Writes readings and estimates to an MCAP file; a sink of the loop.

    Beside our own messages, which hold every bit, it writes what viewers draw without knowing
    skins: ``/skin/chip0/field`` (`sensor_msgs/MagneticField`), ``/skin/contact0``
    (`geometry_msgs/PointStamped`) and so on, and ``/skin/wrench``
    (`geometry_msgs/WrenchStamped`), the sum over all contacts about the skin's origin.

    Parameters
    ----------
    path : str or path-like
        A new file; an existing one is never overwritten.
    design : SkinDesign
        What is recorded; its name, hash and chip setting go into the file.
    flush_interval : float
        s of readings that a kill of the process can lose at most; a power cut can lose more.
    clock : callable
        A monotonic clock in s, for the flushing.
    wall_clock : callable
        ns since 1970-01-01 UTC at the first reading; stamps go on with the readings' own clock.

    Raises
    ------
    ArgumentError
        If the flush interval is negative or not finite.
    RecordingError
        If the file exists or cannot be made.
    MissingExtraError
        If mcap or rosbags is not installed.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        design: SkinDesign,
        *,
        flush_interval: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
        wall_clock: Callable[[], int] = time.time_ns,
    ) -> None:
        if not 0.0 <= flush_interval < float("inf"):
            raise ArgumentError(f"flush_interval must be finite and >= 0; got {flush_interval}")
        try:
            from mcap.writer import CompressionType, Writer
        except ImportError as error:
            raise MissingExtraError("recording and replaying", "recording") from error
        self._codec = Codec()
        self._clock = clock
        self._wall_clock = wall_clock
        self._flush_interval = flush_interval
        opened = wall_clock()
        self._description = Description(
            design=design.name,
            design_hash=design.content_hash,
            chips=len(design.halls),
            setting=design.hall_setting,
            version=version("smoskin"),
            start=opened * 1e-9,
        )
        self._file = _new_file(path)
        self._closed = False
        self._sequence = self._bytes = 0
        self._flushed = clock()
        self._last_stamp = opened
        self._first: tuple[int, float] | None = None
        # Chunks end where this class says, between readings, never by the writer's own count.
        self._writer: Any = Writer(  # partly untyped
            self._file, chunk_size=2**62, compression=CompressionType.ZSTD
        )
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        try:
            self._begin()
        except OSError:
            self._file.close()
            raise

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Append a reading and what was made of it.

        Raises `ArgumentError` if it has another number of chips than the design, `RecordingError`
        if the recorder is closed.
        """
        if self._closed:
            raise RecordingError("the recorder is closed")
        chips = self._description.chips
        if len(reading.field) != chips:
            raise ArgumentError(
                f"reading must have the design's {chips} chips; got {len(reading.field)}"
            )
        codec, sequence = self._codec, self._sequence
        stamp = self._last_stamp = self._stamp(reading.time)
        self._add(READING_TOPIC, codec.encode_reading(reading, sequence, stamp))
        if estimate is not None:
            # Directly behind its reading: the pair must not be parted by a chunk's end.
            self._add(ESTIMATE_TOPIC, codec.encode_estimate(estimate, sequence, stamp))
        for chip in range(chips):
            self._add(f"/skin/chip{chip}/field", codec.encode_field(reading, chip, stamp))
        if estimate is not None:
            self._add_contacts(estimate, stamp)
        self._sequence += 1
        waited = self._clock() - self._flushed
        if waited >= self._flush_interval or self._bytes >= _CHUNK_BYTES:
            self._flush()

    def close(self) -> None:
        """Write what is left and the file's index; may be called any number of times."""
        if self._closed:
            return
        self._closed = True
        try:
            # Once more, so that damage to the first chunk does not make the file nameless.
            self._describe()
            self._writer.finish()
        finally:
            self._file.close()

    def _begin(self) -> None:
        """Write header, schemas, channels and description before the first reading."""
        self._writer.start(profile="ros2", library=f"smoskin {self._description.version}")
        self._declare(DESCRIPTION_TOPIC, ros.DESCRIPTION)
        self._declare(READING_TOPIC, ros.READING)
        self._declare(ESTIMATE_TOPIC, ros.ESTIMATE)
        self._declare(WRENCH_TOPIC, ros.WRENCH)
        for chip in range(self._description.chips):
            self._declare(f"/skin/chip{chip}/field", ros.FIELD)
        self._describe()

    def _add_contacts(self, estimate: Estimate, stamp: int) -> None:
        """Add places and wrench of an estimate's contacts."""
        for index, contact in enumerate(estimate.contacts):
            topic = f"/skin/contact{index}"
            if topic not in self._channels:
                self._declare(topic, ros.POSITION)
            self._add(topic, self._codec.encode_position(contact, stamp))
        if estimate.status in _WRENCH_KNOWN:
            self._add(WRENCH_TOPIC, self._codec.encode_wrench(estimate.contacts, stamp))

    def _describe(self) -> None:
        """Write the description in a chunk of its own, with the channels not yet written."""
        self._flush()
        self._add(DESCRIPTION_TOPIC, self._codec.encode_description(self._description))
        self._flush()

    def _declare(self, topic: str, schema: str) -> None:
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(
                schema, "ros2msg", self._codec.schema(schema)
            )
        self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[schema])

    def _add(self, topic: str, payload: bytes) -> None:
        """Add a message at the latest stamp."""
        stamp = self._last_stamp
        self._writer.add_message(
            self._channels[topic], log_time=stamp, data=payload, publish_time=stamp
        )
        self._bytes += len(payload)

    def _flush(self) -> None:
        """End the chunk."""
        self._writer.flush()
        self._bytes, self._flushed = 0, self._clock()

    def _stamp(self, moment: float) -> int:
        """Wall clock time of a moment on the readings' clock, ns, as far as it can be told."""
        if self._first is None:
            self._first = (self._wall_clock(), moment)
        wall, first = self._first
        elapsed = min(max(moment - first, -1e10), 1e10)
        return min(max(wall + round(elapsed * 1e9), 0), _LAST_STAMP)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recording on disk, which `open_recording` makes.

    Iterating reads it anew, chunk by chunk, and gives ``(reading, estimate)`` in the order of
    recording, the estimate None where none was recorded.
    """

    path: Path
    description: Description
    """What was recorded."""
    reading_count: int
    """Readings that can be read."""
    estimate_count: int
    """Estimates that can be read."""
    duration: float
    """s, from the earliest to the latest reading."""
    lost_chunks: int
    """Damaged chunks, each up to a second of readings, that are left out."""
    truncated: bool
    """Whether the file was cut off, or its recorder was killed or is still writing."""
    spans: tuple[Span, ...]
    """Places of the sound chunks in the file."""
    topics: Mapping[int, str]
    """Topic of each channel number of the file."""

    def __iter__(self) -> Iterator[tuple[Reading, Estimate | None]]:
        """Readings with their estimates, unless the file has changed since it was opened."""
        codec = Codec()
        waiting: tuple[int, Reading] | None = None
        for topic, payload in self._messages():
            if topic == READING_TOPIC:
                if waiting is not None:
                    yield waiting[1], None
                waiting = codec.decode_reading(payload)
            elif topic == ESTIMATE_TOPIC and waiting is not None:
                sequence, estimate = codec.decode_estimate(payload)
                if sequence == waiting[0]:
                    yield waiting[1], estimate
                    waiting = None
        if waiting is not None:
            yield waiting[1], None

    def readings(self) -> Iterator[Reading]:
        """The readings alone."""
        codec = Codec()
        for topic, payload in self._messages():
            if topic == READING_TOPIC:
                yield codec.decode_reading(payload)[1]

    def estimates(self) -> Iterator[Estimate]:
        """The estimates alone."""
        codec = Codec()
        for topic, payload in self._messages():
            if topic == ESTIMATE_TOPIC:
                yield codec.decode_estimate(payload)[1]

    def _messages(self) -> Iterator[tuple[str, bytes]]:
        topics = dict(self.topics)
        with _opened(self.path) as file:
            for span in self.spans:
                data = mcap.load(file, span)
                if data is None:
                    raise RecordingError("the file has changed since it was opened")
                yield from mcap.messages(data, topics)


def _new_file(path: str | os.PathLike[str]) -> BinaryIO:
    """A file that did not exist, opened for writing."""
    try:
        return open(path, "xb")
    except FileExistsError as error:
        raise RecordingError(
            f"{os.fspath(path)} exists; choose another name or remove it"
        ) from error
    except OSError as error:
        raise RecordingError(f"{os.fspath(path)} cannot be written: {error.strerror}") from error


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """A file for reading, which every error names."""
    try:
        with open(path, "rb") as file:
            yield file
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from error


def open_recording(path: str | os.PathLike[str]) -> Recording:
    """A recording that `Recorder` wrote, every chunk of it checked.

    A file that was cut off or damaged gives every reading whose chunk is whole; `truncated`
    and `lost_chunks` tell that something is missing.

    Raises
    ------
    RecordingError
        If there is no such file, it is not a recording, or it ends before its description.
    MissingExtraError
        If mcap or rosbags is not installed.
    """
    with _opened(Path(path)) as file:
        return _surveyed(Path(path), file)


def _surveyed(path: Path, file: BinaryIO) -> Recording:
    """The recording in a file, gone through once."""
    layout, codec = mcap.survey(file), Codec()
    topics = dict(layout.topics)
    sound: list[Span] = []
    times: list[float] = []
    description: Description | None = None
    estimates = lost = expected = 0
    gap_known = False
    for span in layout.spans:
        data = mcap.load(file, span)
        if data is None:
            lost += 1
            gap_known = True
            continue
        sound.append(span)
        for topic, payload in mcap.messages(data, topics):
            if topic == READING_TOPIC:
                sequence, moment = codec.sequence_and_time(payload)
                # Readings can be missing without a damaged chunk in sight where its very opcode
                # is damaged and the file has no index.
                lost += sequence != expected and not gap_known
                expected, gap_known = sequence + 1, False
                times.append(moment)
            elif topic == ESTIMATE_TOPIC:
                estimates += 1
            elif topic == DESCRIPTION_TOPIC and description is None:
                description = codec.decode_description(payload)
    if description is None:
        raise RecordingError(_nameless(layout, lost, topics))
    return Recording(
        path=path,
        description=description,
        reading_count=len(times),
        estimate_count=estimates,
        duration=max(times) - min(times) if times else 0.0,
        lost_chunks=lost,
        truncated=layout.truncated,
        spans=tuple(sound),
        topics=MappingProxyType(topics),
    )


def _nameless(layout: mcap.Layout, lost: int, topics: Mapping[int, str]) -> str:
    """The reason why a file holds no description."""
    if layout.truncated and not layout.spans:
        return "the file ends before its description"
    if lost:
        return "the recording's description is damaged"
    seen = ", ".join(sorted(set(topics.values()))) or "none"
    return f"not a recording of a skin: no message on {DESCRIPTION_TOPIC}; its topics: {seen}"
