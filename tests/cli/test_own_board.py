"""A person with an AnySkin board: four commands from nothing to touches, on a byte-level fake."""

import re
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from boards import Line
from pads import REST, counted, pressed
from smoskin.hardware.wire.foreign import anyskin_frame

pytest.importorskip("serial")
pytest.importorskip("safetensors")


def smoskin(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "smoskin", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )


class Board:
    """Sends what a pad's chips read while a hand presses where it is told."""

    def __init__(self, line: Line, seed: int) -> None:
        self.line, self.rng = line, np.random.default_rng(seed)
        self.place: np.ndarray | None = None
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> "Board":
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stopped.set()
        self.thread.join(5.0)

    def _run(self) -> None:
        level, change = 0.0, np.zeros((5, 3))
        while not self.stopped.wait(1 / 60):
            place = self.place
            if place is not None and level == 0.0:
                missed = place + self.rng.normal(0.0, 0.3e-3, 2)
                change = pressed(missed, 0.5 * (1 + 0.03 * self.rng.normal()))
            level = min(max(level + (0.1 if place is not None else -0.1), 0.0), 1.0)
            noise = self.rng.normal(0.0, 1.5e-6, (5, 3))
            frame = anyskin_frame(counted(REST + level * change + noise), np.full(5, 25.0))
            # A board drops what nobody reads.
            with suppress(BlockingIOError):
                self.line.send(frame)


def followed(folder: Path, board: Board, on_line: Callable[[str], None], *arguments: str) -> str:
    """What a command prints while somebody does what it says."""
    with subprocess.Popen(
        [sys.executable, "-m", "smoskin", *arguments], cwd=folder, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        giving_up = threading.Timer(150.0, process.kill)
        giving_up.start()
        printed = []
        for line in process.stdout:
            printed.append(line)
            on_line(line)
        giving_up.cancel()
    assert process.returncode == 0, "".join(printed)
    return "".join(printed)


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_an_anyskin_board_is_learned_and_run(tmp_path: Path) -> None:
    smoskin(tmp_path, "touches", "grid", "--count", "30", "--out", "plan.csv")
    with Line() as line, Board(line, 0) as board:

        def obeys(sentence: str) -> None:
            where = re.search(r"press at x ([\d.]+) mm, y ([\d.]+) mm", sentence)
            board.place = None if where is None else 1e-3 * np.array(where.groups(), float)

        url = f"serial://{line.port}?format=anyskin"
        recorded = followed(tmp_path, board, obeys, "touches", "record", url)
    assert "30 touches in touches.csv" in recorded
    learned = smoskin(tmp_path, "learn", "touches.csv", "--out", "own.model")
    error = re.search(r"mean_error_mm: ([\d.]+)", learned.stdout)
    assert error is not None
    assert float(error.group(1)) < 2.5
    with Line() as line, Board(line, 9) as board:

        def presses(sentence: str) -> None:
            if "NO_CONTACT" in sentence:
                board.place = np.array([12e-3, 18e-3])

        url = f"serial://{line.port}?format=anyskin"
        options = ("--calibration", "own.model", "--seconds", "6", "--every", "0.1")
        run = followed(tmp_path, board, presses, "run", url, *options)
    touched = re.findall(r" CONTACT +x +([-\d.]+) mm +y +([-\d.]+) mm", run)
    assert len(touched) >= 10
    place = np.median(np.array(touched[-8:], float), axis=0)
    np.testing.assert_allclose(place, [12.0, 18.0], atol=4.0)
