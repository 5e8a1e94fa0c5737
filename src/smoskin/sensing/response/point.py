"""What chips read under touches one or two at a time, fast and with slopes.

Gives the answers of `ResponseTable.signals` and `together` at one temperature of the rubber, with
the derivatives that descents need, of a few descents at once. Decides nothing; hides in which order
coefficients lie so that the few which a touch needs stand together.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.magnetics.nonlinearity import cross_matrices
from smoskin.sensing.response.basis import TouchBasis, mean_ramps
from smoskin.sensing.response.pairs import coupled_with_slopes, held

_FAR: Final = 1e3
"""Place of vertices past a line's end, m."""


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
        self._windows = PointWindows(basis)
        # Vertices and products of neighbours in turn: what a touch needs stands together.
        p, q, d, signals = coefficients.shape
        functions = 2 * self._windows.width - 1
        block = np.zeros((max(p, functions), max(q, functions), d * signals))
        orders = [_in_turn(len(line)) for line in (basis.lines_x, basis.lines_y)]
        block[:p, :q] = coefficients[np.ix_(*orders)].reshape(p, q, -1)
        parts = np.lib.stride_tricks.sliding_window_view(block, (functions, functions), (0, 1))
        self._parts = np.moveaxis(parts[::2, ::2], 2, -1)
        self._coupling = None
        if coupling is not None:
            vertices = len(coupling)
            by_vertices = coupling.swapaxes(1, 2).reshape(vertices, vertices, -1)
            self._coupling = np.ascontiguousarray(by_vertices)
        # Which powers make each product and its slopes by each force, and their factors.
        e = basis.exponents
        lower = np.maximum(e - np.eye(3, dtype=np.int64)[:, None], 0)
        self._orders = np.arange(e.max() + 1.0)
        powers = np.concatenate([e[None], lower]) + len(self._orders) * np.arange(3)
        self._powers = np.ascontiguousarray(np.moveaxis(powers, -1, 0))
        self._factors = np.concatenate([np.ones((1, len(e))), e.T])

    def at(self, place: Floats, force: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) at places (B, 2) under forces (B, 3), and slopes by these, (B, 5, C)."""
        return self._at(*self._windows.near(place), force)

    def _at(self, first: Ints, rates: Floats, force: Floats) -> tuple[Floats, Floats]:
        """The same of touches in these windows."""
        batch, functions, d = len(force), rates.shape[-1], len(self.basis.exponents)
        part = self._parts[first[:, 0], first[:, 1]].reshape(batch, functions, -1)
        here = (rates[:, 0] @ part).reshape(batch, 2, functions, -1)
        mixed = (rates[:, 1, None] @ here).reshape(batch, 2, 2, d, -1)
        powers = (force[..., None] ** self._orders).reshape(batch, -1)
        g = self._factors * powers[:, self._powers].prod(axis=1)
        both = g @ mixed[:, 0, 0]
        value, slopes = both[:, 0], np.empty((batch, 5, both.shape[-1]))
        slopes[:, 0] = (g[:, :1] @ mixed[:, 1, 0])[:, 0]
        slopes[:, 1] = (g[:, :1] @ mixed[:, 0, 1])[:, 0]
        slopes[:, 2:] = both[:, 1:]
        return value, slopes

    def scan(self, x: Floats, y: Floats, force: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) and slopes (B, 5, C) at many places under one force."""
        return self.basis.sums_and_slopes(
            self._coefficients, np.stack([x, y], axis=-1), np.broadcast_to(force, (len(x), 3))
        )

    def pairs(self, place: Floats, press: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) of two touches at (B, 2, 2), m, that press with (B, 2), N, positive.

        With their slopes by x, y and the press of each, (B, 6, C), T/m and T/N.
        """
        batch = len(place)
        first, rates = self._windows.near(place.reshape(-1, 2))
        shares, vertices, everywhere = self._windows.shares(first, rates)
        by = held(self._grip, everywhere.reshape(batch, 2, 3, -1), press)
        # Forces f of each touch on the sheet, with their slopes: drags, and presses down.
        down = np.concatenate([by.together, press[..., None]], axis=-1)
        drags = by.together - by.alone
        by_drags = (by.together_slopes - by.alone_slopes).reshape(batch, 6, 2, 2)
        push = np.concatenate([drags, -press[..., None]], axis=-1).reshape(-1, 3)
        signals, steep = self._at(first, rates, push)
        # One touch after the other, each with what its drags change as either moves.
        value = signals.reshape(batch, 2, -1).swapaxes(0, 1)
        own = steep.reshape(batch, 2, 5, -1).swapaxes(0, 1)
        slopes = by_drags.transpose(2, 0, 1, 3) @ own[:, :, 2:4]
        for k in (0, 1):
            slopes[k, :, 3 * k : 3 * k + 2] += own[k, :, :2]
            slopes[k, :, 3 * k + 2] -= own[k, :, 4]
        by_one = cross_matrices(self._curvature, value[1])
        by_other = cross_matrices(self._curvature.swapaxes(1, 2), value[0])
        rows = np.concatenate([value[0][:, None], slopes[0]], axis=1)
        added = _by_chip(rows, by_one)
        total = value[0] + value[1] + added[:, 0]
        slope = slopes[0] + added[:, 1:] + slopes[1] + _by_chip(slopes[1], by_other)
        if self._coupling is None:
            return total, slope
        by_forces = np.zeros((batch, 6, 2, 3))
        by_forces[..., :2] = by.together_slopes.reshape(batch, 6, 2, 2)
        by_forces[:, [2, 5], [0, 1], 2] = 1.0
        more, steeper = coupled_with_slopes(
            self._coupling,
            vertices.reshape(batch, 2, -1),
            shares.reshape(batch, 2, 3, -1),
            down,
            by_forces,
        )
        return total + more, slope + steeper


class PointWindows:
    """The vertices near each touch, as many for all, and the functions of them along both axes."""

    def __init__(self, basis: TouchBasis) -> None:
        lines, self._radius = (basis.lines_x, basis.lines_y), basis.radius
        self._counts = len(lines[0]), len(lines[1])
        reach = [np.searchsorted(line, line + 2 * basis.radius) for line in lines]
        within = max(int((ends - np.arange(len(ends))).max()) for ends in reach)
        self.width = width = min(within + 2, max(2, *self._counts))
        """Number of vertices along an axis."""
        self._last = np.maximum(np.array(self._counts) - width, 0)
        self._starts = np.full((2, max(self._counts)), np.inf)
        for axis, line in enumerate(lines):
            self._starts[axis, : len(line)] = line + basis.radius
        # No ramp begins at a line's last vertex, none rises past it.
        size = max(*self._counts, width)
        self._begins = np.full((2, size), _FAR)
        self._pitch = np.full((2, size), np.inf)
        for axis, line in enumerate(lines):
            self._begins[axis, : max(len(line) - 1, 1)] = line[: max(len(line) - 1, 1)]
            self._pitch[axis, : len(line) - 1] = np.diff(line)
        self._steps, self._axes = np.arange(width), np.arange(2)[:, None]

    def near(self, place: Floats) -> tuple[Ints, Floats]:
        """First vertices (T, 2) of the windows of T places, and functions in these.

        They are shares and products of neighbours in turn, with their slopes, (T, 2, 2, 2 w - 1).
        """
        passed = np.add.reduce(self._starts <= place[..., None], axis=-1)
        first = np.minimum(np.maximum(passed - 1, 0), self._last)
        at = first[..., None] + self._steps
        away = place[..., None] - self._begins[self._axes, at]
        # The first of a window is straight already, or carries on as a lever; its last has not
        # begun.
        ramps = np.zeros((len(place), 2, 2, self.width))
        ramps[:, :, 0, 0], ramps[:, :, 1, 0] = away[..., 0], 1.0
        if self.width > 2:
            inner = mean_ramps(away[..., 1:-1] / self._radius)
            ramps[:, :, 0, 1:-1], ramps[:, :, 1, 1:-1] = self._radius * inner[0], inner[1]
        rise = ramps[..., :-1] - ramps[..., 1:]
        rise /= self._pitch[self._axes, at[..., :-1]][:, :, None]
        out = np.zeros((len(place), 2, 2, 2 * self.width - 1))
        shares = out[..., ::2]
        shares[:, :, 0, 0] = 1.0
        shares[..., :-1] -= rise
        shares[..., 1:] += rise
        value, slope = shares[:, :, 0], shares[:, :, 1]
        out[:, :, 0, 1::2] = value[..., :-1] * value[..., 1:]
        out[:, :, 1, 1::2] = slope[..., :-1] * value[..., 1:] + value[..., :-1] * slope[..., 1:]
        return first, out

    def shares(self, first: Ints, rates: Floats) -> tuple[Floats, Ints, Floats]:
        """Shares with slopes along x and y, of vertices in the windows (T, 3, w w) and all.

        Between them: which vertices these are, (T, w w); then (T, 3, H).
        """
        n, m = self._counts
        touches, on = len(first), rates[..., ::2]
        at = first[..., None] + self._steps
        lines = np.zeros((touches, 2, self._pitch.shape[1], 2))
        lines[np.arange(touches)[:, None, None], self._axes, at] = on.swapaxes(-1, -2)
        x, y = (part.swapaxes(1, 2) for part in (lines[:, 0, :n], lines[:, 1, :m]))
        near, everywhere = (
            (one[:, [0, 1, 0], :, None] * other[:, [0, 0, 1], None]).reshape(touches, 3, -1)
            for one, other in ((on[:, 0], on[:, 1]), (x, y))
        )
        # Vertices past a line's end have no share; they count as its last.
        i, j = np.minimum(at[:, 0], n - 1), np.minimum(at[:, 1], m - 1)
        return near, (i[:, :, None] * m + j[:, None]).reshape(touches, -1), everywhere


def _by_chip(rows: Floats, matrices: Floats) -> Floats:
    """Rows (B, R, C) times a matrix of each chip, (B, S, 3, 3)."""
    batch, count, signals = rows.shape
    split = rows.reshape(batch, count, -1, 3).swapaxes(1, 2)
    return np.asarray((split @ matrices).swapaxes(1, 2).reshape(batch, count, signals))


def _in_turn(vertices: int) -> Ints:
    """Order of a line's functions in which each vertex is followed by its product with the next."""
    order = np.arange(2 * vertices - 1)
    return np.where(order % 2 == 0, order // 2, vertices + order // 2)
