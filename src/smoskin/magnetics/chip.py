"""Made chips against their data sheet: where they sit, how they are turned, what their axes add.

Decides the order of a chip's errors: the field at the sensing point is turned into the chip's
true axes, each axis takes in a little of the others and has its own sensitivity and zero, and
only then is it converted (`smoskin.magnetics.mlx90393.measure`). Records hold one chip or, with a
leading axis, all chips of a skin.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, assign, floats, freeze, frozen
from smoskin.design.skin import HallSite
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.arrangement import rotation_matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChipPose:
    """Place and attitude of a chip against its site, in the skin's axes."""

    offset: Floats
    """(..., 3), m: offset of the sensing point from the designed one."""
    turn: Floats
    """(..., 3), rad: rotation vector from the designed attitude."""

    def __init__(self, *, offset: ArrayLike, turn: ArrayLike) -> None:
        assign(self, offset=_vectors("offset", offset, "m"), turn=_vectors("turn", turn, "rad"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChipErrors:
    """Errors of a chip's words against those of the data sheet's chip in the same place.

    It answers s (B + X B) + z of the field B along its axes: sensitivities s, cross-axis shares X,
    zeros z.
    """

    sensitivity: Floats
    """(..., 3): s, reading of an axis over its field; about 1."""
    cross_axis: Floats
    """(..., 3, 3): X, share of the field along axis j that axis i reads as well, at [i, j]; zero
    on the diagonal."""
    zero: Floats
    """(..., 3), T: z, reading of an axis without a field."""
    warmth: Floats
    """(...), degC: excess of the temperature word over the temperature."""

    def __init__(
        self,
        *,
        sensitivity: ArrayLike = (1.0, 1.0, 1.0),
        cross_axis: ArrayLike = ((0.0, 0.0, 0.0),) * 3,
        zero: ArrayLike = (0.0, 0.0, 0.0),
        warmth: ArrayLike = 0.0,
    ) -> None:
        gain = _vectors("sensitivity", sensitivity, "")
        if not (gain > 0).all():
            raise ArgumentError(f"sensitivity must be positive; got {gain}")
        cross = floats("cross_axis", cross_axis, (3, 3))
        if np.diagonal(cross, axis1=-2, axis2=-1).any() or not np.isfinite(cross).all():
            raise ArgumentError(f"cross_axis must be finite and zero on its diagonal; got {cross}")
        degrees = floats("warmth", warmth)
        if not np.isfinite(degrees).all():
            raise ArgumentError(f"warmth must be finite; got {degrees} degC")
        assign(self, sensitivity=gain, cross_axis=cross, zero=_vectors("zero", zero, "T"))
        assign(self, warmth=degrees)
        freeze(self, cross_axis=cross.shape, warmth=degrees.shape)


def mounting(sites: Sequence[HallSite], pose: ChipPose) -> Floats:
    """Rotations from the made chips' axes to the skin's.

    Parameters
    ----------
    sites : sequence of HallSite
        S sites.
    pose : ChipPose
        Pose of each chip, its arrays (S, 3), or one for all.

    Returns
    -------
    Floats, shape (S, 3, 3)
        R with B_skin = R @ B_chip.

    Raises
    ------
    ArgumentError
        If the pose is that of another number of chips.

    Examples
    --------
    >>> site = HallSite(name="S1", magnet="M1", gap=5e-3, axes=("+x", "-y", "-z"), address=12)
    >>> quarter = ChipPose(offset=np.zeros(3), turn=[0.0, 0.0, np.pi / 2])
    >>> (mounting([site], quarter)[0] @ [1.0, 0.0, 0.0]).round(12)
    array([0., 1., 0.])
    """
    designed = mlx90393.rotations(sites)
    if pose.turn.shape not in ((3,), (len(sites), 3)):
        raise ArgumentError(
            f"pose must be of one chip or of {len(sites)}; its arrays have shape {pose.turn.shape}"
        )
    return np.asarray(rotation_matrix(pose.turn) @ designed)


def answered(field: ArrayLike, errors: ChipErrors) -> Floats:
    """The field that an errorless chip would have to be in to say the same.

    Parameters
    ----------
    field : array_like, shape (..., 3)
        B along the made chip's own axes, T.
    errors : ChipErrors
        Errors of these chips.

    Returns
    -------
    Floats, shape (..., 3)
        T; for `smoskin.magnetics.mlx90393.measure`.
    """
    true = floats("field", field, (3,))
    taken = true + np.einsum("...ij,...j->...i", errors.cross_axis, true)
    return np.asarray(taken * errors.sensitivity + errors.zero)


def _vectors(name: str, value: ArrayLike, unit: str) -> Floats:
    """Finite vectors, read-only."""
    vectors = floats(name, value, (3,))
    if not np.isfinite(vectors).all():
        raise ArgumentError(f"{name} must be finite; got {vectors} {unit}".rstrip())
    return frozen(name, vectors, vectors.shape)
