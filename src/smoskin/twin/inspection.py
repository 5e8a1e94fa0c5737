"""Which made skins leave the workshop: those whose chips can read their own magnets.

Decides what is measured on an untouched skin, and how many are made before the design is to blame.
"""

from typing import Final

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.magnetics.mlx90393 import full_scale
from smoskin.records import Motion
from smoskin.twin.manufacture import Deviations, Tolerances, draw
from smoskin.twin.readout import Readout

_MADE: Final = 20
"""Skins that are made for one that can be used; the last is taken as it is."""


def drawn_skin(design: SkinDesign, seed: int, tolerances: Tolerances | None = None) -> Deviations:
    """The skin of a seed, as a twin with this seed has it.

    Skins are made until one passes `reads_untouched`.
    """
    of_skin, _ = np.random.SeedSequence(seed).spawn(2)
    rng = np.random.default_rng(of_skin)
    for _ in range(_MADE):
        made = draw(design, rng, tolerances)
        if reads_untouched(design, made):
            break
    return made


def reads_untouched(design: SkinDesign, made: Deviations) -> bool:
    """Whether every chip of a made skin reads its magnets at rest within its range."""
    field = Readout(design, made).seen(Motion.rest(len(design.magnets)))
    return bool((np.abs(field) < full_scale(design.hall_setting)).all())
