"""The ROS 2 messages of a recording: their definitions, and records to CDR bytes and back.

Decides the message types: `Reading`, `Estimate` and `Description` of our own hold every bit of
the records; `sensor_msgs/MagneticField`, `geometry_msgs/PointStamped` and `WrenchStamped` say
the same, as far as they can, to viewers that know nothing of skins. Hides the encoding.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import HallSetting
from smoskin.errors import MissingExtraError, RecordingError
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

READING: Final = "smoskin_msgs/msg/Reading"
ESTIMATE: Final = "smoskin_msgs/msg/Estimate"
DESCRIPTION: Final = "smoskin_msgs/msg/Description"
FIELD: Final = "sensor_msgs/msg/MagneticField"
POSITION: Final = "geometry_msgs/msg/PointStamped"
WRENCH: Final = "geometry_msgs/msg/WrenchStamped"

DEFINITIONS: Final[Mapping[str, str]] = MappingProxyType(
    {
        READING: """\
# One moment of all chips of a skin.
int64 MISSING=1
int64 SATURATED=2
int64 WRAPPED=4
int64 OLD=8
int64 INVALID=16
builtin_interfaces/Time stamp  # wall clock
uint64 sequence                # counts the readings of a recording from 0
float64 time                   # s, on the source's monotonic clock
float64[] field                # T, (chips, 3) row by row, in each chip's own axes
float64[] temperature          # degC, (chips); NaN where a chip does not report it
int64[] flags                  # (chips), sums of the constants above; 0 is good
""",
        ESTIMATE: """\
# What an estimator makes of the reading with the same sequence number.
builtin_interfaces/Time stamp  # wall clock
uint64 sequence                # of the reading
float64 time                   # s, on the source's monotonic clock
string status                  # CONTACT, NO_CONTACT, SATURATED, ...
float64[] position             # m, (contacts, 2) row by row, in the skin's frame
float64[] force                # N, (contacts, 3), that the toucher exerts; pressing is -z
float64[] covariance           # (contacts, 5, 5) of x, y, Fx, Fy, Fz in m and N
""",
        DESCRIPTION: """\
# What was recorded.
string design                  # name of the skin's design
string design_hash             # SHA-256 of everything in the design that is built
uint32 chips
uint8 gain_selection           # GAIN_SEL of every MLX90393
uint8 resolution               # RES
uint8 oversampling             # OSR
uint8 digital_filter           # DIG_FILT
string version                 # of the smoskin package that recorded
float64 start                  # s since 1970-01-01 UTC, when the recorder was opened
""",
    }
)
"""Our own message types, as their schemas stand in every recording."""

_MEANINGLESS: Final = int(ChipFlag.MISSING | ChipFlag.WRAPPED | ChipFlag.INVALID)
"""Flags of chips whose field is no field at all; viewers get NaN."""
_HEAD: Final = struct.Struct("<4xiIQd")
"""Little-endian CDR of `stamp`, `sequence` and `time`, after its four bytes of preamble."""
_SECOND: Final = 1_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What a recording is of."""

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


@cache
def _typestore() -> "Typestore":
    """ROS 2's message types and our own; made once, as that takes a tenth of a second."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store


class Codec:
    """Records to CDR bytes and back.

    Raises
    ------
    MissingExtraError
        If rosbags is not installed.
    """

    def __init__(self) -> None:
        try:
            from rosbags.serde import SerdeError
        except ImportError as error:
            raise MissingExtraError("recording and replaying", "recording") from error
        self._store = _typestore()
        self._wrong = (SerdeError, KeyError, ValueError)

    def schema(self, name: str) -> bytes:
        """The definition of a message type and of all types in it, as `ros2msg` text."""
        generated, _ = self._store.generate_msgdef(name, ros_version=2)
        own, rule, nested = generated.partition("=" * 80)
        return (DEFINITIONS.get(name, own) + rule + nested).encode()

    def encode_reading(self, reading: Reading, sequence: int, stamp: int) -> bytes:
        """A reading, its number in the recording and its wall clock time in ns."""
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
        """An estimate, the number of its reading and its wall clock time in ns."""
        contacts = estimate.contacts
        return self._encode(
            ESTIMATE,
            self._time(stamp),
            sequence,
            estimate.time,
            estimate.status.name,
            np.array([contact.position for contact in contacts]).ravel(),
            np.array([contact.force for contact in contacts]).ravel(),
            estimate.covariance.ravel(),
        )

    def encode_description(self, description: Description) -> bytes:
        """What the recording is of."""
        setting = description.setting
        return self._encode(
            DESCRIPTION,
            description.design,
            description.design_hash,
            description.chips,
            setting.gain_selection,
            setting.resolution,
            setting.oversampling,
            setting.digital_filter,
            description.version,
            description.start,
        )

    def encode_field(self, reading: Reading, chip: int, stamp: int) -> bytes:
        """One chip's field for viewers, in T; NaN where the chip's numbers mean nothing."""
        bad = bool(reading.flags[chip] & _MEANINGLESS)
        field = np.full(3, np.nan) if bad else reading.field[chip]
        header = self._header(f"chip{chip}", stamp)
        return self._encode(FIELD, header, self._vector(field), np.zeros(9))

    def encode_position(self, contact: Contact, stamp: int) -> bytes:
        """A contact's place on the undeformed skin for viewers, in m."""
        point = self._new("geometry_msgs/msg/Point", *contact.position.tolist(), 0.0)
        return self._encode(POSITION, self._header("skin", stamp), point)

    def encode_wrench(self, contacts: tuple[Contact, ...], stamp: int) -> bytes:
        """All contacts' force and torque about the skin's origin for viewers, in N and N m."""
        force, torque = np.zeros(3), np.zeros(3)
        for contact in contacts:
            (x, y), (fx, fy, fz) = contact.position, contact.force
            force += contact.force
            torque += (y * fz, -x * fz, x * fy - y * fx)
        wrench = self._new("geometry_msgs/msg/Wrench", self._vector(force), self._vector(torque))
        return self._encode(WRENCH, self._header("skin", stamp), wrench)

    def decode_reading(self, payload: bytes) -> tuple[int, Reading]:
        """A reading and its number in the recording."""
        try:
            message = self._decode(READING, payload)
            reading = Reading(
                time=message.time,
                field=message.field.reshape(-1, 3),
                temperature=message.temperature,
                flags=message.flags,
            )
        except self._wrong as error:
            raise RecordingError(f"a reading cannot be decoded: {error}") from error
        return message.sequence, reading

    def decode_estimate(self, payload: bytes) -> tuple[int, Estimate]:
        """An estimate and the number of its reading."""
        try:
            message = self._decode(ESTIMATE, payload)
            places = message.position.reshape(-1, 2)
            forces = message.force.reshape(-1, 3)
            estimate = Estimate(
                time=message.time,
                status=Status[message.status],
                contacts=tuple(
                    Contact(position=place, force=force)
                    for place, force in zip(places, forces, strict=True)
                ),
                covariance=message.covariance.reshape(-1, 5, 5),
            )
        except self._wrong as error:
            raise RecordingError(f"an estimate cannot be decoded: {error}") from error
        return message.sequence, estimate

    def decode_description(self, payload: bytes) -> Description:
        """What the recording is of."""
        try:
            message = self._decode(DESCRIPTION, payload)
            return Description(
                design=message.design,
                design_hash=message.design_hash,
                chips=message.chips,
                setting=HallSetting(
                    gain_selection=message.gain_selection,
                    resolution=message.resolution,
                    oversampling=message.oversampling,
                    digital_filter=message.digital_filter,
                ),
                version=message.version,
                start=message.start,
            )
        except self._wrong as error:
            raise RecordingError(f"the description cannot be decoded: {error}") from error

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

    def _decode(self, name: str, payload: bytes) -> Any:
        return self._store.deserialize_cdr(payload, name)

    def _time(self, stamp: int) -> Any:
        return self._new("builtin_interfaces/msg/Time", *divmod(stamp, _SECOND))

    def _header(self, frame: str, stamp: int) -> Any:
        return self._new("std_msgs/msg/Header", self._time(stamp), frame)

    def _vector(self, xyz: Floats) -> Any:
        return self._new("geometry_msgs/msg/Vector3", *xyz.tolist())
