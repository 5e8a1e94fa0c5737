"""Field of the sector magnet against magpylib's cylinder segments, side by side in one process.

Run with ``OMP_NUM_THREADS=1 python benchmarks/bench_sector.py``; fails below fifty times.
"""

import time
from collections.abc import Callable

import magpylib
import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import Magnet
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.sector import VACUUM_PERMEABILITY, field, field_and_gradient

LEAST_RATIO = 50.0
POINTS = 2_000
MAGNET = Magnet(name="M", mount="sheet", corner=(0, 0), radius=5e-3, height=2e-3, remanence=8.04e5)


def segments() -> list[magpylib.magnet.CylinderSegment]:
    """The magnet as magpylib builds it."""
    polarisation = VACUUM_PERMEABILITY * MAGNET.remanence
    return [
        magpylib.magnet.CylinderSegment(
            dimension=(0.0, MAGNET.radius, MAGNET.height, start, start + 90),
            polarization=-polarisation
            * np.array([np.cos(np.deg2rad(start + 45)), np.sin(np.deg2rad(start + 45)), 0.0]),
        )
        for start in (0, 90, 180, 270)
    ]


def microseconds(calls: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Least time of each call; they take turns, so that a busy machine slows all alike."""
    best = dict.fromkeys(calls, np.inf)
    for _ in range(rounds):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            best[name] = min(best[name], 1e6 * (time.perf_counter() - start))
    return best


def clouds() -> dict[str, Floats]:
    """Where sensors sit, and anywhere outside within three radii."""
    rng = np.random.default_rng(0)
    sensor = rng.uniform([-2e-3, -2e-3, -9e-3], [2e-3, 2e-3, -4e-3], (POINTS, 3))
    anywhere = rng.uniform(-15e-3, 15e-3, (2 * POINTS, 3))
    inside = np.hypot(anywhere[:, 0], anywhere[:, 1]) < MAGNET.radius
    inside &= np.abs(anywhere[:, 2]) < 0.5 * MAGNET.height
    return {"3 to 8 mm below": sensor, "anywhere outside": anywhere[~inside][:POINTS]}


def main() -> None:
    sources = segments()
    ratios = []
    print(f"{'points':18}{'ours us':>9}{'with slope':>11}{'magpylib us':>13}{'ratio':>7}  error")
    for name, points in clouds().items():
        many = np.tile(points, (10, 1))
        best = microseconds(
            {
                "ours": lambda many=many: field(MAGNET, many),
                "slope": lambda many=many: field_and_gradient(MAGNET, many),
                "theirs": lambda points=points: magpylib.getB(sources, points, sumup=True),
            },
            rounds=6,
        )
        ours, slope = best["ours"] / len(many), best["slope"] / len(many)
        theirs = best["theirs"] / len(points)
        true = magpylib.getB(sources, points, sumup=True)
        error = np.linalg.norm(field(MAGNET, points) - true, axis=1) / np.linalg.norm(true, axis=1)
        ratios.append(theirs / ours)
        print(
            f"{name:18}{ours:9.2f}{slope:11.2f}{theirs:13.1f}{ratios[-1]:7.0f}"
            f"  median {np.median(error):.1e}, 99 % below {np.quantile(error, 0.99):.1e}"
        )
    positions, charges = point_charges([MAGNET] * 3)
    chips = clouds()["3 to 8 mm below"][:3]
    call = microseconds(
        {"charges": lambda: charge_field_and_gradient(positions, charges, chips)}, rounds=5_000
    )["charges"]
    print(f"point charges, B and slope at three chips: {call:.1f} us a call")
    if min(ratios) < LEAST_RATIO:
        raise SystemExit(f"ratio must be at least {LEAST_RATIO:.0f}; got {min(ratios):.0f}")


if __name__ == "__main__":
    main()
