"""Made skins that no table was fitted on, each calibrated by a few touches.

Estimators are shown on them. Decides how small a response table the report makes do with, which
skins it judges on, and how readings of a bench become signals.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.score.evaluate import label
from smoskin.commands.table import Effort, make_table
from smoskin.design.skin import SkinDesign
from smoskin.errors import ModelError
from smoskin.magnetics import mlx90393
from smoskin.records import Motion
from smoskin.sensing.response.calibrate import DEFAULT_COUNT, calibrate_touches, plan_touches
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.twin.readout import Readout
from smoskin.twin.whole import Twin

EFFORT: Final = Effort(presses=4000, pairs=200, skins=16, draws=3, presses_a_skin=250)
"""Of a table that is made for the report alone, in half a minute; rougher than what a skin that is
used deserves."""
SEEDS: Final = (1, 2)
"""Of the made skins; tables are made of others."""
_UNTOUCHED: Final = 20
"""Readings whose mean is the zero."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrialSkin:
    """One made skin, and its table after a calibration by labelled touches."""

    twin: Twin
    table: ResponseTable
    """Of all chips."""
    noise: Floats
    """(C, C), T^2: covariance of its signals at rest."""


def trial_table(design: SkinDesign, given: ResponseTable | None) -> ResponseTable:
    """The response table that was given, or else a small one, which takes half a minute.

    Raises
    ------
    ModelError
        If the table belongs to another design or lacks chips.
    """
    if given is None:
        return make_table(design, EFFORT)
    if given.design_hash != design.content_hash or len(given.chips) != len(design.halls):
        raise ModelError(
            f"table must be of all chips of the design {design.name!r} "
            f"({design.content_hash[:12]}); got one of {given.design_hash[:12]} with the chips "
            f"{given.chips}"
        )
    return given


def trial_skins(
    design: SkinDesign, table: ResponseTable, touches: int = DEFAULT_COUNT
) -> tuple[TrialSkin, ...]:
    """Skins of `SEEDS`, each touched so many times by a virtual rig.

    Parameters
    ----------
    design : SkinDesign
    table : ResponseTable
        Of the design with all its chips.
    touches : int
    """
    noise = signal_noise(design)
    plan = plan_touches(table, touches, noise)
    skins = []
    for seed in SEEDS:
        twin = Twin(design, seed=seed, manufactured=True)
        given = label(twin, plan, np.random.default_rng([seed, 0]))
        fitted = calibrate_touches(table, given, noise)
        skins.append(TrialSkin(twin=twin, table=fitted, noise=noise))
    return tuple(skins)


def bench_signals(
    design: SkinDesign, readout: Readout, motion: Motion, rng: np.random.Generator
) -> Floats:
    """One reading of each of B held motions at reference temperature, zeroed, (B, S, 3), T.

    In the skin's axes as designed; without creep and drift, as on a bench that waits.
    """
    still = Motion.rest(len(design.magnets), (_UNTOUCHED,))
    zero, said = (
        mlx90393.tesla(readout.sample(one, rng).counts, design.hall_setting)
        for one in (still, motion)
    )
    return np.asarray(
        np.einsum("sij,bsj->bsi", mlx90393.rotations(design.halls), said - zero.mean(axis=0))
    )
