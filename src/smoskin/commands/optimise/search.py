"""Looks for the design whose signals tell most about a touch, within what can be made and stood.

Decides what is varied and in which order: magnets' corners and the chips' gain on motions that are
at hand; columns, frame and the magnets' shape by a search with constraints, each step of which
presses a sheet, once with every rubber. Gaps are no variables, they follow. The same seed finds the
same design, unless the time runs out.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from smoskin.arrays import Floats
from smoskin.commands.optimise.limits import (
    GAP_STEP,
    Limits,
    alone_over,
    fit_gaps,
    slowest_setting,
)
from smoskin.commands.optimise.objective import (
    Objective,
    Trial,
    design_information,
    try_design,
    worth,
)
from smoskin.commands.optimise.pressed import PressedSheet
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.roles import Progress

_RESERVE: Final = 0.01
"""Share of what must be stood that the search keeps for rounding to the workshop's steps."""
_STEEP: Final = 3.0
"""Weight of limits against the objective's logarithm."""
_TOO_BAD: Final = 10.0
"""Merit, over that of the start, of a design that has no equilibrium."""
_ENOUGH: Final = 0.005
"""Relative gain of a round below which no other follows."""
_DRAWS: Final = 6
"""Random placements from which magnets are moved one by one, besides the one at hand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchEffort:
    """How long a design is searched for.

    Raises
    ------
    ArgumentError
        If a number is not positive.
    """

    steps: int = 40
    """Designs tried in each search with constraints; the first ones, with each rubber, take half as
    many. Fewer than seven do not make one."""
    rounds: int = 2
    """Most rounds of such a search and then of magnets' places."""
    seconds: float = math.inf
    """Time after which the best design so far is taken, s."""
    seed: int = 0
    """Seed of the placements from which magnets are moved."""

    def __post_init__(self) -> None:
        if min(self.steps, self.rounds) < 1 or not self.seconds > 0:
            raise ArgumentError(f"steps, rounds and seconds must be positive; got {self}")


class _OutOfTime(Exception):
    """The search has no time left."""


def find_design(
    design: SkinDesign,
    objective: Objective,
    limits: Limits,
    effort: SearchEffort,
    progress: Progress,
    clock: Callable[[], float],
) -> Trial:
    """The best design found, its numbers rounded to what a workshop sets.

    Parameters
    ----------
    design : SkinDesign
        Start of the search; cells, creases, panels, board and shear layer stay.
    objective : Objective
        Figure to make small.
    limits : Limits
        Limits to keep.
    effort : SearchEffort
        How long is searched.
    progress : Progress
        Listener.
    clock : callable
        Seconds, rising.
    """
    return _Search(design, objective, limits, effort, progress, clock).run()


class _Search:
    """One search; remembers the sheets last pressed and the best design."""

    def __init__(
        self,
        design: SkinDesign,
        objective: Objective,
        limits: Limits,
        effort: SearchEffort,
        progress: Progress,
        clock: Callable[[], float],
    ) -> None:
        self._objective, self._limits, self._effort = objective, limits, effort
        self._progress, self._clock = progress, clock
        self._end = clock() + effort.seconds
        self._total = (effort.rounds + len(limits.rubbers) / 2) * effort.steps
        self._done = 0
        self._sheets: dict[object, PressedSheet] = {}
        self._rng = np.random.default_rng(effort.seed)
        self._best = Trial(design, math.inf, [], [])
        self._start = design

    def run(self) -> Trial:
        """Magnets' places, a search with each rubber, then both in turn."""
        try:
            start = replace(self._start, hall_setting=slowest_setting(self._start, self._limits))
            self._place(fit_gaps(start, self._sheet(start), self._limits), "places of magnets")
            placed = self._best.design
            for rubber in self._limits.rubbers:
                columns = replace(placed.columns, material=rubber)
                self._refine(replace(placed, columns=columns), -(-self._effort.steps // 2))
            before = math.inf
            for _ in range(self._effort.rounds):
                self._refine(self._best.design, self._effort.steps)
                self._place(self._best.design, "places of magnets")
                if self._best.merit > before * (1 - _ENOUGH):
                    break
                before = self._best.merit
        except _OutOfTime:
            pass
        self._progress("rounding", 1.0)
        return self._round()

    def _try(self, design: SkinDesign, what: str) -> Trial:
        """One design with its gaps fitted; the best is remembered."""
        if self._clock() > self._end:
            raise _OutOfTime
        self._progress(what, min(self._done / self._total, 1.0))
        sheet = self._sheet(design)
        if sheet.stands():
            design = fit_gaps(design, sheet, self._limits)
        trial = try_design(design, sheet, self._objective, self._limits)
        if trial.merit < self._best.merit:
            self._best = trial
        return trial

    def _sheet(self, design: SkinDesign) -> PressedSheet:
        """Pressed now or lately."""
        key = (design.columns, design.frame)
        if key not in self._sheets:
            while len(self._sheets) > 1:
                del self._sheets[next(iter(self._sheets))]
            self._sheets[key] = PressedSheet(
                design, force=self._objective.force, places=self._objective.places
            )
        return self._sheets[key]

    def _refine(self, design: SkinDesign, steps: int) -> None:
        """A search with constraints from a design, its rubber and corners kept."""
        begin = self._try(design, "start")
        worst = _TOO_BAD * (begin.value if begin.stood else self._best.value)
        count = len(self._best.own) + len(self._best.stood)
        memory: dict[bytes, tuple[float, Floats]] = {}

        def tried(point: Floats) -> tuple[float, Floats]:
            key = point.tobytes()
            if key not in memory:
                trial = self._try(_varied(design, point, self._limits), "columns, frame, magnets")
                self._done += 1
                slacks = np.full(count, -1.0)
                if trial.stood:
                    slacks = np.array(
                        [limit.slack for limit in trial.own]
                        + [limit.slack - _RESERVE for limit in trial.stood]
                    )
                memory[key] = (min(trial.value, worst), np.clip(slacks, -1.0, 0.1))
            return memory[key]

        def goal(point: Floats) -> float:
            return math.log(tried(point)[0] / worst)

        def room(point: Floats) -> Floats:
            return np.asarray(_STEEP * tried(point)[1])

        start: Floats = _point(design, self._limits)
        minimize(
            goal,
            start,
            method="COBYLA",
            bounds=Bounds(np.zeros(len(start)), np.ones(len(start))),
            constraints=NonlinearConstraint(room, 0.0, np.inf),
            tol=2e-3,
            options={"rhobeg": 0.12, "maxiter": max(steps, len(start) + 2)},
        )

    def _place(self, design: SkinDesign, what: str) -> None:
        """The best corners and gain on this design's sheet."""
        sheet = self._sheet(design)
        for gain in range(8):
            setting = replace(design.hall_setting, gain_selection=gain)
            self._try(replace(design, hall_setting=setting), what)
        design = self._best.design
        sheet = self._sheet(design)
        placed = exchange(design, sheet, self._objective, self._limits, self._rng)
        self._try(placed, what)

    def _round(self) -> Trial:
        """The best design in the workshop's steps: of the roundings up and down, the best."""
        best, columns = self._best.design, self._best.design.columns
        shaped = tuple(
            replace(m, radius=_nearest(m.radius, 1e-4), height=_nearest(m.height, 1e-4))
            for m in best.magnets
        )
        digits = 1 - math.floor(math.log10(best.frame.stiffness))
        frame = replace(best.frame, stiffness=round(best.frame.stiffness, digits))
        trials = []
        for radius, height in product(
            _beside(columns.radius, 0.05e-3), _beside(columns.height, 0.1e-3)
        ):
            rounded = replace(columns, radius=radius, height=height)
            design = replace(best, columns=rounded, frame=frame, magnets=shaped)
            sheet = self._sheet(design)
            if sheet.stands():
                design = fit_gaps(design, sheet, self._limits, step=GAP_STEP)
            trials.append(try_design(design, sheet, self._objective, self._limits))
        return min(trials, key=lambda trial: trial.merit)


def exchange(
    design: SkinDesign,
    sheet: PressedSheet,
    objective: Objective,
    limits: Limits,
    rng: np.random.Generator,
) -> SkinDesign:
    """Magnets moved one by one to the corner that tells most, from several placements.

    Each chip is taken to see its own magnet alone, so that what chips tell adds up.
    """
    cell, reach = geometry(design).cell, limits.wall + max(m.radius for m in design.magnets)
    within = [math.ceil(reach / float(length)) for length in (cell.length, cell.width)]
    corners = [
        (p, q)
        for p in range(within[0], design.cells[0] - within[0] + 1)
        for q in range(within[1], design.cells[1] - within[1] + 1)
    ]
    sites = design.halls
    if len(corners) <= len(sites):
        return design
    informed = np.stack(
        [
            [
                design_information(alone_over(design, site, corner), sheet, objective.unmodelled)
                for corner in corners
            ]
            for site in sites
        ]
    )
    placed = {magnet.name: magnet.corner for magnet in design.magnets}
    free = list(range(len(corners)))
    present = [placed[site.magnet] for site in sites]
    starts = [list(map(int, rng.permutation(free)[: len(sites)])) for _ in range(_DRAWS)]
    if set(present) <= set(corners) and len(set(present)) == len(present):
        starts.insert(0, [corners.index(corner) for corner in present])
    best: tuple[float, list[int]] = (math.inf, [])
    for start in starts:
        best = min(best, _settle(start, informed, sheet, objective))
    moved = {site.magnet: corners[at] for site, at in zip(sites, best[1], strict=True)}
    magnets = tuple(replace(m, corner=moved.get(m.name, m.corner)) for m in design.magnets)
    return replace(design, magnets=magnets)


def _settle(
    start: Sequence[int], informed: Floats, sheet: PressedSheet, objective: Objective
) -> tuple[float, list[int]]:
    """The placement that single moves lead to from another, and its objective."""
    at, chips = list(start), len(start)

    def value(places: Sequence[int]) -> float:
        together = sum(informed[k, place] for k, place in enumerate(places))
        return worth(np.asarray(together), sheet, chips, objective)

    best, moving = value(at), True
    while moving:
        moving = False
        for k in range(chips):
            options = [p for p in range(informed.shape[1]) if p not in at]
            values = [value([*at[:k], p, *at[k + 1 :]]) for p in options]
            least = int(np.argmin(values))
            if values[least] < best * (1 - 1e-9):
                best, at[k], moving = values[least], options[least], True
    return best, at


def _beside(value: float, step: float) -> list[float]:
    """The steps next to a value, or the one that it stands on."""
    return sorted({_nearest(value + side * 0.4999 * step, step) for side in (-1, 1)})


def _nearest(value: float, step: float) -> float:
    """Rounded to a step, without the trail of binary digits."""
    return round(round(value / step) * step, 9)


def _ranges(limits: Limits) -> list[tuple[float, float]]:
    """Ranges of the continuous variables."""
    return [
        limits.column_radius,
        limits.column_height,
        limits.frame_stiffness,
        limits.magnet_radius,
        limits.magnet_height,
    ]


def _varied(design: SkinDesign, point: Floats, limits: Limits) -> SkinDesign:
    """The design at a point of the unit cube, on whose axes run the variables' logarithms."""
    radius, height, frame, wide, high = (
        float(least * (most / least) ** min(max(part, 0.0), 1.0))
        for part, (least, most) in zip(point.tolist(), _ranges(limits), strict=True)
    )
    return replace(
        design,
        columns=replace(design.columns, radius=radius, height=height),
        frame=replace(design.frame, stiffness=frame),
        magnets=tuple(replace(magnet, radius=wide, height=high) for magnet in design.magnets),
    )


def _point(design: SkinDesign, limits: Limits) -> Floats:
    """Place of a design in that cube, or next to it."""
    magnet = design.magnets[-1]
    values = (
        design.columns.radius,
        design.columns.height,
        design.frame.stiffness,
        magnet.radius,
        magnet.height,
    )
    parts = [
        math.log(max(value, least) / least) / math.log(most / least)
        for value, (least, most) in zip(values, _ranges(limits), strict=True)
    ]
    return np.clip(parts, 0.0, 1.0)
