"""Latency of a board's line: from a frame written whole to its reading out of `read`.

The board is a process of its own at the far end of a pseudo-terminal, as a real one is at the end
of its cable, so that what a cable takes is not in it. What is lost is counted too.
Run alone on a quiet machine: ``python benchmarks/bench_board.py --seconds 60``.
"""

import argparse
import multiprocessing
import os
import time
import tty
from collections.abc import Sequence
from multiprocessing.connection import Connection

import numpy as np

from smoskin.feasibility import load_design
from smoskin.hardware.board import scan_of
from smoskin.hardware.serial import SerialSource
from smoskin.hardware.wire.messages import BoardScan, reading_frame
from smoskin.magnetics import mlx90393
from smoskin.records import Reading

RATES = (200, 500, 1000)
"""Readings a second, Hz."""
DESIGN = load_design("planar")
START = 0.5
"""Seconds before the first frame."""


def frames(count: int, rate: float) -> list[bytes]:
    """Frames of the planar design's board, which tell the numbers of their scans."""
    setting = DESIGN.hall_setting
    addresses = tuple(site.address for site in DESIGN.halls)
    sent = []
    for number in range(count):
        field = mlx90393.tesla(np.full((len(addresses), 3), number % 8000), setting)
        scan = scan_of(Reading(time=0.0, field=field), DESIGN, number / rate)
        board = BoardScan(sequence=number % 65536, scan=scan, addresses=addresses, setting=setting)
        sent.append(reading_frame(board))
    return sent


def send(far_end: int, frames: Sequence[bytes], rate: float, tell: Connection) -> None:
    """Write the frames at their rate, and tell when each had been written, s."""
    start, written = time.monotonic() + START, []
    for number, frame in enumerate(frames):
        time.sleep(max(0.0, start + number / rate - time.monotonic()))
        os.write(far_end, frame)
        written.append(time.monotonic())
    tell.send(written)


def measure(rate: int, seconds: float) -> None:
    """Print what came over a line at a rate, and how late."""
    far_end, near_end = os.openpty()
    tty.setraw(near_end)
    count = round(rate * seconds)
    hear, tell = multiprocessing.Pipe(duplex=False)
    with SerialSource(os.ttyname(near_end), design=DESIGN) as source:
        board = multiprocessing.Process(
            target=send, args=(far_end, frames(count, rate), rate, tell)
        )
        board.start()
        came = []
        for _ in range(count):
            source.read(5.0)
            came.append(time.monotonic())
        late = 1e3 * (np.array(came) - hear.recv())
        counters = source.counters
        board.join()
    lost = counters.lost + counters.corrupt + counters.dropped
    median, most, worst = np.quantile(late, [0.5, 0.99, 1.0])
    print(
        f"{rate:5d} Hz for {seconds:g} s: {counters.readings} readings, {lost} lost; "
        f"median {median:.2f} ms, 99 % within {most:.2f} ms, all within {worst:.1f} ms"
    )


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=60.0)
    seconds = options.parse_args().seconds
    for rate in RATES:
        measure(rate, seconds)


if __name__ == "__main__":
    main()
