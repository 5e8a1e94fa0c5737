"""Recordings that are begun and ended while a skin is read."""

from datetime import datetime

import pytest

from smoskin.commands import recordings as recording
from smoskin.commands.recordings import Recordings
from smoskin.errors import ArgumentError, FileError
from smoskin.service.recording import open_recording
from smoskin.service.replay import ReplaySource
from smoskin.service.source import TwinSource
from smoskin.twin.reduced import ReducedTwin


@pytest.fixture
def twin(planar):
    return ReducedTwin(planar, seed=None)


@pytest.fixture
def clock(monkeypatch):
    class Clock:
        now = staticmethod(lambda: datetime(2026, 3, 1, 9, 8, 7))

    monkeypatch.setattr(recording, "datetime", Clock)


def write(recordings, twin, count):
    for k in range(count):
        recordings.write(twin.read(time=0.01 * k))


def test_each_begin_makes_a_new_file_and_none_is_overwritten(planar, twin, tmp_path, clock):
    (tmp_path / "planar-20260301-090807.mcap").write_bytes(b"somebody's")
    with Recordings(planar, TwinSource(twin), home=tmp_path) as recordings:
        write(recordings, twin, 3)  # nobody wants these
        assert (recordings.goes_on, recordings.sentence) == (False, "")
        for count in (4, 5):
            recordings.switch(True)
            write(recordings, twin, count)
            assert recordings.goes_on
            recordings.switch(False)
            assert not recordings.goes_on
        assert recordings.sentence == (
            "Recorded planar-20260301-090807-3.mcap: 5 readings, 0 lost."
        )
        recordings.switch(True)
        write(recordings, twin, 6)
        assert recordings.sentence.startswith(
            "Recording into planar-20260301-090807-4.mcap: 6 readings"
        )
    counts = [
        open_recording(tmp_path / f"planar-20260301-090807-{k}.mcap").reading_count
        for k in (2, 3, 4)
    ]
    assert counts == [4, 5, 6]
    assert (tmp_path / "planar-20260301-090807.mcap").read_bytes() == b"somebody's"


def test_further_recordings_stand_beside_the_file_that_was_given(planar, twin, tmp_path, clock):
    first = tmp_path / "day.mcap"
    with Recordings(planar, TwinSource(twin), home=first) as recordings:
        recordings.begin(first)
        write(recordings, twin, 2)
        recordings.begin()
        write(recordings, twin, 3)
        with pytest.raises(FileError, match=r"day\.mcap exists"):
            recordings.begin(first)
    assert open_recording(first).reading_count == 2
    assert open_recording(tmp_path / "day-20260301-090807.mcap").reading_count == 3
    with ReplaySource(open_recording(first)) as played:
        again = Recordings(planar, played, home=first)
        with pytest.raises(ArgumentError, match="another file than the one that is played"):
            again.begin(first, force=True)


def test_a_name_that_another_program_takes_meanwhile_is_refused(planar, twin, tmp_path):
    taken = tmp_path / "taken.mcap"
    taken.write_bytes(b"another's")
    with Recordings(planar, TwinSource(twin), home=tmp_path) as recordings:
        recordings._free = lambda: taken
        recordings.switch(True)
        assert recordings.sentence.startswith(f"Not recorded: {taken} exists")
    assert taken.read_bytes() == b"another's"


def test_what_cannot_be_recorded_is_told_and_counted(planar, twin, tmp_path, monkeypatch):
    messages = []
    with Recordings(planar, TwinSource(twin), home=tmp_path, say=messages.append) as recordings:
        with monkeypatch.context() as patch:
            patch.setattr(recordings, "_folder", tmp_path / "nowhere")
            recordings.switch(True)
        assert not recordings.goes_on
        assert recordings.sentence.startswith("Not recorded: ")
        assert "No such file or directory" in recordings.sentence
        assert messages == [recordings.sentence]
        recordings.switch(True)
        next(tmp_path.iterdir()).unlink()
        write(recordings, twin, 5)
        recordings.switch(False)
        assert recordings.sentence.startswith("Recorded planar-")
        assert recordings.sentence.endswith("nothing more is recorded.")
        lost = recordings.dropped
        assert f": {5 - lost} readings, {lost} lost. " in recordings.sentence
        assert lost >= 1
        assert recordings.failure in messages
        recordings.switch(True)  # a new file may do
        assert recordings.goes_on
    assert recordings.dropped == lost
