"""Recordings read back: what is whole of them, what is missing, and of which skin they are.

Decides what of a cut or damaged file counts, and how its loss is told. Hides checksums and chunks.
"""

import math
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final, TypeVar

from smoskin.design.document import parse_design, shipped_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import RecordingError
from smoskin.outputs import path_text
from smoskin.records import Estimate, Reading
from smoskin.service import mcap
from smoskin.service.mcap import Span
from smoskin.service.ros import Codec, Description

T = TypeVar("T")

DESCRIPTION_TOPIC: Final = "/skin/description"
DESIGN_TOPIC: Final = "/skin/design"
READING_TOPIC: Final = "/skin/reading"
ESTIMATE_TOPIC: Final = "/skin/estimate"
GAUGE_TOPIC: Final = "/rig/gauge"
STAGE_TOPIC: Final = "/rig/stage"
PHASE_TOPIC: Final = "/rig/phase"
TOUCH_TOPIC: Final = "/rig/touch"
RIG_TOPIC: Final = "/rig/description"


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
    lost_readings: int
    """Readings that are missing for sure; a truncated file may lack up to a second more."""
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
    document: str
    """The design as a TOML document; empty in files from before it was kept."""

    @property
    def design(self) -> SkinDesign:
        """Design of the skin that was recorded; raises `DesignError` where it cannot be told."""
        if not self.document:
            return shipped_design(self.description.design_hash)
        design = parse_design(self.document)
        design.check_own(f"the design in {self.path}", self.description.design_hash)
        return design

    @property
    def damage(self) -> str:
        """Sentence that says what is missing; empty where nothing is."""
        lost, total = self.lost_readings, self.reading_count + self.lost_readings
        parts = [
            f"{lost} of {total} readings are lost" * bool(lost),
            f"{self.lost_chunks} of its chunks are damaged" * bool(self.lost_chunks),
            "it ends too early: cut off, killed or still being written" * self.truncated,
        ]
        return f"{self.path} is not whole: {'; '.join(filter(None, parts))}" * any(parts)

    def __iter__(self) -> Iterator[tuple[Reading, Estimate | None]]:
        """Readings with their estimates, unless the file has changed since it was opened."""
        waiting: tuple[int, Reading] | None = None
        for number, record in self._records(READING_TOPIC, ESTIMATE_TOPIC):
            if isinstance(record, Reading):
                if waiting is not None:
                    yield waiting[1], None
                waiting = number, record
            elif waiting is not None and number == waiting[0]:
                yield waiting[1], record
                waiting = None
        if waiting is not None:
            yield waiting[1], None

    def readings(self) -> Iterator[Reading]:
        """The readings alone."""
        for _, record in self._records(READING_TOPIC):
            if isinstance(record, Reading):
                yield record

    def estimates(self) -> Iterator[Estimate]:
        """The estimates alone."""
        for _, record in self._records(ESTIMATE_TOPIC):
            if isinstance(record, Estimate):
                yield record

    def _records(self, *wanted: str) -> Iterator[tuple[int, Reading | Estimate]]:
        """Records on these topics, with the numbers of their readings."""
        codec = Codec()
        decoders: dict[str, Callable[[bytes], tuple[int, Reading | Estimate]]] = {
            READING_TOPIC: codec.decode_reading,
            ESTIMATE_TOPIC: codec.decode_estimate,
        }
        yield from self.decoded({topic: decoders[topic] for topic in wanted})

    def decoded(self, decoders: Mapping[str, Callable[[bytes], T]]) -> Iterator[T]:
        """What the decoder of its topic makes of each message, in the file's order."""
        topics = dict(self.topics)
        with _opened(self.path) as file:
            for span in self.spans:
                data = mcap.load(file, span)
                if data is None:
                    raise RecordingError("the file has changed since it was opened")
                with _located(span):
                    for topic, payload in mcap.messages(data, topics):
                        if topic in decoders:
                            yield decoders[topic](payload)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """A regular file for reading, which every error names."""
    try:
        # A pipe without a writer would block.
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise RecordingError("must be a file; got a folder, a pipe or a device")
            yield file
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error
    except RecordingError as error:
        raise type(error)(f"{path}: {error}") from error


@contextmanager
def _located(span: Span) -> Iterator[None]:
    """Reading of a chunk, whose place every error names."""
    try:
        yield
    except RecordingError as error:
        raise RecordingError(f"in the chunk at byte {span.offset}: {error}") from error


def open_recording(path: str | os.PathLike[str]) -> Recording:
    """A recording that `Recorder` wrote, every chunk of it checked.

    A file that was cut off or damaged gives every reading whose chunk is whole; `truncated`
    and `lost_chunks` tell that something is missing.

    Raises
    ------
    RecordingError
        If there is no such file, it is not a recording, or it ends before its description (a
        `smoskin.service.mcap.UnbegunError`).
    MissingExtraError
        If mcap or rosbags is not installed.
    """
    given = Path(path_text(path))
    with _opened(given) as file:
        return _surveyed(given, file)


def _surveyed(path: Path, file: BinaryIO) -> Recording:
    """The recording in a file, gone through once."""
    layout, codec = mcap.survey(file), Codec()
    topics = dict(layout.topics)
    sound: list[Span] = []
    earliest, latest = math.inf, -math.inf
    description: Description | None = None
    document = ""
    readings = estimates = lost = expected = last = 0
    gap_known = False
    for span in layout.spans:
        data = mcap.load(file, span)
        if data is None:
            lost += 1
            gap_known = True
            continue
        sound.append(span)
        with _located(span):
            for topic, payload in mcap.messages(data, topics):
                if topic == READING_TOPIC:
                    sequence, moment = codec.sequence_and_time(payload)
                    # Readings can be missing without a damaged chunk in sight where its very
                    # opcode is damaged and the file has no index.
                    lost += sequence != expected and not gap_known
                    expected, gap_known = sequence + 1, False
                    readings, last = readings + 1, max(last, expected)
                    earliest, latest = min(earliest, moment), max(latest, moment)
                elif topic == ESTIMATE_TOPIC:
                    estimates += 1
                elif topic == DESCRIPTION_TOPIC:
                    description = codec.decode_description(payload)
                elif topic == DESIGN_TOPIC:
                    document = codec.decode_document(payload)
    if description is None:
        if layout.truncated and not layout.spans:
            raise mcap.UnbegunError("the file ends before its description")
        raise RecordingError(_nameless(lost, topics))
    counts = (n for channel, n in layout.counts.items() if topics.get(channel) == READING_TOPIC)
    return Recording(
        path=path,
        description=description,
        reading_count=readings,
        estimate_count=estimates,
        lost_readings=max(last, sum(counts)) - readings,
        duration=max(latest - earliest, 0.0),
        lost_chunks=lost,
        truncated=layout.truncated,
        spans=tuple(sound),
        topics=MappingProxyType(topics),
        document=document,
    )


def _nameless(lost: int, topics: Mapping[int, str]) -> str:
    """The reason why a file holds no description."""
    if lost:
        return "the recording's description is damaged"
    seen = ", ".join(sorted(set(topics.values()))) or "none"
    return f"not a recording of a skin: no message on {DESCRIPTION_TOPIC}; its topics: {seen}"
