"""Foxglove's live server, seen by a client that decodes every channel by the server's schema."""

import base64
import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading, Status

pytest.importorskip("foxglove")
pytest.importorskip("websockets")
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from websockets.sync.client import ClientConnection, connect

from smoskin.service.bridges.foxglove import Foxglove

TOUCH = Contact(position=(0.045, 0.080), force=(0.3, -0.4, -1.2))
SECOND = Contact(position=(0.090, 0.030), force=(0.0, 0.2, -0.6))
HEAD = struct.Struct("<BIQ")
"""Operation, subscription and time of a message of the protocol."""


@pytest.fixture
def server() -> Iterator[Foxglove]:
    with Foxglove() as server:
        yield server


def by_protobuf(channel: dict[str, Any], payload: bytes) -> Any:
    """A message by the descriptors in its channel's schema."""
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    kind = pool.FindMessageTypeByName(channel["schemaName"])
    return message_factory.GetMessageClass(kind).FromString(payload)


def by_ros(channel: dict[str, Any], payload: bytes) -> Any:
    """A message by the definition in its channel's schema alone."""
    store = get_typestore(Stores.EMPTY)
    own, *others = channel["schema"].split("=" * 80 + "\n")
    types = get_types_from_msg(own, channel["schemaName"])
    for other in others:
        name, _, text = other.partition("\n")
        types |= get_types_from_msg(text, name.removeprefix("MSG: "))
    store.register(types)
    return store.deserialize_cdr(payload, channel["schemaName"])


def by_json(channel: dict[str, Any], payload: bytes) -> Any:
    return json.loads(payload)


DECODERS = {"cdr": by_ros, "protobuf": by_protobuf, "json": by_json}


class Viewer:
    """A client that subscribes to every channel."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self.channels: dict[int, dict[str, Any]] = {}
        while not self.channels:
            message = json.loads(connection.recv(timeout=10.0))
            if message["op"] == "advertise":
                self.channels = {channel["id"]: channel for channel in message["channels"]}
        wanted = [{"id": name, "channelId": name} for name in self.channels]
        connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def messages(self, sink: Any, estimate: Estimate) -> dict[str, list[Any]]:
        """All messages by their topics, of readings that are written until each has one."""
        heard: dict[str, list[Any]] = {}
        chips = sum(channel["topic"].endswith("/field") for channel in self.channels.values())
        reading = Reading(time=5.0, field=np.arange(3.0 * chips).reshape(-1, 3) * 1e-6)
        for _ in range(200):
            sink.write(reading, estimate)
            try:
                while True:
                    raw = self._connection.recv(timeout=0.02)
                    operation, name, _ = HEAD.unpack_from(raw)
                    assert operation == 1
                    channel = self.channels[name]
                    decoded = DECODERS[channel["encoding"]](channel, raw[HEAD.size :])
                    heard.setdefault(channel["topic"], []).append(decoded)
            except TimeoutError:
                pass
            scene = [e.id for update in heard.get("/left/scene", []) for e in update.entities]
            unused = 2 - len(estimate.contacts)
            if len(heard) == len(self.channels) - unused and {"sheet", "touches"} <= set(scene):
                return heard
        raise AssertionError(sorted(heard))


@contextmanager
def viewing(server: Foxglove) -> Iterator[Viewer]:
    protocol: Any = ["foxglove.sdk.v1"]
    with connect(server.url, subprotocols=protocol, open_timeout=10.0) as connection:
        yield Viewer(connection)


def test_a_stranger_decodes_every_channel(server):
    design = load_design("planar")
    sink = server.add("left", 3, design, counters=lambda: {"readings": 7})
    covariance = np.diag([1e-6, 4e-6, 0.01, 0.04, 0.09])[None]
    estimate = Estimate(time=5.0, status=Status.CONTACT, contacts=(TOUCH,), covariance=covariance)
    with viewing(server) as viewer:
        heard = viewer.messages(sink, estimate)
    assert set(heard) == {
        *("/left/reading", "/left/estimate", "/left/wrench", "/left/contact0", "/left/status"),
        *("/left/counters", "/left/scene", "/left/frames"),
        *(f"/left/chip{chip}/field" for chip in range(3)),
    }
    reading = heard["/left/reading"][0]
    assert_allclose(reading.field, np.arange(9.0) * 1e-6)
    assert reading.time == 5.0
    estimated = heard["/left/estimate"][0]
    assert estimated.status == "CONTACT"
    assert_allclose(estimated.covariance, covariance.ravel())
    field = heard["/left/chip2/field"][0]
    assert field.header.frame_id == "left/chip2"
    assert field.magnetic_field.z == pytest.approx(8e-6)
    wrench = heard["/left/wrench"][0].wrench
    assert [wrench.force.x, wrench.force.y, wrench.force.z] == [0.3, -0.4, -1.2]
    assert heard["/left/contact0"][0].point.y == 0.080
    assert heard["/left/status"][0] == {"status": "CONTACT", "means": Status.CONTACT.value}
    assert heard["/left/counters"][0] == {"readings": 7}
    transforms = heard["/left/frames"][0].transforms
    place = geometry(design).chips[1]
    seen = transforms[1].translation
    assert_allclose([seen.x, seen.y, seen.z], place)
    assert (transforms[1].parent_frame_id, transforms[1].child_frame_id) == (
        "left/skin",
        "left/chip1",
    )


def arrow_of(arrow: Any) -> tuple[Any, Any]:
    """Tip and direction of an arrow, whose x its pose turns."""
    turn, tail = arrow.pose.orientation, arrow.pose.position
    along = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).apply([1.0, 0.0, 0.0])
    length = arrow.shaft_length + arrow.head_length
    return np.array([tail.x, tail.y, tail.z]) + length * along, length * along


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_two_touches_are_on_a_channel_and_an_arrow_each(server, name):
    design = load_design(name)
    sink = server.add("left", len(design.halls), design, counters=lambda: {"readings": 7})
    contacts = (TOUCH, SECOND)
    covariance = np.array([np.diag([1e-6, 4e-6, 0.01, 0.04, 0.09]) * (1 + k) for k in range(2)])
    estimate = Estimate(time=5.0, status=Status.CONTACT, contacts=contacts, covariance=covariance)
    with viewing(server) as viewer:
        heard = viewer.messages(sink, estimate)
        assert set(heard) == {channel["topic"] for channel in viewer.channels.values()}
    for k, contact in enumerate(contacts):
        for touch in heard[f"/left/contact{k}"]:
            assert touch.header.frame_id == "left/skin"
            place = [touch.point.x, touch.point.y, touch.point.z]
            assert place == [*contact.position, 0.0]
    first, second = (heard[f"/left/contact{k}"][0].header.stamp for k in range(2))
    assert (first.sec, first.nanosec) == (second.sec, second.nanosec)
    estimated = heard["/left/estimate"][0]
    assert_allclose(estimated.position.reshape(-1, 2), [c.position for c in contacts])
    assert_allclose(estimated.force.reshape(-1, 3), [c.force for c in contacts])
    assert_allclose(estimated.covariance.reshape(-1, 5, 5), covariance)
    wrench = heard["/left/wrench"][0].wrench
    pull, lever = wrench.force, wrench.torque
    assert_allclose([pull.x, pull.y, pull.z], [0.3, -0.2, -1.8])
    levers = [np.cross([*c.position, 0.0], c.force) for c in contacts]
    assert_allclose([lever.x, lever.y, lever.z], np.sum(levers, axis=0))
    chips = range(len(design.halls))
    assert [heard[f"/left/chip{k}/field"][0].magnetic_field.z for k in chips] == [
        pytest.approx((3 * k + 2) * 1e-6) for k in chips
    ]
    assert heard["/left/status"][0]["status"] == "CONTACT"
    entities = [entity for update in heard["/left/scene"] for entity in update.entities]
    arrows = next(entity for entity in entities if entity.id == "touches").arrows
    assert len(arrows) == 2
    roll = geometry(design).roll
    for arrow, contact in zip(arrows, contacts, strict=True):
        tip, along = arrow_of(arrow)
        assert_allclose(tip, roll.places(np.array([*contact.position, 0.0])), atol=1e-12)
        force = roll.axes(contact.position[1]) @ contact.force
        assert_allclose(along, 0.05 * force, atol=1e-12)  # 50 mm for 1 N


def test_an_arrow_points_along_the_force_and_ends_at_the_touch(server):
    design = load_design("planar")
    sink = server.add("left", 3, design, counters=dict)
    estimate = Estimate(
        time=5.0, status=Status.CONTACT, contacts=(TOUCH,), covariance=np.zeros((1, 5, 5))
    )
    with viewing(server) as viewer:
        heard = viewer.messages(sink, estimate)
    entities = [entity for update in heard["/left/scene"] for entity in update.entities]
    (arrow,) = next(entity for entity in entities if entity.id == "touches").arrows
    tip, along = arrow_of(arrow)
    assert_allclose(along / np.linalg.norm(along), TOUCH.force / np.linalg.norm(TOUCH.force))
    assert_allclose(tip, [0.045, 0.080, 0.0], atol=1e-12)
    sheet = next(entity for entity in entities if entity.id == "sheet").lines[0]
    vertices = geometry(design).sheet.vertices
    drawn = np.array([[point.x, point.y, point.z] for point in sheet.points])
    assert_allclose(np.unique(drawn, axis=0), np.unique(vertices, axis=0))


def test_wrong_use_is_named(server):
    sink = server.add("skin", 3)
    with pytest.raises(ArgumentError, match="name must be of one skin alone; got 'skin' again"):
        server.add("skin", 3)
    port = int(server.url.rpartition(":")[2])
    with pytest.raises(ArgumentError, match=f"port must be free; got {port}"):
        Foxglove(port=port)
    sink.write(Reading(time=0.0, field=np.zeros((3, 3))))
    sink.close()
    server.close()
    server.close()
