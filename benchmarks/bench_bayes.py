"""The Bayesian estimator on made skins that its table never saw: the figures of `smoskin score`.

Makes the table first where there is none (some minutes), and tells the bound beside the figures:
``OMP_NUM_THREADS=1 python benchmarks/bench_bayes.py planar.table --skins 5 --places 25x33``.
"""

import argparse

import numpy as np
from rich.console import Console

from smoskin import load_design
from smoskin.commands.score import Exam, candidate, examine
from smoskin.commands.score.evaluate import parse_places
from smoskin.commands.train import parse_chips
from smoskin.sensing.response.bound import bound_map
from smoskin.sensing.response.table import load_response_table
from smoskin.sensing.signals.signals import signal_noise


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", nargs="?", default="planar")
    parser.add_argument("--design", default="planar")
    parser.add_argument("--skins", type=int, default=5)
    parser.add_argument("--places", default="25x33")
    parser.add_argument("--count", type=int, help="of the places for each force; all by default")
    parser.add_argument("--touches", type=int, default=60)
    parser.add_argument("--drag", type=float, default=0.5)
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--chips", default="1,2")
    asked = parser.parse_args()
    design = load_design(asked.design)
    exam = Exam(
        skins=tuple(range(1, asked.skins + 1)),
        touches=asked.touches,
        places=parse_places(asked.places),
        count=asked.count,
        drag=asked.drag,
        pairs=asked.pairs,
        chips=parse_chips(asked.chips),
    )
    table = load_response_table(asked.table)
    subject = candidate(table, design, exam)
    console = Console(width=110)
    for shown in examine(design, subject, exam).tables():
        console.print(shown)
    best = bound_map(
        table.of_chips(subject.chips), signal_noise(design, subject.chips), drags=False
    )
    area, spacing = best.super_resolution
    console.print(
        f"bound of a skin as designed at 0.5 N: median {np.median(best.location) * 1e3:.3f} mm, "
        f"blind {best.blind.mean():.0%} {', '.join(best.blind_regions())}; super-resolution "
        f"{area:.0f} (area), {spacing:.0f} (spacing)"
    )


if __name__ == "__main__":
    main()
