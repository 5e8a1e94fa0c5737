"""One step of the closed-form estimator: latency, beside what the machine and the chip take.

Run alone on a quiet core: ``OMP_NUM_THREADS=1 python benchmarks/bench_step.py``.
"""

import time

import numpy as np

from smoskin import (
    ClosedFormEstimator,
    Contact,
    Reading,
    ReducedTwin,
    load_design,
    load_response_table,
)
from smoskin.magnetics.mlx90393 import conversion_time
from smoskin.origami.geometry import geometry

STEPS = 5000


def seconds(work: object, count: int) -> np.ndarray:
    """Time of each of `count` calls."""
    taken = np.empty(count)
    for k in range(count):
        begin = time.perf_counter()
        work(k)
        taken[k] = time.perf_counter() - begin
    return taken


def main() -> None:
    design = load_design("planar")
    twin = ReducedTwin(design, seed=0)
    estimators = {
        "by theory": ClosedFormEstimator(design),
        "by a response table": ClosedFormEstimator(design, load_response_table("planar")),
    }
    small = np.zeros((3, 3))
    unit = np.median(seconds(lambda k: small + small, 20000))
    conversion = conversion_time(design.hall_setting)
    print(f"one addition of two 3 x 3 arrays: {unit * 1e6:.2f} us")
    print(f"one conversion of the chips: {conversion * 1e6:.0f} us")
    for name, force, drag in (("idle", 0.0, 0.0), ("0.5 N", 0.5, 0.1), ("1 N", 1.0, 0.4)):
        readings = []
        for k, place in enumerate(np.resize(geometry(design).tops.reshape(-1, 2), (STEPS, 2))):
            touch = [Contact(position=place, force=(drag, 0.0, -force))] if force else []
            once = twin.read(touch) if k < 36 else readings[k - 36]
            readings.append(
                Reading(time=k + 1e4 * (force + 1), field=once.field,
                        temperature=once.temperature, flags=once.flags)
            )  # fmt: skip
        for way, estimator in estimators.items():
            taken = seconds(lambda k, r=readings, e=estimator: e.step(r[k]), STEPS)
            median, p99 = np.percentile(taken, [50, 99])
            print(
                f"step {way}, {name}: median {median * 1e6:.1f} us, 99 % {p99 * 1e6:.1f} us; "
                f"{median / unit:.0f} additions, {median / conversion:.3f} conversions"
            )


if __name__ == "__main__":
    main()
