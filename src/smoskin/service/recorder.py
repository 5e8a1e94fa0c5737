"""The recorder: every reading and estimate, to the last bit, in a file that robotics tools open.

Decides the layout of a recording (MCAP, ROS 2 messages, one chunk a second) and what survives
a kill or a full disk. Hides topics, time stamps and chunks.
"""

import errno
import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.metadata import version
from io import BufferedWriter
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.document import format_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, RecordingError, require
from smoskin.records import Estimate, HeldTouch, Reading
from smoskin.roles import Sink
from smoskin.service import ros
from smoskin.service.recording import (
    DESCRIPTION_TOPIC,
    DESIGN_TOPIC,
    ESTIMATE_TOPIC,
    GAUGE_TOPIC,
    PHASE_TOPIC,
    READING_TOPIC,
    RIG_TOPIC,
    STAGE_TOPIC,
    TOUCH_TOPIC,
    Recording,
)
from smoskin.service.ros import Codec, Description

WRENCH_TOPIC: Final = "/skin/wrench"
JOINTS_TOPIC: Final = "/arm/joints"
ARM_TOPIC: Final = "/arm/state"

_CHUNK_BYTES: Final = 1_000_000
"""Size at which a chunk is written at the latest, bytes."""
_LAST_STAMP: Final = 2**31 * 1_000_000_000 - 1
"""Latest wall clock time that both MCAP and ROS 2 can hold, ns."""
_RIG_SCHEMAS: Final = {
    GAUGE_TOPIC: ros.WRENCH,
    STAGE_TOPIC: ros.POSITION,
    PHASE_TOPIC: ros.PHASE,
    TOUCH_TOPIC: ros.TOUCH,
}
"""Message types of what a rig says."""
_OTHER_SCHEMAS: Final = _RIG_SCHEMAS | {JOINTS_TOPIC: ros.JOINTS, ARM_TOPIC: ros.DOCUMENT}
"""The same with what an arm says."""


@final
class Recorder(Sink):
    """Writes readings and estimates to an MCAP file; a sink of the loop.

    Beside our own messages, which hold every bit, it writes what viewers draw without knowing
    skins: ``/skin/chip0/field`` (`sensor_msgs/MagneticField`), ``/skin/contact0``
    (`geometry_msgs/PointStamped`) and so on, and ``/skin/wrench``
    (`geometry_msgs/WrenchStamped`), the sum over all contacts about the skin's origin. The design's
    document stands in ``/skin/design``.

    A disk that is full, or a file that somebody removes, ends the recording but not the loop:
    `failure` says why, `dropped` counts, and what is in the file up to there stays readable.

    Parameters
    ----------
    path : str or path-like
        A new file; an existing one is never overwritten.
    design : SkinDesign
        What is recorded; all of it goes into the file.
    flush_interval : float
        s of readings that a kill of the process can lose at most, in the beginning no more than
        half of what there is; a power cut can lose more.
    attachments : mapping of str to bytes
        Files by their names that go into the recording as they are, such as a calibration.
    rig : str
        What is known of the rig that touches the skin, kept in ``/rig/description``.
    on_failure : callable
        Called once with a sentence when the file cannot be written any more.
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

    @typed
    def __init__(
        self,
        path: str | os.PathLike[str],
        design: SkinDesign,
        *,
        flush_interval: float = 1.0,
        attachments: Mapping[str, bytes] | None = None,
        rig: str = "",
        on_failure: Callable[[str], object] = warnings.warn,
        clock: Callable[[], float] = time.monotonic,
        wall_clock: Callable[[], int] = time.time_ns,
    ) -> None:
        if not 0.0 <= flush_interval < float("inf"):
            raise ArgumentError(f"flush_interval must be finite and >= 0; got {flush_interval}")
        require("recording and replaying", "recording", "mcap")
        from mcap.writer import CompressionType, Writer

        self._codec = Codec()
        self._clock, self._wall_clock = clock, wall_clock
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
        self._documents = {DESIGN_TOPIC: format_design(design)} | ({RIG_TOPIC: rig} if rig else {})
        self._on_failure = on_failure
        self.failure = ""
        """Reason why the file cannot be written any more; empty while it can."""
        self._path, self._file = Path(path).absolute(), _new_file(path)
        self._closed = False
        self._sequence = self._kept = self._whole = self._bytes = 0
        self._flushed, self._last_stamp = clock(), opened
        self._first: tuple[int, float] | None = None
        self._begun: float | None = None
        # Chunks end where this class says, between readings, never by the writer's own count.
        self._writer: Any = Writer(  # partly untyped
            self._file, chunk_size=2**62, compression=CompressionType.ZSTD
        )
        self._schemas, self._channels = dict[str, int](), dict[str, int]()
        try:
            self._begin(attachments or {})
        except OSError as error:
            self._file.raw.close()
            self._path.unlink(missing_ok=True)
            raise RecordingError(f"{path} cannot be written: {error.strerror}") from error

    @property
    def dropped(self) -> int:
        """How many readings are not in the file because it could not be written."""
        return self._sequence - self._kept if self.failure else 0

    @property
    def kept(self) -> int:
        """Readings in the chunks that have been written: a kill cannot lose them."""
        return self._kept

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        """Append a reading and what was made of it, as long as the file can be written.

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
        self._sequence += 1
        if not self.failure:
            with self._tried():
                self._append(reading, estimate)

    def write_touch(self, number: int, touch: HeldTouch) -> None:
        """Append a touch of a rig with its readings and trace, and end the chunk behind it.

        What gauge and stage said stands in ``/rig/gauge`` (`geometry_msgs/WrenchStamped`) and
        ``/rig/stage`` (`geometry_msgs/PointStamped`), at stamps of the readings' clock. It raises
        as `write`.
        """
        for reading in touch.readings:
            self.write(reading)
        if self.failure:
            return
        with self._tried():
            codec, trace = self._codec, touch.trace
            if trace is not None:
                for moment, *force in trace.gauge:
                    stamp = self._stamp(moment)
                    self._add(GAUGE_TOPIC, codec.encode_force(np.array(force), stamp), stamp)
                for moment, *place in trace.stage:
                    stamp = self._stamp(moment)
                    self._add(STAGE_TOPIC, codec.encode_place(np.array(place), stamp), stamp)
                for phase in trace.phases:
                    stamp = self._stamp(phase[1])
                    self._add(PHASE_TOPIC, codec.encode_phase(number, phase, stamp), stamp)
            stamp = self._stamp(touch.held[1])
            self._add(TOUCH_TOPIC, codec.encode_touch(number, touch, stamp), stamp)
            self._flush()
            self._flushed = self._clock()

    def write_arm(self, moment: float, angles: Floats, speeds: Floats, state: str) -> None:
        """Append how an arm stands that carries the skin, on the readings' clock.

        Joints, (J,), rad and rad/s, stand in ``/arm/joints`` (`sensor_msgs/JointState`), what the
        arm is allowed and why in ``/arm/state`` (`std_msgs/String`). It raises as `write`.
        """
        if self._closed:
            raise RecordingError("the recorder is closed")
        if not self.failure:
            with self._tried():
                stamp = self._stamp(moment)
                self._add(JOINTS_TOPIC, self._codec.encode_joints(angles, speeds, stamp), stamp)
                self._add(ARM_TOPIC, self._codec.encode_document(state), stamp)

    def take_over(self, recording: Recording) -> None:
        """Append what can be read of an earlier part of this recording, as it stands there.

        The clock of its readings goes on. It is for a recorder that has written nothing, and
        raises a `RecordingError` if the part cannot be read or the file not be written.
        """
        topics = {READING_TOPIC, *_RIG_SCHEMAS, *(t for t in self._channels if "/chip" in t)}
        decoders = {topic: lambda payload, topic=topic: (topic, payload) for topic in topics}
        for topic, payload in recording.decoded(decoders):
            stamp = self._codec.stamp(payload)
            if topic == READING_TOPIC:
                sequence, moment = self._codec.sequence_and_time(payload)
                self._sequence = sequence + 1
                self._first = self._first or (stamp, moment)
            if not self.failure:
                with self._tried():
                    self._add(topic, payload, stamp)
                    if self._bytes >= _CHUNK_BYTES:
                        self._flush()
        if not self.failure:
            with self._tried():
                self._flush()
                os.fsync(self._file.fileno())
        if self.failure:
            raise RecordingError(self.failure)

    def close(self) -> None:
        """Write what is left and the file's index; may be called any number of times."""
        if self._closed:
            return
        self._closed = True
        if not self.failure:
            with self._tried():
                # Once more, so that damage to the first chunk does not make the file nameless.
                self._describe()
                self._writer.finish()
                self._file.flush()
                self._file.close()

    def _append(self, reading: Reading, estimate: Estimate | None) -> None:
        """Add a reading's messages, and end the chunk if it is time."""
        codec, sequence = self._codec, self._sequence - 1
        stamp = self._last_stamp = self._stamp(reading.time)
        self._add(READING_TOPIC, codec.encode_reading(reading, sequence, stamp))
        if estimate is not None:
            # Directly behind its reading: the pair must not be parted by a chunk's end.
            self._add(ESTIMATE_TOPIC, codec.encode_estimate(estimate, sequence, stamp))
        for chip in range(len(reading.field)):
            self._add(f"/skin/chip{chip}/field", codec.encode_field(reading, chip, stamp))
        if estimate is not None:
            self._add_contacts(estimate, stamp)
        now = self._clock()
        self._begun = now if self._begun is None else self._begun
        # The first chunks are short: a kill loses no more than half of what there is.
        patience = min(self._flush_interval, self._flushed - self._begun)
        if now - self._flushed >= patience or self._bytes >= _CHUNK_BYTES:
            self._flush()
            self._flushed = now

    @contextmanager
    def _tried(self) -> Iterator[None]:
        """Writing that leaves a file of whole chunks, whatever ends it."""
        try:
            yield
        except OSError as error:
            self._give_up(error.strerror or str(error))
        except KeyboardInterrupt:
            self._give_up("a reading was interrupted")
            raise

    def _give_up(self, reason: str) -> None:
        """Leave the file as it was after its last chunk, and say so."""
        self.failure = f"{self._path} cannot be written: {reason}; nothing more is recorded"
        with suppress(OSError, ValueError):
            os.ftruncate(self._file.fileno(), self._whole)
        self._file.raw.close()  # what was not written must not be
        self._on_failure(self.failure)

    def _begin(self, attachments: Mapping[str, bytes]) -> None:
        """Write header, attachments, schemas, channels and description before any reading."""
        self._writer.start(profile="ros2", library=f"smoskin {self._description.version}")
        for name, content in attachments.items():
            self._writer.add_attachment(
                self._last_stamp, self._last_stamp, name, "application/octet-stream", content
            )
        self._declare(DESCRIPTION_TOPIC, ros.DESCRIPTION)
        for topic in self._documents:
            self._declare(topic, ros.DOCUMENT)
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
        if estimate.status in ros.WRENCH_KNOWN:
            self._add(WRENCH_TOPIC, self._codec.encode_wrench(estimate.contacts, stamp))

    def _describe(self) -> None:
        """Write description and design in a chunk of their own, with the channels till then."""
        self._flush()
        self._add(DESCRIPTION_TOPIC, self._codec.encode_description(self._description))
        for topic, text in self._documents.items():
            self._add(topic, self._codec.encode_document(text))
        self._flush()

    def _declare(self, topic: str, schema: str) -> None:
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(
                schema, "ros2msg", self._codec.schema(schema)
            )
        self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[schema])

    def _add(self, topic: str, payload: bytes, stamp: int | None = None) -> None:
        """Add a message at a stamp, the latest by default."""
        if topic not in self._channels:
            self._declare(topic, _OTHER_SCHEMAS[topic])
        stamp = self._last_stamp if stamp is None else stamp
        self._writer.add_message(
            self._channels[topic], log_time=stamp, data=payload, publish_time=stamp
        )
        self._bytes += len(payload)

    def _flush(self) -> None:
        """End the chunk; raises `OSError` where it is not on the disk, or not under its name."""
        self._writer.flush()
        if not os.path.samestat(os.stat(self._path), os.fstat(self._file.fileno())):
            raise FileNotFoundError(errno.ENOENT, "another file stands in its place")
        self._whole, self._kept = self._file.tell(), self._sequence
        self._bytes = 0

    def _stamp(self, moment: float) -> int:
        """Wall clock time of a moment on the readings' clock, ns, as far as it can be told."""
        if self._first is None:
            self._first = (self._wall_clock(), moment)
        wall, first = self._first
        elapsed = min(max(moment - first, -1e10), 1e10)
        return min(max(wall + round(elapsed * 1e9), 0), _LAST_STAMP)


def _new_file(path: str | os.PathLike[str]) -> BufferedWriter:
    """A file that did not exist, opened for writing."""
    try:
        return open(path, "xb")
    except FileExistsError as error:
        raise RecordingError(
            f"{os.fspath(path)} exists; choose another name or remove it"
        ) from error
    except OSError as error:
        raise RecordingError(f"{os.fspath(path)} cannot be written: {error.strerror}") from error
