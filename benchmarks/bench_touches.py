"""Calibration touches against error, planned and random, on made skins that no table has seen.

``OMP_NUM_THREADS=1 python benchmarks/bench_touches.py planar.table --skins 5 --places 60``; the
table is made first where there is none (some minutes).
"""

import argparse
import json
import sys

from paper.models.touch_curve import CurveEffort, touch_curve
from smoskin import load_design
from smoskin.sensing.response.table import load_response_table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", nargs="?", default="planar")
    parser.add_argument("--skins", type=int, default=5)
    parser.add_argument("--counts", type=int, nargs="+", default=(2, 5, 8, 10, 15, 30, 60, 120))
    parser.add_argument("--forces", type=float, nargs="+", default=(0.3, 0.5, 0.7, 1.0))
    parser.add_argument("--places", type=int, default=60, help="of 25 x 33 for each force")
    parser.add_argument("--chips", type=int, nargs="+", default=(1, 2))
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    design = load_design("planar")
    table = load_response_table(asked.table).of_chips(tuple(asked.chips))
    effort = CurveEffort(
        seeds=tuple(range(1, asked.skins + 1)),
        counts=tuple(asked.counts),
        forces=tuple(asked.forces),
        places=asked.places,
    )
    curve = touch_curve(
        design, table, effort, progress=lambda what, share: print(what, file=sys.stderr)
    )
    if asked.json:
        print(json.dumps({"bound_mm": 1e3 * curve.bound, "rows": curve.rows()}, indent=1))
        return
    print(
        "touches   planned (worst skin)    random (worst skin)   expected   force   random  inside"
    )
    for row in curve.rows():
        print(
            "{touches:7d}   {planned_mm:.3f} ({planned_worst_skin_mm:.3f}) mm   "
            "{random_mm:8.3f} ({random_worst_skin_mm:.3f}) mm   {expected_mm:.3f} mm  "
            "{planned_force_percent:5.2f} %  {random_force_percent:5.2f} %  "
            "{inside_percent:4.0f} %".format(**row)
        )
    print(f"  bound   {1e3 * curve.bound:.3f} mm by the chips' noise")


if __name__ == "__main__":
    main()
