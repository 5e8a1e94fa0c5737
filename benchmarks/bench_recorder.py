"""What recording costs: share of a core, memory, readings passed over, and what a kill loses.

Four chips, a thousand readings a second, written at their pace; then recorders that are killed at
random moments. Run: ``python benchmarks/bench_recorder.py --seconds 600 --kills 20``.
"""

import argparse
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from smoskin import open_recording
from smoskin.feasibility import load_design
from smoskin.records import Reading
from smoskin.service.recorder import Recorder

PLANAR = load_design("planar")
DESIGN = replace(PLANAR, halls=(*PLANAR.halls, replace(PLANAR.halls[-1], name="S4", address=0x0F)))
"""A design with a fourth chip."""
CHIPS, RATE = len(DESIGN.halls), 1000.0
"""Chips of a reading, and readings a second."""
PIECE = 50
"""Readings that are written between two sleeps, lest sleeping be what is measured."""


def resident() -> float:
    """Memory of this process that is in use, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def record(path: Path, seconds: float) -> None:
    """Record at the rate, and print what that cost; every piece's last time where it is killed."""
    rng = np.random.default_rng(0)
    fields = rng.normal(0.0, 1e-3, (PIECE, CHIPS, 3))
    with Recorder(path, DESIGN) as sink:
        start, used, memory, number = time.monotonic(), 0.0, [], 0
        while number < seconds * RATE:
            time.sleep(max(0.0, start + number / RATE - time.monotonic()))
            begun = time.process_time()
            for field in fields:
                sink.write(Reading(time=number / RATE, field=field))
                number += 1
            used += time.process_time() - begun
            memory.append(resident())
            if sys.argv[1:2] == ["--killed"]:
                print((number - 1) / RATE, flush=True)
    if sys.argv[1:2] == ["--killed"]:
        return
    kept = open_recording(path).reading_count
    third = len(memory) // 3
    print(
        f"{number} readings of {CHIPS} chips in {time.monotonic() - start:.0f} s: "
        f"{100 * used / seconds:.1f} % of a core, {np.mean(memory[:third]):.1f} MB in the first "
        f"third and {np.mean(memory[-third:]):.1f} MB in the last, {sink.dropped} passed over, "
        f"{kept} kept"
    )


def lost(path: Path, moment: float) -> float:
    """Seconds of readings that a recorder lacks that was killed so long after its first."""
    with subprocess.Popen(
        [sys.executable, __file__, "--killed", str(path)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(moment)
        process.kill()
        written = [float(line) for line in (first, *process.stdout.readlines())]
    kept = [reading.time for reading in open_recording(path).readings()]
    return max(0.0, written[-1] - (kept[-1] if kept else 0.0))


def main() -> None:
    """Measure as asked."""
    if sys.argv[1:2] == ["--killed"]:
        record(Path(sys.argv[2]), 3600.0)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--kills", type=int, default=20)
    asked = parser.parse_args()
    with TemporaryDirectory() as folder:
        record(Path(folder) / "whole.mcap", asked.seconds)
        moments = np.random.default_rng(1).uniform(0.0, 4.0, asked.kills)
        gone = [lost(Path(folder) / f"{k}.mcap", moment) for k, moment in enumerate(moments)]
    if gone:
        print(f"{len(gone)} kills: each readable, at most {max(gone):.2f} s lost")


if __name__ == "__main__":
    main()
