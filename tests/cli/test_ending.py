"""How the program ends: exit codes, sentences, signals at any moment, and no traceback ever."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import pytest

pytest.importorskip("typer")

from smoskin.cli import ending, keep_compiled
from smoskin.errors import ArgumentError

MAIN = "from smoskin.cli import main; main()"


@pytest.fixture(autouse=True)
def nothing_heard(monkeypatch):
    monkeypatch.setattr(ending, "_heard", [])
    monkeypatch.setattr(ending, "_kept", [])
    monkeypatch.setattr(signal, "signal", lambda *_: None)


def ended(error):
    """Exit code where the work raises this."""

    def fail():
        raise error

    return ending.run_to_end(fail)


def test_errors_are_one_line_and_a_code(capsys):
    assert ended(ArgumentError("no")) == 1
    assert ended(SystemExit("error: never")) == 1
    assert ended(FileNotFoundError(2, "No such file or directory", "no/such/t.table")) == 1
    assert ended(OSError(28, "No space left on device")) == 1
    assert capsys.readouterr().err.splitlines() == [
        "error: no",
        "error: never",
        "error: no/such/t.table: No such file or directory",
        "error: No space left on device",
    ]
    assert ended(BrokenPipeError()) == 1
    assert ended(SystemExit(2)) == 2
    assert ended(KeyboardInterrupt()) == 130
    assert ending.run_to_end(lambda: None) == 0
    assert capsys.readouterr().err == ""


def test_control_characters_of_a_message_are_escaped(capsys):
    ended(ArgumentError("\x1b[31mred\n"))
    assert capsys.readouterr().err == "error: \\x1b[31mred\\n\n"


def test_what_is_unforeseen_is_a_bug_with_a_report(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert ended(TypeError("x" * 1000)) == 70
    message = capsys.readouterr().err
    (report,) = (tmp_path / "smoskin").iterdir()
    assert message.startswith("error: this is a bug in smoskin: TypeError: xxx")
    assert message.endswith(f"xxx; the report lies at {report}\n")
    assert len(message) <= 301
    assert "Traceback" not in message
    text = report.read_text()
    assert "smoskin 0.1.0" in text
    assert "x" * 1000 in text
    assert "Traceback" in text


def test_a_report_that_cannot_be_kept_lies_elsewhere(monkeypatch, tmp_path, capsys):
    (tmp_path / "smoskin").write_text("in the way")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert ended(ZeroDivisionError("no")) == 70
    assert f"lies at {tmp_path}/bug-" in capsys.readouterr().err


def test_whoever_debugs_sees_the_traceback(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("SMOSKIN_DEBUG", "1")
    assert ended(TypeError("no")) == 70
    assert "Traceback" in capsys.readouterr().err


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


def test_where_no_folder_for_caches_is_named_it_is_the_usual_one(monkeypatch, tmp_path):
    monkeypatch.setattr(os, "environ", {"HOME": str(tmp_path)})
    keep_compiled()
    folder = tmp_path / ".cache" / "smoskin" / "jax"
    assert folder.is_dir()
    assert os.environ["JAX_COMPILATION_CACHE_DIR"] == str(folder)


def stopped(program, number, again=0.0, before=""):
    """A program that hears signals, stopped once it says that it works; and what it left."""
    start = (
        # Whoever runs the tests in the background may have had signals ignored.
        "import signal, sys, time\nfrom smoskin.cli.ending import *\n"
        "for number in (signal.SIGINT, signal.SIGHUP): signal.signal(number, signal.SIG_DFL)\n"
        f"{before}\nheed_signals()\n"
    )
    code = start + textwrap.dedent(program)
    running = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert running.stdout.readline() == "works\n"
    running.send_signal(number)
    if again:
        time.sleep(again)
        running.send_signal(number)
    out, err = running.communicate(timeout=30)
    return running.returncode, out, err


LATE = """
    real, calls = signal.signal, 0
    def late(number, handler):
        global calls
        calls += 1
        if calls == {call}:
            signal.raise_signal({number:d})
        return real(number, handler)
    def work():
        if {number:d} == signal.SIGALRM:
            exec("raise_signal(SIGHUP)", vars(signal) | dict(__name__="jax"))
        signal.signal = late
    print("works", flush=True)
    time.sleep(0.1)
    sys.exit(run_to_end(work))
"""


@pytest.mark.parametrize("call", [1, 2, 3])
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGALRM])
def test_a_signal_as_the_work_ends_leaves_no_traceback(number, call):
    """The signal itself, or the next try of one that waited."""
    code, _, message = stopped(LATE.format(number=number, call=call), 0)
    heard = (128 + signal.SIGHUP, "Stopped by SIGHUP: the terminal is closed.\n")
    assert (code, message) == heard or (number, code, message) == (
        signal.SIGHUP,
        -signal.SIGHUP,
        "",
    )


WORK = """
    def work():
        with if_stopped(lambda: "half is kept"):
            print("works", flush=True)
            time.sleep(20)
    sys.exit(run_to_end(work))
"""


@pytest.mark.parametrize(
    ("number", "sentence"),
    [
        (signal.SIGINT, "Stopped by Ctrl-C; half is kept.\n"),
        (signal.SIGTERM, "Stopped by SIGTERM; half is kept.\n"),
        (signal.SIGHUP, "Stopped by SIGHUP: the terminal is closed; half is kept.\n"),
    ],
)
def test_a_signal_ends_the_work_with_a_sentence(number, sentence):
    assert stopped(WORK, number) == (128 + number, "", sentence)


MASKED = """
    def work():
        try:
            print("works", flush=True)
            time.sleep(20)
        except KeyboardInterrupt as stop:
            raise TypeError("compiled code makes its own error of it") from stop
    sys.exit(run_to_end(work))
"""


def test_an_error_that_compiled_code_makes_of_a_signal_is_no_bug():
    assert stopped(MASKED, signal.SIGTERM) == (143, "", "Stopped by SIGTERM.\n")


COMPILER = """
    compiler = {"__name__": "jax._src.compiler", "print": print, "time": time}
    exec('''def compile():
        print("works", flush=True)
        begin = time.monotonic()
        while time.monotonic() < begin + SECONDS: time.sleep(0.01)
        print("compiled", flush=True)
    ''', compiler)
    def work():
        compiler["compile"]()
        time.sleep(20)
    sys.exit(run_to_end(work))
"""


def test_a_signal_waits_until_jax_has_compiled():
    left = stopped(COMPILER.replace("SECONDS", "0.5"), signal.SIGINT)
    assert left == (130, "compiled\n", "Stopped by Ctrl-C.\n")


def test_a_second_ctrl_c_does_not_wait():
    assert stopped(COMPILER.replace("SECONDS", "20"), signal.SIGINT, again=0.2) == (130, "", "")


def test_what_the_system_ignores_stays_ignored():
    program = WORK.replace("20", "0.5")
    ignored = "signal.signal(signal.SIGHUP, signal.SIG_IGN)"
    assert stopped(program, signal.SIGHUP, before=ignored) == (0, "", "")


def test_a_full_output_is_told_and_a_poor_one_served():
    arguments = [sys.executable, "-c", MAIN, "info"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(arguments, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (1, "error: No space left on device\n")
    poor = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run(arguments, capture_output=True, env=poor, timeout=60, check=True)
    assert done.stdout.isascii()
    assert done.stderr == b""
