"""A folded sheet for a surface, from start to judgement.

Decides what is tried: a sheet that folds flat where the surface is bent one way, as cylinders and
cones are, and else one that only unfolds; on a saddle also turned, as its straight lines run; with
thinner plates where creases leave no room for others; and what advice a failure gives.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError, SmoskinError
from smoskin.origami.cell import size
from smoskin.origami.sheet import Sheet, build_sheet
from smoskin.origami.surface.surface import Surface, forms
from smoskin.origami.tessellation.arc import arc_sheet
from smoskin.origami.tessellation.attachment import attach, attached_sheet
from smoskin.origami.tessellation.conditions import net_of
from smoskin.origami.tessellation.hinges import Folding, fold, fold_angles, frame_of, rigid_modes
from smoskin.origami.tessellation.solve import (
    Listener,
    Problem,
    Solution,
    places,
    settle,
    settle_further,
)
from smoskin.origami.tessellation.survey import TooBentError, fold_range, largest_share, survey
from smoskin.origami.tessellation.trials import TRIALS, Order, Trial
from smoskin.origami.tessellation.unfold import unfold
from smoskin.origami.tessellation.validity import (
    GAP,
    Candidate,
    Gate,
    Nominal,
    gates,
    reason,
    thinned,
)

_PULL: Final = 3e3
"""Weight of bottom vertices' heights where all columns are equal."""
_SHARPEST: Final = np.radians(110)
"""Fold angle that is free however thin the plates are."""
_SMALLER: Final = (0.8, 0.6, 0.4)
"""Sizes that are tried, over the one asked for, where this does not fit."""
_FEWER: Final = (2, 3, 4)
"""What numbers of cells are divided by where as many cannot lie on the patch."""
_CLOSE: Final = 1.0
"""Sum of what measures are off their limits, over these, up to which a search goes on."""
_ROUNDS: Final = 5
"""How often it does."""
FREE: Final = 1e-6
"""Lowest singular value below which a sheet folds by its creases alone."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tessellation:
    """A folded sheet on a surface, and what it is worth."""

    sheet: Sheet
    """Vertices in the surface's frame, panels, creases, loaded vertices and columns."""
    normals: Floats
    """(2N + 1, M + 1, 3): the surface's normal at each column, along which it stands."""
    pattern: Floats
    """(V, 2), m: the flat crease pattern."""
    angles: Floats
    """(C,), rad: fold angle of each crease, positive at valleys."""
    surface: Surface
    """The surface in the chart along whose first parameter the sheet's x runs."""
    turn: float
    """rad: from the first parameter of the surface that was given to that of this chart."""
    plate: float
    """m: thickness of the panels on one face of the film."""
    layers: Floats
    """(V, 3), m: parameters of this chart and height over the surface of every vertex."""
    flat_foldable: bool
    """Whether opposite sector angles sum to pi."""
    gates: tuple[Gate, ...]
    """Measures and limits."""
    rigidity: tuple[float, float]
    """Two lowest singular values of the panels' edges, diagonals and planes; a sheet folds by its
    creases alone where the first is zero, and stiffly where it comes near the second."""
    folding: Folding | None
    """The way from flat to folded, by lengths and fold angles alone; None where it was not asked
    for or the sheet could not be judged."""
    advice: str
    """What would fit where a gate does not hold; empty otherwise."""

    @property
    def holds(self) -> bool:
        """Whether every gate holds."""
        return all(gate.holds for gate in self.gates)

    def with_plate(self, plate: float) -> "Tessellation":
        """The same sheet with plates of another thickness, m, which only its gaps tell."""
        return replace(self, plate=plate, gates=thinned(self.gates, plate / self.plate))

    @property
    def lifts(self) -> Floats:
        """Height of each bottom vertex over the surface, (2N + 1, M + 1), m; its column's more."""
        return np.asarray(self.layers[self.sheet.columns, 2])

    @property
    def folds(self) -> bool:
        """Whether creases alone let the sheet fold."""
        return self.rigidity[0] < FREE


@typed
def tessellate(
    surface: Surface,
    cell: MiuraCell,
    cells: tuple[int, int],
    *,
    plate: float = 0.5e-3,
    thinner: Sequence[float] = (),
    column: float = 10e-3,
    own_columns: bool = False,
    time_limit: float = 60.0,
    refold: bool = True,
    progress: Listener | None = None,
) -> Tessellation:
    """The sheet of ``cells = (N, M)`` cells round the middle of a surface, judged.

    Rows of cells run along the surface's first parameter; a cylinder's or cone's axis must lie so
    for the sheet to fold. Where no sheet lies so on a saddle, one is sought along a line in which
    it is straight.

    Parameters
    ----------
    cell : MiuraCell
        The planar cell, whose extent is kept as well as the surface lets it be.
    plate, column : float
        Thickness of the panels on one face of the film, and the columns' height, m.
    thinner : sequence of float
        Plates that may be taken, thickest first, where creases leave no room for `plate`, m.
    own_columns : bool
        Whether every column may have its own height, within 10 %: then a sheet that folds is
        sought on any surface, and no other.
    time_limit : float
        s; the sheet that was reached by then is judged.
    refold : bool
        Whether the flat pattern is folded again.

    Raises
    ------
    ArgumentError
        If there is no cell, the surface ends under the sheet, or it is bent along the sheet's x
        alone, where a sheet does not fold.
    TooBentError
        If the surface is bent more tightly than a cell can follow, or so much over the whole sheet
        that its depth does not leave the folds for it.
    """
    if min(cells) < 1:
        raise ArgumentError(f"cells must be at least (1, 1); got {cells}")
    if not time_limit > 0.0:
        raise ArgumentError(f"time_limit must be > 0 s; got {time_limit}")
    plates = (plate, *thinner)
    if (np.diff(plates) >= 0).any():
        raise ArgumentError(f"thinner must fall from below plate, {plate} m; got {tuple(thinner)}")
    order = Order(
        surface=surface,
        cell=cell,
        cells=cells,
        plates=plates,
        column=column,
        own_columns=own_columns,
        deadline=time.monotonic() + time_limit,
        progress=progress,
    )
    survey(surface, cell, cells)
    if not own_columns:
        _refuse_beyond(order)
    return _reported(order, _sought(order), refold=refold)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Judged:
    """A sheet with its gates and its flat pattern."""

    order: Order
    candidate: Candidate
    measures: tuple[Gate, ...]
    pattern: Floats
    solution: Solution
    regular: Sheet
    """The planar sheet of the same cells."""
    problem: Problem
    start: Floats
    """(V, 3), m: layers towards which it is fair."""

    @property
    def failed(self) -> list[Gate]:
        """Gates that do not hold."""
        return [gate for gate in self.measures if not gate.holds]

    @property
    def excess(self) -> float:
        """Sum of what measures are off their limits, over these, each at most 1."""
        return sum(
            min(abs(gate.value / gate.limit - 1), 1.0) if gate.limit else 1.0
            for gate in self.failed
        )


def _sought(order: Order) -> _Judged:
    """The first sheet of all ways that passes all gates, or what the way that is asked came to."""
    asked = _thickest(order.plates, _best(order))
    if asked.failed and (turned := _turned(order)) is not None and not turned.failed:
        return turned
    asked = _thickest(order.plates, _better(order, asked))
    if asked.failed and len(order.plates) > 1:
        thin = order.thinnest
        if not (thinner := _thickest(order.plates, _better(thin, _best(thin)))).failed:
            return thinner
    return asked


def _turned(order: Order) -> _Judged | None:
    """The sheet with the thinnest plates along a saddle's straight line, if it reaches so far."""
    turned = order.thinnest.turned
    _, one_way = survey(order.surface, order.cell, order.cells)
    if one_way or not turned.turn:
        return None
    try:
        return _thickest(order.plates, _best(turned, TRIALS[::-1]))
    except SmoskinError:
        return None


def _thickest(plates: tuple[float, ...], judged: _Judged) -> _Judged:
    """A sheet with the thickest plates with which it passes all gates, as it is if none does."""
    for plate in plates:
        measures = thinned(judged.measures, plate / judged.order.plate)
        if all(gate.holds for gate in measures):
            order = replace(judged.order, plates=(plate,))
            return replace(judged, order=order, measures=measures)
    return judged


def _best(order: Order, trials: tuple[Trial, ...] = TRIALS) -> _Judged:
    """The first sheet that passes all gates, or the one that is least off, of those tried."""
    radius, one_way = survey(order.surface, order.cell, order.cells)
    foldable = order.own_columns or one_way
    attempts = [(trial, foldable) for trial in (trials[:1] if one_way else trials)]
    if foldable and not order.own_columns:
        attempts.append((trials[0], False))
    tried: list[_Judged] = []
    for trial, folds in attempts:
        start = _start(order, radius, trial, one_way=one_way)
        if order.surface.holds(start[:, :2]).all():
            tried.append(_judge(order, start, trial, foldable=folds))
            if not tried[-1].failed or time.monotonic() > order.deadline:
                break
    if not tried:
        raise ArgumentError("the surface must reach under the whole sheet; take fewer cells")
    return min(tried, key=lambda judged: judged.excess)


def _refuse_beyond(order: Order) -> None:
    """Raise where equal cells' folds cannot take up the patch's curvature, with what would fit."""
    if (asked := fold_range(order.surface, order.cell, order.cells)).holds:
        return
    rim, middle = np.degrees([asked.rim, asked.middle])
    left = np.degrees(asked.left[int(middle > rim)])
    share = largest_share(order.surface, order.cell, order.cells)
    raise TooBentError(
        f"the surface is bent too much for so many cells: folds of {rim:.1f} deg at the rim ask "
        f"{middle:.1f} deg inside, the depth {left:.1f}; at most {share:.2f} of the sheet could "
        f"lie on it; {_what_fewer_fit(order)}",
        "fold_angle_inside",
        (float(middle), float(left), "deg"),
    )


def _what_fewer_fit(order: Order) -> str:
    """Fewer cells that fit the surface, or how much wider it would have to be for half as many."""
    n, m = order.cells
    half, *smaller = (
        replace(order, cells=(max(n // part, 1), max(m // part, 1)), progress=None)
        for part in _FEWER
    )
    for fewer in (half, *smaller):
        if _fits(fewer):
            return f"{fewer.cells[0]} x {fewer.cells[1]} of these cells would fit"
    return f"with {half.cells[0]} x {half.cells[1]} of these cells {_what_fits(half)}"


def _better(order: Order, judged: _Judged) -> _Judged:
    """A sheet that is all but sound, once its search has gone on until all gates hold."""
    best = judged
    for _ in range(_ROUNDS):
        if not best.failed or best.excess > _CLOSE or time.monotonic() > order.deadline:
            break
        further = settle_further(
            judged.problem, judged.start, judged.solution, deadline=order.deadline
        )
        judged = _judged(order, judged.problem, judged.start, judged.regular, further)
        best = min(best, judged, key=lambda tried: tried.excess)
    return best


def _judge(order: Order, start: Floats, trial: Trial, *, foldable: bool) -> _Judged:
    """The sheet that the search ends at, judged."""
    regular = build_sheet(order.cell, order.cells)
    shape = (2 * order.cells[0] + 1, 2 * order.cells[1] + 1)
    problem = Problem(
        surface=order.surface,
        net=net_of(regular.facets),
        frame=frame_of(places(order.surface, start), regular.facets, regular.creases),
        shape=shape,
        bottom=(np.indices(shape)[1] % 2 == 0).ravel(),
        scale=float(size(order.cell).length),
        flat_foldable=foldable,
        sharpest=_sharpest(order, trial),
        depth=float(size(order.cell).height),
        weights=trial.weights,
        pull=trial.own_pull if order.own_columns else _PULL,
    )
    solution = settle(problem, start, deadline=order.deadline, progress=order.progress)
    return _judged(order, problem, start, regular, solution)


def _judged(
    order: Order, problem: Problem, start: Floats, regular: Sheet, solution: Solution
) -> _Judged:
    """What a search came to."""
    vertices = places(problem.surface, solution.layers)
    pattern, closure = unfold(vertices, regular.facets, solution.layers[:, :2])
    candidate = Candidate(
        surface=problem.surface,
        net=problem.net,
        frame=frame_of(vertices, regular.facets, regular.creases),
        layers=solution.layers,
        vertices=vertices,
        bottom=problem.bottom,
        mountain=regular.mountain,
        closure=closure,
        flat_foldable=problem.flat_foldable,
    )
    return _Judged(
        order=order,
        candidate=candidate,
        measures=gates(candidate, _nominal(order)),
        pattern=pattern,
        solution=solution,
        regular=regular,
        problem=problem,
        start=start,
    )


def _sharpest(order: Order, trial: Trial) -> float:
    """Fold angle whose gap leaves the planar cell's panels room enough, rad."""
    cell = order.cell
    height = min(cell.panel_a, cell.panel_b) * np.sin(cell.sector_angle)
    room = trial.room * GAP * height / (2 * order.plate)
    return float(min(_SHARPEST, 2 * np.arctan(room)))


def _nominal(order: Order) -> Nominal:
    """Measures of a sheet by the planar cell."""
    asked, _ = arc_sheet(order.cell, order.cells, np.inf)
    return Nominal(
        asked=asked.reshape(-1, 2),
        depth=float(size(order.cell).height),
        plate=order.plate,
        column=order.column,
        own_columns=order.own_columns,
    )


def _start(order: Order, radius: float, trial: Trial, *, one_way: bool) -> Floats:
    """Layers to begin with, (V, 3)."""
    cell, cells = order.cell, order.cells
    parameters, heights = arc_sheet(cell, cells, radius)
    if not one_way:
        across = np.arange(-cells[1], cells[1] + 1) * float(size(cell).width) / 2
        attached = attach(order.surface, cell, cells, trial.stiffness)
        parameters, heights = attached_sheet(attached, cell, parameters[..., 1] - across)
        parameters = trial.wider * parameters
    return np.column_stack([parameters.reshape(-1, 2), heights.ravel()])


def _reported(order: Order, judged: _Judged, *, refold: bool) -> Tessellation:
    """The sheet with how it folds, and advice where a gate does not hold."""
    candidate, regular = judged.candidate, judged.regular
    angles = fold_angles(candidate.vertices, candidate.frame.creases)
    values, _ = rigid_modes(candidate.vertices, regular.facets)
    refold = refold and judged.solution.reached == 1.0
    at = forms(candidate.surface, candidate.layers[regular.columns.ravel(), :2])
    return Tessellation(
        surface=judged.order.surface,
        turn=judged.order.turn,
        plate=judged.order.plate,
        sheet=replace(regular, vertices=candidate.vertices),
        normals=at.normals.reshape(*regular.columns.shape, 3),
        pattern=judged.pattern,
        angles=angles,
        layers=candidate.layers,
        flat_foldable=candidate.flat_foldable,
        gates=judged.measures,
        rigidity=(float(values[0]), float(values[1])),
        folding=fold(judged.pattern, candidate.frame, angles) if refold else None,
        advice=f"{_reason(judged)}; {_what_fits(order)}" if judged.failed else "",
    )


def _reason(judged: _Judged) -> str:
    """Place and reason of a failure."""
    if judged.solution.reached < 1.0:
        return f"the search came {100 * judged.solution.reached:.0f} % of the way to the surface"
    return reason(judged.candidate, judged.failed)


def _what_fits(order: Order) -> str:
    """How much wider a surface would have to be, as far as there is time to try it."""
    for share in _SMALLER:
        if time.monotonic() > order.deadline:
            return "there was no time left to look for what would fit"
        if _fits(order.scaled(share)):
            return (
                f"a surface {1 / share:.2g} times as wide would fit, or a sheet {share:g} times as "
                "large in all its parts"
            )
    return f"not even a surface {1 / _SMALLER[-1]:g} times as wide would fit"


def _fits(order: Order) -> bool:
    """Whether the first search of a sheet ends at one that passes all gates."""
    try:
        return not _best(order, TRIALS[:1]).failed
    except SmoskinError:
        return False
