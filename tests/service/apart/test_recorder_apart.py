"""Recordings written by a process of their own: whole, counted, and never the loop's concern."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from smoskin.errors import RecordingError
from smoskin.records import Estimate, Status
from smoskin.service.apart import recorder as apart
from smoskin.service.apart.recorder import RecorderApart
from smoskin.service.recording import open_recording
from smoskin.twin.reduced import ReducedTwin
from touch_recordings import decoded_by_others


def until(happened, seconds=20.0):
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.fixture
def readings(planar):
    twin = ReducedTwin(planar, seed=None)
    return [twin.read(time=0.01 * k) for k in range(60)]


def test_all_readings_are_written_in_their_order_unless_there_is_no_room(
    planar, readings, tmp_path, monkeypatch
):
    path, failures = tmp_path / "kept.mcap", []
    with pytest.raises(RecordingError, match="No such file or directory"):
        RecorderApart(
            tmp_path / "no" / "a.mcap", planar, attachments={}, on_failure=failures.append
        )
    recorder = RecorderApart(path, planar, attachments={"a": b"note"}, on_failure=failures.append)
    for reading in readings[:40]:
        recorder.write(reading, Estimate(time=reading.time, status=Status.NO_CONTACT))
    until(lambda: recorder._remote.waiting == 0)
    # Nobody waits for a writer that stands still, and what finds no room is counted.
    monkeypatch.setattr(apart, "_ROOM", 5)
    process = recorder._remote._process
    os.kill(process.pid, signal.SIGSTOP)
    for _ in range(200):
        recorder.write(readings[40])
    assert 0 < recorder.dropped < 200
    os.kill(process.pid, signal.SIGCONT)
    recorder.close()
    recorder.close()
    with pytest.raises(RecordingError, match="the recorder is closed"):
        recorder.write(readings[0])
    times = [reading.time for reading, _ in open_recording(path)]
    assert times[:40] == [reading.time for reading in readings[:40]]
    assert len(times) == 240 - recorder.dropped
    assert (recorder.failure, failures) == ("", [])


def test_an_arm_is_written_beside_them_where_there_is_room(planar, readings, tmp_path, monkeypatch):
    path, arm = tmp_path / "kept.mcap", (np.array([0.1, 0.2]), np.zeros(2), "standing")
    recorder = RecorderApart(path, planar, attachments={}, on_failure=pytest.fail)
    for reading in readings[:30]:
        recorder.write(reading)
        recorder.write_arm(reading.time, *arm)
    until(lambda: recorder._remote.waiting == 0)
    monkeypatch.setattr(apart, "_ROOM", 0)
    recorder.write_arm(readings[30].time, *arm)
    recorder.close()
    assert recorder.dropped == 0  # that counts readings
    with pytest.raises(RecordingError, match="the recorder is closed"):
        recorder.write_arm(0.0, *arm)
    messages = decoded_by_others(path)
    stamps = [[stamp for stamp, _ in messages[topic]] for topic in ("/skin/reading", "/arm/joints")]
    assert len(stamps[0]) == 30
    assert stamps[0] == stamps[1]
    assert {word.data for _, word in messages["/arm/state"]} == {"standing"}


def test_a_file_that_is_gone_or_a_writer_that_is_ended_ends_the_recording_alone(
    planar, readings, tmp_path
):
    failures = []
    for name, hurt, word in (
        ("removed", lambda recorder, path: path.unlink(), "No such file or directory"),
        ("ended", lambda recorder, path: recorder._remote._process.kill(), "has ended"),
    ):
        path = tmp_path / f"{name}.mcap"
        recorder = RecorderApart(path, planar, attachments={}, on_failure=failures.append)
        hurt(recorder, path)
        for _ in range(1000):
            recorder.write(readings[0])
            time.sleep(0.005)
            if recorder.failure:
                break
        recorder.write(readings[1])
        assert word in recorder.failure
        assert f"{path} cannot be written" in recorder.failure
        assert recorder.dropped > 0
        recorder.close()
        assert failures.pop() == recorder.failure
        assert not failures


LIFE = """
import os, signal, sys, time
import smoskin as smo
from smoskin.service.apart.recorder import RecorderApart
planar = smo.load_design("planar")
twin = smo.ReducedTwin(planar, seed=None)
recorder = RecorderApart(sys.argv[1], planar, attachments={}, on_failure=print)
for k in range(60):
    recorder.write(twin.read(time=0.01 * k))
while recorder._remote.waiting:
    time.sleep(0.01)
time.sleep(0.1)
print(recorder._remote._process.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_what_was_handed_over_is_written_though_the_program_is_killed(tmp_path):
    path = tmp_path / "orphan.mcap"
    ended = subprocess.run([sys.executable, "-c", LIFE, path], capture_output=True, text=True)
    assert ended.returncode == -signal.SIGKILL
    until(lambda: not os.path.exists(f"/proc/{ended.stdout.strip()}"))
    recording = open_recording(path)
    assert (recording.reading_count, recording.damage) == (60, "")
