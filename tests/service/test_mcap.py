"""Recordings that were killed, cut off or damaged: what is left, and what is refused."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from smoskin.errors import RecordingError
from smoskin.records import Reading
from smoskin.service.recorder import Recording, open_recording
from touch_recordings import CHIPS, Clock, moments, record, recorder


def assert_readings_true(recording: Recording, originals: list[Reading]) -> int:
    """Every reading given is one of the originals, in order; returns how many are."""
    unread = iter(originals)
    given = list(recording.readings())
    assert all(any(reading == original for original in unread) for reading in given)
    assert len(given) == recording.reading_count
    return len(given)


def test_a_kill_loses_at_most_the_flush_interval(tmp_path: Path) -> None:
    path, clock = tmp_path / "touch.mcap", Clock()
    with recorder(path, clock=clock) as sink:
        for index in range(500):
            clock.now = 0.01 * index
            sink.write(Reading(time=clock.now, field=np.zeros((CHIPS, 3))))
            if index % 37 == 0:
                on_disk = open_recording(path)
                assert on_disk.truncated
                assert index + 1 - on_disk.reading_count <= 100


def test_a_killed_process_leaves_a_recording(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    script = f"""
import os, signal
import numpy as np
from smoskin.design.document import read_design
from smoskin.records import Reading
from smoskin.service.recorder import Recorder
time = [0.0]
sink = Recorder({str(path)!r}, read_design("planar"), clock=lambda: time[0])
for index in range(250):
    time[0] = 0.01 * index
    sink.write(Reading(time=time[0], field=np.full(({CHIPS}, 3), 1e-3 * index)))
os.kill(os.getpid(), signal.SIGKILL)
"""
    ended = subprocess.run([sys.executable, "-c", script], timeout=60, check=False)
    assert ended.returncode == -signal.SIGKILL
    recording = open_recording(path)
    assert recording.truncated
    assert recording.lost_chunks == 0
    times = [reading.time for reading in recording.readings()]
    assert times == [0.01 * index for index in range(len(times))]
    assert len(times) >= 150


# Exhaustive where it matters, and all the way when asked.
every_byte = pytest.mark.parametrize("step", [7, pytest.param(1, marks=pytest.mark.slow)])


@every_byte
def test_a_file_cut_anywhere_gives_all_before_the_cut(step: int, tmp_path: Path) -> None:
    count = 3
    whole = open_recording(record(tmp_path / "touch.mcap", count))
    content = whole.path.read_bytes()
    originals = [reading for reading, _ in moments(count)]
    header, *ends = [span.offset + span.length for span in whole.spans]
    edges = {header, *ends, header - 1, *(end - 1 for end in ends)}
    cut = tmp_path / "cut.mcap"
    for length in sorted({*range(0, len(content), step), *edges}):
        cut.write_bytes(content[:length])
        if length < header:
            with pytest.raises(RecordingError, match=r"is empty|ends before its"):
                open_recording(cut)
            continue
        recording = open_recording(cut)
        assert recording.truncated
        assert recording.lost_chunks == 0
        assert recording.description == whole.description
        wanted = sum(end <= length for end in ends[:count])
        assert recording.reading_count == wanted
        if length in edges:
            assert list(recording.readings()) == originals[:wanted]


@every_byte
@pytest.mark.parametrize("closed", [True, False])
def test_one_damaged_byte_is_never_a_silent_wrong_answer(
    closed: bool, step: int, tmp_path: Path
) -> None:
    count = 3
    whole = open_recording(record(tmp_path / "touch.mcap", count))
    content = bytearray(whole.path.read_bytes())
    if not closed:
        del content[whole.spans[-1].offset :]
    originals = [reading for reading, _ in moments(count)]
    damaged = tmp_path / "damaged.mcap"
    refused, incomplete = 0, 0
    for position in range(0, len(content), step):
        content[position] ^= 0x10
        damaged.write_bytes(content)
        content[position] ^= 0x10
        try:
            recording = open_recording(damaged)
        except RecordingError:
            # Only damage to what names the file, not to a reading, may lose it all; and a
            # closed file is named twice.
            assert position < (8 if closed else whole.spans[1].offset)
            refused += 1
            continue
        assert recording.description == whole.description
        if recording.reading_count == count and position % 16:
            continue
        found = assert_readings_true(recording, originals)
        if found < count:
            incomplete += 1
            assert recording.lost_chunks > 0 or recording.truncated
            if closed:
                assert (recording.lost_chunks, found) == (1, count - 1)
    assert refused > 0
    assert incomplete > 0


def test_a_damaged_chunk_costs_that_chunk_only(recorded: Path) -> None:
    whole = open_recording(recorded)
    content = bytearray(recorded.read_bytes())
    third = whole.spans[3]  # the description stands in a chunk of its own
    content[third.offset + third.length // 2] ^= 0xFF
    recorded.write_bytes(content)
    recording = open_recording(recorded)
    assert recording.lost_chunks == 1
    assert not recording.truncated
    expected = moments(6)
    assert list(recording) == expected[:2] + expected[3:]


def test_readings_lost_without_a_trace_are_counted(recorded: Path) -> None:
    """No index, and a chunk that no longer looks like one: only the numbering tells."""
    whole = open_recording(recorded)
    content = bytearray(recorded.read_bytes())[: whole.spans[-1].offset]
    content[whole.spans[2].offset] = 0x80  # an opcode of someone's own
    recorded.write_bytes(content)
    recording = open_recording(recorded)
    assert recording.reading_count == 5
    assert recording.lost_chunks == 1


def test_a_tail_of_zeros_is_a_cut(recorded: Path) -> None:
    """What file systems leave behind after a power cut."""
    whole = open_recording(recorded)
    content = recorded.read_bytes()[: whole.spans[4].offset]
    recorded.write_bytes(content + bytes(5000))
    recording = open_recording(recorded)
    assert recording.truncated
    assert recording.reading_count == 3


def test_a_full_disk_raises_and_leaves_a_recording(tmp_path: Path) -> None:
    path = tmp_path / "full.mcap"
    script = f"""
import resource
import numpy as np
from smoskin.design.document import read_design
from smoskin.records import Reading
from smoskin.service.recorder import Recorder
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
noise = np.random.default_rng(0)
sink = Recorder({str(path)!r}, read_design("planar"), flush_interval=0.0)
try:
    for index in range(1000):
        sink.write(Reading(time=float(index), field=noise.normal(size=({CHIPS}, 3))))
except OSError as error:
    print(index, error.strerror)
try:
    sink.close()
except OSError as error:
    print("closed", error.strerror)
"""
    command = [sys.executable, "-c", script]
    said = subprocess.run(command, timeout=60, check=True, capture_output=True, text=True)
    written, closed = said.stdout.splitlines()
    assert written.endswith("File too large")
    assert closed == "closed File too large"
    recording = open_recording(path)
    assert recording.truncated
    assert 10 < recording.reading_count <= int(written.split()[0])


def test_a_file_that_changes_after_opening_is_reported(recorded: Path) -> None:
    recording = open_recording(recorded)
    content = bytearray(recorded.read_bytes())
    span = recording.spans[3]
    content[span.offset + span.length // 2] ^= 0xFF
    recorded.write_bytes(content)
    with pytest.raises(RecordingError, match="has changed since it was opened"):
        list(recording)
    recorded.unlink()
    with pytest.raises(RecordingError, match="cannot be read: No such file"):
        list(recording)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"\x89MCA", "ends before its header"),
        (b"time,x,y,z\n", r"not an MCAP file: it begins with b'time,x,y'"),
        (os.urandom(3000).replace(b"\x89", b"\x88"), "not an MCAP file"),
        (b"\x89MCAP0\r\n" + bytes(2000), "ends before its description"),
    ],
)
def test_other_files_are_refused(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=message):
        open_recording(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.mcap cannot be read: No such file"):
        open_recording(tmp_path / "none.mcap")
    with pytest.raises(RecordingError, match="Is a directory"):
        open_recording(tmp_path)


def test_another_robots_recording_is_refused(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "other.mcap"
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="")
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        channel = writer.register_channel("/joint_states", "cdr", schema)
        writer.add_message(channel, log_time=1, data=bytes(5), publish_time=1)
        writer.finish()
    with pytest.raises(RecordingError, match=r"not a recording of a skin.*/joint_states"):
        open_recording(path)
