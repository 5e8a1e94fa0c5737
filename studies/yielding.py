"""How surely an arm yields: the chance to be moved by true force, and by nothing at all.

``python -m studies.yielding force`` presses made skins in the hard world, each calibrated by a
rig's touches, and asks of each touch whether its readings would move an arm that stands.
``python -m studies.yielding nobody`` carries an untouched skin along random trajectories at the
speed limit. Both write a figure or numbers beside the documentation's page.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.calibrate import calibrate
from smoskin.commands.score.evaluate import press, readings
from smoskin.design.skin import SkinDesign
from smoskin.feasibility import load_design
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.robot import law
from smoskin.robot.arm import ArmState
from smoskin.robot.chain import Carriage, Chain
from smoskin.robot.follow import Follow, Seen, State
from smoskin.robot.law import Limits
from smoskin.robot.simulated import SimulatedArm
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.estimators import ZeroFirst
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.sensing.signals.estimator import ON_AN_ARM
from smoskin.twin.carried import CarriedSkin
from smoskin.twin.readout import Readout
from smoskin.twin.rig import VirtualRig
from smoskin.twin.surroundings import Ambience, Neighbour, Surroundings
from smoskin.twin.whole import Twin
from smoskin.twin.world.effect import Effect, World
from smoskin.twin.world.fields import Steel
from smoskin.twin.world.worlds import HARD, PLAIN


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SkinBeside(Effect):
    """Another skin of the design on the same limb, whose magnets presses move at once."""

    gap: float = 5e-3
    """From edge to edge along x, m."""
    sinks: float = 1e-3
    """How far its magnets sink under a press, m."""
    period: float = 1.3
    """Time from press to press, half of which each lasts, s."""

    def ambience(self, twin: Twin, rng: np.random.Generator, times: Floats) -> Ambience:
        """As `Effect.ambience`."""
        rest, away = Motion.rest(len(twin.design.magnets)), geometry(twin.design).extent[0]
        alone, beside, pressed = (
            Readout(twin.design, surroundings=Surroundings(neighbours=skins)).field(rest)
            for skins in (
                (),
                (Neighbour(place=(away + self.gap, 0.0, 0.0)),),
                (Neighbour(place=(away + self.gap, 0.0, -self.sinks)),),
            )
        )
        held = (times % self.period > self.period / 2)[:, None, None]
        none = Ambience.none(len(times), len(twin.design.halls))
        return none + Ambience(
            field=np.where(held, pressed, beside) - alone, magnets=none.magnets, chips=none.chips
        )


FORCES: Final = (0.30, 0.35, 0.40, 0.45, 0.50, 0.55, 0.60, 0.65, 0.70)
"""Sizes of the true forces, N."""
FIGURES: Final = Path(__file__).parents[1] / "docs" / "follow.json"
_TILT: Final = 0.35
"""Largest drag for a pressing force of 1."""
_RIM: Final = 10e-3
"""Distance that touches keep from the rim, m."""
_ZEROS: Final = 20
"""Readings of the untouched skin with which a session begins."""
_RATE: Final = 50.0
"""Readings a second on a trajectory."""
_WARMING: Final = 0.1
"""Rise of the temperature, degC/s."""
_WARMER: Final = 5.0
"""Whole rise, degC."""
_PAUSE: Final = 1.0
"""Seconds of rest after a trajectory."""
_SWING: Final = 9.0
"""Seconds of slower turns before a trajectory counts, in which poses are learned."""


def calibrated(
    design: SkinDesign, world: World, seed: int, count: int
) -> tuple[Twin, ResponseTable]:
    """A made skin of a world, and its table by so many touches of a rig."""
    twin = world.skin(design, seed)
    run = None if world.plain else world.run(twin, (seed, 1), bench=True)
    rig = VirtualRig(twin, seed=seed, run=run)
    done = calibrate(load_response_table(design.name), rig, design=design, count=count)
    return twin, done.table


def moved(
    design: SkinDesign, world: World, seeds: Sequence[int], presses: int, touches: int
) -> dict[str, list[int]]:
    """How many presses of each force moved the arm, of how many."""
    limits = Limits()
    yielded = dict.fromkeys(FORCES, 0)
    asked = dict.fromkeys(FORCES, 0)
    extent = geometry(design).extent
    for seed in seeds:
        twin, table = calibrated(design, world, seed, touches)
        rng = np.random.default_rng([seed, 2])
        for number, size in enumerate(FORCES):
            place = _RIM + rng.uniform(size=(presses, 1, 2)) * (extent - 2 * _RIM)
            bearing = rng.uniform(0, 2 * np.pi, presses)
            drag = rng.uniform(0, _TILT, presses)
            push = np.stack([drag * np.cos(bearing), drag * np.sin(bearing), -np.ones(presses)], 1)
            push *= size / np.linalg.norm(push, axis=1)[:, None]
            session = press(
                twin, Touches(position=place, force=push[:, None]), 25.0, world, (seed, 3, number)
            )
            stream = readings(twin, session, rng)
            estimator = BayesEstimator(design, table, tracking=ON_AN_ARM)
            first = [reading for reading in stream.readings[:_ZEROS] if reading is not None]
            estimator.zero(first, force=True)
            moves = np.zeros(presses, dtype=bool)
            for row, reading, idle in zip(stream.row, stream.readings, stream.idle, strict=True):
                if reading is None:
                    continue
                estimate = estimator.step(reading)
                if row >= 0 and not idle and len(estimate.contacts) == 1:
                    force = float(np.linalg.norm(estimate.contacts[0].force))
                    wide = np.linalg.eigvalsh(estimate.covariance[0, :2, :2])[-1] * 5.991
                    moves[row] |= force >= limits.begin and wide <= limits.ellipse**2
            yielded[size] += int(moves.sum())
            asked[size] += presses
    return {f"{size:.2f}": [yielded[size], asked[size]] for size in FORCES}


def untouched(
    design: SkinDesign, seeds: Sequence[int], count: int, seconds: float
) -> dict[str, float]:
    """Trajectories at the speed limit, nobody touching: how many asked the arm to move."""
    outcomes = [each for seed in seeds for each in carried(design, seed, count, seconds)]
    return {
        "trajectories": len(outcomes),
        "skins": len(seeds),
        "asked_to_move": sum(moves for moves, _, _ in outcomes),
        "stopped": sum(stopped for _, stopped, _ in outcomes),
        "largest_force_N": round(max(force for _, _, force in outcomes), 4),
    }


def carried(
    design: SkinDesign, seed: int, count: int, seconds: float
) -> list[tuple[bool, bool, float]]:
    """What an untouched skin on each of so many trajectories asked of the arm.

    Whether it was to move, whether it was stopped by a fault, and the largest force felt, N. The
    carrying joints turn along sines whose fastest part moves at the limit, in the Earth's field,
    beside a piece of steel and a skin that is pressed, with gravity and acceleration on the skin's
    mass, while all warms.
    """
    twin, table = calibrated(design, PLAIN, seed, 15)
    around = World(name="around", effects=(Steel(), SkinBeside())).run(twin, (seed, 5))
    skin = CarriedSkin(twin, seed=seed, run=around)
    with SimulatedArm(design, lambda: 0.0) as arm:
        chain, start = arm.chain, arm.state().angles
    path = trajectory(chain, start, np.random.default_rng([seed, 4]), count, seconds)
    speeds = np.gradient(path, 1 / _RATE, axis=0)
    follow = Follow(chain, design)
    carriage = Carriage(chain, follow.middle)
    postures = [chain.posture(angles) for angles in path]
    turns = [posture.of_skin(np.eye(3)).T for posture in postures]
    middles = np.array([posture.on_skin(follow.middle) for posture in postures])
    pulls = np.gradient(np.gradient(middles, 1 / _RATE, axis=0), 1 / _RATE, axis=0)
    estimator = ZeroFirst(BayesEstimator(design, table))
    estimator.carried_by(lambda: carriage.pose)
    outcomes = [(False, False, 0.0)] * count
    for k, angles in enumerate(path):
        time = k / _RATE
        carriage.look(time, angles, speeds[k])
        warm = 25.0 + min(_WARMING * time, _WARMER)
        reading = skin.read(time, (), turns[k], acceleration=pulls[k], temperature=warm)
        estimate = estimator.step(reading)
        still = ArmState(angles=angles, speeds=np.zeros(chain.joints))
        command = follow.step(time, Seen(estimate, time), still)
        number, since = divmod(time - _SWING, seconds + _PAUSE)
        if number < 0:
            continue
        if since < 1 / _RATE:
            if follow.state is State.FAULT:
                follow.reset()
            if follow.state is State.DISARMED:
                follow.arm()
        sizes = [float(np.linalg.norm(contact.force)) for contact in estimate.contacts]
        moved, stopped, largest = outcomes[int(number)]
        outcomes[int(number)] = (
            moved or bool(command.speeds.any()),
            stopped or command.state is State.FAULT,
            max([largest, *sizes]),
        )
    print(f"seed {seed}: {[round(force, 3) for _, _, force in outcomes]}", flush=True)
    return outcomes


def trajectory(
    chain: Chain, start: Floats, rng: np.random.Generator, count: int, seconds: float
) -> Floats:
    """Angles at each reading: a swing of each joint, then trajectories at the speed limit.

    Each begins and ends at rest where the arm began, and a pause follows it.
    """
    times = np.arange(0.0, _SWING, 1 / _RATE)
    away = np.zeros((len(times), chain.joints))
    for joint in range(chain.carriers):
        phase = np.clip((times - 1.0 - 2.0 * joint) / 2.0, 0.0, 1.0)
        away[:, joint] = 0.25 * np.sin(2 * np.pi * phase) * np.sin(np.pi * phase)
    parts = [away]
    times = np.arange(0.0, seconds + _PAUSE, 1 / _RATE)
    for _ in range(count):
        away = np.zeros((len(times), chain.joints))
        eased = (_eased(times) * _eased(seconds - times))[:, None]
        for joint in range(chain.carriers):
            size, rate = rng.uniform(0.05, 0.5), rng.uniform(0.3, 1.2)
            away[:, joint] = size * np.sin(rate * times + rng.uniform(0, 2 * np.pi))
        away = np.clip(start + eased * away, chain.lower, chain.upper) - start
        fastest = max(
            float(np.linalg.norm(chain.posture(start + part).corner_motions @ speed, axis=1).max())
            for part, speed in zip(away, np.gradient(away, 1 / _RATE, axis=0), strict=True)
        )
        parts.append(away * min(1.0, law.HARD_LIMIT / fastest))
    return np.asarray(start + np.concatenate(parts))


def _eased(since: Floats) -> Floats:
    """From 0 to 1 in a second without a jerk."""
    share = np.clip(since, 0.0, 1.0)
    return np.asarray(share**2 * (3 - 2 * share))


def draw(counts: dict[str, dict[str, list[int]]]) -> None:
    """The chance to be moved by each force, with 95 % intervals (Wilson), as a figure."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "smoskin"
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5.6, 3.2), layout="constrained")
    for shift, (name, forces) in zip((-0.003, 0.003), counts.items(), strict=True):
        sizes = np.array([float(size) for size in forces]) + shift
        moves, asked = np.array(list(forces.values()), dtype=float).T
        share, weight = moves / asked, 1.96**2 / asked
        middle = (share + weight / 2) / (1 + weight)
        half = np.sqrt(weight * (share * (1 - share) + weight / 4)) / (1 + weight)
        bars = np.abs(np.stack([share - (middle - half), middle + half - share]))
        axes.errorbar(sizes, share, bars, marker="o", capsize=2, label=f"{name} world")
    axes.axvspan(0.45, 0.55, color="0.9", label="dead band")
    axes.set(xlabel="true force (N)", ylabel="share of touches that move the arm")
    axes.legend(frameon=False)
    figure.savefig(FIGURES.with_suffix(".svg"), metadata={"Date": None})


def main() -> None:
    """Measure, and write the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("force", "nobody"))
    parser.add_argument("--design", default="curved")
    parser.add_argument("--seeds", type=int, nargs=2, default=(41, 44), help="first and behind")
    parser.add_argument("--presses", type=int, default=40, help="presses of each force and skin")
    parser.add_argument("--touches", type=int, default=60, help="touches of the rig")
    parser.add_argument("--trajectories", type=int, default=25, help="of each skin")
    parser.add_argument("--seconds", type=float, default=6.0, help="of a trajectory")
    given = parser.parse_args()
    design, seeds = load_design(given.design), range(*given.seeds)
    if given.what == "force":
        measured: dict[str, object] = {
            world.name: moved(design, world, seeds, given.presses, given.touches)
            for world in (PLAIN, HARD)
        }
    else:
        measured = {"nobody": untouched(design, seeds, given.trajectories, given.seconds)}
    known = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}
    known |= measured
    FIGURES.write_text(json.dumps(known) + "\n")
    draw({name: known[name] for name in ("plain", "hard") if name in known})
    print(json.dumps(measured))


if __name__ == "__main__":
    main()
