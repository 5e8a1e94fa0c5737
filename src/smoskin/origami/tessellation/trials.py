"""What is asked of a sheet, and the ways in which it is sought, one after the other.

Decides how a sheet is turned, and what weighs how much in each trial: in the attachment, in
fairness, and of the room for creases.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from smoskin.design.skin import MiuraCell
from smoskin.origami.surface.surface import Surface, Turned, straight_way
from smoskin.origami.tessellation.attachment import Stiffness
from smoskin.origami.tessellation.solve import Listener, Weights


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order:
    """What is asked for."""

    surface: Surface
    cell: MiuraCell
    cells: tuple[int, int]
    plates: tuple[float, ...]
    """m: the first is sought with."""
    column: float
    own_columns: bool
    deadline: float
    progress: Listener | None
    turn: float = 0.0
    """rad: how far the surface's chart is turned."""

    @property
    def plate(self) -> float:
        """Thickness that is sought with, m."""
        return self.plates[0]

    @property
    def thinnest(self) -> "Order":
        """The same with the thinnest plates."""
        return replace(self, plates=self.plates[-1:])

    @property
    def turned(self) -> "Order":
        """The same with the sheet's x along a line in which a saddle's middle is straight."""
        turn = straight_way(self.surface)
        return replace(self, surface=Turned(self.surface, turn), turn=turn)

    def scaled(self, share: float) -> "Order":
        """The same of a sheet so many times as large in all its parts."""
        a, b = share * self.cell.panel_a, share * self.cell.panel_b
        return replace(
            self,
            cell=replace(self.cell, panel_a=a, panel_b=b),
            plates=(share * self.plate,),
            column=share * self.column,
            progress=None,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """How a sheet is sought."""

    weights: Weights = Weights()  # noqa: RUF009 - it is frozen
    stiffness: Stiffness = Stiffness()  # noqa: RUF009 - it is frozen
    wider: float = 1.0
    """Factor on the lattice that the search begins at."""
    room: float = 0.7
    """Share of the room for a crease's gap that is free, as panels grow slimmer on the surface."""
    own_pull: float = 10.0
    """Weight of bottom vertices' heights where every column has its own height."""


TRIALS: Final = (
    Trial(),
    Trial(
        weights=Weights(
            heights=21.4, start=0.0907, angles=74.8, depth=0.99, least_angle=np.radians(28.0)
        ),
        stiffness=Stiffness(stretch=5.32, smooth=9.17),
        wider=1.0769,
        room=0.76,
    ),
    Trial(
        weights=Weights(
            heights=2.14, start=0.0546, angles=199.6, depth=3.73, least_angle=np.radians(27.2)
        ),
        stiffness=Stiffness(stretch=703.0, smooth=3.09),
        wider=1.0854,
        room=0.943,
    ),
    Trial(
        weights=Weights(
            heights=0.827, start=0.43, angles=131.0, depth=0.794, least_angle=np.radians(30.2)
        ),
        stiffness=Stiffness(stretch=510.0, smooth=22.2),
        wider=1.0627,
        room=0.905,
        own_pull=43.1,
    ),
)
"""What is tried on surfaces bent two ways, one after the other, until all gates hold. The first is
fair by plain reasoning; the others were found by drawing such numbers at random for saddles. None
weighs the way from the start so little that a sheet may drift off its patch."""
