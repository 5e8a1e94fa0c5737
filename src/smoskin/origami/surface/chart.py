"""A smooth chart of the part of a mesh that a sheet covers.

Decides how a mesh becomes a smooth surface: vertices get geodesic coordinates round a picked point
(Schmidt's discrete exponential map), and a bicubic spline with knots as far apart as cells is
fitted to their places, so that noise finer than a cell goes.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.interpolate import BSpline, NdBSpline
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from smoskin.arrays import Bools, Floats, Ints, floats
from smoskin.errors import ArgumentError
from smoskin.origami.surface.mesh import Mesh, place_text
from smoskin.origami.surface.surface import Jet

_SMOOTHINGS: Final = 3
"""Times that normals are averaged with their neighbours' before they carry directions."""
_STIFF: Final = 1e-4
"""Weight of third differences of the spline against one vertex; it fills the rim."""
_SHARP: Final = np.cos(np.radians(60))
"""Cosine between the normals of neighbouring triangles at a sharp edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """A bicubic spline fitted to part of a mesh, in the frame of the mesh."""

    spline: NdBSpline
    """Places by parameters."""
    half: tuple[float, float]
    """m: the chart reaches so far from the picked point along both parameters."""
    roughness: float
    """m: root mean square by which the mesh departs from the chart along the normal."""

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        u = floats("parameters", parameters, (2,))
        slopes = [self.spline(u, nu=nu) for nu in ((1, 0), (0, 1))]
        xx, xy, yy = (self.spline(u, nu=nu) for nu in ((2, 0), (1, 1), (0, 2)))
        bends = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -1)
        return Jet(self.spline(u), np.stack(slopes, -1), bends)

    def holds(self, parameters: Floats) -> Bools:
        """Within the chart."""
        return np.asarray((np.abs(parameters) <= self.half).all(axis=-1))


def chart_of(
    mesh: Mesh, point: ArrayLike, along: ArrayLike, size: tuple[float, float], fineness: float
) -> Chart:
    """The chart round a point of a mesh, its first parameter along a direction.

    Parameters
    ----------
    point : array_like, shape (3,)
        m; the mesh's nearest place is taken.
    along : array_like, shape (3,)
        Direction of the sheet's x; its part in the surface counts.
    size : tuple of float
        Lengths of the part that is needed along both parameters, m.
    fineness : float
        Distance of knots, m: what is finer counts as noise.

    Raises
    ------
    ArgumentError
        If the mesh ends, has a hole or a fold within that part, or the direction is its normal.
    """
    start, origin = _nearest(mesh, floats("point", point, (3,)))
    frame = _frame(mesh, start, floats("along", along, (3,)))
    half = np.array(size) / 2
    wide = half + 1.5 * fineness
    parameters = _geodesic(mesh, start, frame, wide)
    parameters = parameters - _at(mesh, parameters, origin)
    _check(mesh, parameters, half)
    inside = (np.abs(parameters) <= wide).all(axis=1)
    spline = _fitted(parameters[inside], mesh.vertices[inside], wide, fineness)
    chart = Chart(spline, (float(half[0]), float(half[1])), 0.0)
    near = (np.abs(parameters) <= half).all(axis=1)
    at = chart.jet(parameters[near])
    normals = np.cross(at.slopes[..., 0], at.slopes[..., 1])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    off = ((mesh.vertices[near] - at.places) * normals).sum(-1)
    return Chart(spline, chart.half, float(np.sqrt(np.mean(off**2))))


def _nearest(mesh: Mesh, point: Floats) -> tuple[int, Floats]:
    """The vertex nearest to a point, and the nearest place on the triangles round it."""
    start = int(KDTree(mesh.vertices).query(point)[1])
    best, least = mesh.vertices[start], np.inf
    for corners in mesh.triangles[(mesh.triangles == start).any(axis=1)]:
        place = _on_triangle(mesh.vertices[corners], point)
        if (distance := float(np.linalg.norm(place - point))) < least:
            best, least = place, distance
    return start, best


def _on_triangle(corners: Floats, point: Floats) -> Floats:
    """A place of a triangle near a point: its foot, moved into the triangle by shares."""
    arms = (corners[1:] - corners[0]).T
    shares = np.linalg.lstsq(arms, point - corners[0], rcond=None)[0].clip(0.0)
    return np.asarray(corners[0] + arms @ (shares / max(1.0, float(shares.sum()))))


def _at(mesh: Mesh, parameters: Floats, place: Floats) -> Floats:
    """Parameters at a place on the mesh, by the plane map of the vertices round it."""
    charted = np.flatnonzero(np.isfinite(parameters).all(axis=1))
    near = charted[np.argsort(((mesh.vertices[charted] - place) ** 2).sum(1))[:7]]
    away = np.column_stack([mesh.vertices[near] - place, np.ones(len(near))])
    return np.asarray(np.linalg.lstsq(away, parameters[near], rcond=1e-6)[0][3])


def _frame(mesh: Mesh, start: int, along: Floats) -> Floats:
    """The tangent at a vertex that points along a direction."""
    normal = mesh.normals[start]
    tangent = along - (along @ normal) * normal
    length = float(np.linalg.norm(tangent))
    if not length > 1e-3 * float(np.linalg.norm(along)):
        raise ArgumentError(
            f"along must lie in the surface; {along} is its normal near "
            f"{place_text(mesh.vertices[start])}"
        )
    return np.asarray(tangent / length)


def _geodesic(mesh: Mesh, start: int, tangent: Floats, wide: Floats) -> Floats:
    """Geodesic coordinates (V, 2) of the vertices within a rectangle and just beyond; else NaN.

    Vertices are settled in the order of their distance. A new one takes the mean of what settled
    neighbours say: their coordinates and the edge, turned into their tangent plane. Frames go from
    vertex to vertex without turning about the normal.
    """
    normals = _smoothed(mesh)
    ahead, behind = mesh.edges.T
    edge = mesh.vertices[behind] - mesh.vertices[ahead]
    length = np.linalg.norm(edge, axis=1)
    parameters = np.full((len(normals), 2), np.nan)
    tangents = np.zeros_like(normals)
    parameters[start], tangents[start] = 0.0, tangent
    settled = np.zeros(len(normals), dtype=bool)
    spreads = settled.copy()
    settled[start] = spreads[start] = True
    band = float(np.median(length))
    while (front := np.flatnonzero(spreads[ahead] & ~settled[behind])).size:
        source, new = ahead[front], behind[front]
        first, normal = tangents[source], normals[source]
        second = np.cross(normal, first)
        flat = np.stack([(edge[front] * first).sum(1), (edge[front] * second).sum(1)], axis=1)
        flat *= (length[front] / np.maximum(np.linalg.norm(flat, axis=1), 1e-300))[:, None]
        weights = 1 / np.maximum(length[front], 1e-12)
        proposed = np.column_stack(
            [parameters[source] + flat, _carried(first, normal, normals[new])]
        )
        names, which = np.unique(new, return_inverse=True)
        total = np.bincount(which, weights)
        sums = np.stack([np.bincount(which, weights * column) for column in proposed.T], 1)
        means = np.asarray(sums / total[:, None], dtype=np.float64)
        reach = np.linalg.norm(means[:, :2], axis=1)
        now = reach <= reach.min() + band
        chosen = names[now]
        parameters[chosen] = means[now, :2]
        turned = means[now, 2:]
        turned -= (turned * normals[chosen]).sum(1, keepdims=True) * normals[chosen]
        tangents[chosen] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        settled[chosen] = True
        spreads[chosen] = (np.abs(means[now, :2]) <= wide).all(axis=1)
    return parameters


def _smoothed(mesh: Mesh) -> Floats:
    """Vertex normals, averaged with their neighbours'."""
    normals = mesh.normals
    ahead, behind = mesh.edges.T
    for _ in range(_SMOOTHINGS):
        sums = normals.copy()
        np.add.at(sums, ahead, normals[behind])
        normals = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)
    return normals


def _carried(tangents: Floats, before: Floats, after: Floats) -> Floats:
    """Tangents turned by the least rotation that takes one normal to the other."""
    axis = np.cross(before, after)
    cosine = np.maximum((before * after).sum(1, keepdims=True), -0.99)
    across = np.cross(axis, tangents)
    return np.asarray(tangents + across + np.cross(axis, across) / (1 + cosine))


def _check(mesh: Mesh, parameters: Floats, half: Floats) -> None:
    """Refuse a part of a mesh that ends, has a hole or folds over."""
    inside: Bools = np.all(np.abs(parameters) <= half, axis=1)
    open_ends = inside[mesh.rim].any(axis=1)
    if open_ends.any():
        place = mesh.vertices[mesh.rim[open_ends]].mean(axis=(0, 1))
        raise ArgumentError(
            f"the mesh ends or has a hole under the sheet, near {place_text(place)}; close it, "
            "move the point, or take fewer or smaller cells"
        )
    corners = mesh.triangles[inside[mesh.triangles].all(axis=1)]
    p, q, r = (parameters[corners[:, k]] for k in range(3))
    signs = (q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0]
    reach = half - np.abs(parameters[inside]).max(axis=0) if inside.any() else half
    longest = float(np.linalg.norm(q - p, axis=1).max(initial=0.0))
    if (reach > 2 * longest).any():
        raise ArgumentError("the mesh is smaller than the sheet; take fewer or smaller cells")
    folded = np.concatenate([corners[signs <= 0], mesh.triangles[_sharp(mesh, inside)]])
    if len(folded):
        raise ArgumentError(
            f"the mesh folds over or has a sharp edge under the sheet, near "
            f"{place_text(mesh.vertices[folded[0]].mean(axis=0))}; smooth it or move the point"
        )


def _sharp(mesh: Mesh, inside: Bools) -> Ints:
    """Triangles that meet another at a sharp edge between vertices inside."""
    p, q, r = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    facing = np.cross(q - p, r - p)
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-300)
    edges = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1) & inside[edges[order[1:]]].all(
        axis=1
    )
    first, second = order[:-1][same] // 3, order[1:][same] // 3
    return np.asarray(first[(facing[first] * facing[second]).sum(1) < _SHARP])


def _fitted(parameters: Floats, places: Floats, wide: Floats, fineness: float) -> NdBSpline:
    """The bicubic spline that is nearest to places in the sense of least squares."""
    knots, designs, penalties = [], [], []
    for axis, end in enumerate(wide):
        pieces = max(2, round(2 * end / fineness))
        line = np.linspace(-end, end, pieces + 1)
        line = np.concatenate([[-end] * 3, line, [end] * 3])
        knots.append(line)
        designs.append(BSpline.design_matrix(parameters[:, axis].clip(-end, end), line, 3))
        penalties.append(_third_differences(pieces + 3))
    counts = [len(line) - 4 for line in knots]
    design = _row_product(*designs)
    along = sparse.kron(penalties[0], sparse.eye_array(counts[1]))
    across = sparse.kron(sparse.eye_array(counts[0]), penalties[1])
    system = (design.T @ design + _STIFF * (along + across)).tocsc()
    coefficients = splu(system).solve(design.T @ places)
    return NdBSpline(tuple(knots), coefficients.reshape(*counts, 3), 3)


def _third_differences(count: int) -> sparse.csr_array:
    """Sum of squares of third differences, as a matrix."""
    matrix = np.diff(np.eye(count), 3, axis=0)
    return sparse.csr_array(matrix.T @ matrix)


def _row_product(first: sparse.csr_array, second: sparse.csr_array) -> sparse.csr_array:
    """Products of every entry of a row with every one of the other's, as columns."""
    rows = first.shape[0]
    a, b = first.data.reshape(rows, 4), second.data.reshape(rows, 4)
    i, j = first.indices.reshape(rows, 4), second.indices.reshape(rows, 4)
    columns: Ints = (i[:, :, None] * second.shape[1] + j[:, None, :]).reshape(rows, 16)
    data = (a[:, :, None] * b[:, None, :]).reshape(rows, 16)
    return sparse.csr_array(
        (data.ravel(), columns.ravel(), np.arange(0, 16 * rows + 1, 16)),
        shape=(rows, first.shape[1] * second.shape[1]),
    )
