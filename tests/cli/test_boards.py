"""Commands for boards of one's own: each option reaches the work, and what comes next is told."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("typer")

from typer.testing import CliRunner

import rigs
from smoskin.cli import app
from smoskin.measurement import TouchTable, read_touches, write_touches
from smoskin.sensing.learned.gaussian_process import Metric
from smoskin.service.guided import grid_plan


class Worked:
    """Stands for a piece of work: takes note of what it was asked."""

    def __init__(self, result=None):
        self.result = result

    def __call__(self, *asked, **options):
        self.asked, self.options = asked, options
        return self.result


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def invoke(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def touches(count=3):
    place = np.linspace((0.005, 0.01), (0.02, 0.03), count)
    return TouchTable(
        position=place, force=np.tile([0.0, 0.0, -0.5], (count, 1)), field=np.zeros((count, 0, 3))
    )


def test_a_grid_is_written_as_asked(monkeypatch, folder):
    import smoskin.service.guided as work

    plan = Worked(touches())
    monkeypatch.setattr(work, "grid_plan", plan)
    words = "--width-mm 40 --height-mm 20 --count 7 --force-N 0.3 --seed 2 --out wide.csv"
    done = invoke("touches", "grid", *words.split())
    assert done.exit_code == 0, done.output
    assert plan.asked == pytest.approx((0.04, 0.02, 7))
    assert plan.options == {"force": 0.3, "seed": 2}
    assert done.stdout == "3 touches\n"
    assert done.stderr.endswith(
        "Now: smoskin touches record SOURCE --plan wide.csv --out touches.csv\n"
    )
    np.testing.assert_allclose(read_touches(folder / "wide.csv")[0].position, touches().position)
    assert invoke("touches", "grid", *words.split()).exit_code != 0
    assert invoke("touches", "grid", *words.split(), "--force").exit_code == 0


def test_touches_are_recorded_as_planned_and_kept_after_each(monkeypatch, folder):
    import smoskin.service.guided as guided
    import smoskin.service.source as sources

    opened, closed = [], []

    class Source:
        def __init__(self, url):
            opened.append(url)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            closed.append(True)

    def record(source, wanted, *, say, keep):
        assert isinstance(source, Source)
        np.testing.assert_allclose(wanted.position, touches(3).position)
        say("Press here.")
        keep(touches(2))
        assert len(read_touches(folder / "made.csv")[0].position) == 2
        return touches(2)

    monkeypatch.setattr(sources, "open_source", Source)
    monkeypatch.setattr(guided, "record_touches", record)
    write_touches(folder / "plan.csv", touches(3))
    done = invoke("touches", "record", "serial://port", "--plan", "plan.csv", "--out", "made.csv")
    assert done.exit_code == 0, done.output
    assert (opened, closed) == (["serial://port"], [True])
    assert done.stdout == "Press here.\n2 touches in made.csv\n"
    assert done.stderr.endswith("Now: smoskin learn made.csv --out own.model\n")
    again = invoke("touches", "record", "serial://port", "--plan", "plan.csv", "--out", "made.csv")
    assert again.exit_code != 0


def test_a_rig_makes_a_plan_and_goes_on_with_what_it_has_made(monkeypatch, folder):
    import smoskin.cli.rig as commands
    import smoskin.commands.press as campaign

    rigs, given = [], []

    class Rig:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            rigs.append("closed")

    def opened(name, design):
        rigs.extend([name, design.name])
        return Rig()

    def press(rig, plan, *, made, keep, on_touch, progress):
        assert isinstance(rig, Rig)
        given.append((len(plan.contacts), None if made is None else len(made.contacts)))
        progress("touch 1 of 3", 0.0)
        done = touches(2 if made is None else 3)
        keep(done)
        return done

    monkeypatch.setattr(commands, "open_rig", opened)
    monkeypatch.setattr(campaign, "press_plan", press)
    write_touches(folder / "plan.csv", touches(3))
    words = ("touches", "press", "optimised", "--rig", "virtual?seed=3", "--out", "made.csv")
    for count in (2, 3):
        done = invoke(*words)
        assert done.exit_code == 0, done.output
        assert done.stdout == f"{count} touches in made.csv\n"
        assert done.stderr.endswith("Now: smoskin learn made.csv --out own.model\n")
    assert given == [(3, None), (3, 2)]
    assert rigs == 2 * ["virtual?seed=3", "optimised", "closed"]


def test_a_stage_and_a_gauge_make_a_plan(monkeypatch, folder):
    pytest.importorskip("serial")
    import smoskin.service.source as sources

    world = rigs.World()
    stage, gauge, asked = rigs.FakeStage(world), rigs.FakeGauge(world), []
    monkeypatch.setattr(
        sources, "open_source", lambda url: (asked.append(url), rigs.Skin(world))[1]
    )
    write_touches(folder / "plan.csv", grid_plan(20e-3, 20e-3, 2, force=0.3))
    origin = ",".join(f"{1e3 * part:.4f}" for part in rigs.ORIGIN)
    words = ["touches", "press", "--plan", "plan.csv", "--out", "made.csv", "--source", "skin"]
    words += ["--stage", f"serial://{stage.port}", "--stiffness-N-per-mm", "2.5"]
    try:
        lost = invoke(*words, "--gauge", f"serial://{gauge.port}")
        assert "must come together" in str(lost.exception)
        words += ["--gauge", f"serial://{gauge.port}"]
        wrong = invoke(*words, "--origin-mm=1,2")
        assert "--origin-mm must be three numbers" in str(wrong.exception)
        done = invoke(*words, f"--origin-mm={origin}")
        assert done.exit_code == 0, done.output
    finally:
        stage.close()
        gauge.close()
    made = read_touches(folder / "made.csv")[0]
    plan = read_touches(folder / "plan.csv")[0]
    assert asked == ["skin"]
    np.testing.assert_allclose(made.position[1::2], plan.position, atol=2e-6)
    np.testing.assert_allclose(made.force[1::2, 2], -0.3, atol=0.02)
    np.testing.assert_allclose(-1e3 * made.field[1::2, :, 2], made.force[1::2, [2, 2]], atol=5e-3)


@pytest.mark.parametrize("recording", [None, "some.mcap"])
def test_sheets_are_learned_as_asked(monkeypatch, folder, recording):
    import smoskin.sensing.learned.touches as work
    import smoskin.service.recording as recordings

    class Sheet:
        contacts = (1, 2, 3)

        def __init__(self, name):
            self.name, self.readings = name, None

        def with_readings(self, readings):
            self.readings = readings
            return self

    model = SimpleNamespace(
        split="5 folds of 30 places",
        metrics=(Metric("place_error", 1.23456e-3, "m"), Metric("inside", 0.9, "")),
        save=lambda path: saved.append(path),
    )
    saved, learned = [], Worked(model)
    monkeypatch.setattr(work, "learn_touches", learned)
    monkeypatch.setattr("smoskin.service.kept.read_sheet", lambda name: (Sheet(str(name)), None))
    monkeypatch.setattr(
        recordings, "open_recording", lambda path: SimpleNamespace(readings=lambda: iter("abc"))
    )
    words = ["one.csv", "two.csv", "--out", "mine.model", "--seed", "4"]
    words += [] if recording is None else ["--recording", recording]
    if recording is not None:
        (folder / recording).write_bytes(b"x")
    done = invoke("learn", *words)
    assert done.exit_code == 0, done.output
    assert [sheet.name for sheet in learned.asked[0]] == ["one.csv", "two.csv"]
    expected = None if recording is None else ["a", "b", "c"]
    assert [sheet.readings for sheet in learned.asked[0]] == [expected] * 2
    assert learned.options["seed"] == 4
    assert set(learned.options) == {"seed", "chips", "progress", "on_judged"}
    assert learned.options["chips"] is None
    assert [str(path) for path in saved] == ["mine.model"]
    assert done.stdout == (
        "mine.model, judged by 5 folds of 30 places:\nplace_error_mm: 1.23\ninside: 0.9\n"
    )
    assert done.stderr.endswith("Now: smoskin run SOURCE --calibration mine.model\n")
    answer = json.loads(invoke("learn", *words, "--json").stdout)
    assert answer == {
        "file": "mine.model", "split": "5 folds of 30 places", "place_error_m": 1.23456e-3,
        "inside": 0.9,
    }  # fmt: skip
    judged = Worked((Metric("place_error", 2e-3, "m"),))
    monkeypatch.setattr(work, "judge_touches", judged)
    words += ["--chips", "0,3", "--test", "three.csv", "--test", "four.csv"]
    done = invoke("learn", *words)
    assert done.stdout.endswith(
        "inside: 0.9\nthree.csv, four.csv, not learned:\nplace_error_mm: 2\n"
    )
    assert learned.options["chips"] == (0, 3)
    assert judged.asked[0] is model
    assert [sheet.name for sheet in judged.asked[1]] == ["three.csv", "four.csv"]
    assert [sheet.readings for sheet in judged.asked[1]] == [expected] * 2
    answer = json.loads(invoke("learn", *words, "--json").stdout)
    assert answer["test"] == {"place_error_m": 2e-3}
    (folder / "mine.model").write_bytes(b"x")
    assert invoke("learn", *words).exit_code != 0


@pytest.mark.parametrize(
    ("wire", "ask"), [("smoskin", ""), ("anyskin", "?format=anyskin&design=optimised")]
)
def test_a_board_is_simulated_as_asked(monkeypatch, wire, ask):
    import smoskin.service.board as work

    run = Worked(SimpleNamespace(sent=12, dropped=3))
    monkeypatch.setattr(work, "run_board", run)
    words = f"--virtual optimised --format {wire} --rate 50 --seed 2 --no-hand --seconds 3"
    done = invoke("board", *words.split())
    assert done.exit_code == 0, done.output
    assert [design.name for design in run.asked] == ["optimised"]
    announce = run.options.pop("on_start")
    assert run.options == {
        "format": wire, "rate": 50.0, "seed": 2, "hand": False, "seconds": 3.0,
    }  # fmt: skip
    assert done.stderr == "12 frames sent, 3 that nobody read\n"
    echo = Worked()
    monkeypatch.setattr("typer.echo", echo)
    announce("/dev/pts/7")
    assert echo.asked == (f"Read it by: smoskin run 'serial:///dev/pts/7{ask}'",)
    assert echo.options == {"err": True}


@pytest.mark.parametrize("findings", [(), ("a loose wire",)])
def test_a_board_is_looked_at_as_asked(monkeypatch, findings):
    import smoskin.service.doctor as work

    class Diagnosis:
        def __init__(self):
            self.findings = findings

        def as_json(self):
            return {"findings": list(findings)}

        def __str__(self):
            return "what there is"

    around, examined = Worked(Diagnosis()), Worked(Diagnosis())
    monkeypatch.setattr(work, "look_around", around)
    monkeypatch.setattr(work, "examine_source", examined)
    done = invoke("doctor")
    assert (done.stdout, done.exit_code) == ("what there is\n", bool(findings))
    assert (around.asked, around.options) == ((), {})
    words = "serial://port --design optimised --seconds 7 --moving 2 --json"
    done = invoke("doctor", *words.split())
    assert done.exit_code == bool(findings)
    assert json.loads(done.stdout) == {"findings": list(findings)}
    assert examined.asked == ("serial://port",)
    say = examined.options.pop("say")
    assert examined.options.pop("design").name == "optimised"
    assert examined.options == {"seconds": 7.0, "moving": 2.0}
    assert invoke("doctor", "serial://port").exit_code == bool(findings)
    assert examined.options["design"] is None
    echo = Worked()
    monkeypatch.setattr("typer.echo", echo)
    say("Move the robot.")
    assert (echo.asked, echo.options) == (("Move the robot.",), {"err": True})


def test_recordings_and_tables_are_converted_as_asked(monkeypatch):
    import smoskin.service.exchange as work

    there, back = Worked(5), Worked(6)
    monkeypatch.setattr(work, "export_recording", there)
    monkeypatch.setattr(work, "import_readings", back)
    done = invoke("convert", "touch.mcap", "touch.csv")
    assert (done.exit_code, done.stdout) == (0, "5 readings in touch.csv\n")
    assert [str(path) for path in there.asked] == ["touch.mcap", "touch.csv"]
    assert there.options == {"force": False}
    done = invoke("convert", "mine.csv", "mine.mcap", "--design", "optimised", "--force")
    assert (done.exit_code, done.stdout) == (0, "6 readings in mine.mcap\n")
    source, design, out = back.asked
    assert (str(source), design.name, str(out)) == ("mine.csv", "optimised", "mine.mcap")
    assert back.options == {"force": True}
    assert invoke("convert", "mine.csv", "mine.mcap").exit_code == 0
    assert back.asked[1].name == "planar"


@pytest.mark.parametrize("holds", [True, False])
def test_a_surface_is_covered_as_asked(monkeypatch, holds):
    import smoskin.commands.tessellate as work

    report = SimpleNamespace(
        made=SimpleNamespace(holds=holds, advice="take smaller cells"),
        as_json=lambda: {"fine": holds},
        tables=list,
        warnings=(),
    )
    made = Worked(report)
    monkeypatch.setattr(work, "tessellate_surface", made)
    words = (
        "cylinder:100 --cells 6 8 --out skin --design optimised --scale 0.5 --at 1,2,3 "
        "--along 0,0,1 --own-columns --time-limit 9 --force --json"
    )
    done = invoke("tessellate", *words.split())
    assert done.exit_code == (not holds), done.output
    assert json.loads(done.stdout) == {"fine": holds}
    surface, design, cells, out = made.asked
    assert (surface, design.name, cells, str(out)) == ("cylinder:100", "optimised", (6, 8), "skin")
    assert made.options.pop("progress") is not None
    given = {name: np.asarray(made.options.pop(name)).tolist() for name in ("at", "along")}
    assert given == {name: np.asarray(work.numbers(name, text)).tolist() for name, text in (
        ("at", "1,2,3"), ("along", "0,0,1"),
    )}  # fmt: skip
    assert made.options == {
        "scale": 0.5, "own_columns": True, "time_limit": 9.0, "force": True,
    }  # fmt: skip
    warning = "This sheet must not be cut: take smaller cells.\n"
    assert done.stderr.endswith(warning) is not holds
