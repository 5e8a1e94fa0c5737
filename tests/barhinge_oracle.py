"""A small linear bar-and-hinge model of the whole sheet on its columns: an independent oracle.

Bars along every panel edge and one diagonal of each panel, hinges at every crease and at every
panel's diagonal, a spring in the plane under each bottom vertex, which cannot move in z. It
knows the sheet's mesh and nothing of the closed forms.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from smoskin.design.skin import MiuraCell
from smoskin.origami.sheet import build_sheet


@dataclass(frozen=True)
class Springs:
    """What the model is made of."""

    bar: float
    """EA of every bar, N."""
    panel: float
    """Moment per angle and length at a panel's diagonal, N."""
    crease: float
    """The same at a crease, N."""
    column: float
    """N/m."""


def hinge_gradient(points: np.ndarray) -> np.ndarray:
    """Gradient of the angle between two triangles; rows: both ends of the hinge, both wings."""
    start, end, left, right = points
    axis = end - start
    length = np.linalg.norm(axis)
    n_left, n_right = np.cross(axis, left - start), np.cross(right - start, axis)
    g_left = length * n_left / (n_left @ n_left)
    g_right = length * n_right / (n_right @ n_right)

    def share(wing: np.ndarray) -> float:
        return float((wing - start) @ axis / length**2)

    g_end = -share(left) * g_left - share(right) * g_right
    g_start = -(1 - share(left)) * g_left - (1 - share(right)) * g_right
    return np.stack([g_start, g_end, g_left, g_right])


def panel_triangles(sheet) -> list[tuple[int, int, int, int]]:
    """Each panel's diagonal, the shorter one, and the two corners beside it."""
    out = []
    for p, q, r, s in sheet.facets:
        v = sheet.vertices
        if np.linalg.norm(v[p] - v[r]) < np.linalg.norm(v[q] - v[s]):
            out.append((p, r, q, s))
        else:
            out.append((q, s, p, r))
    return out


def stiffness_matrix(sheet, springs: Springs) -> np.ndarray:
    """Of all vertices' displacements, (3V, 3V)."""
    v = sheet.vertices
    k = np.zeros((3 * len(v), 3 * len(v)))

    def add(nodes, gradient: np.ndarray, stiffness: float) -> None:
        where = (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()
        k[np.ix_(where, where)] += stiffness * np.outer(gradient, gradient)

    triangles = panel_triangles(sheet)
    bars = {frozenset((a, b)) for q in sheet.facets for a, b in zip(q, np.roll(q, 1), strict=True)}
    wings = defaultdict(list)
    for a, b, c, d in triangles:
        bars.add(frozenset((a, b)))
        for wing in (c, d):
            for end, far in ((a, b), (b, a)):
                wings[frozenset((end, wing))].append(far)
    for a, b in map(tuple, bars):
        along = v[b] - v[a]
        length = np.linalg.norm(along)
        add((a, b), np.concatenate([-along, along]) / length, springs.bar / length)
    hinges = [(quad, springs.panel) for quad in triangles]
    hinges += [((a, b, *wings[frozenset((a, b))]), springs.crease) for a, b in sheet.creases]
    for nodes, stiffness in hinges:
        points = v[list(nodes)]
        length = np.linalg.norm(points[1] - points[0])
        add(nodes, hinge_gradient(points).ravel(), stiffness * length)
    for foot in sheet.columns.ravel():
        k[3 * foot, 3 * foot] += springs.column
        k[3 * foot + 1, 3 * foot + 1] += springs.column
    return k


def press_stiffness(
    cell: MiuraCell, cells: tuple[int, int], springs: Springs, loaded: tuple[int, int], *,
    held: bool = False,
) -> float:  # fmt: skip
    """dF/d(dh) of a press on one cell; `held` also holds the loaded vertex in the plane, N/m."""
    sheet = build_sheet(cell, cells)
    k = stiffness_matrix(sheet, springs)
    top = 3 * sheet.loaded[loaded]
    fixed = set(3 * sheet.columns.ravel() + 2) | {top + 2}
    if held:
        fixed |= {top, top + 1}
    free = np.array(sorted(set(range(len(k))) - fixed))
    moved = np.linalg.solve(k[np.ix_(free, free)], -k[free, top + 2])
    return float(k[top + 2, top + 2] + k[top + 2, free] @ moved)
