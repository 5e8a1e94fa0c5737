"""Curvature of chips' fields in the motion of their magnets, to second order.

What a chip reads of two motions at once is not the sum of what it reads of each. The difference
is a product of both readings, so that readings can be freed of it before anything linear is done
with them, and bent again afterwards.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.origami.geometry import geometry

_STEP: Final = 1e-5
"""m: step of the differences of the gradient."""
_FIXED_POINTS: Final = 5


def field_curvature(design: SkinDesign) -> Floats:
    """Product C_ijk of two readings that each chip adds to their sum, from its own magnet, 1/T.

    Shape (S, 3, 3, 3): change of field under one motion, under the other, and component that is
    added, all in the skin's frame. Valid for motions of the magnet along x, y and z, small against
    the gap; tilts are taken as what they look like.
    """
    magnets = [design.magnet(site.magnet) for site in design.halls]
    places, charges = point_charges(magnets)
    rest = geometry(design).rest

    def gradient(shift: Floats) -> Floats:
        return charge_field_and_gradient(places, charges, rest + shift)[1]

    bends = [(gradient(_STEP * axis) - gradient(-_STEP * axis)) / (2 * _STEP) for axis in np.eye(3)]
    inverse = np.linalg.inv(gradient(np.zeros(3)))
    return np.asarray(np.einsum("kscj,sji,skl->silc", np.stack(bends), inverse, inverse))


def cross_signals(curvature: Floats, first: Floats, second: Floats) -> Floats:
    """Amount that readings of two motions, (..., 3 S) each, T, add to their sum.

    c_k = sum over i, j of a_i b_j C_ijk for each chip.
    """
    chips = len(curvature)
    a, b = first.reshape(-1, chips, 3, 1), second.reshape(-1, chips, 1, 3)
    products = (a * b).reshape(-1, chips, 1, 9)
    return np.asarray((products @ curvature.reshape(chips, 9, 3)).reshape(first.shape))


class Bend:
    """Readings s of motions that would read x if fields were linear: s = x + c(x, x) / 2."""

    def __init__(self, curvature: Floats) -> None:
        chips = range(len(curvature))
        rows = np.arange(3 * len(curvature)).reshape(-1, 3)
        self._first, self._second = rows.repeat(3), np.tile(rows, 3).ravel()
        halves = np.zeros((len(curvature), 9, len(curvature), 3))
        halves[chips, :, chips] = 0.5 * curvature.reshape(-1, 9, 3)
        self._halves = halves.reshape(9 * len(curvature), 3 * len(curvature))

    def straightened(self, signals: Floats) -> Floats:
        """Linear readings x of readings s; both of shape (..., 3 S) or (S, 3), T."""
        rows = linear = signals.reshape(-1, len(self._halves) // 3)
        for _ in range(_FIXED_POINTS):
            linear = rows - self._half_cross(linear)
        return np.asarray(linear.reshape(signals.shape))

    def bent(self, linear: Floats) -> Floats:
        """Readings s of linear readings x."""
        rows = linear.reshape(-1, len(self._halves) // 3)
        return np.asarray((rows + self._half_cross(rows)).reshape(linear.shape))

    def _half_cross(self, rows: Floats) -> Floats:
        """Half of c(x, x) for rows (B, 3 S) of x."""
        return np.asarray((rows.take(self._first, 1) * rows.take(self._second, 1)) @ self._halves)


def straightened(curvature: Floats, signals: Floats) -> Floats:
    """Readings (..., 3 S), T, if fields were linear."""
    return Bend(curvature).straightened(signals)
