"""Makes the response table of a design by pressing its twin.

Decides which presses a table is made of: many of the skin as designed, with drags, with pairs and
with warm and cold rubber; and one set on many made skins, from which come the modes in which skins
differ. Each made sheet is read by chips and magnets of several draws, which cost next to nothing.
The equations are those of "Fit" and "Modes" in `docs/derivations.md`.
"""

from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from smoskin.arrays import Floats
from smoskin.datasets.patterns import far_pairs
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.compliance import grip_compliance
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.roles import Progress, unheard
from smoskin.sensing.response.fit import add_coupling, add_modes, add_warmth, fit_response_table
from smoskin.sensing.response.table import ResponseTable
from smoskin.twin.manufacture import Tolerances, draw, made_mechanics
from smoskin.twin.readout import Readout
from smoskin.twin.whole import Twin

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is pressed.

    Raises
    ------
    ArgumentError
        If a number is not positive.
    """

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


def make_table(
    design: SkinDesign,
    effort: Effort | None = None,
    *,
    tolerances: Tolerances | None = None,
    progress: Progress = unheard,
) -> ResponseTable:
    """The response table of a design, from presses of its twin; a minute or two.

    Parameters
    ----------
    design : SkinDesign
    effort : Effort, optional
    tolerances : Tolerances, optional
        What made skins are drawn from.
    progress : callable, optional

    Raises
    ------
    MissingExtraError
        If the extra `twin` is not installed.
    """
    work = effort or Effort()
    rng = np.random.default_rng([work.seed, 1])
    twin, ideal = Twin(design, seed=0), Readout(design)
    progress("the skin as designed", 0.0)
    presses = _draw_presses(design, work, rng, work.presses)
    signals = ideal.risen(twin.motions(presses))
    table = fit_response_table(design, presses.position[:, 0], presses.force[:, 0], signals)
    if work.pairs:
        progress("pairs of touches", 0.1)
        pairs = _draw_pairs(design, work, rng)
        motion = twin.motions(pairs)
        place, force = pairs.position[motion.valid], pairs.force[motion.valid]
        signals = ideal.risen(motion)[motion.valid]
        table = add_coupling(table, grip_compliance(design), place, force, signals)
    progress("warm and cold rubber", 0.2)
    presses = _draw_presses(design, work, rng, work.presses_a_skin)
    place, force = presses.position[:, 0], presses.force[:, 0]
    cold, hot = (
        ideal.risen(twin.motions(presses, temperature=REFERENCE_TEMPERATURE + degrees))
        for degrees in (-10.0, 10.0)
    )
    table = add_warmth(table, place, force, (hot - cold) / 20)
    signals, grips = _made_skins(design, work, presses, rng, tolerances, progress)
    if len(signals) > 1:
        designed = ideal.risen(twin.motions(presses))
        table = add_modes(table, place, force, signals - designed, grips)
    return replace(table, origin={"smoskin": version("smoskin"), "effort": asdict(work)})


def _made_skins(
    design: SkinDesign,
    work: Effort,
    presses: Touches,
    rng: np.random.Generator,
    tolerances: Tolerances | None,
    progress: Progress,
) -> tuple[Floats, Floats]:
    """Signals of L made skins in B presses, (L, B, S, 3), and their grips, (L, H, 2, H, 3)."""
    signals, grips = [], []
    for skin in range(work.skins):
        progress("made skins", 0.3 + 0.7 * skin / work.skins)
        # Seeds far from the small ones that people try.
        seed = 1_000_000 * (work.seed + 1) + skin
        made = Twin(design, seed=seed, manufactured=True, tolerances=tolerances)
        motion = made.motions(presses)
        grip = grip_compliance(*made_mechanics(design, made.deviations, REFERENCE_TEMPERATURE))
        for _ in range(work.draws):
            signals.append(Readout(design, draw(design, rng, tolerances)).risen(motion))
            grips.append(grip)
    return np.stack(signals), np.stack(grips)


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
        ("misfit of each signal, uT/N", ", ".join(f"{v:.1f}" for v in _misfit_microtesla(table))),
    ):
        shown.add_row(name, value)
    return shown


def _misfit_microtesla(table: ResponseTable) -> Floats:
    """Root mean square misfit of each signal, (C,), uT/N."""
    return np.asarray(np.sqrt(np.diag(table.misfit)) * 1e6)


def _draw_presses(
    design: SkinDesign, work: Effort, rng: np.random.Generator, count: int
) -> Touches:
    """Presses of one touch all over the skin; two in five are straight."""
    place = rng.uniform(0, geometry(design).extent, (count, 2))
    force = np.zeros((count, 3))
    force[:, 2] = -rng.uniform(*work.force, count)
    drag = work.drag * np.sqrt(rng.uniform(0, 1, count)) * (rng.uniform(0, 1, count) > 0.4)
    angle = rng.uniform(0, 2 * np.pi, count)
    force[:, 0], force[:, 1] = drag * np.cos(angle), drag * np.sin(angle)
    return Touches(position=place[:, None], force=force[:, None])


def _draw_pairs(design: SkinDesign, work: Effort, rng: np.random.Generator) -> Touches:
    """Presses of two straight touches, more than a cell apart."""
    cell = geometry(design).cell
    apart = float(max(cell.length, cell.width))
    place = far_pairs(geometry(design).extent, apart, work.pairs, rng)
    force = np.zeros((work.pairs, 2, 3))
    force[..., 2] = -rng.uniform(*work.force, (work.pairs, 2))
    return Touches(position=place, force=force)
