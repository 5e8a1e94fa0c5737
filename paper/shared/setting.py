"""What every script starts from: the design, and made skins calibrated by a few touches.

No table was fitted on these skins. Decides how small a response table the paper makes do with,
which skins estimators are judged on, and how readings of a bench become signals.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.score.evaluate import label
from smoskin.commands.table import Effort, make_table
from smoskin.design.skin import Magnet, SkinDesign
from smoskin.errors import ArgumentError, ModelError
from smoskin.feasibility import load_design
from smoskin.magnetics import mlx90393
from smoskin.records import Motion
from smoskin.sensing.response.calibrate import TouchPlanner, calibrate_touches
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.readout import Readout
from smoskin.twin.whole import Twin

EFFORT: Final = Effort(presses=4000, pairs=200, skins=16, draws=3, presses_a_skin=250)
"""Effort for a table of the paper alone; rougher than what a skin that is used deserves."""
SEEDS: Final = (1, 2)
"""Seeds of the made skins; tables are made of others."""
_TOUCHES: Final = 60
"""Touches that calibrate each of them."""
CELLS: Final = (6, 6)
"""Cells of the paper's skin: nine zones of two by two (Figure S5)."""
_UNTOUCHED: Final = 20
"""Readings whose mean is the zero."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrialSkin:
    """One made skin, and its table after a calibration by labelled touches."""

    twin: Twin
    table: ResponseTable
    """Its table, of all chips."""
    noise: Floats
    """(C, C), T^2: covariance of its signals at rest."""


class Setting:
    """The paper's skin, and what several scripts compute of it, each when it is first asked for.

    Parameters
    ----------
    design : SkinDesign, optional
        With the paper's 6 x 6 cells and two magnets on the sheet; the reference by default.
    table : ResponseTable, optional
        Of all its chips; by default a small one is made, which takes half a minute.

    Raises
    ------
    ArgumentError
        If the design has another layout.
    ModelError
        If the table belongs to another design or lacks chips.
    """

    def __init__(
        self, design: SkinDesign | None = None, table: ResponseTable | None = None
    ) -> None:
        self.design = design or load_design("planar")
        sheet_magnets(self.design)
        if table is not None:
            _check(table, self.design)
            self.table = table

    @cached_property
    def table(self) -> ResponseTable:
        """The response table that estimators read by."""
        return make_table(self.design, EFFORT)

    @cached_property
    def skins(self) -> tuple[TrialSkin, ...]:
        """Skins of `SEEDS`, each touched by a virtual rig."""
        noise = signal_noise(self.design)
        plan = TouchPlanner(self.table, noise).plan(_TOUCHES)
        skins = []
        for seed in SEEDS:
            twin = Twin(self.design, seed=seed, manufactured=True)
            given = label(twin, plan, np.random.default_rng([seed, 0]))
            fitted = calibrate_touches(self.table, given, noise)
            skins.append(TrialSkin(twin=twin, table=fitted, noise=noise))
        return tuple(skins)


def sheet_magnets(design: SkinDesign) -> tuple[Magnet, Magnet]:
    """Magnets 2 and 3 of the SI: those of the sheet, in the order of their chips.

    Raises
    ------
    ArgumentError
        If the design is not of the SI's layout.
    """
    watched = [design.magnet(site.magnet) for site in design.halls]
    upper = [magnet for magnet in watched if magnet.mount == "sheet"]
    if len(upper) != 2 or design.cells != CELLS:
        raise ArgumentError(
            "design must have 6 x 6 cells and two magnets on the sheet, as the paper's skin; got "
            f"{design.cells[0]} x {design.cells[1]} cells and {len(upper)} magnets"
        )
    return upper[0], upper[1]


def upper_chips(design: SkinDesign) -> tuple[int, ...]:
    """The chips under the sheet's magnets, which the paper's models are fed."""
    mounts = [design.magnet(site.magnet).mount for site in design.halls]
    return tuple(s for s, mount in enumerate(mounts) if mount == "sheet")


def _check(table: ResponseTable, design: SkinDesign) -> None:
    if table.design_hash != design.content_hash or len(table.chips) != len(design.halls):
        raise ModelError(
            f"table must be of all chips of the design {design.name!r} "
            f"({design.content_hash[:12]}); got one of {table.design_hash[:12]} with the chips "
            f"{table.chips}"
        )


def bench_signals(
    design: SkinDesign, readout: Readout, motion: Motion, rng: np.random.Generator
) -> Floats:
    """One reading of each of B held motions at reference temperature, zeroed, (B, S, 3), T.

    In the skin's axes as designed; without creep and drift, as on a bench that waits.
    """
    still = Motion.rest(len(design.magnets), (_UNTOUCHED,))
    zero, read = (
        mlx90393.tesla(readout.sample(item, rng).counts, design.hall_setting)
        for item in (still, motion)
    )
    return np.asarray(
        np.einsum("sij,bsj->bsi", mlx90393.rotations(design.halls), read - zero.mean(axis=0))
    )
