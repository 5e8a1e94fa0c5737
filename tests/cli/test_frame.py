"""What commands share, and what the help says of them."""

import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

pytest.importorskip("typer")

from smoskin import cli
from smoskin.cli import app, frame
from smoskin.cli.frame import GroupedCommands


def test_every_command_stands_in_one_group():
    names = [name for group in frame._GROUPS.values() for name in group]
    assert len(names) == len(set(names))
    from typer.main import get_command

    commands = get_command(app)
    assert isinstance(commands, GroupedCommands)
    assert set(commands.commands) <= set(names)
    assert commands.list_commands(None)[:3] == ["demo", "run", "view"]


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


def test_the_program_is_named_and_told_when_it_began(monkeypatch, capsys):
    import time

    import smoskin.cli

    monkeypatch.setattr(sys, "argv", ["somewhere/__main__.py", "--help"])
    with pytest.raises(SystemExit) as ended:
        smoskin.cli._run(0.0)
    assert ended.value.code == 0
    assert "Usage: smoskin " in capsys.readouterr().out
    from types import SimpleNamespace

    clock = frame.clock_of(SimpleNamespace(obj=time.monotonic() - 7.0))
    assert 7.0 <= clock() < 20.0
    assert frame.clock_of(SimpleNamespace(obj=None))() < 10.0


def test_a_missed_touch_is_exit_code_1(monkeypatch):
    """The demonstration's own answer decides: one missed is 1, and so is nothing read."""
    from typer.testing import CliRunner

    from smoskin.commands import demo
    from smoskin.commands.demo import DemoResult, Summary

    for touches, unread, located, code in ((2, 0, 2, 0), (2, 0, 1, 1), (2, 1, 2, 0), (0, 2, 0, 1)):
        summary = Summary(
            estimator="BayesEstimator", calibration_touches=15, touches=touches, found=located,
            unread=unread,
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


def test_progress_is_told_in_lines_where_there_is_no_terminal(capsys):
    seconds = iter([0.0, 1.0, 5.0, 6.0, 11.0])
    tell = frame._ProgressLines(lambda: next(seconds))
    for k in range(4):
        tell(f"step {k}", k / 4)
    assert capsys.readouterr().err.splitlines() == [
        "    5 s   25 %  step 1",
        "   11 s   75 %  step 3",
    ]


def test_progress_is_a_bar_on_a_terminal(monkeypatch):
    import rich.console
    import rich.progress

    done = []

    class Bar:
        def __init__(self, *, console, transient):
            assert console.is_terminal
            assert console.stderr
            assert transient

        def __enter__(self):
            return self

        def __exit__(self, *_):
            done.append("over")

        def add_task(self, what, *, total):
            done.append((what, total))
            return 7

        def update(self, task, *, description, completed):
            done.append((task, description, completed))

    monkeypatch.setattr(rich.console.Console, "is_terminal", True)
    monkeypatch.setattr(rich.progress, "Progress", Bar)
    with frame.progress_bar() as progress:
        progress("learning", 0.25)
    assert done == [("", 1.0), (7, "learning", 0.25), "over"]


def test_a_refused_argument_is_repeated_on_one_short_line():
    from typer.testing import CliRunner

    done = CliRunner().invoke(app, ["info", "--" + 400 * "x" + "\n"])
    assert done.exit_code == 2
    assert 30 * "x" in done.stderr
    assert 201 * "x" not in done.stderr.replace("\n", "").replace("│", "").replace(" ", "")


def test_the_log_may_be_asked_for_behind_a_command(caplog, monkeypatch):
    import logging

    from typer.testing import CliRunner

    monkeypatch.setattr(logging.getLogger("smoskin"), "level", logging.WARNING)
    for arguments in (["-v", "info"], ["info", "--verbose"]):
        logging.getLogger("smoskin").setLevel(logging.WARNING)
        assert CliRunner().invoke(app, arguments).exit_code == 0
        assert logging.getLogger("smoskin").level == logging.INFO


def test_every_command_has_an_example_and_a_whole_first_sentence():
    from typer.main import get_command
    from typer.testing import CliRunner

    commands = get_command(app).commands
    text = CliRunner().invoke(app, ["--help"]).output
    assert "..." not in text.partition("\n")[2]
    for name, command in commands.items():
        for subcommand in getattr(command, "commands", {"": command}).values():
            assert "smoskin " in (subcommand.epilog or ""), name


def test_minutes_are_counted_from_the_program_s_start(monkeypatch):
    begun = []
    monkeypatch.setattr(cli, "_app", lambda: lambda **given: begun.append(given["obj"]))
    monkeypatch.setattr(cli, "heed_signals", lambda: None)
    before = time.monotonic()
    with pytest.raises(SystemExit) as done:
        cli.main()
    assert done.value.code == 0
    assert before <= begun[0] <= time.monotonic()
    early = frame.clock_of(SimpleNamespace(obj=begun[0] - 100.0))
    assert 100.0 <= early() < 200.0
    assert 0.0 <= frame.clock_of(SimpleNamespace(obj=None))() < 100.0
