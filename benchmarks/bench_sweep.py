"""The SI's sweep, 25 x 33 places at ten forces, from start to files, beside the bare solver.

Run alone on a quiet machine: ``python benchmarks/bench_sweep.py``.
"""

import json
import math
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from smoskin import load_design
from smoskin.datasets.patterns import Grid, Sweep
from smoskin.datasets.store import write_dataset
from smoskin.datasets.workers import Engine
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Touches

SI = Sweep(presses=Grid(forces=tuple(k / 10 for k in range(1, 11))))


def bare_rate(design: object) -> float:
    """Presses a second of the solver alone, in this process, compiled before."""
    parts = [SI.touches(design, chunk) for chunk in range(SI.chunks)]
    touches = Touches(
        position=np.concatenate([part.position for part in parts]),
        force=np.concatenate([part.force for part in parts]),
        radius=np.concatenate([part.radius for part in parts]),
    )
    solver = BarHinge(design)
    solver.press(parts[0])
    begin = time.perf_counter()
    pressed = solver.press(touches)
    assert pressed.converged.all()
    return len(touches) / (time.perf_counter() - begin)


def main() -> None:
    design = load_design("planar")
    cores = len(os.sched_getaffinity(0))
    results = {"cores": cores, "presses": SI.rows, "bare_per_s": bare_rate(design)}
    sweeps = [("whole", workers) for workers in sorted({1, cores})] + [("reduced", cores)]
    for mechanics, workers in sweeps:
        heard: list[tuple[float, int]] = []
        with tempfile.TemporaryDirectory() as folder:
            begin = time.perf_counter()
            write_dataset(
                Path(folder) / "set",
                design,
                replace(SI, mechanics=mechanics),
                engine=Engine(workers),
                progress=lambda _, share, at=heard: at.append(
                    (time.perf_counter(), round(share * SI.rows))
                ),
            )
            seconds = time.perf_counter() - begin
        name = f"{mechanics}_{workers}_workers"
        # Once every worker has delivered: starting and compiling are behind.
        (first, some), (last, every) = heard[workers], heard[-1]
        steady = (every - some) / (last - first) if last > first else math.nan
        results |= {
            f"{name}_s": seconds,
            f"{name}_started_after_s": heard[1][0] - begin,
            f"{name}_steady_per_s": steady,
        }
        if mechanics == "whole":
            results[f"{name}_steady_over_bare"] = steady / results["bare_per_s"]
    print("Ratios are what to compare; seconds are this machine's.", file=sys.stderr)
    print(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
