"""Right cells on manufactured whole-sheet skins: by theory, and by the skin's response table.

Run: ``OMP_NUM_THREADS=1 python benchmarks/bench_table.py``; needs the extra ``twin``. Each of ten
made skins is calibrated by 15 touches of a rig, and by touches of a bench with 2 % of noise in
force on all of its 36 cells. Then it is pressed on each cell, with the chips' noise; 360 presses a
row. A press counts if the estimate is a contact in the right cell.

Result: a table that 15 touches of a rig have calibrated names the right one of 36 cells, with
normal forces of 0.5 N good to 2 mN. Answers fitted to a press and two drags on every cell alone,
without the modes in which skins differ, named as many cells, with 10 mN, 23 mN under a drag of
0.3 N; with the modes the same touches come to 2.4 mN and 2.5 mN.
"""

import argparse
from collections import Counter

import numpy as np

from smoskin import (
    BayesEstimator,
    ClosedFormEstimator,
    Contact,
    Estimator,
    Status,
    Twin,
    load_design,
    load_response_table,
)
from smoskin.commands.calibrate import calibrate
from smoskin.mechanics.sheet.touches import touches_of
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.origami.geometry import geometry
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.response.table import ResponseTable
from smoskin.twin.bench import GAUGE_NOISE, measure, table_loads
from smoskin.twin.rig import VirtualRig

LEAST = 0.95
"""Share of right cells at 0.5 N that a calibrated skin must reach."""
PRESSES = (
    ("0.2 N", 0.2, 0.0, 0.0),
    ("0.5 N", 0.5, 0.0, 0.0),
    ("1 N", 1.0, 0.0, 0.0),
    ("0.5 N, off the vertex by up to a fifth of a cell", 0.5, 0.0, 0.2),
    ("0.5 N, dragged by 0.1 N", 0.5, 0.1, 0.0),
    ("0.5 N, dragged by 0.3 N", 0.5, 0.3, 0.0),
)
SINGLE = TouchPriors(chances=(0.5, 0.5, 0.0))


class Tally:
    """Right cells, errors of the right ones, and statuses of one kind of press."""

    def __init__(self) -> None:
        self.right: list[bool] = []
        self.force: list[np.ndarray] = []
        self.place: list[float] = []
        self.status: Counter[str] = Counter()

    def row(self) -> str:
        """For people."""
        force = (
            np.sqrt(np.mean(np.square(self.force), axis=0)) * 1e3 if self.force else [np.nan] * 3
        )
        place = 1e3 * np.mean(self.place) if self.place else np.nan
        others = ", ".join(f"{n} {name}" for name, n in self.status.items() if name != "CONTACT")
        return (
            f"{np.mean(self.right):7.2%}   {force[0]:5.1f} {force[1]:5.1f} {force[2]:6.1f}   "
            f"{place:5.2f}   {others}"
        )


def calibrations(twin: Twin, seed: int, table: ResponseTable) -> dict[str, ResponseTable]:
    """The skin's own tables, by how it was touched."""
    touches = measure(twin, table_loads(twin.design), np.random.default_rng(1000 + seed))
    straight = np.abs(touches.force[:, :2]).max(axis=1) < 0.05
    bench = {"place_spread": 10e-6, "force_spread": GAUGE_NOISE * 0.3}
    return {
        "15 of a rig": calibrate(table, VirtualRig(twin, seed=seed)).table,
        "1 a cell": calibrate(table, touches.rows(straight | ~touches.touched), **bench).table,
        "3 a cell": calibrate(table, touches, **bench).table,
    }


def judge(twin: Twin, estimators: dict[str, Estimator], tallies: dict, seed: int) -> None:
    """Press one skin so before every estimator."""
    rng = np.random.default_rng(seed)
    shape = geometry(twin.design)
    cell = np.array([shape.cell.length, shape.cell.width])
    tops = shape.tops.reshape(-1, 2)
    untouched = [twin.read(time=-2.0 + 0.05 * k) for k in range(20)]
    for press, force, drag, off in PRESSES:
        angle = rng.uniform(0, 2 * np.pi, len(tops))
        where = tops + rng.uniform(-off, off, tops.shape) * cell
        push = np.column_stack([drag * np.cos(angle), drag * np.sin(angle), np.full(36, -force)])
        contacts = [Contact(position=w, force=f) for w, f in zip(where, push, strict=True)]
        motion = twin.motions(touches_of([[contact] for contact in contacts]))
        readings = [twin.sense(motion[k], time=100.0 * k) for k in range(len(contacts))]
        for name, estimator in estimators.items():
            tally = tallies.setdefault((press, name), Tally())
            for top, contact, reading in zip(tops, contacts, readings, strict=True):
                estimator.reset()
                estimator.zero(untouched)
                estimate = estimator.step(reading)
                tally.status[estimate.status.name] += 1
                detected = estimate.contacts if estimate.status is Status.CONTACT else ()
                right = len(detected) == 1 and bool(
                    (np.abs(detected[0].position - top) < cell / 2).all()
                )
                tally.right.append(right)
                if right:
                    tally.force.append(detected[0].force - contact.force)
                    tally.place.append(float(np.hypot(*(detected[0].position - contact.position))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--skins", type=int, default=10)
    skins = parser.parse_args().skins
    design, table = load_design("planar"), load_response_table("planar")
    tallies: dict[tuple[str, str], Tally] = {}
    for seed in range(skins):
        twin = Twin(design, seed=seed, manufactured=True)
        estimators: dict[str, Estimator] = {"theory": ClosedFormEstimator(design)}
        for name, own in calibrations(twin, seed, table).items():
            estimators[f"closed forms, {name}"] = ClosedFormEstimator(design, own)
            estimators[f"Bayes, {name}"] = BayesEstimator(design, own, priors=SINGLE, creep=ELASTIC)
        judge(twin, estimators, tallies, seed)
    print(f"{skins} skins, {36 * skins} presses a row; errors of the right ones")
    print(f"{'press':50} {'estimator':26} right   Fx    Fy    Fz mN  place mm  not a contact")
    for (press, name), tally in tallies.items():
        print(f"{press:50} {name:26} {tally.row()}")
    for name in ("closed forms, 15 of a rig", "Bayes, 15 of a rig"):
        share = np.mean(tallies["0.5 N", name].right)
        if share < LEAST:
            raise SystemExit(f"{name}: {share:.1%} of cells right, must be {LEAST:.0%}")


if __name__ == "__main__":
    main()
