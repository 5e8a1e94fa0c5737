"""Recordings: lossless, readable by others, and honest about cuts and damage."""

import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from smoskin.errors import ArgumentError, MissingExtraError, RecordingError
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from touch_recordings import CHIPS, DESIGN, WALL, decoded_by_others, moments, recorder

# ---------------------------------------------------------------- what is written is read

floats = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def readings(draw: st.DrawFn) -> Reading:
    return Reading(
        time=draw(floats),
        field=draw(arrays(np.uint64, (CHIPS, 3))).view(np.float64),
        temperature=draw(arrays(np.uint64, CHIPS)).view(np.float64),
        flags=draw(arrays(np.int64, CHIPS)),
    )


@st.composite
def estimates(draw: st.DrawFn) -> Estimate:
    count = draw(st.integers(0, 3))
    return Estimate(
        time=draw(floats),
        status=draw(st.sampled_from(Status)),
        contacts=tuple(
            Contact(
                position=draw(arrays(np.float64, 2, elements=st.floats(-1e3, 1e3))),
                force=draw(arrays(np.uint64, 3)).view(np.float64),
            )
            for _ in range(count)
        ),
        covariance=draw(arrays(np.uint64, (count, 5, 5))).view(np.float64),
    )


def reading_bits(reading: Reading) -> tuple[bytes, ...]:
    parts = (reading.field, reading.temperature, reading.flags)
    return (np.float64(reading.time).tobytes(), *(part.tobytes() for part in parts))


def estimate_bits(estimate: Estimate | None) -> object:
    if estimate is None:
        return None
    contacts = [(c.position.tobytes(), c.force.tobytes()) for c in estimate.contacts]
    time = np.float64(estimate.time).tobytes()
    return time, estimate.status, contacts, estimate.covariance.tobytes()


@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(readings(), st.none() | estimates()), max_size=6), st.booleans())
# Forces whose bits are NaN or huge go into the viewers' sum as they are.
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_every_bit_comes_back(
    tmp_path_factory: pytest.TempPathFactory,
    pairs: list[tuple[Reading, Estimate | None]],
    often: bool,
) -> None:
    path = tmp_path_factory.mktemp("bits") / "touch.mcap"
    with recorder(path, flush_interval=0.0 if often else 1e9) as sink:
        for reading, estimate in pairs:
            sink.write(reading, estimate)
    recording = open_recording(path)
    back = list(recording)
    assert [reading_bits(r) for r, _ in back] == [reading_bits(r) for r, _ in pairs]
    assert [estimate_bits(e) for _, e in back] == [estimate_bits(e) for _, e in pairs]
    assert [reading_bits(r) for r in recording.readings()] == [reading_bits(r) for r, _ in pairs]
    assert recording.reading_count == len(pairs)
    assert recording.estimate_count == sum(e is not None for _, e in pairs)
    assert not recording.truncated
    assert recording.lost_chunks == 0


def test_the_description_says_what_was_recorded(recorded: Path) -> None:
    recording = open_recording(recorded)
    description = recording.description
    assert description.design == DESIGN.name
    assert description.design_hash == DESIGN.content_hash
    assert description.setting == DESIGN.hall_setting
    assert description.chips == CHIPS
    assert description.version
    assert description.start == WALL * 1e-9
    assert recording.duration == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("times", "duration"),
    [((5.0, 5.3, 5.1), 0.3), ((5.2, 5.0, 5.3), 0.3), ((5.3, 5.1, 5.0), 0.3), ((7.0,), 0.0)],
)
def test_the_duration_is_from_the_earliest_to_the_latest(
    times: tuple[float, ...], duration: float, tmp_path: Path
) -> None:
    with recorder(tmp_path / "a.mcap") as sink:
        for time in times:
            sink.write(Reading(time=time, field=np.zeros((CHIPS, 3))))
    assert open_recording(tmp_path / "a.mcap").duration == pytest.approx(duration)


def test_a_chunk_ends_with_the_reading_that_fills_a_million_bytes(tmp_path: Path) -> None:
    now = [0.0]
    with Recorder(tmp_path / "long.mcap", DESIGN, flush_interval=1e9, clock=lambda: now[0]) as sink:
        sizes = []
        for k in range(9000):
            now[0] = min(k, 1e3)  # then no more time passes
            sink.write(Reading(time=0.01 * k, field=np.full((CHIPS, 3), 1e-6 * k)))
            sizes.append(sink._bytes)
    filled = [size for size, after in pairwise(sizes[1001:]) if not after]
    each = sizes[1002] - sizes[1001]
    assert len(filled) >= 2
    assert all(1e6 - 2 * each <= size < 1e6 for size in filled)


def test_a_recording_of_nothing_is_a_recording(tmp_path: Path) -> None:
    recorder(tmp_path / "none.mcap").close()
    recording = open_recording(tmp_path / "none.mcap")
    assert list(recording) == []
    assert recording.duration == 0.0
    assert not recording.truncated


def test_iterating_twice_at_once_gives_the_same(recorded: Path) -> None:
    recording = open_recording(recorded)
    for first, second in zip(recording, recording, strict=True):
        assert first == second
    assert list(recording.estimates()) == [estimate for _, estimate in moments(6)]


def test_times_out_of_order_are_kept_in_order_of_recording(tmp_path: Path) -> None:
    times = [2.0, 1.0, 1.0, 1e12, -1e300, 3.0]
    with recorder(tmp_path / "mixed.mcap") as sink:
        for time in times:
            sink.write(Reading(time=time, field=np.zeros((CHIPS, 3))))
    recording = open_recording(tmp_path / "mixed.mcap")
    assert [reading.time for reading in recording.readings()] == times


def test_a_shorter_chip_row_is_wrong_use(tmp_path: Path) -> None:
    with recorder(tmp_path / "touch.mcap") as sink:
        with pytest.raises(ArgumentError, match=r"reading must have the design's 3 chips; got 2"):
            sink.write(Reading(time=0.0, field=np.zeros((2, 3))))
        sink.write(Reading(time=0.0, field=np.zeros((CHIPS, 3))))
    assert open_recording(tmp_path / "touch.mcap").reading_count == 1


def test_an_existing_file_is_never_overwritten(recorded: Path) -> None:
    before = recorded.read_bytes()
    with pytest.raises(RecordingError, match="exists; choose another name"):
        recorder(recorded)
    assert recorded.read_bytes() == before


def test_a_recorder_says_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be written: No such file or directory"):
        recorder(tmp_path / "no" / "such" / "folder.mcap")
    with pytest.raises(ArgumentError, match="flush_interval must be finite and >= 0; got -1"):
        recorder(tmp_path / "touch.mcap", flush_interval=-1.0)
    sink = recorder(tmp_path / "touch.mcap")
    sink.close()
    sink.close()
    with pytest.raises(RecordingError, match="the recorder is closed"):
        sink.write(Reading(time=0.0, field=np.zeros((CHIPS, 3))))


# ---------------------------------------------------------------- what others read


def test_viewers_find_standard_messages(tmp_path: Path) -> None:
    flags = [ChipFlag.MISSING, ChipFlag.SATURATED, ChipFlag.WRAPPED | ChipFlag.OLD]
    reading = Reading(time=7.25, field=np.arange(9.0).reshape(3, 3) * 1e-3, flags=flags)
    contacts = (
        Contact(position=(0.03, 0.05), force=(0.1, 0.2, -0.5)),
        Contact(position=(0.07, 0.02), force=(0.0, 0.0, -1.0)),
    )
    touched = Estimate(
        time=7.25,
        status=Status.CONTACT,
        contacts=contacts,
        covariance=np.full((2, 5, 5), np.nan),
    )
    with recorder(tmp_path / "touch.mcap") as sink:
        sink.write(reading, touched)
        later = Reading(time=7.75, field=reading.field)
        sink.write(later, Estimate(time=7.75, status=Status.NO_CONTACT))
        sink.write(later, Estimate(time=7.75, status=Status.STALE))
    messages = decoded_by_others(tmp_path / "touch.mcap")

    chip = [content.magnetic_field for _, content in messages["/skin/chip1/field"]]
    assert (chip[0].x, chip[0].y, chip[0].z) == tuple(reading.field[1])
    for index in (0, 2):  # a missing and a wrapped chip have no field to show
        lost = messages[f"/skin/chip{index}/field"][0][1].magnetic_field
        assert np.isnan([lost.x, lost.y, lost.z]).all()
        assert not np.isnan(messages[f"/skin/chip{index}/field"][1][1].magnetic_field.x)

    for index, contact in enumerate(contacts):
        [(_, shown)] = messages[f"/skin/contact{index}"]
        assert shown.header.frame_id == "skin"
        assert (shown.point.x, shown.point.y, shown.point.z) == (*contact.position, 0.0)

    (stamp, pushed), (next_stamp, free) = messages["/skin/wrench"]
    assert (stamp, next_stamp) == (WALL, WALL + 500_000_000)
    assert (pushed.header.stamp.sec, pushed.header.stamp.nanosec) == divmod(WALL, 10**9)
    force, torque = pushed.wrench.force, pushed.wrench.torque
    np.testing.assert_allclose([force.x, force.y, force.z], [0.1, 0.2, -1.5])
    lever = sum(np.cross([*contact.position, 0.0], contact.force) for contact in contacts)
    np.testing.assert_allclose([torque.x, torque.y, torque.z], lever)
    assert (free.wrench.force.z, free.wrench.torque.x) == (0.0, 0.0)


def test_an_arm_stands_beside_the_readings(tmp_path: Path) -> None:
    angles, speeds = np.array([0.1, -0.2]), np.array([0.0, 0.3])
    with recorder(tmp_path / "touch.mcap") as sink:
        for reading, estimate in moments(3):
            sink.write(reading, estimate)
            sink.write_arm(reading.time + 0.001, angles, speeds, "moving: it is pushed")
    with pytest.raises(RecordingError, match="the recorder is closed"):
        sink.write_arm(9.0, angles, speeds, "")
    messages = decoded_by_others(tmp_path / "touch.mcap")
    assert [word.data for _, word in messages["/arm/state"]] == 3 * ["moving: it is pushed"]
    stamps = [stamp for stamp, _ in messages["/skin/reading"]]
    for stamp, (at, joints) in zip(stamps, messages["/arm/joints"], strict=True):
        assert at - stamp == pytest.approx(1_000_000, abs=1)
        assert (joints.name, joints.header.frame_id) == (["joint0", "joint1"], "base")
        np.testing.assert_array_equal([joints.position, joints.velocity], [angles, speeds])
    assert list(open_recording(tmp_path / "touch.mcap")) == moments(3)


def test_attachments_come_back_whatever_becomes_of_the_readings(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    content = bytes(range(256)) * 40
    with recorder(tmp_path / "a.mcap", attachments={"skin.table": content}) as sink:
        for reading, estimate in moments(20):
            sink.write(reading, estimate)
    with open(tmp_path / "a.mcap", "rb") as file:
        (kept,) = make_reader(file, validate_crcs=True).iter_attachments()
    assert (kept.name, kept.data) == ("skin.table", content)
    assert list(open_recording(tmp_path / "a.mcap")) == moments(20)
    whole = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: whole.rindex(b"/skin/reading") - 1])
    cut = open_recording(tmp_path / "cut.mcap")
    assert cut.truncated
    assert list(cut) == moments(20)


def test_our_own_messages_explain_themselves(recorded: Path) -> None:
    from mcap.reader import make_reader

    messages = decoded_by_others(recorded)
    for (_, content), (reading, _) in zip(messages["/skin/reading"], moments(6), strict=True):
        assert content.time == reading.time
        np.testing.assert_array_equal(content.field.reshape(-1, 3), reading.field)
        assert content.SATURATED == ChipFlag.SATURATED
    assert {content.status for _, content in messages["/skin/estimate"]} == {"CONTACT"}
    assert messages["/skin/description"][0][1].design == DESIGN.name
    with open(recorded, "rb") as file:
        schemas = make_reader(file).get_summary().schemas.values()
    [text] = [schema.data.decode() for schema in schemas if schema.name.endswith("/Reading")]
    assert "float64[] field                # T, (chips, 3) row by row" in text


def test_a_ros_bag_reader_opens_it_as_it_is(recorded: Path) -> None:
    from rosbags.highlevel import AnyReader

    with AnyReader([recorded]) as bag:
        counts = {connection.topic: connection.msgcount for connection in bag.connections}
        times = [
            bag.deserialize(raw, connection.msgtype).time
            for connection, _, raw in bag.messages()
            if connection.topic == "/skin/reading"
        ]
    assert counts["/skin/wrench"] == counts["/skin/chip0/field"] == counts["/skin/contact0"] == 6
    assert times == [reading.time for reading, _ in moments(6)]


def test_stamps_follow_the_readings_own_clock(tmp_path: Path) -> None:
    wall = iter([WALL, WALL + 3_000_000_000])
    with Recorder(tmp_path / "touch.mcap", DESIGN, wall_clock=lambda: next(wall)) as sink:
        for time in (100.0, 100.25, 101.0):
            sink.write(Reading(time=time, field=np.zeros((CHIPS, 3))))
    stamps = [stamp for stamp, _ in decoded_by_others(tmp_path / "touch.mcap")["/skin/reading"]]
    # The recorder was opened at WALL; the first reading came three seconds later.
    assert [stamp - WALL for stamp in stamps] == [3_000_000_000, 3_250_000_000, 4_000_000_000]


@pytest.mark.parametrize("package", ["mcap", "rosbags"])
def test_a_missing_extra_is_named(
    package: str, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    for use in (lambda: open_recording(recorded), lambda: recorder(tmp_path / "new.mcap")):
        with pytest.raises(MissingExtraError, match=r"recording and replaying .*\[recording"):
            use()
    assert not (tmp_path / "new.mcap").exists()


def test_importing_the_service_costs_no_extra() -> None:
    script = """
import sys
import smoskin.service.loop, smoskin.service.recorder, smoskin.service.source
extras = {"mcap", "rosbags", "zstandard", "viser", "jax"}
print(sorted(extras & {name.split(".")[0] for name in sys.modules}))
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, timeout=60, check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"


def test_other_numbers_of_chips_are_recorded_alike(tmp_path: Path) -> None:
    design = replace(DESIGN, halls=DESIGN.halls[:1])
    with Recorder(tmp_path / "one.mcap", design) as sink:
        sink.write(Reading(time=0.0, field=[[1e-3, 2e-3, 3e-3]]))
    recording = open_recording(tmp_path / "one.mcap")
    assert recording.description.chips == 1
    assert next(recording.readings()).field.shape == (1, 3)
