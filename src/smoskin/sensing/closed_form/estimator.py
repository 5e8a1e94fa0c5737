"""The SI's own estimator: from three chips to the loaded cell and the force, without training.

Decides how signals become an estimate: turned into motions of the chips against their magnets
(S5, S6) from where the untouched skin's field says that they rest, read as a touch
(`smoskin.sensing.closed_form.sheets`), and judged. The answer is a cell: its place is known to no
better than the cell's size, which the covariance says.
"""

from typing import Final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.inversion import FieldInverse
from smoskin.mechanics.sheet.touches import Covered, Sticking
from smoskin.mechanics.viscoelasticity import ELASTIC
from smoskin.origami.geometry import geometry
from smoskin.records import Contact, Estimate, Status
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.measured import MeasuredSheet, cell_answers
from smoskin.sensing.closed_form.sheets import IdealSheet, Sheet
from smoskin.sensing.closed_form.statics import StaticSheet
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.estimator import SignalEstimator
from smoskin.sensing.signals.idle import IdleBand
from smoskin.sensing.signals.zero import ZeroTracking

_HARDEST: Final = 20.0
"""Force, N, up to which theory is taken at its word; columns are crushed long before."""


class ClosedFormEstimator(SignalEstimator):
    """Locates a touch to its cell and gives its force, from theory or from a skin's response table.

    Parameters
    ----------
    design : SkinDesign
        With one magnet on the base and any number on the sheet, each with its chip. Two tell
        cells apart by the SI's ratios; `smoskin.sensing.closed_form.confidence.ambiguities` says
        which not.
    known : Calibration or ResponseTable, optional
        What is known of this skin. A calibration reads it as an ideal sheet, by default the one
        designed, and holds the zero; a response table cell by cell, as this very sheet answers.
    grip : Sticking or Covered, optional
        How touches hold on to the skin. Where it is given, a calibration reads the skin by the
        statics of a sheet on columns that bend (`smoskin.sensing.closed_form.statics`), whose cells
        are named under drags too; by default as the SI's, which a drag shifts and nothing else.
    tracking : ZeroTracking, optional
        How the zero follows drift while the skin is idle.
    idle_field : float
        T: signals below this on every axis count as idle.
    least_confidence : float
        A touch located less surely is `AMBIGUOUS`, its contact the likeliest cell.

    Raises
    ------
    ArgumentError
        If the design has another set of magnets, or a grip is given for a skin that is not flat or
        is known by a table, which knows its own.
    ModelError
        If the calibration or the table belongs to another design, or the table lacks chips.

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

    @typed
    def __init__(
        self,
        design: SkinDesign,
        known: Calibration | ResponseTable | None = None,
        *,
        grip: Sticking | Covered | None = None,
        tracking: ZeroTracking | None = None,
        idle_field: float = 40e-6,
        least_confidence: float = 0.5,
    ) -> None:
        calibration = known if isinstance(known, Calibration) else Calibration.nominal(design)
        calibration.check_fits(design)
        mounts = [design.magnet(site.magnet).mount for site in design.halls]
        if "sheet" not in mounts or mounts.count("base") != 1:
            raise ArgumentError(
                "design must have chips under magnets of the sheet and one over a magnet of the "
                f"base; got {mounts.count('sheet')} and {mounts.count('base')}"
            )
        if not 0.0 <= least_confidence <= 1.0:
            raise ArgumentError(f"least_confidence must lie in [0, 1]; got {least_confidence}")
        super().__init__(
            design,
            range(len(mounts)),
            creep=ELASTIC,
            tracking=tracking or ZeroTracking(),
            idle=IdleBand(idle_field),
            correction=calibration.field_correction,
            most=known.forces[1] if isinstance(known, ResponseTable) else _HARDEST,
            # The SI's skin reads as designed, unless a table says that this one does not.
            zeroed=not isinstance(known, ResponseTable),
        )
        self._inverse = FieldInverse(design)
        self._sheet = _sheet(design, calibration if known is None else known, grip)
        self._least_confidence = least_confidence
        designed = self._signals.rest_field
        self._rest = designed, np.zeros_like(designed)
        self._tops, extent = geometry(design).tops, geometry(design).cell
        self._covariance = np.zeros((*design.cells, 5, 5))
        self._covariance[..., 0, 0] = extent.length**2 / 12
        self._covariance[..., 1, 1] = extent.width**2 / 12
        self._covariance[..., 2:, 2:] = self._sheet.noise
        # Place and press of a touch in one of several cells are unknown.
        self._drag_alone = np.full((1, 5, 5), np.nan)
        self._drag_alone[0, 2:4, 2:4] = self._covariance[0, 0, 2:4, 2:4]

    def _resting(self) -> tuple[Floats, Floats]:
        """Field of each chip's own magnet at rest, (S, 3), T, and where that is, m."""
        signals = self._signals
        if isinstance(self._sheet, MeasuredSheet):
            return self._rest
        if not np.array_equal(signals.rest, self._rest[0]):
            # A magnet that hangs off its place stays as far off while it moves. S6's offset has it
            # in place and adds a difference of fields, which differs where the magnet moves to.
            places, within = self._inverse.displacements(signals.rest[None])
            designed = signals.rest_field, np.zeros_like(signals.rest_field)
            self._rest = (signals.rest, places[0]) if within[0] else designed
        return self._rest

    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        rest, place = self._resting()
        moved, within = self._inverse.displacements((rest + signals.reshape(-1, 3))[None])
        if not within[0]:
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        solution = self._sheet.solve((moved[0] - place).ravel())
        if solution is None:
            return Estimate(time=time, status=Status.AMBIGUOUS)
        if solution.misfit > self._sheet.most_misfit:
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        cell, force, confidence, _ = solution
        contact = Contact(position=self._tops[cell], force=force)
        if confidence < self._least_confidence:
            status, covariance = Status.AMBIGUOUS, self._drag_alone
        else:
            status, covariance = Status.CONTACT, self._covariance[cell][None].copy()
            covariance[0, 2:, 2:] += self._sheet.place[cell] * force[2] ** 2
        return Estimate(time=time, status=status, contacts=(contact,), covariance=covariance)


def _sheet(
    design: SkinDesign, known: Calibration | ResponseTable, grip: Sticking | Covered | None
) -> Sheet:
    """The model of the sheet by which motions are read."""
    if isinstance(known, ResponseTable):
        if grip is not None:
            raise ArgumentError("grip must be None where a response table is given")
        return MeasuredSheet(design, cell_answers(design, known))
    return IdealSheet(design, known) if grip is None else StaticSheet(design, known, grip)
