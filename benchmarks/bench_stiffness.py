"""Stiffness maps: time and memory against the number of cells, beside a matrix product.

Run alone on a quiet core: ``OMP_NUM_THREADS=1 python benchmarks/bench_stiffness.py``. The product
is of an (N, 2N + 1) by a (2N + 1, N) matrix: the sheet's own sizes.
"""

import time
import tracemalloc
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from paper.models.finite_press import column_response, crease_response
from paper.models.stiffness_terms import stiffness_terms
from smoskin import load_design
from smoskin.mechanics.reduced.stiffness import relative_stiffness_map

SIZES = (6, 12, 24, 60, 120)
BUDGET = {6: 5e-3, 60: 2.0}
"""s, for a whole map."""


def median_seconds(work: Callable[[], object], other: Callable[[], object]) -> tuple[float, float]:
    """Of both, called in turn, so that both meet the same machine."""
    taken = np.empty((2, 101))
    for k in range(taken.shape[1]):
        for row, act in enumerate((work, other)):
            begin = time.perf_counter()
            act()
            taken[row, k] = time.perf_counter() - begin
    first, second = np.median(taken, axis=1)
    return float(first), float(second)


def peak_bytes(work: Callable[[], object]) -> int:
    """Most memory that one call holds."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def main() -> None:
    planar = load_design("planar")
    magnets = tuple(replace(magnet, corner=(0, 0)) for magnet in planar.magnets)
    v = planar.coefficients.attenuation
    print("map                cells      time   / product   peak memory   bytes a cell")
    for n in SIZES:
        design = replace(planar, cells=(n, n), magnets=magnets)
        left, right = np.ones((n, 2 * n + 1)), np.ones((2 * n + 1, n))
        acts: dict[str, Callable[[], object]] = {
            "columns": lambda d=design: relative_stiffness_map(d.cell, d.cells, v),
            "all three terms": lambda d=design: stiffness_terms(d, v, panel_energy="bending"),
            "columns, exact": lambda d=design: column_response(d, v, -1e-3),
            "creases, exact": lambda d=design: crease_response(d, v, -1e-3),
        }
        for name, act in acts.items():
            taken, product = median_seconds(act, lambda a=left, b=right: a @ b)
            peak = peak_bytes(act)
            print(
                f"{name:16} {n:4} x {n:3} {taken * 1e6:8.0f} us {taken / product:10.1f} "
                f"{peak / 1024:10.0f} KiB {peak / n**2:12.0f}"
            )
            if taken > BUDGET.get(n, np.inf):
                raise SystemExit(f"{name}, {n} x {n}: {taken:.3g} s, allowed {BUDGET[n]:.3g} s")


if __name__ == "__main__":
    main()
