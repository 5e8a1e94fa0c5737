"""From the chips' motions to a touch, by a model of the sheet; the SI's ideal sheet is one.

Decides the cell, the force and how well both are known. The ideal sheet follows S26, Table S1, S12
and S27; `smoskin.sensing.closed_form.measured` reads a sheet whose answers are known cell by cell.
"""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.reduced.stiffness import (
    folding_correction_map,
    normal_force,
    shear_gain,
    stiffness_map,
)
from smoskin.mechanics.sheet.touches import vertex_shares
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.confidence import cones, readout_noise
from smoskin.sensing.closed_form.location import decide, ideal_rule, readout, unit_press


class Solution(NamedTuple):
    """The touch that motions show."""

    cell: tuple[int, int]
    """Loaded cell (n, m)."""
    force: Floats
    """(3,), N; z is below zero."""
    confidence: float
    """Chance that the chips' noise did not decide the cell."""
    misfit: float
    """Share of the squared motions that no load on that cell makes."""


class Sheet(ABC):
    """A model of the sheet by which motions are read."""

    noise: Floats
    """(N, M, 3, 3), N^2: covariance that the chips' noise makes in a force on each cell."""
    place: Floats
    """(N, M, 3, 3): mean square error of the force of a newton's press anywhere in the cell."""
    most_misfit: float
    """Largest misfit of a touch anywhere."""

    @abstractmethod
    def solve(self, motions: Floats) -> Solution | None:
        """Touch by motions (3S,), m, of the chips against their magnets; None where none fits."""


class IdealSheet(Sheet):
    """Theory's sheet with a calibration's coefficients, under G magnets with their chips.

    Notes
    -----
    Source: SI Eqs. (S12), (S26), (S27) and Table S1.
    """

    most_misfit = 0.35  # touches between vertices, and dragged, come to 0.27

    def __init__(self, design: SkinDesign, calibration: Calibration) -> None:
        coefficients = calibration.coefficients
        self._wide = 2 * (len(design.halls) - 1)
        self._readout = readout(design, calibration)
        noise = readout_noise(design, self._readout)
        unit = unit_press(design, coefficients)
        self._rule = ideal_rule(unit)
        self._cones = cones(self._rule, unit, noise[:-2, :-2])
        self._stiffness = stiffness_map(design, coefficients)
        self._folding = folding_correction_map(design.cells, coefficients)
        flat = unit.reshape(*design.cells, -1)
        self._per_press = flat / (flat**2).sum(axis=-1, keepdims=True)
        self.noise = np.zeros((*design.cells, 3, 3))
        self.noise[..., :2, :2] = noise[self._wide :, self._wide :]
        self.noise[..., 2, 2] = self._stiffness**2 * np.einsum(
            "nmk,kl,nml->nm", self._per_press, noise[:-2, :-2], self._per_press
        )
        loads = np.zeros((*design.cells, 3, self._wide))
        loads[..., 2, :] = -self._per_press * self._stiffness[..., None]
        self.place = place_scatter(design, flat / self._stiffness[..., None], loads)

    def solve(self, motions: Floats) -> Solution | None:
        """Touch by motions (3S,), m, of the chips against their magnets; None where none fits."""
        parted = motions @ self._readout
        moved, shear = parted[: self._wide], parted[self._wide :]
        n, m = cell = tuple(decide(self._rule, moved.reshape(-1, 2)).tolist())
        if n < 0 or m < 0:
            return None
        press = self._per_press[cell] @ moved
        if not press > 0:
            return None
        gain = shear_gain(shear, self._folding[cell])
        force = np.array([*shear.tolist(), -normal_force(press, self._stiffness[cell], gain)])
        # What lies along the press that the cell's own motions make, of all that has moved.
        along = press * press / (self._per_press[cell] @ self._per_press[cell])
        misfit = 1.0 - float(along / (moved @ moved))
        return Solution(cell, force, self._cones.confidence(cell, moved), misfit)


def place_scatter(design: SkinDesign, press: Floats, loads: Floats) -> Floats:
    """Mean square error of the force of a newton's press anywhere in each cell, (N, M, 3, 3).

    `press`, (N, M, K), m/N, are the motions for a newton on each cell's vertex; `loads`,
    (N, M, 3, K), N/m, turn them into the force on the cell.
    """
    given = presses_anywhere(design, press)
    off = np.einsum("nmfk,nmpk->nmpf", loads, given)
    off[..., 2] += 1.0
    return np.asarray(np.einsum("nmpf,nmpg->nmfg", off, off) / given.shape[2])


def presses_anywhere(design: SkinDesign, press: Floats) -> Floats:
    """Motions for a newton on 25 places of each cell, (N, M, 25, K), m/N, by those on vertices."""
    extent = geometry(design).cell
    inside = np.linspace(-0.4, 0.4, 5)
    steps = np.stack(np.meshgrid(inside, inside, indexing="ij"), axis=-1).reshape(-1, 2)
    places = geometry(design).tops[..., None, :] + steps * (extent.length, extent.width)
    return np.asarray(np.einsum("nmpij,ijk->nmpk", vertex_shares(design, places), press))
