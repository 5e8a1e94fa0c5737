"""Pairs of touches that are held for a while, and of which one slides, in the hard world.

``OMP_NUM_THREADS=1 python benchmarks/bench_held_pairs.py --skins 3 --first 31 [--posed]``. The
first touch is alone for 0.4 s; then both are held for 1.6 s, and from 0.2 s on one of them slides
by up to 20 mm. Of the readings from 0.4 s on that both are held: how many told two touches, how far
off each is, and what share of the stated 90 % regions holds it.
"""

import argparse
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from smoskin import load_design, load_response_table
from smoskin.arrays import Floats
from smoskin.commands.score import Candidate, candidate
from smoskin.commands.score.evaluate import Exam
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.touches import Touches
from smoskin.records import Motion, Pose, Reading
from smoskin.twin.creep import Creep
from smoskin.twin.rig import drifting_readings
from smoskin.twin.whole import Twin
from smoskin.twin.world.effect import World
from smoskin.twin.world.worlds import world_of

STEP = 0.1
"""Time between readings, s."""
ZEROS = 20
ALONE, TOGETHER, AFTER = 4, 16, 8
"""Readings of the first touch alone, of both, and of none after them."""
SETTLED = 4
"""Readings of both before they count."""
FARTHEST = 0.02
"""Longest way that a touch slides, m."""
SPEEDS = (0.0, 0.01, 0.03, 0.1)
"""Speeds at which it does, m/s."""


class Held(NamedTuple):
    """Readings of pairs of touches."""

    readings: list[Reading | None]
    places: Floats
    """(T, 2, 2), m: where both touches are; NaN where no pair counts."""
    turns: Floats
    """(T, 3, 3): rotation from the skin's frame to the room's."""


def held(twin: Twin, world: World, seed: int, count: int, *, sliding: int, speed: float) -> Held:
    """What chips read of pairs of which one touch, the first or the second, slides."""
    rng = np.random.default_rng([seed, sliding, int(1e3 * speed)])
    idle = round((20 if world.posed else 1) / STEP)
    before = -idle * STEP + np.linspace(-1.0, 0.0, ZEROS)
    places, forces, states, counted = [], [], [-1] * (ZEROS + idle), [False] * (ZEROS + idle)
    for _ in range(count):
        start = far_pair(rng)
        heading = rng.uniform(0.0, 2 * np.pi)
        way = np.array([np.cos(heading), np.sin(heading)])
        press = -rng.uniform(0.3, 1.0, 2)
        for k in range(ALONE + TOGETHER):
            moved = start.copy()
            moved[sliding] += min(speed * STEP * max(k - ALONE - 2, 0), FARTHEST) * way
            states.append(len(places))
            counted.append(k >= ALONE + SETTLED)
            places.append(np.clip(moved, 0.005, (0.115, 0.155)))
            forces.append(press if k >= ALONE else press * (1.0, 0.0))
        states += [-1] * AFTER
        counted += [False] * AFTER
    position, normal = np.array(places), np.array(forces)
    alone = normal[:, 1] == 0.0
    # One finger is two touches in one place, each with half of its force.
    position_pressed = np.where(alone[:, None, None], position[:, :1], position)
    normal[alone] = normal[alone, :1] / 2
    push = np.concatenate([np.zeros((*normal.shape, 2)), normal[..., None]], axis=-1)
    motion = twin.motions(Touches(position=position_pressed, force=push), temperature=25.0)
    motion = Motion.concatenate([motion, Motion.rest(len(twin.design.magnets), (1,))])
    times = np.concatenate([before, STEP * (np.arange(len(states) - ZEROS) - idle + 1)])
    steps = np.diff(times, prepend=times[0])
    run = world.run(twin, (seed, sliding, int(1e3 * speed)))
    moving = Creep(twin.design).steps(steps, run.moved(times, motion[np.array(states)]))
    around = run.around(times)
    read, _ = drifting_readings(
        twin, moving, times, steps, rng, temperature=25.0, drift=0.3e-6, around=around
    )
    there = np.full((len(states), 2, 2), np.nan)
    there[counted] = position[np.array(states)[counted]]
    return Held(run.arrived(read), there, run.poses(times))


def far_pair(rng: np.random.Generator) -> Floats:
    """Two places at least 50 mm apart and 20 mm from the rim, (2, 2), m."""
    while True:
        pair = rng.uniform((0.02, 0.02), (0.1, 0.14), (2, 2))
        if np.hypot(*(pair[0] - pair[1])) > 0.05:
            return pair


def judged(subject: Candidate, twin: Twin, world: World, seed: int, pairs: Held) -> Floats:
    """Whether two were told, and how far off and held each is, of what counts, (R, 5)."""
    estimator = subject.enter(twin, np.random.default_rng([seed, 0]), world)[1][False]
    now = 0
    if world.posed:
        estimator.carried_by(lambda: Pose(turn=pairs.turns[now]))
    estimator.zero([reading for reading in pairs.readings[:ZEROS] if reading], force=True)
    rows = []
    for now, (reading, places) in enumerate(zip(pairs.readings, pairs.places, strict=True)):
        if now < ZEROS or reading is None:
            continue
        estimate = estimator.step(reading)
        if np.isnan(places).any():
            continue
        if len(estimate.contacts) != 2:
            rows.append([0.0, *4 * [np.nan]])
            continue
        away = np.stack([contact.position for contact in estimate.contacts])[[[0, 1], [1, 0]]]
        away = away - places
        order = int(np.hypot(*np.moveaxis(away, -1, 0)).sum(axis=1).argmin())
        off, spread = away[order], estimate.covariance[:: -1 if order else 1, :2, :2]
        squares = (off * np.linalg.solve(spread, off[..., None])[..., 0]).sum(axis=1)
        rows.append([1.0, *np.hypot(*off.T), *(squares < -2 * np.log(0.1))])
    return np.array(rows)


def calibrated(design: SkinDesign, twin: Twin, world: World, seed: int) -> Candidate:
    """The shipped table after 60 touches of this skin."""
    exam = Exam(skins=(seed,), world=world)
    subject = candidate(load_response_table(design.name), design, exam)
    table, _ = subject.enter(twin, np.random.default_rng([seed, 0]), world)
    assert table is not None
    return candidate(table, design, replace(exam, touches=0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--skins", type=int, default=3)
    parser.add_argument("--first", type=int, default=31, help="seed of the first made skin")
    parser.add_argument("--pairs", type=int, default=6)
    parser.add_argument("--posed", action="store_true", help="the arm tells how it is held")
    options = parser.parse_args()
    design, world = load_design("planar"), world_of("hard")
    if options.posed:
        world = replace(world, name="hard, posed", posed=True)
    skins = {}
    for seed in range(options.first, options.first + options.skins):
        twin = world.skin(design, seed, None)
        skins[seed] = twin, calibrated(design, twin, world, seed)
    for sliding, name in enumerate(("the first", "the second")):
        for speed in SPEEDS[sliding:]:
            rows = np.concatenate(
                [
                    judged(
                        subject,
                        twin,
                        world,
                        seed,
                        held(twin, world, seed, options.pairs, sliding=sliding, speed=speed),
                    )
                    for seed, (twin, subject) in skins.items()
                ]
            )
            told_two, first, second, *inside = np.nanmean(rows, axis=0).tolist()
            print(
                f"{name} slides at {1e3 * speed:3.0f} mm/s: {told_two:4.0%} told as two; first "
                f"{1e3 * first:5.1f} mm, regions hold {inside[0]:4.0%}; second {1e3 * second:5.1f} "
                f"mm, {inside[1]:4.0%}",
                flush=True,
            )


if __name__ == "__main__":
    main()
