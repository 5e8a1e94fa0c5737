"""Made chips against their data sheet: where they sit, how they are turned, what their axes add.

Decides the order of a chip's errors: the field at the sensing point is turned into the chip's
true axes, each axis takes in a little of the others and has its own sensitivity and zero, and
only then is it converted (`smoskin.magnetics.mlx90393.measure`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, floats, freeze
from smoskin.design.skin import HallSite
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.arrangement import rotation_matrix
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, chip_factor


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MadeChips:
    """Poses of S chips against their sites, and errors of their words against the data sheet.

    A chip answers f s (B + X B) + z of the field B along its axes: sensitivities s, cross-axis
    shares X, zeros z, and the factor f of its warmth (`smoskin.magnetics.temperature.chip_factor`).
    """

    place: Floats
    """(S, 3), m, in the skin's axes: offset of the sensing point from the designed one."""
    turn: Floats
    """(S, 3), rad, in the skin's axes: rotation vector from the designed attitude."""
    sensitivity: Floats
    """(S, 3): s, reading of an axis over its field; about 1."""
    cross_axis: Floats
    """(S, 3, 3): X, share of the field along axis j that axis i reads as well, at [i, j]; zero
    on the diagonal."""
    zero: Floats
    """(S, 3), T: z, reading of an axis without a field."""
    warmth: Floats
    """(S,), degC: excess of the temperature word over the temperature."""

    def __post_init__(self) -> None:
        chips = len(self.place)
        freeze(self, place=(chips, 3), turn=(chips, 3), sensitivity=(chips, 3))
        freeze(self, cross_axis=(chips, 3, 3), zero=(chips, 3), warmth=(chips,))
        for name in (field.name for field in fields(self)):
            if not np.isfinite(getattr(self, name)).all():
                raise ArgumentError(f"{name} must be finite; got {getattr(self, name)}")
        if not (self.sensitivity > 0).all():
            raise ArgumentError(f"sensitivity must be positive; got {self.sensitivity}")
        if np.diagonal(self.cross_axis, axis1=-2, axis2=-1).any():
            raise ArgumentError(f"cross_axis must be zero on its diagonal; got {self.cross_axis}")

    def rotations(self, sites: Sequence[HallSite]) -> Floats:
        """Rotations R from the made chips' axes to the skin's, (S, 3, 3): B_skin = R @ B_chip.

        Sites of another number than S raise an `ArgumentError`.
        """
        if len(sites) != len(self.turn):
            raise ArgumentError(f"sites must be those of {len(self.turn)} chips; got {len(sites)}")
        return np.asarray(rotation_matrix(self.turn) @ mlx90393.rotations(sites))

    def answers(self, field: ArrayLike, temperature: ArrayLike = REFERENCE_TEMPERATURE) -> Floats:
        """Field that errorless chips at reference temperature read the same in, (..., S, 3), T.

        `field`, (..., S, 3), T, is B along the made chips' own axes; the chips' temperatures, degC,
        are broadcast against (..., S).
        """
        true = floats("field", field, (len(self.turn), 3))
        taken = true + np.einsum("...ij,...j->...i", self.cross_axis, true)
        factor = chip_factor(temperature)[..., None]
        return np.asarray(taken * factor * self.sensitivity + self.zero)
