"""Bounds of designs without a table: figures as designed and made, and how long one takes.

``OMP_NUM_THREADS=1 python benchmarks/bench_bound.py planar optimised --made 3``; with ``--table`` a
response table of the first design is bounded as well.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from smoskin import load_design
from smoskin.commands.optimise import Limits, Objective, design_bound
from smoskin.commands.optimise.limits import fit_gaps
from smoskin.commands.optimise.pressed import PressedSheet
from smoskin.commands.optimise.search import try_design
from smoskin.sensing.response.bound import BoundMap, bound_map, figures
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.manufacture import draw


def line(name: str, bound: BoundMap) -> str:
    """Figures of location and force."""
    place, force = figures(bound.location * 1e3), figures(bound.force * 1e3)
    area, spacing = bound.super_resolution
    return (
        f"{name:>34}: place mean {place.mean:.3f} median {place.median:.3f} worst "
        f"{place.worst:.3f} max {place.maximum:.3f} mm, force mean {force.mean:.2f} mN, "
        f"super-resolution {area:.0f} (area) {spacing:.0f} (spacing)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("designs", nargs="+")
    parser.add_argument("--places", type=int, nargs=2, default=(25, 33))
    parser.add_argument("--made", type=int, default=3, help="skins of each design")
    parser.add_argument("--table", type=Path, help="response table of the first design")
    asked = parser.parse_args()
    places = tuple(asked.places)
    for name in asked.designs:
        design = load_design(name)
        for drags in (True, False):
            what = "drag unknown" if drags else "no drag"
            print(line(f"{name}, {what}", design_bound(design, drags=drags, places=places)))
        for skin in range(asked.made):
            made = draw(design, np.random.default_rng([1, skin]))
            print(line(f"{name}, made skin {skin}", design_bound(design, made, places=(13, 17))))
    first = load_design(asked.designs[0])
    if asked.table:
        table = load_response_table(asked.table)
        noise = signal_noise(first, table.chips)
        for misfit in (False, True):
            what = "of the table" + (", its misfit as noise" if misfit else "")
            print(line(what, bound_map(table, noise, places=places, misfit=misfit)))
    objective, limits = Objective(), Limits()
    begin = time.perf_counter()
    sheet = PressedSheet(first, places=objective.places)
    pressed = time.perf_counter() - begin
    begin = time.perf_counter()
    try_design(fit_gaps(first, sheet, limits), sheet, objective, limits)
    tried = time.perf_counter() - begin
    print(f"one design of a search: {pressed:.2f} s to press its sheet, {tried:.2f} s to read it")


if __name__ == "__main__":
    main()
