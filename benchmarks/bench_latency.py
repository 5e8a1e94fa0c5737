"""One step of each estimator: latency, beside what the machine and the chips take.

All of them take turns in one run, each with its own readings of made touches; so does the unit, one
matrix product of the response table's size, which no step on that table can do without.
Times are those of the process. Run alone on a quiet core:
``OMP_NUM_THREADS=1 python benchmarks/bench_latency.py planar.table``.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from smoskin import load_design
from smoskin.commands.score.evaluate import (
    grid_sessions,
    label,
    pair_session,
    readings,
)
from smoskin.datasets.patterns import far_pairs
from smoskin.magnetics.mlx90393 import conversion_time
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.records import Motion, Reading
from smoskin.roles import Estimator
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import load_network
from smoskin.sensing.response.calibrate import TouchPlanner, calibrate_touches
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.creep import Creep
from smoskin.twin.rig import drifting_readings
from smoskin.twin.whole import Twin

UNTOUCHED = 20
"""Readings before the first touch."""


class Runner(NamedTuple):
    """An estimator with its readings."""

    name: str
    estimator: Estimator
    readings: Sequence[Reading]
    touches: int
    """That a step must say to be counted."""


def seconds(work: Callable[[], object]) -> tuple[float, object]:
    """Time of the process that a call takes, and its answer."""
    begin = time.process_time()
    answer = work()
    return time.process_time() - begin, answer


def run(runners: Sequence[Runner], unit: Callable[[], object]) -> dict[str, list[float]]:
    """Time of each step under touches (or of idle ones), one after the other in turn."""
    taken: dict[str, list[float]] = {runner.name: [] for runner in runners} | {"unit": []}
    for k in range(UNTOUCHED, max(len(runner.readings) for runner in runners)):
        taken["unit"].append(seconds(unit)[0])
        for runner in runners:
            if k < len(runner.readings):
                spent, estimate = seconds(
                    lambda runner=runner, k=k: runner.estimator.step(runner.readings[k])
                )
                if len(estimate.contacts) == runner.touches:
                    taken[runner.name].append(spent)
    return taken


def moving(twin: Twin, rng: np.random.Generator, count: int, most: int) -> Sequence[Reading]:
    """A stream of 100 Hz: one touch, then as many for 0.8 s, all of which slide and waver."""
    period, extent = 0.01, geometry(twin.design).extent
    time = period * np.arange(100)
    # Nothing, one touch, both, one, nothing.
    rows = np.split(np.arange(100), [5, 10, 90, 95])
    rest = Motion.rest(len(twin.design.magnets), (UNTOUCHED,))
    motions, steps = [rest], [0.05] * UNTOUCHED
    for places in far_pairs(extent, 0.05, count, rng):
        slides = rng.uniform(-0.01, 0.01, (2, 2)) * time[:, None, None]
        position = np.clip(places + slides, 0.006, extent - 0.006)
        force = np.zeros((len(time), 2, 3))
        wave = np.sin(time[:, None] * rng.uniform(2, 6, 2))
        force[..., 2] = -rng.uniform(0.3, 0.8, 2) * (1 + 0.2 * wave)
        for some, touches in zip(rows, (0, 1, most, 1, 0), strict=True):
            where = Touches(position=position[some, :touches], force=force[some, :touches])
            motions.append(twin.motions(where) if touches else rest[: len(some)])
        steps += [period] * len(time)
    motion = Creep(twin.design).steps(np.array(steps), Motion.concatenate(motions))
    times = np.cumsum(steps)
    return drifting_readings(
        twin, motion, times, np.array(steps), rng, temperature=25.0, drift=0.3e-6
    )[0]


def calibrated(table: ResponseTable, twin: Twin, chips: Sequence[int]) -> ResponseTable:
    """The skin's own table."""
    used = table.of_chips(chips)
    noise = signal_noise(twin.design, used.chips)
    touches = label(
        twin, TouchPlanner(used, noise).plan(60), np.random.default_rng(1), chips=used.chips
    )
    return calibrate_touches(used, touches, noise)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", nargs="?", default="planar")
    parser.add_argument("--touches", type=int, default=300)
    parser.add_argument("--network", type=Path, help="a model file of `smoskin train`, too")
    asked = parser.parse_args()
    design = load_design("planar")
    table = load_response_table(asked.table)
    twin = Twin(design, seed=1, manufactured=True)
    rng = np.random.default_rng(2)
    straight, dragged = (
        next(iter(grid_sessions(twin, rng, forces=(0.5,), drag=drag, count=asked.touches)))
        for drag in (0.0, 0.5)
    )
    streams = {
        name: readings(twin, session, rng).readings
        for name, session in (
            ("straight", straight),
            ("dragged", dragged),
            ("pairs", pair_session(twin, rng, asked.touches // 5)),
        )
    }
    streams |= {f"moving {k}": moving(twin, rng, asked.touches // 30, k) for k in (1, 2)}
    six, nine = (calibrated(table, twin, chips) for chips in ((1, 2), (0, 1, 2)))
    free, none = TouchPriors(), TouchPriors(drag_spread=0.0)
    cases = [
        ("idle, 2 chips", six, none, "straight", 0),
        ("one straight touch, 2 chips", six, none, "straight", 1),
        ("one straight touch, 3 chips", nine, none, "straight", 1),
        ("one dragged touch, 3 chips", nine, free, "dragged", 1),
        ("one touch at 100 Hz, 3 chips", nine, none, "moving 1", 1),
        ("two touches at 100 Hz, 3 chips", nine, none, "moving 2", 2),
        ("two touches, seldom read", nine, none, "pairs", 2),
    ]
    runners = []
    for name, known, priors, session, touches in cases:
        estimator = BayesEstimator(design, known, priors=priors)
        estimator.zero(streams[session][:UNTOUCHED])
        runners.append(Runner(name, estimator, streams[session], touches))
    if asked.network:
        network = NetworkEstimator(design, load_network(asked.network))
        network.zero(streams["straight"][:UNTOUCHED])
        runners.append(Runner("one straight touch, network", network, streams["straight"], 1))
    functions, columns = six.mean.shape[0], six.mean[0].size
    weights, flat = np.ones((2, functions)), np.ascontiguousarray(six.mean).reshape(functions, -1)
    taken = run(runners, lambda: weights @ flat)
    conversion = conversion_time(design.hall_setting)
    unit = float(np.median(taken.pop("unit")))
    print(f"unit: a product of 2 x {functions} with {functions} x {columns}: {unit * 1e6:.1f} us")
    print(f"one conversion of the chips: {conversion * 1e6:.0f} us")
    for name, times in taken.items():
        if times:
            quick, median, slow = np.percentile(times, [10, 50, 99])
            print(
                f"{name:>30}: median {median * 1e6:7.0f} us, 10 % {quick * 1e6:6.0f} us, 99 % "
                f"{slow * 1e6:7.0f} us; "
                f"{median / unit:5.0f} units, {median / conversion:6.3f} conversions"
            )
        else:
            print(f"{name:>30}: never said as many touches")


if __name__ == "__main__":
    main()
