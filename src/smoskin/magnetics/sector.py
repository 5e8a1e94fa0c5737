"""Exact field of the four-sector centripetal disc magnet, and its gradient.

Decides how the field is integrated: each sector is uniformly magnetised, so only its curved
and its radial faces carry magnetic charge. The radial faces of neighbouring sectors merge into
two crossed rectangles of uniform charge (closed form); a curved face is a row of vertical line
charges (closed form) summed over the azimuth. Hides the symmetry folding, the choice of nodes
by nearness and the near-singular transform. Magnet frame: origin at the disc's centre, z its
axis, sectors between the azimuths 0, 90, 180 and 270 degrees; lengths inside are in radii.
"""

import math
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Bools, Floats, floats
from smoskin.design.skin import Magnet

VACUUM_PERMEABILITY: Final = 1.25663706127e-6
"""mu_0, T m/A (CODATA 2022)."""

_BLOCK: Final = 512
"""Points at a time, so that working arrays of nodes times points stay in the cache."""
_TOUCHING: Final = 1e-9
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


def field(magnet: Magnet, points: ArrayLike) -> Floats:
    """Flux density of the magnet, B, in its own frame.

    Parameters
    ----------
    magnet : Magnet
        The disc; its mount and corner play no part here.
    points : array_like, shape (..., 3)
        Points, m, from the disc's centre.

    Returns
    -------
    Floats, shape (..., 3)
        T. Inside the disc the magnetisation is included, on the plane between two sectors as
        their mean. On an outer surface the outer limit; on a sharp edge, where B has no limit,
        the value 1e-9 radii off it. NaN where a coordinate is not finite.

    Raises
    ------
    ArgumentError
        If `points` is not (..., 3).

    Notes
    -----
    Valid for all points, to 1.2e-7 of B; the recoil permeability is taken as one.
    """
    where = floats("points", points, (3,))
    sums, swapped = _potentials(magnet, where.reshape(-1, 3), rows=3)
    density = _density(magnet, sums, swapped, where.reshape(-1, 3))
    return density.reshape(where.shape)


def field_and_gradient(magnet: Magnet, points: ArrayLike) -> tuple[Floats, Floats]:
    """Flux density and its gradient, in the magnet's own frame.

    Parameters
    ----------
    magnet : Magnet
        The disc.
    points : array_like, shape (..., 3)
        Where, m, from the disc's centre.

    Returns
    -------
    density : Floats, shape (..., 3)
        B, T, as `field` gives it.
    gradient : Floats, shape (..., 3, 3)
        dB_i/dx_j at [..., i, j], T/m; symmetric and of zero trace.

    Raises
    ------
    ArgumentError
        If `points` is not (..., 3).

    Notes
    -----
    Valid as `field`, the gradient to 1e-6 of itself (4e-6 within 1e-6 radii of the rim).
    """
    where = floats("points", points, (3,))
    flat = where.reshape(-1, 3)
    sums, swapped = _potentials(magnet, flat, rows=8)
    density = _density(magnet, sums, swapped, flat)
    slope = _slope(magnet, sums, swapped, flat)
    return density.reshape(where.shape), slope.reshape(*where.shape, 3)


class _Nodes(NamedTuple):
    """Line charges that all points share."""

    place: Floats
    """(N, 2), radii."""
    square: Floats
    """(N, 1), distance from the axis squared."""
    moments: Floats
    """(6, N): charge q, then q X, q Y, q X X, q Y Y, q X Y."""


def _nodes(place: Floats, charge: Floats) -> _Nodes:
    """Shared line charges with their moments."""
    x, y = place.T
    moments = charge * np.stack([np.ones_like(x), x, y, x * x, y * y, x * y])
    return _Nodes(place, np.sum(place * place, axis=1, keepdims=True), moments)


@cache
def _gauss(count: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights on (-1, 1)."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nodes, weights


@cache
def _curved_nodes(count: int, sectors: tuple[int, ...]) -> _Nodes:
    """Gauss rule over the curved faces of these sectors."""
    nodes, weights = _gauss(count)
    offset = 0.25 * np.pi * nodes
    azimuth = np.concatenate([0.25 * np.pi * (1 + 2 * sector) + offset for sector in sectors])
    charge = np.tile(-np.cos(offset) * 0.25 * np.pi * weights, len(sectors))
    return _nodes(np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1), charge)


@cache
def _far_nodes() -> _Nodes:
    """Gauss rule over all faces, for points far away."""
    curved = _curved_nodes(8, (0, 1, 2, 3))
    nodes, weights = _gauss(8)
    still = np.zeros_like(nodes)
    place = np.concatenate(
        [curved.place, np.stack([nodes, still], axis=1), np.stack([still, nodes], axis=1)]
    )
    flat = math.sqrt(2.0) * weights
    return _nodes(place, np.concatenate([curved.moments[0], flat, flat]))


def _potentials(magnet: Magnet, flat: Floats, *, rows: int) -> tuple[Floats, Bools]:
    """Unit-charge sums at the points folded into 0 <= y <= x, 0 <= z.

    Rows are E_x, E_y, E_z and, where 8 are asked for, E_xx, E_yy, E_xy, E_xz, E_yz. The second
    result says where x and y were swapped.
    """
    half = 0.5 * magnet.height / magnet.radius
    finite = np.isfinite(flat).all(axis=1)
    size = np.where(finite, np.abs(flat.T) / magnet.radius, 0.0)
    swapped = size[1] > size[0]
    folded = np.stack([np.maximum(size[0], size[1]), np.minimum(size[0], size[1]), size[2]])
    up = size[2]
    radius = np.hypot(folded[0], folded[1])
    grazing = np.abs(radius - 1.0) < _TOUCHING
    folded[:2, grazing] *= (1.0 + _TOUCHING) / radius[grazing]
    radius[grazing] = 1.0 + _TOUCHING
    slab = up < half
    clear = np.where(slab, 0.0, up - half) ** 2
    nearness = np.sqrt(((radius - 1.0) ** 2 + clear) / ((radius + 1.0) ** 2 + clear))
    kind = np.searchsorted(_FLOORS, nearness, side="right") - 1
    kind[radius**2 + up**2 > _FAR**2] = len(_FLOORS)
    kind[slab] = ~kind[slab]

    sums = np.empty((rows, len(flat)))
    for one in np.unique(kind).tolist():
        (index,) = np.nonzero(kind == one)
        for start in range(0, len(index), _BLOCK):
            some = index[start : start + _BLOCK]
            point = folded[:, some]
            if one < 0:
                sums[:, some] = _sums(~one, point, nearness[some], half, True, rows)
            else:
                sums[:, some] = _sums(one, point, nearness[some], half, False, rows)
    # Inside, B = mu_0 (H + M); M of the folded sector points to the axis along its bisector.
    inside = slab & (radius < 1.0)
    sums[:2, inside] -= 4.0 * np.pi / math.sqrt(2.0)
    sums[:, ~finite] = np.nan
    return sums, swapped


def _sums(kind: int, point: Floats, nearness: Floats, half: float, slab: bool, rows: int) -> Floats:
    """All faces' charge at points of one kind of nearness, all beside the disc or all above."""
    if kind == len(_FLOORS):
        return _shared(_far_nodes(), point, half, slab, rows)
    total = _rectangles(point, half, slab, rows)
    if kind >= len(_SINH):
        count = _PLAIN[kind - len(_SINH)][1]
        total += _shared(_curved_nodes(count, (0, 1, 2, 3)), point, half, slab, rows)
    else:
        total += _shared(_curved_nodes(_OPPOSITE, (1, 2)), point, half, slab, rows)
        total += _nearest(_SINH[kind][1], point, nearness, half, slab, rows)
    return total


def _density(magnet: Magnet, sums: Floats, swapped: Bools, flat: Floats) -> Floats:
    """B (P, 3) from the folded sums; odd components vanish on their symmetry planes."""
    scale = VACUUM_PERMEABILITY * magnet.remanence * magnet.polarity / (4.0 * np.pi)
    density = np.empty_like(flat)
    density[:, 0] = np.where(swapped, sums[1], sums[0])
    density[:, 1] = np.where(swapped, sums[0], sums[1])
    density[:, 2] = sums[2]
    density *= scale * np.sign(flat)
    density += 0.0  # no negative zeros
    return density


def _slope(magnet: Magnet, sums: Floats, swapped: Bools, flat: Floats) -> Floats:
    """Gradient (P, 3, 3) from the folded sums."""
    scale = VACUUM_PERMEABILITY * magnet.remanence * magnet.polarity / (4.0 * np.pi)
    sign = np.sign(flat).T
    slope = np.empty((len(flat), 3, 3))
    slope[:, 0, 0] = np.where(swapped, sums[4], sums[3])
    slope[:, 1, 1] = np.where(swapped, sums[3], sums[4])
    slope[:, 2, 2] = -sums[3] - sums[4]
    slope[:, 0, 1] = slope[:, 1, 0] = sums[5] * sign[0] * sign[1]
    slope[:, 0, 2] = slope[:, 2, 0] = np.where(swapped, sums[7], sums[6]) * sign[0] * sign[2]
    slope[:, 1, 2] = slope[:, 2, 1] = np.where(swapped, sums[6], sums[7]) * sign[1] * sign[2]
    slope *= scale / magnet.radius
    return slope


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
    """Field of the line per unit of charge a length, `square` being d^2.

    Both forms of `across` are free of cancellation on their side of the line's upper end.
    """
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


def _nearest(
    count: int, point: Floats, nearness: Floats, half: float, slab: bool, rows: int
) -> Floats:
    """Curved faces from azimuth -90 to 90 degrees, nodes crowding at the point; (rows, P).

    In t = tan(half the azimuth from the point) all squared distances are quadratics over
    1 + t^2 with roots at +-i b or farther, which t = b sinh(s) moves to Im s = pi/2. Turning
    the point is turning the charge back: the slope along the circle is the field of the
    charge's own slope, which has no peak near the face for rounding and nodes to miss.
    """
    x, y, up = point
    radius = np.hypot(x, y)
    cos, sin = x / radius, y / radius
    start = y / (radius + x)
    knots = np.stack([-(1.0 + start) / (1.0 - start), -start, (1.0 - start) / (1.0 + start)])
    knots = np.arcsinh(knots / nearness)
    nodes, weights = _gauss(count)
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
    sums = np.empty((rows, len(x)))
    sums[0] = cos * polar[0] - sin * polar[1]
    sums[1] = sin * polar[0] + cos * polar[1]
    sums[2] = polar[2]
    if rows == 8:
        for end in (-1.0, 1.0):  # where the two sectors are cut from the others, charge steps
            line = _line(radius * radius + 1.0 - 2.0 * end * y, up, half, slab)
            polar[5] += end * root * line.across * (radius - end * sin)
            polar[6] -= root * line.across * cos
            polar[7] += end * root * line.along
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
    """Both crossed rectangles of charge sqrt(2), by their edges and corners; (rows, P).

    Row 0 of each array is the rectangle |x| < 1, |z| < half of the plane y = 0
    with u = x, w = y, v = z; row 1 that of the plane x = 0 with u = y, w = x.
    """
    floor = _TOUCHING**2
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
    sums[0] = eu[0] + ew[1]
    sums[1] = eu[1] + ew[0]
    sums[2] = ev[0] + ev[1]
    if rows == 8:
        # The slope of a sheet of charge is the field of line charges along its edges.
        f1 = _chord(d1, v1, v2, r11, r12)
        f2 = _chord(d2, v1, v2, r21, r22)
        h1 = _chord(e1, u1, u2, r11, r21)
        h2 = _chord(e2, u1, u2, r12, r22)
        uu = u1 * f1 - u2 * f2
        ww = v2 * h2 - v1 * h1 - uu
        uw = w * (f1 - f2)
        uv = 1.0 / r12 - 1.0 / r11 - 1.0 / r22 + 1.0 / r21
        vw = w * (h1 - h2)
        sums[3] = uu[0] + ww[1]
        sums[4] = uu[1] + ww[0]
        sums[5] = uw[0] + uw[1]
        sums[6] = uv[0] + vw[1]
        sums[7] = uv[1] + vw[0]
    sums *= math.sqrt(2.0)
    return sums


def _chord(square: Floats, a: Floats, b: Floats, ra: Floats, rb: Floats) -> Floats:
    """(a/ra - b/rb) / square for 0 < a > b, free of cancellation beyond the line's end."""
    beyond = (a * a - b * b) / (ra * rb * (a * rb + np.abs(b) * ra))
    return np.where(b < 0.0, (a / ra - b / rb) / square, beyond)
