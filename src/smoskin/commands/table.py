"""Makes the response table of a design by pressing its twin.

Decides which presses a table is made of: many of the skin as designed, with drags, with pairs and
with warm and cold rubber; and one set on many made skins, from which come the modes in which skins
differ. Each is a data set, so that it resumes. Each made sheet is read by chips and magnets of
several draws. The equations are those of "Fit" and "Modes" in `docs/derivations.md`.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.datasets.patterns import Repeated, Sweep
from smoskin.datasets.store import Dataset, write_dataset
from smoskin.datasets.workers import Engine
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.nonlinearity import field_curvature
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.compliance import grip_compliance, load_coupling
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.origami.geometry import geometry
from smoskin.records import Motion
from smoskin.roles import Progress, unheard
from smoskin.sensing.response.fit import (
    add_coupling,
    add_modes,
    add_warmth,
    fit_response_table,
    least_presses,
)
from smoskin.sensing.response.table import ResponseTable
from smoskin.twin.manufacture import Tolerances, draw, made_mechanics
from smoskin.twin.readout import Readout
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table

_WARMTH: Final = tuple(REFERENCE_TEMPERATURE + degrees for degrees in (-10.0, 0.0, 10.0))
"""Temperatures between which the effect of warmth is taken, degC."""
_NUDGE: Final = 1e-6
"""m and rad: step of the differences by magnets' motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is pressed; numbers that are not positive raise an `ArgumentError`."""

    presses: int = 12_000
    """Presses of the skin as designed, one touch each."""
    pairs: int = 4_000
    """Presses of the skin as designed, two touches each; 0 leaves two touches to add up."""
    skins: int = 96
    """Made sheets."""
    draws: int = 4
    """Draws of magnets and chips on each made sheet."""
    presses_a_skin: int = 640
    """Presses of each made skin, the same on all."""
    force: tuple[float, float] = (0.05, 1.15)
    """N, normal, from and to."""
    drag: float = 0.6
    """N, largest."""
    seed: int = 0
    """Seed of the presses and of the made skins; skins that judge the table should have others."""

    def __post_init__(self) -> None:
        counts = (self.presses, self.skins, self.draws, self.presses_a_skin)
        if min(counts) < 1 or self.pairs < 0:
            raise ArgumentError(f"counts must be positive; got {counts} and {self.pairs} pairs")
        if not 0 < self.force[0] < self.force[1] or not self.drag >= 0:
            raise ArgumentError(f"force must rise from above 0; got {self.force} and {self.drag} N")


@typed
def make_table(
    design: SkinDesign,
    effort: Effort | None = None,
    *,
    tolerances: Tolerances | None = None,
    folder: str | os.PathLike[str] | None = None,
    engine: Engine | None = None,
    progress: Progress = unheard,
) -> ResponseTable:
    """The response table of a design, from presses of its twin; a minute or two.

    The presses are data sets. Made again in the same folder, after a kill too, the table is the
    same to the last bit, and what has been pressed already is not pressed again.

    Parameters
    ----------
    tolerances : Tolerances, optional
        What made skins are drawn from; by default the usual ones, each under a cover of its own:
        what loads the sheet between vertices is then among the modes.
    folder : path, optional
        Folder that keeps the presses; by default they are thrown away.
    engine : Engine, optional
        Where to press; by default one process a core of this machine.

    Raises
    ------
    ArgumentError
        If there are fewer presses than the table needs.
    RecordingError
        If the folder holds presses of another design, effort or version.
    EngineError
        If the workers fail; what has been pressed stays in the folder.
    MissingExtraError
        If the extras `twin` and `data` are not installed.
    """
    work = effort or Effort()
    if work.presses < (least := least_presses(design)):
        raise ArgumentError(f"presses must be at least {least} of this design; got {work.presses}")
    sweeps = _plan(design, work, tolerances or Tolerances(contact=1.0))
    total, before = sum(sweep.rows for sweep in sweeps.values()), 0
    pressed: dict[str, Dataset] = {}
    with TemporaryDirectory() as passing:
        for name, sweep in sweeps.items():
            scaled = partial(_tell, progress, name, before / total, sweep.rows / total)
            file = Path(folder or passing) / name
            pressed[name] = write_dataset(file, design, sweep, engine=engine, progress=scaled)
            before += sweep.rows
        table = _fit(design, work, pressed)
    return replace(table, origin={"smoskin": version("smoskin"), "effort": asdict(work)})


def _tell(
    progress: Progress, name: str, begin: float, share: float, rows: str, done: float
) -> None:
    """Tell how far one data set among others is."""
    progress(f"{name}: {rows}", begin + share * done)


def _plan(design: SkinDesign, work: Effort, tolerances: Tolerances) -> dict[str, Sweep]:
    """What is pressed, by the names of the data sets."""
    press, seed, cell = partial(Repeated, forces=work.force), 3 * work.seed, geometry(design).cell
    compared = press(count=work.presses_a_skin, drag=work.drag, seed=seed + 2)
    plan = {"designed": Sweep(presses=press(count=work.presses, drag=work.drag, seed=seed))}
    if work.pairs:
        apart = float(max(cell.length, cell.width))
        plan["pairs"] = Sweep(presses=press(count=work.pairs, apart=apart, seed=seed + 1))
    plan["warmth"] = Sweep(presses=compared, temperatures=_WARMTH)
    first = 1_000_000 * (work.seed + 1)  # far from the small seeds that people try
    plan["skins"] = Sweep(
        presses=compared,
        skins=tuple(range(first, first + work.skins)),
        tolerances=tolerances,
        presses_per_chunk=work.presses_a_skin,
    )
    return plan


def _fit(design: SkinDesign, work: Effort, pressed: Mapping[str, Dataset]) -> ResponseTable:
    """The table of these presses."""
    ideal = Readout(design)
    place, force, motion = _read(pressed["designed"])
    table = fit_response_table(design, place[:, 0], force[:, 0], ideal.risen(motion))
    if work.pairs:
        place, force, motion = _read(pressed["pairs"])
        valid, signals = motion.valid, ideal.risen(motion)
        table = add_coupling(
            table,
            grip_compliance(design),
            place[valid],
            force[valid],
            signals[valid],
            coupling=load_coupling(design, _motion_slopes(design, ideal)),
            curvature=field_curvature(design),
        )
    place, force, motion = _read(pressed["warmth"])
    cold, designed, hot = np.split(ideal.risen(motion), len(_WARMTH))
    place, force = place[: len(cold), 0], force[: len(cold), 0]
    table = add_warmth(table, place, force, (hot - cold) / (_WARMTH[-1] - _WARMTH[0]))
    signals, grips = _made_skins(design, work, pressed["skins"])
    if len(signals) > 1:
        table = add_modes(table, place, force, signals - designed, grips)
    return table.with_open_contact()


def _motion_slopes(design: SkinDesign, ideal: Readout) -> Floats:
    """Slopes of the signals by every vertex's motion over the board, (C, V, 3), T/m."""
    holders = holder_matrix(design)
    magnets = holders.shape[:2]
    small = _NUDGE * np.eye(math.prod(magnets)).reshape(-1, *magnets)
    still = np.zeros((len(small), 6))
    ends = [ideal.risen(Motion(magnets=sign * small, board=still)) for sign in (1.0, -1.0)]
    slopes = (ends[0] - ends[1]).reshape(len(small), -1) / (2 * _NUDGE)
    return np.tensordot(slopes, holders.reshape(len(small), *holders.shape[2:]), (0, 0))


def _made_skins(design: SkinDesign, work: Effort, pressed: Dataset) -> tuple[Floats, Floats]:
    """Signals of L made skins in B presses, (L, B, S, 3), and their grips, (L, H, 2, H, 3)."""
    rng, tolerances = np.random.default_rng([work.seed, 1]), pressed.sweep.tolerances
    signals, grips = [], []
    for seed, rows in zip(pressed.sweep.skins, pressed.chunks(), strict=True):
        made = Twin(design, seed=seed, manufactured=True, tolerances=tolerances)
        grip = grip_compliance(
            design, *made_mechanics(design, made.deviations, REFERENCE_TEMPERATURE)
        )
        for _ in range(work.draws):
            signals.append(Readout(design, draw(design, rng, tolerances)).risen(rows.motion))
            grips.append(grip)
    return np.stack(signals), np.stack(grips)


def _read(pressed: Dataset) -> tuple[Floats, Floats, Motion]:
    """Places, (R, K, 2), forces, (R, K, 3), and motions of all presses of a data set."""
    rows = list(pressed.chunks())
    return (
        np.concatenate([part.position for part in rows]),
        np.concatenate([part.force for part in rows]),
        Motion.concatenate([part.motion for part in rows]),
    )


def table_facts(table: ResponseTable) -> dict[str, object]:
    """What there is to say of a table, as plain values for machines."""
    return {
        "design_hash": table.design_hash,
        "chips": list(table.chips),
        "forces_N": list(table.forces),
        "modes": len(table.modes),
        "misfit_uT_per_N": _misfit_microtesla(table).tolist(),
        "origin": dict(table.origin),
    }


def table_rows(table: ResponseTable, title: str) -> "Table":
    """What there is to say of a table, for people."""
    from rich.table import Table

    shown = Table(title=title, show_header=False)
    low, high = table.forces
    for name, value in (
        ("chips", ", ".join(str(chip) for chip in table.chips)),
        ("normal forces", f"{low:.2f} to {high:.2f} N"),
        ("modes in which made skins differ", str(len(table.modes))),
        (
            "missed by each signal of presses held out, uT/N",
            ", ".join(f"{v:.1f}" for v in _misfit_microtesla(table)),
        ),
    ):
        shown.add_row(name, value)
    return shown


def _misfit_microtesla(table: ResponseTable) -> Floats:
    """Root mean square misfit of each signal, (C,), uT/N."""
    return np.asarray(np.sqrt(np.diag(table.misfit)) * 1e6)
