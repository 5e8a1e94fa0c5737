"""What is learned with its past: a rig's recording and the table that it is converted to."""

import json

import numpy as np
import pytest

pytest.importorskip("typer")
pytest.importorskip("mcap")

from typer.testing import CliRunner

from smoskin.cli import app
from smoskin.commands.learn import read_course
from smoskin.errors import RecordingError
from smoskin.records import Contact, HeldTouch, Reading, Trace
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, load_model
from smoskin.service.exchange import export_recording
from smoskin.service.kept import Campaign
from touch_recordings import DESIGN

SPAN = 6.0
"""Seconds of a touch, the first of them at rest."""
RATE = 10.0


def touch(k):
    """A press that rises and falls, felt by a gauge at 40 Hz; the board's fields drift."""
    begin, peak = SPAN * k, 0.3 + 0.1 * (k % 4)
    times, gauge = begin + np.arange(0, SPAN, 1 / RATE), begin + np.arange(0, SPAN, 0.025)

    def force(time):
        return peak * np.sin(np.pi * np.clip((time - begin - 1) / (SPAN - 1), 0, 1)) ** 2

    shape = np.random.default_rng(7).normal(size=(3, 3))
    readings = [
        Reading(time=t, field=5e-3 + 1e-5 * k + 1e-3 * force(t) * shape, flags=[0] * 3)
        for t in times
    ]
    pressed = np.column_stack([gauge, 0 * gauge, 0 * gauge, -force(gauge)])
    stage = np.column_stack([times, np.tile([0.03, 0.04, 0.0], (len(times), 1))])
    return HeldTouch(
        contact=Contact(position=(0.03, 0.04), force=(0.0, 0.0, -peak)),
        readings=tuple(readings),
        rest=(begin, begin + 0.95),
        held=(begin + 3.4, begin + 3.6),
        trace=Trace(
            gauge=pressed, stage=stage,
            phases=[("rest", begin, begin + 0.99), ("press", begin + 1.0, begin + SPAN)],
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("learn") / "pad.mcap"
    with Campaign(path, DESIGN) as campaign:
        for k in range(12):
            campaign.add(touch(k))
    return path


def test_fields_count_from_the_rest_before_and_forces_are_the_gauges(recording):
    course = read_course(recording)
    known = np.isfinite(course.force).all(axis=1)
    assert known.mean() > 0.95
    shape = np.random.default_rng(7).normal(size=(3, 3))
    expected = -1e-3 * course.force[known, 2, None, None] * shape
    # Between the gauge's samples the force is on a straight line.
    np.testing.assert_allclose(course.field[known], expected, atol=2e-7)


def test_a_table_gives_the_course_of_its_recording(recording, tmp_path):
    export_recording(recording, tmp_path / "pad.csv")
    recorded, exported = read_course(recording), read_course(tmp_path / "pad.csv")
    for name in ("time", "field", "force", "position"):
        np.testing.assert_array_equal(getattr(recorded, name), getattr(exported, name))


def table(path, rows, head="time_s,chip0_x_T,chip0_y_T,chip0_z_T,gauge_Fz_N"):
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def test_a_users_own_table_needs_times_fields_and_the_force(tmp_path):
    rows = [f"{t},{1e-3 + 1e-5 * t},0,0,{-t if t > 2 else 0}" for t in range(6)]
    course = read_course(table(tmp_path / "own.csv", [*rows, "5,0,0,0,-1", "7,,0,0,-1"]))
    assert course.time.tolist() == [0, 1, 2, 3, 4, 5]  # no time that stays, no field that is gone
    np.testing.assert_allclose(course.field[:, 0, 0], 1e-5 * (np.arange(6) - 1.0), atol=1e-12)
    assert not course.force[:, :2].any()
    assert course.force[5, 2] == -5


@pytest.mark.parametrize(
    ("head", "row", "words"),
    [
        ("time_s,chip0_x_T,chip0_y_T,chip0_z_T", "0,0,0,0", "a column gauge_Fz_N"),
        ("time_s,gauge_Fz_N", "0,0", "a column chip0_x_T"),
        ("time_s,chip0_x_T,chip0_y_T,chip0_z_T,gauge_Fz_N", "0,0,0,x,0", "line 2: could not"),
        ("time_s,chip0_x_T,chip0_y_T,chip0_z_T,gauge_Fz_N", "0,0,0", "line 2: .* as many columns"),
        ("time_s,chip0_x_T,chip0_y_T,chip0_z_T,gauge_Fz_N", "0,0,0,0,", "forces of a gauge"),
        ("time_s,chip0_x_T,chip0_y_T,chip0_z_T,gauge_Fz_N", "0,0,0,0,-1", "begin with readings"),
    ],
)
def test_a_table_that_cannot_be_learned_says_why(tmp_path, head, row, words):
    with pytest.raises(RecordingError, match=words):
        read_course(table(tmp_path / "bad.csv", [row], head))


def test_the_command_learns_a_recording_that_then_runs(recording, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["learn", str(recording), "--past", "--test", str(recording), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    figures = json.loads(done.stdout)
    assert figures["later_rmse_fz_N"] < 0.05
    assert figures["test"]["rmse_fz_N"] < 0.02
    estimator = LearnedEstimator(load_model("own.model"), np.full((3, 3), 5e-3))
    estimates = [estimator.step(reading) for reading in touch(0).readings]
    middle = estimates[len(estimates) * 7 // 12]
    assert middle.contacts[0].normal_force == pytest.approx(0.3, abs=0.03)
    words += ["--force", "--recording", str(recording)]
    refused = CliRunner().invoke(app, words)
    assert refused.exit_code == 2
