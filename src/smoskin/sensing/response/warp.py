"""Laws of contact as warps of place: a touch at p loads the sheet at W(p).

A response table shares a touch out between the vertices beside it in one way. Under another law of
contact a touch at p loads the sheet as the table's does at W(p). Decides which warps can be
written, how large they are likely to be, and how they are undone where they are level; "Laws of
contact" in `docs/derivations.md`.
"""

import math
from bisect import bisect_right
from typing import Final

import numpy as np

from smoskin.arrays import Floats

_WAVES: Final = (0.08, 0.04, 0.02)
"""Spread of each harmonic of a warp that is the same between all vertices, in pitches."""
_OWN: Final = (0.02, 0.03)
"""Spread of what is each interval's own: a first harmonic and a bow, in pitches."""
_LEVER: Final = 0.5
"""Spread of what the lever past the outermost vertices lacks of the whole one."""
_SHIFT: Final = 0.2e-3
"""Spread of a shift of all places, m."""
_COMMON: Final = 3 + len(_WAVES)
"""Functions that are not an interval's own."""
_GRID: Final = 0.5e-3
"""Step of the places at which a warp is undone first, m."""
_LEVEL: Final = 0.35
"""Slope of a warp below which it counts as level."""
_WIDER: Final = 1.5
"""Variance of a place over that which the slope there gives, past which other places may be it."""
_NEWTON: Final = 3
"""Newton's steps from there, at most."""
_THERE: Final = 1e-6
"""Length, m, of a step that is the last: each squares the error of the one before."""


class LineWarp:
    """Warps W(x) = x + sum_k a_k w_k(x) of a line with vertices (N,), m.

    The functions are a shift, what the lever past either end lacks, three harmonics that are the
    same between all vertices, and between each two a harmonic and a bow of their own.
    """

    def __init__(self, vertices: Floats) -> None:
        self._vertices: list[float] = vertices.tolist()
        self._starts, self._pitch = vertices[:-1], np.diff(vertices)
        pitch = float(self._pitch.mean()) if len(vertices) > 1 else 0.0
        shared = [_SHIFT, _LEVER, _LEVER, *(wave * pitch for wave in _WAVES)]
        self.spread = np.append(shared, np.tile(_OWN, len(self._pitch)) * pitch)
        """Standard deviation of each coefficient among skins, (W,): m, of levers 1."""

    def functions(self, x: Floats) -> tuple[Floats, Floats]:
        """Functions w_k of places (B,), m, and their slopes, (B, W)."""
        first, last = self._vertices[0], self._vertices[-1]
        value, slope = np.zeros((2, len(x), len(self.spread)))
        value[:, 0] = 1.0
        value[:, 1], slope[:, 1] = np.maximum(first - x, 0.0), -1.0 * (x < first)
        value[:, 2], slope[:, 2] = np.minimum(last - x, 0.0), -1.0 * (x > last)
        rows = np.flatnonzero((x > first) & (x < last))
        interval = np.searchsorted(self._vertices, x[rows], side="right") - 1
        pitch = self._pitch[interval]
        t = (x[rows] - self._starts[interval]) / pitch
        turns = 2 * np.pi * np.arange(1, 1 + len(_WAVES))
        value[rows, 3:_COMMON] = np.sin(t[:, None] * turns)
        slope[rows, 3:_COMMON] = turns / pitch[:, None] * np.cos(t[:, None] * turns)
        own = _COMMON + 2 * interval
        value[rows, own], slope[rows, own] = value[rows, 3], slope[rows, 3]
        value[rows, own + 1], slope[rows, own + 1] = 4 * t * (1 - t), 4 * (1 - 2 * t) / pitch
        return value, slope

    def point(self, x: float, coefficients: list[float]) -> tuple[float, float]:
        """W at one place, m, and its slope: plain numbers start faster than arrays."""
        vertices, load, slope = self._vertices, x + coefficients[0], 1.0
        if x <= vertices[0]:
            return load + coefficients[1] * (vertices[0] - x), slope - coefficients[1]
        if x >= vertices[-1]:
            return load + coefficients[2] * (vertices[-1] - x), slope - coefficients[2]
        i = bisect_right(vertices, x) - 1
        pitch, own = vertices[i + 1] - vertices[i], _COMMON + 2 * i
        t = (x - vertices[i]) / pitch
        for k in range(len(_WAVES)):
            size = coefficients[3 + k] + (0.0 if k else coefficients[own])
            turn = 2 * math.pi * (k + 1)
            load += size * math.sin(turn * t)
            slope += size * turn / pitch * math.cos(turn * t)
        bow = 4 * coefficients[own + 1]
        return load + bow * t * (1 - t), slope + bow * (1 - 2 * t) / pitch


class PlaceWarp:
    """Warps of both axes of a skin with vertices on lines (N,) and (M,), m, one after the other."""

    def __init__(self, vertices_x: Floats, vertices_y: Floats) -> None:
        self._lines = LineWarp(vertices_x), LineWarp(vertices_y)
        self.spread = np.concatenate([line.spread for line in self._lines])
        """Standard deviation of each coefficient among skins, (W,): m, of levers 1."""

    def functions(self, position: Floats) -> tuple[Floats, Floats]:
        """Motion of the load with each coefficient at places (B, 2), m, and its slopes, (B, W, 2).

        The last axis is x and y; the slopes are those along the same axis.
        """
        both = np.zeros((2, len(position), len(self.spread), 2))
        split = len(self._lines[0].spread)
        both[:, :, :split, 0] = self._lines[0].functions(position[:, 0])
        both[:, :, split:, 1] = self._lines[1].functions(position[:, 1])
        return both[0], both[1]

    def loads(self, position: Floats, coefficients: Floats) -> tuple[Floats, Floats]:
        """Places W(p), (B, 2), m, that touches at p load, and their slopes along x and y."""
        value, slope = self.functions(position)
        return (
            position + np.einsum("bwd,w->bd", value, coefficients),
            1.0 + np.einsum("bwd,w->bd", slope, coefficients),
        )

    def inverse(self, coefficients: Floats, extent: Floats) -> tuple["Unwarp", "Unwarp"]:
        """What undoes the warps of x and y on a skin of this extent, (2,), m."""
        split = len(self._lines[0].spread)
        parts = coefficients[:split], coefficients[split:]
        x, y = (Unwarp(*line) for line in zip(self._lines, parts, extent.tolist(), strict=True))
        return x, y


class Unwarp:
    """Places of touches along one line, from where they load the sheet.

    Places from 0 to `end`, m, are taken as equally likely beforehand. Where a warp is level, a
    touch may have been anywhere on the level stretch: its mean and variance are the answer.
    """

    def __init__(self, warp: LineWarp, coefficients: Floats, end: float) -> None:
        self._warp, self._coefficients, self._end = warp, coefficients.tolist(), end
        self._places = np.linspace(0.0, end, math.ceil(end / _GRID) + 1)
        value, slope = warp.functions(self._places)
        self._loads = self._places + value @ coefficients
        self._step = float(self._places[1])
        # Where a warp rises everywhere, one load has one place.
        rises = (1.0 + slope @ coefficients).min() >= _LEVEL
        self._rising: list[float] = self._loads.tolist() if rises else []
        self.is_none = not coefficients.any()
        """Whether nothing is warped."""

    def place(self, load: float, variance: float) -> tuple[float, float]:
        """Mean, m, and variance, m^2, of the place of a touch that loads the sheet at `load`, m.

        `variance` is that of the load, m^2.
        """
        if self._rising:
            place = min(self._step * bisect_right(self._rising, load), self._end)
        else:
            blurred = variance + self._step**2 / 3
            away = (self._loads - load) ** 2
            chance = np.exp((away.min() - away) / (2 * blurred))
            chance /= chance.sum()
            place = float(chance @ self._places)
            spread = float(chance @ (self._places - place) ** 2)
            _, slope = self._warp.point(place, self._coefficients)
            if slope < _LEVEL or spread > _WIDER * blurred / slope**2:
                return place, spread
        slope = 1.0
        for _ in range(_NEWTON):
            reached, slope = self._warp.point(place, self._coefficients)
            slope = max(slope, _LEVEL)
            step = (reached - load) / slope
            place = min(max(place - step, 0.0), self._end)
            if abs(step) < _THERE:
                break
        return place, variance / slope**2
