"""What `smoskin follow --headless --json` prints, and the exit code by which it tells."""

import json
from types import SimpleNamespace

import pytest

from smoskin.commands.follow import demonstration, live
from smoskin.commands.follow.demonstration import Demonstration, FollowSummary
from smoskin.errors import RecordingError

pytest.importorskip("typer")

from typer.testing import CliRunner

from smoskin.cli import app

KEPT = {
    "touches": 8,
    "moved_below_0_40_N": 0,
    "still_above_0_60_N": 0,
    "direction_error_deg_max": 1.0,
    "limit_violations": 0,
    "faults": 0,
    "stop_ms_max": 0.0,
    "rate_hz": 900.0,
}


@pytest.mark.parametrize(
    ("broken", "code"),
    [
        ({}, 0),
        ({"touches": 0}, 1),
        ({"moved_below_0_40_N": 1}, 1),
        ({"still_above_0_60_N": 1}, 1),
        ({"direction_error_deg_max": 10.1}, 1),
        ({"limit_violations": 1}, 1),
        ({"faults": 1}, 1),
        ({"stop_ms_max": 30.0}, 1),
        ({"rate_hz": 99.0}, 1),
    ],
)
def test_the_summary_has_its_keys_and_a_broken_promise_is_the_exit_code(monkeypatch, broken, code):
    figures = KEPT | broken
    demo = Demonstration(touches=(), summary=FollowSummary(**figures), asked_hz=100.0)
    monkeypatch.setattr(demonstration, "demonstrate", lambda *args, **options: demo)
    done = CliRunner().invoke(app, ["follow", "--headless", "--json"])
    assert done.exit_code == code, done.stderr
    assert json.loads(done.stdout)["summary"] == figures
    slow = "This machine can only turn 99 of 100 readings a second."
    assert (slow in done.stderr) == (figures["rate_hz"] < 100.0)


def test_it_is_told_what_to_record_and_a_recording_that_is_not_whole(monkeypatch, tmp_path):
    file = tmp_path / "follow.mcap"
    reason = f"{file} cannot be written: No space left on device; nothing more is recorded"
    summary = FollowSummary(**KEPT)
    for headless, failure in ((True, ""), (True, reason), (False, ""), (False, reason)):
        asked = {}

        def demonstrate(design, asked=asked, failure=failure, **options):
            asked.update(options)
            return Demonstration(touches=(), summary=summary, not_recorded=failure)

        def follow_source(url, design, asked=asked, failure=failure, **options):
            asked.update(options)
            if failure:
                raise RecordingError(failure)
            return SimpleNamespace(readings=6, rate=100.0)

        monkeypatch.setattr(demonstration, "demonstrate", demonstrate)
        monkeypatch.setattr(live, "follow_source", follow_source)
        words = ["follow", "--record", str(file), "--force", *["--headless"] * headless]
        done = CliRunner().invoke(app, words)
        assert (asked["record"], asked["force"]) == (file, True)
        assert done.exit_code == (1 if failure else 0)
        assert failure in done.stderr or failure in str(done.exception)
