"""Field of the magnetic charges on the faces of a disc of four sectors, for points in one octant.

Decides how E = sum of q d / |d|^3 is integrated: neighbouring radial faces merge into two crossed
rectangles (closed form); a curved face is a row of vertical line charges (closed form) over the
azimuth. Lengths are in radii; a point lies in 0 <= y <= x, 0 <= z; `half` is half the disc's
height, and `slab` says that all points lie beside the disc, not above it.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats, Ints

TOUCHING: Final = 1e-9
"""Radii: nearer to the curved face or to an edge than this counts as this far outside it."""
_FAR: Final = 6.0
"""Radii from the centre beyond which rectangles too are summed, free of cancellation."""
_SINH: Final = ((0.0, 110), (3e-5, 70), (1e-3, 44), (0.01, 28), (0.1, 16))
"""(least nearness b, Gauss nodes) of each of the two nearest sectors, B then good to 1e-7."""
_PLAIN: Final = ((0.30, 16), (0.45, 11), (0.60, 8))
"""(least nearness b, Gauss nodes a sector) where the plain rule converges as well."""
_FLOORS: Final = tuple(floor for floor, _ in _SINH + _PLAIN)
_OPPOSITE: Final = 10
"""Gauss nodes of each of the other two sectors, never nearer than an eighth of a turn."""


def kinds(nearness: Floats, squared: Floats) -> Ints:
    """Rule of integration for points of this nearness and squared distance from the centre."""
    rule = np.searchsorted(_FLOORS, nearness, side="right") - 1
    rule[squared > _FAR**2] = len(_FLOORS)
    return rule


def sums(kind: int, point: Floats, nearness: Floats, half: float, slab: bool, rows: int) -> Floats:
    """Sums over the charge of all faces at points of one kind, all beside the disc or all above.

    Rows are E_x, E_y, E_z and, where 8 are asked for, E_xx, E_yy, E_xy, E_xz, E_yz; (rows, P).
    """
    if kind == len(_FLOORS):
        return _shared(_far_nodes(), point, half, slab, rows)
    total = _rectangles(point, half, slab, rows)
    if kind >= len(_SINH):
        count = _PLAIN[kind - len(_SINH)][1]
        total += _shared(_curved_nodes(count), point, half, slab, rows)
    else:
        total += _shared(_curved_nodes(_OPPOSITE, (1, 2)), point, half, slab, rows)
        total += _nearest(_SINH[kind][1], point, nearness, half, slab, rows)
    return total


def curved_lines(count: int, sectors: Sequence[int] = range(4)) -> tuple[Floats, Floats]:
    """Gauss rule over curved faces of sectors: places of lines (N, 2) and their charges (N,)."""
    nodes, weights = gauss(count)
    offset = 0.25 * np.pi * nodes
    azimuth = np.concatenate([0.25 * np.pi * (1 + 2 * sector) + offset for sector in sectors])
    charge = np.tile(-np.cos(offset) * 0.25 * np.pi * weights, len(sectors))
    return np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1), charge


def plane_lines(count: int) -> tuple[Floats, Floats]:
    """Gauss rule over both rectangles of radial faces, as `curved_lines`."""
    nodes, weights = gauss(count)
    still = np.zeros_like(nodes)
    place = np.concatenate([np.stack([nodes, still], axis=1), np.stack([still, nodes], axis=1)])
    return place, math.sqrt(2.0) * np.tile(weights, 2)


@cache
def gauss(count: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights on (-1, 1)."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nodes, weights


class _Nodes(NamedTuple):
    """Line charges that all points share."""

    place: Floats
    """(N, 2), radii."""
    square: Floats
    """(N, 1), distance from the axis squared."""
    moments: Floats
    """(6, N): charge q, then q X, q Y, q X X, q Y Y, q X Y."""


def _nodes(*lines: tuple[Floats, Floats]) -> _Nodes:
    """Shared line charges with their moments."""
    place, charge = (np.concatenate(parts) for parts in zip(*lines, strict=True))
    x, y = place.T
    moments = charge * np.stack([np.ones_like(x), x, y, x * x, y * y, x * y])
    return _Nodes(place, np.sum(place * place, axis=1, keepdims=True), moments)


@cache
def _curved_nodes(count: int, sectors: tuple[int, ...] = (0, 1, 2, 3)) -> _Nodes:
    """Nodes of the curved faces of these sectors."""
    return _nodes(curved_lines(count, sectors))


@cache
def _far_nodes() -> _Nodes:
    """Nodes of all faces, for points far away."""
    return _nodes(curved_lines(8), plane_lines(8))


class _Line(NamedTuple):
    """A vertical line charge -half..half, seen from distance d and height `up`."""

    v1: Floats
    """up + half."""
    v2: Floats
    """|up - half|."""
    s1: Floats
    """d^2 + v1^2; s2 likewise."""
    s2: Floats
    r1: Floats
    """Distance to the lower end; r2 to the upper."""
    r2: Floats
    along: Floats
    """E_z = 1/r2 - 1/r1."""
    across: Floats
    """E_d / d = (v1/r1 -+ v2/r2) / d^2."""


def _line(square: Floats, up: Floats, half: float, slab: bool) -> _Line:
    """Field of the line per unit of charge a length, `square` being d^2."""
    # Both forms of `across` are free of cancellation on their side of the line's upper end.
    v1 = up + half
    v2 = np.abs(up - half)
    s1 = square + v1 * v1
    s2 = square + v2 * v2
    r1 = np.sqrt(s1)
    r2 = np.sqrt(s2)
    mixed = v1 * r2
    mixed += v2 * r1
    total = r1 + r2
    along = r1 * r2
    along *= total
    span = 4.0 * half * up
    if slab:
        along *= square
        np.divide(1.0, along, out=along)
        across = mixed
        across *= total
        across *= along
        along *= square
        along *= span
    else:
        along *= mixed
        np.divide(span, along, out=along)
        across = total
        across *= along
        along *= mixed
    return _Line(v1, v2, s1, s2, r1, r2, along, across)


def _shared(nodes: _Nodes, point: Floats, half: float, slab: bool, rows: int) -> Floats:
    """Line charges that all points share, summed; (rows, P)."""
    x, y, up = point
    square = (-2.0 * nodes.place) @ point[:2]
    square += nodes.square
    square += x * x + y * y
    line = _line(square, up, half, slab)
    sums = np.empty((rows, len(x)))
    f, fx, fy = nodes.moments[:3] @ line.across
    sums[0] = x * f - fx
    sums[1] = y * f - fy
    sums[2] = nodes.moments[0] @ line.along
    if rows == 3:
        return sums
    c1 = 1.0 / (line.s1 * line.r1)
    c2 = 1.0 / (line.s2 * line.r2)
    if slab:
        spread = -(2.0 * line.across + line.v1 * c1 + line.v2 * c2) / square
    else:
        mixed = line.r1 * line.r2 * (line.v1 * line.r2 + line.v2 * line.r1)
        spread = 1.0 / line.s1 + 1.0 / line.s2
        spread += (line.v1 * line.r1 + line.v2 * line.r2) / mixed
        spread *= -line.across
    s, sx, sy, sxx, syy, sxy = nodes.moments @ spread
    sums[3] = f + x * x * s - 2.0 * x * sx + sxx
    sums[4] = f + y * y * s - 2.0 * y * sy + syy
    sums[5] = x * y * s - x * sy - y * sx + sxy
    h, hx, hy = nodes.moments[:3] @ (c1 - c2)
    sums[6] = x * h - hx
    sums[7] = y * h - hy
    return sums


# In t = tan(half the azimuth from the point) all squared distances are quadratics over
# 1 + t^2 with roots at +-i b or farther, which t = b sinh(s) moves to Im s = pi/2. Turning
# the point is turning the charge back: the slope along the circle is the field of the
# charge's own slope, which has no peak near the face for rounding and nodes to miss.
def _nearest(
    count: int, point: Floats, nearness: Floats, half: float, slab: bool, rows: int
) -> Floats:
    """Curved faces from azimuth -90 to 90 degrees, nodes crowding at the point; (rows, P)."""
    x, y, up = point
    radius = np.hypot(x, y)
    cos, sin = x / radius, y / radius
    start = y / (radius + x)
    knots = np.stack([-(1.0 + start) / (1.0 - start), -start, (1.0 - start) / (1.0 + start)])
    knots = np.arcsinh(knots / nearness)
    nodes, weights = gauss(count)
    root = math.sqrt(0.5)
    gap = radius - 1.0
    polar = np.zeros((3 if rows == 3 else 8, len(x)))
    for low, high, even, odd in (
        (knots[0], knots[1], root * (cos - sin), root * (sin + cos)),
        (knots[1], knots[2], root * (cos + sin), root * (sin - cos)),
    ):
        reach = 0.5 * (high - low)
        grown = np.exp(0.5 * (high + low) + reach * nodes[:, None])
        shrunk = 1.0 / grown
        t = (0.5 * nearness) * (grown - shrunk)
        measure = (grown + shrunk) * weights[:, None]
        measure *= nearness * reach
        tt = t * t
        q = 1.0 / (1.0 + tt)
        measure *= q
        cosine = (1.0 - tt) * q
        sine = 2.0 * t * q
        line = _line((gap * gap + (radius + 1.0) ** 2 * tt) * q, up, half, slab)
        out = gap + t * sine
        charge = (odd * sine - even * cosine) * measure
        across = charge * line.across
        polar[0] += np.sum(across * out, axis=0)
        polar[1] -= np.sum(across * sine, axis=0)
        polar[2] += np.sum(charge * line.along, axis=0)
        if rows == 8:
            c1 = charge / (line.s1 * line.r1)
            c2 = charge / (line.s2 * line.r2)
            polar[3] += np.sum(out * (c1 - c2), axis=0)
            polar[4] += np.sum(line.v1 * c1 + (line.v2 if slab else -line.v2) * c2, axis=0)
            charge = (even * sine + odd * cosine) * measure
            across = charge * line.across
            polar[5] += np.sum(across * out, axis=0)
            polar[6] -= np.sum(across * sine, axis=0)
            polar[7] += np.sum(charge * line.along, axis=0)
    if rows == 8:
        polar[5:] += _steps_of_charge(point, half, slab)
    return _from_polar(polar, cos, sin, radius)


def _steps_of_charge(point: Floats, half: float, slab: bool) -> Floats:
    """Slope along the circle by the two sectors' ends, where charge steps; polar, (3, P)."""
    x, y, up = point
    radius = np.hypot(x, y)
    cos, sin = x / radius, y / radius
    root = math.sqrt(0.5)
    polar = np.zeros((3, len(x)))
    for end in (-1.0, 1.0):
        line = _line(radius * radius + 1.0 - 2.0 * end * y, up, half, slab)
        polar[0] += end * root * line.across * (radius - end * sin)
        polar[1] -= root * line.across * cos
        polar[2] += end * root * line.along
    return polar


def _from_polar(polar: Floats, cos: Floats, sin: Floats, radius: Floats) -> Floats:
    """Sums along x, y, z from those outwards, along the circle and along z."""
    # Rows of polar: E_o, E_t, E_z; then dE_o/dz, dE_z/dz and the field, outwards, along the circle
    # and along z, of the charge's own slope along the circle.
    sums = np.empty_like(polar)
    sums[0] = cos * polar[0] - sin * polar[1]
    sums[1] = sin * polar[0] + cos * polar[1]
    sums[2] = polar[2]
    if len(polar) == 8:
        ot = (polar[5] - polar[1]) / radius
        tt = (polar[6] + polar[0]) / radius
        tz = polar[7] / radius
        oz, zz = polar[3], polar[4]
        oo = -tt - zz
        sums[3] = cos * cos * oo - 2.0 * sin * cos * ot + sin * sin * tt
        sums[4] = sin * sin * oo + 2.0 * sin * cos * ot + cos * cos * tt
        sums[5] = sin * cos * (oo - tt) + (cos * cos - sin * sin) * ot
        sums[6] = cos * oz - sin * tz
        sums[7] = sin * oz + cos * tz
    return sums


def _rectangles(point: Floats, half: float, slab: bool, rows: int) -> Floats:
    """Both crossed rectangles of charge sqrt(2), by their edges and corners; (rows, P)."""
    # Row 0 of each array is the rectangle |x| < 1, |z| < half of the plane y = 0
    # with u = x, w = y, v = z; row 1 that of the plane x = 0 with u = y, w = x.
    floor = TOUCHING**2
    u, w, v = point[:2], point[1::-1], point[2]
    ww = w * w
    u1, u2, v1, v2 = u + 1.0, u - 1.0, v + half, v - half
    d1 = u1 * u1 + ww
    d2 = np.maximum(u2 * u2 + ww, floor)
    e1 = v1 * v1 + ww
    e2 = np.maximum(v2 * v2 + ww, floor)
    v1v1, v2v2 = v1 * v1, v2 * v2
    r11 = np.sqrt(d1 + v1v1)
    r12 = np.sqrt(d1 + v2v2)
    r21 = np.sqrt(d2 + v1v1)
    r22 = np.sqrt(d2 + v2v2)
    # asinh(a/d) - asinh(b/d) as one logarithm without cancellation, whatever the sign of b.
    ratio = (r21 + v1) / (r11 + v1)
    size = np.abs(v2)
    if slab:
        ratio *= (r22 + size) * d1 / ((r12 + size) * d2)
    else:
        ratio *= (r12 + size) / (r22 + size)
    eu = np.log(ratio)
    size = np.abs(u2)
    far, near = r21 + size, r22 + size
    ratio = np.where(u2 < 0.0, near * e1 / (far * e2), far / near)
    ratio *= (r12 + u1) / (r11 + u1)
    ev = np.log(ratio)
    ew = np.arctan2(u1 * v1, w * r11)
    ew -= np.arctan2(u1 * v2, w * r12)
    ew -= np.arctan2(u2 * v1, w * r21)
    ew += np.arctan2(u2 * v2, w * r22)
    sums = np.empty((rows, len(v)))
    sums[:3] = eu[0] + ew[1], eu[1] + ew[0], ev[0] + ev[1]
    if rows == 8:
        # The slope of a sheet of charge is the field of line charges along its edges.
        u_edges = _chord(d1, v1, v2, r11, r12), _chord(d2, v1, v2, r21, r22)
        v_edges = _chord(e1, u1, u2, r11, r21), _chord(e2, u1, u2, r12, r22)
        uu = u1 * u_edges[0] - u2 * u_edges[1]
        ww = v2 * v_edges[1] - v1 * v_edges[0] - uu
        uw = w * (u_edges[0] - u_edges[1])
        uv = 1.0 / r12 - 1.0 / r11 - 1.0 / r22 + 1.0 / r21
        vw = w * (v_edges[0] - v_edges[1])
        sums[3:] = uu[0] + ww[1], uu[1] + ww[0], uw[0] + uw[1], uv[0] + vw[1], uv[1] + vw[0]
    sums *= math.sqrt(2.0)
    return sums


def _chord(square: Floats, a: Floats, b: Floats, ra: Floats, rb: Floats) -> Floats:
    """(a/ra - b/rb) / square for 0 < a > b, free of cancellation beyond the line's end."""
    beyond = (a * a - b * b) / (ra * rb * (a * rb + np.abs(b) * ra))
    return np.where(b < 0.0, (a / ra - b / rb) / square, beyond)
