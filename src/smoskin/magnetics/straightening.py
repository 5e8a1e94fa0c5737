"""Signals freed of the bend of a made skin's fields: linear in the motions of its magnets.

Decides where each magnet of a made skin is, by the field that its chip reads at rest, and what
becomes of fields that no motion gives: they stay as they are. Hides the magnets' own field.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.charges import charge_field, charge_field_and_gradient, point_charges
from smoskin.magnetics.nonlinearity import cross_signals
from smoskin.origami.geometry import geometry

_STROKE: Final = 3e-3
"""Largest motion along an axis, m."""
_BENT_AMISS: Final = 0.05
"""Share of what motions add to each other's signals that straightening leaves of a made skin."""
_STEPS: Final = 8
"""Most Newton steps."""
_LAST: Final = 1e-6
"""Length, m, of a step whose error is below a nanometre, as each squares that of the one before."""


class Straightening:
    """Signals x = G u of the motions u behind what chips read, B(p + u) - B(p) = s, and back.

    B is the field of a chip's own magnet in the skin's frame, p where the chip is against it, and G
    the field's slope there. A made skin's magnet is off its place, tilted and of another strength:
    p is where the designed one would give the field at rest.

    Parameters
    ----------
    design : SkinDesign
    rest : Floats, shape (S, 3)
        Field of each chip's own magnet at rest, in the skin's frame, T.
    """

    def __init__(self, design: SkinDesign, rest: Floats) -> None:
        magnets = [design.magnet(site.magnet) for site in design.halls]
        self._magnets = point_charges(magnets)
        designed = geometry(design).rest
        moved, settled = self._motions(designed, rest[None], np.zeros((1, *rest.shape)))
        self._place = np.where(settled[0], designed + moved[0], designed)
        self._rest, self._slope = self._field(self._place)
        self._inverse = np.linalg.inv(self._slope)

    @property
    def motions(self) -> Floats:
        """Motion of each chip's magnet by its linear signals, the inverse of G, (S, 3, 3), m/T."""
        return np.asarray(self._inverse)

    def straightened(self, signals: Floats) -> Floats:
        """Linear signals x of signals s; both of shape (..., 3 S) or (..., S, 3), T."""
        rows = signals.reshape(-1, *self._rest.shape)
        first = (self._inverse @ rows[..., None])[..., 0]
        moved, settled = self._motions(self._place, self._rest + rows, first)
        linear = (self._slope @ moved[..., None])[..., 0]
        return np.asarray(np.where(settled, linear, rows).reshape(signals.shape))

    def bent(self, linear: Floats) -> Floats:
        """Signals s of linear signals x."""
        rows = linear.reshape(-1, *self._rest.shape)
        moved = (self._inverse @ rows[..., None])[..., 0]
        within = (np.abs(moved) <= _STROKE).all(axis=-1, keepdims=True)
        place = self._place + np.where(within, moved, 0.0)
        bent = charge_field(*self._magnets, place) - self._rest
        return np.asarray(np.where(within, bent, rows).reshape(linear.shape))

    def _field(self, places: Floats) -> tuple[Floats, Floats]:
        """Field and slope at chips' places against their magnets, (..., S, 3)."""
        return charge_field_and_gradient(*self._magnets, places)

    def _motions(self, start: Floats, fields: Floats, moved: Floats) -> tuple[Floats, Bools]:
        """Motions from places (S, 3) to where fields (T, S, 3) are, m, and whether they are.

        The search begins at motions that are near already.
        """
        moved = np.minimum(np.maximum(moved, -_STROKE), _STROKE)
        for _ in range(_STEPS):
            field, slope = self._field(start + moved)
            step = np.linalg.solve(slope, (fields - field)[..., None])[..., 0]
            moved = np.minimum(np.maximum(moved + step, -_STROKE), _STROKE)
            settled = np.abs(step).max(axis=-1, keepdims=True) < _LAST
            if settled.all():
                break
        return moved, np.asarray(settled)


def bent_amiss(curvature: Floats, moved: Floats, felt: Floats) -> Floats:
    """Deviations (..., C), T, of what two motions add to each other's linear signals (..., C).

    Made skins differ so from the curvature (S, 3, 3, 3), 1/T, of the design's fields.
    """
    added = cross_signals(curvature, moved, felt).reshape(*felt.shape[:-1], -1, 3)
    size = np.sqrt((added * added).sum(axis=-1) / 3)
    return np.asarray(_BENT_AMISS * np.repeat(size, 3, axis=-1))
