"""The flat crease pattern of a folded sheet.

Decides how panels are laid flat: one beside the other, then all lengths at once by least squares,
so that what is left over does not gather at one end.
"""

from collections import deque
from typing import Any, Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from smoskin.arrays import Floats, Ints
from smoskin.errors import ArgumentError

_STEPS: Final = 10
"""Gauss-Newton steps."""


def unfold(vertices: Floats, facets: Ints, towards: Floats) -> tuple[Floats, float]:
    """Flat places of the vertices (V, 2), m, and the largest length that does not fit, m.

    Edges and diagonals of all panels keep their lengths in the sense of least squares. The pattern
    is seen from above, its middle at (0, 0), turned as near as can be towards places (V, 2).

    Raises
    ------
    ArgumentError
        If the panels do not hang together.
    """
    pairs = lengths_of(facets)
    lengths = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)
    flat = by_lengths(_laid(vertices, facets), pairs, lengths)
    flat = _turned(flat - flat.mean(axis=0), towards - towards.mean(axis=0))
    misfit = np.linalg.norm(flat[pairs[:, 0]] - flat[pairs[:, 1]], axis=1) - lengths
    return flat, float(np.abs(misfit).max())


def by_lengths(start: Floats, pairs: Ints, lengths: Floats) -> Floats:
    """Flat places (V, 2), m, near others, that are nearest to lengths (B,), m, of pairs (B, 2)."""
    flat = start
    for _ in range(_STEPS):
        spans = flat[pairs[:, 0]] - flat[pairs[:, 1]]
        now = np.linalg.norm(spans, axis=1)
        slopes = _length_slopes(pairs, spans / now[:, None], len(flat))
        # A trace of stiffness keeps the three rigid motions from drifting.
        system: Any = (slopes.T @ slopes + 1e-12 * sparse.eye_array(flat.size)).tocsc()
        factor = splu(
            system,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        motion = factor.solve(slopes.T @ (lengths - now)).reshape(-1, 2)
        flat = flat + motion
        if np.abs(motion).max() < 1e-15:
            break
    return flat


def _turned(flat: Floats, towards: Floats) -> Floats:
    """Places turned about (0, 0) as near as can be to others."""
    cosine = float((flat * towards).sum())
    sine = float((flat[:, 0] * towards[:, 1] - flat[:, 1] * towards[:, 0]).sum())
    rotation = np.array([[cosine, sine], [-sine, cosine]]) / max(np.hypot(cosine, sine), 1e-300)
    return np.asarray(flat @ rotation)


def lengths_of(facets: Ints) -> Ints:
    """Pairs of vertices (B, 2) between which panels are stiff: every edge once, both diagonals."""
    sides = np.concatenate([facets[:, [k, (k + 1) % 4]] for k in range(4)])
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    return np.concatenate([edges, facets[:, [0, 2]], facets[:, [1, 3]]])


def _length_slopes(pairs: Ints, units: Floats, count: int) -> sparse.csr_array:
    """Derivatives of the lengths by the flat places, (B, 2 V)."""
    rows = np.repeat(np.arange(len(pairs)), 4)
    columns = (2 * pairs[:, [0, 0, 1, 1]] + np.array([0, 1, 0, 1])).ravel()
    data = np.concatenate([units, -units], axis=1).ravel()
    return sparse.csr_array((data, (rows, columns)), shape=(len(pairs), 2 * count))


def _laid(vertices: Floats, facets: Ints) -> Floats:
    """Panels laid beside one another, each against the first neighbour that lies already.

    A panel is laid rigidly by its neighbour's own corners: by places that other panels gave, what
    is rounded would double from panel to panel.
    """
    sides: dict[tuple[int, int], list[int]] = {}
    for f, corners in enumerate(facets.tolist()):
        for k in range(4):
            edge = corners[k], corners[(k + 1) % 4]
            sides.setdefault((min(edge), max(edge)), []).append(f)
    flat = np.full((len(vertices), 2), np.nan)
    p, q = facets[0, :2].tolist()
    away = float(np.linalg.norm(vertices[q] - vertices[p]))
    waiting = deque([(0, p, q, np.zeros(2), np.array([away, 0.0]))])
    laid = np.zeros(len(facets), dtype=bool)
    laid[0] = True
    while waiting:
        f, p, q, from_p, to_q = waiting.popleft()
        corners = facets[f].tolist()
        own = _lay(vertices[corners], vertices[[p, q]], from_p, to_q)
        for v, place in zip(corners, own, strict=True):
            if np.isnan(flat[v, 0]):
                flat[v] = place
        for k in range(4):
            a, b = corners[k], corners[(k + 1) % 4]
            for beside in sides[min(a, b), max(a, b)]:
                if not laid[beside]:
                    laid[beside] = True
                    waiting.append((beside, b, a, own[(k + 1) % 4], own[k]))
    if not laid.all():
        raise ArgumentError("the panels of a sheet must hang together by their edges")
    return flat


def _lay(corners: Floats, edge: Floats, begin: Floats, end: Floats) -> Floats:
    """Corners (4, 3) of a panel laid to the left of an edge (2, 3), which lies between places."""
    space = edge[1] - edge[0]
    length = float(np.linalg.norm(space))
    along = (end - begin) / np.linalg.norm(end - begin)
    left = np.array([-along[1], along[0]])
    arms = corners - edge[0]
    reach = arms @ space / length
    aside = np.linalg.norm(np.cross(space, arms), axis=1) / length
    return np.asarray(begin + reach[:, None] * along + aside[:, None] * left)
