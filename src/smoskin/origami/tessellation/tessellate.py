"""A folded sheet for a surface, from start to judgement.

Decides what is tried: a sheet that folds flat where the surface is bent one way, as cylinders and
cones are, and else one that only unfolds; and what advice a failure gives.
"""

import time
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError, DesignError
from smoskin.origami.cell import size
from smoskin.origami.sheet import Sheet, build_sheet
from smoskin.origami.surface.surface import Surface, curvatures, forms
from smoskin.origami.tessellation.arc import arc_sheet
from smoskin.origami.tessellation.attachment import attach, attached_sheet
from smoskin.origami.tessellation.conditions import Net, net_of
from smoskin.origami.tessellation.hinges import (
    Folding,
    Frame,
    fold,
    fold_angles,
    frame_of,
    rigid_modes,
)
from smoskin.origami.tessellation.solve import Alarm, Problem, Solution, places, settle
from smoskin.origami.tessellation.unfold import unfold
from smoskin.origami.tessellation.validity import Candidate, Gate, Nominal, gates

_TIGHTEST: Final = 0.8
"""Largest product of a curvature and a cell's width that a cell can follow."""
_ONE_WAY: Final = 0.1
"""Largest Gaussian curvature over the square of the largest one at which a surface is bent one
way; charts of noisy meshes stay below."""
_PULL: Final = 3e3
"""Weight of bottom vertices' heights where all columns are equal."""
_PULL_OF_OWN: Final = 10.0
"""The same where every column has its own height."""
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
    layers: Floats
    """(V, 3), m: parameters of the surface and height over it of every vertex."""
    flat_foldable: bool
    """Whether opposite sector angles sum to pi."""
    gates: tuple[Gate, ...]
    """Measures and limits."""
    rigidity: tuple[float, float]
    """Two lowest singular values of the panels' edges, diagonals and planes; a sheet folds by its
    creases alone where the first is zero, and stiffly where it comes near the second."""
    folding: Folding | None
    """The way from flat to folded, by lengths and fold angles alone; None where it was not asked
    for or the sheet could not be found."""
    advice: str
    """What would fit where a gate does not hold; empty otherwise."""

    @property
    def holds(self) -> bool:
        """Whether every gate holds."""
        return all(gate.holds for gate in self.gates)

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
    column: float = 10e-3,
    own_columns: bool = False,
    time_limit: float = 60.0,
    refold: bool = True,
    progress: Alarm | None = None,
) -> Tessellation:
    """The sheet of ``cells = (N, M)`` cells round the middle of a surface, judged.

    Rows of cells run along the surface's first parameter; a cylinder's or cone's axis must lie so
    for the sheet to fold.

    Parameters
    ----------
    cell : MiuraCell
        The planar cell, whose extent is kept as well as the surface lets it be.
    plate, column : float
        Thickness of the panels on one face of the film, and the columns' height, m.
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
    DesignError
        If the surface is bent more tightly than a cell can follow.
    """
    if min(cells) < 1:
        raise ArgumentError(f"cells must be at least (1, 1); got {cells}")
    if not time_limit > 0.0:
        raise ArgumentError(f"time_limit must be > 0 s; got {time_limit}")
    deadline = time.monotonic() + time_limit
    radius, one_way = _survey(surface, cell, cells)
    start, shape = _start(surface, cell, cells, radius, one_way=one_way)
    if not surface.holds(start[:, :2]).all():
        raise ArgumentError("the surface must reach under the whole sheet; take fewer cells")
    regular = build_sheet(cell, cells)
    net = net_of(regular.facets)
    nominal = _nominal(cell, cells, plate, column, own_columns=own_columns)
    best: tuple[Candidate, tuple[Gate, ...], Floats, Solution] | None = None
    for foldable in (True,) if own_columns else (True, False) if one_way else (False,):
        problem = Problem(
            surface=surface,
            net=net,
            frame=frame_of(places(surface, start), regular.facets, regular.creases),
            shape=shape,
            bottom=(np.indices(shape)[1] % 2 == 0).ravel(),
            scale=float(size(cell).length),
            flat_foldable=foldable,
            pull=_PULL_OF_OWN if own_columns else _PULL,
        )
        solution = settle(problem, start, deadline=deadline, progress=progress)
        judged = _judged(problem, solution, regular, nominal)
        if best is None or _failures(judged[1]) < _failures(best[1]):
            best = (*judged, solution)
        if _failures(best[1]) == 0 or time.monotonic() > deadline:
            break
    assert best is not None
    return _reported(best, regular, cells, refold=refold)


def _nominal(
    cell: MiuraCell, cells: tuple[int, int], plate: float, column: float, *, own_columns: bool
) -> Nominal:
    """What the planar cell says that a sheet should be."""
    length, width, height = (float(extent) for extent in size(cell))
    return Nominal(
        area=cells[0] * length * cells[1] * width,
        depth=height,
        plate=plate,
        column=column,
        own_columns=own_columns,
    )


def _survey(surface: Surface, cell: MiuraCell, cells: tuple[int, int]) -> tuple[float, bool]:
    """Radius along y in the mean, m, positive outside; whether the surface is bent one way."""
    length, width, height = (float(extent) for extent in size(cell))
    x = np.linspace(-0.5, 0.5, 2 * cells[0] + 1) * cells[0] * length
    y = np.linspace(-0.5, 0.5, 2 * cells[1] + 1) * cells[1] * width
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    if not surface.holds(grid).all():
        raise ArgumentError("the surface must reach under the whole sheet; take fewer cells")
    at = forms(surface, grid)
    principal = curvatures(at)
    largest = np.abs(principal).max(axis=-1)
    tight = np.maximum(largest * width, 2 * principal[..., 1] * height)
    if tight.max() > _TIGHTEST:
        worst = np.unravel_index(int(np.argmax(tight)), tight.shape)
        place = ", ".join(f"{1e3 * v:.0f}" for v in at.places[worst])
        share = _TIGHTEST / float(tight.max())
        raise DesignError(
            f"the surface's radius of {1e3 / float(largest[worst]):.3g} mm at ({place}) mm is too "
            f"tight for a cell {1e3 * width:.3g} mm wide; take cells {share:.2f} times as large"
        )
    gauss = np.median(np.abs(principal.prod(axis=-1)))
    one_way = bool(gauss <= _ONE_WAY * np.median(largest) ** 2)
    along, bend = (-float(np.mean(at.second[..., k, k] / at.metric[..., k, k])) for k in (0, 1))
    if one_way and abs(along) > max(abs(bend), 1e-6):
        raise ArgumentError(
            "the surface must be bent along the sheet's y, and be straight along its x, the axis; "
            "turned otherwise a sheet does not fold: turn the direction by 90 degrees"
        )
    return (1 / bend if abs(bend) * height > 1e-9 else np.inf), one_way


def _start(
    surface: Surface, cell: MiuraCell, cells: tuple[int, int], radius: float, *, one_way: bool
) -> tuple[Floats, tuple[int, int]]:
    """Layers to begin with, (V, 3), and the rows and columns of vertices."""
    parameters, heights = arc_sheet(cell, cells, radius)
    if not one_way:
        across = np.arange(-cells[1], cells[1] + 1) * float(size(cell).width) / 2
        zigzag = parameters[..., 1] - across
        parameters, heights = attached_sheet(attach(surface, cell, cells), cell, zigzag)
    layers = np.column_stack([parameters.reshape(-1, 2), heights.ravel()])
    return layers, (2 * cells[0] + 1, 2 * cells[1] + 1)


def _judged(
    problem: Problem, solution: Solution, regular: Sheet, nominal: Nominal
) -> tuple[Candidate, tuple[Gate, ...], Floats]:
    """A solution with its gates and its flat pattern."""
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
    return candidate, gates(candidate, nominal), pattern


def _failures(measures: tuple[Gate, ...]) -> int:
    """Gates that do not hold."""
    return sum(not gate.holds for gate in measures)


def _reported(
    best: tuple[Candidate, tuple[Gate, ...], Floats, Solution],
    regular: Sheet,
    cells: tuple[int, int],
    *,
    refold: bool,
) -> Tessellation:
    """The sheet with how it folds, and advice where a gate does not hold."""
    candidate, measures, pattern, solution = best
    frame: Frame = candidate.frame
    angles = fold_angles(candidate.vertices, frame.creases)
    values, _ = rigid_modes(candidate.vertices, regular.facets)
    found = solution.reached == 1.0
    at = forms(candidate.surface, candidate.layers[regular.columns.ravel(), :2])
    return Tessellation(
        sheet=replace(regular, vertices=candidate.vertices),
        normals=at.normals.reshape(*regular.columns.shape, 3),
        pattern=pattern,
        angles=angles,
        layers=candidate.layers,
        flat_foldable=candidate.flat_foldable,
        gates=measures,
        rigidity=(float(values[0]), float(values[1])),
        folding=fold(pattern, frame, angles) if refold and found else None,
        advice=_advice(candidate.net, candidate.vertices, measures, solution, cells),
    )


def _advice(
    net: Net,
    vertices: Floats,
    measures: tuple[Gate, ...],
    solution: Solution,
    cells: tuple[int, int],
) -> str:
    """Place and reason of a failure and what would fit; empty where nothing fails."""
    failed = [gate for gate in measures if not gate.holds]
    if not failed:
        return ""
    by_name = {gate.name: gate for gate in failed}
    share = solution.reached
    reason = f"the search came {100 * share:.0f} % of the way to the surface"
    if solution.reached == 1.0:
        worst = (
            by_name.get("least_sector_angle") or by_name.get("largest_sector_angle") or failed[0]
        )
        reason = f"{worst.name} is {worst.value:.3g} {worst.unit}, its limit {worst.limit:.3g}"
        if "sector_angle" in worst.name and worst.where is not None:
            place = ", ".join(f"{1e3 * v:.0f}" for v in vertices[net.corners.at[worst.where]])
            reason += f", at ({place}) mm"
        share = 0.8
    share = max(0.2, min(0.9, share))
    fewer = " x ".join(str(max(1, int(share * count))) for count in cells)
    return f"{reason}; it would more likely fit {1 / share:.1f} times the radius or {fewer} cells"
