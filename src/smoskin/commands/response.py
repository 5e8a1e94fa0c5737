"""Presses the twin all over and writes what its chips read as a response table.

Decides which presses a table is made of: many of the skin as designed, with drags, with pairs and
with warm and cold rubber; and one set on many made skins, from which come the modes in which skins
differ. Each made sheet is read by chips and magnets of several draws, which cost next to nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from smoskin.arrays import Floats
from smoskin.datasets.patterns import far_pairs
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.sheet.compliance import grip_compliance
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.cell import size
from smoskin.origami.layout import skin_extent
from smoskin.sensing.response.fit import add_coupling, add_modes, add_warmth, fit_response_table
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.twin.manufacture import Tolerances, draw, made_mechanics
from smoskin.twin.readout import Motion, Readout
from smoskin.twin.whole import Twin

Progress = Callable[[str, float], None]
"""Is told what is being pressed, and the share of the whole work that is done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is pressed.

    Raises
    ------
    ArgumentError
        If a number is not positive.
    """

    presses: int = 12_000
    """Of the skin as designed, one touch each."""
    pairs: int = 4_000
    """Of the skin as designed, two touches each; 0 leaves two touches to add up."""
    skins: int = 96
    """Made sheets."""
    draws: int = 4
    """Of magnets and chips on each made sheet."""
    presses_a_skin: int = 640
    """The same on each made skin."""
    force: tuple[float, float] = (0.05, 1.15)
    """N, normal, from and to."""
    drag: float = 0.6
    """N, largest."""
    seed: int = 0
    """Of the presses and of the made skins; skins of a judgement should have others."""

    def __post_init__(self) -> None:
        counts = (self.presses, self.skins, self.draws, self.presses_a_skin)
        if min(counts) < 1 or self.pairs < 0:
            raise ArgumentError(f"counts must be positive; got {counts} and {self.pairs} pairs")
        if not 0 < self.force[0] < self.force[1] or not self.drag >= 0:
            raise ArgumentError(f"force must rise from above 0; got {self.force} and {self.drag} N")


def make_response_table(
    design: SkinDesign,
    effort: Effort | None = None,
    *,
    tolerances: Tolerances | None = None,
    progress: Progress = lambda task, share: None,
) -> ResponseTable:
    """The response table of a design, from presses of its twin; some minutes.

    Parameters
    ----------
    design : SkinDesign
    effort : Effort, optional
    tolerances : Tolerances, optional
        What made skins are drawn from.
    progress : callable, optional
    """
    work = effort or Effort()
    rng = np.random.default_rng([work.seed, 1])
    twin, ideal = Twin(design, seed=0), Readout(design)
    progress("the skin as designed", 0.0)
    where, push = _draw_presses(design, work, rng, work.presses)
    settled = ideal.risen(_pressed(twin, where, push))
    table = fit_response_table(design, where, push, settled)
    if work.pairs:
        progress("pairs of touches", 0.1)
        places, forces = _draw_pairs(design, work, rng)
        motion = twin.motions(Touches(position=places, force=forces))
        kept = motion.valid
        both = ideal.risen(motion)[kept]
        table = add_coupling(table, grip_compliance(design), places[kept], forces[kept], both)
    progress("warm and cold rubber", 0.2)
    where, push = _draw_presses(design, work, rng, work.presses_a_skin)
    cold, hot = (
        ideal.risen(_pressed(twin, where, push, REFERENCE_TEMPERATURE + degrees))
        for degrees in (-10.0, 10.0)
    )
    table = add_warmth(table, where, push, (hot - cold) / 20)
    designed = ideal.risen(_pressed(twin, where, push))
    ways, grips = [], []
    for skin in range(work.skins):
        progress("made skins", 0.3 + 0.7 * skin / work.skins)
        made = Twin(design, seed=_skin_seed(work, skin), manufactured=True, tolerances=tolerances)
        motion = _pressed(made, where, push)
        mechanics = made_mechanics(design, made.deviations, REFERENCE_TEMPERATURE)
        grip = grip_compliance(*mechanics)
        for _ in range(work.draws):
            readout = Readout(design, draw(design, rng, tolerances))
            ways.append(readout.risen(motion) - designed)
            grips.append(grip)
    if len(ways) < 2:
        return table
    return add_modes(table, where, push, np.stack(ways), np.stack(grips))


def cached_response_table(
    design: SkinDesign,
    path: Path | str,
    effort: Effort | None = None,
    *,
    progress: Progress = lambda task, share: None,
) -> ResponseTable:
    """The table in a file, made and written first where there is none.

    Raises
    ------
    ModelError
        If the file holds something else.
    """
    file = Path(path)
    if file.exists():
        return load_response_table(file)
    table = make_response_table(design, effort, progress=progress)
    table.save(file)
    return table


def _skin_seed(work: Effort, skin: int) -> int:
    """Seeds of made skins, far from the small ones that people try."""
    return 1_000_000 * (work.seed + 1) + skin


def _draw_presses(
    design: SkinDesign, work: Effort, rng: np.random.Generator, count: int
) -> tuple[Floats, Floats]:
    """Places (B, 2) and forces (B, 3) all over the skin; two in five are straight."""
    where = rng.uniform(0, skin_extent(design), (count, 2))
    push = np.zeros((count, 3))
    push[:, 2] = -rng.uniform(*work.force, count)
    drag = work.drag * np.sqrt(rng.uniform(0, 1, count)) * (rng.uniform(0, 1, count) > 0.4)
    angle = rng.uniform(0, 2 * np.pi, count)
    push[:, 0], push[:, 1] = drag * np.cos(angle), drag * np.sin(angle)
    return where, push


def _draw_pairs(
    design: SkinDesign, work: Effort, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Places (B, 2, 2) and forces (B, 2, 3) of straight pairs, more than a cell apart."""
    cell = size(design.cell)
    apart = float(max(cell.length, cell.width))
    where = far_pairs(skin_extent(design), apart, work.pairs, rng)
    push = np.zeros((work.pairs, 2, 3))
    push[..., 2] = -rng.uniform(*work.force, (work.pairs, 2))
    return where, push


def _pressed(
    twin: Twin, where: Floats, push: Floats, temperature: float = REFERENCE_TEMPERATURE
) -> Motion:
    return twin.motions(
        Touches(position=where[:, None], force=push[:, None]), temperature=temperature
    )
