"""A board without hardware, from a design."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.design.skin import SkinDesign
from smoskin.service import board
from smoskin.service.source import open_source
from smoskin.twin.reduced import ReducedTwin

pytest.importorskip("serial")


def test_a_virtual_board_is_read_as_a_real_one_would_be(
    planar: SkinDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports, there, ended = [], threading.Event(), threading.Event()
    clock = SimpleNamespace(monotonic=lambda: 1.0 if ended.is_set() else 0.0, sleep=time.sleep)
    monkeypatch.setattr(board, "time", clock)

    def announce(port: str) -> None:
        ports.append(port)
        there.set()

    done = []
    running = threading.Thread(
        target=lambda: done.append(
            board.run_board(planar, rate=50.0, seed=4, seconds=1.0, on_start=announce)
        )
    )
    running.start()
    assert there.wait(20.0)
    # Whoever opens the port finds the skin untouched; then the hand moves its magnets.
    rest = ReducedTwin(planar).read().field
    for _ in range(2):
        with open_source(f"serial://{ports[0]}") as source:
            moved = [np.abs(source.read(20.0).field - rest)[1:].max() for _ in range(2)]
            assert max(moved) < 50e-6
            while moved[-1] < 100e-6:
                reading = source.read(20.0)
                assert not reading.flags.any()
                moved.append(np.abs(reading.field - rest)[1:].max())
        time.sleep(0.1)
    ended.set()
    running.join(20.0)
    assert done[0].sent >= 20


def test_a_board_whose_readings_end_ends(
    planar: SkinDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = []

    class Ending(board.VirtualBoard):
        watched = True

        def restart(self, source: object) -> None:
            pass

        def step(self) -> bool:
            steps.append(1)
            return len(steps) < 3

    monkeypatch.setattr(board, "VirtualBoard", Ending)
    board.run_board(planar, seconds=5.0)
    assert len(steps) == 3
