"""Networks on made skins that training never saw: figures, time of training, latency of a step.

Each skin is calibrated by a few touches and gets a network of its own. Makes the table first where
there is none (some minutes):
``OMP_NUM_THREADS=1 python benchmarks/bench_network.py planar.table --skins 5 --places 25 33``.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from smoskin import load_design
from smoskin.commands.score.errors import Answers, Tally, tally, together
from smoskin.commands.score.evaluate import (
    FORCES,
    HEADLINE,
    grid_sessions,
    judge,
    label,
    readings,
)
from smoskin.commands.train import parse_chips
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.mlx90393 import conversion_time
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import Ensemble, NetworkModel, load_network
from smoskin.sensing.network.samples import TouchSpread, TrainingEffort
from smoskin.sensing.network.training import train_network
from smoskin.sensing.response.calibrate import TouchPlanner, calibrate_touches
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.whole import Twin

UNTOUCHED = 20
"""Readings of a session before its first touch."""


def line(figures: Tally) -> str:
    """Figures of single touches."""
    drag = "" if figures.drag is None else f", drag {figures.drag:.2%} of it"
    return (
        f"{figures.name:>12}: one touch told {figures.detected:6.1%}, place "
        f"{figures.location.mean * 1e3:5.2f} mm, force {figures.force:6.2%}{drag}, 90 % regions "
        f"hold {figures.held.place:5.1%} of places and {figures.held.force:5.1%} of forces"
    )


def microseconds(work: Callable[[], object], count: int = 3000) -> tuple[float, float]:
    """Median and least time of a call."""
    taken = np.empty(count)
    for k in range(count):
        begin = time.perf_counter()
        work()
        taken[k] = time.perf_counter() - begin
    return float(np.median(taken)) * 1e6, float(taken.min()) * 1e6


def tell_latency(design: SkinDesign, model: NetworkModel, twin: Twin) -> None:
    """Of the network alone and of a whole step, beside an addition and the chips' conversion."""
    estimator = NetworkEstimator(design, model)
    session = next(iter(grid_sessions(twin, np.random.default_rng(1), forces=(0.5,), count=300)))
    stream = readings(twin, session, np.random.default_rng(2)).readings
    estimator.zero(stream[:UNTOUCHED])
    taken = []
    for reading in stream[UNTOUCHED:]:
        begin = time.perf_counter()
        if estimator.step(reading).contacts:
            taken.append(time.perf_counter() - begin)
    point, signals = Ensemble(model), np.full((1, 3 * len(model.chips)), 1e-3)
    unit, _ = microseconds(lambda: signals + signals)
    network, least = microseconds(lambda: point.predict(signals, 25.0))
    conversion = conversion_time(design.hall_setting) * 1e6
    step = float(np.median(taken)) * 1e6
    print(
        f"network: median {network:.1f} us, least {least:.1f} us ({network / conversion:.4f} "
        f"conversions of the chips, {network / unit:.0f} additions of {unit:.2f} us); whole step: "
        f"median {step:.1f} us ({step / conversion:.4f} conversions)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", nargs="?", default="planar")
    parser.add_argument("--skins", type=int, default=5)
    parser.add_argument("--places", type=int, nargs=2, default=(25, 33))
    parser.add_argument("--count", type=int, help="of the places for each force; all by default")
    parser.add_argument("--touches", type=int, default=60)
    parser.add_argument("--chips", default="1,2")
    parser.add_argument("--drag", type=float, default=0.0, help="N, largest that is told")
    parser.add_argument("--epochs", type=int, default=20, help="of each skin's network")
    parser.add_argument("--start", type=Path, help="a network of the design to go on from")
    asked = parser.parse_args()
    design = load_design("planar")
    table = load_response_table(asked.table).of_chips(parse_chips(asked.chips))
    noise, rubber = signal_noise(design, table.chips), elastomer_prony(design.columns.material)
    plan = TouchPlanner(table, noise).plan(asked.touches)
    start = None if asked.start is None else load_network(asked.start)
    by_force: dict[float, list[Answers]] = {force: [] for force in FORCES}
    for seed in range(1, asked.skins + 1):
        rng = np.random.default_rng(seed)
        twin = Twin(design, seed=seed, manufactured=True)
        touches = label(twin, plan, rng, temperature=22.0, chips=table.chips)
        trained = train_network(
            design,
            calibrate_touches(table, touches, noise),
            spread=TouchSpread(drag=asked.drag),
            creep=rubber,
            effort=TrainingEffort(epochs=asked.epochs),
            start=start,
        )
        print(f"skin {seed}: trained {trained.curve[-1].seconds:.0f} s; {trained.ended}")
        estimator = NetworkEstimator(design, trained.model)
        sessions = grid_sessions(
            twin, rng, places=tuple(asked.places), drag=asked.drag, count=asked.count
        )
        for force, session in zip(FORCES, sessions, strict=True):
            by_force[force].append(judge(estimator, twin, session, rng))
    for force, answers in by_force.items():
        print(line(tally(f"{force:.1f} N", together(answers))))
    firm = [part for force in FORCES if force >= HEADLINE for part in by_force[force]]
    print(line(tally(f"{HEADLINE:g} to {FORCES[-1]:g} N", together(firm))))
    tell_latency(design, trained.model, twin)


if __name__ == "__main__":
    main()
