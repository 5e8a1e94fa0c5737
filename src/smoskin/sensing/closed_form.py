"""The SI's own estimator: shear from the lower chip, the loaded cell from signs and ratios.

Decides where, how hard and which way from three chips without training: the lower chip gives
the drag (S26), whose share is taken off the upper magnets' motion; the signs of what is left
name a zone (Table S1), the ratios of the two magnets' displacements a column and a row in it
(S12), the size of the motion the press depth and the force (S27). The answer is a cell: its
place is known to no better than the cell's size, which the covariance says.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import hall
from smoskin.magnetics.inversion import FieldInverse, rest_cross_talk
from smoskin.mechanics.attenuation import magnet_displacements, profiles
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

_AXIS_TURNS: Final = np.array([0.0, 2 * np.pi])
"""Added to the directions of x and y, so that one sorted list of lines serves both."""


def signal_matrix(displacements: Floats) -> Ints:
    """Signs by which the zones are told apart: +1 where the load lies at larger x or y.

    Parameters
    ----------
    displacements : Floats, shape (..., 2, 2)
        Of the two magnets on the sheet, in x and y, m, caused by the press alone.

    Notes
    -----
    Source: SI Table S1, erratum E7 (row Z.5 is - + + -). A press spreads its cell, so that
    magnets move away from the load: the sign is the opposite of the displacement's.
    """
    return np.where(np.asarray(displacements) > 0, -1, 1)


class Divisions(NamedTuple):
    """How the two magnets' displacements along x and y name a column and a row of cells.

    The signs of the two displacements and their ratio are together one direction,
    ``arctan2(first, second)``. Lines on its circle divide the columns, and where the signs
    belong to no column, a sector is nobody's. A second circle divides the rows.
    """

    lines: Floats
    """(K,), rad, ascending: of x in (-pi, pi], of y one turn further."""
    cells: Ints
    """(K + 1,): the column (or row) between the lines; -1 where there is none."""


def divisions(unit_press: Floats) -> Divisions:
    """Dividing lines halfway between the ratios that neighbouring columns, and rows, give.

    Parameters
    ----------
    unit_press : Floats, shape (N, M, 2, 2)
        Displacements of the first and second magnet, in x and y, for a press on each cell. Along
        x they depend on the column alone, along y on the row.

    Notes
    -----
    Source: SI Eq. (S12) and Figure S5: the mean of two neighbours' ratios divides them.
    """
    lines, cells = [], []
    for turn, along in zip(
        _AXIS_TURNS, (unit_press[:, 0, :, 0], unit_press[0, :, :, 1]), strict=True
    ):
        direction = np.arctan2(along[:, 0], along[:, 1])
        for quarter in np.arange(-np.pi, np.pi - 0.1, np.pi / 2):
            members = np.flatnonzero((direction > quarter) & (direction < quarter + np.pi / 2))
            members = members[np.argsort(direction[members])]
            ratio, side = along[members, 0] / along[members, 1], np.sign(along[members, 1])
            between = np.arctan2(side[1:] * (ratio[1:] + ratio[:-1]) / 2, side[1:])
            lines += [quarter + turn, *(between + turn)]
            cells += members.tolist() if len(members) else [-1]
    return Divisions(np.array(lines), np.array([-1, *cells]))


def decide(rule: Divisions, displacements: Floats) -> Ints:
    """Cell (n, m) that displacements belong to, shape (..., 2); -1 where no cell gives them.

    Parameters
    ----------
    rule : Divisions
    displacements : Floats, shape (..., 2, 2)
        Of the first and second magnet, in x and y; a common factor does not matter.

    Notes
    -----
    Source: SI Eq. (S12): the signs name a zone (Table S1), the ratios a cell in it.
    """
    direction = np.arctan2(displacements[..., 0, :], displacements[..., 1, :])
    return np.asarray(rule.cells.take(rule.lines.searchsorted(direction + _AXIS_TURNS)))


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


class ClosedFormEstimator(Estimator):
    """Locates a touch to its cell and gives its force, from theory and a calibration alone.

    Parameters
    ----------
    design : SkinDesign
        With two magnets on the sheet and one on the base, each with its chip.
    calibration : Calibration, optional
        Of this skin; as designed by default.
    tracking : ZeroTracking, optional
        How the zero follows drift while the skin is idle.

    Raises
    ------
    ArgumentError
        If the design has another set of magnets.
    ModelError
        If the calibration belongs to another design.

    Notes
    -----
    Source: SI Eqs. (S5), (S6), (S12), (S26), (S27) and Table S1.
    Valid for one touch at a time, on or near a cell's top vertex.

    Examples
    --------
    >>> from smoskin.feasibility import load_design
    >>> from smoskin.twin.skin import Twin
    >>> design = load_design("planar")
    >>> touch = Contact(position=(0.05, 0.0667), force=(0.2, 0.0, -0.5))
    >>> estimate = ClosedFormEstimator(design).step(Twin(design).read([touch]))
    >>> estimate.status.name, estimate.contacts[0].position.round(3).tolist()
    ('CONTACT', [0.05, 0.067])
    """

    def __init__(
        self,
        design: SkinDesign,
        calibration: Calibration | None = None,
        *,
        tracking: ZeroTracking | None = None,
    ) -> None:
        calibration = calibration or Calibration.nominal(design)
        calibration.check_fits(design)
        self.design = design
        self.calibration = calibration
        watched = [design.magnet(site.magnet) for site in design.halls]
        upper = [s for s, magnet in enumerate(watched) if magnet.mount == "sheet"]
        lower = [s for s, magnet in enumerate(watched) if magnet.mount == "base"]
        if len(upper) != 2 or len(lower) != 1:
            raise ArgumentError(
                "design must have two chips under magnets of the sheet and one over a magnet of "
                f"the base; got {len(upper)} and {len(lower)}"
            )
        self._upper, self._lower = np.array(upper), lower[0]
        self._inverse = FieldInverse(design)
        self._conditioner = Conditioner(
            design, self._inverse.rest_field, rest_cross_talk(design), tracking=tracking
        )

        coefficients = calibration.coefficients
        parts = profiles(design.cell, design.cells, coefficients.attenuation, -1.0)
        unit = [magnet_displacements(parts, watched[s].corner) for s in upper]
        self._divisions = divisions(np.stack(unit, axis=2))
        self._unit = np.concatenate(unit, axis=-1)
        self._stiffness = stiffness_map(design, coefficients)
        # One row a cell: displacements to press depth, then v_s K_z, then v_f in x and y.
        per_press = self._unit / (self._unit**2).sum(axis=-1, keepdims=True)
        folding = folding_correction_map(design.cells, coefficients)
        table = np.concatenate([per_press, self._stiffness[..., None], folding], axis=-1)
        self._cell_table = table.reshape(-1, 7)
        self._cell_strides = np.array([design.cells[1], 1])
        self._places = loaded_positions(design)
        self._covariance = self._covariances()
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
        shear = self.calibration.board_stiffness * moved[:, self._lower, :2]
        # Chips are at rest in their own frame; a magnet's motion is the reverse of theirs.
        pressed = -moved.take(self._upper, axis=1)[..., :2]
        pressed -= (shear / self.calibration.sheet_stiffness)[:, None, :]
        cell = decide(self._divisions, pressed)
        # Where no cell was found the row is some cell's, and the cell says so.
        of_cell = self._cell_table.take(cell @ self._cell_strides, axis=0, mode="clip")
        press = np.einsum("tk,tk->t", pressed.reshape(-1, 4), of_cell[:, :4])
        force = np.empty((len(field), 3))
        force[:, :2] = shear
        gain = shear_gain(shear, of_cell[:, 5:])
        force[:, 2] = -normal_force(press, of_cell[:, 4], gain)
        return Solution(cell, press, force, found)

    def _estimate(self, time: float, solution: Solution, k: int) -> Estimate:
        """One row of a solution as an estimate."""
        if not solution.found[k]:
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        n, m = solution.cell[k].tolist()
        if n < 0 or m < 0 or not solution.press[k] > 0:
            return Estimate(time=time, status=Status.AMBIGUOUS)
        contact = Contact(position=self._places[n, m], force=solution.force[k])
        covariance = self._covariance[n, m].copy()
        covariance[4, 4] += (self._force_spread[n, m] * contact.force[2]) ** 2
        return Estimate(
            time=time, status=Status.CONTACT, contacts=(contact,), covariance=covariance[None]
        )

    def _covariances(self) -> Floats:
        """Of (x, y, Fx, Fy, Fz) for each cell: a uniform place in it, the chips' noise in force."""
        noise = hall.noise(self.design.hall_setting)[0]
        slope = self._inverse.rest_slope
        of_motion = (noise / slope[self._upper].mean()) ** 2
        of_board = (noise / slope[self._lower]) ** 2
        extent = size(self.design.cell)
        spread = np.zeros((*self.design.cells, 5, 5))
        spread[..., 0, 0] = extent.length**2 / 12
        spread[..., 1, 1] = extent.width**2 / 12
        spread[..., 2, 2] = spread[..., 3, 3] = self.calibration.board_stiffness**2 * of_board
        spread[..., 4, 4] = self._stiffness**2 * of_motion / (self._unit**2).sum(axis=-1)
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
