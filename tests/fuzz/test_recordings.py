"""Recordings as disks and cables spoil them: what is lost is told, the rest as recorded."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from fuzzing import broken, cases, check_answer, check_error, command, mutated, working_folder
from smoskin import open_recording
from smoskin.errors import RecordingError
from touch_recordings import moments, record, recorder

COUNT = 40
NAME = "r.mcap"
MADE = {reading.time: (reading, estimate) for reading, estimate in moments(COUNT)}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """The bytes of a recording with a chunk for each reading, one of four chunks, and a cut one."""
    folder = tmp_path_factory.mktemp("recordings")
    each = record(folder / "each.mcap", COUNT).read_bytes()
    with recorder(folder / "few.mcap", flush_interval=1e9, clock=lambda: 0.0) as sink:
        for k, moment in enumerate(moments(COUNT)):
            sink.write(*moment)
            if k % 10 == 9:
                sink._flush()
    few = (folder / "few.mcap").read_bytes()
    return each, few, few[: len(few) * 2 // 3]


def read(content: bytes, whole: int) -> None:
    """Every reading is one that was recorded, in order, and fewer of them do not pass for all."""
    Path(NAME).write_bytes(content)
    try:
        recording = open_recording(NAME)
        pairs = list(recording)
    except RecordingError as error:
        check_error(error, NAME)
        return
    times = [reading.time for reading, _ in pairs]
    assert times == sorted(set(times))
    for reading, estimate in pairs:
        made = MADE[reading.time]
        assert reading == made[0]
        assert estimate in (None, made[1])
    assert recording.reading_count == len(pairs)
    assert recording.description.chips == 3
    if len(pairs) < whole:
        assert recording.lost_chunks or recording.truncated, f"{whole - len(pairs)} lost, not told"


def replay(content: bytes, whole: list[str]) -> None:
    """The program tells of lost readings, and answers the others as it did."""
    Path(NAME).write_bytes(content)
    answer = command("run", f"replay:{NAME}?speed=max", "--no-zero", "--json")
    check_answer(answer, as_json=True, names=NAME)
    lines = answer.out.splitlines()
    if answer.code == 0 and len(lines) < len(whole):
        warned = bool(answer.err.strip())
        assert warned, f"{len(whole) - len(lines)} readings lost without a word"
    times = [json.loads(line)["time_s"] for line in lines]
    assert set(times) <= {json.loads(line)["time_s"] for line in whole}


def spoilt(recordings, count: int, seed: int):
    rng = np.random.default_rng(seed)
    for k in range(count):
        what, content = mutated(recordings[k % len(recordings)], rng)
        yield f"{k}: {what}", k % len(recordings), content


@cases(10, 1200)
def test_what_is_read_was_recorded_and_what_is_lost_is_told(count, recordings, tmp_path):
    with working_folder(tmp_path):
        counts = []
        for content in recordings:
            Path(NAME).write_bytes(content)
            counts.append(open_recording(NAME).reading_count)
        spoiled = (
            (label, partial(read, content, counts[which]))
            for label, which, content in spoilt(recordings, count, 1)
        )
        assert broken(spoiled) == []


@cases(3, 150)
def test_a_replay_says_what_is_lost(count, recordings, tmp_path):
    with working_folder(tmp_path):
        Path(NAME).write_bytes(recordings[0])
        whole = command("run", f"replay:{NAME}?speed=max", "--no-zero", "--json").out.splitlines()
        assert len(whole) == COUNT
        spoiled = (
            (label, partial(replay, content, whole))
            for label, _, content in spoilt(recordings[:1], count, 2)
        )
        assert broken(spoiled) == []
