"""`smoskin simulate`: a press in words, and sweeps that go on where they stopped."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from rich.console import Console

from chunk_work import contents
from smoskin.cli import main
from smoskin.commands.simulate import (
    parse_engine,
    parse_grip,
    parse_numbers,
    plan_sweep,
    run_sweep,
    simulate_press,
)
from smoskin.datasets.patterns import Grid, Pairs, Random, sideways
from smoskin.datasets.store import open_dataset
from smoskin.datasets.workers import LocalEngine
from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Covered, Frictionless, Sliding, Sticking
from smoskin.records import Contact
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

PROGRAM = [sys.executable, "-c", "from smoskin.cli import main; main()", "simulate"]


@pytest.fixture
def simulate(monkeypatch, capsys):
    """The command: its standard output, or standard error where it must fail."""

    def call(*arguments, code=0):
        monkeypatch.setattr(sys, "argv", ["smoskin", "simulate", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        if code == 0:
            assert ended.value.code == 0, ended.value.code
            return said.out
        assert isinstance(ended.value.code, str)  # which leaves with 1 and this on standard error
        return ended.value.code

    return call


def test_a_press_of_the_reduced_model_is_told_in_the_units_of_people(planar):
    report = simulate_press(planar, ["45,80"], ["0,0,-0.5"], mechanics="reduced")
    told = json.loads(json.dumps(report.as_json()))
    (touch,) = told["touches"]
    assert (touch["at_mm"], touch["force_N"]) == ([45.0, 80.0], [0.0, 0.0, -0.5])
    twin = ReducedTwin(planar, seed=0)
    contact = Contact(position=(0.045, 0.080), force=(0.0, 0.0, -0.5))
    moved = twin.motion([contact]).magnets[1, :3] * 1e3
    assert told["magnets"][1]["shift_mm"] == pytest.approx(moved.tolist(), rel=1e-8)
    field = twin.field(twin.motion([contact]))
    assert told["chips"][2]["field_mT"] == pytest.approx((field[2] * 1e3).tolist())
    assert told["chips"][2]["reading_mT"] == (
        pytest.approx((twin.read([contact]).field[2] * 1e3).tolist())
    )
    assert told["valid"]
    assert 0.01 < touch["depth_mm"] < 0.3
    console = Console(width=120)
    with console.capture() as said:
        for table in report.tables():
            console.print(table)
    for words in ("45.0, 80.0", "0.000, 0.000, -0.500", "M3", "S1", "good"):
        assert words in said.get()


def test_a_press_of_the_whole_sheet(planar):
    pytest.importorskip("jax")
    report = simulate_press(
        planar, ["45,80", "90,40"], ["0,0,-0.5", "0.1,0,-0.3"], temperature=40.0
    )
    assert report.valid
    assert (report.depths > 5e-5).all()
    assert (report.depths < 5e-4).all()
    board = report.as_json()["board"]
    assert 0 < board["shift_mm"][0] < 1
    twice = simulate_press(planar, ["45,80"], ["0,0,-0.5"], manufactured=True, seed=3)
    other = simulate_press(planar, ["45,80"], ["0,0,-0.5"], manufactured=True, seed=4)
    assert not np.allclose(twice.field, other.field, rtol=1e-6)


def test_a_press_without_an_equilibrium_says_so(planar):
    pytest.importorskip("jax")
    report = simulate_press(planar, ["60,80"], ["0,0,-45"])
    told = report.as_json()
    assert not told["valid"]
    assert told["chips"][0]["field_mT"] == [None] * 3
    assert told["chips"][0]["flags"] == ["INVALID"]


@pytest.mark.parametrize(
    ("at", "force", "more", "said"),
    [
        (["130,80"], ["0,0,-1"], {}, "must lie on the skin"),
        (["45,80"], ["0,0,1"], {}, "force must be finite and press"),
        (["45,80"], ["0,0,-51"], {}, "force must lie within 50 N; got [0.0, 0.0, -51.0] N"),
        (["45,80"], ["0,0,nan"], {}, "force must lie within 50 N"),
        (["45"], ["0,0,-1"], {}, "at must be 2 numbers with commas; got '45'"),
        (["45,80"], ["0,0,down"], {}, "force must be 3 numbers with commas; got '0,0,down'"),
        (["45,80"], [], {}, "every touch needs both at and force; got 1 and 0"),
        (["45,80"], ["0,0,-1"], {"temperature": 120.0}, "temperature must lie in -40..75 degC"),
        (["45,80"], ["0,0,-1"], {"grip": "glue"}, "grip must be sticking, frictionless"),
        (["45,80"], ["0,0,-1"], {"manufactured": True}, "know neither grip nor manufactured"),
    ],
)
def test_presses_that_cannot_be_are_refused(planar, at, force, more, said):
    with pytest.raises(ArgumentError) as refused:
        simulate_press(planar, at, force, mechanics="reduced", **more)
    if "grip" not in more:
        assert said in str(refused.value)


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
    ("act", "said"),
    [
        (lambda: plan("grid", count="5"), "count is no option of a grid sweep, which takes forces"),
        (lambda: plan("random"), "count must be given for a random sweep"),
        (lambda: plan("random", count="many"), "count must be a whole number; got 'many'"),
        (lambda: plan("random", count="5", margin="wide"), "margin must be a number or from:to"),
        (lambda: plan("grid", places="25"), "places must be two numbers such as 25x33; got '25'"),
        (lambda: plan("grid", forces="60"), "forces must lie in 0..50 N; got 60"),
        (lambda: plan("grid", forces="0.1:1"), "forces must be numbers such as 0.1,0.5"),
        (lambda: plan_sweep("grid", {}, temperatures="25,99"), "temperatures must lie in -40..75"),
        (lambda: parse_grip("sliding"), "grip must be sticking, frictionless, covered or sliding:"),
        (lambda: parse_grip("sliding:-1"), "friction must be finite and >= 0; got -1.0"),
        (lambda: parse_grip("covered:1"), "grip must be sticking"),
        (lambda: parse_engine("local", 2, "tcp://here:1"), "scheduler is an option of the dask"),
        (lambda: parse_engine("dask", 2, "tcp://here:1"), "workers must be left out"),
    ],
)
def test_words_that_mean_nothing_are_refused(act, said):
    with pytest.raises(ArgumentError) as refused:
        act()
    assert said in str(refused.value)


def test_numbers_and_grips_in_words():
    assert parse_numbers("forces", "0.5") == (0.5,)
    assert parse_numbers("forces", "0.1:1:10") == tuple(k / 10 for k in range(1, 11))
    assert parse_grip(None) == parse_grip("sticking") == Sticking()
    assert (parse_grip("frictionless"), parse_grip("covered")) == (Frictionless(), Covered())
    assert parse_engine("local", 2, None).name == "local, 2 workers"
    assert parse_engine("dask", None, "tcp://here:1").name == "dask, tcp://here:1"


def test_the_command_presses_once(simulate):
    told = json.loads(simulate("planar", "--at", "45,80", "--force", "0.1,0,-0.5",
                               "--mechanics", "reduced", "--json"))  # fmt: skip
    assert told["touches"][0]["force_N"] == [0.1, 0.0, -0.5]
    assert simulate("--at", "45,80", code=1).startswith("error: every touch needs both")
    assert "--at and --force for one press" in simulate(code=1)
    assert "--at and --force for one press" in simulate("--at", "1,1", "--places", "2x2", code=1)
    assert "at one temperature" in simulate("--at", "1,1", "--temperature", "25,35", code=1)
    assert "a sweep must be given --out" in simulate("--sweep", "grid", code=1)


def test_the_command_sweeps_resumes_and_exports(simulate, tmp_path):
    pytest.importorskip("h5py")
    words = ["planar", "--sweep", "grid", "--places", "6x7", "--forces", "0.1:0.6:6", "--chunk",
             "10", "--mechanics", "reduced", "--workers", "2"]  # fmt: skip
    whole = json.loads(simulate(*words, "--out", str(tmp_path / "whole"), "--json"))
    assert (whole["rows"], whole["chunks"], whole["invalid_rows"]) == (252, 26, 0)
    broken = tmp_path / "broken"
    process = subprocess.Popen([*PROGRAM, *words, "--out", str(broken)], stdout=subprocess.PIPE)
    try:
        end = time.monotonic() + 60
        while len(list(broken.glob("chunk-*.h5"))) < 3:
            assert time.monotonic() < end
            time.sleep(0.002)
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    one_file = tmp_path / "one.h5"
    said = simulate(*words, "--out", str(broken), "--export", str(one_file))
    assert "252 rows in 26 chunks" in said
    assert f"in one file: {one_file}" in said
    names = sorted(one.name for one in broken.glob("chunk-*"))
    assert len(names) == 26
    assert contents(broken) == contents(tmp_path / "whole")
    message = simulate(*words, "--seed", "1", "--out", str(broken), code=1)
    assert "another sweep: seed is 0 there and 1 here; use another folder" in message
    assert "\n" not in message


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
        run_sweep(planar, sweep, tmp_path / str(workers), engine=LocalEngine(workers)).dataset
        for workers in (1, 2)
    ]
    process = subprocess.Popen(
        [*PROGRAM, "--sweep", "random", "--count", "40", "--touches", "1:2", "--drags", "0:0.2",
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
    images = [contents(one.path) for one in sets]
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
