"""Surfaces in closed form: plane, cylinder, cone, sphere, and heights over a plane.

Decides each one's chart; all of them touch the plane z = 0 at the origin, with the normal along z.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline

from smoskin.arguments import typed
from smoskin.arrays import Bools, Floats, floats
from smoskin.errors import ArgumentError
from smoskin.origami.surface.surface import Jet


@dataclass(frozen=True, slots=True)
class Plane:
    """The plane z = 0."""

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        x, y = _split(parameters)
        return _jet([x, y, 0 * x], [[1, 0], [0, 1], [0, 0]], [(0, 0, 0)] * 3)

    def holds(self, parameters: Floats) -> Bools:
        """Everywhere."""
        return np.isfinite(_split(parameters)[0])


@typed
@dataclass(frozen=True, slots=True)
class Cylinder:
    """A circular cylinder whose axis runs along x; its chart keeps lengths.

    It raises an `ArgumentError` unless the radius is positive.
    """

    radius: float
    """m."""

    def __post_init__(self) -> None:
        _positive(radius=self.radius)

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        x, y = _split(parameters)
        r = self.radius
        s, c = np.sin(y / r), np.cos(y / r)
        # 1 - cos by its half angle, so that a wide cylinder keeps its digits.
        drop = 2 * r * np.sin(y / (2 * r)) ** 2
        return _jet(
            [x, r * s, -drop],
            [[1, 0], [0, c], [0, -s]],
            [(0, 0, 0), (0, 0, -s / r), (0, 0, -c / r)],
        )

    def holds(self, parameters: Floats) -> Bools:
        """Less than half a turn to either side."""
        return np.abs(_split(parameters)[1]) < np.pi * self.radius


@typed
@dataclass(frozen=True, slots=True)
class Cone:
    """A frustum whose generator runs along x, from its first radius to its last.

    Its parameters are the way along a generator and the arc at the middle. It raises an
    `ArgumentError` unless radii and height are positive.
    """

    first: float
    """Radius at the end of negative x, m."""
    last: float
    """Radius at the end of positive x, m."""
    height: float
    """Length of the axis between the ends, m."""

    def __post_init__(self) -> None:
        _positive(first=self.first, last=self.last, height=self.height)

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        x, y = _split(parameters)
        middle = (self.first + self.last) / 2
        rise, along = self._slope()
        s, c = np.sin(y / middle), np.cos(y / middle)
        r = middle + rise * x
        # In the frame of the axis e_a = (along, 0, -rise) and the radius e_r = (rise, 0, along).
        drop = 2 * np.sin(y / (2 * middle)) ** 2
        places = [x - r * rise * drop, r * s, -r * along * drop]
        slopes = [
            [1 - rise**2 * drop, -rise * s * r / middle],
            [rise * s, c * r / middle],
            [-rise * along * drop, -along * s * r / middle],
        ]
        bends = [
            (0, -(rise**2) * s / middle, -rise * c * r / middle**2),
            (0, rise * c / middle, -s * r / middle**2),
            (0, -rise * along * s / middle, -along * c * r / middle**2),
        ]
        return _jet(places, slopes, bends)

    def holds(self, parameters: Floats) -> Bools:
        """Short of the apex, and less than half a turn to either side."""
        x, y = _split(parameters)
        middle = (self.first + self.last) / 2
        return (np.abs(y) < np.pi * middle) & (middle + self._slope()[0] * x > 0.0)

    def _slope(self) -> tuple[float, float]:
        """Sine and cosine of the angle between generator and axis."""
        slant = float(np.hypot(self.last - self.first, self.height))
        return (self.last - self.first) / slant, self.height / slant


@typed
@dataclass(frozen=True, slots=True)
class Sphere:
    """A sphere by its stereographic chart, which keeps angles; lengths are true at the origin.

    It raises an `ArgumentError` unless the radius is positive.
    """

    radius: float
    """m."""

    def __post_init__(self) -> None:
        _positive(radius=self.radius)

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        u = np.asarray(parameters, dtype=np.float64)
        r = self.radius
        # (k u, 2 r (k - 1)) with k = 1 / (1 + u . u / 4 r^2), whose derivatives follow.
        k = 1 / (1 + (u * u).sum(-1) / (4 * r**2))
        by = -((k**2)[..., None]) * u / (2 * r**2)
        unit = np.eye(2)
        two = (k**3 / (2 * r**4))[..., None, None] * (u[..., :, None] * u[..., None, :]) - (
            k**2 / (2 * r**2)
        )[..., None, None] * unit
        flat = u[..., :, None] * by[..., None, :] + k[..., None, None] * unit
        third = u[..., :, None, None] * two[..., None, :, :] + (
            unit[:, :, None] * by[..., None, None, :] + unit[:, None, :] * by[..., None, :, None]
        )
        drop = -k * (u * u).sum(-1) / (2 * r)
        return Jet(
            np.concatenate([k[..., None] * u, drop[..., None]], axis=-1),
            np.concatenate([flat, 2 * r * by[..., None, :]], axis=-2),
            np.concatenate([third, 2 * r * two[..., None, :, :]], axis=-3),
        )

    def holds(self, parameters: Floats) -> Bools:
        """The half round the origin, with a tenth of the way more."""
        return np.asarray((np.asarray(parameters) ** 2).sum(-1) < (2.2 * self.radius) ** 2)


@typed
@dataclass(frozen=True, slots=True)
class Saddle:
    """A surface with opposite curvatures: z = (x^2 - y^2) / 2 R.

    It raises an `ArgumentError` unless the radius is positive.
    """

    radius: float
    """Radius of curvature at the origin along x and y, m."""

    def __post_init__(self) -> None:
        _positive(radius=self.radius)

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        x, y = _split(parameters)
        r = self.radius
        return _raised(x, y, (x**2 - y**2) / (2 * r), (x / r, -y / r), (1 / r, 0.0, -1 / r))

    def holds(self, parameters: Floats) -> Bools:
        """Everywhere."""
        return np.isfinite(_split(parameters)[0])


@typed
@dataclass(frozen=True, slots=True)
class Bump:
    """A rounded hill: z = H (exp(-(x^2 + y^2) / 2 s^2) - 1); a negative height is a hollow.

    It raises an `ArgumentError` unless the width is positive and the height finite.
    """

    height: float
    """H, m."""
    width: float
    """s, m."""

    def __post_init__(self) -> None:
        _positive(width=self.width)
        if not np.isfinite(self.height):
            raise ArgumentError(f"height must be finite; got {self.height}")

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        x, y = _split(parameters)
        s2 = self.width**2
        z = self.height * np.exp(-(x**2 + y**2) / (2 * s2))
        second = (z * (x**2 / s2 - 1) / s2, z * x * y / s2**2, z * (y**2 / s2 - 1) / s2)
        return _raised(x, y, z - self.height, (-x * z / s2, -y * z / s2), second)

    def holds(self, parameters: Floats) -> Bools:
        """Everywhere."""
        return np.isfinite(_split(parameters)[0])


class HeightField:
    """Heights on a grid over the plane, between which a bicubic spline goes.

    Parameters
    ----------
    x, y : array_like, shape (P,) and (Q,)
        Lines of the grid, m, rising; at least four of each.
    heights : array_like, shape (P, Q)
        m; the origin should lie on the field, where a sheet's middle comes.

    Raises
    ------
    ArgumentError
        If the shapes do not fit, a line does not rise or a value is not finite.
    """

    def __init__(self, x: Floats, y: Floats, heights: Floats) -> None:
        lines = floats("x", x, (None,)), floats("y", y, (None,))
        values = floats("heights", heights, (len(lines[0]), len(lines[1])))
        for name, line in zip("xy", lines, strict=True):
            if line.ndim != 1 or len(line) < 4 or not np.all(np.diff(line) > 0.0):
                raise ArgumentError(f"{name} must be at least four rising numbers; got {line}")
        if not np.isfinite(values).all():
            raise ArgumentError("heights must be finite; a field with holes is refused")
        self._spline = RectBivariateSpline(*lines, values)
        self._ends = [(float(line[0]), float(line[-1])) for line in lines]

    def jet(self, parameters: Floats) -> Jet:
        """Places and derivatives at parameters (..., 2)."""
        x, y = _split(parameters)
        z, zx, zy, zxx, zxy, zyy = (
            self._spline.ev(x, y, dx=i, dy=j)
            for i, j in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        )
        return _raised(x, y, z, (zx, zy), (zxx, zxy, zyy))

    def holds(self, parameters: Floats) -> Bools:
        """Within the grid."""
        x, y = _split(parameters)
        (left, right), (near, far) = self._ends
        return (x >= left) & (x <= right) & (y >= near) & (y <= far)


Value = Floats | float | int


def _positive(**values: float) -> None:
    """Refuse lengths that are not positive."""
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} must be finite and > 0 m; got {value}")


def _split(parameters: Floats) -> tuple[Floats, Floats]:
    """Both parameters apart."""
    u = floats("parameters", parameters, (2,))
    return u[..., 0], u[..., 1]


def _raised(
    x: Floats, y: Floats, z: Floats, by: tuple[Floats, Floats], second: tuple[Value, Value, Value]
) -> Jet:
    """A jet of heights over the plane: their first and second derivatives xx, xy, yy."""
    return _jet([x, y, z], [[1, 0], [0, 1], list(by)], [(0, 0, 0), (0, 0, 0), second])


def _jet(
    places: Sequence[Floats], slopes: Sequence[Sequence[Value]], bends: Sequence[Sequence[Value]]
) -> Jet:
    """A jet of components; bends are those by xx, xy and yy."""
    shape = places[0].shape
    x = np.stack(places, axis=-1)
    first = np.empty((*shape, 3, 2))
    second = np.empty((*shape, 3, 2, 2))
    for i in range(3):
        for a in range(2):
            first[..., i, a] = slopes[i][a]
        second[..., i, 0, 0], mixed, second[..., i, 1, 1] = bends[i]
        second[..., i, 0, 1] = second[..., i, 1, 0] = mixed
    return Jet(x, first, second)
