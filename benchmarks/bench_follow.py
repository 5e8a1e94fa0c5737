"""Time from a reading's arrival to the arm's command that it led to, on a live simulated arm.

A board in a process of its own sends, byte for byte, what a made skin reads under a hand; a loop
estimates by a calibrated table and the arm's pose, and a driver moves the arm 125 times a second.

``python benchmarks/bench_follow.py --rate 200 --seconds 60``
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from tempfile import TemporaryDirectory

import numpy as np

import smoskin as smo
from smoskin.records import Pose, Reading
from smoskin.robot.driver import Driver
from smoskin.robot.follow import Command, Follow
from smoskin.robot.simulated import SimulatedArm
from smoskin.roles import Source
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.service.apart.realtime import undisturbed
from smoskin.service.loop import Loop

BOARD = """
import sys, smoskin as smo
from smoskin.hardware.board import VirtualBoard
with VirtualBoard(smo.open_source(sys.argv[1])) as board:
    print(board.port, flush=True)
    while True:
        while board.watched and board.step():
            pass
        board.restart(smo.open_source(sys.argv[1]))
"""


class Stamped(Source):
    """A source that keeps when its newest reading came."""

    def __init__(self, source: Source) -> None:
        self._source, self.arrived = source, 0.0

    @property
    def chips(self) -> int:
        """Number of chips in every reading."""
        return self._source.chips

    def read(self, timeout: float = 1.0) -> Reading | None:
        """The next reading."""
        reading = self._source.read(timeout)
        self.arrived = time.monotonic()
        return reading

    def close(self) -> None:
        """Close the source."""
        self._source.close()


def recorded(design: smo.SkinDesign, folder: str, rate: float) -> str:
    """A recording of what a made skin reads, first untouched and then under a hand, as a source."""
    url = f"twin://curved?manufactured=yes&seed=0&speed=max&rate={rate:g}"
    with smo.Recorder(f"{folder}/hand.mcap", design) as sink:
        for begin, seconds, hand in ((0.0, 5.0, "no"), (5.0, 20.0, "yes")):
            with smo.open_source(f"{url}&hand={hand}") as source:
                for index in range(round(seconds * rate)):
                    sink.write(replace(source.read(), time=begin + index / rate))
    return f"replay:{folder}/hand.mcap"


@contextmanager
def board(url: str) -> Iterator[str]:
    """Port of a board that sends a source's readings."""
    with subprocess.Popen(
        [sys.executable, "-c", BOARD, url], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def main() -> None:
    """Follow for a while, and tell how late commands were."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rate", type=float, default=200.0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--realtime", action="store_true")
    options = parser.parse_args()
    design = smo.load_design("curved")
    table = smo.calibrate(
        smo.load_response_table("curved"), smo.VirtualRig(design, seed=0), design=design, count=15
    ).table
    late: list[float] = []
    with TemporaryDirectory() as folder, board(recorded(design, folder, options.rate)) as port:
        source = Stamped(smo.open_source(f"serial://{port}?design=curved"))
        arm = SimulatedArm(design, time.monotonic)
        ready, answered = [0.0], [0.0]

        def commanded(command: Command) -> None:
            if ready[0] != answered[0]:
                answered[0] = ready[0]
                late.append(time.monotonic() - ready[0])

        driver = Driver(arm, Follow(arm.chain, design), on_command=commanded)
        # What was read does not hang on this arm.
        still = Pose(turn=np.eye(3))
        estimator = ZeroFirst(BayesEstimator(design, table))
        estimator.carried_by(lambda: still)
        begun = time.monotonic()
        driver.start()
        loop = Loop(source, estimator, sinks=(driver,))
        with loop, undisturbed(realtime=options.realtime):
            for _ in loop:
                ready[0] = source.arrived  # its estimate is with the driver
                if time.monotonic() - begun > options.seconds:
                    break
            counters = loop.counters
    estimate = counters.stages["estimate"]
    print(
        f"{counters.readings} readings at {counters.rate:.0f} Hz, {len(late)} commands of new ones"
    )
    print(f"to the estimate {1e3 * estimate.median:.2f} ms, 99 % {1e3 * estimate.p99:.2f} ms")
    median, most = np.percentile(late, [50, 99])
    print(f"to the command {1e3 * median:.2f} ms, 99 % {1e3 * most:.2f} ms")


if __name__ == "__main__":
    main()
