"""Right cells on manufactured whole-sheet skins, by a table of one press a cell and by theory.

Run: ``OMP_NUM_THREADS=1 python benchmarks/bench_table.py``; needs the extra ``twin``. Each of ten
made skins is measured by a bench with 2 % of noise in force, then pressed ten times on each of
its 36 cells, 3,600 presses a row, with the chips' noise. A press counts if the estimate is a
contact on the right cell.
"""

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from smoskin.sensing.closed_form.table_fit import fit_press_table

from smoskin import ClosedFormEstimator, Reading, SkinDesign, Status, load_design
from smoskin.arrays import Floats
from smoskin.magnetics import mlx90393
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.twin.bench import TwinSkin, measure, table_loads
from smoskin.twin.manufacture import Tolerances
from smoskin.twin.whole import Twin

SKINS = 10
REPEATS = 10
LEAST = 0.95
"""Share of right cells at 0.5 N that the measured table must reach."""
PRESSES = (
    ("0.2 N", 0.2, 0.0, 0.0),
    ("0.5 N", 0.5, 0.0, 0.0),
    ("1 N", 1.0, 0.0, 0.0),
    ("0.5 N, off the vertex by up to a fifth of a cell", 0.5, 0.0, 0.2),
    ("0.5 N, dragged by 0.1 N", 0.5, 0.1, 0.0),
    ("0.5 N, dragged by 0.3 N", 0.5, 0.3, 0.0),
)
NONE = dict.fromkeys(Tolerances.__slots__, 0.0)
AS_MADE = ("chip_place", "chip_tilt", "magnet_place", "magnet_tilt")
PARTS = {
    "as designed": Tolerances(**NONE),
    "sheet and rubber scatter": Tolerances(**(NONE | {
        name: getattr(Tolerances(), name)
        for name in ("stiffness_variation", "column_stiffness", "column_height",
                     "crease_stiffness", "frame_stiffness")})),
    "magnets and chips scatter": Tolerances(**(NONE | {
        name: getattr(Tolerances(), name) for name in AS_MADE})),
}  # fmt: skip


class Tally:
    """Right cells, forces and statuses of one kind of press under one calibration."""

    def __init__(self) -> None:
        self.right: list[bool] = []
        self.off: list[Floats] = []
        self.status: Counter[str] = Counter()
        self.named = np.zeros((36, 37), dtype=int)

    def row(self) -> str:
        """For people."""
        off = np.sqrt(np.mean(np.square(self.off), axis=0)) * 1e3 if self.off else np.zeros(3)
        other = {name: count for name, count in self.status.items() if name != "CONTACT"}
        return (
            f"{np.mean(self.right):7.2%}   {off[0]:5.1f} {off[1]:5.1f} {off[2]:6.1f}   "
            f"{', '.join(f'{count} {name}' for name, count in other.items())}"
        )


def readings(twin: Twin, motion: Motion, rng: np.random.Generator, start: float) -> list[Reading]:
    """One reading of each state."""
    sample = twin.sample(motion, rng)
    field = mlx90393.tesla(sample.counts, twin.design.hall_setting)
    warmth = mlx90393.degrees(sample.temperature_counts)
    return [
        Reading(time=start + k, field=field[k], temperature=warmth[k], flags=sample.flags[k])
        for k in range(len(field))
    ]


def repeated(motion: Motion, times: int) -> Motion:
    """Every state so often."""
    return motion[np.repeat(np.arange(len(motion.board)), times)]


def judge(
    twin: Twin,
    ways: dict[str, Calibration],
    tell: Callable[[str, str], Tally],
    presses: Sequence[tuple[str, float, float, float]] = PRESSES,
) -> None:
    """Press one skin so under every calibration."""
    design = twin.design
    rng = np.random.default_rng(len(ways))
    extent = geometry(design).cell
    cell = np.array([extent.length, extent.width])
    places = geometry(design).tops.reshape(-1, 2)
    idle = Touches(position=places[:, None], force=np.zeros((len(places), 1, 3)))
    zero = readings(twin, twin.motions(idle), rng, -1e3)
    for press, force, drag, off in presses:
        way = rng.uniform(0, 2 * np.pi, len(places))
        where = places + rng.uniform(-off, off, places.shape) * cell
        push = np.column_stack(
            [drag * np.cos(way), drag * np.sin(way), np.full(len(places), -force)]
        )
        motion = twin.motions(Touches(position=where[:, None], force=push[:, None]))
        seen = readings(twin, repeated(motion, REPEATS), rng, 0.0)
        for name, calibration in ways.items():
            estimator = ClosedFormEstimator(design, calibration)
            estimator.zero(zero)
            tally = tell(press, name)
            for k, estimate in enumerate(estimator.batch(seen)):
                true, named = k // REPEATS, len(places)
                tally.status[estimate.status.name] += 1
                if estimate.status is Status.CONTACT:
                    n, m = (estimate.contacts[0].position // cell).astype(int)
                    named = n * design.cells[1] + m
                tally.named[true, named] += 1
                tally.right.append(named == true)
                if named == true:
                    tally.off.append(estimate.contacts[0].force - push[true])


def calibrations(twin: Twin, seed: int) -> dict[str, Calibration]:
    """Theory's, and those learned by one and by three touches a cell."""
    rng = np.random.default_rng(1000 + seed)
    touches = measure(TwinSkin(twin), table_loads(twin.design), rng)
    alone = touches.rows(np.abs(touches.force[:, :2]).max(axis=1) < 0.05)
    fits = [
        fit_press_table(twin.design, one, date="2026-01-31", data_sha256="")
        for one in (alone, touches)
    ]
    return {
        "theory": Calibration.nominal(twin.design),
        "one press a cell": fits[0].calibration,
        "and two drags": fits[1].calibration,
    }


def explain(design: SkinDesign) -> None:
    """What of theory's misses comes from the sheet, and what from how the skin is made."""
    print("\nTheory's rule at 0.5 N: right cells, by what differs from the design")
    for name, tolerances in PARTS.items():
        tally = Tally()
        for seed in range(1 if name == "as designed" else 4):
            twin = Twin(design, seed=seed, manufactured=True, tolerances=tolerances)
            ways = {"theory": Calibration.nominal(design)}
            judge(twin, ways, lambda *_, t=tally: t, [one for one in PRESSES if one[0] == "0.5 N"])
        print(f"{name:28} {np.mean(tally.right):7.1%}")


def main() -> None:
    design = load_design("planar")
    tallies: dict[tuple[str, str], Tally] = {}
    for seed in range(SKINS):
        twin = Twin(design, seed=seed, manufactured=True)
        judge(
            twin,
            calibrations(twin, seed),
            lambda press, way: tallies.setdefault((press, way), Tally()),
        )
    print(f"{SKINS} skins, {36 * SKINS * REPEATS} presses a row; force: rms error of right ones")
    print(f"{'press':50} {'calibration':18} right   Fx    Fy    Fz mN   not a contact")
    for (press, way), tally in tallies.items():
        print(f"{press:50} {way:18} {tally.row()}")
    named = tallies["0.5 N", "theory"].named[:, :36].reshape(6, 6, 6, 6)
    right = np.einsum("nmnm->nm", named) / (SKINS * REPEATS)
    columns = np.einsum("nmnk->", named) / named.sum()
    rows = np.einsum("nmkm->", named) / named.sum()
    print("\nTheory at 0.5 N, share of right cells; columns down, rows across")
    print(np.array2string(right, precision=2, floatmode="fixed"))
    print(f"right column {columns:.1%}, right row {rows:.1%}")
    explain(design)
    for way in ("one press a cell", "and two drags"):
        share = np.mean(tallies["0.5 N", way].right)
        if share < LEAST:
            raise SystemExit(f"{way}: {share:.1%} of cells right, must be {LEAST:.0%}")


if __name__ == "__main__":
    main()
