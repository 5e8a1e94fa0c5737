"""Options of the command line: their defaults, and that each reaches the work it names."""

import json
from types import SimpleNamespace

import pytest

pytest.importorskip("typer")

import typer
from typer.testing import CliRunner

import smoskin.cli.live
import smoskin.commands.demo
import smoskin.commands.optimise
from smoskin.cli import app


def leaves(command, name="smoskin"):
    """Every command below this one, by its name."""
    below = getattr(command, "commands", None)
    if below is None:
        return {name: command}
    return {key: leaf for part, each in below.items() for key, leaf in leaves(each, part).items()}


COMMANDS = leaves(typer.main.get_command(app))


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_no_command_replaces_files_unless_it_is_forced(name):
    options = COMMANDS[name].params
    force = [option for option in options if "--force" in option.opts and option.is_flag]
    assert [option.default for option in force] == [False] * len(force)
    writes = {"--out", "--record"} & {text for option in options for text in option.opts}
    # A simulation resumes what its folder holds; the demonstration refuses, and has no other way.
    assert force or not writes or name in {"demo", "simulate"}


def test_every_option_of_the_demonstration_reaches_it(monkeypatch, tmp_path):
    given = {}

    def run_demo(design, **options):
        given.update(options, design=design.name)
        options["on_start"](None)
        summary = SimpleNamespace(found=1, touches=1)
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
        def write(self, out):
            return out, out.with_suffix(".json")

        def as_json(self):
            return {"kept": kept}

        def verdict(self):
            return "one sentence"

    found = Found()
    found.kept = kept
    monkeypatch.setattr(smoskin.commands.optimise, "optimise", lambda *_, **__: found)
    done = CliRunner().invoke(app, ["optimise", "--out", str(tmp_path / "b.toml"), "--json"])
    assert done.exit_code == (0 if kept else 1), done.output
    assert json.loads(done.stdout) == {"kept": kept}
    assert "one sentence" in done.stderr
