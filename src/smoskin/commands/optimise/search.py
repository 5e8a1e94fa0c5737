"""Looks for the design whose signals tell most about a touch, within what can be made and stood.

Decides what is varied and in which order: magnets' corners and the chips' gain on motions that are
at hand; columns, frame and the magnets' shape by a search with constraints, each step of which
presses a sheet, once with every rubber. Gaps are no variables, they follow. Decides too which bound
of location counts: with drags unknown and known to be none, over the mean and the worst place.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import product
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from smoskin.arrays import Floats
from smoskin.commands.optimise.limits import (
    GAP_STEP,
    Limits,
    Reached,
    alone_over,
    fit_gaps,
    own_limits,
    slowest_setting,
    stood_limits,
)
from smoskin.commands.optimise.pressed import Places, PressedSheet, design_information
from smoskin.design.skin import Columns, Frame, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.roles import Progress
from smoskin.sensing.response.bound import bound_of_information, figures

_RESERVE: Final = 0.01
"""Share of what must be stood that the search keeps for rounding to the workshop's steps."""
_STEEP: Final = 3.0
"""Weight of limits against the objective's logarithm."""
_TOO_BAD: Final = 10.0
"""Merit, over that of the start, of a design that has no equilibrium."""
_ENOUGH: Final = 0.005
"""Relative gain of a round below which no other follows."""
_EXCHANGING: Final = 3.0
"""Presses that take as long as moving magnets one by one does."""
_ROUNDING: Final = 4.0
"""Presses that rounding takes."""
_LAST: Final = 9
"""Presses by whose time the next ones are reckoned."""
_DRAWS: Final = 6
"""Random placements from which magnets are moved one by one, besides the one at hand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """The bound of location that is made small, drags unknown and drags known to be none.

    Over a map of bounds b, the mean of b plus a weight times its 99 % quantile, averaged over both.
    Numbers out of their range raise an `ArgumentError`.
    """

    force: float = 0.5
    """Normal force of the touch, N."""
    worst_weight: float = 0.25
    """Weight of the worst place (99 %) against the mean over the skin."""
    unmodelled: float = 0.005
    """Share of each signal that counts as noise besides the chips' own, of a chip 5.5 mm from its
    magnet; it grows with the inverse square of the gap, as what a calibration cannot follow of
    magnets that sit askew. The value is the reference design's: there it raises the bound as
    much as does what 60 touches leave open of a made skin."""
    places: Places = (5, 7)
    """Places of the touches, from rim to rim."""

    def __post_init__(self) -> None:
        if not (self.force > 0 and self.worst_weight >= 0 and self.unmodelled >= 0):
            raise ArgumentError(
                "force must be positive, worst_weight and unmodelled >= 0; got "
                f"{self.force}, {self.worst_weight} and {self.unmodelled}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchEffort:
    """How long a design is searched for; numbers that are not positive raise an `ArgumentError`."""

    steps: int = 40
    """Designs tried in each search with constraints; the first ones, with each rubber, take half as
    many. Fewer than seven do not make one."""
    rounds: int = 2
    """Most rounds of such a search and then of magnets' places."""
    seconds: float = math.inf
    """Time for all, s: the best design is taken when what follows the search needs the rest."""
    seed: int = 0
    """Seed of the placements from which magnets are moved."""

    def __post_init__(self) -> None:
        if min(self.steps, self.rounds) < 1 or not self.seconds > 0:
            raise ArgumentError(f"steps, rounds and seconds must be positive; got {self}")


class Trial(NamedTuple):
    """One design, tried."""

    design: SkinDesign
    value: float
    """Objective, m."""
    own: list[Reached]
    """Limits on its own numbers."""
    stood: list[Reached]
    """Limits under the rated touches; empty where the skin has no equilibrium."""

    @property
    def merit(self) -> float:
        """The objective, the larger the more limits are broken."""
        if not self.stood:
            return math.inf
        broken = sum(max(-limit.slack, 0.0) for limit in (*self.own, *self.stood))
        return self.value * (1 + 20 * broken)


def try_design(
    design: SkinDesign, sheet: PressedSheet, objective: Objective, limits: Limits
) -> Trial:
    """A design on its pressed sheet, against objective and limits."""
    own = own_limits(design, limits)
    if not sheet.stands():
        return Trial(design, math.inf, own, [])
    fisher = design_information(design, sheet, objective.unmodelled)
    value = worth(fisher, sheet, len(design.halls), objective)
    return Trial(design, value, own, stood_limits(design, sheet, limits))


def worth(fisher: Floats, sheet: PressedSheet, chips: int, objective: Objective) -> float:
    """The objective of this information, m."""
    both = [
        figures(bound_of_information(sheet.x, sheet.y, fisher, chips, drags=drags).location)
        for drags in (True, False)
    ]
    return sum(part.mean + objective.worst_weight * part.worst for part in both) / len(both)


class _OutOfTime(Exception):
    """The search has no time left."""


class Search:
    """One search from a design; remembers the sheets last pressed and the best design.

    Cells, creases, panels, board and shear layer stay as they are. The same seed finds the same
    design, unless the time runs out by the clock, which tells the seconds since the work began.
    """

    rest: float = 0.0
    """Seconds that are left for what follows the search."""

    def __init__(
        self,
        start: SkinDesign,
        objective: Objective,
        limits: Limits,
        effort: SearchEffort,
        progress: Progress,
        clock: Callable[[], float],
    ) -> None:
        self._objective, self._limits, self._effort = objective, limits, effort
        self._progress, self._clock = progress, clock
        self._took: list[float] = []
        """Time of each press, s; the first one compiles."""
        self._total = (effort.rounds + len(limits.rubbers) / 2) * effort.steps
        self._done = 0
        self._pressed = lru_cache(maxsize=2)(self._press)
        self._rng = np.random.default_rng(effort.seed)
        self._start, self._best = start, Trial(start, math.inf, [], [])

    def run(self) -> Trial:
        """The best design, its numbers rounded to what a workshop sets.

        Magnets are placed, then a search is made with each rubber, then both in turn.
        """
        try:
            setting = slowest_setting(self._start, self._limits)
            start = replace(self._start, hall_setting=setting)
            self._place(fit_gaps(start, self._sheet(start), self._limits))
            placed = self._best.design
            for rubber in self._limits.rubbers:
                columns = replace(placed.columns, material=rubber)
                self._refine(replace(placed, columns=columns), -(-self._effort.steps // 2))
            before = math.inf
            for _ in range(self._effort.rounds):
                self._refine(self._best.design, self._effort.steps)
                self._place(self._best.design)
                if self._best.merit > before * (1 - _ENOUGH):
                    break
                before = self._best.merit
        except _OutOfTime:
            pass
        self._progress("rounding", 1.0)
        return self._round()

    @property
    def left(self) -> float:
        """Seconds of its time that are left."""
        return self._effort.seconds - self._clock()

    @property
    def pressing(self) -> float:
        """Median time of the last presses, s, but of the first, which compiles."""
        return float(np.median(self._took[1:][-_LAST:])) if len(self._took) > 1 else 0.0

    def measure(self) -> None:
        """Press the start twice, so that the time of a press is known."""
        self._sheet(self._start)
        self._press(self._start.columns, self._start.frame)

    def has_time(self, presses: float = 1.0) -> bool:
        """Whether there is time for so many presses and for what follows them."""
        return self.left >= self.rest + (presses + _ROUNDING) * self.pressing

    def _try(self, design: SkinDesign, what: str) -> Trial:
        """One design with its gaps fitted; the best is remembered."""
        if not self.has_time():
            raise _OutOfTime
        self._progress(what, min(self._done / self._total, 1.0))
        trial = self._fitted(design)
        if trial.merit < self._best.merit:
            self._best = trial
        return trial

    def _fitted(self, design: SkinDesign, *, step: float = 0.0) -> Trial:
        """One design with gaps that fit it, in multiples of a step."""
        sheet = self._sheet(design)
        if sheet.stands():
            design = fit_gaps(design, sheet, self._limits, step=step)
        return try_design(design, sheet, self._objective, self._limits)

    def _sheet(self, design: SkinDesign) -> PressedSheet:
        """The design's sheet, pressed now or lately."""
        return self._pressed(design.columns, design.frame)

    def _press(self, columns: Columns, frame: Frame) -> PressedSheet:
        """The start's sheet on these columns and in this frame."""
        design = replace(self._start, columns=columns, frame=frame)
        begun = self._clock()
        sheet = PressedSheet(design, force=self._objective.force, places=self._objective.places)
        self._took.append(self._clock() - begun)
        return sheet

    def _refine(self, design: SkinDesign, steps: int) -> None:
        """A search with constraints from a design, its rubber and corners kept."""
        begin = self._try(design, "start")
        worst = _TOO_BAD * (begin.value if begin.stood else self._best.value)
        count = len(self._best.own) + len(self._best.stood)

        @cache
        def tried(*point: float) -> tuple[float, Floats]:
            varied = _varied(design, np.array(point), self._limits)
            trial = self._try(varied, "columns, frame, magnets")
            self._done += 1
            slacks = np.full(count, -1.0)
            if trial.stood:
                slacks[:] = [limit.slack for limit in (*trial.own, *trial.stood)]
                slacks[len(trial.own) :] -= _RESERVE
            return min(trial.value, worst), np.clip(slacks, -1.0, 0.1)

        def goal(point: Floats) -> float:
            return math.log(tried(*point)[0] / worst)

        def room(point: Floats) -> Floats:
            return np.asarray(_STEEP * tried(*point)[1])

        start = _point(design, self._limits)
        minimize(
            goal,
            start,
            method="COBYLA",
            bounds=Bounds(np.zeros(len(start)), np.ones(len(start))),
            constraints=NonlinearConstraint(room, 0.0, np.inf),
            tol=2e-3,
            options={"rhobeg": 0.12, "maxiter": max(steps, len(start) + 2)},
        )

    def _place(self, design: SkinDesign) -> None:
        """The best corners and gain on this design's sheet."""
        for gain in range(8):
            setting = replace(design.hall_setting, gain_selection=gain)
            self._try(replace(design, hall_setting=setting), "places of magnets")
        best = self._best.design
        if not self.has_time(_EXCHANGING):
            raise _OutOfTime
        placed = exchange(best, self._sheet(best), self._objective, self._limits, self._rng)
        self._try(placed, "places of magnets")

    def _round(self) -> Trial:
        """The best design in the workshop's steps: of the roundings up and down, the best."""
        best, columns = self._best.design, self._best.design.columns
        magnets = tuple(
            replace(m, radius=_nearest(m.radius, 1e-4), height=_nearest(m.height, 1e-4))
            for m in best.magnets
        )
        clearance = _nearest(best.frame.clearance, 0.05e-3)
        sizes = product(_beside(columns.radius, 0.05e-3), _beside(columns.height, 0.1e-3))
        trials = []
        for radius, height in sizes:
            rounded = replace(columns, radius=radius, height=height)
            held = _nearest(height / 2, 0.1e-3)
            frame = replace(best.frame, clearance=clearance, held_height=held)
            design = replace(best, columns=rounded, frame=frame, magnets=magnets)
            trials.append(self._fitted(design, step=GAP_STEP))
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
    first = [math.ceil(reach / float(length)) for length in (cell.length, cell.width)]
    across, along = (range(p, n - p + 1) for p, n in zip(first, design.cells, strict=True))
    corners = list(product(across, along))
    sites = design.halls
    if len(corners) <= len(sites):
        return design
    fishers = np.array(
        [
            [
                design_information(alone_over(design, site, corner), sheet, objective.unmodelled)
                for corner in corners
            ]
            for site in sites
        ]
    )

    def value(places: Sequence[int]) -> float:
        whole = sum(fishers[k, place] for k, place in enumerate(places))
        return worth(np.asarray(whole), sheet, len(sites), objective)

    starts = [rng.permutation(len(corners))[: len(sites)].tolist() for _ in range(_DRAWS)]
    present = [design.magnet(site.magnet).corner for site in sites]
    if set(present) <= set(corners) and len(set(present)) == len(present):
        starts.insert(0, [corners.index(corner) for corner in present])
    best = min(_settle(start, len(corners), value) for start in starts)[1]
    moved = {site.magnet: corners[place] for site, place in zip(sites, best, strict=True)}
    magnets = tuple(replace(m, corner=moved.get(m.name, m.corner)) for m in design.magnets)
    return replace(design, magnets=magnets)


def _settle(
    places: list[int], count: int, value: Callable[[Sequence[int]], float]
) -> tuple[float, list[int]]:
    """The placement on so many corners that single moves lead to, after its objective."""
    best, moving = value(places), True
    while moving:
        moving = False
        for k in range(len(places)):
            free = [place for place in range(count) if place not in places]
            values = [value([*places[:k], place, *places[k + 1 :]]) for place in free]
            least = int(np.argmin(values))
            if values[least] < best * (1 - 1e-9):
                best, places[k], moving = values[least], free[least], True
    return best, places


def _beside(value: float, step: float) -> list[float]:
    """The steps next to a value, or the one that it stands on."""
    return sorted({_nearest(value + side * 0.4999 * step, step) for side in (-1, 1)})


def _nearest(value: float, step: float) -> float:
    """Rounded to a step, without the trail of binary digits."""
    return round(round(value / step) * step, 9)


def _ranges(limits: Limits) -> Floats:
    """Ends of the variables, (5, 2), m: columns, frame and magnets."""
    return np.array(
        [
            limits.column_radius,
            limits.column_height,
            limits.frame_clearance,
            limits.magnet_radius,
            limits.magnet_height,
        ]
    )


def _varied(design: SkinDesign, point: Floats, limits: Limits) -> SkinDesign:
    """The design at a point of the unit cube, on whose axes run the variables' logarithms."""
    least, most = _ranges(limits).T
    values = least * (most / least) ** np.clip(point, 0.0, 1.0)
    radius, height, clearance, wide, high = values.tolist()
    return replace(
        design,
        columns=replace(design.columns, radius=radius, height=height),
        frame=replace(design.frame, clearance=clearance, held_height=height / 2),
        magnets=tuple(replace(magnet, radius=wide, height=high) for magnet in design.magnets),
    )


def _point(design: SkinDesign, limits: Limits) -> Floats:
    """Place of a design in that cube, or next to it."""
    columns, magnet = design.columns, design.magnets[-1]
    values = columns.radius, columns.height, design.frame.clearance, magnet.radius, magnet.height
    least, most = _ranges(limits).T
    return np.asarray(np.clip(np.log(values / least) / np.log(most / least), 0.0, 1.0))
