"""Time of tessellation over the number of vertices, beside n log n.

Sparse factorisations of the search's steps take most of the time, so their number stands beside:
seven at any size. From 441 to 4,225 vertices the time grows as 0.8 to 1.05 of n log n, as
1.2 to 1.5 on a busier machine. Run alone on a quiet one: ``python benchmarks/bench_tessellate.py``.
"""

import time
from dataclasses import replace
from unittest import mock

import numpy as np

from smoskin.feasibility import load_design
from smoskin.origami.surface.analytic import Cone
from smoskin.origami.tessellation import solve
from smoskin.origami.tessellation.tessellate import tessellate

COUNTS = (10, 16, 24, 32)
"""Cells each way; on fewer, what does not depend on the vertices takes most of the time."""


def seconds(count: int) -> tuple[float, int]:
    """Process time of a cone of so many cells each way, the best of three, and its steps."""
    cell = load_design("planar").cell
    cell = replace(cell, panel_a=0.6 * cell.panel_a, panel_b=0.6 * cell.panel_b)
    radius = 0.016 * count
    cone = Cone(0.95 * radius, 1.05 * radius, 0.012 * count)
    taken, steps = [], 0
    for _ in range(3):
        with mock.patch.object(solve, "splu", wraps=solve.splu) as factorised:
            begin = time.process_time()
            made = tessellate(cone, cell, (count, count), refold=False)
            taken.append(time.process_time() - begin)
        assert made.holds, made.advice
        steps = factorised.call_count
    return min(taken), steps


def main() -> None:
    seconds(COUNTS[0])  # modules are loaded
    reference = None
    for count in COUNTS:
        vertices, (taken, steps) = (2 * count + 1) ** 2, seconds(count)
        size = vertices * np.log(vertices)
        reference = reference or (taken / size, taken / size / steps)
        whole, step = taken / size / reference[0], taken / size / steps / reference[1]
        print(
            f"{vertices:5d} vertices: {taken:6.3f} s, {whole:.2f} of n log n; {steps} steps, "
            f"{step:.2f} of n log n each"
        )


if __name__ == "__main__":
    main()
