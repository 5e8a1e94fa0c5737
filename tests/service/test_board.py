"""A board without hardware, from a design."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest

from smoskin.design.skin import SkinDesign
from smoskin.service import board
from smoskin.service.source import open_source

pytest.importorskip("serial")


def test_a_virtual_board_is_read_as_a_real_one_would_be(
    planar: SkinDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports, there, ended = [], threading.Event(), threading.Event()
    clock = SimpleNamespace(monotonic=lambda: 1.0 if ended.is_set() else 0.0)
    monkeypatch.setattr(board, "time", clock)

    def announce(port: str) -> None:
        ports.append(port)
        there.set()

    done = []
    running = threading.Thread(
        target=lambda: done.append(
            board.run_board(planar, rate=200.0, seed=4, seconds=1.0, on_start=announce)
        )
    )
    running.start()
    assert there.wait(20.0)
    with open_source(f"serial://{ports[0]}") as source:
        readings = [source.read(20.0) for _ in range(60)]
    ended.set()
    running.join(20.0)
    fields = np.array([reading.field for reading in readings])
    # The hand touches the skin: its magnets move.
    assert np.ptp(fields[:, 1:, 2], axis=0).max() > 100e-6
    assert not np.any([reading.flags for reading in readings])
    assert done[0].sent >= 60
