"""Readings that a good skin gives untouched, when it is first powered up."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.fabrication.process.tolerances import made_tolerances
from smoskin.magnetics import mlx90393
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
