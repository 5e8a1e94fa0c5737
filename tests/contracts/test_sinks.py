"""What every sink promises, asked of each of them."""

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from smoskin.errors import ArgumentError
from smoskin.feasibility import load_design
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Sink
from smoskin.service.apart.recorder import RecorderApart
from smoskin.service.bridges.feed import Feed
from smoskin.service.bridges.foxglove import Foxglove
from smoskin.service.page.view import View
from smoskin.service.recorder import Recorder

PLANAR = load_design("planar")
TOUCH = Contact(position=(0.045, 0.080), force=(0.1, -0.05, -0.5))


@pytest.fixture(params=["recorder", "recorder apart", "view", "feed", "foxglove"])
def make(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[[], Sink]]:
    if request.param == "recorder":
        pytest.importorskip("mcap")
        yield lambda: Recorder(tmp_path / "touch.mcap", PLANAR)
    elif request.param == "recorder apart":
        pytest.importorskip("mcap")
        more = {"attachments": {}, "on_failure": warnings.warn}
        yield lambda: RecorderApart(tmp_path / "touch.mcap", PLANAR, **more)
    elif request.param == "view":
        pytest.importorskip("viser")
        yield lambda: View(PLANAR)
    else:
        pytest.importorskip("websockets" if request.param == "feed" else "foxglove")
        with Feed() if request.param == "feed" else Foxglove() as server:
            yield lambda: server.add("skin", len(PLANAR.halls), PLANAR)


def reading(time: float, chips: int = 3) -> Reading:
    return Reading(time=time, field=np.zeros((chips, 3)))


def test_readings_are_taken_with_and_without_estimates(make) -> None:
    with make() as sink:
        assert sink.dropped == 0
        sink.write(reading(0.0))
        for k, status in enumerate(Status):
            contacts = (TOUCH, TOUCH) if status is Status.CONTACT else ()
            covariance = np.full((len(contacts), 5, 5), np.nan)
            estimate = Estimate(
                time=0.1 * k, status=status, contacts=contacts, covariance=covariance
            )
            sink.write(reading(0.1 * k), estimate)
        bad = Reading(time=9.0, field=np.full((3, 3), np.nan), flags=[1, 2, 4])
        sink.write(bad, Estimate(time=9.0, status=Status.CHIP_MISSING))
        assert 0 <= sink.dropped <= len(Status) + 2


def test_times_may_go_back(make) -> None:
    with make() as sink:
        for time in (5.0, 4.0, -1e9, 1e9):
            sink.write(reading(time), Estimate(time=time, status=Status.STALE))
        assert 0 <= sink.dropped <= 4


@pytest.mark.parametrize("chips", [0, 2, 4])
def test_another_number_of_chips_is_wrong_use(make, chips) -> None:
    with make() as sink, pytest.raises(ArgumentError, match=f"reading must have .*got {chips}"):
        sink.write(reading(0.0, chips))


def test_closing_may_be_repeated_and_comes_with_the_context(make) -> None:
    with make() as sink:
        sink.write(reading(0.0))
    sink.close()
    sink.close()
    assert sink.dropped in (0, 1)
