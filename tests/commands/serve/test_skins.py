"""Skins side by side: their names, that one's failure is its own, and what is told of them."""

import json
import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from smoskin.commands.serve import skins
from smoskin.commands.serve.log import logged_to
from smoskin.commands.serve.skins import Service, counters_line, wanted_skins
from smoskin.errors import ArgumentError, SourceError
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Sink
from smoskin.service.recording import open_recording
from touch_recordings import record


def test_skins_have_the_names_and_files_that_are_given():
    left, right, third = wanted_skins(
        ["left=twin://planar?seed=1&hand=yes", "right=serial:///dev/ttyACM0", "i2c:///dev/i2c-1"],
        ["left=a=b.table", "all.table"],
        Path("touches"),
        ["all.net", "right=c=d.net"],
    )
    assert (left.name, left.url) == ("left", "twin://planar?seed=1&hand=yes")
    assert (left.calibration, left.record) == (Path("a=b.table"), Path("touches/left.mcap"))
    assert (right.url, right.calibration) == ("serial:///dev/ttyACM0", Path("all.table"))
    assert (third.name, third.url) == ("skin3", "i2c:///dev/i2c-1")
    assert left.estimators == (Path("all.net"),)
    assert right.estimators == (Path("all.net"), Path("c=d.net"))
    (alone,) = wanted_skins(["twin://planar?seed=2"])
    assert (alone.name, alone.calibration, alone.record) == ("skin", None, None)


@pytest.mark.parametrize(
    ("sources", "files", "sentence"),
    [
        ([], [], "sources must be at least one; got none"),
        (["a=twin://planar", "a=twin://curved"], [], "names of skins must differ; got 'a' twice"),
        (["twin://planar"], ["arm=a.table"], "calibration must be of one of skin; got 'arm'"),
        (["twin://planar"], ["a.table", "b.table"], "one calibration; got two of 'all skins'"),
        (["a=twin://planar"], ["a=1", "a=2"], "one calibration; got two of 'a'"),
    ],
)
def test_wrong_names_are_refused(sources, files, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        wanted_skins(sources, files)


def test_an_estimator_is_of_one_of_the_skins():
    with pytest.raises(ArgumentError, match="estimator must be of one of left; got 'x'"):
        wanted_skins(["left=twin://planar"], estimators=["x=a.net"])


class Given:
    """A bridge of sinks by the names of their skins."""

    def __init__(self, **sinks: Sink) -> None:
        self._sinks = sinks

    def add(self, name: str, *known: Any, **doors: Any) -> Sink:
        return self._sinks[name]


class Kept(Sink):
    """Counts what it is given, and does something each time."""

    def __init__(self, does: Callable[[], object] = lambda: None) -> None:
        self.written, self._does = 0, does

    def write(self, reading: Reading, estimate: Estimate | None = None) -> None:
        self.written += 1
        self._does()

    def close(self) -> None:
        pass


def failing(error: Exception) -> Callable[[], object]:
    def fail() -> None:
        raise error

    return fail


def test_a_skin_that_fails_leaves_the_others_alone(tmp_path, caplog):
    path = record(tmp_path / "touch.mcap", 6)
    sinks = {
        "good": Kept(),
        "lost": Kept(failing(SourceError("the board is gone"))),
        "bug": Kept(failing(ZeroDivisionError("by zero"))),
    }
    wanted = wanted_skins([f"{name}=replay:{path}" for name in sinks])
    with Service(wanted, [Given(**sinks)]) as service:
        assert list(service.run(seconds=30.0)) == []  # they ended before the first report
        counters = service.counters()
    assert service.failures == {
        "lost": "the board is gone",
        "bug": "a bug: ZeroDivisionError: by zero",
    }
    assert {name: counts["state"] for name, counts in counters.items()} == {
        "good": "ended",
        "lost": "failed",
        "bug": "failed",
    }
    assert sinks["good"].written == counters["good"]["readings"] == 6
    stages = counters["good"]["stages_ms"]
    assert 0.0 < stages["estimate"]["median"] <= stages["estimate"]["p999"]
    assert counters["good"]["statuses"][Status.NOT_CALIBRATED.name] == 6
    json.dumps(counters, allow_nan=False)
    assert counters_line(counters).startswith("good ended, 6 readings")
    assert "lost ended: the board is gone" in caplog.text


def test_a_skin_whose_estimates_stop_counts_as_silent(tmp_path, monkeypatch, caplog):
    caplog.set_level(logging.INFO)
    monkeypatch.setattr(skins, "_SILENT", 0.05)
    go = threading.Semaphore(3)
    path = record(tmp_path / "touch.mcap", 6)
    sink = Kept(lambda: go.acquire(timeout=10.0))
    states = []
    with Service(wanted_skins([f"replay:{path}"]), [Given(skin=sink)]) as service:
        for counters in service.run(seconds=20.0, every=0.01):
            states.append(counters["skin"]["state"])
            if states[-1] == "silent":
                go.release(10)
    assert states[-1] == "silent" or "silent" in states
    assert "skin gives no estimates for 0.05 s" in caplog.text
    assert service.failures == {}


def test_a_service_that_is_ended_records_what_was_read(tmp_path):
    """Sinks are closed behind the reading that the loop is at, not under it."""
    path, kept = record(tmp_path / "touch.mcap", 200), tmp_path / "kept"
    kept.mkdir()
    slow = Kept(lambda: time.sleep(0.005))
    wanted = wanted_skins([f"replay:{path}?speed=max"], folder=kept)
    with Service(wanted, [Given(skin=slow)]) as service:
        next(service.run(every=0.05))
    counters = service.counters()["skin"]
    assert service.failures == {}
    assert 0 < counters["readings"] < 200
    recording = open_recording(kept / "skin.mcap")
    assert not recording.damage
    assert len(list(recording)) == counters["readings"] == slow.written


def test_one_that_cannot_be_opened_closes_what_was(tmp_path):
    path = record(tmp_path / "touch.mcap", 6)
    before = threading.active_count()
    closed = []

    class Closing(Kept):
        def close(self) -> None:
            closed.append(True)

    with pytest.raises(SourceError, match=r"nowhere\.mcap"):
        Service(
            wanted_skins([f"replay:{path}", f"replay:{tmp_path / 'nowhere.mcap'}"]),
            [Given(skin1=Closing())],
        )
    assert closed
    assert threading.active_count() == before


def test_the_log_is_lines_of_json(tmp_path):
    log = logging.getLogger("smoskin.somewhere")
    with logged_to(tmp_path / "log.jsonl"):
        log.info("%d readings", 3)
        try:
            raise ValueError("odd")
        except ValueError:
            log.exception("a bug\nof two lines")
    log.error("not there")
    first, second = map(json.loads, (tmp_path / "log.jsonl").read_text().splitlines())
    assert first["level"] == "info"
    assert (first["logger"], first["message"]) == ("smoskin.somewhere", "3 readings")
    assert first["time"].endswith("+00:00")
    assert "error" not in first
    assert "ValueError: odd" in second["error"]
    assert time.strftime("%Y") in first["time"]
