"""`smoskin sweep`: data sets that go on where they stopped, and what one holds."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from typer.testing import CliRunner

from chunk_work import contents
from smoskin.cli import app
from smoskin.commands.sweep import plan_sweep, run_sweep, summarise
from smoskin.datasets.patterns import Grid, Pairs, Random, sideways
from smoskin.datasets.store import open_dataset
from smoskin.datasets.workers import Engine
from smoskin.errors import ArgumentError, RecordingError
from smoskin.mechanics.sheet.touches import Sliding
from smoskin.records import Contact
from smoskin.twin.whole import Twin

PROGRAM = [sys.executable, "-c", "from smoskin.cli import main; main()", "sweep"]
GRID = ["--places", "3x4", "--forces", "0.1:0.4:4", "--chunk", "5", "--mechanics", "reduced"]


def sweep(*arguments, code=0):
    """The command's standard output, or its error."""
    done = CliRunner().invoke(app, ["sweep", *map(str, arguments)])
    assert done.exit_code == code, done.output
    return str(done.exception) if done.exception and not done.stdout else done.stdout


def plan(kind, **options):
    return plan_sweep(kind, options).presses


def test_sweeps_are_written_in_words():
    tenths = tuple(k / 10 for k in range(1, 11))
    assert plan("grid") == Grid(forces=tenths)
    assert plan("grid", forces="0.1:1.0:10", places="5x7", radius="3") == Grid(
        forces=tenths, places=(5, 7), radius=3e-3
    )
    assert plan("shear", forces="0.5", drags="0.1,0.3", directions="4") == Grid(
        forces=(0.5,), drags=sideways([0.1, 0.3], 4)
    )
    assert plan("pairs", forces="0.2", places="2x2") == Pairs(forces=(0.2,), places=(2, 2))
    assert plan("random", count="50", touches="1:2", drags="0:0.2", margin="5", radius="2:4") == (
        Random(count=50, touches_at_once=(1, 2), drags=(0.0, 0.2), margin=5e-3,
               radius=(2e-3, 4e-3))
    )  # fmt: skip
    sweep = plan_sweep("grid", {}, temperatures="25,45", skins=3, grip="sliding:0.4", seed=2,
                       presses_per_chunk=9)  # fmt: skip
    assert (sweep.temperatures, sweep.skins, sweep.seed) == ((25.0, 45.0), (0, 1, 2), 2)
    assert (sweep.grip, sweep.presses_per_chunk) == (Sliding(friction=0.4), 9)
    assert plan_sweep("grid", {}).chunks == 33
    everything = plan_sweep("pairs", {})
    assert everything.rows == 68_062_500
    assert 3500 < everything.chunks <= 4096


@pytest.mark.parametrize(
    ("act", "reason"),
    [
        (lambda: plan("grid", count="5"), "count is no option of a grid sweep, which takes forces"),
        (lambda: plan("random"), "count must be given for a random sweep"),
        (lambda: plan("random", count="many"), "count must be a whole number; got 'many'"),
        (lambda: plan("random", count="5", margin="wide"), "margin must be a number or from:to"),
        (lambda: plan("grid", places="25"), "places must be two numbers such as 25x33; got '25'"),
        (lambda: plan("grid", forces="60"), "forces must lie in 0..50 N; got 60"),
        (lambda: plan("grid", forces="0.1:1"), "forces must be numbers such as 0.1,0.5"),
        (lambda: plan_sweep("grid", {}, temperatures="25,99"), "temperatures must lie in -40..75"),
    ],
)
def test_words_that_mean_nothing_are_refused(act, reason):
    with pytest.raises(ArgumentError) as refused:
        act()
    assert reason in str(refused.value)


def test_the_command_sweeps_resumes_and_exports(tmp_path):
    pytest.importorskip("h5py")
    whole = json.loads(sweep(*GRID, "--workers", 2, "--out", tmp_path / "whole", "--json"))
    assert (whole["rows"], whole["chunks"], whole["invalid_rows"]) == (48, 10, 0)
    assert (whole["missing_rows"], whole["damaged_chunks"]) == (0, 0)
    broken = tmp_path / "broken"
    process = subprocess.Popen([*PROGRAM, *GRID, "--out", str(broken)], stdout=subprocess.PIPE)
    try:
        end = time.monotonic() + 60
        while len(list(broken.glob("chunk-*.h5"))) < 3:
            assert time.monotonic() < end
            time.sleep(0.002)
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    one_file = tmp_path / "one.h5"
    lines = sweep(*GRID, "--out", broken, "--export", one_file)
    assert "48 rows in 10 chunks" in lines
    assert f"in one file: {one_file}" in lines
    assert contents(broken) == contents(tmp_path / "whole")
    refused = CliRunner().invoke(app, ["sweep", *GRID, "--seed", "1", "--out", str(broken)])
    assert isinstance(refused.exception, RecordingError)
    message = "another sweep: seed is 0 there and 1 here; use another folder"
    assert message in str(refused.exception)


def test_a_summary_tells_what_is_missing_and_damaged(planar, tmp_path):
    pytest.importorskip("h5py")
    plan = plan_sweep(
        "grid", {"places": "4x4", "forces": "0.3"}, mechanics="reduced", presses_per_chunk=5
    )
    folder = tmp_path / "set"
    made = run_sweep(planar, plan, folder, engine=Engine(1))
    assert made.sound
    assert summarise(folder) == made
    summary = json.loads(sweep("--summary", folder, "--json"))
    assert summary == made.as_json()
    assert summary["design_hash"] == planar.content_hash
    assert summary["sweep"]["presses"]["places"] == [4, 4]
    assert "missing" not in sweep("--summary", folder)
    (folder / "chunk-000001.h5").unlink()
    last = folder / "chunk-000003.h5"
    last.write_bytes(last.read_bytes() + b"0")
    lines = sweep("--summary", folder, code=1)
    assert "missing rows: 6; damaged chunks: 1; repeat the sweep" in lines
    summary = json.loads(sweep("--summary", folder, "--json", code=1))
    assert (summary["missing_rows"], summary["damaged_chunks"]) == (6, 1)
    assert run_sweep(planar, plan, folder, engine=Engine(1)).sound
    assert json.loads(sweep("--summary", folder, "--json"))["damaged_chunks"] == 0


def test_the_folder_has_a_name_by_default(tmp_path, monkeypatch):
    pytest.importorskip("h5py")
    monkeypatch.chdir(tmp_path)
    words = ["--kind", "shear", "--places", "2x2", "--forces", "0.3", "--mechanics", "reduced"]
    summary = json.loads(sweep(*words, "--workers", 1, "--json"))
    assert summary["path"] == "planar-shear"
    assert open_dataset("planar-shear").complete


@pytest.mark.slow
def test_the_whole_sheet_fills_a_set_bit_for_bit(planar, tmp_path):
    """Made skins, warm and cold, with drags: one worker, two workers, and a killed one."""
    pytest.importorskip("jax")
    pytest.importorskip("h5py")
    sweep = plan_sweep(
        "random",
        {"count": "40", "touches": "1:2", "drags": "0:0.2"},
        temperatures="25,45",
        skins=2,
        presses_per_chunk=16,
    )
    sets = [
        run_sweep(planar, sweep, tmp_path / str(workers), engine=Engine(workers)).dataset
        for workers in (1, 2)
    ]
    process = subprocess.Popen(
        [*PROGRAM, "--kind", "random", "--count", "40", "--touches", "1:2", "--drags", "0:0.2",
         "--temperature", "25,45", "--skins", "2", "--chunk", "16", "--out",
         str(tmp_path / "killed")]
    )  # fmt: skip
    try:
        end = time.monotonic() + 120
        while len(list((tmp_path / "killed").glob("chunk-*.h5"))) < 4:
            assert time.monotonic() < end
            time.sleep(0.01)
    finally:
        process.kill()
        process.wait()
    assert not open_dataset(tmp_path / "killed").complete
    sets.append(run_sweep(planar, sweep, tmp_path / "killed").dataset)
    images = [contents(dataset.path) for dataset in sets]
    assert images[0] == images[1] == images[2]
    field = sets[0].column("field_T")
    assert np.isfinite(field[sets[0].column("valid")]).all()
    assert sets[0].column("valid").mean() > 0.95
    skin = sets[0].column("skin_seed")
    # Rows far apart, one by one: the live way through the twin, with its own tolerance.
    for row in (5, 70, 130):
        touches = zip(sets[0].column("position_m")[row], sets[0].column("force_N")[row],
                      strict=True)  # fmt: skip
        contacts = [Contact(position=p, force=f) for p, f in touches if f.any()]
        twin = Twin(planar, seed=int(skin[row]), manufactured=True)
        degrees = float(sets[0].column("temperature_degC")[row])
        motion = twin.motion(contacts, temperature=degrees)
        assert twin.field(motion, degrees) == pytest.approx(field[row], rel=1e-4, abs=1e-8)
    assert abs(field[skin == 0].mean() - field[skin == 1].mean()) > 1e-6
