"""What `smoskin follow --headless --json` prints, and the exit code by which it tells."""

import json

import pytest

from smoskin.commands.follow import demonstration
from smoskin.commands.follow.demonstration import Demonstration, FollowSummary

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
    ],
)
def test_the_summary_has_its_keys_and_a_broken_promise_is_the_exit_code(monkeypatch, broken, code):
    told = KEPT | broken
    found = Demonstration(touches=(), summary=FollowSummary(**told))
    monkeypatch.setattr(demonstration, "demonstrate", lambda *args, **options: found)
    done = CliRunner().invoke(app, ["follow", "--headless", "--json"])
    assert done.exit_code == code, done.stderr
    assert json.loads(done.stdout)["summary"] == told
