"""Calibration of a skin by a few touches: a rig makes them one by one, or a person by a sheet.

Decides how many touches are made, which are left out and replaced (those under which a chip reaches
the end of its range), and what is said meanwhile: where to touch next and how far off a located
touch would still be. What comes out is the response table of the very skin, for `smoskin run`.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from smoskin.commands.touch_sheet import read_held_touches
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.records import Contact, Status
from smoskin.roles import Rig
from smoskin.sensing.response.calibrate import (
    DEFAULT_COUNT,
    Target,
    TouchPlanner,
    calibrate_touches,
)
from smoskin.sensing.response.labels import Label, Labeller, labelled_touches
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.service.recorder import open_recording
from smoskin.twin.creep import Creep
from smoskin.twin.rig import VirtualRig
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table

_PATIENCE: Final = 30.0
"""s that a rig may take for a touch."""
_RIG: Final = 7
"""Tells a rig's randomness from all else that a seed begins."""
_TRIES: Final = 2
"""Touches that are made at most, over those that are asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchOrder:
    """What a rig is asked to do.

    Raises
    ------
    ArgumentError
        If the count or a force is not positive, or the drag or the error is negative.
    """

    count: int = DEFAULT_COUNT
    """Touches that can be used."""
    until: float = 0.0
    """m: fewer are made if a located touch is expected to be no further off than this."""
    force: float = 0.8
    """N, largest normal force."""
    drag: float = 0.3
    """N, largest sideways force; 0 for a rig that presses straight."""

    def __post_init__(self) -> None:
        if self.count < 1 or not self.force > 0 or not min(self.drag, self.until) >= 0:
            raise ArgumentError(
                f"count and force must be positive, drag and until >= 0; got {self.count}, "
                f"{self.force} N, {self.drag} N and {self.until} m"
            )


class TouchStep(NamedTuple):
    """One touch that a rig has made."""

    number: int
    """Of the touches that can be used, from 1; that of the one before, where this cannot."""
    asked: int
    """How many are asked for."""
    contact: Contact
    status: Status | None
    """Why it cannot be used; None where it can."""
    error: float
    """m: how far off a located touch is expected to be now; root mean square over the skin."""
    following: Target | None
    """Where to touch next; None after the last."""

    @property
    def sentence(self) -> str:
        """What has been done and what comes next."""
        state = f"touch {self.number} of {self.asked}: located to {1e3 * self.error:.2f} mm"
        if self.status is not None:
            state = f"left out ({self.status.name.lower()}); {state}"
        if self.following is None:
            return state
        (x, y), (fx, fy, fz) = 1e3 * self.following.position, self.following.force
        return f"{state}; next ({x:.0f}, {y:.0f}) mm with ({fx:g}, {fy:g}, {fz:g}) N"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchCalibration:
    """A skin's own table and what it rests on."""

    table: ResponseTable
    labels: tuple[Label, ...]
    """All touches that were made, those left out included."""
    errors: tuple[float, ...]
    """m: how far off a located touch is expected to be, before the first touch and after each that
    was used; root mean square over the skin, of straight touches of 0.5 N."""

    @property
    def used(self) -> int:
        """How many touches it rests on."""
        return len(self.errors) - 1

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        return {
            "design_hash": self.table.design_hash,
            "touches": self.used,
            "left_out": len(self.labels) - self.used,
            "expected_error_mm": [round(1e3 * one, 4) for one in self.errors],
            "misfit_uT_per_N": (np.sqrt(np.diag(self.table.misfit)) * 1e6).round(3).tolist(),
            "made": [
                {
                    "x_mm": round(1e3 * float(one.contact.position[0]), 3),
                    "y_mm": round(1e3 * float(one.contact.position[1]), 3),
                    "force_N": one.contact.force.round(4).tolist(),
                    "left_out": None if one.status is None else one.status.name,
                }
                for one in self.labels
            ],
        }

    def tables(self) -> "list[Table]":
        """How the expected error fell, for people."""
        from rich.table import Table

        shown = Table(title="Calibration by touches")
        for name in ("touches", "a located touch is off by"):
            shown.add_column(name, justify="right")
        for count in sorted({*(c for c in _MILESTONES if c < self.used), self.used}):
            shown.add_row(str(count), f"{1e3 * self.errors[count]:.2f} mm")
        lost = len(self.labels) - self.used
        if lost:
            shown.caption = f"{lost} touches were left out: a chip could not read them."
        return [shown]


_MILESTONES: Final = (0, 1, 2, 5, 10, 15, 30, 60, 120, 240)


def virtual_rig(design: SkinDesign, seed: int, *, temperature: float = 25.0) -> VirtualRig:
    """A rig with a made skin on it, whose rubber creeps and whose chips drift.

    Parameters
    ----------
    design : SkinDesign
    seed : int
        Of the skin, as `smoskin.open_source` takes it, and of everything that spoils touches.
    temperature : float
        degC.

    Raises
    ------
    MissingExtraError
        Without the extra ``twin``.
    """
    return VirtualRig(
        Twin(design, seed=seed, manufactured=True),
        np.random.default_rng([seed, _RIG]),
        temperature=temperature,
        creep=Creep(design),
    )


def calibrate_with_rig(
    design: SkinDesign,
    table: ResponseTable,
    rig: Rig,
    order: TouchOrder | None = None,
    *,
    progress: Callable[[TouchStep], None] = lambda step: None,
) -> TouchCalibration:
    """The table of the skin that is on a rig.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Of the design.
    rig : Rig
        Left open.
    order : TouchOrder, optional
    progress : callable, optional
        Is told of each touch.

    Raises
    ------
    ModelError
        If the table belongs to another design.
    SourceError
        If the rig does not answer in time.
    ArgumentError
        If no touch can be used: every one ends a chip's range.
    """
    asked = order or TouchOrder()
    planner = _planner(design, table, asked, rig.place_spread, rig.force_spread)
    labeller = Labeller(design, elastomer_prony(design.columns.material))
    labels: list[Label] = []
    errors = [planner.error]
    target = planner.next()
    while True:
        labels.append(
            labeller.label(
                rig.press(Contact(position=target.position, force=target.force), _PATIENCE)
            )
        )
        if labels[-1].status is None:
            planner.made(labels[-1].contact.position, labels[-1].contact.force)
            errors.append(planner.error)
        else:
            planner.bar(target)
        enough = len(errors) > asked.count or errors[-1] <= asked.until
        over = enough or len(labels) >= _TRIES * asked.count or planner.exhausted
        following = None if over else planner.next()
        progress(
            TouchStep(
                number=len(errors) - 1,
                asked=asked.count,
                contact=labels[-1].contact,
                status=labels[-1].status,
                error=errors[-1],
                following=following,
            )
        )
        if following is None:
            break
        target = following
    return _calibrated(
        design, table, labels, errors, place_spread=rig.place_spread, force_spread=rig.force_spread
    )


def calibrate_with_sheet(
    design: SkinDesign,
    table: ResponseTable,
    sheet: str | os.PathLike[str],
    *,
    recording: str | os.PathLike[str] | None = None,
    place_spread: float = 0.5e-3,
    force_spread: float = 0.01,
) -> TouchCalibration:
    """The table of a skin that a person has touched.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Of the design.
    sheet : path
        CSV, as `smoskin.commands.touch_sheet.read_held_touches` describes it.
    recording : path, optional
        MCAP file with the chips' readings, where the sheet says only when each touch was held;
        creep is undone then. Without it every touch was held until it settled.
    place_spread, force_spread : float
        m and N: standard deviations of the places and forces that the person wrote down.

    Raises
    ------
    ModelError
        If the table belongs to another design.
    RecordingError
        If sheet or recording cannot be read or do not fit each other.
    ArgumentError
        If no touch can be used.
    """
    planner = _planner(design, table, TouchOrder(), place_spread, force_spread)
    readings = None if recording is None else open_recording(recording).readings()
    touches = read_held_touches(sheet, design, readings)
    rubber = None if recording is None else elastomer_prony(design.columns.material)
    labeller = Labeller(design, rubber)
    labels = [labeller.label(one) for one in touches]
    errors = [planner.error]
    for label in labels:
        if label.status is None:
            planner.made(label.contact.position, label.contact.force)
            errors.append(planner.error)
    return _calibrated(
        design, table, labels, errors, place_spread=place_spread, force_spread=force_spread
    )


def plan_of(
    design: SkinDesign,
    table: ResponseTable,
    order: TouchOrder,
    made: Sequence[Contact] = (),
    *,
    place_spread: float = 0.5e-3,
    force_spread: float = 0.01,
) -> list[Target]:
    """The touches that a person shall make after those made already.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Of the design.
    order : TouchOrder
    made : sequence of Contact, optional
    place_spread, force_spread : float
        m and N: standard deviations of the places and forces that the person writes down.

    Raises
    ------
    ModelError
        If the table belongs to another design.
    """
    planner = _planner(design, table, order, place_spread, force_spread)
    for contact in made:
        planner.made(contact.position, contact.force)
    targets: list[Target] = []
    while len(targets) < order.count and planner.error > order.until:
        targets.append(planner.next())
        planner.made(targets[-1].position, targets[-1].force)
    return targets


def _calibrated(
    design: SkinDesign,
    table: ResponseTable,
    labels: list[Label],
    errors: list[float],
    *,
    place_spread: float,
    force_spread: float,
) -> TouchCalibration:
    """The table that labels make of the design's."""
    given = labelled_touches(
        labels, table.chips, place_spread=place_spread, force_spread=force_spread
    )
    fitted = calibrate_touches(table, given, signal_noise(design, table.chips))
    return TouchCalibration(table=fitted, labels=tuple(labels), errors=tuple(errors))


def _planner(
    design: SkinDesign,
    table: ResponseTable,
    order: TouchOrder,
    place_spread: float,
    force_spread: float,
) -> TouchPlanner:
    """Where to touch a skin of this design, whose table it must be."""
    design.check_own("table", table.design_hash)
    return TouchPlanner(
        table,
        signal_noise(design, table.chips),
        force=order.force,
        drag=order.drag,
        place_spread=place_spread,
        force_spread=force_spread,
    )
