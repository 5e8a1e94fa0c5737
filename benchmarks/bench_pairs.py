"""Two touches on made skins that the table never saw: at once, and one after the other.

``OMP_NUM_THREADS=1 python benchmarks/bench_pairs.py planar.response --skins 5 --pairs 40``; makes
the table first where there is none. For pairs that land together: how many touches were counted,
how far off their places are, what share of pairs has both within 5 mm, and the Cramer-Rao bound of
the same pairs with noise alone and with all that the calibrated table does not know. Then the same
pairs, their second touch 0.3 s after the first.
"""

import argparse
import time
from typing import NamedTuple

import numpy as np

from smoskin import load_design
from smoskin.arrays import Floats
from smoskin.commands.score.evaluate import label
from smoskin.datasets.patterns import far_pairs
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.records import Motion, Reading, Status
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.bayes.solver import TouchSolver
from smoskin.sensing.response.calibrate import TouchPlanner, calibrate_touches
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.creep import Creep
from smoskin.twin.rig import drifting_readings
from smoskin.twin.whole import Twin

ZEROS = 20
AT_ONCE = ((0.0, 0), (0.02, 2), (0.3, 2), (0.32, 0))
ONE_THEN_TWO = ((0.0, 0), (0.02, 1), (0.3, 1), (0.32, 2), (0.6, 2), (0.62, 0))
"""s after a pair begins, and how many touches there are; the last reading with both counts."""
PERIOD = 1.2
DRIFT = 0.3e-6
"""Random walk of each axis in a second, T."""


class Found(NamedTuple):
    """Of B pairs."""

    count: Floats
    """(B,): touches said."""
    off: Floats
    """(B, 2), m; NaN where the count was wrong."""
    inside: Floats
    """(B, 2): whether the truth lay in the stated 90 % region."""
    seconds: Floats
    """(B,): of the steps that were judged."""


def readings(
    twin: Twin,
    pairs: Touches,
    moments: tuple[tuple[float, int], ...],
    temperature: float,
    rng: np.random.Generator,
) -> list[Reading]:
    """All that the chips read while pairs come and go."""
    first = Touches(position=pairs.position[:, :1], force=pairs.force[:, :1])
    held = [twin.motions(touches, temperature=temperature) for touches in (first, pairs)]
    total = ZEROS + len(moments) * len(pairs)
    starts = PERIOD * np.arange(1, len(pairs) + 1)
    times = np.add.outer(starts, [moment for moment, _ in moments]).ravel()
    times = np.concatenate([np.linspace(-1.0, 0.0, ZEROS), times])
    states = Motion.concatenate([Motion.rest(len(twin.design.magnets), (1,)), *held])
    state = np.zeros(total, dtype=int)
    for place, (_, there) in enumerate(moments):
        if there:
            count = len(pairs)
            begin = 1 + (there - 1) * count
            state[ZEROS + place :: len(moments)] = np.arange(begin, begin + count)
    steps = np.diff(times, prepend=times[0])
    motion = Creep(twin.design).steps(steps, states[state])
    walk = {"temperature": temperature, "drift": DRIFT}
    return list(drifting_readings(twin, motion, times, steps, rng, **walk)[0])


def judge(
    estimator: BayesEstimator,
    stream: list[Reading],
    pairs: Touches,
    moments: tuple[tuple[float, int], ...],
) -> Found:
    """What the estimator says of each pair at the last moment at which both touches are there."""
    judged = max(place for place, (_, there) in enumerate(moments) if there == 2)
    estimator.reset()
    estimator.zero(stream[:ZEROS])
    count, seconds = np.full(len(pairs), -1.0), np.zeros(len(pairs))
    off, inside = np.full((len(pairs), 2), np.nan), np.zeros((len(pairs), 2))
    for k, reading in enumerate(stream[ZEROS:]):
        begin = time.perf_counter()
        estimate = estimator.step(reading)
        row, place = divmod(k, len(moments))
        if place != judged:
            continue
        seconds[row] = time.perf_counter() - begin
        if estimate.status in (Status.CONTACT, Status.NO_CONTACT):
            count[row] = len(estimate.contacts)
        if count[row] == 2:
            where = np.stack([contact.position for contact in estimate.contacts])
            turns = [where - pairs.position[row], where[::-1] - pairs.position[row]]
            turned = np.argmin([np.hypot(*turn.T).sum() for turn in turns])
            gap, spread = turns[turned], estimate.covariance[:: -1 if turned else 1, :2, :2]
            off[row] = np.hypot(*gap.T)
            sure = np.linalg.solve(spread, gap[..., None])[..., 0]
            inside[row] = (gap * sure).sum(axis=1) < -2 * np.log(0.1)
    return Found(count, off, inside, seconds)


def bounds(table: ResponseTable, noise: Floats, pairs: Touches, *, known: bool) -> Floats:
    """Root mean square error of each place that no estimator can go below, (B, 2), m."""
    point = table.point_table()
    misfit = TouchSolver(table, noise).misfit + table.pair_misfit
    prior = np.diag(np.tile([*12 / table.basis.extent**2, 1e-6], 2))
    out = np.empty((len(pairs), 2))
    for row, (place, force) in enumerate(zip(pairs.position, pairs.force, strict=True)):
        spread = noise if known else noise + float(force[:, 2].sum() ** 2) * misfit
        slopes = point.pairs(place[None], -force[None, :, 2])[1][0]
        information = slopes @ np.linalg.solve(spread, slopes.T) + prior
        out[row] = np.sqrt(np.diag(np.linalg.inv(information)).reshape(2, 3)[:, :2].sum(axis=1))
    return out


def line(name: str, answers: Found) -> str:
    """Figures of one way in which pairs come."""
    right = answers.count == 2
    off = answers.off[right] * 1e3
    both = (np.nan_to_num(answers.off, nan=np.inf) < 5e-3).all(axis=1)
    return (
        f"{name:>14}: counted {right.mean():6.1%}; place mean {off.mean():5.2f} mm, median "
        f"{np.median(off):5.2f}, 90 % {np.percentile(off, 90):5.2f}; both within 5 mm "
        f"{both.mean():5.1%}; 90 % regions hold {answers.inside[right].mean():5.1%}; step median "
        f"{np.median(answers.seconds) * 1e3:.1f} ms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", nargs="?", default="planar")
    parser.add_argument("--skins", type=int, default=5)
    parser.add_argument("--first", type=int, default=1, help="seed of the first made skin")
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--touches", type=int, default=60)
    parser.add_argument("--apart", type=float, default=40.0, help="mm, at least")
    parser.add_argument("--chips", type=int, nargs="+", default=(0, 1, 2))
    parser.add_argument("--drag", type=float, default=0.0, help="N, that a single touch may have")
    asked = parser.parse_args()
    design = load_design("planar")
    table = load_response_table(asked.table).of_chips(tuple(asked.chips))
    noise = signal_noise(design, table.chips)
    plan = TouchPlanner(table, noise).plan(asked.touches)
    ways = {"at once": AT_ONCE, "one then two": ONE_THEN_TWO}
    answers: dict[str, list[Found]] = {name: [] for name in ways}
    best: dict[bool, list[Floats]] = {True: [], False: []}
    for seed in range(asked.first, asked.first + asked.skins):
        rng = np.random.default_rng(seed)
        twin = Twin(design, seed=seed, manufactured=True)
        touches = label(twin, plan, rng, temperature=22.0, chips=table.chips)
        skin = calibrate_touches(table, touches, noise)
        estimator = BayesEstimator(
            design,
            skin,
            priors=TouchPriors(drag_spread=asked.drag),
        )
        position = far_pairs(geometry(design).extent, asked.apart / 1e3, asked.pairs, rng)
        force = np.zeros((asked.pairs, 2, 3))
        force[..., 2] = -rng.uniform(0.3, 1.0, (asked.pairs, 2))
        pairs = Touches(position=position, force=force)
        temperature = float(rng.uniform(15.0, 35.0))
        for name, moments in ways.items():
            stream = readings(twin, pairs, moments, temperature, rng)
            answers[name].append(judge(estimator, stream, pairs, moments))
            print(line(f"skin {seed} {name}", answers[name][-1]), flush=True)
        for known, all_bounds in best.items():
            all_bounds.append(bounds(skin, noise, pairs, known=known))
    for name, parts in answers.items():
        print(line(name, Found(*(np.concatenate(column) for column in zip(*parts, strict=True)))))
    for known, parts in best.items():
        rms = np.concatenate(parts) * 1e3
        print(
            f"bound with {'noise alone' if known else 'what the table does not know'}: mean "
            f"{rms.mean():.2f} mm, median {np.median(rms):.2f}; both within 5 mm "
            f"{(rms < 5).all(axis=1).mean():.1%}"
        )


if __name__ == "__main__":
    main()
