"""Recordings of a few moments of touch, and the recorder that makes them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from smoskin.design.document import read_design
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.service.recorder import Recorder

DESIGN = read_design("planar")
CHIPS = len(DESIGN.halls)
WALL = 1_700_000_000_000_000_000


class Clock:
    """Stands still until told."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def moments(count: int) -> list[tuple[Reading, Estimate]]:
    noise = np.random.default_rng(3)
    made = []
    for index in range(count):
        time = 5.0 + 0.01 * index
        reading = Reading(
            time=time,
            field=noise.normal(0.0, 1e-3, (CHIPS, 3)),
            temperature=noise.normal(25.0, 1.0, CHIPS),
        )
        contact = Contact(position=(0.04, 0.08), force=(0.1, -0.2, -0.5 - 0.01 * index))
        spread = noise.normal(0.0, 1e-3, (1, 5, 5))
        estimate = Estimate(
            time=time, status=Status.CONTACT, contacts=(contact,), covariance=spread
        )
        made.append((reading, estimate))
    return made


def recorder(path: Path, **options: object) -> Recorder:
    return Recorder(path, DESIGN, wall_clock=lambda: WALL, **options)  # type: ignore[arg-type]


def record(path: Path, count: int) -> Path:
    with recorder(path, flush_interval=0.0) as sink:
        for reading, estimate in moments(count):
            sink.write(reading, estimate)
    return path


class FakeTime:
    """A clock that sleeping moves on."""

    def __init__(self) -> None:
        self.now = 1000.0

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds


def recorded(path: Path, times: Sequence[float]) -> Path:
    """A recording of readings at these times, each with its number as field, in T."""
    with Recorder(path, DESIGN) as sink:
        for index, moment in enumerate(times):
            sink.write(Reading(time=moment, field=np.full((CHIPS, 3), float(index))))
    return path


def decoded_by_others(path: Path) -> dict[str, list[tuple[int, object]]]:
    """Log time and message by topic, through mcap's reader and the schemas in the file alone."""
    from mcap.reader import make_reader
    from rosbags.typesys import get_types_from_msg
    from rosbags.typesys.store import Typestore

    decoded: dict[str, list[tuple[int, object]]] = {}
    stores: dict[str, Typestore] = {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            if schema.name not in stores:
                store = stores[schema.name] = Typestore()
                store.register(get_types_from_msg(schema.data.decode(), schema.name))
            content = stores[schema.name].deserialize_cdr(message.data, schema.name)
            decoded.setdefault(channel.topic, []).append((message.log_time, content))
    return decoded
