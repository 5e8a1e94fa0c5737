"""Signals and kills at random moments: no crash, no traceback, files whole, little lost.

SMOSKIN_SIGNALS and SMOSKIN_KILLS say how many there are; in full 60 and 40.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from smoskin import open_recording
from smoskin.datasets.store import open_dataset
from smoskin.sensing.network.model import load_network
from smoskin.sensing.response.table import load_response_table

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1500)]

SOURCE = Path(__file__).parents[2] / "src"
SIGNALS = int(os.environ.get("SMOSKIN_SIGNALS", "12"))
KILLS = int(os.environ.get("SMOSKIN_KILLS", "6"))
AT_ONCE = 2
PATIENCE = 90.0
"""s in which a program must end once it is told to, on a machine with other work."""
COMMANDS = {
    "demo": ("demo", "--headless", "--seconds", "4", "--record", "r.mcap"),
    "run": ("run", "twin://planar", "--seconds", "8", "--record", "r.mcap"),
    "table": (
        *("table", "--out", "t.table", "--folder", "p", "--presses", "3640", "--pairs", "20"),
        *("--skins", "2", "--workers", "1"),
    ),
    "sweep": (
        *("sweep", "--kind", "random", "--count", "4000", "--out", "s", "--chunk", "50"),
        *("--workers", "1"),
    ),
    "simulate": ("simulate", "--at", "45,80"),
    "train": (
        *("train", str(SOURCE / "smoskin/sensing/response/planar.table")),
        *("--out", "n.safetensors", "--minutes", "0.5"),
    ),
}


@dataclass(frozen=True)
class Trial:
    """A command, and the signal that meets it after so many seconds."""

    number: int
    command: str
    signal: signal.Signals
    delay: float
    compiled: bool
    """Whether what JAX compiles is there already."""

    def __str__(self) -> str:
        compiled = "" if self.compiled else ", nothing compiled"
        return f"{self.number}: {self.command}, {self.signal.name} at {self.delay:.2f} s{compiled}"


def started(words: tuple[str, ...], folder: Path, *, compiled: bool = True) -> subprocess.Popen:
    """A program in a folder of its own, its output in files there."""
    folder.mkdir(parents=True)
    caches = os.environ["JAX_COMPILATION_CACHE_DIR"] if compiled else str(folder / "jax")
    environment = os.environ | {
        "PYTHONPATH": str(SOURCE),
        "PYTHONUNBUFFERED": "1",
        "XDG_STATE_HOME": str(folder),
        "JAX_COMPILATION_CACHE_DIR": caches,
    }
    with (folder / "out").open("wb") as out, (folder / "err").open("wb") as err:
        return subprocess.Popen(
            [sys.executable, "-m", "smoskin", *words],
            cwd=folder,
            env=environment,
            stdout=out,
            stderr=err,
        )


@pytest.fixture(autouse=True)
def ctrl_c():
    """Programs start with Ctrl-C as a terminal has it: what a shell starts with & ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def hears(process: subprocess.Popen, number: int) -> bool:
    """Whether a program handles a signal: before it has begun, the interpreter's defaults hold."""
    try:
        status = Path(f"/proc/{process.pid}/status").read_text()
    except OSError:
        return False
    caught = next((line for line in status.splitlines() if line.startswith("SigCgt")), "SigCgt: 0")
    return bool(int(caught.split()[1], 16) >> (number - 1) & 1)


def met(trial: Trial, folder: Path) -> tuple[str, str]:
    """How a program met a signal, and what that broke, in words; "" if nothing."""
    process = started(COMMANDS[trial.command], folder, compiled=trial.compiled)
    try:
        time.sleep(trial.delay)
        heard = hears(process, signal.SIGTERM)
        while trial.signal == signal.SIGINT and not heard and process.poll() is None:
            time.sleep(0.01)  # before the program Python itself hears Ctrl-C, and tells it
            heard = hears(process, signal.SIGTERM)
        done = process.poll() is not None
        process.send_signal(trial.signal)
        code = process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        return "hung", f"{trial}: did not end within {PATIENCE:g} s"
    finally:
        process.kill()
        process.wait()
    stderr = (folder / "err").read_text(errors="replace")
    stopped = 128 + trial.signal
    how = "ended before it" if done else "stopped" if heard else "not begun"
    if not done and code not in ((0, 1, stopped) if heard else (-trial.signal, stopped)):
        return how, f"{trial}: exit code {code}; {stderr[-300:]}"
    if "Traceback" in stderr or "this is a bug" in stderr:
        return how, f"{trial}: {stderr[-500:]}"
    if code == stopped and "Stopped by" not in stderr:
        return how, f"{trial}: not a word; {stderr[-300:]}"
    try:
        check_files(folder, closed=heard)
    except Exception as error:
        return how, f"{trial}: {type(error).__name__}: {error}"
    return how, ""


def check_files(folder: Path, *, closed: bool) -> None:
    """Raise where a file is not whole."""
    assert not (folder / "t.table").exists() or load_response_table(folder / "t.table")
    assert not (folder / "n.safetensors").exists() or load_network(folder / "n.safetensors")
    for manifest in (*folder.glob("s/manifest.json"), *folder.glob("p/*/manifest.json")):
        assert open_dataset(manifest.parent).damaged() == ()
    for line in (text for file in folder.glob("*.jsonl") for text in file.read_text().splitlines()):
        json.loads(line)
    for file in folder.glob("*.mcap"):
        recording = open_recording(file)
        assert not (closed and recording.truncated), "the recording was not closed"
        assert recording.lost_chunks == 0
        assert len(list(recording)) == recording.reading_count


def test_no_signal_breaks_a_program_or_its_files(tmp_path):
    rng, trials = np.random.default_rng(int(os.environ.get("SMOSKIN_SEED", "1"))), []
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    for k in range(SIGNALS):
        command = list(COMMANDS)[k % len(COMMANDS)]
        late = 3.0 if command == "simulate" or k % 2 else 9.0
        number = numbers[(k // len(COMMANDS) + k) % 3]
        trials.append(Trial(k, command, number, float(rng.uniform(0.1, late)), k % 4 != 3))
    with ThreadPoolExecutor(AT_ONCE) as pool:
        outcomes = list(pool.map(lambda t: met(t, tmp_path / str(t.number)), trials))
    print(Counter(how for how, _ in outcomes))
    assert [what for _, what in outcomes if what] == []


def lost(folder: Path, delay: float) -> tuple[float, float]:
    """Readings that a kill loses and the largest gap between two, s; nan while none was read."""
    words = ("run", "twin://planar?mechanics=reduced", "--record", "r.mcap", "--json")
    process = started(words, folder)
    try:
        until = time.monotonic() + PATIENCE
        while not (folder / "out").stat().st_size:
            assert time.monotonic() < until, "no reading came"
            time.sleep(0.01)
        time.sleep(delay)
    finally:
        process.kill()
        process.wait()
    whole = (folder / "out").read_text().rpartition("\n")[0].splitlines()
    times = [json.loads(line)["time_s"] for line in whole]
    recording = open_recording(folder / "r.mcap")
    kept = [reading.time for reading in recording.readings()]
    assert recording.lost_chunks == 0
    assert len(kept) == recording.reading_count
    reached = kept[-1] if kept else times[0]
    return max(times[-1] - reached, 0.0), max(np.diff(times), default=0.0)


def test_a_kill_loses_at_most_a_second_of_a_recording(tmp_path):
    delays = np.random.default_rng(2).uniform(0.0, 4.0, KILLS)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        losses = list(pool.map(lambda k: lost(tmp_path / str(k), delays[k]), range(KILLS)))
    print("lost, s:", [round(seconds, 2) for seconds, _ in losses])
    assert [(s, gap) for s, gap in losses if s > 1.0 + gap + 0.05] == []
