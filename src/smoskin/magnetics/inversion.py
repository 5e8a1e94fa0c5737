"""From the fields at the chips to where each magnet has moved: the inverse of the sector field.

The corrected ideal inverse (S5, S6) gives a start, Newton steps on the exact field the rest, so
that the answer does not depend on how well the ideal field fits. All chips and any number of
readings are solved together.
"""

from typing import NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.centripetal import displacement, fit_correction
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.sector import field
from smoskin.origami.layout import chip_offset, hall_positions, magnet_positions

_STEPS = 2
"""Newton steps from the corrected inverse: the second already moves less than a nanometre
inside the usable range."""
_FITTED = 1e-3
"""m: displacements that the ideal field is corrected for."""
_SETTLED = 2e-6
"""m: a last Newton step longer than this has not converged."""


class Displacements(NamedTuple):
    """Where the chips stand relative to their magnets."""

    moved: Floats
    """(..., S, 3), m: chip against magnet, from rest, in the skin's frame."""
    found: Bools
    """(..., S): whether the field fits a place within the stroke."""


def rest_cross_talk(design: SkinDesign) -> Floats:
    """Field of all magnets but its own at each chip at rest, in the skin's frame, (S, 3), T."""
    chips, magnets = hall_positions(design), magnet_positions(design)
    fields = np.zeros_like(chips)
    for magnet, place in zip(design.magnets, magnets, strict=True):
        others = [s for s, site in enumerate(design.halls) if site.magnet != magnet.name]
        fields[others] += field(magnet, chips[others] - place)
    return fields


class FieldInverse:
    """Solves B(rest + moved) = field for every chip of a design.

    Parameters
    ----------
    design : SkinDesign
    stroke : float
        m: farthest motion that counts as a solution, in the plane and along z.
    """

    def __init__(self, design: SkinDesign, *, stroke: float = 2.5e-3) -> None:
        magnets = [design.magnet(site.magnet) for site in design.halls]
        self._stroke = stroke
        self._rest = np.zeros((len(magnets), 3))
        self._rest[:, 2] = [chip_offset(design, site) for site in design.halls]
        self._places, self._charges = point_charges(magnets)
        self._corrections = [
            fit_correction(magnet, site.gap, min(_FITTED, site.gap / 2))
            for magnet, site in zip(magnets, design.halls, strict=True)
        ]

    @property
    def rest_field(self) -> Floats:
        """Field of each chip's own magnet at rest, in the skin's frame, shape (S, 3), T."""
        return charge_field_and_gradient(self._places, self._charges, self._rest)[0]

    @property
    def rest_slope(self) -> Floats:
        """dB_x/dx of each chip's own magnet at rest, shape (S,), T/m."""
        slope = charge_field_and_gradient(self._places, self._charges, self._rest)[1]
        return np.abs(slope[:, 0, 0])

    def displacements(self, fields: Floats) -> Displacements:
        """Motion of each chip against its magnet.

        Parameters
        ----------
        fields : Floats, shape (..., S, 3)
            T, of each chip's own magnet, at reference temperature, in the skin's frame.

        Returns
        -------
        Displacements
        """
        fields = floats("fields", fields, self._rest.shape)
        moved = np.empty_like(fields)
        for s, correction in enumerate(self._corrections):
            # A chip moves against its magnet as the magnet moves against the chip, reversed.
            moved[..., s, :] = -displacement(correction, fields[..., s, :])
        np.clip(moved, -self._stroke, self._stroke, out=moved)
        np.nan_to_num(moved, copy=False)
        step = moved
        for _ in range(_STEPS):
            at, slope = charge_field_and_gradient(
                self._places, self._charges, self._rest + moved
            )
            step = np.linalg.solve(slope, (fields - at)[..., None])[..., 0]
            moved = moved + step
        found = (np.abs(moved) <= self._stroke).all(axis=-1)
        found &= (np.abs(step) <= _SETTLED).all(axis=-1)
        return Displacements(moved, found)
