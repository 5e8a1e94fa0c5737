"""How every command ends, and what the help says of them."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

pytest.importorskip("typer")

from smoskin.cli import app, frame
from smoskin.cli.frame import GroupedCommands, keep_compiled
from smoskin.errors import ArgumentError


def ended(monkeypatch, capsys, error):
    """Exit code and what is said where a command raises this."""

    def fail(**_):
        raise error

    monkeypatch.setattr(frame, "app", fail)
    monkeypatch.setattr(frame, "keep_compiled", lambda: None)
    with pytest.raises(SystemExit) as end:
        frame.main()
    return end.value.code


def test_errors_are_one_line_and_a_code(monkeypatch, capsys):
    assert ended(monkeypatch, capsys, ArgumentError("no")) == "error: no"
    assert ended(monkeypatch, capsys, KeyboardInterrupt()) == 130
    missing = FileNotFoundError(2, "No such file or directory", "no/such/t.table")
    assert ended(monkeypatch, capsys, missing) == (
        "error: no/such/t.table: No such file or directory"
    )
    assert ended(monkeypatch, capsys, OSError(28, "No space left on device")) == (
        "error: No space left on device"
    )
    monkeypatch.setattr(sys, "stderr", SimpleNamespace(close=lambda: None))
    assert ended(monkeypatch, capsys, BrokenPipeError()) == 1


def test_every_command_stands_in_one_group():
    names = [name for group in frame._GROUPS.values() for name in group]
    assert len(names) == len(set(names))
    from typer.main import get_command

    commands = get_command(app)
    assert isinstance(commands, GroupedCommands)
    assert set(commands.commands) <= set(names)
    assert commands.list_commands(None)[:3] == ["demo", "run", "info"]


def test_a_command_in_no_group_is_listed_all_the_same():
    import typer

    own = typer.Typer(cls=GroupedCommands, rich_markup_mode=None)
    own.command("demo")(lambda: None)
    own.command("else")(lambda: None)
    own.command("first")(lambda: None)
    from typer.testing import CliRunner

    text = CliRunner().invoke(own, ["--help"]).output
    assert text.index("See and read a skin:") < text.index("Other:") < text.index("else")


@pytest.mark.parametrize("given", [None, "mine", "cache"])
def test_what_jax_compiles_is_kept_in_the_users_folder(monkeypatch, tmp_path, given):
    monkeypatch.setattr(os, "environ", {"XDG_CACHE_HOME": str(tmp_path)})
    if given == "mine":
        os.environ["JAX_COMPILATION_CACHE_DIR"] = "mine"
    if given == "cache":
        (tmp_path / "smoskin").write_text("a file where the folder should be")
    keep_compiled()
    kept = os.environ.get("JAX_COMPILATION_CACHE_DIR")
    folder = tmp_path / "smoskin" / "jax"
    assert kept == {None: str(folder), "mine": "mine", "cache": None}[given]
    assert folder.is_dir() == (given is None)


def test_the_package_runs_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "smoskin", "--version"], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout) == (0, "smoskin 0.1.0\n")


def test_a_missed_touch_is_exit_code_1(monkeypatch):
    """The demonstration's own answer decides: all found is 0, one missed is 1."""
    from typer.testing import CliRunner

    from smoskin.commands import demo
    from smoskin.commands.demo import DemoResult, Summary

    for found, code in ((2, 0), (1, 1)):
        summary = Summary(
            estimator="BayesEstimator", calibration_touches=15, touches=2, found=found,
            mean_position_error_mm=0.3, mean_force_error_percent=0.2, rate_hz=100.0,
            latency_us_median=500.0, first_touch_after_s=5.0,
        )  # fmt: skip
        given = {}

        def run_demo(design, summary=summary, given=given, **options):
            given.update(options)
            return DemoResult(touches=(), summary=summary)

        monkeypatch.setattr(demo, "run_demo", run_demo)
        for arguments in (["demo", "--headless"], ["demo", "--headless", "--json"]):
            assert CliRunner().invoke(app, arguments).exit_code == code
        assert given["seconds"] == 15.0
        assert given["page"] is False
        assert (given["rate"], given["seed"], given["calibration_touches"]) == (100.0, 0, 15)
