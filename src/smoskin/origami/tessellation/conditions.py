"""What makes a folded sheet one of plane panels that unfolds, and folds flat: with derivatives.

Decides how each condition is measured; hides which panels and corners meet where. Holds for any
mesh of quadrilaterals with one orientation, regular or not.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse

from smoskin.arrays import Floats, Ints, cross


class Corners(NamedTuple):
    """Every corner of every panel; corner k of panel f has the number 4 f + k."""

    at: Ints
    """(K,): its vertex."""
    after: Ints
    """(K,): the panel's next vertex."""
    before: Ints
    """(K,): the panel's vertex before."""


@dataclass(frozen=True, slots=True, eq=False)
class Net:
    """Panels of a sheet, and how their corners meet at its inner vertices."""

    facets: Ints
    """(F, 4): vertices of each panel, counter-clockwise seen from above."""
    corners: Corners
    """Corners of the panels."""
    inner: Ints
    """(I,): vertices that panels surround."""
    around: sparse.csr_array
    """(I, K): ones at the corners round an inner vertex."""
    opposite: sparse.csr_array
    """(Q, K): ones at two opposite corners round an inner vertex of four panels."""


def net_of(facets: Ints) -> Net:
    """The net of panels (F, 4)."""
    at = facets.ravel()
    corners = Corners(at, np.roll(facets, -1, axis=1).ravel(), np.roll(facets, 1, axis=1).ravel())
    # A vertex is inner where every neighbour comes once after it and once before it.
    count = int(at.max()) + 1
    ones = np.ones(len(at))
    after = sparse.csr_array((ones, (at, corners.after)), shape=(count, count))
    before = sparse.csr_array((ones, (at, corners.before)), shape=(count, count))
    rim = np.asarray(abs(after - before).sum(axis=1)).ravel() > 0
    used = np.bincount(at, minlength=count)
    inner = np.flatnonzero(~rim & (used > 0))
    order = np.argsort(at, kind="stable")
    first = np.concatenate([[0], np.cumsum(used)])
    around = _incidence([order[first[v] : first[v + 1]] for v in inner], len(at))
    fours = inner[used[inner] == 4]
    groups = order[first[fours][:, None] + np.arange(4)] if len(fours) else np.empty((0, 4), int)
    ends = np.stack([corners.after[groups], corners.before[groups]], axis=-1)
    shares = (ends[:, :, None, :, None] == ends[:, None, :, None, :]).any(axis=(-1, -2))
    faces = np.argmin(shares[:, 0], axis=1)
    opposite = _incidence(
        list(np.stack([groups[:, 0], groups[np.arange(len(fours)), faces]], 1)), len(at)
    )
    return Net(facets, corners, inner, around, opposite)


def _incidence(groups: list[Ints], columns: int) -> sparse.csr_array:
    """A row of ones for each group of columns."""
    sizes = [len(group) for group in groups]
    rows = np.repeat(np.arange(len(groups)), sizes)
    ends = np.concatenate(groups) if groups else np.empty(0, int)
    return sparse.csr_array((np.ones(len(ends)), (rows, ends)), shape=(len(groups), columns))


def sector_angles(net: Net, places: Floats) -> Floats:
    """Angle of every corner, (K,), rad; places are (V, 3) or (V, 2)."""
    first, second = _arms(net, places)
    return _angle(first, second)


def angle_slopes(net: Net, places: Floats) -> sparse.csr_array:
    """Derivatives of the sector angles by the coordinates, (K, 3 V)."""
    first, second = _arms(net, places)
    normal = cross(first, second)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    by_first = -cross(normal, first) / (first**2).sum(-1, keepdims=True)
    by_second = cross(normal, second) / (second**2).sum(-1, keepdims=True)
    nodes = np.stack([net.corners.after, net.corners.before, net.corners.at], axis=1)
    parts = np.stack([by_first, by_second, -by_first - by_second], axis=1)
    return gather(nodes, parts, len(places))


def warps(net: Net, places: Floats) -> Floats:
    """How far each panel is from plane, (F,): distance of its diagonals over their mean length."""
    p, q, r, s = (places[net.facets[:, k]] for k in range(4))
    normal = cross(r - p, s - q)
    lengths = np.linalg.norm(r - p, axis=-1) + np.linalg.norm(s - q, axis=-1)
    return np.asarray(2 * ((q - p) * normal).sum(-1) / (np.linalg.norm(normal, axis=-1) * lengths))


def volumes(net: Net, places: Floats, scale: float) -> tuple[Floats, sparse.csr_array]:
    """Volume spanned by each panel's corners over scale^3, (F,), and its derivatives (F, 3 V)."""
    p, q, r, s = (places[net.facets[:, k]] for k in range(4))
    a, b, c = q - p, r - p, s - p
    by_a, by_b, by_c = cross(b, c), cross(c, a), cross(a, b)
    parts = np.stack([-by_a - by_b - by_c, by_a, by_b, by_c], axis=1) / scale**3
    return (a * by_a).sum(-1) / scale**3, gather(net.facets, parts, len(places))


def _arms(net: Net, places: Floats) -> tuple[Floats, Floats]:
    """Both edges of every corner, from its vertex, in space."""
    space = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    at = space[net.corners.at]
    return space[net.corners.after] - at, space[net.corners.before] - at


def _angle(first: Floats, second: Floats) -> Floats:
    """Angle between two edges; the tangent's form keeps digits at every angle."""
    sine = np.linalg.norm(cross(first, second), axis=-1)
    return np.asarray(np.arctan2(sine, (first * second).sum(-1)))


def gather(nodes: Ints, parts: Floats, count: int) -> sparse.csr_array:
    """A row for each group of nodes (R, n) with the derivatives (R, n, 3) by their places."""
    columns = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])
    order = np.argsort(columns, axis=1)
    columns = np.take_along_axis(columns, order, axis=1)
    values = np.take_along_axis(parts.reshape(columns.shape), order, axis=1)
    ends = np.arange(0, columns.size + 1, columns.shape[1])
    return sparse.csr_array((values.ravel(), columns.ravel(), ends), shape=(len(nodes), 3 * count))
