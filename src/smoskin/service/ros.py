"""The ROS 2 messages of a recording: records to CDR bytes and back.

Decides the message types: those of our own (in `msg/`) hold every bit of the records;
`sensor_msgs/MagneticField`, `geometry_msgs/PointStamped` and `WrenchStamped` say the same, as far
as they can, to viewers that know nothing of skins. Hides the encoding.
"""

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import HallSetting
from smoskin.errors import MissingExtraError, RecordingError
from smoskin.records import ChipFlag, Contact, Estimate, HeldTouch, Reading, Status

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

READING: Final = "smoskin_msgs/msg/Reading"
ESTIMATE: Final = "smoskin_msgs/msg/Estimate"
DESCRIPTION: Final = "smoskin_msgs/msg/Description"
FIELD: Final = "sensor_msgs/msg/MagneticField"
POSITION: Final = "geometry_msgs/msg/PointStamped"
WRENCH: Final = "geometry_msgs/msg/WrenchStamped"
DOCUMENT: Final = "std_msgs/msg/String"
JOINTS: Final = "sensor_msgs/msg/JointState"
TOUCH: Final = "smoskin_msgs/msg/Touch"
PHASE: Final = "smoskin_msgs/msg/Phase"

WRENCH_KNOWN: Final = (Status.CONTACT, Status.NO_CONTACT, Status.AMBIGUOUS)
"""Statuses of estimates that tell the wrench on the skin."""
_MEANINGLESS: Final = int(ChipFlag.MISSING | ChipFlag.WRAPPED | ChipFlag.INVALID)
"""Flags of chips whose field is no field at all; viewers get NaN."""
_HEAD: Final = struct.Struct("<4xiIQd")
"""Little-endian CDR of `stamp`, `sequence` and `time`, after its four bytes of preamble."""
_STAMP: Final = struct.Struct("<4xiI")
"""The same of `stamp` alone."""
_SECOND: Final = 1_000_000_000
_WRONG: Final = (LookupError, ValueError, TypeError, OverflowError, MemoryError, struct.error)
"""Errors that payloads of something else raise, beside the library's own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What a recording is of; the fields are those of the message, in its order."""

    design: str
    """Name of the skin's design."""
    design_hash: str
    """SHA-256 of everything in the design that is built."""
    chips: int
    """Number of chips in every reading."""
    setting: HallSetting
    """How every chip was set."""
    version: str
    """Version of the package that recorded."""
    start: float
    """s since 1970-01-01 UTC, when the recorder was opened."""


class TouchLabel(NamedTuple):
    """What a recording says of a touch."""

    number: int
    """Its number in the campaign, from 0."""
    contact: Contact
    span: tuple[float, float]
    """Times of its first and last reading, s."""
    rest: tuple[float, float]
    """Start and end of the rest before it, s."""
    held: tuple[float, float]
    """Start and end of the hold, s."""


def _definition(name: str) -> str:
    """A message type of our own, as its schema stands in every recording."""
    file = resources.files("smoskin.service") / "msg" / f"{name.rpartition('/')[2]}.msg"
    return file.read_text(encoding="utf-8")


@cache
def _typestore() -> "Typestore":
    """ROS 2's message types and our own; made once, as that takes a tenth of a second."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name in (READING, ESTIMATE, DESCRIPTION, TOUCH, PHASE):
        store.register(get_types_from_msg(_definition(name), name))
    return store


def shown_field(reading: Reading, chip: int) -> Floats:
    """One chip's field for viewers, (3,), T; NaN where the chip's numbers mean nothing."""
    meaningless = bool(reading.flags[chip] & _MEANINGLESS)
    return np.full(3, np.nan) if meaningless else reading.field[chip]


class Codec:
    """Records to CDR bytes and back; stamps are times of the wall clock, ns.

    Parameters
    ----------
    within : str
        Name before those of the frames, such as ``left/``, where there are several skins.

    Raises
    ------
    MissingExtraError
        If rosbags is not installed.
    """

    def __init__(self, within: str = "") -> None:
        try:
            from rosbags.serde import SerdeError
        except ImportError as error:
            raise MissingExtraError("recording and replaying", "recording") from error
        self._within = within
        self._store = _typestore()
        self._wrong = (SerdeError, *_WRONG)

    def schema(self, name: str) -> bytes:
        """The definition of a message type and of all types in it, as `ros2msg` text."""
        generated, _ = self._store.generate_msgdef(name, ros_version=2)
        own, rule, nested = generated.partition("=" * 80)
        own = _definition(name) if name.startswith("smoskin_msgs") else own
        return (own + rule + nested).encode()

    def encode_reading(self, reading: Reading, sequence: int, stamp: int) -> bytes:
        """A reading with its number in the recording."""
        return self._encode(
            READING,
            self._time(stamp),
            sequence,
            reading.time,
            reading.field.ravel(),
            reading.temperature,
            reading.flags,
        )

    def encode_estimate(self, estimate: Estimate, sequence: int, stamp: int) -> bytes:
        """An estimate with the number of its reading."""
        return self._encode(
            ESTIMATE,
            self._time(stamp),
            sequence,
            estimate.time,
            estimate.status.name,
            np.array([contact.position for contact in estimate.contacts]).ravel(),
            np.array([contact.force for contact in estimate.contacts]).ravel(),
            estimate.covariance.ravel(),
        )

    def encode_description(self, description: Description) -> bytes:
        """What the recording is of."""
        design, digest, chips, setting, version, start = astuple(description)
        return self._encode(DESCRIPTION, design, digest, chips, *setting, version, start)

    def encode_document(self, text: str) -> bytes:
        """A text, such as the document of a design."""
        return self._encode(DOCUMENT, text)

    def encode_field(self, reading: Reading, chip: int, stamp: int) -> bytes:
        """One chip's field for viewers, in T; NaN where the chip's numbers mean nothing."""
        header = self._header(f"chip{chip}", stamp)
        return self._encode(FIELD, header, self._vector(shown_field(reading, chip)), np.zeros(9))

    def encode_position(self, contact: Contact, stamp: int) -> bytes:
        """A contact's place on the undeformed skin for viewers, in m."""
        point = self._new("geometry_msgs/msg/Point", *contact.position.tolist(), 0.0)
        return self._encode(POSITION, self._header("skin", stamp), point)

    def encode_wrench(self, contacts: Sequence[Contact], stamp: int) -> bytes:
        """All contacts' force and torque about the skin's origin for viewers, in N and N m."""
        force, torque = np.zeros(3), np.zeros(3)
        for contact in contacts:
            (x, y), (fx, fy, fz) = contact.position, contact.force
            force += contact.force
            torque += (y * fz, -x * fz, x * fy - y * fx)
        wrench = self._new("geometry_msgs/msg/Wrench", self._vector(force), self._vector(torque))
        return self._encode(WRENCH, self._header("skin", stamp), wrench)

    def encode_force(self, force: Floats, stamp: int) -> bytes:
        """What a gauge felt, (3,), N."""
        wrench = self._new(
            "geometry_msgs/msg/Wrench", self._vector(force), self._vector(np.zeros(3))
        )
        return self._encode(WRENCH, self._header("gauge", stamp), wrench)

    def encode_place(self, place: Floats, stamp: int) -> bytes:
        """Place at which a stage held the probe, (3,), m in the skin's frame."""
        point = self._new("geometry_msgs/msg/Point", *place.tolist())
        return self._encode(POSITION, self._header("skin", stamp), point)

    def encode_joints(self, angles: Floats, speeds: Floats, stamp: int) -> bytes:
        """An arm's joints, (J,), rad and rad/s, called joint0 and so on from the base."""
        names = [f"joint{joint}" for joint in range(len(angles))]
        return self._encode(JOINTS, self._header("base", stamp), names, angles, speeds, np.zeros(0))

    def encode_phase(self, number: int, phase: tuple[str, float, float], stamp: int) -> bytes:
        """A phase of the touch of this number."""
        return self._encode(PHASE, self._time(stamp), number, *phase)

    def encode_touch(self, number: int, touch: HeldTouch, stamp: int) -> bytes:
        """A touch without its readings and its trace, which have messages of their own."""
        first, last = touch.readings[0].time, touch.readings[-1].time
        return self._encode(
            TOUCH,
            self._time(stamp),
            number,
            *(np.array(pair) for pair in ((first, last), touch.rest, touch.held)),
            touch.contact.position,
            touch.contact.force,
        )

    def decode_vector(self, payload: bytes, name: str) -> tuple[int, Floats]:
        """Stamp, ns, and x, y and z of a gauge's `WRENCH` or a stage's `POSITION`."""
        with self._decoded("a rig's part", name, payload) as message:
            xyz = message.wrench.force if name == WRENCH else message.point
            stamp = message.header.stamp
            return stamp.sec * _SECOND + stamp.nanosec, np.array([xyz.x, xyz.y, xyz.z])

    def decode_phase(self, payload: bytes) -> tuple[int, tuple[str, float, float]]:
        """A phase and the number of its touch."""
        with self._decoded("a phase", PHASE, payload) as message:
            return message.touch, (message.name, message.begin, message.end)

    def decode_touch(self, payload: bytes) -> TouchLabel:
        """What was said of a touch."""
        with self._decoded("a touch", TOUCH, payload) as message:
            return TouchLabel(
                message.touch,
                Contact(position=message.position, force=message.force),
                *(tuple(getattr(message, name).tolist()) for name in ("span", "rest", "held")),
            )

    def stamp(self, payload: bytes) -> int:
        """Stamp of any message that begins with one, ns, without decoding the rest."""
        seconds, nanoseconds = _STAMP.unpack_from(payload)
        return int(seconds * _SECOND + nanoseconds)

    def decode_reading(self, payload: bytes) -> tuple[int, Reading]:
        """A reading and its number in the recording."""
        with self._decoded("a reading", READING, payload) as message:
            return message.sequence, Reading(
                time=message.time,
                field=message.field.reshape(-1, 3),
                temperature=message.temperature,
                flags=message.flags,
            )

    def decode_estimate(self, payload: bytes) -> tuple[int, Estimate]:
        """An estimate and the number of its reading."""
        with self._decoded("an estimate", ESTIMATE, payload) as message:
            places, forces = message.position.reshape(-1, 2), message.force.reshape(-1, 3)
            return message.sequence, Estimate(
                time=message.time,
                status=Status[message.status],
                contacts=tuple(
                    Contact(position=place, force=force)
                    for place, force in zip(places, forces, strict=True)
                ),
                covariance=message.covariance.reshape(-1, 5, 5),
            )

    def decode_description(self, payload: bytes) -> Description:
        """What the recording is of."""
        with self._decoded("the description", DESCRIPTION, payload) as message:
            own = [part.name for part in fields(Description) if part.name != "setting"]
            registers = [part.name for part in fields(HallSetting)]
            return Description(
                setting=HallSetting(**{name: getattr(message, name) for name in registers}),
                **{name: getattr(message, name) for name in own},
            )

    def decode_document(self, payload: bytes) -> str:
        """The text of a document."""
        with self._decoded("a document", DOCUMENT, payload) as message:
            return str(message.data)

    def sequence_and_time(self, payload: bytes) -> tuple[int, float]:
        """Number and time of a reading, without decoding the rest."""
        try:
            _, _, sequence, time = _HEAD.unpack_from(payload)
        except struct.error as error:
            raise RecordingError(f"a reading cannot be decoded: {error}") from error
        return sequence, time

    def _new(self, name: str, *values: Any) -> Any:
        return self._store.types[name](*values)

    def _encode(self, name: str, *values: Any) -> bytes:
        # Little-endian everywhere: `sequence_and_time` and the round trip rely on it.
        message = self._new(name, *values)
        return bytes(self._store.serialize_cdr(message, name, little_endian=True))

    @contextmanager
    def _decoded(self, what: str, name: str, payload: bytes) -> Iterator[Any]:
        """The message in a payload, whose use raises one error, whatever is wrong."""
        try:
            yield self._store.deserialize_cdr(payload, name)
        except self._wrong as error:
            raise RecordingError(f"{what} cannot be decoded: {error}") from error

    def _time(self, stamp: int) -> Any:
        return self._new("builtin_interfaces/msg/Time", *divmod(stamp, _SECOND))

    def _header(self, frame: str, stamp: int) -> Any:
        return self._new("std_msgs/msg/Header", self._time(stamp), self._within + frame)

    def _vector(self, xyz: Floats) -> Any:
        return self._new("geometry_msgs/msg/Vector3", *xyz.tolist())
