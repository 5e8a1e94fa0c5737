"""An arm that carries the skin: how it turns, and how the skin's own weight then moves it."""

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.magnetics.arrangement import rotation_matrix
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.board import carried
from smoskin.mechanics.masses import GRAVITY
from smoskin.mechanics.sheet.holders import holder_matrix
from smoskin.mechanics.weight import board_load, hung_loads
from smoskin.records import Motion
from smoskin.twin.manufacture import made_mechanics
from smoskin.twin.whole import Twin
from smoskin.twin.world.effect import Effect, History

ARM: Final = "arm"
"""Name of the randomness of all that an arm does: its axis is drawn first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """How the arm turns once a session has begun: to and fro about an axis."""

    angle: float = math.pi / 2
    """Farthest turn, rad."""
    period: float = 20.0
    """Time of one turn to and fro, s: 14 degrees a second at its fastest."""

    def sway(self, times: Floats) -> Floats:
        """Share of the farthest turn at (T,) times, s; none before the session."""
        return np.asarray(0.5 - 0.5 * np.cos(2 * math.pi * np.maximum(times, 0.0) / self.period))

    def turns(self, axis: Floats, times: Floats) -> Floats:
        """Rotations from the skin's frame to the room's about an axis, (T, 3, 3)."""
        return rotation_matrix(self.angle * self.sway(times)[:, None] * axis)


TURNING: Final = Arm()
"""The usual arm."""


def level_axis(rng: np.random.Generator) -> Floats:
    """A level axis of any direction, (3,)."""
    bearing = rng.uniform(0, 2 * math.pi)
    return np.array([math.cos(bearing), math.sin(bearing), 0.0])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Gravity(Effect):
    """The weight of all that moves, as the arm turns the skin from face up.

    Columns bear sheet, scales, magnets and half of themselves, the shear layer all of it.
    """

    on_bench = False
    on_arm = True
    chance = ARM
    arm: Arm = TURNING

    def history(self, twin: Twin, rng: np.random.Generator) -> History:
        """As `Effect.history`."""
        return _Weight(twin, self.arm, level_axis(rng))

    def poses(self, rng: np.random.Generator, times: Floats) -> Floats:
        """As `Effect.poses`."""
        return self.arm.turns(level_axis(rng), times)


class _Weight:
    """Motions by weight, added to those by touches: u = A (g(t) - g(0)), small loads."""

    def __init__(self, twin: Twin, arm: Arm, axis: Floats) -> None:
        self._arm, self._axis = arm, axis
        self._magnets, self._board = motion_by_acceleration(twin)

    def steps(self, times: Floats, motion: Motion) -> Motion:
        """As `History.steps`."""
        down = np.array([0.0, 0.0, -GRAVITY])
        pull = np.swapaxes(self._arm.turns(self._axis, times), -1, -2) @ down - down
        return Motion(
            magnets=motion.magnets + np.einsum("gpd,td->tgp", self._magnets, pull),
            board=motion.board + pull @ self._board.T,
        )


def motion_by_acceleration(twin: Twin) -> tuple[Floats, Floats]:
    """Motions of the magnets over the board, (G, 6, 3), and of the board, (6, 3), by 1 m/s^2."""
    from smoskin.mechanics.sheet.continuation import settle
    from smoskin.mechanics.sheet.tangent import Tangent

    design = twin.design
    lattice, board = made_mechanics(design, twin.deviations, REFERENCE_TEMPERATURE)
    holders = holder_matrix(design).reshape(len(design.magnets), 6, -1, 3)
    loads = hung_loads(design, holders)
    tangent = Tangent(lattice, board)
    rest = settle(tangent)
    moved = tangent.solve(tangent.at(rest.motion, rest.board, rest.force), loads)
    taken = np.einsum("vdb,vda->ba", carried(board, lattice.nodes), loads)
    taken += board_load(design)
    return np.einsum("gpva,vad->gpd", holders, moved), board.gives(taken)
