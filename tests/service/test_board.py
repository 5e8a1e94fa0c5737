"""A board without hardware, from a design."""

import threading

import numpy as np
import pytest

from smoskin.design.skin import SkinDesign
from smoskin.service.board import run_board
from smoskin.service.source import open_source

pytest.importorskip("serial")


def test_a_virtual_board_is_read_as_a_real_one_would_be(planar: SkinDesign) -> None:
    ports, there = [], threading.Event()

    def announce(port: str) -> None:
        ports.append(port)
        there.set()

    done = []
    running = threading.Thread(
        target=lambda: done.append(
            run_board(planar, rate=200.0, seed=4, seconds=1.0, on_start=announce)
        )
    )
    running.start()
    assert there.wait(20.0)
    with open_source(f"serial://{ports[0]}") as source:
        readings = [source.read() for _ in range(60)]
    running.join(20.0)
    fields = np.array([reading.field for reading in readings])
    # The hand touches the skin: its magnets move.
    assert np.ptp(fields[:, 1:, 2], axis=0).max() > 100e-6
    assert not np.any([reading.flags for reading in readings])
    assert done[0].sent >= 60
