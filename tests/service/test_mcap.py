"""Recordings that were killed, cut off or damaged: what is left, and what is refused."""

import os
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard

from smoskin.errors import RecordingError
from smoskin.records import Reading
from smoskin.service import mcap
from smoskin.service.recording import Recording, open_recording
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


# Exhaustive where it matters, and all the way when asked.
every_byte = pytest.mark.parametrize("step", [19, pytest.param(1, marks=pytest.mark.slow)])


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
        kept = assert_readings_true(recording, originals)
        if kept < count:
            incomplete += 1
            assert recording.lost_chunks > 0 or recording.truncated
            if closed:
                assert (recording.lost_chunks, kept) == (1, count - 1)
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


@pytest.mark.parametrize("length", [31, 40, 128, 500])
def test_a_chunk_whose_head_is_zeros_is_damaged(length: int, recorded: Path) -> None:
    """Not a chunk without records, whose checksum of nothing would be zero too."""
    content = bytearray(recorded.read_bytes())
    begin = open_recording(recorded).spans[6].offset + 9  # behind opcode and length
    content[begin : begin + length] = bytes(length)
    recorded.write_bytes(content)
    recording = open_recording(recorded)
    assert (recording.lost_chunks, recording.lost_readings) == (1, 1)
    assert list(recording) == moments(6)[:-1]


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


def test_a_full_disk_ends_the_recording_alone(tmp_path: Path) -> None:
    path = tmp_path / "full.mcap"
    script = f"""
import resource
import numpy as np
from smoskin.design.document import read_design
from smoskin.records import Reading
from smoskin.service.recorder import Recorder
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
noise = np.random.default_rng(0)
sink = Recorder({str(path)!r}, read_design("planar"), flush_interval=0.0, on_failure=print)
for index in range(1000):
    sink.write(Reading(time=float(index), field=noise.normal(size=({CHIPS}, 3))))
sink.close()
print(sink.dropped)
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, timeout=60, check=True, capture_output=True, text=True)
    sentence, dropped = done.stdout.splitlines()
    assert sentence == f"{path} cannot be written: File too large; nothing more is recorded"
    recording = open_recording(path)
    assert recording.truncated
    assert recording.lost_chunks == 0
    assert recording.reading_count == 1000 - int(dropped) > 10


def test_a_recording_that_somebody_removes_is_missed_once(tmp_path: Path) -> None:
    failures: list[str] = []
    with recorder(tmp_path / "gone.mcap", flush_interval=0.0, on_failure=failures.append) as sink:
        for index, (reading, estimate) in enumerate(moments(5)):
            sink.write(reading, estimate)
            if index == 1:
                (tmp_path / "gone.mcap").unlink()
    assert len(failures) == 1
    assert "gone.mcap cannot be written: No such file" in failures[0]
    assert sink.dropped == 3


def test_a_reading_that_is_interrupted_leaves_whole_chunks(tmp_path: Path) -> None:
    def interrupted() -> float:
        if stop:
            raise KeyboardInterrupt
        return 0.0

    stop: list[bool] = []
    path, failures = tmp_path / "touch.mcap", list[str]()
    sink = recorder(path, flush_interval=0.0, clock=interrupted, on_failure=failures.append)
    for reading, estimate in moments(3):
        sink.write(reading, estimate)
    stop.append(True)
    with pytest.raises(KeyboardInterrupt):
        sink.write(*moments(4)[3])
    sink.close()
    assert open_recording(path).reading_count >= 3
    assert "was interrupted" in failures[0]


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


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for other in ("/dev/zero", tmp_path / "pipe"):
        with pytest.raises(RecordingError, match="must be a file; got"):
            open_recording(other)
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


def chunked(path: Path, *chunks: bytes, size: int | None = None) -> Path:
    """An MCAP file of these chunks, with sound checksums; `size` is told instead of theirs."""
    content = [b"\x89MCAP0\r\n"]
    for data in chunks:
        packed = zstandard.compress(data)
        head = struct.pack("<QQQI", 0, 0, len(data) if size is None else size, zlib.crc32(data))
        body = head + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
        content.append(struct.pack("<BQ", 6, len(body)) + body)
    path.write_bytes(b"".join(content))
    return path


def test_a_chunk_that_unpacks_out_of_all_proportion_is_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bomb = chunked(tmp_path / "bomb.mcap", *[bytes(2**22)] * 5)
    unpacked: list[object] = []
    monkeypatch.setattr("smoskin.service.mcap._unpacked", unpacked.append)
    with pytest.raises(RecordingError, match=r"bomb\.mcap.*description is damaged"):
        open_recording(bomb)
    assert not unpacked
    monkeypatch.undo()
    for size in (0, 10, 2**20):  # no more than the chunk says that it holds
        with pytest.raises(RecordingError, match="description is damaged"):
            open_recording(chunked(tmp_path / "lies.mcap", bytes(10**5), size=size))


def test_a_message_that_cannot_be_read_is_named_with_its_place(recorded: Path) -> None:
    whole = open_recording(recorded)
    with open(recorded, "rb") as file:
        chunks = [mcap.load(file, span) or b"" for span in whole.spans]
    # A string's length in the third reading's estimate that no payload holds.
    spoilt = chunks[3].replace(b"\x08\0\0\0CONTACT", b"\xff\xff\xff\xffCONTACT")
    assert spoilt != chunks[3]
    recording = open_recording(chunked(recorded, *chunks[:3], spoilt, *chunks[4:]))
    with pytest.raises(RecordingError, match=r"touch\.mcap: in the chunk at byte \d+: an estimate"):
        list(recording)
    assert len(list(recording.readings())) == 6


def records_of(chunk: bytes) -> list[bytes]:
    """Records of an unpacked chunk, one by one."""
    records = []
    while chunk:
        (length,) = struct.unpack_from("<Q", chunk, 1)
        records.append(chunk[: 9 + length])
        chunk = chunk[9 + length :]
    return records


def test_an_estimate_whose_reading_is_missing_is_nobodys(recorded: Path) -> None:
    whole = open_recording(recorded)
    times = [reading.time for reading in whole.readings()]
    with open(recorded, "rb") as file:
        chunks = [records_of(mcap.load(file, span) or b"") for span in whole.spans]
    # One moment a chunk after the first, a reading and then its estimate.
    del chunks[2][1], chunks[3][0], chunks[5][0]
    recording = open_recording(chunked(recorded, *map(b"".join, chunks)))
    pairs = [(reading.time, estimate and estimate.time) for reading, estimate in recording]
    complete = [(time, time) for time in times]
    assert pairs == [complete[0], (times[1], None), complete[3], complete[5]]


def test_what_is_lost_is_told(recorded: Path) -> None:
    content = bytearray(recorded.read_bytes())
    assert open_recording(recorded).damage == ""
    last = open_recording(recorded).spans[6]
    content[last.offset + last.length // 2] ^= 0xFF  # only the index knows how many there were
    recorded.write_bytes(content)
    assert open_recording(recorded).damage == (
        f"{recorded} is not whole: 1 of 6 readings are lost; 1 of its chunks are damaged"
    )
    recorded.write_bytes(content[: last.offset])
    assert open_recording(recorded).lost_readings == 0
    assert "ends too early" in open_recording(recorded).damage


def killed(path: Path, moment: float) -> list[float]:
    """Kill a recording process so many seconds after its first reading; times it had written."""
    script = f"""
import time
import numpy as np
from smoskin.design.document import read_design
from smoskin.records import Reading
from smoskin.service.recorder import Recorder
sink = Recorder({str(path)!r}, read_design("planar"))
while True:
    now = time.monotonic()
    sink.write(Reading(time=now, field=np.full(({CHIPS}, 3), now)))
    print(now, flush=True)
    time.sleep(0.005)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(moment)
        process.kill()
        return [float(line) for line in (first, *process.stdout.readlines())]


@pytest.mark.parametrize("kills", [1, pytest.param(40, marks=pytest.mark.slow)])
def test_killed_at_any_moment_a_recording_lacks_a_second_at_most(
    kills: int, tmp_path: Path
) -> None:
    for number, moment in enumerate(np.random.default_rng(kills).uniform(0.0, 1.5, kills)):
        path = tmp_path / f"{number}.mcap"
        written = killed(path, moment)
        recording = open_recording(path)
        given = list(recording.readings())
        times = [reading.time for reading in given]
        # The last may have been written and not told any more.
        assert times[: len(written)] == written[: len(times)]
        assert all(reading.field[0, 0] == reading.time for reading in given)
        assert "ends too early" in recording.damage
        elapsed = written[-1] - written[0]
        assert written[-1] - times[-1] <= min(1.0, elapsed / 2) + 0.2


@pytest.mark.parametrize("mutations", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_a_mutated_recording_never_gives_a_wrong_reading_in_silence(
    mutations: int, tmp_path: Path
) -> None:
    originals = moments(60)
    with recorder(tmp_path / "touch.mcap", flush_interval=0.0) as sink:
        for reading, estimate in originals:
            sink.write(reading, estimate)
    content = (tmp_path / "touch.mcap").read_bytes()
    rng, path = np.random.default_rng(mutations), tmp_path / "mutated.mcap"
    for _ in range(mutations):
        mutant = bytearray(content)
        start, stop = np.sort(rng.integers(0, len(mutant), 2))
        match rng.integers(5):
            case 0:
                del mutant[start:]
            case 1:
                del mutant[start : min(stop, start + 3000)]
            case 2:
                mutant[start : start + 1] = bytes([mutant[start] ^ 1 << rng.integers(8)])
            case 3:
                mutant[start : start + 500] = rng.bytes(500)
            case _:
                mutant[start:start] = mutant[stop : stop + 2000]
        path.write_bytes(mutant)
        try:
            recording = open_recording(path)
            given = list(recording)
        except RecordingError:
            continue
        unread = iter(originals)
        assert all(any(pair == other for other in unread) for pair in given)
        assert len(given) == recording.reading_count
        assert len(given) == 60 or recording.damage
