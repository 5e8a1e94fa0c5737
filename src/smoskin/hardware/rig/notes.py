"""Notes of what a rig's stage and gauge said while it made a touch, at the times when they did."""

import time
from collections.abc import Callable
from typing import final

import numpy as np

from smoskin.arrays import Floats
from smoskin.records import Trace


@final
class Notes:
    """Forces, places and phases of one touch, at times of the host's monotonic clock."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget the touch before."""
        self._forces: list[tuple[float, float]] = []
        self._places: list[tuple[float, ...]] = []
        self._phases: list[tuple[str, float]] = []

    def force(self, pressed: float, begun: float) -> None:
        """Note how hard the probe has pressed since a time, s, N."""
        self._forces.append((0.5 * (begun + time.monotonic()), pressed))

    def place(self, place: Floats) -> None:
        """Note where the stage stands now, (3,), m."""
        self._places.append((time.monotonic(), *place.tolist()))

    def phase(self, name: str) -> None:
        """Note what begins now, which ends what was."""
        self._phases.append((name, time.monotonic()))

    def trace(
        self, clock: Callable[[Floats], Floats], origin: Floats, zero: float, scale: Floats
    ) -> Trace:
        """All notes, their times put on another clock, with places from an origin, (3,), m.

        The stage goes `scale`, (3,), times as far as the probe does along the skin. The gauge's
        reading `zero`, N, is no force.
        """
        forces = np.reshape(self._forces, (-1, 2))
        places = np.reshape(self._places, (-1, 4))
        begins = clock(np.array([begin for _, begin in self._phases] + [time.monotonic()]))
        nothing = np.zeros(len(forces))
        return Trace(
            gauge=np.column_stack([clock(forces[:, 0]), nothing, nothing, zero - forces[:, 1]]),
            stage=np.column_stack([clock(places[:, 0]), (places[:, 1:] - origin) / scale]),
            phases=[(name, begins[k], begins[k + 1]) for k, (name, _) in enumerate(self._phases)],
        )
