"""Gates that a sheet must pass before it is cut, each with its value and its limit.

Decides what is measured and how far it may go; whether a sheet folds is told beside it.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
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

    area: float
    """m^2: part of the surface to be covered."""
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
    covered = footprint(sheet.surface, sheet.layers, net.facets) / nominal.area
    yield _least("coverage", np.array([covered]), COVERAGE, "1")
    deviation = np.where(sheet.bottom, 0.0, heights / nominal.depth - 1)
    yield _most("depth_deviation", deviation, DEPTH, "1")
    yield _most("column_height_deviation", off / nominal.column, COLUMNS, "1")
    gap = 2 * nominal.plate * np.tan(np.abs(folds) / 2)
    room = GAP * float(_least_heights(sheet.vertices, net.facets).min())
    yield _most("crease_gap", 1e3 * gap, 1e3 * room, "mm")


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


def footprint(surface: Surface, layers: Floats, facets: Ints) -> float:
    """Area of the surface under a sheet, m^2, by its panels' corners moved down to it."""
    p, q, r, s = (layers[facets[:, k], :2] for k in range(4))
    first, second = r - p, s - q
    areas = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    metric = forms(surface, (p + q + r + s) / 4).metric
    return float((areas * np.sqrt(np.linalg.det(metric))).sum())


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
