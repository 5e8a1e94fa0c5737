"""Time of tessellation: on the fixed surfaces, and over the number of vertices beside n log n.

Sheets of 6 x 6 cells should take 2 s at most and those of 24 x 24 30 s, without folding the flat
pattern again, whose time stands beside; the two noisy meshes are left out.
Sparse factorisations of the search's steps take most of the time, so their number stands beside:
seven at any size. From 441 to 4,225 vertices the time grows as 0.8 to 1.3 of n log n, as
1.5 on a busy machine. Run alone on a quiet one: ``python benchmarks/bench_tessellate.py``.
"""

import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from smoskin.commands.tessellate.panels import thinner_plates
from smoskin.commands.tessellate.surfaces import named_surface
from smoskin.errors import DesignError
from smoskin.feasibility import load_design
from smoskin.origami.surface.analytic import Cone
from smoskin.origami.tessellation import solve
from smoskin.origami.tessellation.tessellate import tessellate

SURFACES = Path(__file__).parents[1] / "tests/origami/tessellation/surfaces.toml"
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


def on(case: dict[str, Any], *, refold: bool) -> tuple[float, bool]:
    """Process time on one of the fixed surfaces, and whether there is a sheet that holds."""
    cell, cells = load_design("planar").cell, tuple(case["cells"])
    scale = case.get("scale", 1.0)
    cell = replace(cell, panel_a=scale * cell.panel_a, panel_b=scale * cell.panel_b)
    surface, _ = named_surface(case["kind"], cell, cells, (0, 0, 0), (1, 0, 0))
    begin = time.process_time()
    try:
        made = tessellate(surface, cell, cells, thinner=thinner_plates(5e-4), refold=refold)
        holds = made.holds
    except DesignError:
        holds = False
    return time.process_time() - begin, holds


def main() -> None:
    seconds(COUNTS[0])  # modules are loaded
    for case in tomllib.loads(SURFACES.read_text())["surface"]:
        if not case.get("noisy"):
            taken, holds = on(case, refold=False)
            again, _ = on(case, refold=True)
            n, m = case["cells"]
            verdict = "holds" if holds else "refused"
            print(
                f"{case['name']:24s} {n:2d} x {m:2d}: {taken:5.2f} s, folded again {again:5.2f} s; "
                f"{verdict}"
            )
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
