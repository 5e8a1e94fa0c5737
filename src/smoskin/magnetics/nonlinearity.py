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


def cross_signals(curvature: Floats, one: Floats, other: Floats) -> Floats:
    """Amount that readings of two motions, (..., 3 S) each, T, add to their sum.

    c_k = sum over i, j of a_i b_j C_ijk for each chip.
    """
    chips = len(curvature)
    first, second = one.reshape(-1, chips, 3, 1), other.reshape(-1, chips, 1, 3)
    products = (first * second).reshape(-1, chips, 1, 9)
    return np.asarray((products @ curvature.reshape(chips, 9, 3)).reshape(one.shape))


def straightened(curvature: Floats, signals: Floats) -> Floats:
    """Readings (..., 3 S), T, if fields were linear: x of x + c(x, x) / 2 = signals."""
    chips = len(curvature)
    halves = 0.5 * curvature.reshape(chips, 9, 3)
    rows = linear = signals.reshape(-1, chips, 1, 3)
    for _ in range(_FIXED_POINTS):
        products = (linear.swapaxes(2, 3) * linear).reshape(-1, chips, 1, 9)
        linear = rows - products @ halves
    return np.asarray(linear.reshape(signals.shape))


def bent(curvature: Floats, motions: Floats) -> Floats:
    """The readings that `straightened` makes these of."""
    return np.asarray(motions + 0.5 * cross_signals(curvature, motions, motions))
