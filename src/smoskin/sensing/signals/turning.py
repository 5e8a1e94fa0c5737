"""What a skin that turns reads untouched: the Earth's field, and its own weight.

Decides along which patterns over the chips that changes; hides fields and weights.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.sector import field_and_gradient
from smoskin.mechanics.board import board_of, carried, turned
from smoskin.mechanics.weight import Sags, sags
from smoskin.origami.geometry import geometry

EARTH: Final = 100e-6
"""Spread along each axis, T, of the Earth's field in the frame of a skin that turns by a radian: a
field of 25 to 65 uT turned over changes by twice as much."""
_UNLIKE: Final = 0.2
"""Share of the change by its weight in which a made skin's chip differs from the designed one."""
_KNOWN: Final = 0.1
"""Time, s, of turning that what is known before of turns counts for."""


class Turning(NamedTuple):
    """Covariances of what a turn by a radian changes, (C, C), T^2."""

    field: Floats
    """Earth's field alone, of a skin that its weight does not move."""
    whole: Floats
    """Both, with the skin's weight."""

    @property
    def weighs(self) -> bool:
        """Whether its weight takes part."""
        return self.whole is not self.field


class TurnsSeen:
    """What a turn by a radian changes of one skin, learned from how fast its zero goes.

    A made skin's chips differ from the designed ones, and an arm turns it about few axes: its zero
    is followed along what these change.

    Parameters
    ----------
    turning : Turning
        What is known before, with the skin's weight.

    Notes
    -----
    A speed v of covariance P is of a turn at ``w = (v^T W^-1 v)^(1/2)`` rad/s, W what is known
    before, so that ``(v v^T + P) / w^2`` is what a radian about its axis changes. The mean of these
    over time is learned, W counting for a tenth of a second ("The zero" in `docs/derivations.md`).
    """

    def __init__(self, turning: Turning) -> None:
        self.before = turning.whole
        """W, (C, C), T^2."""
        self.whole = turning.whole
        """Covariance of what a turn by a radian changes, by all that was seen, (C, C), T^2."""
        self._precision = np.linalg.inv(turning.whole)
        self._sum, self._time = _KNOWN * turning.whole, _KNOWN

    def learn(self, elapsed: float, speed: Floats, spread: Floats) -> None:
        """Take in that the zero went at a speed (C,), T/s, of covariance (C, C), for so long, s."""
        rate = float(speed @ self._precision @ speed)
        self._sum = self._sum + elapsed / rate * (np.outer(speed, speed) + spread)
        self._time += elapsed
        self.whole = self._sum / self._time


def uniform_covariance(axes: Floats, spread: float) -> Floats:
    """Covariance u^2 A A^T of a field that is the same at all chips, (3 S, 3 S), T^2.

    Readings are along the chips' local axes, (S, 3, 3).
    """
    along = np.swapaxes(axes, 1, 2).reshape(-1, 3)
    return np.asarray(spread**2 * (along @ along.T))


def turning(
    design: SkinDesign, chips: Sequence[int] | None = None, *, weight: bool = True
) -> Turning:
    """What all chips of a design, or those chosen, read of a turn, with or without its weight.

    Notes
    -----
    Chip s reads U_s q of an acceleration q ~ N(0, I), in g, that moves its magnet by d: a magnet of
    the sheet hangs above its chip, one of the base lies below a board that slides and tilts. So its
    covariance is U U^T and c^2 |U_s|^2 I / 3 at each chip, with c what made skins differ by.
    """
    used = range(len(design.halls)) if chips is None else chips
    field = uniform_covariance(geometry(design).chip_axes[list(used)], EARTH)
    if not weight:
        return Turning(field, field)
    sagged = sags(design)
    parts = [change_by_weight(design, chip, sagged) for chip in used]
    alike = np.concatenate(parts)
    whole = field + alike @ alike.T
    for row, part in enumerate(parts):
        own = slice(3 * row, 3 * row + 3)
        whole[own, own] += _UNLIKE**2 / 3 * float((part**2).sum()) * np.eye(3)
    return Turning(field, whole)


def change_by_weight(design: SkinDesign, chip: int, sagged: Sags) -> Floats:
    """Change U_s of a chip's own field, (3, 3), T, by 1 g along x, y and z."""
    site, places = design.halls[chip], geometry(design)
    magnet = design.magnet(site.magnet)
    field, gradient = field_and_gradient(magnet, places.rest[chip])
    if magnet.mount == "sheet":
        # The field goes and turns with its magnet: r x B.
        moved, turns = np.split(sagged.magnets[design.magnets.index(magnet)], 2)
        moved = moved + turned(places.rest[chip]) @ turns
        return np.asarray(turned(field) @ turns - gradient @ moved)
    inward = places.chip_axes[chip].T
    moved = inward @ carried(board_of(design), places.chips[chip]) @ sagged.board
    # The chip turns with the board, the magnet does not: -r x B.
    return np.asarray(gradient @ moved - turned(field) @ (inward @ sagged.board[3:]))
