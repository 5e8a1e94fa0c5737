"""Options of the command line: their defaults, and that each reaches the work it names."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("typer")

import typer
from typer.testing import CliRunner

import smoskin.cli.live
import smoskin.commands.demo
import smoskin.commands.optimise
from smoskin.cli import app

USUAL = {
    "board": {"virtual": "planar", "wire": "smoskin", "rate": 100.0, "seed": 0, "hand": True},
    "calibrate": {"rig": "virtual", "out": "skin.table"},
    "campaign": {
        "kind": "grid", "width": 120.0, "height": 160.0, "out": "plan.csv",
        "columns": 25, "rows": 33, "forces": "0.3,0.6,0.9", "drag": 0.2, "angles": 8, "repeats": 5,
        "reference_every": 25, "seed": 0,
    },
    "convert": {"rate": 30, "task": "touch", "window": 4},
    "demo": {"rate": 100.0, "seed": 0, "touches": 15, "port": 0},
    "doctor": {"seconds": 5.0, "moving": 0.0},
    "fit-paper": {"out": "calibration.toml"},
    "follow": {"source": "twin://planar", "rate": 100.0, "seed": 0, "site": "skin", "port": 0},
    "grid": {
        "width": 30.0, "height": 30.0, "out": "plan.csv", "count": 30, "force": 0.5, "seed": 0,
    },
    "learn": {"out": "own.model", "seed": 0},
    "new-design": {"base": "planar"},
    "optimise": {"force": 0.5, "rate": 100.0, "seed": 0},
    "plan": {
        "count": 15, "force": 0.8, "drag": 0.0, "place_mm": 0.5, "force_mn": 10.0,
        "out": "touches.csv",
    },
    "press": {
        "rig": "virtual", "plan": "plan.csv", "out": "touches.csv",
        "limit": 1.5, "reach": 10.0, "stiffness": 2.0, "recovery": 0.0, "held_out": 0.0,
    },
    "record": {"plan": "plan.csv", "out": "touches.csv"},
    "report": {"out": "report"},
    "run": {"source": "twin://planar", "zero": True, "port": 0},
    "score": {
        "skins": 2, "touches": 60, "drag": 0.0, "pairs": 40, "pairs_after": 0.3, "seed": 1,
        "world": "hard",
    },
    "serve": {"zero": True, "host": "127.0.0.1", "feed": 8770, "every": 10.0},
    "simulate": {"temperature": 25.0, "mechanics": "whole", "seed": 0},
    "sweep": {"kind": "grid", "temperature": "25", "skins": 0, "mechanics": "whole", "seed": 0},
    "table": {"seed": 0},
    "tessellate": {"scale": 1.0, "at": "0,0,0", "along": "1,0,0", "time_limit": 60.0},
    "train": {"drag": 0.0, "seed": 0, "out": "network.safetensors"},
    "view": {"port": 0},
    "virtual-bench": {"seed": 0, "sheet": "whole", "out": "touches.csv"},
}  # fmt: skip
"""What a command does where nothing is said: people and scripts build on it."""
ENDS = {
    ("board", "seconds"): (0, None),
    ("board", "seed"): (0, None),
    ("calibrate", "touches"): (1, 1000),
    ("calibrate", "until_mm"): (0, None),
    ("calibrate", "place_mm"): (0, None),
    ("calibrate", "force_mn"): (0, None),
    ("campaign", "columns"): (1, 1000),
    ("campaign", "rows"): (1, 1000),
    ("campaign", "angles"): (1, 360),
    ("campaign", "repeats"): (1, 1000),
    ("campaign", "reference_every"): (0, None),
    ("campaign", "seed"): (0, None),
    ("demo", "seconds"): (0, None),
    ("demo", "port"): (0, 65535),
    ("demo", "seed"): (0, None),
    ("demo", "touches"): (1, 1000),
    ("doctor", "seconds"): (1.0, None),
    ("doctor", "moving"): (0.0, None),
    ("follow", "rate"): (50.0, 500.0),
    ("follow", "seed"): (0, None),
    ("follow", "seconds"): (0, None),
    ("follow", "port"): (0, 65535),
    ("grid", "count"): (1, 10_000),
    ("grid", "seed"): (0, None),
    ("learn", "seed"): (0, None),
    ("optimise", "minutes"): (0.1, None),
    ("optimise", "force"): (0.05, 1.0),
    ("optimise", "rate"): (1.0, None),
    ("optimise", "seed"): (0, None),
    ("plan", "count"): (1, 1000),
    ("plan", "until_mm"): (0, None),
    ("plan", "place_mm"): (0, None),
    ("plan", "force_mn"): (0, None),
    ("press", "recovery"): (0, None),
    ("press", "held_out"): (0, 0.9),
    ("run", "seconds"): (0, None),
    ("run", "port"): (0, 65535),
    ("run", "every"): (0, None),
    ("score", "skins"): (1, 1000),
    ("score", "touches"): (0, 1000),
    ("score", "count"): (1, 100_000),
    ("score", "drag"): (0, None),
    ("score", "pairs"): (0, 10_000),
    ("score", "pairs_after"): (0.02, 10.0),
    ("score", "seed"): (0, None),
    ("ros", "seconds"): (0, None),
    ("serve", "seconds"): (0, None),
    ("serve", "feed"): (0, 65535),
    ("serve", "foxglove"): (0, 65535),
    ("serve", "every"): (0.1, None),
    ("simulate", "seed"): (0, None),
    ("sweep", "skins"): (0, 10_000),
    ("sweep", "seed"): (0, None),
    ("sweep", "chunk"): (1, None),
    ("sweep", "workers"): (1, None),
    ("table", "presses"): (1, 1_000_000),
    ("table", "pairs"): (0, 1_000_000),
    ("table", "skins"): (1, 10_000),
    ("table", "seed"): (0, None),
    ("table", "workers"): (1, None),
    ("train", "drag"): (0, None),
    ("train", "members"): (1, 100),
    ("train", "minutes"): (0.01, None),
    ("train", "seed"): (0, None),
    ("view", "port"): (0, 65535),
    ("view", "seconds"): (0, None),
    ("virtual-bench", "seed"): (0, None),
}
"""Least and largest values that are taken."""


def leaves(command, name="smoskin"):
    """Every command below this one, by its name."""
    below = getattr(command, "commands", None)
    if below is None:
        return {name: command}
    return {key: leaf for part, each in below.items() for key, leaf in leaves(each, part).items()}


COMMANDS = leaves(typer.main.get_command(app))


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_where_nothing_is_said_the_usual_is_done(name):
    options = {option.name: option for option in COMMANDS[name].params}
    usual = {key: option.default for key, option in options.items() if option.default is not None}
    usual = {key: str(value) if isinstance(value, Path) else value for key, value in usual.items()}
    if "design" in usual:
        assert usual.pop("design") == "planar"
    switches = {key for key, value in usual.items() if value is False}
    assert {key: value for key, value in usual.items() if key not in switches} == USUAL.get(
        name, {}
    )
    # Switches are off, and each is a flag.
    assert all(options[key].is_flag for key in switches)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_numbers_past_their_ends_are_wrong_use(name):
    ends = {}
    for option in COMMANDS[name].params:
        kind = getattr(option, "type", option)  # typer of its own click knows them itself
        if getattr(kind, "min", None) is not None:
            ends[name, option.name] = kind.min, kind.max
    assert ends == {key: value for key, value in ENDS.items() if key[0] == name}


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_no_command_replaces_files_unless_it_is_forced(name):
    options = COMMANDS[name].params
    force = [option for option in options if "--force" in option.opts and option.is_flag]
    assert [option.default for option in force] == [False] * len(force)
    writes = {"--out", "--record"} & {text for option in options for text in option.opts}
    # A simulation and a rig's touches go on with what is there; the demonstration refuses, and has
    # no other way.
    assert force or not writes or name in {"demo", "press", "simulate"}


def test_every_option_of_the_demonstration_reaches_it(monkeypatch, tmp_path):
    given = {}

    def run_demo(design, **options):
        given.update(options, design=design.name)
        options["on_start"](None)
        summary = SimpleNamespace(found=1, touches=1, unread=0)
        return SimpleNamespace(summary=summary)

    monkeypatch.setattr(smoskin.commands.demo, "run_demo", run_demo)
    monkeypatch.setattr(smoskin.cli.live, "load_response_table", lambda path: ("table", path.name))
    monkeypatch.setattr(smoskin.cli.live, "tell", lambda result, as_json: None)
    record = tmp_path / "a.mcap"
    options = (
        "demo optimised --headless --json --seconds 7 --rate 50 --seed 3 --touches 4 --port 99"
    )
    files = ["--table", "own.table", "--estimator", "a.net", "--estimator", "b.net"]
    done = CliRunner().invoke(app, [*options.split(), *files, "--record", str(record)])
    assert done.exit_code == 0, done.output
    assert "A hand touches the skin for 7 s" in done.stderr
    expected = {
        "design": "optimised",
        "seconds": 7.0,
        "page": False,
        "port": 99,
        "rate": 50.0,
        "seed": 3,
        "calibration_touches": 4,
        "table": ("table", "own.table"),
        "record": record,
    }
    assert {name: given[name] for name in expected} == expected
    assert [file.name for file in given["others"]] == ["a.net", "b.net"]


@pytest.mark.parametrize("kept", [True, False])
def test_a_search_fails_by_its_exit_code_where_limits_are_broken(monkeypatch, tmp_path, kept):
    class Found:
        warning = "no time was left"

        def write(self, out):
            return out, out.with_suffix(".json")

        def as_json(self):
            return {"kept": kept}

        def verdict(self):
            return "one sentence"

    optimised = Found()
    optimised.kept = kept
    monkeypatch.setattr(smoskin.commands.optimise, "optimise", lambda *_, **__: optimised)
    done = CliRunner().invoke(app, ["optimise", "--out", str(tmp_path / "b.toml"), "--json"])
    assert done.exit_code == (0 if kept else 1), done.output
    assert json.loads(done.stdout) == {"kept": kept}
    assert done.stderr.endswith("warning: no time was left\none sentence\n")
