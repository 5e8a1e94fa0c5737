"""Hysteresis of creases and adhesive: loops that do not depend on how fast they are gone round."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry, middles_of_fields
from smoskin.records import Motion
from smoskin.twin.whole import Twin
from smoskin.twin.world.effect import Effect, History

_PLACES: Final = (4, 5)
"""Places whose presses tell how far each magnet moves under a newton."""
_BOARD: Final = 6
"""Motions of the board."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Hysteresis(Effect):
    """Loops of some per cent of each motion's range, by a discrete Prandtl-Ishlinskii operator.

    Its equation is ``y = x + sum_k w (P_k[x] - x)`` with plays P_k, ``P_k(t) = max(x - r_k u,
    min(x + r_k u, P_k(t-)))``, for every component x of the skin's motion, u its largest one under
    a newton: between 0.1 and 1 N loops are some 2 w sum(r_k < x / 2 u) u wide, a few per cent of x.
    "Hysteresis" in `docs/derivations_sheet.md`.
    """

    weight: float = 0.05
    """w."""
    plays: tuple[float, ...] = (0.02, 0.06, 0.2)
    """r_k."""

    def history(self, twin: Twin, rng: np.random.Generator) -> History:
        """As `Effect.history`."""
        return Loops(_ranges(twin), self.weight, self.plays, rng)


class Loops:
    """Plays of a motion's components, of a skin with a past: at first they are anywhere.

    `ranges` are components' largest motions under a newton, one state; without a generator the skin
    is new. `ArgumentError` if weights sum to 1 or more, or one or a play is negative.
    """

    def __init__(
        self,
        ranges: Motion,
        weight: float,
        plays: tuple[float, ...],
        rng: np.random.Generator | None = None,
    ) -> None:
        if not (0.0 <= weight * len(plays) < 1.0 and min(plays, default=0.0) >= 0.0):
            raise ArgumentError(
                "weight and plays must be >= 0 with a sum of weights below 1; got "
                f"{weight} and {plays}"
            )
        self._weight, self._shape = weight, ranges.magnets.shape
        self._reach = np.array(plays)[:, None] * _flat(ranges)
        self._plays = np.zeros_like(self._reach)
        if rng is not None:
            self._plays = self._reach * rng.uniform(-1, 1, self._reach.shape)

    def steps(self, times: Floats, motion: Motion) -> Motion:
        """As `History.steps`; where a motion is invalid its plays stay."""
        asked = np.stack([_flat(motion[row]) for row in range(len(times))])
        out = asked.copy()
        for row, value in enumerate(asked):
            if np.isfinite(value).all():
                low, high = value - self._reach, value + self._reach
                self._plays = np.clip(self._plays, low, high)
                out[row] += self._weight * (self._plays - value).sum(axis=0)
        magnets, board = np.split(out, [-_BOARD], axis=1)
        return Motion(magnets=magnets.reshape(-1, *self._shape), board=board)


def _flat(motion: Motion) -> Floats:
    """Components of one state in a row."""
    return np.concatenate([motion.magnets.ravel(), motion.board])


def _ranges(twin: Twin) -> Motion:
    """Largest motion of each component under a newton that presses, and under drags of half one."""
    places = middles_of_fields(geometry(twin.design).extent, _PLACES)
    forces = np.array([[0.0, 0.0, -1.0], [0.5, 0.0, -1.0], [0.0, 0.5, -1.0]])
    position = np.repeat(places, len(forces), axis=0)[:, None]
    force = np.tile(forces, (len(places), 1))[:, None]
    moved = twin.motions(Touches(position=position, force=force))
    return Motion(
        magnets=np.nanmax(np.abs(moved.magnets), axis=0),
        board=np.nanmax(np.abs(moved.board), axis=0),
    )
