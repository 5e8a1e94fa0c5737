"""Smooth functions of where and how hard a skin is touched, in which its answers are written.

A touch presses the vertices round it in linear shares (`mechanics.contact`), past the outermost by
a lever over the last two, and a patch of some radius takes the mean over its disc. What chips read
is then nearly a sum over vertices of shares times force; products of neighbouring shares and of
forces carry what is left. Decides these functions along each axis and of the force; hides their
slopes.
"""

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints, floats, frozen
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import FINGERTIP
from smoskin.origami.layout import skin_extent
from smoskin.origami.sheet import loaded_positions

_EXPONENTS = (
    *((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    *((2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 0), (1, 0, 1), (0, 1, 1)),
    *((0, 0, 3), (1, 0, 2), (0, 1, 2), (2, 0, 1), (0, 2, 1), (1, 1, 1)),
)
"""Of Fx, Fy and Fz in each product of forces: all of first and second order, and those of third
order that the normal force takes part in."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchBasis:
    """Functions of place and force for one size of skin and of touch.

    Raises
    ------
    ArgumentError
        If lines do not rise within the skin, or radius or extent are not positive.
    """

    extent: Floats
    """(2,), m: of the skin along x and y, from its origin."""
    lines_x: Floats
    """(N,), m: where the loaded vertices lie along x."""
    lines_y: Floats
    """(M,), m: likewise along y."""
    radius: float
    """m, of the patch that touches."""
    exponents: Ints
    """(D, 3): of Fx, Fy, Fz in each product of forces."""

    def __init__(
        self,
        *,
        extent: ArrayLike,
        lines_x: ArrayLike,
        lines_y: ArrayLike,
        radius: float = FINGERTIP,
        exponents: ArrayLike = _EXPONENTS,
    ) -> None:
        whole = frozen("extent", extent, (2,))
        lines = frozen("lines_x", lines_x, (None,)), frozen("lines_y", lines_y, (None,))
        for name, line, end in zip(("lines_x", "lines_y"), lines, whole, strict=True):
            if not (len(line) and line[0] >= 0 and line[-1] <= end and (np.diff(line) > 0).all()):
                raise ArgumentError(f"{name} must rise within 0..{end} m; got {line}")
        if not (0 < radius < np.inf and (whole > 0).all()):
            raise ArgumentError(f"radius and extent must be positive; got {radius} m and {whole} m")
        powers = np.array(exponents, dtype=np.int64)
        if powers.ndim != 2 or powers.shape[1] != 3 or (powers.sum(axis=1) < 1).any():
            raise ArgumentError(
                f"exponents must be rows of 3, not all zero; got shape {powers.shape}"
            )
        powers.setflags(write=False)
        object.__setattr__(self, "extent", whole)
        object.__setattr__(self, "lines_x", lines[0])
        object.__setattr__(self, "lines_y", lines[1])
        object.__setattr__(self, "radius", float(radius))
        object.__setattr__(self, "exponents", powers)

    @classmethod
    def of(cls, design: SkinDesign, radius: float = FINGERTIP) -> "TouchBasis":
        """The functions for a design."""
        places = loaded_positions(design)
        return cls(
            extent=skin_extent(design),
            lines_x=places[:, 0, 0],
            lines_y=places[0, :, 1],
            radius=radius,
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """How many functions along x, along y and of the force, (P, Q, D)."""
        return 2 * len(self.lines_x) - 1, 2 * len(self.lines_y) - 1, len(self.exponents)

    def along_x(self, x: Floats) -> tuple[Floats, Floats]:
        """Functions of x and their slopes, (..., P), and per metre."""
        return _line(x, self.lines_x, self.radius)

    def along_y(self, y: Floats) -> tuple[Floats, Floats]:
        """Functions of y and their slopes, (..., Q), and per metre."""
        return _line(y, self.lines_y, self.radius)

    def products(self, force: Floats) -> tuple[Floats, Floats]:
        """Products of forces and their slopes by each force.

        Parameters
        ----------
        force : Floats, shape (..., 3)
            N.

        Returns
        -------
        products : Floats, shape (..., D)
        slopes : Floats, shape (..., 3, D)
        """
        e = self.exponents
        powers = force[..., None] ** np.arange(e.max() + 1)
        fx, fy, fz = (powers[..., axis, e[:, axis]] for axis in range(3))
        lower = np.maximum(e - 1, 0)
        dx, dy, dz = (powers[..., axis, lower[:, axis]] * e[:, axis] for axis in range(3))
        return fx * fy * fz, np.stack([dx * fy * fz, fx * dy * fz, fx * fy * dz], axis=-2)

    def rows(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """All functions of B touches, flat, (B, P Q D)."""
        where, push = floats("position", position, (None, 2)), floats("force", force, (None, 3))
        x, y = self.along_x(where[:, 0])[0], self.along_y(where[:, 1])[0]
        places = (x[:, :, None] * y[:, None, :]).reshape(len(where), -1)
        g = self.products(push)[0]
        return np.asarray((places[:, :, None] * g[:, None, :]).reshape(len(where), -1))


class PointLine:
    """The functions along one axis, for one place at a time.

    Parameters
    ----------
    lines : Floats, shape (N,)
        m.
    radius : float
        m.
    """

    def __init__(self, lines: Floats, radius: float) -> None:
        self._lines: list[float] = lines.tolist()
        self._pitch: list[float] = np.diff(lines).tolist()
        self._radius = radius

    def near(self, where: float) -> tuple[int, Floats]:
        """Shares of the few vertices that a touch there loads, and products of neighbours.

        Returns
        -------
        first : int
            Of those vertices.
        rows : Floats, shape (2, 2 n - 1)
            Shares and products in turn, and their slopes. Plain numbers start faster than arrays.
        """
        lines, radius = self._lines, self._radius
        if len(lines) == 1:
            return 0, np.array([[1.0], [0.0]])
        first = min(max(bisect_right(lines, where - radius) - 1, 0), len(lines) - 2)
        last = max(min(bisect_left(lines, where + radius), len(lines) - 1), first + 1)
        # Before the first ramps are straight, at the last none has begun; so it is at the end
        # vertices, which carry on as levers.
        here, steep = where - lines[first], 1.0
        shares, slopes = [1.0], [0.0]
        for k in range(first, last):
            after, steeper = (
                _point_ramp(where - lines[k + 1], radius) if k + 1 < last else (0.0, 0.0)
            )
            rise, tilt = (here - after) / self._pitch[k], (steep - steeper) / self._pitch[k]
            shares[-1] -= rise
            slopes[-1] -= tilt
            shares += (0.0, rise)
            slopes += (0.0, tilt)
            here, steep = after, steeper
        for k in range(1, len(shares), 2):
            shares[k] = shares[k - 1] * shares[k + 1]
            slopes[k] = slopes[k - 1] * shares[k + 1] + shares[k - 1] * slopes[k + 1]
        return first, np.array([shares, slopes])

    def at(self, where: float) -> Floats:
        """All functions and their slopes, (2, 2 N - 1)."""
        first, rows = self.near(where)
        count, vertices = rows.shape[1] // 2, len(self._lines)
        out = np.zeros((2, 2 * vertices - 1))
        out[:, first : first + count + 1] = rows[:, ::2]
        out[:, vertices + first : vertices + first + count] = rows[:, 1::2]
        return out


def _point_ramp(distance: float, radius: float) -> tuple[float, float]:
    """One value of `_ramp`, in m."""
    if distance >= radius:
        return distance, 1.0
    if distance <= -radius:
        return 0.0, 0.0
    u = distance / radius
    root = math.sqrt(1 - u * u)
    turn = math.asin(u)
    mean = u / 2 + (u * turn + root - root**3 / 3) / math.pi
    return radius * mean, 0.5 + (u * root + turn) / math.pi


def _line(where: Floats, lines: Floats, radius: float) -> tuple[Floats, Floats]:
    """Shares of the vertices on a line and products of neighbours, with their slopes."""
    ramp, slope = _ramp((where[..., None] - lines) / radius)
    # The end vertices carry on as levers: no ramp begins at them.
    ramp[..., 0], slope[..., 0] = (where - lines[0]) / radius, 1.0
    ramp[..., -1] = slope[..., -1] = 0.0
    pitch = np.diff(lines)
    rise = radius * (ramp[..., :-1] - ramp[..., 1:]) / pitch
    steep = (slope[..., :-1] - slope[..., 1:]) / pitch
    hats, tilts = (np.zeros((*where.shape, len(lines))) for _ in range(2))
    hats[..., 0] = 1.0
    hats[..., 1:] += rise
    hats[..., :-1] -= rise
    tilts[..., 1:] += steep
    tilts[..., :-1] -= steep
    bubbles = hats[..., 1:] * hats[..., :-1]
    bends = tilts[..., 1:] * hats[..., :-1] + hats[..., 1:] * tilts[..., :-1]
    return np.concatenate([hats, bubbles], axis=-1), np.concatenate([tilts, bends], axis=-1)


def _ramp(u: Floats) -> tuple[Floats, Floats]:
    """Mean of max(u + t, 0) over a disc of radius 1 with t one of its coordinates, and its slope.

    A disc's coordinate has the density (2 / pi) sqrt(1 - t^2).
    """
    inside = np.clip(u, -1.0, 1.0)
    root = np.sqrt(1 - inside * inside)
    turn = np.arcsin(inside)
    mean = inside / 2 + (inside * turn + root - root**3 / 3) / np.pi
    return mean + np.maximum(u - 1, 0), 0.5 + (inside * root + turn) / np.pi
