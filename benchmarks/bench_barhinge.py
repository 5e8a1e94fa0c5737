"""Nonlinear presses a second: batches beside a plain Newton loop on SciPy's sparse solver.

Run alone on a quiet machine: ``python benchmarks/bench_barhinge.py``. Both solve the same presses
to the same residual in the same run, in turn. The loop assembles the exact tangent from the same
compiled elements, factorises it by SuperLU at every step and halves the load where it diverges.
On a GPU the batches run there; the loop does not.
"""

import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from smoskin import load_design
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.tangent import Tangent
from smoskin.mechanics.sheet.touches import Frictionless, Touches, patch_shares
from smoskin.origami.cell import size
from smoskin.origami.geometry import geometry

BATCH, RESIDUAL = 1000, 1e-6
LOOP = 12
"""Presses that the loop solves; a thousand would take minutes."""
SIZES = (3, 6, 12, 24)
LEAST_RATE, LEAST_RATIO, MOST_GROWTH, MOST_GRID, MOST_LIVE = 1000.0, 20.0, 1.5, 10.0, 5e-3


def sized(design: SkinDesign, count: int) -> SkinDesign:
    """The design with count x count cells, its magnets out of the way."""
    magnets = tuple(replace(magnet, corner=(0, 0)) for magnet in design.magnets)
    return replace(design, cells=(count, count), magnets=magnets)


def presses(design: SkinDesign, count: int, seed: int) -> Touches:
    """Anywhere on the skin, 0.1 to 2 N straight down."""
    rng = np.random.default_rng(seed)
    extent = geometry(design).cell
    whole = np.multiply(design.cells, [float(extent.length), float(extent.width)])
    force = np.zeros((count, 1, 3))
    force[:, 0, 2] = -rng.uniform(0.1, 2.0, count)
    return Touches(position=rng.uniform(0, whole, (count, 1, 2)), force=force)


def seconds(act: Callable[[], object]) -> float:
    begin = time.perf_counter()
    act()
    return time.perf_counter() - begin


class NewtonLoop:
    """One press after the other."""

    def __init__(self, model: BarHinge) -> None:
        lattice = self.lattice = model.lattice
        self.tangent = Tangent(lattice, model.board)
        where = []
        supported = lattice.feet[:, None], lattice.stops.nodes[:, None]
        for nodes in (lattice.bars, lattice.hinges, *supported):
            each = (3 * nodes[..., None] + np.arange(3)).reshape(len(nodes), -1)
            where.append(
                (
                    np.repeat(each, each.shape[1], axis=1).ravel(),
                    np.tile(each, (1, each.shape[1])).ravel(),
                )
            )
        self.rows, self.columns = (np.concatenate(part) for part in zip(*where, strict=True))

    def step(self, motion: np.ndarray, outer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        made = self.tangent.blocks(motion, np.zeros(6))
        right = (outer - made.pushes.sum(axis=0)).ravel()
        parts = (made.bars, made.hinges, made.columns, made.stops)
        blocks = np.concatenate([part.ravel() for part in parts])
        whole = coo_array((blocks, (self.rows, self.columns)), (right.size, right.size))
        move = splu(csc_array(whole)).solve(right)
        return right, move.reshape(motion.shape)

    def solve(self, outer: np.ndarray) -> int:
        motion, reached, share, steps = np.zeros_like(outer), 0.0, 1.0, 0
        while reached < 1.0:
            trial, load = motion, min(reached + share, 1.0)
            for _ in range(20):
                right, move = self.step(trial, load * outer)
                if np.linalg.norm(right) <= RESIDUAL * load * np.linalg.norm(outer):
                    motion, reached, share = trial, load, 2 * share
                    break
                trial, steps = trial + move, steps + 1
                if not np.abs(trial).max() < 1.0:
                    share /= 2
                    break
            else:
                share /= 2
        return steps


def main() -> None:
    planar = load_design("planar")
    print(f"{jax.devices()[0].device_kind}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    sticking = BarHinge(planar)
    touches = presses(planar, BATCH, 0)
    first = seconds(lambda: sticking.press(touches, tolerance=RESIDUAL))
    taken = [seconds(lambda: sticking.press(touches, tolerance=RESIDUAL)) for _ in range(7)]
    pressed = sticking.press(touches, tolerance=RESIDUAL)
    rate = BATCH / min(taken)
    print(
        f"6 x 6 cells, {BATCH} presses that stick: {rate:.0f} a second (median "
        f"{BATCH / np.median(taken):.0f}), {pressed.iterations.mean():.1f} steps, all converged: "
        f"{pressed.converged.all()}; compiled in {first - min(taken):.1f} s"
    )

    free = BarHinge(planar, grip=Frictionless())
    loop, few = NewtonLoop(free), presses(planar, LOOP, 1)
    outer = np.zeros((LOOP, *free.lattice.nodes.shape))
    shares = patch_shares(planar, few).reshape(LOOP, -1)
    outer[:, free.lattice.loaded.ravel(), 2] = shares * few.force[:, :, 2]
    loop.solve(outer[0])
    free.press(touches, tolerance=RESIDUAL)
    slow, fast, steps = [], [], 0
    for row in range(LOOP):
        begin = time.perf_counter()
        steps += loop.solve(outer[row])
        slow.append(time.perf_counter() - begin)
        if row % 4 == 0:
            fast.append(seconds(lambda: free.press(touches, tolerance=RESIDUAL)) / BATCH)
    ratio = np.median(slow) / np.median(fast)
    print(
        f"free presses: loop {np.median(slow) * 1e3:.1f} ms a press ({steps / LOOP:.1f} steps), "
        f"batch {np.median(fast) * 1e3:.3f} ms: {ratio:.0f} times"
    )

    cost = []
    for count in SIZES:
        design = sized(planar, count)
        begin = time.perf_counter()
        model = BarHinge(design)
        built = time.perf_counter() - begin
        some = presses(design, max(64, 4096 // count**2), 2)
        again = partial(model.press, some, tolerance=RESIDUAL)
        again()
        cost.append(min(seconds(again) for _ in range(3)) / len(some))
        print(
            f"{count:3} x {count:2} cells: {cost[-1] * 1e3:8.3f} ms a press, built in {built:.1f} s"
        )
    growth = max(
        np.log(cost[-1] / cost[k]) / np.log((SIZES[-1] / SIZES[k]) ** 2)
        for k in range(len(SIZES) - 1)
        if SIZES[k] >= 6
    )
    print(f"growth with the number of cells from 6 x 6 on: exponent {growth:.2f}")

    x, y, f = np.meshgrid(
        np.linspace(0, 0.120, 25),
        np.linspace(0, 0.160, 33),
        np.linspace(0.1, 1.0, 10),
        indexing="ij",
    )
    whole = np.multiply(planar.cells, [float(part) for part in size(planar.cell)[:2]])
    where = np.stack([x, y], axis=-1).reshape(-1, 1, 2) * whole / [0.120, 0.160]
    force = np.zeros((x.size, 1, 3))
    force[:, 0, 2] = -f.ravel()
    grid = Touches(position=where, force=force)
    sweep = seconds(lambda: sticking.press(grid, tolerance=RESIDUAL))
    print(f"the 825-point grid at 10 forces: {sweep:.2f} s")

    live = [
        Touches(position=[[(0.05, 0.06 + 1e-4 * k)]], force=[[(0.1, 0, -0.8)]]) for k in range(60)
    ]
    start = sticking.press(live[0]).displacements
    times = []
    for touch in live:
        begin = time.perf_counter()
        start = sticking.press(touch, tolerance=RESIDUAL, start=start).displacements
        times.append(time.perf_counter() - begin)
    median, worst = np.median(times), np.percentile(times, 99)
    print(f"a live press with drag: median {median * 1e3:.2f} ms, 99 % {worst * 1e3:.2f} ms")

    for name, value, good in (
        ("presses a second", rate, rate >= LEAST_RATE),
        ("times the loop", ratio, ratio >= LEAST_RATIO),
        ("growth exponent", growth, growth <= MOST_GROWTH),
        ("seconds for the grid", sweep, sweep <= MOST_GRID),
        ("seconds a live press", median, median <= MOST_LIVE),
    ):
        if not good:
            raise SystemExit(f"{name}: {value:.3g} misses its target")


if __name__ == "__main__":
    main()
