"""The touches of the demonstration: what is pressed where, along what, and how it changes.

Decides that forces go up and down through the threshold, as in the paper's Figure S13, and change
suddenly, as in its Movie S2.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats, freeze
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.origami.geometry import geometry
from smoskin.records import Contact

_RAMP: Final = ((0.0, 1.5, 2.0, 3.5), (0.0, 0.75, 0.75, 0.0))
"""Times, s, and forces, N: through the threshold, held, and back."""
_CHANGES: Final = (
    (0.0, 0.05, 0.4, 0.43, 0.8, 0.83, 1.2, 1.23, 1.6, 1.63, 1.9, 1.93),
    (0.0, 0.30, 0.3, 0.80, 0.8, 0.30, 0.3, 0.90, 0.9, 0.30, 0.3, 0.0),
)
"""Sudden changes to and fro over the threshold."""
_TAPS: Final = (
    (0.0, 0.03, 0.18, 0.21, 0.6, 0.63, 0.78, 0.81),
    (0.0, 0.8, 0.8, 0.0, 0.0, 0.9, 0.9, 0.0),
)
"""Two taps."""
_TOUCHES: Final = (
    ((0.50, 0.50), (0.0, 0.0), _RAMP),
    ((0.30, 0.35), (0.35, 0.0), _RAMP),
    ((0.70, 0.65), (-0.35, 0.0), _RAMP),
    ((0.65, 0.35), (0.0, 0.35), _RAMP),
    ((0.35, 0.70), (0.0, -0.35), _RAMP),
    ((0.50, 0.30), (0.25, 0.25), _RAMP),
    ((0.45, 0.55), (0.0, 0.0), _CHANGES),
    ((0.60, 0.45), (0.2, -0.2), _TAPS),
)
"""Place as shares of the extent, drag along x and y for a pressing force of 1, and course."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Press:
    """One touch of the script."""

    place: Floats
    """(2,), m."""
    direction: Floats
    """(3,): direction of its force, in the skin's local axes there."""
    times: Floats
    """(N,), s, from its beginning, at which the force is known."""
    forces: Floats
    """(N,), N: sizes of it then; even changes between."""

    def __post_init__(self) -> None:
        freeze(self, place=(2,), direction=(3,), times=(None,), forces=(len(self.times),))
        if not (np.diff(self.times) > 0.0).all():
            raise ArgumentError(f"times must follow each other; got {self.times} s")

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return float(self.times[-1])

    def force(self, since: float) -> float:
        """Size of the force so many seconds after the beginning, N; none after the end."""
        return float(np.interp(since, self.times, self.forces, left=0.0, right=0.0))

    def contacts(self, since: float) -> tuple[Contact, ...]:
        """What touches the skin then."""
        size = self.force(since)
        if size <= 0.0:
            return ()
        return (Contact(position=self.place, force=size * self.direction),)


def scripted_presses(design: SkinDesign) -> tuple[Press, ...]:
    """The demonstration's touches of a skin."""
    presses = []
    for share, drag, (times, forces) in _TOUCHES:
        direction = np.array([*drag, -1.0])
        presses.append(
            Press(
                place=np.multiply(share, geometry(design).extent),
                direction=direction / np.linalg.norm(direction),
                times=np.array(times),
                forces=np.array(forces),
            )
        )
    return tuple(presses)
