"""What commands share, and what the help says of them."""

import subprocess
import sys

import pytest

pytest.importorskip("typer")

from smoskin.cli import app, frame
from smoskin.cli.frame import GroupedCommands


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
