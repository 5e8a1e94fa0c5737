"""Hysteresis of creases and adhesive: loops that do not depend on how fast they are gone round."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Final, final

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


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BoucWen(Effect):
    """Loops of some per cent likewise, by the Bouc-Wen law, which is no sum of plays.

    Friction z takes off: ``y = x - a z``, ``dz = dx - (|dx| z + dx |z|) / (2 q u)`` for every
    component x of the skin's motion, u its largest one under a newton. Loops are rounded, and a
    small one inside of a large does not close. "Hysteresis" in `docs/derivations_sheet.md`.
    """

    chance: ClassVar[str] = "Hysteresis"
    share: float = 0.12
    """a."""
    width: float = 0.12
    """q."""

    def history(self, twin: Twin, rng: np.random.Generator) -> History:
        """As `Effect.history`."""
        return Friction(_ranges(twin), self.share, self.width, rng)


class _Memory(ABC):
    """What a motion's components leave behind, each by itself."""

    def __init__(self, ranges: Motion) -> None:
        self._shape = ranges.magnets.shape

    def steps(self, times: Floats, motion: Motion) -> Motion:
        """As `History.steps`; where a motion is invalid what is left of others stays."""
        out = np.stack([_flat(motion[row]) for row in range(len(times))])
        for value in out:
            if np.isfinite(value).all():
                value += self._left(value)
        magnets, board = np.split(out, [-_BOARD], axis=1)
        return Motion(magnets=magnets.reshape(-1, *self._shape), board=board)

    @abstractmethod
    def _left(self, value: Floats) -> Floats:
        """What is added to the components (M,) after what they were before."""


class Loops(_Memory):
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
        super().__init__(ranges)
        self._weight = weight
        self._reach = np.array(plays)[:, None] * _flat(ranges)
        self._plays = np.zeros_like(self._reach)
        if rng is not None:
            self._plays = self._reach * rng.uniform(-1, 1, self._reach.shape)

    def _left(self, value: Floats) -> Floats:
        self._plays = np.clip(self._plays, value - self._reach, value + self._reach)
        return np.asarray(self._weight * (self._plays - value).sum(axis=0))


class Friction(_Memory):
    """Friction of a motion's components, of a skin with a past: at first it is anything.

    `ranges` are components' largest motions under a newton, one state; without a generator the skin
    is new. `ArgumentError` if the width is not positive, or the share not from 0 to below 1.
    """

    def __init__(
        self, ranges: Motion, share: float, width: float, rng: np.random.Generator | None = None
    ) -> None:
        if not (0.0 <= share < 1.0 and width > 0.0):
            raise ArgumentError(
                f"share must be in [0, 1) and width positive; got {share} and {width}"
            )
        super().__init__(ranges)
        self._share, self._most = share, width * _flat(ranges)
        self._before = np.zeros_like(self._most)
        # In units of its most; where nothing ever moves there is none.
        self._friction = np.zeros_like(self._most)
        if rng is not None:
            self._friction = rng.uniform(-1, 1, self._most.shape)

    def _left(self, value: Floats) -> Floats:
        moved = value - self._before
        there = self._most > 0
        way = np.divide(np.abs(moved), self._most, out=np.zeros_like(moved), where=there)
        along = np.sign(moved) * self._friction
        # Against what is left friction changes with the way, along it ever slower: both exactly.
        back = np.minimum(way, np.maximum(-along, 0.0))
        along = along + back
        along = 1 - (1 - along) * np.exp(back - way)
        self._friction = np.where(way > 0, np.sign(moved) * along, self._friction)
        self._before = value.copy()
        return np.asarray(-self._share * self._most * self._friction)


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
