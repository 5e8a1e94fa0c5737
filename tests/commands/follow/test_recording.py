"""What `smoskin follow --record` keeps: all that the arm followed, for any reader."""

import errno
import os
from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.commands.follow import demonstration, live
from smoskin.commands.follow.demonstration import demonstrate
from smoskin.commands.follow.script import scripted_presses
from smoskin.design.document import read_design
from smoskin.errors import ArgumentError, FileError, RecordingError
from smoskin.robot.driver import Driver
from smoskin.robot.follow import Follow
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.response.table import load_response_table
from smoskin.service.apart.recorder import RecorderApart
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.twin.reduced import ReducedTwin
from touch_recordings import decoded_by_others, record

pytest.importorskip("mujoco")
pytest.importorskip("mcap")
pytest.importorskip("rosbags")

PLANAR = read_design("planar")
SECONDS = 2.5
"""Time of readings of a live source, s: its hand touches meanwhile."""


class Lying:
    """A skin as designed, of the reduced model: what it reads does not hang on the arm."""

    def __init__(self, twin, seed):
        self.twin = twin

    def read(self, time, contacts, turn, acceleration):
        return self.twin.read(contacts, time=time)


@pytest.fixture
def one_tap(monkeypatch):
    """The last touch of the script alone."""
    monkeypatch.setattr(demonstration, "scripted_presses", lambda skin: scripted_presses(skin)[-1:])


@pytest.fixture
def as_designed(monkeypatch, one_tap):
    """A demonstration that nobody has to make and calibrate a skin for."""
    table = SimpleNamespace(table=load_response_table("planar"))

    def closed(design, table):
        return ClosedFormEstimator(design)

    monkeypatch.setattr(demonstration, "BayesEstimator", closed)
    monkeypatch.setattr(demonstration, "Twin", lambda *args, **options: ReducedTwin(PLANAR, seed=1))
    monkeypatch.setattr(demonstration, "VirtualRig", lambda *args, **options: None)
    monkeypatch.setattr(demonstration, "CarriedSkin", Lying)
    monkeypatch.setattr(demonstration, "calibrate", lambda *args, **options: table)


@pytest.fixture
def seen(monkeypatch):
    """Every reading that is estimated, with its estimate, and the arm and command of it."""
    pairs, arms = [], []
    step, follow = ZeroFirst.step, Follow.step

    def estimated(self, reading):
        pairs.append((reading, step(self, reading)))
        return pairs[-1][1]

    def followed(self, now, newest, arm, **options):
        arms.append((arm, follow(self, now, newest, arm, **options)))
        return arms[-1][1]

    monkeypatch.setattr(ZeroFirst, "step", estimated)
    monkeypatch.setattr(Follow, "step", followed)
    return pairs, arms


def by_rosbags(path):
    """Messages by topic, through the reader of ROS bags and the types in the file."""
    from rosbags.highlevel import AnyReader

    messages = {}
    with AnyReader([path]) as bag:
        for connection, _, raw in bag.messages():
            messages.setdefault(connection.topic, []).append(
                bag.deserialize(raw, connection.msgtype)
            )
    return messages


def assert_holds(path, pairs):
    """A recording is of these readings and estimates, in their order, whoever reads it."""
    assert len(pairs) > 20
    assert list(open_recording(path)) == pairs
    by_mcap = {name: [m for _, m in stamped] for name, stamped in decoded_by_others(path).items()}
    for topics in (by_mcap, by_rosbags(path)):
        for message, (reading, _) in zip(topics["/skin/reading"], pairs, strict=True):
            assert message.time == reading.time
            np.testing.assert_array_equal(message.field.reshape(-1, 3), reading.field)
        touched = [estimate for _, estimate in pairs if estimate.contacts]
        for message, (_, estimate) in zip(topics["/skin/estimate"], pairs, strict=True):
            assert (message.time, message.status) == (estimate.time, estimate.status.name)
            forces = [contact.force for contact in estimate.contacts]
            np.testing.assert_array_equal(message.force.reshape(-1, 3), np.reshape(forces, (-1, 3)))
        for message, estimate in zip(topics.get("/skin/contact0", ()), touched, strict=True):
            assert (message.point.x, message.point.y) == tuple(estimate.contacts[0].position)
    return by_mcap


def assert_holds_demonstration(path, pairs, arms, demo):
    """The same of a demonstration, with its arm, table and judgement."""
    from mcap.reader import make_reader

    topics = assert_holds(path, pairs)
    assert topics["/skin/contact0"]
    for joints, word, (arm, command) in zip(
        topics["/arm/joints"], topics["/arm/state"], arms, strict=True
    ):
        assert joints.name == ["joint0", "joint1", "joint2", "joint3"]
        np.testing.assert_array_equal(joints.position, arm.angles)
        np.testing.assert_array_equal(joints.velocity, arm.speeds)
        assert word.data == command.sentence
    for joints, message in zip(topics["/arm/joints"], topics["/skin/reading"], strict=True):
        assert joints.header.stamp.sec == message.stamp.sec
        assert joints.header.stamp.nanosec == message.stamp.nanosec
    assert {word.data.partition(":")[0] for word in topics["/arm/state"]} >= {
        *("disarmed", "standing", "moving"),
    }
    with open(path, "rb") as file:
        (kept,) = make_reader(file).iter_attachments()
    table = path.with_name("kept.table")
    table.write_bytes(kept.data)
    assert load_response_table(table).design_hash == PLANAR.content_hash
    assert set(demo.exceeded.values()) == {0}
    assert not demo.not_recorded


def test_a_demonstration_is_recorded_with_its_arm(as_designed, seen, tmp_path):
    path = tmp_path / "follow.mcap"
    path.write_bytes(b"somebody's")
    with pytest.raises(FileError, match=r"follow\.mcap exists"):
        demonstrate(PLANAR, record=path)
    assert not seen[0]  # it is told before anything is made
    demo = demonstrate(PLANAR, record=path, force=True)
    assert_holds_demonstration(path, *seen, demo)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_demonstration_of_a_made_skin_is_recorded(one_tap, seen, tmp_path):
    path = tmp_path / "follow.mcap"
    demo = demonstrate(PLANAR, seed=3, calibration_touches=3, record=path)
    assert_holds_demonstration(path, *seen, demo)
    assert demo.summary.kept


def test_a_full_disk_ends_the_recording_but_not_the_demonstration(
    as_designed, seen, tmp_path, monkeypatch
):
    flush = Recorder._flush

    def fills(self):
        if self._sequence > 100:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        flush(self)

    monkeypatch.setattr(Recorder, "_flush", fills)
    path, sentences = tmp_path / "follow.mcap", []
    demo = demonstrate(PLANAR, record=path, say=sentences.append)
    assert len(seen[1]) > 800
    *_, sentence = demo.broken
    assert "follow.mcap cannot be written: No space left on device" in sentence
    assert sentence.removesuffix(".") in sentences
    assert not demo.kept
    # What was written until then stays.
    kept = list(open_recording(path))
    assert kept == seen[0][: len(kept)]


def follow_twin(path, **options):
    url = "twin://planar?mechanics=reduced&rate=50&hand=yes"
    return live.follow_source(url, record=path, seconds=SECONDS, **options)


def test_what_a_live_source_gives_is_recorded(seen, tmp_path):
    path, sentences = tmp_path / "live.mcap", []
    path.write_bytes(b"somebody's")
    with pytest.raises(FileError, match=r"live\.mcap exists"):
        follow_twin(path)
    counters = follow_twin(path, force=True, say=sentences.append)
    pairs, arms = seen
    assert counters.readings == len(pairs)
    topics = assert_holds(path, pairs)
    # The arm stands as at the newest look, which may be of this reading or one before.
    times = [message.header.stamp for message in topics["/arm/joints"]]
    stamps = [message.stamp for message in topics["/skin/reading"]]
    assert [(t.sec, t.nanosec) for t in times] == [(t.sec, t.nanosec) for t in stamps]
    commanded = {command.sentence for _, command in arms}
    assert {word.data for word in topics["/arm/state"]} <= commanded
    assert len(topics["/arm/state"]) == len(pairs)
    looked = {arm.angles.tobytes() for arm, _ in arms}
    assert {joints.position.tobytes() for joints in topics["/arm/joints"]} <= looked
    assert sentences[-1] == f"Recorded live.mcap: {len(pairs)} readings, 0 lost."


def test_a_source_is_not_recorded_over_itself(tmp_path):
    path = record(tmp_path / "touch.mcap", 6)
    with pytest.raises(ArgumentError, match="another file than the one that is played"):
        live.follow_source(f"replay:{path}", record=path, force=True)
    assert open_recording(path).reading_count == 6


def test_a_file_that_somebody_removes_never_stops_the_arm(seen, tmp_path, monkeypatch):
    path, sentences, looks = tmp_path / "live.mcap", [], []
    look = Driver.look
    monkeypatch.setattr(Driver, "look", lambda self: looks.append(look(self)) or looks[-1])
    write = RecorderApart.write

    def removed(self, reading, estimate=None):
        path.unlink(missing_ok=True)
        write(self, reading, estimate)

    monkeypatch.setattr(RecorderApart, "write", removed)
    with pytest.raises(RecordingError, match=r"live\.mcap cannot be written"):
        follow_twin(path, say=sentences.append)
    pairs, _ = seen
    assert pairs[-1][0].time - pairs[0][0].time >= SECONDS
    assert len(looks) > 20
    assert not any(command.reason.fault for command in looks)
    assert sentences[-1].startswith("Recorded live.mcap: ")
    assert sentences[-1].endswith("nothing more is recorded.")
