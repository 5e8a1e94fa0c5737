"""The SI's own estimator: from three chips to the loaded cell and the force, without training.

Decides how a reading becomes an estimate: conditioned, turned into motions of the chips against
their magnets (S5, S6), read as a touch (`smoskin.sensing.closed_form.sheets`), and judged. The
answer is a cell: its place is known to no better than the cell's size, which the covariance says.
"""

from collections.abc import Sequence

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.inversion import FieldInverse
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.sheets import IdealSheet, MeasuredSheet, Sheet, Solution
from smoskin.sensing.signals.signals import Signal, Signals
from smoskin.sensing.signals.zero import IdleBand, ZeroTracking


class ClosedFormEstimator(Estimator):
    """Locates a touch to its cell and gives its force, from theory or from a measured table.

    Parameters
    ----------
    design : SkinDesign
        With one magnet on the base and any number on the sheet, each with its chip. Two tell
        cells apart by the SI's ratios; `smoskin.sensing.closed_form.confidence.ambiguities` says
        which not.
    calibration : Calibration, optional
        Of this skin; as designed by default. With a press table in it cells are told apart and
        forces read as they were measured on this skin, without one as on an ideal sheet.
    tracking : ZeroTracking, optional
        How the zero follows drift while the skin is idle.
    idle_field : float
        T: signals below this on every axis count as idle.
    least_confidence : float
        A touch located less surely is `AMBIGUOUS`, its contact the likeliest cell.

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
        tracking: ZeroTracking | None = None,
        idle_field: float = 40e-6,
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
        self._inverse = FieldInverse(design)
        self._signals = Signals(
            design, calibration=calibration, tracking=tracking, idle=IdleBand(idle_field)
        )
        table = calibration.press_table
        self._sheet: Sheet = (
            IdealSheet(design, calibration)
            if table is None
            else MeasuredSheet(design, table, calibration.coefficients)
        )
        self._least_confidence = least_confidence
        self._places = geometry(design).tops
        extent = geometry(design).cell
        self._covariance = np.zeros((*design.cells, 5, 5))
        self._covariance[..., 0, 0] = extent.length**2 / 12
        self._covariance[..., 1, 1] = extent.width**2 / 12
        self._covariance[..., 2:, 2:] = self._sheet.noise
        # Of a touch in one of several cells: the place and the press are unknown.
        self._drag_alone = np.full((5, 5), np.nan)
        self._drag_alone[2:4, 2:4] = self._covariance[0, 0, 2:4, 2:4]

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._signals.drift

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take these readings of the untouched skin as its zero.

        Raises
        ------
        ArgumentError
            If there are none with all chips good.
        """
        self._signals.zero(readings)

    def reset(self) -> None:
        """Return to the design's zero and forget earlier readings."""
        self._signals.reset()

    def step(self, reading: Reading) -> Estimate:
        """The touch that one reading shows.

        Raises
        ------
        ArgumentError
            If the reading has another number of chips than the design.
        """
        signal = self._signals.step(reading)
        if signal.status is not None:
            return Estimate(time=reading.time, status=signal.status)
        return self._estimate(reading.time, self.solve(self._field(signal)[None]), 0)

    def batch(self, readings: Sequence[Reading]) -> list[Estimate]:
        """The same as `step` on each reading in turn, faster.

        Raises
        ------
        ArgumentError
            If a reading has another number of chips than the design.
        """
        signals = [self._signals.step(reading) for reading in readings]
        rows = [k for k, signal in enumerate(signals) if signal.status is None]
        solution = self.solve(np.array([self._field(signals[k]) for k in rows])) if rows else None
        row_of = {k: row for row, k in enumerate(rows)}
        estimates = []
        for k, (reading, signal) in enumerate(zip(readings, signals, strict=True)):
            if signal.status is not None:
                estimates.append(Estimate(time=reading.time, status=signal.status))
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
        return self._sheet.solve(moved.reshape(len(field), -1), found)

    def _field(self, signal: Signal) -> Floats:
        """Field of the chips' own magnets, (S, 3), T."""
        return self._signals.rest_field + signal.values

    def _estimate(self, time: float, solution: Solution, k: int) -> Estimate:
        """One row of a solution as an estimate."""
        if not solution.found[k]:
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        n, m = solution.cell[k].tolist()
        if n < 0 or m < 0 or not solution.force[k, 2] < 0:
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
        covariance[2:, 2:] += self._sheet.place[n, m] * contact.force[2] ** 2
        return Estimate(
            time=time, status=Status.CONTACT, contacts=(contact,), covariance=covariance[None]
        )
