"""Readings that a good skin gives untouched, when it is first powered up."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.process.tolerances import REMANENCE, made_tolerances
from smoskin.feasibility import field_extent, suited_to
from smoskin.magnetics import mlx90393
from smoskin.magnetics.sector import VACUUM_PERMEABILITY
from smoskin.records import Motion
from smoskin.twin.manufacture import drawn_skin
from smoskin.twin.readout import Readout

_SKINS: Final = 50
"""Made skins whose readings are told; a few of a hundred good ones read something beyond."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FirstReading:
    """One chip of a skin at rest, in its own axes, T."""

    chip: str
    address: int
    designed: Floats
    """(3,): reading as designed."""
    low: Floats
    """(3,): lowest of made skins that keep the tolerances."""
    high: Floats
    """(3,): highest of them."""
    full_scale: Floats
    """(3,): range at the design's setting."""


def first_readings(design: SkinDesign) -> tuple[FirstReading, ...]:
    """What each chip of a good skin reads untouched, without the Earth's field (0.05 mT)."""
    limits, still = made_tolerances(design), Motion.rest(len(design.magnets))
    designed = Readout(design).seen(still)
    made = np.stack(
        [Readout(design, drawn_skin(design, seed, limits)).seen(still) for seed in range(_SKINS)]
    )
    full = mlx90393.full_scale(design.hall_setting)
    return tuple(
        FirstReading(
            chip=site.name,
            address=site.address,
            designed=designed[s],
            low=made[:, s].min(axis=0),
            high=made[:, s].max(axis=0),
            full_scale=np.asarray(full),
        )
        for s, site in enumerate(design.halls)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Suited:
    """What to build with magnets of one remanence."""

    remanence: float
    """T."""
    reading: float
    """T: field of a magnet over the first chip at the design's gap."""
    gaps: tuple[float, ...]
    """m: gap of each chip."""
    gain: int
    """GAIN_SEL of all of them."""


def suited_magnets(design: SkinDesign) -> tuple[Suited, ...]:
    """Gaps and gain by what one magnet over one chip reads, before the rest is built."""
    site, rows = design.halls[0], []
    rest = float(np.linalg.norm(field_extent(design, site).rest))
    designed = design.magnet(site.magnet).remanence
    for remanence in np.linspace(*REMANENCE, 7).round(2).tolist():
        try:
            built = suited_to(design, remanence / VACUUM_PERMEABILITY)
        except DesignError:  # none of the chips' gains holds these magnets
            continue
        rows.append(
            Suited(
                remanence=remanence,
                reading=rest * remanence / VACUUM_PERMEABILITY / designed,
                gaps=tuple(own.gap for own in built.halls),
                gain=built.hall_setting.gain_selection,
            )
        )
    return tuple(rows)
