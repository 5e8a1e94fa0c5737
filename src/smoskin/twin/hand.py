"""The hand that touches a virtual skin anywhere, again and again, by a script.

Decides where it touches, how strongly, and how a touch rises, is held and falls.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact

PERIOD: Final = 0.8
"""Time from touch to touch, s."""
RAMP: Final = 0.15
"""Time in which a touch rises and in which it falls, s."""
HOLD: Final = 0.35
"""Time for which it is held between, s."""
_PRESS: Final = (0.3, 0.8)
"""Least and most that the hand presses, N."""
_DRAG: Final = (0.1, 0.3)
"""Least and most that it drags, N."""
_MARGIN: Final = 4e-3
"""Distance that the hand keeps from the skin's rim, as a fingertip must, m."""


def scripted_hand(
    design: SkinDesign, seconds: float, seed: int, *, start: float = 0.2
) -> tuple[Contact, ...]:
    """As many touches as fit into so many seconds, spread over the whole skin.

    The skin is gone over cell by cell in a random order, each touch anywhere in its cell. Every
    other touch drags as well; the first, `start` s after the beginning, presses straight.
    `ArgumentError` if not even one fits.
    """
    count = math.floor((seconds - start) / PERIOD + 1e-9)
    if count < 1:
        raise ArgumentError(f"seconds must be at least {start + PERIOD:g}; got {seconds:g}")
    rng = np.random.default_rng(seed)
    cells = np.stack(np.meshgrid(*map(np.arange, design.cells), indexing="ij"), -1).reshape(-1, 2)
    rounds = [rng.permutation(cells) for _ in range(-(-count // len(cells)))]
    room = geometry(design).extent - 2 * _MARGIN
    touches = []
    for k, cell in enumerate(np.concatenate(rounds)[:count]):
        place = _MARGIN + (cell + rng.uniform(size=2)) / design.cells * room
        press, drag, angle = rng.uniform(*_PRESS), rng.uniform(*_DRAG), rng.uniform(0, math.tau)
        drag *= k % 2
        force = (drag * math.cos(angle), drag * math.sin(angle), -press)
        touches.append(Contact(position=place, force=force))
    return tuple(touches)


def contacts_of(script: Sequence[Contact], since: float) -> tuple[Contact, ...]:
    """What a hand that repeats its script holds on the skin so many seconds after it began."""
    # Times that differ in their last bits alone are one, lest the twin be solved for each.
    number, since = divmod(round(since, 6), PERIOD)
    touch = script[int(number) % len(script)]
    strength = min(since / RAMP, 1.0, (HOLD + 2 * RAMP - since) / RAMP)
    return (Contact(position=touch.position, force=strength * touch.force),) * (strength > 0)
