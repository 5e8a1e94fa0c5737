"""A skin's motion in time: what the rubber remembers of earlier touches.

Decides which rubber each part of a motion hangs on: the magnets on the columns, the board on the
shear layer. How rubber creeps is `smoskin.mechanics.viscoelasticity`'s.
"""

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.viscoelasticity import Memory, elastomer_prony
from smoskin.records import Motion


class Creep:
    """Turns the motions that a skin would come to rest in into those it goes through.

    It begins with a skin of this design that has long been untouched.

    Examples
    --------
    A motion that is held creeps on to it:

    >>> from smoskin.design.document import read_design
    >>> moved = Motion(magnets=np.ones((3, 6)), board=np.ones(6))
    >>> creep = Creep(read_design("planar"))
    >>> [round(float(creep.step(dt, moved).board[0]), 2) for dt in (0.0, 3600.0)]
    [0.91, 1.0]
    """

    def __init__(self, design: SkinDesign) -> None:
        columns = elastomer_prony(design.columns.material)
        layer = elastomer_prony(design.shear_layer.material)
        self._magnets = Memory(columns, np.zeros((len(design.magnets), 6)))
        self._board = Memory(layer, np.zeros(6))

    def step(self, duration: float, motion: Motion) -> Motion:
        """The motion so many seconds after the last one.

        The given motion is the one in which the present touches would hold the skin for good. Where
        it is invalid the answer is too, and the memory goes on from the last that was not. It
        raises an `ArgumentError` if time runs backwards.
        """
        return Motion(
            magnets=self._magnets.step(duration, motion.magnets),
            board=self._board.step(duration, motion.board),
        )

    def steps(self, durations: ArrayLike, motions: Motion) -> Motion:
        """The motions after each `step` of (T,) durations, s, and (T,) states, one by one."""
        seconds = floats("durations", durations).tolist()
        return Motion.stack([self.step(time, motions[row]) for row, time in enumerate(seconds)])
