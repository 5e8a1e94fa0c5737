"""Shares of a small press's energy on the whole sheet: panels, creases and columns."""

from typing import Final, NamedTuple

import numpy as np

from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.tangent import Tangent
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry

_LIGHT: Final = 5e-3
"""N: a press of a linear sheet."""
_POINT: Final = 1e-6
"""m: radius of a touch that presses one vertex."""


class EnergyShares(NamedTuple):
    """Shares of a press's energy, mean over the cells."""

    panels: float
    creases: float
    sway: float
    """The columns' share, sideways."""
    sink: float
    """The columns' share, along z."""


def energy_shares(sheet: BarHinge) -> EnergyShares:
    """Halves of forces times motions, by the parts that put up the forces."""
    tops = geometry(sheet.design).tops.reshape(-1, 1, 2)
    push = np.broadcast_to([0.0, 0.0, -_LIGHT], (len(tops), 1, 3))
    pressed = sheet.press(Touches(position=tops, force=push, radius=_POINT), tolerance=1e-5)
    tangent, shares = Tangent(sheet.lattice, sheet.board), []
    for moved in pressed.displacements:
        work = tangent.blocks(moved, np.zeros(6)).pushes * moved
        bars, bends, creases, columns, _ = work.sum(axis=1)
        parts = np.array([(bars + bends).sum(), creases.sum(), columns[:2].sum(), columns[2]])
        shares.append(parts / parts.sum())
    return EnergyShares(*np.mean(shares, axis=0).tolist())
