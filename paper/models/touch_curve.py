"""How good estimates become with each touch that calibrates a skin: planned touches, and random.

Made skins that no table was fitted on are calibrated by the first few touches of a rig and judged
in sessions of touches (`smoskin.commands.score.evaluate`). Decides what random touches are and
that every touch counts: one that is not told as one is as far off as the middle of the skin.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.score.errors import Answers, together
from smoskin.commands.score.evaluate import Session, grid_sessions, judge, label
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.response.bound import bound_map
from smoskin.sensing.response.calibrate import (
    LabelledTouches,
    Target,
    TouchPlanner,
    calibrate_touches,
)
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.whole import Twin

_ROOM: Final = 22.0
"""degC, in which skins are calibrated."""
_MEAN_OVER_RMS: Final = float(np.sqrt(np.pi) / 2)
"""Mean over root mean square of the distance of a round normal error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveEffort:
    """How much is judged.

    Raises
    ------
    ArgumentError
        If there is nothing to judge, or counts do not rise from 1 or more.
    """

    seeds: tuple[int, ...] = (1, 2)
    """Seeds of the made skins; tables are made of others."""
    counts: tuple[int, ...] = (3, 8, 15, 30, 60)
    """Touches after which estimates are judged."""
    forces: tuple[float, ...] = (0.3, 0.7)
    """N, normal, of the touches that are judged."""
    places: int = 30
    """Touches of each force, drawn from 25 x 33 from rim to rim."""

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in zip((0, *self.counts), self.counts, strict=False))
        if not (self.seeds and self.counts and self.forces and self.places > 0 and rising):
            raise ArgumentError(
                f"seeds, counts, forces and places must be there and counts rise from 1; got "
                f"{self.seeds}, {self.counts}, {self.forces} and {self.places}"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchCurve:
    """Errors of L skins after each of N counts of touches."""

    counts: tuple[int, ...]
    chips: tuple[int, ...]
    """Chips whose signals are used."""
    planned: Floats
    """(L, N), m: mean distance of the estimates from the true places, after planned touches."""
    random: Floats
    """(L, N), m: after random touches."""
    planned_force: Floats
    """(L, N): mean error of the normal force, relative."""
    random_force: Floats
    """(L, N): likewise."""
    inside: Floats
    """(L, N): share of the truths in the stated 90 % regions, after planned touches."""
    expected: Floats
    """(N,), m: what the planner expects of planned touches, as a mean distance."""
    bound: float
    """m: by the chips' noise alone, as a mean distance; for the forces that are judged."""

    def rows(self) -> list[dict[str, float]]:
        """Means over the skins, a row for each count; millimetres and per cent."""
        return [
            {
                "touches": count,
                "planned_mm": 1e3 * float(self.planned[:, k].mean()),
                "planned_worst_skin_mm": 1e3 * float(self.planned[:, k].max()),
                "random_mm": 1e3 * float(self.random[:, k].mean()),
                "random_worst_skin_mm": 1e3 * float(self.random[:, k].max()),
                "expected_mm": 1e3 * float(self.expected[k]),
                "planned_force_percent": 100 * float(self.planned_force[:, k].mean()),
                "random_force_percent": 100 * float(self.random_force[:, k].mean()),
                "inside_percent": 100 * float(self.inside[:, k].mean()),
            }
            for k, count in enumerate(self.counts)
        ]


def touch_curve(
    design: SkinDesign,
    table: ResponseTable,
    effort: CurveEffort | None = None,
    *,
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> TouchCurve:
    """Calibrate made skins by more and more touches, and judge each time.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Of the design; of some of its chips, where only those shall be used.
    effort : CurveEffort, optional
    progress : callable, optional

    Raises
    ------
    MissingExtraError
        Without the extra ``twin``.
    """
    asked = effort or CurveEffort()
    noise = signal_noise(design, table.chips)
    plan = TouchPlanner(table, noise).plan(asked.counts[-1])
    skins = []
    for number, seed in enumerate(asked.seeds):
        progress(f"skin {number + 1} of {len(asked.seeds)}", number / len(asked.seeds))
        rng = np.random.default_rng([seed, 1])
        twin = Twin(design, seed=seed, manufactured=True)
        sessions = list(grid_sessions(twin, rng, forces=asked.forces, count=asked.places))
        kinds = []
        for targets in (plan, _random_targets(plan, table, rng)):
            made = label(twin, targets, rng, temperature=_ROOM, chips=table.chips)
            kinds.append(
                [
                    _figures(_judged(twin, _calibrated(table, made, n, noise), sessions, seed))
                    for n in asked.counts
                ]
            )
        skins.append(kinds)
    result = np.array(skins)
    bounds = [
        bound_map(table, noise, force=force, drags=False, places=(13, 17)).location.mean()
        for force in asked.forces
    ]
    return TouchCurve(
        counts=asked.counts,
        chips=table.chips,
        planned=result[:, 0, :, 0],
        random=result[:, 1, :, 0],
        planned_force=result[:, 0, :, 1],
        random_force=result[:, 1, :, 1],
        inside=result[:, 0, :, 2],
        expected=_MEAN_OVER_RMS * np.array([plan[n - 1].error for n in asked.counts]),
        bound=_MEAN_OVER_RMS * float(np.mean(bounds)),
    )


def _random_targets(
    plan: Sequence[Target], table: ResponseTable, rng: np.random.Generator
) -> list[Target]:
    """As many touches anywhere, half of them straight, with forces as large as the plan's."""
    most = max(-item.force[2] for item in plan)
    drag = max(float(np.hypot(*item.force[:2])) for item in plan)
    targets = []
    for number in range(len(plan)):
        angle, dragged = rng.uniform(0, 2 * np.pi), number % 2
        side = dragged * drag * np.array([np.cos(angle), np.sin(angle)])
        push = np.array([*side, -rng.uniform(0.4, 1.0) * most])
        targets.append(Target(rng.uniform(0, table.basis.extent), push, np.nan))
    return targets


def _calibrated(
    table: ResponseTable, made: LabelledTouches, count: int, noise: Floats
) -> ResponseTable:
    """The table after the first so many touches that could be used."""
    first = LabelledTouches(
        position=made.position[:count],
        force=made.force[:count],
        signals=made.signals[:count],
        temperature=made.temperature[:count],
        place_spread=made.place_spread,
        force_spread=made.force_spread,
    )
    return calibrate_touches(table, first, noise)


def _judged(twin: Twin, table: ResponseTable, sessions: Sequence[Session], seed: int) -> Answers:
    """What the Bayesian estimator says of all sessions, with the same noise for each table."""
    estimator = BayesEstimator(
        twin.design,
        table,
        priors=TouchPriors(drag_spread=0.0),
    )
    rng = np.random.default_rng([seed, 2])
    return together([judge(estimator, twin, session, rng) for session in sessions])


def _figures(answers: Answers) -> tuple[float, float, float]:
    """Mean distance, mean relative error of force, and share inside the stated 90 % regions."""
    force = answers.force_error[:, 2] / np.abs(answers.truth[:, 4])
    inside = answers.confidence((0, 1)) <= 0.9
    return float(answers.distance.mean()), float(force.mean()), float(inside.mean())
