"""The SI's own estimator: shear from the lower chip, the loaded cell from signs and ratios.

Decides where, how hard and which way from three chips without training: the lower chip gives
the drag (S26), whose share is taken off the upper magnets' motion; the signs of what is left
name a zone (Table S1), the ratios of the two magnets' displacements a column and a row in it
(S12), the size of the motion the press depth and the force (S27). The answer is a cell: its
place is known to no better than the cell's size, which the covariance says.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Bools, Floats, Ints, floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.inversion import FieldInverse, rest_cross_talk
from smoskin.mechanics.contact import vertex_shares
from smoskin.mechanics.stiffness import (
    folding_correction_map,
    normal_force,
    shear_gain,
    stiffness_map,
)
from smoskin.origami.cell import size
from smoskin.origami.sheet import loaded_positions
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.calibration import Calibration
from smoskin.sensing.conditioning import Conditioner, ZeroTracking
from smoskin.sensing.confidence import confidence, faces, readout_noise
from smoskin.sensing.location import decide, ideal_rule, measured_rule, readout, unit_press


class Solution(NamedTuple):
    """What a batch of T fields says."""

    cell: Ints
    """(T, 2): loaded cell (n, m); -1 where none fits."""
    press: Floats
    """(T,), m: depth of its vertex."""
    force: Floats
    """(T, 3), N."""
    found: Bools
    """(T,): whether every field fitted a displacement within the stroke."""
    confidence: Floats
    """(T,): chance that the chips' noise did not decide the cell; 0 where none fits."""


class ClosedFormEstimator(Estimator):
    """Locates a touch to its cell and gives its force, from theory and a calibration alone.

    Parameters
    ----------
    design : SkinDesign
        With one magnet on the base and any number on the sheet, each with its chip. Two tell
        cells apart by the SI's ratios; `smoskin.sensing.confidence.ambiguities` says which not.
    calibration : Calibration, optional
        Of this skin; as designed by default.
    table : array_like, shape (N, M, G, 2), optional
        Displacements of the G magnets on the sheet, in the order of their chips, per unit of
        press on each cell, m/m: measured on this skin, one press a cell. By theory by default.
    tracking : ZeroTracking, optional
        How the zero follows drift while the skin is idle.
    least_confidence : float
        A touch located less surely is `AMBIGUOUS`, its contact the likeliest cell.

    Raises
    ------
    ArgumentError
        If the design has another set of magnets, or the table another shape.
    ModelError
        If the calibration belongs to another design.

    Notes
    -----
    Source: SI Eqs. (S5), (S6), (S12), (S26), (S27) and Table S1.
    Valid for one touch at a time, on or near a cell's top vertex.

    Examples
    --------
    >>> from smoskin.feasibility import load_design
    >>> from smoskin.twin.reduced import ReducedTwin
    >>> design = load_design("planar")
    >>> touch = Contact(position=(0.05, 0.0667), force=(0.2, 0.0, -0.5))
    >>> estimate = ClosedFormEstimator(design).step(ReducedTwin(design).read([touch]))
    >>> estimate.status.name, estimate.contacts[0].position.round(3).tolist()
    ('CONTACT', [0.05, 0.067])
    """

    def __init__(
        self,
        design: SkinDesign,
        calibration: Calibration | None = None,
        *,
        table: ArrayLike | None = None,
        tracking: ZeroTracking | None = None,
        least_confidence: float = 0.5,
    ) -> None:
        calibration = calibration or Calibration.nominal(design)
        calibration.check_fits(design)
        self.design = design
        self.calibration = calibration
        watched = [design.magnet(site.magnet) for site in design.halls]
        upper = [s for s, magnet in enumerate(watched) if magnet.mount == "sheet"]
        lower = [s for s, magnet in enumerate(watched) if magnet.mount == "base"]
        if not upper or len(lower) != 1:
            raise ArgumentError(
                "design must have chips under magnets of the sheet and one over a magnet of the "
                f"base; got {len(upper)} and {len(lower)}"
            )
        if not 0.0 <= least_confidence <= 1.0:
            raise ArgumentError(f"least_confidence must lie in [0, 1]; got {least_confidence}")
        self._magnets = len(upper)
        self._readout = readout(design, calibration)
        self._inverse = FieldInverse(design)
        self._conditioner = Conditioner(
            design,
            self._inverse.rest_field,
            rest_cross_talk(design),
            calibration=calibration,
            tracking=tracking,
        )

        coefficients = calibration.coefficients
        if table is None:
            unit = unit_press(design, coefficients)
            self._rule = ideal_rule(unit)
        else:
            unit = _checked(table, (*design.cells, len(upper), 2))
            self._rule = measured_rule(unit)
        noise = readout_noise(design, self._readout)
        self._least_confidence = least_confidence
        self._unit = unit.reshape(*design.cells, -1)
        self._stiffness = stiffness_map(design, coefficients)
        # One row a cell: v_s K_z, v_f in x and y, certainty and share, then what a displacement
        # is multiplied by: to press depth, and to its distance from each face of the cell's cone.
        # Around them rows of nobody's, so that the index -1 of no cell has a row as well.
        per_press = self._unit / (self._unit**2).sum(axis=-1, keepdims=True)
        folding = folding_correction_map(design.cells, coefficients)
        cones = faces(self._rule, unit, noise[:-2, :-2])
        rows = np.concatenate(
            [
                self._stiffness.reshape(-1, 1),
                folding.reshape(-1, 2),
                cones.certainty[:, None],
                cones.share[:, None],
                per_press.reshape(-1, 2 * len(upper)),
                cones.normals.reshape(self._stiffness.size, -1),
            ],
            axis=1,
        )
        padded = np.zeros((design.cells[0] + 1, design.cells[1] + 1, rows.shape[1]))
        padded[..., 1:3] = 1.0
        padded[:-1, :-1] = rows.reshape(*design.cells, -1)
        self._cell_table = padded.reshape(-1, rows.shape[1])
        self._cell_strides = np.array([design.cells[1] + 1, 1])
        self._places = loaded_positions(design)
        self._covariance = self._covariances(noise)
        # Of a touch in one of several cells: the place and the press are unknown.
        self._drag_alone = np.full((5, 5), np.nan)
        self._drag_alone[2:4, 2:4] = self._covariance[0, 0, 2:4, 2:4]
        self._force_spread = self._force_spreads()

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._conditioner.drift

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take these readings of the untouched skin as its zero.

        Raises
        ------
        ArgumentError
            If there are none with all chips good.
        """
        self._conditioner.zero(readings)

    def reset(self) -> None:
        """Return to the design's zero and forget earlier readings."""
        self._conditioner.reset()

    def step(self, reading: Reading) -> Estimate:
        """The touch that one reading shows.

        Raises
        ------
        ArgumentError
            If the reading has another number of chips than the design.
        """
        conditioned = self._conditioner.step(reading)
        if conditioned.status is not None:
            return Estimate(time=reading.time, status=conditioned.status)
        return self._estimate(reading.time, self.solve(conditioned.field[None]), 0)

    def batch(self, readings: Sequence[Reading]) -> list[Estimate]:
        """The same as `step` on each reading in turn, faster.

        Raises
        ------
        ArgumentError
            If a reading has another number of chips than the design.
        """
        conditioned = [self._conditioner.step(reading) for reading in readings]
        rows = [k for k, one in enumerate(conditioned) if one.status is None]
        solution = self.solve(np.array([conditioned[k].field for k in rows])) if rows else None
        row_of = {k: row for row, k in enumerate(rows)}
        estimates = []
        for k, (reading, one) in enumerate(zip(readings, conditioned, strict=True)):
            if one.status is not None:
                estimates.append(Estimate(time=reading.time, status=one.status))
            elif solution is not None:
                estimates.append(self._estimate(reading.time, solution, row_of[k]))
        return estimates

    def solve(self, field: Floats) -> Solution:
        """Cells and forces of a batch of conditioned fields.

        Parameters
        ----------
        field : Floats, shape (T, S, 3)
            T, of the magnets alone, at reference temperature, in the skin's frame.
        """
        moved, found = self._inverse.displacements(field)
        wide = 2 * self._magnets
        parted = moved.reshape(len(field), -1) @ self._readout
        flat, shear = parted[:, :wide], parted[:, wide:]
        cell = decide(self._rule, flat.reshape(-1, self._magnets, 2))
        of_cell = self._cell_table.take(cell @ self._cell_strides, axis=0)
        rows = of_cell[:, 5:].reshape(len(field), -1, wide)
        products = (rows @ flat[:, :, None])[..., 0]
        force = np.empty((len(field), 3))
        force[:, :2] = shear
        gain = shear_gain(shear, of_cell[:, 1:3])
        press = products[:, 0]
        force[:, 2] = -normal_force(press, of_cell[:, 0], gain)
        sure = confidence(products[:, 1:], of_cell[:, 3], of_cell[:, 4])
        return Solution(cell, press, force, found, sure)

    def _estimate(self, time: float, solution: Solution, k: int) -> Estimate:
        """One row of a solution as an estimate."""
        if not solution.found[k]:
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        n, m = solution.cell[k].tolist()
        if n < 0 or m < 0 or not solution.press[k] > 0:
            return Estimate(time=time, status=Status.AMBIGUOUS)
        contact = Contact(position=self._places[n, m], force=solution.force[k])
        if solution.confidence[k] < self._least_confidence:
            return Estimate(
                time=time,
                status=Status.AMBIGUOUS,
                contacts=(contact,),
                covariance=self._drag_alone[None],
            )
        covariance = self._covariance[n, m].copy()
        covariance[4, 4] += (self._force_spread[n, m] * contact.force[2]) ** 2
        return Estimate(
            time=time, status=Status.CONTACT, contacts=(contact,), covariance=covariance[None]
        )

    def _covariances(self, noise: Floats) -> Floats:
        """Of (x, y, Fx, Fy, Fz) for each cell: a uniform place in it, the chips' noise in force."""
        extent = size(self.design.cell)
        wide = 2 * self._magnets
        per_press = self._unit / (self._unit**2).sum(axis=-1, keepdims=True)
        of_press = np.einsum("nmk,kl,nml->nm", per_press, noise[:wide, :wide], per_press)
        spread = np.zeros((*self.design.cells, 5, 5))
        spread[..., 0, 0] = extent.length**2 / 12
        spread[..., 1, 1] = extent.width**2 / 12
        spread[..., 2:4, 2:4] = noise[wide:, wide:]
        spread[..., 4, 4] = self._stiffness**2 * of_press
        return spread

    def _force_spreads(self) -> Floats:
        """Relative error of the normal force of a press anywhere in each cell, RMS, (N, M)."""
        extent = size(self.design.cell)
        inside = np.linspace(-0.4, 0.4, 5)
        steps = np.stack(np.meshgrid(inside, inside, indexing="ij"), axis=-1).reshape(-1, 2)
        places = self._places[..., None, :] + steps * (extent.length, extent.width)
        presses = vertex_shares(self.design, places) / self._stiffness
        motion = np.einsum("...nm,nmk->...k", presses, self._unit)
        per_press = self._unit / (self._unit**2).sum(axis=-1, keepdims=True)
        force = np.einsum("nmpk,nmk->nmp", motion, per_press) * self._stiffness[..., None]
        return np.asarray(np.sqrt(np.mean((force - 1) ** 2, axis=-1)))


def _checked(table: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """A table of that shape, finite and with some motion in every cell."""
    values = floats("table", table)
    if values.shape != shape:
        raise ArgumentError(f"table must have shape {shape}, (N, M, G, 2); got {values.shape}")
    for n, m in np.ndindex(shape[:2]):
        if not (np.isfinite(values[n, m]).all() and values[n, m].any()):
            raise ArgumentError(
                "table must be finite and not all zero in every cell; "
                f"got {values[n, m].tolist()} in cell ({n}, {m})"
            )
    return values
