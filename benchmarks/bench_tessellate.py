"""Time of tessellation over the number of vertices, beside n log n.

Run alone on a quiet machine: ``python benchmarks/bench_tessellate.py``.
"""

import time
from dataclasses import replace

import numpy as np

from smoskin.feasibility import load_design
from smoskin.origami.surface.analytic import Cone
from smoskin.origami.tessellation.tessellate import tessellate

COUNTS = (6, 10, 16, 24)


def seconds(count: int) -> float:
    """Process time of a cone of so many cells each way, the best of three."""
    cell = load_design("planar").cell
    cell = replace(cell, panel_a=0.6 * cell.panel_a, panel_b=0.6 * cell.panel_b)
    radius = 0.016 * count
    cone = Cone(0.95 * radius, 1.05 * radius, 0.012 * count)
    taken = []
    for _ in range(3):
        begin = time.process_time()
        made = tessellate(cone, cell, (count, count), refold=False)
        taken.append(time.process_time() - begin)
        assert made.holds, made.advice
    return min(taken)


def main() -> None:
    seconds(COUNTS[0])  # modules are loaded
    first = None
    for count in COUNTS:
        vertices, taken = (2 * count + 1) ** 2, seconds(count)
        first = first or (vertices, taken)
        grown = vertices * np.log(vertices) / (first[0] * np.log(first[0]))
        print(f"{vertices:5d} vertices: {taken:.3f} s, {taken / first[1] / grown:.2f} of n log n")


if __name__ == "__main__":
    main()
