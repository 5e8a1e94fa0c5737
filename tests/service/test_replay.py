"""Playback: its pace, its pauses, and jumps that lead nobody astray."""

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from smoskin.errors import ArgumentError, SourceError
from smoskin.pace import Pace
from smoskin.records import ChipFlag, Contact, Reading
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.service.loop import run
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.service.replay import ReplaySource
from smoskin.service.source import TwinSource, open_source
from smoskin.twin.reduced import ReducedTwin
from touch_recordings import CHIPS, DESIGN, FakeTime, recorded


def played(path: Path, **options: float) -> tuple[list[float], list[float]]:
    """Times of the readings, and when they came."""
    fake = FakeTime()
    source = ReplaySource(open_recording(path), pace=Pace(fake.clock, fake.sleep), **options)
    given, came = [], []
    for reading in source:
        given.append(reading.time)
        came.append(fake.now - 1000.0)
    return given, came


def test_playback_has_the_original_timing(tmp_path: Path) -> None:
    times = [5.0, 5.1, 5.15, 5.45, 5.5]
    given, came = played(recorded(tmp_path / "a.mcap", times))
    assert given == times
    np.testing.assert_allclose(came, np.subtract(times, 5.0), atol=1e-9)


@pytest.mark.parametrize(("speed", "whole"), [(2.0, 0.2), (0.5, 0.8), (float("inf"), 0.0)])
def test_speed_scales_the_timing(speed: float, whole: float, tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.mcap", [5.0, 5.2, 5.4])
    assert played(path, speed=speed)[1][-1] == pytest.approx(whole)


def test_a_long_gap_is_cut_short(tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.mcap", [0.0, 3600.0, 3600.01])
    np.testing.assert_allclose(played(path)[1], [0.0, 0.5, 0.51], atol=1e-9)
    np.testing.assert_allclose(played(path, longest_gap=0.1)[1], [0.0, 0.1, 0.11], atol=1e-9)


def test_shuffled_times_are_passed_on_and_the_pace_goes_on(tmp_path: Path) -> None:
    times = [0.0, 0.2, 0.1, 0.1, 0.4, 0.3, 0.5]
    given, came = played(recorded(tmp_path / "a.mcap", times))
    assert given == times
    np.testing.assert_allclose(came, [0.0, 0.2, 0.2, 0.2, 0.4, 0.4, 0.5], atol=1e-9)


def test_a_wild_time_costs_one_gap(tmp_path: Path) -> None:
    given, came = played(recorded(tmp_path / "a.mcap", [0.0, 0.1, 1e9, 0.2, 0.3, -1e9, -1e9 + 1]))
    assert given[2] == 1e9
    np.testing.assert_allclose(came, [0.0, 0.1, 0.6, 0.6, 0.7, 0.7, 1.2], atol=1e-6)


def test_bad_measurements_are_played_as_recorded(tmp_path: Path) -> None:
    flags = [ChipFlag.MISSING, ChipFlag.SATURATED, ChipFlag.INVALID]
    field = np.array([[np.nan] * 3, [0.05, 0.0, 0.0], [np.inf, -np.inf, 0.0]])
    bad = Reading(time=0.0, field=field, flags=flags)
    with Recorder(tmp_path / "bad.mcap", DESIGN) as sink:
        sink.write(bad)
    with open_source(f"replay:{tmp_path / 'bad.mcap'}") as source:
        assert list(source) == [bad]


def test_a_reading_that_is_not_due_yet_is_not_lost(tmp_path: Path) -> None:
    fake = FakeTime()
    recording = open_recording(recorded(tmp_path / "a.mcap", [0.0, 0.4]))
    source = ReplaySource(recording, pace=Pace(fake.clock, fake.sleep))
    assert source.read() is not None
    with pytest.raises(SourceError, match=r"no reading within 0\.1 s; the next is due in 0\.300 s"):
        source.read(timeout=0.1)
    late = source.read()
    assert late is not None
    assert late.time == 0.4
    assert fake.now == pytest.approx(1000.4)
    assert source.read() is None


def test_a_recording_that_changes_while_it_plays_ends_the_source(tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.mcap", [0.0, 0.1])
    source = ReplaySource(open_recording(path))
    content = bytearray(path.read_bytes())
    for span in open_recording(path).spans:
        content[span.offset + 40] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(SourceError, match="has changed since it was opened"):
        source.read()


def test_a_damaged_recording_plays_what_is_left(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, DESIGN, flush_interval=0.0) as sink:
        for index in range(5):
            sink.write(Reading(time=0.1 * index, field=np.zeros((CHIPS, 3))))
    third = open_recording(path).spans[3]
    path.write_bytes(path.read_bytes()[: third.offset + 20])
    with open_source(f"replay:{path}?speed=max") as source:
        assert len(list(source)) == 2


def test_a_recording_knows_its_design(tmp_path: Path) -> None:
    own = replace(DESIGN, name="mine", columns=replace(DESIGN.columns, radius=1.4e-3))
    Recorder(tmp_path / "own.mcap", own).close()
    source = ReplaySource(open_recording(tmp_path / "own.mcap"))
    assert source.design == own
    assert source.design.provenance == own.provenance
    assert source.design_hash == own.content_hash


def steady(path: Path, count: int) -> tuple[ReplaySource, FakeTime]:
    """A source of readings 0.1 s apart, and the time it takes."""
    fake = FakeTime()
    recording = open_recording(recorded(path, [5.0 + 0.1 * index for index in range(count)]))
    return ReplaySource(recording, pace=Pace(fake.clock, fake.sleep)), fake


def test_what_is_sought_comes_at_once_with_all_before_it(tmp_path: Path) -> None:
    source, fake = steady(tmp_path / "a.mcap", 30)
    rewound: list[float] = []
    source.on_rewind = lambda: rewound.append(fake.now)

    def numbers(count: int) -> list[int]:
        readings = [source.read() for _ in range(count)]
        return [round(float(reading.field[0, 0])) for reading in readings if reading is not None]

    assert numbers(3) == [0, 1, 2]
    assert fake.now == pytest.approx(1000.2)
    source.seek(1.95)
    assert source.goal == 1.95
    assert numbers(18) == list(range(3, 21))
    assert source.goal is None
    assert source.position == pytest.approx(2.0)
    assert fake.now == pytest.approx(1000.2)
    assert numbers(2) == [21, 22]  # and on at the recorded pace
    assert 1000.2 < fake.now < 1000.5
    assert rewound == []

    source.seek(0.5)
    assert numbers(7) == [0, 1, 2, 3, 4, 5, 6]
    assert len(rewound) == 1
    source.seek(1e6)
    assert numbers(99) == list(range(7, 30))
    with pytest.raises(ArgumentError, match=r"position must be from 0 to inf; got -1"):
        source.seek(-1.0)


def test_a_paused_source_stands_until_it_goes_on_or_is_sought(tmp_path: Path) -> None:
    source, fake = steady(tmp_path / "a.mcap", 30)
    source.pause()
    source.seek(0.0)
    first = source.read()
    assert first is not None
    assert first.time == 5.0
    source.seek(0.3)
    assert [source.read().time for _ in range(3)] == pytest.approx([5.1, 5.2, 5.3])  # type: ignore[union-attr]
    for go_on in (lambda: source.pause(False), source.close):
        source.pause()
        timer = threading.Timer(0.05, go_on)
        timer.start()
        reading = source.read(timeout=0.01)  # it stands, so it is not late
        timer.join()
        assert (reading is None) == (go_on == source.close)
    assert fake.now == 1000.0  # what was stood is not caught up with


def test_a_source_that_stays_plays_again(tmp_path: Path) -> None:
    source, _ = steady(tmp_path / "a.mcap", 3)
    stays = iter((True, False))
    source.stays = lambda: next(stays)
    assert [source.read() is None for _ in range(3)] == [False] * 3
    source.seek(0.1)
    times = [reading.time for reading in source]
    assert times == pytest.approx([5.0, 5.1, 5.2])


def test_an_estimator_that_is_reset_answers_after_a_jump_as_without_one(tmp_path: Path) -> None:
    """Zero, creep and drift included: bit for bit."""
    twin = TwinSource(ReducedTwin(DESIGN, seed=3), speed=np.inf)
    with Recorder(tmp_path / "a.mcap", DESIGN) as recorder:
        for number in range(120):
            force = (0.0, 0.0, -0.5)
            touch = [Contact(position=(0.05, 0.0667), force=force)] * (40 < number < 90)
            twin.touch(touch)
            reading = twin.read()
            assert reading is not None
            recorder.write(reading)

    def play(*goals: float) -> list[object]:
        source = open_source(f"replay:{tmp_path / 'a.mcap'}?speed=max")
        assert isinstance(source, ReplaySource)
        estimator = ZeroFirst(ClosedFormEstimator(DESIGN))
        source.on_rewind = estimator.reset
        waiting, estimates = list(goals), []
        for estimate in run(source, estimator):
            if source.goal is None:
                estimates.append(estimate)
                if waiting and len(estimates) % 60 == 0:
                    source.seek(waiting.pop(0))
        return estimates

    straight = play()
    assert {estimate.status.name for estimate in straight} == {  # type: ignore[attr-defined]
        "NOT_CALIBRATED",
        "NO_CONTACT",
        "CONTACT",
    }
    jumped = play(0.95, 0.455)
    assert jumped[:60] == straight[:60]
    assert jumped[60:85] == straight[95:]
    assert len(jumped) == 85

    jumped = play(0.455)
    assert jumped == straight[:60] + straight[46:]


def test_a_speed_may_change(tmp_path: Path) -> None:
    source, fake = steady(tmp_path / "a.mcap", 9)
    source.read()
    source.speed = 0.5
    source.read()
    assert fake.now == pytest.approx(1000.2)
    source.speed = np.inf
    assert len(list(source)) == 7
    assert fake.now == pytest.approx(1000.2)
    with pytest.raises(ArgumentError, match="speed must be from"):
        source.speed = 0.0
