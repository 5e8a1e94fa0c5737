"""The Bayesian estimator on made skins that its table never saw: figures, and latency of a step.

Makes the table first where there is none (some minutes):
``OMP_NUM_THREADS=1 python benchmarks/bench_bayes.py planar.response --skins 5 --places 25 33``.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from smoskin import load_design
from smoskin.apps.judge import (
    FORCES,
    Disturbance,
    Judged,
    grid_sessions,
    judge,
    label,
    pair_session,
    readings,
)
from smoskin.apps.response import cached_response_table
from smoskin.magnetics.hall import conversion_time
from smoskin.mechanics.relaxation import elastomer_prony
from smoskin.sensing.bayes import BayesEstimator
from smoskin.sensing.bound import bound_map
from smoskin.sensing.conditioning import ZeroTracking
from smoskin.sensing.few_touch import calibrate_touches, plan_touches
from smoskin.sensing.signals import signal_noise
from smoskin.sensing.touch_priors import TouchPriors
from smoskin.twin.skin import Twin

TRACKING = ZeroTracking(hold=0.2, time_constant=2.0)


def line(name: str, found: Judged) -> str:
    """Figures of single touches."""
    said = found.count == 1
    force = np.abs(found.error[:, 0, 4] / found.truth[:, 0, 4])
    stated = np.sqrt(np.nanmean(np.einsum("tii->t", found.spread[:, 0, :2, :2])))
    reached = np.sqrt(np.nanmean(found.distance**2))
    return (
        f"{name:>12}: one touch {said.mean():6.1%}, place {np.nanmean(found.distance) * 1e3:5.2f} "
        f"mm, force {np.nanmean(force):6.2%}, 90 % regions hold {found.inside[said].mean():5.1%}, "
        f"RMS over stated {reached / stated:4.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", type=Path)
    parser.add_argument("--skins", type=int, default=5)
    parser.add_argument("--places", type=int, nargs=2, default=(25, 33))
    parser.add_argument("--count", type=int, help="of the places for each force; all by default")
    parser.add_argument("--touches", type=int, default=60)
    parser.add_argument("--chips", type=int, nargs="+", default=(1, 2))
    asked = parser.parse_args()
    design = load_design("planar")
    table = cached_response_table(design, asked.table).of_chips(tuple(asked.chips))
    noise = signal_noise(design, table.chips)
    rubber = elastomer_prony(design.columns.material)
    plan = plan_touches(table, asked.touches, noise)
    by_force: dict[str, Judged] = {}
    for seed in range(1, asked.skins + 1):
        rng = np.random.default_rng(seed)
        twin = Twin(design, seed=seed, manufactured=True)
        touches = label(twin, plan, rng, temperature=22.0, chips=table.chips)
        skin = calibrate_touches(table, touches, noise)
        straight, dragged = (
            BayesEstimator(
                design, skin, priors=TouchPriors(drag_spread=drag), creep=rubber, tracking=TRACKING
            )
            for drag in (0.0, 0.3)
        )
        sessions = grid_sessions(twin, rng, places=tuple(asked.places), count=asked.count)
        cases = [(f"{f:.1f} N", straight, s) for f, s in zip(FORCES, sessions, strict=True)]
        cases += [
            ("0.7 N, drag", dragged, s)
            for s in grid_sessions(
                twin, rng, places=tuple(asked.places), forces=(0.7,), drag=0.5, count=asked.count
            )
        ]
        cases.append(("pairs", straight, pair_session(twin, rng, 40)))
        for name, estimator, session in cases:
            found = judge(estimator, twin, session, rng)
            by_force[name] = by_force[name] + found if name in by_force else found
    pairs = by_force.pop("pairs")
    for name, found in by_force.items():
        print(line(name, found))
    headline = [by_force[f"{f:.1f} N"] for f in FORCES if f > 0.25]
    whole = headline[0]
    for more in headline[1:]:
        whole = whole + more
    print(line("0.3 to 1 N", whole))
    print(
        f"       pairs: counted {np.mean(pairs.count == 2):.1%}, place "
        f"{np.nanmean(pairs.distance) * 1e3:.1f} mm"
    )
    best = bound_map(table, noise, drags=False)
    print(
        f"       bound at 0.5 N: median {np.median(best.location) * 1e3:.3f} mm, blind "
        f"{best.blind.mean():.0%}: {', '.join(best.blind_regions())}; super-resolution "
        f"{best.super_resolution.area:.0f} (area), {best.super_resolution.spacing:.0f} (spacing)"
    )
    session = next(iter(grid_sessions(twin, rng, places=(13, 17), forces=(0.5,))))
    said = readings(twin, session, rng, Disturbance())
    straight.reset()
    straight.zero(said[:20])
    taken = []
    for reading in said:
        begin = time.perf_counter()
        estimate = straight.step(reading)
        if estimate.contacts:
            taken.append(time.perf_counter() - begin)
    median, slow = np.percentile(taken, [50, 99])
    print(
        f"        step: median {median * 1e3:.2f} ms, 99 % {slow * 1e3:.2f} ms, "
        f"{median / conversion_time(design.hall_setting):.2f} conversions of the chips"
    )


if __name__ == "__main__":
    main()
