"""Inverse of the sector field: from the fields at the chips to where each magnet has moved.

Inside its usable range the corrected ideal inverse (S5, S6) is the answer; outside, it is the
start of a few Newton steps on the magnets' own field. All chips and any number of readings are
solved together.
"""

from typing import NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.centripetal import (
    OF_NUMBERS,
    LinearCorrection,
    displaced,
    displacement,
    fit_correction,
    stack_corrections,
    usable_range,
)
from smoskin.magnetics.charges import charge_field_and_gradient, point_charges
from smoskin.magnetics.sector import field
from smoskin.origami.geometry import geometry

_STEPS = 2
"""Newton steps from the corrected inverse; the second moves less than a nanometre in the stroke."""
_FITTED = 0.5e-3
"""m: largest displacement that the ideal field is corrected for."""
_SETTLED = 2e-6
"""m: a last Newton step longer than this has not converged."""


class Displacements(NamedTuple):
    """Motion of the chips against their magnets."""

    moved: Floats
    """(T, S, 3), m: motion of chip against magnet, from rest, in the skin's frame."""
    within: Bools
    """(T,): whether every chip's field fits a place within the stroke."""


def rest_cross_talk(design: SkinDesign) -> Floats:
    """Field of all magnets but its own at each chip at rest, in the skin's frame, (S, 3), T."""
    chips, magnets = geometry(design).chips, geometry(design).magnets
    fields = np.zeros_like(chips)
    for magnet, place in zip(design.magnets, magnets, strict=True):
        others = [s for s, site in enumerate(design.halls) if site.magnet != magnet.name]
        fields[others] += field(magnet, chips[others] - place)
    return fields


class FieldInverse:
    """Solves B(rest + moved) = field for every chip of a design, B of its own magnet.

    Where the corrected ideal inverse may err by more than `tolerance`, m, Newton steps follow it;
    motions within `stroke`, m, along each axis count as solutions.
    """

    def __init__(
        self, design: SkinDesign, *, tolerance: float = 1e-6, stroke: float = 2.5e-3
    ) -> None:
        magnets = [design.magnet(site.magnet) for site in design.halls]
        self._stroke = stroke
        self._rest = geometry(design).rest
        self._places, self._charges = point_charges(magnets)
        fitted: dict[object, tuple[LinearCorrection, float]] = {}
        kinds = [
            (m.mount, m.radius, m.height, m.remanence, m.polarity, site.gap)
            for m, site in zip(magnets, design.halls, strict=True)
        ]
        for kind, magnet, site in zip(kinds, magnets, design.halls, strict=True):
            if kind not in fitted:
                own = fit_correction(magnet, site.gap, min(_FITTED, site.gap / 2))
                fitted[kind] = own, usable_range(magnet, site.gap, own, tolerance)
        self._correction = stack_corrections([fitted[kind][0] for kind in kinds])
        self._numbers = np.stack(self._correction.numbers, axis=-1).tolist()
        self._usable_squared = np.array([fitted[kind][1] for kind in kinds]) ** 2

    @property
    def rest_field(self) -> Floats:
        """Field of each chip's own magnet at rest, in the skin's frame, shape (S, 3), T."""
        return charge_field_and_gradient(self._places, self._charges, self._rest)[0]

    def displacements(self, fields: Floats) -> Displacements:
        """Motion of each chip against its magnet.

        Fields, (T, S, 3), T, are those of each chip's own magnet at reference temperature, in the
        skin's frame.
        """
        if len(fields) == 1 and (alone := self._usable_alone(fields[0])) is not None:
            return Displacements(alone, np.ones(1, dtype=np.bool_))
        # A chip moves against its magnet as the magnet moves against the chip, reversed.
        moved = -displacement(self._correction, fields)
        within = np.einsum("tsk,tsk->ts", moved, moved) <= self._usable_squared
        usable = within.all(axis=-1)
        settled = usable.copy()
        moved[~usable], settled[~usable] = self._refine(fields[~usable], moved[~usable])
        return Displacements(moved, settled)

    def _usable_alone(self, fields: Floats) -> Floats | None:
        """Motion of the chips for one reading whose magnets are all within their usable range."""
        magnets = []
        limits = self._usable_squared.tolist()
        for (bx, by, bz), numbers, limit in zip(
            fields.tolist(), self._numbers, limits, strict=True
        ):
            try:
                x, y, z = displaced(bx, by, bz, numbers, OF_NUMBERS)
            except (ArithmeticError, ValueError):
                return None
            if not x * x + y * y + z * z <= limit:
                return None
            magnets.append((x, y, z))
        return -np.array([magnets])

    def _refine(self, fields: Floats, start: Floats) -> tuple[Floats, Bools]:
        """Newton steps on the magnets' own field, and whether they settled within the stroke."""
        moved: Floats = np.nan_to_num(np.clip(start, -self._stroke, self._stroke))
        step: Floats = moved
        for _ in range(_STEPS):
            at, slope = charge_field_and_gradient(self._places, self._charges, self._rest + moved)
            step = np.asarray(np.linalg.solve(slope, (fields - at)[..., None])[..., 0], np.float64)
            moved += step
        settled = (np.abs(moved) <= self._stroke) & (np.abs(step) <= _SETTLED)
        return moved, np.asarray(settled.all(axis=(-2, -1)))
