"""What chips read under one touch or two, one reading at a time and fast, with slopes.

Gives the answers of `ResponseTable.signals` and `together` at one temperature of the rubber, with
the derivatives that a descent needs. Decides nothing; hides in which order coefficients lie so
that the few which a touch needs stand together.
"""

import math
from bisect import bisect_left, bisect_right

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.magnetics.nonlinearity import cross_matrix
from smoskin.sensing.response.basis import TouchBasis
from smoskin.sensing.response.pairs import coupled_with_slopes, held


class PointTable:
    """Signals s of one touch, and ``s_1 + s_2 + kappa(s_1, s_2) + f_1 Q f_2`` of two straight ones.

    Coefficients (P, Q, D, C) of s, T/N^k, are at the rubber's temperature; grip, curvature and
    coupling are as `smoskin.sensing.response.table.ResponseTable` has them.
    """

    def __init__(
        self,
        basis: TouchBasis,
        coefficients: Floats,
        grip: Floats,
        curvature: Floats,
        coupling: Floats | None = None,
    ) -> None:
        self.basis = basis
        self._coefficients, self._grip, self._curvature = coefficients, grip, curvature
        self._coupling = coupling
        self._lines = PointLine(basis.lines_x, basis.radius), PointLine(basis.lines_y, basis.radius)
        # Vertices and products of neighbours in turn: what a touch needs stands together.
        orders = [_in_turn(len(line)) for line in (basis.lines_x, basis.lines_y)]
        p, q, *_ = coefficients.shape
        self._block = np.ascontiguousarray(coefficients[np.ix_(*orders)].reshape(p, q, -1))
        # Which powers make each product and its slopes by each force, and their factors.
        e = basis.exponents
        lower = np.maximum(e - np.eye(3, dtype=np.int64)[:, None], 0)
        self._orders = np.arange(e.max() + 1.0)
        powers = np.concatenate([e[None], lower]) + len(self._orders) * np.arange(3)
        self._powers = np.ascontiguousarray(np.moveaxis(powers, -1, 0))
        self._factors = np.concatenate([np.ones((1, len(e))), e.T])

    def at(self, x: float, y: float, force: Floats) -> tuple[Floats, Floats]:
        """Signals (C,) and their slopes by x, y, Fx, Fy, Fz, (5, C)."""
        (i, phi), (j, psi) = self._lines[0].near(x), self._lines[1].near(y)
        a, b, d = phi.shape[1], psi.shape[1], len(self.basis.exponents)
        part = self._block[2 * i : 2 * i + a, 2 * j : 2 * j + b].reshape(a, -1)
        here, steep = (phi @ part).reshape(2, b, -1)
        value, by_y = (psi @ here).reshape(2, d, -1)
        by_x = (psi[0] @ steep).reshape(d, -1)
        powers = (force[:, None] ** self._orders).ravel()
        g = self._factors * powers[self._powers].prod(axis=0)
        both = g @ value
        out = np.empty((5, both.shape[1]))
        out[0], out[1], out[2:] = g[0] @ by_x, g[0] @ by_y, both[1:]
        return both[0], out

    def scan(self, x: Floats, y: Floats, force: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) and slopes (B, 5, C) at many places under one force."""
        return self.basis.sums_and_slopes(
            self._coefficients, np.stack([x, y], axis=-1), np.broadcast_to(force, (len(x), 3))
        )

    def pair(self, place: Floats, press: Floats) -> tuple[Floats, Floats]:
        """Signals (C,) of touches at (2, 2), m, that press with (2,), N, positive, at once.

        With their slopes by x, y and the press of each, (6, C), T/m and T/N.
        """
        rates = np.array([self._shares(x, y) for x, y in place.tolist()])
        by = held(self._grip, rates[None], press[None])
        drags = by.together - by.alone
        by_drags = (by.together_slopes - by.alone_slopes).reshape(6, 2, 2)
        values, slopes = [], []
        for k in (0, 1):
            force = np.array([*drags[0, k], -press[k]])
            signals, steep = self.at(float(place[k, 0]), float(place[k, 1]), force)
            values.append(signals)
            slopes.append(by_drags[:, k] @ steep[2:4])
            slopes[k][3 * k : 3 * k + 2] += steep[:2]
            slopes[k][3 * k + 2] -= steep[4]
        one, other = values
        by_one = cross_matrix(self._curvature, other)
        by_other = cross_matrix(self._curvature.swapaxes(1, 2), one)
        total = one + other + one @ by_one
        steep = slopes[0] + slopes[0] @ by_one + slopes[1] + slopes[1] @ by_other
        if self._coupling is None:
            return total, steep
        forces = np.concatenate([by.together[0], press[:, None]], axis=1)
        by_forces = np.zeros((6, 2, 3))
        by_forces[..., :2] = by.together_slopes.reshape(6, 2, 2)
        by_forces[[2, 5], [0, 1], 2] = 1.0
        more, steeper = coupled_with_slopes(self._coupling, rates, forces, by_forces)
        return total + more, steep + steeper

    def _shares(self, x: float, y: float) -> Floats:
        """Shares of the vertices and their slopes along x and y, (3, H)."""
        on_x, on_y = self._lines[0].shares(x), self._lines[1].shares(y)
        return (on_x[[0, 1, 0], :, None] * on_y[[0, 0, 1], None, :]).reshape(3, -1)


class PointLine:
    """The functions along one axis with these vertices (N,), m, for one place at a time."""

    def __init__(self, lines: Floats, radius: float) -> None:
        self._lines: list[float] = lines.tolist()
        self._pitch: list[float] = np.diff(lines).tolist()
        self._radius = radius

    def near(self, x: float) -> tuple[int, Floats]:
        """First of the n vertices that a touch at `x` loads, and the functions of them.

        These are shares and products of neighbours in turn, and their slopes, (2, 2 n - 1). Plain
        numbers start faster than arrays.
        """
        lines, radius = self._lines, self._radius
        if len(lines) == 1:
            return 0, np.array([[1.0], [0.0]])
        first = min(max(bisect_right(lines, x - radius) - 1, 0), len(lines) - 2)
        last = max(min(bisect_left(lines, x + radius), len(lines) - 1), first + 1)
        # Before the first ramps are straight, at the last none has begun; so it is at the end
        # vertices, which carry on as levers.
        ramp, slope = x - lines[first], 1.0
        shares, slopes = [1.0], [0.0]
        for k in range(first, last):
            next_ramp, next_slope = (
                _point_ramp(x - lines[k + 1], radius) if k + 1 < last else (0.0, 0.0)
            )
            rise = (ramp - next_ramp) / self._pitch[k]
            tilt = (slope - next_slope) / self._pitch[k]
            shares[-1] -= rise
            slopes[-1] -= tilt
            shares += (0.0, rise)
            slopes += (0.0, tilt)
            ramp, slope = next_ramp, next_slope
        for k in range(1, len(shares), 2):
            shares[k] = shares[k - 1] * shares[k + 1]
            slopes[k] = slopes[k - 1] * shares[k + 1] + shares[k - 1] * slopes[k + 1]
        return first, np.array([shares, slopes])

    def shares(self, x: float) -> Floats:
        """Shares of all vertices and their slopes, (2, N)."""
        first, rows = self.near(x)
        out = np.zeros((2, len(self._lines)))
        out[:, first : first + rows.shape[1] // 2 + 1] = rows[:, ::2]
        return out


def _point_ramp(distance: float, radius: float) -> tuple[float, float]:
    """One ramp of `smoskin.sensing.response.basis` and its slope, in m."""
    if distance >= radius:
        return distance, 1.0
    if distance <= -radius:
        return 0.0, 0.0
    u = distance / radius
    root = math.sqrt(1 - u * u)
    angle = math.asin(u)
    mean = u / 2 + (u * angle + root - root**3 / 3) / math.pi
    return radius * mean, 0.5 + (u * root + angle) / math.pi


def _in_turn(vertices: int) -> Ints:
    """Order of a line's functions in which each vertex is followed by its product with the next."""
    order = np.arange(2 * vertices - 1)
    return np.where(order % 2 == 0, order // 2, vertices + order // 2)
