"""What `smoskin run` prints, tells at the end, and fails by."""

import json

import pytest

from smoskin.design.document import read_design
from smoskin.records import Reading
from smoskin.service.recorder import Recorder
from smoskin.service.recording import open_recording
from smoskin.twin.reduced import ReducedTwin

pytest.importorskip("typer")

from typer.testing import CliRunner

from smoskin.cli import app


@pytest.fixture
def recording(tmp_path):
    design = read_design("optimised")
    rest = ReducedTwin(design).read([]).field
    with Recorder(tmp_path / "own.mcap", design) as recorder:
        for k in range(40):
            recorder.write(Reading(time=0.01 * k, field=rest))
    return tmp_path / "own.mcap"


def run(*arguments):
    return CliRunner().invoke(app, ["run", *map(str, arguments)])


def test_a_recording_needs_no_design_and_ends_in_a_summary(recording):
    done = run(f"replay:{recording}?speed=max", "--strict")
    assert done.exit_code == 0, done.stderr
    assert len(done.stdout.splitlines()) == 40
    assert done.stderr.startswith("40 readings: 20 NO_CONTACT, 20 NOT_CALIBRATED; 0 touches; ")
    few = run(f"replay:{recording}?speed=max", "--changes", "--json")
    assert len(few.stdout.splitlines()) == 2
    assert json.loads(few.stderr)["summary"]["readings"] == 40
    assert run(f"replay:{recording}?speed=max", "--quiet").stdout == ""
    other = run(f"replay:{recording}?speed=max", "--design", "planar")
    assert "must be of the design 'planar'" in str(other.exception)


def test_a_cut_recording_is_told_and_fails_when_strict(recording):
    recording.write_bytes(recording.read_bytes()[:-900])
    done = run(f"replay:{recording}?speed=max", "--quiet")
    assert done.exit_code == 0
    assert "own.mcap is not whole" in done.stderr
    assert run(f"replay:{recording}?speed=max", "--quiet", "--strict").exit_code == 1


def test_skins_are_served_recorded_and_told_of(recording, tmp_path):
    out = tmp_path / "again"
    sources = [f"{name}=replay:{recording}?speed=max" for name in ("left", "right")]
    options = [
        "--feed",
        "0",
        "--foxglove",
        "0",
        "--record",
        str(out),
        "--log",
        str(tmp_path / "log"),
        "--json",
    ]
    done = CliRunner().invoke(app, ["serve", *sources, *options])
    assert done.exit_code == 0, done.stderr
    assert "Touches of left, right at ws://127.0.0.1:" in done.stderr
    assert done.stderr.count("ws://127.0.0.1:") == 2
    counters = json.loads(done.stdout.splitlines()[-1])
    assert {name: counts["readings"] for name, counts in counters.items()} == {
        "left": 40,
        "right": 40,
    }
    assert len(list(open_recording(out / "left.mcap"))) == 40
    assert "40 readings" in (tmp_path / "log").read_text()
    refused = CliRunner().invoke(app, ["serve", "a=replay:a.mcap", "a=replay:b.mcap"])
    assert "names of skins must differ; got 'a' twice" in str(refused.exception)
