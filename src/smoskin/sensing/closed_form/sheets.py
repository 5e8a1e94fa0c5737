"""From the chips' motions to a touch: by the SI's ideal sheet, or by a sheet that was measured.

Decides the cell, the force and how well both are known; hides what each way needs for it. The
ideal sheet follows S26, Table S1, S12 and S27. The measured sheet takes the cell whose answers
explain the motions best. Both stiffen under drag by S27.
"""

from typing import NamedTuple, Protocol

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.mechanics.reduced.stiffness import (
    folding_correction_map,
    normal_force,
    shear_gain,
    stiffness_map,
)
from smoskin.mechanics.sheet.touches import vertex_shares
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.confidence import confidence, faces, motion_noise, readout_noise
from smoskin.sensing.closed_form.location import decide, ideal_rule, readout, unit_press
from smoskin.sensing.closed_form.press_table import PressTable
from smoskin.sensing.closed_form.subspaces import Subspaces


class Solution(NamedTuple):
    """What a batch of T motions says."""

    cell: Ints
    """(T, 2): loaded cell (n, m); -1 where none fits."""
    force: Floats
    """(T, 3), N; z is not below zero where no press fits."""
    found: Bools
    """(T,): whether every field fitted a displacement within the stroke."""
    confidence: Floats
    """(T,): chance that the chips' noise did not decide the cell; 0 where none fits."""


class Sheet(Protocol):
    """A way to read motions."""

    noise: Floats
    """(N, M, 3, 3), N^2: what the chips' noise makes in a force on each cell."""
    place: Floats
    """(N, M, 3, 3): what makes of a newton's press that it lies anywhere in the cell."""

    def solve(self, motions: Floats, found: Bools) -> Solution:
        """Cells and forces of motions (T, 3S), m, of the chips against their magnets."""
        ...


class IdealSheet:
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
        self.place = _anywhere(design, flat / stiffness[..., None], loads)

    def solve(self, motions: Floats, found: Bools) -> Solution:
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
        sure = confidence(products[:, 1:], of_cell[:, 3], of_cell[:, 4])
        return Solution(cell, force, found, sure)


class MeasuredSheet:
    """A sheet whose answers to loads on each cell were measured.

    Parameters
    ----------
    design : SkinDesign
    table : PressTable
    coefficients : Coefficients
        v_f alone is used of them.

    Notes
    -----
    Source: SI Eq. (S27); its v_s K_z U_z is the press that the table finds.
    """

    def __init__(self, design: SkinDesign, table: PressTable, coefficients: Coefficients) -> None:
        table.check_fits(design)
        count = design.cells[0] * design.cells[1]
        # A last row for the index -1 of no cell.
        cells = np.indices(design.cells).reshape(2, -1).T
        self._cells = np.concatenate([cells, [[-1, -1]]])
        self._subspaces = Subspaces(
            table.answers.reshape(count, -1, 3), np.diag(motion_noise(design))
        )
        folding = folding_correction_map(design.cells, coefficients).reshape(count, 2)
        self._folding = np.concatenate([folding, [[1.0, 1.0]]])
        # Loads come as press, drag in x, drag in y; forces as x, y, z with a press below zero.
        turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
        noise = turn @ self._subspaces.spread @ turn.T
        self.noise = noise.reshape(*design.cells, 3, 3)
        press = table.press.reshape(*design.cells, -1)
        loads = (turn @ self._subspaces.loads).reshape(*design.cells, 3, -1)
        self.place = _anywhere(design, press, loads)

    def solve(self, motions: Floats, found: Bools) -> Solution:
        """Cells and forces of motions (T, 3S), m, of the chips against their magnets."""
        match = self._subspaces.match(motions)
        shear = match.load[:, 1:]
        force = np.empty((len(motions), 3))
        force[:, :2] = shear
        force[:, 2] = -shear_gain(shear, self._folding[match.cell]) * match.load[:, 0]
        return Solution(self._cells[match.cell], force, found, match.confidence)


def _anywhere(design: SkinDesign, press: Floats, loads: Floats) -> Floats:
    """Mean square error of the force of a newton's press anywhere in each cell, (N, M, 3, 3).

    Parameters
    ----------
    press : Floats, shape (N, M, K)
        What a newton on each cell's vertex gives.
    loads : Floats, shape (N, M, 3, K)
        Times that, the force on the cell.
    """
    extent = geometry(design).cell
    inside = np.linspace(-0.4, 0.4, 5)
    steps = np.stack(np.meshgrid(inside, inside, indexing="ij"), axis=-1).reshape(-1, 2)
    places = geometry(design).tops[..., None, :] + steps * (extent.length, extent.width)
    given = np.einsum("nmpij,ijk->nmpk", vertex_shares(design, places), press)
    off = np.einsum("nmfk,nmpk->nmpf", loads, given)
    off[..., 2] += 1.0
    return np.asarray(np.einsum("nmpf,nmpg->nmfg", off, off) / len(steps))
