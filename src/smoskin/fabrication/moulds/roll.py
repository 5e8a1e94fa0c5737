"""Wide parts rolled on to a limb, and laid flat again for pictures.

Decides that all of them are cut into flat strips at the same angles, so that parts that lie on each
other share their facets and no part of one sticks into the other.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.fabrication.moulds.solids import Part
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import level_of

STRIP: Final = 2.5e-3
"""m: width of a strip on the developed surface; a facet lies 0.01 mm under the reference limb's."""
_FLAT: Final = 1e-9
"""m: edges within a facet that depart less from it are left out."""
_ON: Final = 1e-10
"""m: distance at which a point lies on a strip's edge."""


def rolled(design: SkinDesign, part: Part, level: float | None = None) -> Part:
    """A part that was drawn flat, its lengths true at a level, as it lies on the limb."""
    if design.limb is None:
        return part
    at, roll = level_of(design) if level is None else level, geometry(design).roll
    vertices, triangles = _mesh(part.solid)
    arcs = roll.from_flat(vertices[:, :2], at)[:, 1] - roll.middle
    steps = STRIP * np.arange(np.ceil(arcs.min() / STRIP), np.floor(arcs.max() / STRIP) + 1)
    vertices, triangles = cut_across(vertices, triangles, _generators(design, steps, at))
    places = vertices.copy()
    places[:, :2] = roll.from_flat(vertices[:, :2], at)
    # Between two edges of a strip points lie on the chord.
    strip = np.floor((places[:, 1] - roll.middle) / STRIP)
    share = (places[:, 1] - roll.middle) / STRIP - strip
    ends = []
    for more in (0, 1):
        places[:, 1] = roll.middle + STRIP * (strip + more)
        ends.append(roll.places(places))
    on_chords = ends[0] + share[:, None] * (ends[1] - ends[0])
    solid = _solid(on_chords, triangles).simplify(_FLAT)
    return replace(part, solid=solid, slabs=(), pose=None)


def _generators(design: SkinDesign, arcs: Floats, level: float) -> Floats:
    """Lines (L, 3), m, that lie along the limb so far from the middle of y, of a flat layer.

    Places (x, y) are ``a x + b y + c`` to the left of a line (a, b, c).
    """
    roll = geometry(design).roll
    y = roll.middle + arcs
    turn = roll.flat_turn(y)
    place = roll.flat(np.stack([np.full(len(y), roll.along), y], axis=-1), level)
    across = np.stack([-np.sin(turn), np.cos(turn)], axis=-1)
    return np.concatenate([across, -(across * place).sum(axis=1)[:, None]], axis=1)


def developed(design: SkinDesign, part: Part) -> Part:
    """A part as it would stand on a plane: x, arc on the bottom vertices' surface, height."""
    if design.limb is None:
        return part
    vertices, triangles = _mesh(part.solid)
    solid = _solid(geometry(design).roll.developed(vertices), triangles)
    return replace(part, solid=solid, slabs=(), pose=None)


def cut_across(vertices: Floats, triangles: Ints, lines: Floats) -> tuple[Floats, Ints]:
    """A closed mesh with edges along the upright planes of lines (L, 3), its shape unchanged.

    Places to the left of a line (a, b, c), a^2 + b^2 = 1, lie ``a x + b y + c`` m from it.
    """
    for line in _halving(list(lines)):
        away = vertices[:, :2] @ line[:2] + line[2]
        sides = np.where(np.abs(away) < _ON, 0, np.sign(away)).astype(int)
        own = sides[triangles]
        crossed = (own.min(axis=1) < 0) & (own.max(axis=1) > 0)
        if not crossed.any():
            continue
        # The corner that is alone on its side, or lies in the plane, comes first.
        own, there = own[crossed], triangles[crossed]
        apart = np.where((own == 0).any(axis=1), 0, -own.sum(axis=1))
        first = (own == apart[:, None]).argmax(axis=1)
        a, b, c = np.take_along_axis(there, (first[:, None] + np.arange(3)) % 3, axis=1).T
        within = apart == 0
        pairs = np.concatenate(
            [
                np.stack([np.where(within, b, a), np.where(within, c, b)], axis=1),
                np.stack([a, c], axis=1)[~within],
            ]
        )
        edges, which = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
        which = which.reshape(-1) + len(vertices)
        start, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
        from_start, from_end = away[edges].T
        share = from_start / (from_start - from_end)
        new = start + share[:, None] * (end - start)
        m, n = which[: len(a)], which[len(a) :]
        lone = ~within
        pieces = [
            np.stack([a, b, m], axis=1)[within],
            np.stack([a, m, c], axis=1)[within],
            np.stack([a[lone], m[lone], n], axis=1),
            np.stack([m, b, c], axis=1)[lone],
            np.stack([m[lone], c[lone], n], axis=1),
        ]
        vertices = np.concatenate([vertices, new])
        triangles = np.concatenate([triangles[~crossed], *pieces])
    return vertices, triangles


def _halving(lines: list[Floats]) -> list[Floats]:
    """Lines in such an order that no triangle is cut by many: the middle one, then each half."""
    middle = len(lines) // 2
    if not lines:
        return []
    return [lines[middle], *_halving(lines[:middle]), *_halving(lines[middle + 1 :])]


def _mesh(solid: Any) -> tuple[Floats, Ints]:
    """Vertices (K, 3), m, and triangles of a solid."""
    mesh = solid.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, dtype=np.int64)


def _solid(vertices: Floats, triangles: Ints) -> Any:
    """The solid within a closed mesh."""
    from manifold3d import Manifold, Mesh64

    return Manifold(Mesh64(vertices, triangles.astype(np.uint64)))
