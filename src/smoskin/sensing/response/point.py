"""What chips read under touches one or two at a time, fast and with slopes.

Gives the answers of `ResponseTable.signals` and `together` at one temperature of the rubber, with
the derivatives that descents need, of a few descents at once. Decides nothing; hides in which order
coefficients lie so that the few which a touch needs stand together.
"""

from bisect import bisect_right
from functools import cached_property
from typing import Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.sensing.response.basis import TouchBasis, mean_ramp
from smoskin.sensing.response.pairs import NearPairs

_BY_X, _BY_Y = np.array([0, 1, 0]), np.array([0, 0, 1])
"""Whether that along x, and that along y, is a slope in a product and its slopes."""
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
        self._coefficients = coefficients
        self._windows = PointWindows(basis)
        # Vertices and products of neighbours in turn: what a touch needs stands together.
        p, q, d, signals = coefficients.shape
        functions = 2 * self._windows.width - 1
        block = np.zeros((max(p, functions), max(q, functions), d * signals))
        orders = [_in_turn(len(line)) for line in (basis.lines_x, basis.lines_y)]
        block[:p, :q] = coefficients[np.ix_(*orders)].reshape(p, q, -1)
        parts = np.lib.stride_tricks.sliding_window_view(block, (functions, functions), (0, 1))
        parts = np.ascontiguousarray(np.moveaxis(parts[::2, ::2], 2, -1))
        self._cells = parts.shape[1]
        self._parts = parts.reshape(-1, functions * functions, d * signals)
        self._grip, self._curvature, self._coupling = grip, curvature, coupling
        # Which powers make each product and its slopes by each force, and their factors.
        e = basis.exponents
        lower = np.maximum(e - np.eye(3, dtype=np.int64)[:, None], 0)
        powers = np.concatenate([e[None], lower]) + int(e.max() + 1) * np.arange(3)
        self._highest = int(e.max())
        self._powers = np.ascontiguousarray(np.moveaxis(powers, -1, 0))
        self._factors = np.concatenate([np.ones((1, len(e))), e.T])

    @cached_property
    def _laid_out(self) -> tuple[Floats, Floats | None, Floats]:
        """Grip and coupling of two vertices in each row, and bends (2, C, C^2) of all chips."""
        grip, coupling, signals = self._grip, self._coupling, 3 * len(self._curvature)
        by_grip = np.ascontiguousarray(grip.swapaxes(1, 2)).reshape(len(grip) ** 2, 6)
        by_coupling = None
        if coupling is not None:
            by_coupling = np.ascontiguousarray(coupling.swapaxes(1, 2))
            by_coupling = by_coupling.reshape(len(coupling) ** 2, 9 * signals)
        # What either of two readings adds to the other.
        bends = np.zeros((2, signals, signals, signals))
        for k, curvature in enumerate((self._curvature, self._curvature.swapaxes(1, 2))):
            for chip, products in enumerate(curvature):
                own = slice(3 * chip, 3 * chip + 3)
                bends[k, own, own, own] = products.swapaxes(0, 1)
        return by_grip, by_coupling, bends.reshape(2, signals, signals**2)

    def at(self, place: Floats, force: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) at places (B, 2) under forces (B, 3), and slopes by these, (B, 5, C)."""
        first, rates = self._windows.near(place)
        rows = self._at(first, self._windows.products(rates), force)
        return rows[:, 0, 0], np.concatenate([rows[:, 1:, 0], rows[:, 0, 1:]], axis=1)

    def _at(self, first: Ints, functions: Floats, force: Floats) -> Floats:
        """Signals of touches by functions of place and of force, each with slopes, (B, 3, 4, C)."""
        part = self._parts.take(first[:, 0] * self._cells + first[:, 1], axis=0)
        batch, rates, number = functions.shape[0], 3, functions[0, 0].size
        powers = np.ones((batch, 3, self._highest + 1))
        powers[..., 1:] = force[..., None]
        np.multiply.accumulate(powers, axis=-1, out=powers)
        each = powers.reshape(batch, -1).take(self._powers, axis=1)
        g = self._factors * each[:, 0] * each[:, 1] * each[:, 2]
        mixed = functions.reshape(batch, rates, number) @ part
        return np.asarray(g[:, None] @ mixed.reshape(batch, rates, g.shape[2], -1))

    def scan(self, x: Floats, y: Floats, force: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) and slopes (B, 5, C) at many places under one force."""
        return self.basis.sums_and_slopes(
            self._coefficients, np.stack([x, y], axis=-1), np.broadcast_to(force, (len(x), 3))
        )

    def pairs(self, place: Floats, press: Floats) -> tuple[Floats, Floats]:
        """Signals (B, C) of two touches at (B, 2, 2), m, that press with (B, 2), N, positive.

        With their slopes by x, y and the press of each, (B, 6, C), T/m and T/N.
        """
        batch, (grip, coupling, bends) = len(place), self._laid_out
        first, rates = self._windows.near(place.reshape(-1, 2))
        functions = self._windows.products(rates)
        shares = functions[:, :, ::2, ::2].reshape(batch, 2, 3, -1)
        vertices = self._windows.vertices(first).reshape(batch, 2, -1)
        count = self._windows.count
        near = vertices[:, :, None, :, None] * count + vertices[:, None, :, None]
        pairs = NearPairs(shares)
        together, alone = pairs.held(grip.take(near, axis=0), press)
        # Forces of each touch and their slopes by all unknowns, (B, 2, 7, 3): on the sheet, and
        # those that a table of single touches asks for.
        down = np.zeros((batch, 2, 7, 3))
        down[..., :2] = together
        down[..., 0, 2] = press
        down[:, 0, 3, 2] = down[:, 1, 6, 2] = 1.0
        push = -down
        push[..., :2] = together - alone
        both = self._at(first, functions, push[:, :, 0].reshape(-1, 3))
        both = both.reshape(batch, 2, 3, 4, -1)
        rows = push @ both[:, :, 0, 1:]
        rows[:, :, 0] = both[:, :, 0, 0]
        rows[:, 0, 1:3] += both[:, 0, 1:, 0]
        rows[:, 1, 4:6] += both[:, 1, 1:, 0]
        signals = rows.shape[-1]
        bent = (rows[:, ::-1, :1] @ bends).reshape(batch, 2, signals, signals)
        added = (rows @ bent).sum(axis=1)
        added[:, 0] *= 0.5  # by one and by the other, which is the same
        total = rows.sum(axis=1) + added
        if coupling is not None:
            total += pairs.coupled(coupling.take(near[:, 0, 1], axis=0), down)
        return total[:, 0], total[:, 1:]


class PointWindows:
    """The vertices near each touch, as many for all, and the functions of them along both axes."""

    def __init__(self, basis: TouchBasis) -> None:
        lines, self._radius = (basis.lines_x, basis.lines_y), basis.radius
        self._counts = len(lines[0]), len(lines[1])
        self.count = self._counts[0] * self._counts[1]
        """Number of vertices of the skin."""
        self._ends = np.array(self._counts)[:, None] - 1
        reach = [np.searchsorted(line, line + 2 * basis.radius) for line in lines]
        within = max(int((ends - np.arange(len(ends))).max()) for ends in reach)
        self.width = width = min(within + 2, max(2, *self._counts))
        """Number of vertices along an axis."""
        # Each window but the first starts where a touch has left the first vertex of that before.
        self._starts: list[list[float]] = []
        # Of each window, where ramps begin and how steep they are: none begins at a line's last
        # vertex, none rises past it.
        self._lines: list[list[tuple[list[float], list[float]]]] = []
        for line in lines:
            last = max(len(line) - width, 0)
            self._starts.append((line[1 : 1 + last] + basis.radius).tolist())
            begins = line[: max(len(line) - 1, 1)].tolist() + width * [_FAR]
            steep = (1 / np.diff(line)).tolist() + width * [0.0]
            parts = [slice(start, start + width - 1) for start in range(last + 1)]
            self._lines.append([(begins[part], steep[part]) for part in parts])
        self._steps = np.arange(width)

    def near(self, place: Floats) -> tuple[Ints, Floats]:
        """First vertices (T, 2) of the windows of T places, and functions in these.

        They are shares and products of neighbours in turn, with their slopes, (T, 2, 2, 2 w - 1).
        """
        first, functions = [], []
        for touch in place.tolist():
            for axis, at in enumerate(touch):
                window = bisect_right(self._starts[axis], at)
                first.append(window)
                functions += self._functions(at, *self._lines[axis][window])
        shape = len(place), 2, 2, 2 * self.width - 1
        return np.array(first).reshape(-1, 2), np.array(functions).reshape(shape)

    def _functions(self, at: float, begins: list[float], steep: list[float]) -> list[float]:
        """Functions along an axis in one window, then their slopes."""
        # The first of a window is straight already, or carries on as a lever; its last has not
        # begun.
        ramps, radius = [(at - begins[0], 1.0)], self._radius
        for begin in begins[1:]:
            mean, slope = mean_ramp((at - begin) / radius)
            ramps.append((radius * mean, slope))
        shares, slopes = [1.0], [0.0]
        for rate, here, ahead in zip(steep, ramps, [*ramps[1:], (0.0, 0.0)], strict=True):
            rise, climb = (here[0] - ahead[0]) * rate, (here[1] - ahead[1]) * rate
            shares[-1] -= rise
            slopes[-1] -= climb
            shares.append(rise)
            slopes.append(climb)
        out, by_place = [shares[0]], [slopes[0]]
        for k in range(1, len(shares)):
            out += (shares[k - 1] * shares[k], shares[k])
            by_place += (slopes[k - 1] * shares[k] + shares[k - 1] * slopes[k], slopes[k])
        return out + by_place

    def products(self, rates: Floats) -> Floats:
        """Products of functions along x and y, and their slopes, (T, 3, 2 w - 1, 2 w - 1)."""
        x, y = rates[:, 0].take(_BY_X, axis=1), rates[:, 1].take(_BY_Y, axis=1)
        return np.asarray(x[..., None] * y[..., None, :])

    def vertices(self, first: Ints) -> Ints:
        """Which vertices these windows hold, (T, w w), of all; `products` has their shares."""
        # Vertices past a line's end have no share; they count as its last.
        at = np.minimum((first[..., None] + self._steps), self._ends)
        return np.asarray(at[:, 0, :, None] * self._counts[1] + at[:, 1, None]).reshape(
            len(first), -1
        )


def _in_turn(vertices: int) -> Ints:
    """Order of a line's functions in which each vertex is followed by its product with the next."""
    order = np.arange(2 * vertices - 1)
    return np.where(order % 2 == 0, order // 2, vertices + order // 2)
