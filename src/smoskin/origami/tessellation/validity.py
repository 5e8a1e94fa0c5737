"""Gates that a sheet must pass before it is cut, each with its value and its limit.

Decides what is measured and how far it may go; whether a sheet folds is told beside it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
from scipy.spatial import KDTree

from smoskin.arrays import Bools, Floats, Ints
from smoskin.origami.surface.surface import Surface, forms
from smoskin.origami.tessellation.conditions import Net, sector_angles, warps
from smoskin.origami.tessellation.hinges import Frame, fold_angles

PLANARITY: Final = 1e-9
ANGLES: Final = 1e-9
"""rad."""
CLOSURE: Final = 1e-9
"""m."""
DISTANCE: Final = 0.05e-3
"""m."""
SECTORS: Final = (float(np.radians(25)), float(np.radians(155)))
"""rad."""
COVERAGE: Final = 0.95
_SAMPLES: Final = 100
"""Points each way on the asked patch, at least, by which what is covered is counted."""
_AWAY: Final = 1e-3
"""m: way of a sheet's middle from its patch's that is told."""
DEPTH: Final = 0.2
COLUMNS: Final = 0.1
GAP: Final = 0.25
"""Share of a panel's least height that a crease's gap may take."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """One measure of a sheet and its limit."""

    name: str
    value: float
    limit: float
    unit: str
    holds: bool
    where: int | None = None
    """Vertex, panel or crease with the worst value."""

    def as_json(self) -> dict[str, Any]:
        """Plain values; one that is not finite is null."""
        values = asdict(self)
        del values["where"]
        return values | {"value": self.value if np.isfinite(self.value) else None}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """A sheet as it is judged."""

    surface: Surface
    net: Net
    frame: Frame
    layers: Floats
    """(V, 3), m: parameters and heights of the vertices."""
    vertices: Floats
    """(V, 3), m."""
    bottom: Bools
    """(V,)."""
    mountain: Bools
    """(C,): creases that must be ridges."""
    closure: float
    """m: the largest length that the flat pattern misses."""
    flat_foldable: bool
    """Whether opposite sector angles must sum to pi."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nominal:
    """Measures of a sheet by the planar cell."""

    asked: Floats
    """(V, 2), m: parameters of the planar sheet's vertices, the patch to be covered."""
    depth: float
    """m: height of top vertices."""
    plate: float
    """m: thickness of the panels on one face of the film."""
    column: float
    """m: height of the columns."""
    own_columns: bool
    """Whether every column has a height of its own, which takes up a bottom vertex's."""


def gates(sheet: Candidate, nominal: Nominal) -> tuple[Gate, ...]:
    """All gates of a sheet."""
    return tuple(_gates(sheet, nominal))


def _gates(sheet: Candidate, nominal: Nominal) -> Iterator[Gate]:
    """Every gate in turn."""
    net, heights = sheet.net, sheet.layers[:, 2]
    angles = sector_angles(net, sheet.vertices)
    yield _most("planarity", warps(net, sheet.vertices), PLANARITY, "1")
    yield _most("angle_sum", net.around @ angles - 2 * np.pi, ANGLES, "rad")
    if sheet.flat_foldable:
        yield _most("flat_folding", net.opposite @ angles - np.pi, ANGLES, "rad")
    yield _most("unfolding_closure", 1e3 * np.array([sheet.closure]), 1e3 * CLOSURE, "mm")
    off = np.where(sheet.bottom, heights, 0.0)
    distance = COLUMNS * nominal.column if nominal.own_columns else DISTANCE
    yield _most("distance_to_surface", 1e3 * off, 1e3 * distance, "mm")
    crossings = intersections(sheet.vertices, net.facets)
    yield _most("self_intersections", np.array([float(len(crossings))]), 0.0, "1")
    folds = fold_angles(sheet.vertices, sheet.frame.creases)
    wrong = np.where(sheet.mountain, folds >= 0, folds <= 0).astype(float)
    yield _most("creases_turned_over", np.array([wrong.sum()]), 0.0, "1")
    least, most = (float(np.degrees(bound)) for bound in SECTORS)
    yield _least("least_sector_angle", np.degrees(angles), least, "deg")
    yield _most("largest_sector_angle", np.degrees(angles), most, "deg")
    covered = coverage(sheet.surface, sheet.layers, net.facets, nominal.asked)
    yield _least("coverage", np.array([covered]), COVERAGE, "1")
    deviation = np.where(sheet.bottom, 0.0, heights / nominal.depth - 1)
    yield _most("depth_deviation", deviation, DEPTH, "1")
    yield _most("column_height_deviation", off / nominal.column, COLUMNS, "1")
    gap = 2 * nominal.plate * np.tan(np.abs(folds) / 2)
    room = GAP * float(_least_heights(sheet.vertices, net.facets).min())
    yield _most("crease_gap", 1e3 * gap, 1e3 * room, "mm")


def thinned(measures: Sequence[Gate], share: float) -> tuple[Gate, ...]:
    """Gates of the same sheet with plates so many times as thick."""
    gap = next(gate for gate in measures if gate.name == "crease_gap")
    value = share * gap.value
    other = replace(gap, value=value, holds=value <= gap.limit)
    return tuple(other if gate is gap else gate for gate in measures)


def reason(sheet: Candidate, failed: Sequence[Gate]) -> str:
    """What of a sheet's failed gates tells the most, and where: sector angles before others."""
    sectors = [gate for gate in failed if "sector_angle" in gate.name]
    worst = (sectors or failed)[0]
    unit = "" if worst.unit == "1" else f" {worst.unit}"
    text = f"{worst.name} is {worst.value:.4g}{unit}, its limit {worst.limit:.4g}"
    if worst in sectors and worst.where is not None:
        text += f", at {_millimetres(sheet.vertices[sheet.net.corners.at[worst.where]])}"
    away = sheet.layers[:, :2].mean(axis=0)
    if worst.name == "coverage" and np.abs(away).max() > _AWAY:
        text += f"; the sheet's middle lies {_millimetres(away)} away from the patch's"
    return text


def _millimetres(place: Floats) -> str:
    """Coordinates of a place or a way, in whole mm."""
    return f"({', '.join(str(round(1e3 * float(value))) for value in place)}) mm"


def _most(name: str, values: Floats, limit: float, unit: str) -> Gate:
    """A gate below which all magnitudes must stay."""
    sizes = np.abs(values)
    where = int(np.argmax(sizes))
    value = float(sizes[where])
    return Gate(name=name, value=value, limit=limit, unit=unit, holds=value <= limit, where=where)


def _least(name: str, values: Floats, limit: float, unit: str) -> Gate:
    """A gate above which all values must stay."""
    where = int(np.argmin(values))
    value = float(values[where])
    return Gate(name=name, value=value, limit=limit, unit=unit, holds=value >= limit, where=where)


def coverage(surface: Surface, layers: Floats, facets: Ints, asked: Floats) -> float:
    """Share of the asked patch that a sheet covers, by its corners moved down to the surface.

    Where a chart makes the patch larger than the planar sheet, as a saddle's does, that sheet's
    area counts as all of it: cells of their own size cover no more. A sphere's makes it smaller.

    Parameters
    ----------
    asked : array, shape (V, 2)
        Parameters of the planar sheet's vertices, of the same panels, m.
    """
    count = int(np.ceil(_SAMPLES / np.sqrt(len(facets)))) + 1
    steps = (np.arange(count) + 0.5) / count
    x, y = (grid.ravel()[:, None, None] for grid in np.meshgrid(steps, steps, indexing="ij"))
    p, q, r, s = (asked[facets[:, k]] for k in range(4))
    points = (1 - x) * (1 - y) * p + x * (1 - y) * q + x * y * r + (1 - x) * y * s
    first, second = r - p, s - q
    planar = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / (2 * count**2)
    areas = planar * np.sqrt(np.linalg.det(forms(surface, points).metric))
    under = _windings(points.reshape(-1, 2), layers[_rim(facets), :2]) != 0
    whole = min(float(areas.sum()), float(planar.sum()) * count**2)
    return min(float(areas.ravel()[under].sum()) / whole, 1.0)


def _rim(facets: Ints) -> Ints:
    """Edges (E, 2) of one panel alone, each in that panel's direction."""
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2)
    count = int(edges.max()) + 1
    alone = ~np.isin(edges @ [count, 1], edges @ [1, count])
    return np.asarray(edges[alone])


def _windings(points: Floats, rim: Floats) -> Ints:
    """How often a rim of edges (E, 2, 2) goes round each point (P, 2)."""
    start, way = rim[:, 0], rim[:, 1] - rim[:, 0]
    off = points[:, None] - start
    left = way[:, 0] * off[..., 1] - way[:, 1] * off[..., 0]
    begun, ended = off[..., 1] >= 0.0, off[..., 1] >= way[:, 1]
    up, down = begun & ~ended & (left > 0.0), ended & ~begun & (left < 0.0)
    return np.asarray(up.sum(axis=1) - down.sum(axis=1))


def _least_heights(vertices: Floats, facets: Ints) -> Floats:
    """Least height of each panel: its area over its longest side."""
    p, q, r, s = (vertices[facets[:, k]] for k in range(4))
    area = np.linalg.norm(np.cross(r - p, s - q), axis=1) / 2
    sides = np.linalg.norm(np.stack([q - p, r - q, s - r, p - s]), axis=-1)
    return np.asarray(area / sides.max(axis=0))


def intersections(vertices: Floats, facets: Ints) -> Ints:
    """Pairs of panels (K, 2) without a common vertex that pass through each other."""
    corners = vertices[facets]
    middles = corners.mean(axis=1)
    radius = float(np.linalg.norm(corners - middles[:, None], axis=-1).max())
    pairs = KDTree(middles).query_pairs(2 * radius, output_type="ndarray")
    apart = ~(facets[pairs[:, 0], :, None] == facets[pairs[:, 1], None, :]).any(axis=(1, 2))
    pairs = pairs[apart]
    through = np.zeros(len(pairs), dtype=bool)
    for first, second in ((0, 1), (1, 0)):
        edges, panels = corners[pairs[:, first]], corners[pairs[:, second]]
        for k in range(4):
            for triangle in ([0, 1, 2], [0, 2, 3]):
                through |= _pierces(edges[:, k], edges[:, (k + 1) % 4], panels[:, triangle])
    return np.asarray(pairs[through])


def _pierces(start: Floats, end: Floats, triangles: Floats) -> Bools:
    """Whether the way from start to end crosses each triangle (K, 3, 3)."""
    p, a, b = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    way, normal = end - start, np.cross(a, b)
    down = (way * normal).sum(1)
    safe = np.where(np.abs(down) > 1e-300, down, np.inf)
    share = ((p - start) * normal).sum(1) / safe
    arm = start + share[:, None] * way - p
    scale = np.maximum((normal**2).sum(1), 1e-300)
    x = (np.cross(arm, b) * normal).sum(1) / scale
    y = (np.cross(a, arm) * normal).sum(1) / scale
    inside = (x >= 0) & (y >= 0) & (x + y <= 1)
    return np.asarray((np.abs(down) > 1e-300) & (share >= 0) & (share <= 1) & inside)
