"""Smooth functions of where and how hard a skin is touched, in which its signals are written.

Decides the functions phi_p(x), psi_q(y) and g_d(F) of "The table" in `docs/derivations.md`: a
touch loads the vertices round it in linear shares, means over a disc, and products of neighbouring
shares and of forces carry what is left. Hides their slopes, and how many touches are summed.
"""

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints, assign, floats, freeze
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import FINGERTIP
from smoskin.origami.geometry import geometry

_EXPONENTS: Final = np.array(
    [
        *((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        *((2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 0), (1, 0, 1), (0, 1, 1)),
        *((0, 0, 3), (1, 0, 2), (0, 1, 2), (2, 0, 1), (0, 2, 1), (1, 1, 1)),
    ]
)
"""Powers of Fx, Fy and Fz in each product of forces: all of first and second order, and those of
third order that the normal force takes part in."""
_LARGEST: Final = (10.0, 9)
"""Largest skin, m, and power of a force."""
_AT_ONCE: Final = 2048
"""Touches whose functions are laid out at once."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchBasis:
    """Functions of place and force for one size of skin and of touch.

    Every signal is a sum ``s(x, y, F) = sum_pqd A_pqd phi_p(x) psi_q(y) g_d(F)``. It raises an
    `ArgumentError` if lines do not rise within the skin, radius or extent are not positive, or
    exponents are not rows of three whole numbers >= 0 of which one is positive.
    """

    extent: Floats
    """(2,), m: length and width of the skin along x and y, from its origin."""
    lines_x: Floats
    """(N,), m: places of the loaded vertices along x."""
    lines_y: Floats
    """(M,), m: places of the loaded vertices along y."""
    radius: float = FINGERTIP
    """Radius of the patch that touches, m."""
    exponents: Ints = field(default_factory=_EXPONENTS.copy)
    """(D, 3): powers of Fx, Fy, Fz in each product of forces."""

    def __post_init__(self) -> None:
        freeze(self, extent=(2,), lines_x=(None,), lines_y=(None,), exponents=(None, 3))
        for name, end in zip(("lines_x", "lines_y"), self.extent, strict=True):
            line = getattr(self, name)
            if not (len(line) and line[0] >= 0 and line[-1] <= end and (np.diff(line) > 0).all()):
                raise ArgumentError(f"{name} must rise within 0..{end} m; got {line}")
        longest, highest = _LARGEST
        sizes = np.append(self.extent, self.radius)
        if not ((sizes > 0) & (sizes <= longest)).all():
            raise ArgumentError(
                f"radius and extent must be positive, up to {longest:g} m; got {self.radius} m "
                f"and {self.extent} m"
            )
        exponents = self.exponents
        if not (
            len(exponents)
            and ((exponents >= 0) & (exponents <= highest) & (exponents % 1 == 0)).all()
            and exponents.any(axis=1).all()
        ):
            raise ArgumentError(
                f"exponents must be whole, 0 to {highest} and not all zero in a row; "
                f"got {exponents}"
            )
        powers = np.asarray(exponents, dtype=np.int64)
        powers.flags.writeable = False
        assign(self, exponents=powers, radius=float(self.radius))

    @classmethod
    def of(cls, design: SkinDesign, radius: float = FINGERTIP) -> "TouchBasis":
        """The functions for a design."""
        solid = geometry(design)
        x, y = solid.lines
        return cls(extent=solid.extent, lines_x=x, lines_y=y, radius=radius)

    @property
    def shape(self) -> tuple[int, int, int]:
        """How many functions along x, along y and of the force, (P, Q, D)."""
        return 2 * len(self.lines_x) - 1, 2 * len(self.lines_y) - 1, len(self.exponents)

    @property
    def vertices(self) -> int:
        """How many vertices a touch may load, H = N M."""
        return len(self.lines_x) * len(self.lines_y)

    def along_x(self, x: Floats) -> tuple[Floats, Floats]:
        """Functions of x and their slopes, (..., P), 1 and 1/m."""
        return _line(x, self.lines_x, self.radius)

    def along_y(self, y: Floats) -> tuple[Floats, Floats]:
        """Functions of y and their slopes, (..., Q), 1 and 1/m."""
        return _line(y, self.lines_y, self.radius)

    def products(self, force: Floats) -> tuple[Floats, Floats]:
        """Products (..., D) of forces (..., 3), N, and their slopes by Fx, Fy, Fz, (..., 3, D)."""
        e = self.exponents
        powers = force[..., None] ** np.arange(e.max() + 1)
        fx, fy, fz = (powers[..., axis, e[:, axis]] for axis in range(3))
        lower = np.maximum(e - 1, 0)
        dx, dy, dz = (powers[..., axis, lower[:, axis]] * e[:, axis] for axis in range(3))
        return fx * fy * fz, np.stack([dx * fy * fz, fx * dy * fz, fx * fy * dz], axis=-2)

    def vertex_shares(self, position: Floats) -> Floats:
        """Share of each vertex in touches at (..., 2), shape (..., H)."""
        n, m = len(self.lines_x), len(self.lines_y)
        x, y = self.along_x(position[..., 0])[0], self.along_y(position[..., 1])[0]
        shares = x[..., :n, None] * y[..., None, :m]
        return np.asarray(shares.reshape(*position.shape[:-1], n * m))

    def rows(self, position: ArrayLike, force: ArrayLike) -> Floats:
        """All functions of B touches, (B, 2) m and (B, 3) N, side by side: (B, P Q D)."""
        place, push = touch_arrays(position, force)
        phi, psi = self.along_x(place[:, 0])[0], self.along_y(place[:, 1])[0]
        places = phi[:, :, None, None] * psi[:, None, :, None]
        rows = places * self.products(push)[0][:, None, None]
        return np.asarray(rows.reshape(len(place), math.prod(self.shape)))

    def sums(self, coefficients: Floats, position: ArrayLike, force: ArrayLike) -> Floats:
        """Sums of the functions with coefficients (P, Q, D, V) for B touches, (B, V)."""
        place, push = touch_arrays(position, force)
        flat = coefficients.reshape(math.prod(self.shape), -1)
        parts = [slice(k, k + _AT_ONCE) for k in range(0, max(len(place), 1), _AT_ONCE)]
        return np.concatenate([self.rows(place[k], push[k]) @ flat for k in parts])

    def sums_and_slopes(
        self, coefficients: Floats, position: ArrayLike, force: ArrayLike
    ) -> tuple[Floats, Floats]:
        """The sums (B, V) and their slopes by x, y, Fx, Fy and Fz, (B, 5, V)."""
        place, push = touch_arrays(position, force)
        p, q, d = self.shape
        phi = np.stack(self.along_x(place[:, 0]))
        psi = np.stack(self.along_y(place[:, 1]), axis=1)
        g, by_force = self.products(push)
        along_y = (phi @ coefficients.reshape(p, -1)).reshape(2, len(place), q, -1)
        # Of function and slope along x, each summed along y with functions and slopes there.
        mixed = (psi @ along_y).reshape(2, len(place), 2, d, -1)
        by_place = np.stack([mixed[1, :, 0], mixed[0, :, 1]], axis=1)
        slopes = (g[:, None, None] @ by_place)[:, :, 0]
        here = mixed[0, :, 0]
        return (g[:, None] @ here)[:, 0], np.concatenate([slopes, by_force @ here], axis=1)


def touch_arrays(position: ArrayLike, force: ArrayLike) -> tuple[Floats, Floats]:
    """Places (B, 2), m, and forces (B, 3), N, of B touches; `ArgumentError` at other shapes."""
    place, push = floats("position", position, (None, 2)), floats("force", force, (None, 3))
    if place.ndim != 2 or push.shape != (len(place), 3):
        raise ArgumentError(
            f"position and force must have shapes (B, 2) and (B, 3); got {place.shape} and "
            f"{push.shape}"
        )
    return place, push


def _line(x: Floats, lines: Floats, radius: float) -> tuple[Floats, Floats]:
    """Shares of the vertices on a line and products of neighbours, with their slopes."""
    ramps = mean_ramps((x[..., None] - lines) / radius)
    ramps[0] *= radius
    # The end vertices carry on as levers: no ramp begins at them.
    ramps[0, ..., 0], ramps[1, ..., 0] = x - lines[0], 1.0
    ramps[..., -1] = 0.0
    rise = -np.diff(ramps) / np.diff(lines)
    both = np.zeros(ramps.shape)
    both[0, ..., 0] = 1.0
    both[..., 1:] += rise
    both[..., :-1] -= rise
    shares, slopes = both
    products = shares[..., 1:] * shares[..., :-1]
    bends = slopes[..., 1:] * shares[..., :-1] + shares[..., 1:] * slopes[..., :-1]
    return np.concatenate([shares, products], axis=-1), np.concatenate([slopes, bends], axis=-1)


def mean_ramps(u: Floats) -> Floats:
    """Mean of max(u + t, 0) over the coordinate t of a disc of radius 1, and its slope."""
    # A disc's coordinate has the density (2 / pi) sqrt(1 - t^2).
    inside = np.minimum(np.maximum(u, -1.0), 1.0)
    square = 1 - inside * inside
    root = np.sqrt(square)
    out = np.empty((2, *u.shape))
    out[1] = 0.5 + (inside * root + np.arcsin(inside)) / np.pi
    out[0] = u * out[1] + 2 / (3 * np.pi) * root * square
    return out


def mean_ramp(u: float) -> tuple[float, float]:
    """The same in plain numbers: for a few vertices NumPy takes longer to start than to finish."""
    if not -1.0 < u < 1.0:
        return max(u, 0.0), float(u > 0.0)
    square = 1 - u * u
    root = math.sqrt(square)
    slope = 0.5 + (u * root + math.asin(u)) / math.pi
    return u * slope + 2 / (3 * math.pi) * root * square, slope
