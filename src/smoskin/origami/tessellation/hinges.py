"""Panels of a sheet as bars and hinges: fold angles, folding again, and what holds a sheet rigid.

A panel is split by its shorter diagonal. Fold angles are zero where flat and positive at valleys.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh, splu

from smoskin.arrays import Floats, Ints, cross
from smoskin.origami.tessellation.conditions import gather
from smoskin.origami.tessellation.unfold import lengths_of

_STEPS: Final = 12
"""Steps from flat to folded."""
_NEWTON: Final = 12
"""Gauss-Newton steps at each."""
_BAR: Final = 1e3
"""Weight of a bar's strain against the angle of a crease, rad."""
DENSE: Final = 200
"""Coordinates up to which singular values come from a dense decomposition."""
_PANEL: Final = 10.0
"""Weight of a panel's bend against the angle of a crease."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """Bars and hinges of a sheet."""

    bars: Ints
    """(B, 2): every edge once, then the shorter diagonal of each panel."""
    panels: Ints
    """(F, 4): ends of each panel's shorter diagonal, then the corners to its left and right."""
    creases: Ints
    """(C, 4): ends of each crease, then a corner to its left and one to its right."""


def frame_of(vertices: Floats, facets: Ints, creases: Ints) -> Frame:
    """Bars and hinges of panels (F, 4) and creases (C, 2); lengths tell the shorter diagonal."""
    p, q, r, s = facets.T
    first = np.linalg.norm(vertices[p] - vertices[r], axis=1)
    second = np.linalg.norm(vertices[q] - vertices[s], axis=1)
    shorter = (first <= second)[:, None]
    # Counter-clockwise p q r s: to the left of p -> r lies s, to the left of q -> s lies p.
    panels = np.where(shorter, np.stack([p, r, s, q], 1), np.stack([q, s, p, r], 1))
    sides = np.concatenate([facets[:, [k, (k + 1) % 4]] for k in range(4)])
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    # A triangle's third corner, by its directed edges.
    start, end, left, right = panels.T
    triangles = np.concatenate([np.stack([start, end, left], 1), np.stack([end, start, right], 1)])
    turned = np.concatenate([np.roll(triangles, -k, axis=1) for k in range(3)])
    third = {(a, b): c for a, b, c in turned.tolist()}
    wings = [[third[a, b], third[b, a]] for a, b in creases.tolist()]
    return Frame(
        bars=np.concatenate([edges, panels[:, :2]]),
        panels=panels,
        creases=np.concatenate([creases, np.array(wings, dtype=np.int64).reshape(-1, 2)], axis=1),
    )


def fold_angles(vertices: Floats, hinges: Ints) -> Floats:
    """Angle of each hinge (H, 4), rad, in (-pi, pi]."""
    axis, _, _, left, right = _arms(vertices, hinges)
    along = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    # Normals of a flat hinge agree; at a valley the left one leans to the right.
    sine = (cross(right, left) * along).sum(1)
    return np.asarray(np.arctan2(sine, (left * right).sum(1)))


def fold_slopes(vertices: Floats, hinges: Ints) -> sparse.csr_array:
    """Derivatives of the fold angles by the coordinates, (H, 3 V)."""
    axis, b, c, left, right = _arms(vertices, hinges)
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    by_left = length * left / (left**2).sum(1, keepdims=True)
    by_right = length * right / (right**2).sum(1, keepdims=True)
    beta = (b * axis).sum(1, keepdims=True) / length**2
    gamma = (c * axis).sum(1, keepdims=True) / length**2
    by_end = -beta * by_left - gamma * by_right
    parts = np.stack([-by_left - by_right - by_end, by_end, by_left, by_right], axis=1)
    return gather(hinges, parts, len(vertices))


def _arms(vertices: Floats, hinges: Ints) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Axis and wings from the axis' start, and the normals of both sides, which point up."""
    start = vertices[hinges[:, 0]]
    axis, b, c = (vertices[hinges[:, k]] - start for k in (1, 2, 3))
    return axis, b, c, cross(axis, b), cross(c, axis)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Folding:
    """A sheet on its way from flat to folded."""

    steps: Floats
    """(S, V, 3), m: places at every step; the first is flat."""
    strain: float
    """Largest strain of a bar on the way."""
    twist: float
    """Largest bend of a panel about its shorter diagonal on the way, rad."""


def fold(flat: Floats, frame: Frame, angles: Floats) -> Folding:
    """Fold a flat pattern (V, 2) to the angles of its creases (C,), rad.

    The tangents of half the angles grow together, as those of a sheet that folds flat do. Lengths
    and angles are all that is known; places are those of least squares, from step to step.
    """
    places = np.pad(flat, ((0, 0), (0, 1)))
    lengths = np.linalg.norm(places[frame.bars[:, 0]] - places[frame.bars[:, 1]], axis=1)
    steps, strain, twist = [places], 0.0, 0.0
    for k in range(_STEPS):
        aim = 2 * np.arctan((k + 1) / _STEPS * np.tan(angles / 2))
        for _ in range(_NEWTON):
            motion = _towards(places, frame, lengths, aim)
            places = places + motion
            if np.abs(motion).max() < 1e-9:
                break
        steps.append(places)
        spans = np.linalg.norm(places[frame.bars[:, 0]] - places[frame.bars[:, 1]], axis=1)
        strain = max(strain, float(np.abs(spans / lengths - 1).max()))
        twist = max(twist, float(np.abs(fold_angles(places, frame.panels)).max()))
    return Folding(steps=np.array(steps), strain=strain, twist=twist)


def laid_onto(places: Floats, aim: Floats) -> Floats:
    """Places (V, 3) moved as a rigid body, nearest to others in the sense of least squares."""
    arms = places - places.mean(axis=0)
    left, _, right = np.linalg.svd(arms.T @ (aim - aim.mean(axis=0)))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    return np.asarray(arms @ (left @ mirror @ right) + aim.mean(axis=0))


def _towards(places: Floats, frame: Frame, lengths: Floats, aim: Floats) -> Floats:
    """Gauss-Newton's step towards lengths, plane panels and fold angles."""
    spans = places[frame.bars[:, 0]] - places[frame.bars[:, 1]]
    now = np.linalg.norm(spans, axis=1)
    units = spans / now[:, None]
    bars = gather(frame.bars, np.stack([units, -units], axis=1), len(places))
    slopes = sparse.vstack(
        [
            sparse.diags_array(_BAR / lengths) @ bars,
            _PANEL * fold_slopes(places, frame.panels),
            fold_slopes(places, frame.creases),
        ]
    ).tocsr()
    residuals = np.concatenate(
        [
            _BAR * (now / lengths - 1),
            _PANEL * fold_angles(places, frame.panels),
            fold_angles(places, frame.creases) - aim,
        ]
    )
    scale = float(lengths.mean())
    system: Any = (slopes.T @ slopes + 1e-9 / scale**2 * sparse.eye_array(places.size)).tocsc()
    factor = splu(
        system,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    motion = -factor.solve(slopes.T @ residuals)
    longest = float(np.abs(motion).max())
    return (motion * min(1.0, 0.5 * scale / max(longest, 1e-300))).reshape(places.shape)


def rigid_modes(vertices: Floats, facets: Ints, count: int = 2) -> tuple[Floats, Floats]:
    """How stiffly panels hold a sheet: lowest singular values, ascending, and their motions.

    Rows are the panels' edges and diagonals, each stretched by unit motions, and the distances of
    diagonals, by which panels would warp; the six rigid motions are left out. Zero is a motion that
    folds creases alone. Motions are (count, V, 3), of length 1.
    """
    pairs = lengths_of(facets)
    units = vertices[pairs[:, 0]] - vertices[pairs[:, 1]]
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    bars = gather(pairs, np.stack([units, -units], axis=1), len(vertices))
    rows: Any = sparse.vstack([bars, _warp_slopes(vertices, facets)]).tocsr()
    rigid = rigid_motions(vertices)
    if vertices.size <= DENSE:
        whole = rows.toarray() @ (np.eye(vertices.size) - rigid @ rigid.T)
        _, values, motions = np.linalg.svd(whole, full_matrices=len(whole) < vertices.size)
        values = np.pad(values, (0, vertices.size - len(values)))  # fewer rows than coordinates
        order = np.argsort(values)[6 : 6 + count]
        return values[order], motions[order].reshape(count, -1, 3)
    stiff: Any = (rows.T @ rows).tocsc()
    _, vectors = eigsh(stiff, k=6 + count, sigma=-1e-9, v0=np.ones(vertices.size))
    free, _ = np.linalg.qr(vectors - rigid @ (rigid.T @ vectors))
    _, values, turns = np.linalg.svd(rows @ free, full_matrices=False)
    motions = (free @ turns.T).T
    apart = np.linalg.norm(rigid.T @ motions.T, axis=0) < 0.5
    order = np.flatnonzero(apart)[np.argsort(values[apart])][:count]
    return values[order], motions[order].reshape(count, -1, 3)


def _warp_slopes(vertices: Floats, facets: Ints) -> sparse.csr_array:
    """Derivatives of the distance of each panel's diagonals, (F, 3 V)."""
    p, q, r, s = (vertices[facets[:, k]] for k in range(4))
    normal = np.cross(r - p, s - q)
    area = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / area
    # Shares at which plane diagonals cross: p + x (r - p) = q + y (s - q).
    x = (np.cross(q - p, s - q) * normal).sum(1, keepdims=True) / area
    y = (np.cross(q - p, r - p) * normal).sum(1, keepdims=True) / area
    parts = np.stack([(1 - x) * normal, (y - 1) * normal, x * normal, -y * normal], axis=1)
    return gather(facets, parts, len(vertices))


def rigid_motions(vertices: Floats) -> Floats:
    """Three shifts and three turns, (3 V, 6), orthonormal."""
    arms = vertices - vertices.mean(axis=0)
    turns = [np.cross(axis, arms).ravel() for axis in np.eye(3)]
    shifts = [np.tile(axis, len(vertices)) for axis in np.eye(3)]
    return np.asarray(np.linalg.qr(np.stack([*shifts, *turns], axis=1))[0])
