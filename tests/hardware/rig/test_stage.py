"""A GRBL stage on a pseudo-terminal: moves, stops, and what its answers are made of."""

import threading
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rigs import FakeStage, World
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.rig.stage import GrblStage, open_stage

pytest.importorskip("serial")

TARGET = np.array([-0.0203, -0.0204, -0.0012])


@pytest.fixture
def fake():
    stage = FakeStage(World())
    yield stage
    stage.close()


def test_a_stage_goes_where_it_is_sent(fake) -> None:
    with open_stage(f"serial://{fake.port}?baud=9600") as stage:
        assert_allclose(stage.where(), [-0.020, -0.020, -0.001])
        stage.move(TARGET, 2e-3, 5.0)
        assert_allclose(stage.where(), TARGET)
        assert fake.asked == ["$J=G53 G90 G21 X-20.3000 Y-20.4000 Z-1.2000 F120.00"]


def test_work_places_are_told_in_the_machine_s_frame(fake) -> None:
    fake.work = True
    with GrblStage(fake.port) as stage:
        stage.move(TARGET, 2e-3, 5.0)
        for _ in range(5):
            assert_allclose(stage.where(), TARGET)


def test_a_stop_ends_a_move_and_the_next_goes(fake) -> None:
    fake.share = 20.0
    with GrblStage(fake.port) as stage:
        timer = threading.Timer(0.1, stage.stop)
        timer.start()
        with pytest.raises(SourceError, match=r"was stopped on its way, 0\.\d+ mm before the end"):
            stage.move(TARGET, 2e-3, 10.0)
        timer.join()
        fake.share = 0.0
        stage.stop()  # a hold at rest outlasts until it is resumed
        stage.move(TARGET, 2e-3, 5.0)
        assert_allclose(stage.where(), TARGET)


def test_a_move_that_takes_too_long_is_stopped(fake) -> None:
    fake.share = 50.0
    with GrblStage(fake.port) as stage:
        with pytest.raises(SourceError, match=r"within 0\.1 s and was stopped"):
            stage.move(TARGET, 1e-3, 0.1)
        time.sleep(0.05)
        here = fake.world.place
        time.sleep(0.1)
        assert_allclose(fake.world.place, here, atol=0)


@pytest.mark.parametrize(
    ("code", "message"),
    [("15", "beyond its travel"), ("9", "locked by an alarm"), ("22", "GRBL error 22")],
)
def test_a_refused_move_says_why(fake, code, message) -> None:
    with GrblStage(fake.port) as stage:
        fake.refuse(code)
        with pytest.raises(SourceError, match=message):
            stage.move(TARGET, 1e-3, 1.0)


def test_a_stage_that_is_silent_in_alarm_or_gone_is_refused(fake) -> None:
    fake.state = "Alarm"
    with pytest.raises(SourceError, match=r"in alarm .* home the stage"):
        GrblStage(fake.port)
    fake.state = "Idle"
    with GrblStage(fake.port) as stage:
        fake.silent = True
        with pytest.raises(SourceError, match=r"has not answered within 2 s"):
            stage.where()
        fake.close()
        with pytest.raises(SourceError, match=r"is gone: is its cable plugged in"):
            stage.where()


@pytest.mark.parametrize("url", ["tcp://x", "serial://", "serial:///dev/x?speed=1"])
def test_urls_of_no_stage_are_refused(url) -> None:
    with pytest.raises(ArgumentError, match=r"stage must be serial://PORT, with the options baud"):
        open_stage(url)


def test_absurd_moves_are_refused(fake) -> None:
    with GrblStage(fake.port) as stage:
        with pytest.raises(ArgumentError, match=r"target must be three finite"):
            stage.move(np.array([0.0, np.nan, 0.0]), 1e-3, 1.0)
        with pytest.raises(ArgumentError, match=r"speed must be positive"):
            stage.move(TARGET, 0.0, 1.0)
    with pytest.raises(ArgumentError, match=r"baud of the stage must be"):
        open_stage("serial:///dev/x?baud=fast")
    with pytest.raises(SourceError, match=r"cannot be opened"):
        open_stage("serial:///dev/no-such-port")
