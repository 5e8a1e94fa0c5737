"""A made skin on an arm that moves: its weight and the Earth's field turn with the arm."""

import math
from collections.abc import Sequence
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.masses import GRAVITY
from smoskin.records import Contact, Motion, Reading
from smoskin.twin.creep import Creep
from smoskin.twin.rig import drifting_readings
from smoskin.twin.surroundings import Ambience
from smoskin.twin.whole import Twin
from smoskin.twin.world.arm import motion_by_acceleration
from smoskin.twin.world.effect import Run

EARTH: Final = 50e-6 * np.array([math.cos(math.radians(65.0)), 0.0, -math.sin(math.radians(65.0))])
"""The Earth's field in the room, T."""
_STILL: Final = np.zeros(3)
_SETTLED: Final = 1e5
"""Time for which the skin was held as at the first reading before it, s."""


@final
class CarriedSkin:
    r"""A skin whose readings depend on how the arm holds and moves it; time is the skin's.

    Parameters
    ----------
    twin : Twin
    seed : int
        Seed of noise and drift.
    earth : Floats, shape (3,)
        Field in the room, T.
    drift : float
        Random walk of each axis of the chips in a second, T.
    run : Run, optional
        What a world does to the skin besides.

    Notes
    -----
    Sheet and board move by :math:`A\,(R^T (g - a) - g_0)`, R from the skin's frame to the room's,
    a the acceleration of the skin, :math:`g_0` the pull on a skin that lies face up.
    """

    def __init__(
        self,
        twin: Twin,
        *,
        seed: int = 0,
        earth: Floats = EARTH,
        drift: float = 0.3e-6,
        run: Run | None = None,
    ) -> None:
        self.twin = twin
        self._sheet, self._board = motion_by_acceleration(twin)
        self._creep = Creep(twin.design)
        self._rng = np.random.default_rng([seed, 11])
        self._earth, self._drift, self._run = earth, drift, run
        self._time: float | None = None
        self._walked: Floats = np.zeros((len(twin.design.halls), 3))

    def read(
        self,
        time: float,
        contacts: Sequence[Contact],
        turn: Floats,
        *,
        acceleration: Floats = _STILL,
        temperature: float = REFERENCE_TEMPERATURE,
    ) -> Reading:
        """What the chips read of the skin held so, (3, 3), under these contacts at a time, s."""
        begins = self._time is None
        times = np.array([time])
        steps = times - times if self._time is None else times - self._time
        self._time = time
        down = np.array([0.0, 0.0, -GRAVITY])
        pull = turn.T @ (down - acceleration) - down
        touched = self.twin.motion(contacts, temperature=temperature)
        motion = Motion(
            magnets=(touched.magnets + self._sheet @ pull)[None],
            board=(touched.board + self._board @ pull)[None],
        )
        chips = len(self.twin.design.halls)
        around = Ambience.none(1, chips)
        even = np.broadcast_to(turn.T @ self._earth, around.field.shape)
        around = around + Ambience(field=even, magnets=around.magnets, chips=around.chips)
        if self._run is not None:
            motion = self._run.moved(times, motion)
            around = around + (self._run.around(times) or Ambience.none(1, chips))
        (reading,), self._walked = drifting_readings(
            self.twin,
            self._creep.steps(steps + _SETTLED * begins, motion),
            times,
            steps,
            self._rng,
            temperature=temperature,
            drift=self._drift,
            walked=self._walked,
            around=around,
        )
        return reading
