"""From the chips' motions to a touch, by a model of the sheet; the SI's ideal sheet is one.

Decides the cell, the force and how well both are known. The ideal sheet follows S26, Table S1, S12
and S27; `smoskin.sensing.closed_form.measured` reads a sheet whose answers are known cell by cell.
"""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from smoskin.arrays import Floats, Ints
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
from smoskin.sensing.closed_form.confidence import confidence, faces, readout_noise
from smoskin.sensing.closed_form.location import decide, ideal_rule, readout, unit_press


class Solution(NamedTuple):
    """The touches that a batch of T motions shows."""

    cell: Ints
    """(T, 2): loaded cell (n, m); -1 where none fits."""
    force: Floats
    """(T, 3), N; z is not below zero where no press fits."""
    confidence: Floats
    """(T,): chance that the chips' noise did not decide the cell; 0 where none fits."""


class Sheet(ABC):
    """A model of the sheet by which motions are read."""

    noise: Floats
    """(N, M, 3, 3), N^2: covariance that the chips' noise makes in a force on each cell."""
    place: Floats
    """(N, M, 3, 3): mean square error of the force of a newton's press anywhere in the cell."""

    @abstractmethod
    def solve(self, motions: Floats) -> Solution:
        """Cells and forces of motions (T, 3S), m, of the chips against their magnets."""


class IdealSheet(Sheet):
    """Theory's sheet with a calibration's coefficients.

    Parameters
    ----------
    design : SkinDesign
        With G chips under magnets of the sheet and one over a magnet of the base.
    calibration : Calibration

    Notes
    -----
    Source: SI Eqs. (S12), (S26), (S27) and Table S1.
    """

    def __init__(self, design: SkinDesign, calibration: Calibration) -> None:
        coefficients = calibration.coefficients
        self._magnets = len(design.halls) - 1
        wide = 2 * self._magnets
        self._readout = readout(design, calibration)
        unit = unit_press(design, coefficients)
        self._rule = ideal_rule(unit)
        noise = readout_noise(design, self._readout)
        flat = unit.reshape(*design.cells, -1)
        stiffness = stiffness_map(design, coefficients)
        # One row a cell: v_s K_z, v_f in x and y, certainty and share, then what a displacement
        # is multiplied by: to press depth, and to its distance from each face of the cell's cone.
        # Around them rows of nobody's, so that the index -1 of no cell has a row as well.
        per_press = flat / (flat**2).sum(axis=-1, keepdims=True)
        folding = folding_correction_map(design.cells, coefficients)
        cones = faces(self._rule, unit, noise[:-2, :-2])
        rows = np.concatenate(
            [
                stiffness.reshape(-1, 1),
                folding.reshape(-1, 2),
                cones.certainty[:, None],
                cones.share[:, None],
                per_press.reshape(-1, wide),
                cones.normals.reshape(stiffness.size, -1),
            ],
            axis=1,
        )
        padded = np.zeros((design.cells[0] + 1, design.cells[1] + 1, rows.shape[1]))
        padded[..., 1:3] = 1.0
        padded[:-1, :-1] = rows.reshape(*design.cells, -1)
        self._cell_table = padded.reshape(-1, rows.shape[1])
        self._cell_strides = np.array([design.cells[1] + 1, 1])
        self.noise = np.zeros((*design.cells, 3, 3))
        self.noise[..., :2, :2] = noise[wide:, wide:]
        of_press = np.einsum("nmk,kl,nml->nm", per_press, noise[:wide, :wide], per_press)
        self.noise[..., 2, 2] = stiffness**2 * of_press
        loads = np.zeros((*design.cells, 3, wide))
        loads[..., 2, :] = -per_press * stiffness[..., None]
        self.place = place_scatter(design, flat / stiffness[..., None], loads)

    def solve(self, motions: Floats) -> Solution:
        """Cells and forces of motions (T, 3S), m, of the chips against their magnets."""
        wide = 2 * self._magnets
        parted = motions @ self._readout
        flat, shear = parted[:, :wide], parted[:, wide:]
        cell = decide(self._rule, flat.reshape(-1, self._magnets, 2))
        of_cell = self._cell_table.take(cell @ self._cell_strides, axis=0)
        rows = of_cell[:, 5:].reshape(len(motions), -1, wide)
        products = (rows @ flat[:, :, None])[..., 0]
        force = np.empty((len(motions), 3))
        force[:, :2] = shear
        gain = shear_gain(shear, of_cell[:, 1:3])
        force[:, 2] = -normal_force(products[:, 0], of_cell[:, 0], gain)
        certainty = confidence(products[:, 1:], of_cell[:, 3], of_cell[:, 4])
        return Solution(cell, force, certainty)


def place_scatter(design: SkinDesign, press: Floats, loads: Floats) -> Floats:
    """Mean square error of the force of a newton's press anywhere in each cell, (N, M, 3, 3).

    Parameters
    ----------
    press : Floats, shape (N, M, K)
        Motions for a newton on each cell's vertex, m/N.
    loads : Floats, shape (N, M, 3, K)
        What turns them into the force on the cell, N/m.
    """
    extent = geometry(design).cell
    inside = np.linspace(-0.4, 0.4, 5)
    steps = np.stack(np.meshgrid(inside, inside, indexing="ij"), axis=-1).reshape(-1, 2)
    places = geometry(design).tops[..., None, :] + steps * (extent.length, extent.width)
    given = np.einsum("nmpij,ijk->nmpk", vertex_shares(design, places), press)
    off = np.einsum("nmfk,nmpk->nmpf", loads, given)
    off[..., 2] += 1.0
    return np.asarray(np.einsum("nmpf,nmpg->nmfg", off, off) / len(steps))
