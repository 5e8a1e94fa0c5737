"""Every option of every command reaches the work that it names, and what comes of it is told."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("typer")

from typer.testing import CliRunner

from smoskin.cli import app, calibration, live, train
from smoskin.errors import CalibrationError, FileError, SourceError


class Worked:
    """Stands for a piece of work: takes note of what it was asked, and has something to tell."""

    def __init__(self, **attributes):
        self.__dict__.update(attributes)

    def __call__(self, *asked, **options):
        self.asked, self.options = asked, options
        self.tells = options.pop("progress", None) is not None  # how far it is
        return self.result


def invoke(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(autouse=True)
def light(monkeypatch, tmp_path):
    """Tables and designs are known by their names, and nobody looks at a bar."""
    monkeypatch.chdir(tmp_path)
    for module in (calibration, live):
        monkeypatch.setattr(module, "load_response_table", lambda path: ("table", str(path)))


def report(**more):
    return SimpleNamespace(as_json=lambda: {"fine": True}, tables=list, warnings=(), **more)


def test_a_press_is_simulated_as_asked(monkeypatch):
    import smoskin.commands.simulate as work

    press = Worked(result=report(valid=True))
    monkeypatch.setattr(work, "simulate_press", press)
    assert invoke("simulate", "--json").exit_code == 0
    assert press.asked[0].name == "planar"
    assert press.asked[1:] == ((), ())
    assert press.options == {
        "temperature": 25.0, "mechanics": "whole", "grip": None, "manufactured": False, "seed": 0,
    }  # fmt: skip
    more = "--at 1,2 --at 3,4 --force 0,0,-1 --temperature 30 --mechanics reduced --grip covered"
    done = invoke("simulate", "optimised", *more.split(), "--manufactured", "--seed", 3, "--json")
    assert json.loads(done.stdout) == {"fine": True}
    assert press.asked[0].name == "optimised"
    assert press.asked[1:] == (["1,2", "3,4"], ["0,0,-1"])
    assert press.options == {
        "temperature": 30.0, "mechanics": "reduced", "grip": "covered", "manufactured": True,
        "seed": 3,
    }  # fmt: skip
    press.result.valid = False
    done = invoke("simulate", "--json")
    assert done.exit_code == 1
    assert "no equilibrium" in done.stderr


def test_a_sweep_is_planned_and_run_as_asked(monkeypatch):
    import smoskin.commands.sweep as work

    summary = SimpleNamespace(as_json=lambda: {"rows": 1}, lines=lambda: ["one row"], sound=True)
    plan, run, tell = Worked(result="the plan"), Worked(result=summary), Worked(result=summary)
    for name, stand_in in (("plan_sweep", plan), ("run_sweep", run), ("summarise", tell)):
        monkeypatch.setattr(work, name, stand_in)
    words = {
        "forces": "1", "drags": "2", "directions": "3", "places": "4x5", "count": "6",
        "touches": "7", "radius": "8", "margin": "9",
    }  # fmt: skip
    given = [part for name, text in words.items() for part in (f"--{name}", text)]
    rest = "--kind random --temperature 10,20 --skins 5 --mechanics reduced --grip covered --seed 6"
    done = invoke(
        "sweep", *given, *rest.split(), "--chunk", 9, "--workers", 2, "--force",
        "--out", "here", "--export", "one.h5",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert done.stdout == "one row\n"
    assert plan.asked == ("random", words)
    assert plan.options == {
        "temperatures": "10,20", "skins": 5, "mechanics": "reduced", "grip": "covered", "seed": 6,
        "presses_per_chunk": 9,
    }  # fmt: skip
    assert run.tells
    assert (run.asked[0].name, *run.asked[1:]) == ("planar", "the plan", Path("here"))
    assert run.options["engine"].workers == 2
    assert run.options["engine"].scheduler is None
    assert (run.options["export"], run.options["force"]) == (Path("one.h5"), True)
    assert json.loads(invoke("sweep", "optimised", "--kind", "shear", "--json").stdout) == {
        "rows": 1
    }
    assert run.asked[2] == Path("optimised-shear")
    assert (run.options["export"], run.options["force"]) == (None, False)
    assert invoke("sweep", "--scheduler", "tcp://a:1").exit_code == 0
    assert run.options["engine"].scheduler == "tcp://a:1"
    run.asked = None
    summary.sound = False
    assert invoke("sweep", "--summary", "here").exit_code == 1
    assert (tell.asked, run.asked) == ((Path("here"),), None)


def test_a_table_is_made_as_asked(monkeypatch):
    import smoskin.commands.table as work

    saved = []
    make = Worked(result=SimpleNamespace(save=saved.append))
    monkeypatch.setattr(work, "make_table", make)
    monkeypatch.setattr(work, "table_facts", lambda table: {"touches": 3})
    done = invoke("table", "--json")
    assert json.loads(done.stdout) == {"file": "planar.table", "touches": 3}
    design, effort = make.asked
    assert make.tells
    assert (design.name, effort, make.options["folder"]) == ("planar", work.Effort(), None)
    some = "--presses 7 --pairs 0 --skins 3 --seed 5 --folder kept --workers 1 --out own.table"
    assert invoke("table", "optimised", *some.split(), "--json").exit_code == 0
    design, effort = make.asked
    assert design.name == "optimised"
    assert (effort.presses, effort.pairs, effort.skins, effort.seed) == (7, 0, 3, 5)
    assert (make.options["folder"], make.options["engine"].workers) == (Path("kept"), 1)
    assert saved == [Path("planar.table"), Path("own.table")]
    assert "nothing is kept" in train._pressed(None)
    assert train._pressed(Path("kept")).startswith("kept keeps")


def test_a_network_is_trained_as_asked(monkeypatch, tmp_path):
    import smoskin.commands.train as work
    import smoskin.plots as plots

    kept = SimpleNamespace(unlink=lambda: kept.__dict__.update(gone=True))
    asked = Worked(result=kept)
    monkeypatch.setattr(work, "checkpoint_of", asked)
    monkeypatch.setattr(work, "figure_rows", lambda trained: "rows")
    monkeypatch.setattr(train, "show", print)
    trained = SimpleNamespace(
        as_json=lambda: {"fine": True}, ended="in time", warning="train longer"
    )
    teach = Worked(result=trained)
    monkeypatch.setattr(work, "train", teach)
    write = Worked(result=[Path("a.net")])
    monkeypatch.setattr(work, "write_network", write)
    monkeypatch.setattr(train, "require", lambda *_: None)
    done = invoke("train", "skin.table")
    assert done.exit_code == 0, done.output
    assert done.stdout == "rows\nTraining ended: in time.\na.net\nnetwork.safetensors.curve.jsonl\n"
    assert done.stderr == "warning: train longer\n"
    assert kept.gone
    assert (asked.asked, asked.options) == ((Path("network.safetensors"),), {"resume": False})
    assert write.asked == (trained, Path("network.safetensors"), None)
    usual = {
        "chips": None, "drag": 0.0, "members": None, "minutes": None, "seed": 0,
        "start": None, "checkpoint": kept, "curve": Path("network.safetensors.curve.jsonl"),
    }  # fmt: skip
    assert teach.options["design"] is None
    assert teach.tells
    assert 0 <= teach.options["clock"]() < 60
    drawn = []
    monkeypatch.setattr(plots, "save_figure", lambda *figure: drawn.append(figure))
    monkeypatch.setattr(work, "residual_figure", lambda trained, skin: skin.name)
    assert {name: teach.options[name] for name in usual} == usual
    some = "--drag 0.3 --members 2 --minutes 5 --seed 4 --start b.net --resume --chips 1,2"
    files = "--design optimised --out c.net --onnx c.onnx --plot c.png --json"
    done = invoke("train", "skin.table", *some.split(), *files.split())
    assert json.loads(done.stdout)["files"] == ["a.net", "c.net.curve.jsonl"]
    assert teach.options["design"].name == "optimised"
    usual |= {
        "chips": work.parse_chips("1,2"), "drag": 0.3, "members": 2, "minutes": 5.0, "seed": 4,
        "start": Path("b.net"), "curve": Path("c.net.curve.jsonl"),
    }  # fmt: skip
    assert drawn == [("optimised", Path("c.png"))]
    assert {name: teach.options[name] for name in usual} == usual
    assert asked.options == {"resume": True}
    assert write.asked == (trained, Path("c.net"), Path("c.onnx"))
    # A curve that is there is gone on with where training is, and else replaced only by force.
    (tmp_path / "c.net.curve.jsonl").write_text("")
    assert invoke("train", "skin.table", *files.split(), "--resume").exit_code == 0
    assert invoke("train", "skin.table", *files.split()).exit_code == 1
    assert invoke("train", "skin.table", *files.split(), "--force").exit_code == 0


def test_an_estimator_is_judged_as_asked(monkeypatch):
    import smoskin.commands.score as work

    sheet = report(met=True, verdict=lambda: "well met")
    judge = Worked(result=sheet)
    monkeypatch.setattr(work, "score", judge)
    done = invoke("score", "a.table", "--json")
    assert (done.exit_code, json.loads(done.stdout)) == (0, {"fine": True}), done.output
    assert done.stderr.endswith("well met\n")
    usual = {
        "skins": range(1, 3), "touches": 60, "count": None, "places": None, "chips": None,
        "drag": 0.0, "pairs": 40, "pairs_after": 0.3, "world": "hard", "effect": None, "out": None,
    }  # fmt: skip
    assert judge.tells
    assert (judge.asked[0], judge.asked[1].name) == (Path("a.table"), "planar")
    assert {name: judge.options[name] for name in usual} == usual
    some = "--design optimised --skins 3 --touches 15 --places 5x7 --count 9 --drag 0.2 --pairs 0"
    more = "--chips 0,2 --seed 8 --world plain --effect hysteresis --pairs-after 0.1 --out judged"
    sheet.met = False
    done = invoke("score", "a.table", *some.split(), *more.split())
    assert (done.exit_code, done.stdout) == (1, "judged/score.json\n"), done.output
    usual |= {
        "skins": range(8, 11), "touches": 15, "count": 9, "places": (5, 7), "drag": 0.2, "pairs": 0,
        "pairs_after": 0.1, "world": "plain", "effect": "hysteresis", "out": Path("judged"),
    }  # fmt: skip
    assert judge.asked[1].name == "optimised"
    assert list(judge.options["chips"]) == [0, 2]
    del usual["chips"]
    assert {name: judge.options[name] for name in usual} == usual
    Path("judged").mkdir()
    Path("judged/score.json").write_text("{}")
    assert isinstance(invoke("score", "a.table", "--out", "judged").exception, FileError)
    assert invoke("score", "a.table", "--out", "judged", "--force").exit_code == 1


def test_a_design_is_varied_as_asked(monkeypatch):
    import smoskin.commands.optimise as work

    optimised = report(
        kept=True,
        write=lambda out: (out, out.with_suffix(".json")),
        verdict=lambda: "ok",
        warning="too little time",
    )
    monkeypatch.setattr(work, "optimise", vary := Worked(result=optimised))
    done = invoke("optimise", "--out", "b.toml")
    assert (done.exit_code, done.stdout) == (0, "b.toml and b.json\n"), done.output
    assert done.stderr.endswith("warning: too little time\nok\n")
    assert 0 <= vary.options["clock"]() < 60
    assert (vary.asked[0].name, vary.options["name"]) == ("planar", "b")
    assert vary.tells
    assert vary.options["objective"] == work.Objective(force=0.5)
    assert vary.options["limits"] == work.Limits(rate=100.0)
    assert vary.options["effort"] == work.SearchEffort(seed=0)
    some = "--minutes 2 --force-N 0.3 --rate 200 --seed 7 --out c.toml"
    assert invoke("optimise", "optimised", *some.split()).exit_code == 0
    assert vary.options["objective"] == work.Objective(force=0.3)
    assert vary.options["limits"] == work.Limits(rate=200.0)
    assert vary.options["effort"] == work.SearchEffort(seed=7, seconds=120.0)


def test_a_sheet_is_planned_as_asked(monkeypatch):
    import smoskin.commands.calibrate as work

    targets = [SimpleNamespace(error=error) for error in (2e-3, 0.31234567e-3)]
    plan, write = Worked(result=targets), Worked(result=None)
    monkeypatch.setattr(work, "plan_by_hand", plan)
    monkeypatch.setattr(work, "write_plan", write)
    done = invoke("touches", "plan")
    assert done.exit_code == 0, done.output
    assert done.stdout == "2 touches; a touch is then expected to be located to 0.31 mm\n"
    assert done.stderr == "Now: smoskin calibrate planar --sheet touches.csv --out skin.table\n"
    assert (plan.asked[0].name, plan.asked[1]) == ("planar", ("table", "planar"))
    assert plan.options == {
        "count": 15, "until": 0.0, "force": 0.8, "drag": 0.0, "made": (), "place_spread": 5e-4,
        "force_spread": 0.01,
    }  # fmt: skip
    assert (write.asked[0], write.asked[2]) == (Path("touches.csv"), targets)
    some = "--count 3 --until-mm 0.4 --force-N 0.5 --drag-N 0.2 --place-mm 1 --force-mN 20"
    done = invoke("touches", "plan", *some.split(), "--table", "own", "--out", "a.csv", "--json")
    assert json.loads(done.stdout) == {"file": "a.csv", "expected_error_mm": [2.0, 0.3123]}
    assert plan.asked[1] == ("table", "own")
    assert plan.options.pop("made") == ()
    assert plan.options == pytest.approx(
        {
            "count": 3, "until": 4e-4, "force": 0.5, "drag": 0.2, "place_spread": 1e-3,
            "force_spread": 0.02,
        }
    )  # fmt: skip
    targets.clear()
    assert invoke("touches", "plan").stdout == ""


def test_a_skin_is_calibrated_as_asked(monkeypatch):
    import smoskin.commands.calibrate as work
    import smoskin.plots as plots

    saved = []
    done = report(
        save=saved.append,
        judgement=SimpleNamespace(warnings=("odd",)),
        figure=lambda skin: SimpleNamespace(savefig=lambda file: saved.append((skin.name, file))),
    )
    made = Worked(result=done)
    monkeypatch.setattr(work, "calibrate", made)
    monkeypatch.setattr(plots, "save_figure", lambda figure, file: figure.savefig(file))
    ran = invoke("calibrate", "--sheet", "a.csv")
    assert ran.exit_code == 0, ran.output
    assert ran.stderr == "warning: odd\nNow: smoskin run SOURCE --calibration skin.table\n"
    assert saved == [Path("skin.table")]
    assert made.asked == (("table", "planar"), Path("a.csv"))
    assert made.options.pop("design").name == "planar"
    assert made.options == {
        "recording": None, "accept_bad_fit": False, "place_spread": None, "force_spread": None,
    }  # fmt: skip
    some = "--recording a.mcap --place-mm 0.2 --force-mN 5 --accept-bad-fit --table own"
    ran = invoke(
        "calibrate", "optimised", "--sheet", "a.csv", *some.split(), "--plot", "a.png", "--json",
        "--out", "b.table",
    )  # fmt: skip
    assert json.loads(ran.stdout) == {"fine": True, "file": "b.table"}
    assert ran.stderr == "warning: odd\n"
    assert saved[1:] == [Path("b.table"), ("optimised", Path("a.png"))]
    assert made.asked[0] == ("table", "own")
    del made.options["design"]
    assert made.options == pytest.approx(
        {
            "recording": Path("a.mcap"), "accept_bad_fit": True, "place_spread": 2e-4,
            "force_spread": 5e-3,
        }
    )  # fmt: skip
    for more in (
        "--touches 3",
        "--until-mm 1",
        "--force-N 1",
        "--drag-N 1",
        "--rig virtual?seed=1",
    ):
        refused = invoke("calibrate", "--sheet", "a.csv", *more.split())
        assert "--sheet must come without" in str(refused.exception)
    assert "--recording must come with" in str(invoke("calibrate", "--recording", "a").exception)


@pytest.mark.parametrize("error", [None, CalibrationError, SourceError])
def test_a_rig_is_asked_as_told_and_its_touches_outlive_a_failure(monkeypatch, error):
    import contextlib

    import smoskin.commands.calibrate as work
    import smoskin.service.kept as kept

    class Remembering:
        def __init__(self, rig, design):
            self.rig, self.design = rig, design

        def keep(self, out):
            return f"kept beside {out}"

    asked = {}

    def made(table, rig, *, progress, **options):
        asked.update(options, rig=rig.rig, of=rig.design.name)
        progress(SimpleNamespace(sentence="touch 1", number=1, asked=2))
        if error is not None:
            raise error("no")
        return report(save=lambda out: None, judgement=SimpleNamespace(warnings=()))

    monkeypatch.setattr(work, "calibrate", made)
    monkeypatch.setattr(kept, "RememberingRig", Remembering)
    monkeypatch.setattr(
        calibration, "open_rig", lambda name, design: contextlib.nullcontext((name, design.name))
    )
    some = "--rig virtual?seed=3 --touches 4 --until-mm 0.5 --force-N 0.6 --drag-N 0.1"
    done = invoke("calibrate", *some.split(), "--json")
    assert (done.exit_code, done.stderr) == (
        (0, "") if error is None else (1, "kept beside skin.table\n")
    )
    del asked["design"]
    assert asked == {
        "rig": ("virtual?seed=3", "planar"), "of": "planar", "count": 4, "until": 5e-4,
        "force": 0.6, "drag": 0.1, "accept_bad_fit": False, "place_spread": None,
        "force_spread": None,
    }  # fmt: skip


def test_the_papers_model_is_fitted_as_asked(monkeypatch):
    import datetime as dt

    import smoskin.commands.fit_paper as work
    import smoskin.plots as plots

    result = report(fit="the fit")
    result.warnings = ("odd",)
    fit = Worked(result=result)
    monkeypatch.setattr(work, "fit_paper", fit)
    done = invoke("fit-paper", "a.csv", "--json")
    assert (done.exit_code, json.loads(done.stdout)) == (0, {"fine": True}), done.output
    assert done.stderr == "warning: odd\n"
    assert (fit.asked[0].name, *fit.asked[1:]) == (
        "planar", Path("a.csv"), Path("calibration.toml"),
    )  # fmt: skip
    today = dt.date.today().isoformat()
    assert fit.options == {"recording": None, "date": today, "attenuation": "equal"}
    drawn = []
    monkeypatch.setattr(work, "residual_figure", lambda fit: ("figure of", fit))
    monkeypatch.setattr(plots, "save_figure", lambda *figure: drawn.append(figure))
    some = "--out b.toml --design optimised --recording a.mcap --date 2026-01-02 --separate"
    assert invoke("fit-paper", "a.csv", *some.split(), "--plot", "a.png").exit_code == 0
    assert (fit.asked[0].name, fit.asked[2]) == ("optimised", Path("b.toml"))
    assert fit.options == {
        "recording": Path("a.mcap"), "date": "2026-01-02", "attenuation": "separate",
    }  # fmt: skip
    assert drawn == [(("figure of", "the fit"), Path("a.png"))]


@pytest.mark.parametrize(
    ("sheet", "hint"),
    [
        ("whole", "Now: smoskin calibrate optimised --sheet a.csv --out skin.table"),
        ("reduced", "Now: smoskin fit-paper a.csv --out calibration.toml"),
    ],
)
def test_a_virtual_bench_says_what_comes_next(monkeypatch, sheet, hint):
    import smoskin.commands.fit_paper as work

    monkeypatch.setattr(work, "write_virtual_bench", bench := Worked(result=None))
    some = f"--design optimised --seed 2 --sheet {sheet}"
    done = invoke("virtual-bench", "a.csv", *some.split())
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", f"{hint}\n")
    assert (bench.asked[0].name, bench.asked[1]) == ("optimised", Path("a.csv"))
    assert bench.tells
    assert (bench.options["seed"], bench.options["sheet"]) == (2, sheet)


def test_a_source_is_run_as_asked(monkeypatch):
    import smoskin.commands.run as work
    from smoskin.commands.run import lines

    class Watching:
        def __init__(self, *asked, **options):
            self.asked, self.options = asked, options
            self.summary = SimpleNamespace(
                as_json=lambda: {"n": 2}, failure="", damage="", __str__=lambda _: "two"
            )
            made.append(self)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def __iter__(self):
            return iter("ab")

        def close(self):
            self.summary.failure, self.summary.damage = wrong

    made, wrong = [], ("", "")
    thinned = []

    def thin(estimates, **options):
        return thinned.append(options) or zip(estimates, (True, False), strict=True)

    monkeypatch.setattr(work, "Watch", Watching)
    monkeypatch.setattr(lines, "thinned", thin)
    monkeypatch.setattr(lines, "estimate_line", lambda estimate, as_json: f"{estimate} {as_json}")
    done = invoke("run")
    assert (done.exit_code, done.stdout) == (0, "a False\n"), done.output
    assert made[0].asked == ("twin://planar", None)
    assert made[0].options.pop("say")
    assert made[0].options == {
        "calibration": None, "arm": False, "zero": True, "seconds": None, "record": None,
        "force": False, "view": False, "port": 0, "estimators": (),
    }  # fmt: skip
    assert thinned[0] == {"every": None, "changes": False}
    some = "--design optimised --calibration a.table --no-zero --seconds 2 --view --port 8 --force"
    some += " --arm --estimator b.table --estimator c.network"
    done = invoke("run", "replay:a", *some.split(), "--record", "b.mcap", "--every", 1, "--changes",
                  "--json")  # fmt: skip
    assert (done.stdout, json.loads(done.stderr)) == ("a True\n", {"summary": {"n": 2}})
    assert (made[1].asked[0], made[1].asked[1].name) == ("replay:a", "optimised")
    del made[1].options["say"]
    assert made[1].options == {
        "calibration": Path("a.table"), "zero": False, "seconds": 2.0, "record": Path("b.mcap"),
        "force": True, "view": True, "port": 8, "arm": True,
        "estimators": [Path("b.table"), Path("c.network")],
    }  # fmt: skip
    assert thinned[1] == {"every": 1.0, "changes": True}
    assert invoke("run", "--quiet").stdout == ""
    for wrong, more, code in (  # noqa: B007  what the next watch ends with
        (("full", ""), (), 1), (("", "cut"), (), 0), (("", "cut"), ("--strict",), 1),
        (("", ""), ("--strict",), 0),
    ):  # fmt: skip
        assert invoke("run", *more).exit_code == code
