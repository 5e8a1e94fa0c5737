"""Skins made of the reference design's parts, for tests of other sizes and placements."""

from dataclasses import replace

import numpy as np

from smoskin.sensing.signals.signals import signal_noise
from smoskin.sensing.signals.turning import turning


def with_magnets(design, corners, cells=None):
    """The design with magnets of the sheet at these corners, each over its chip."""
    base, sheet = design.magnets[:2]
    board, upper = design.halls[:2]
    magnets = [replace(sheet, name=f"M{g + 2}", corner=c) for g, c in enumerate(corners)]
    halls = [
        replace(upper, name=f"S{g + 2}", magnet=f"M{g + 2}", address=0x20 + g)
        for g in range(len(corners))
    ]
    return replace(
        design,
        cells=cells or design.cells,
        magnets=(replace(base, corner=(0, 0)), *magnets),
        halls=(board, *halls),
    )


def unlike_a_turn(design, chips=None, *, weight=False):
    """A change, (C,), that a turn of the skin hardly explains, of a unit's length to its zero.

    The zero is of twenty readings, and the skin may have been jerked for a tenth of a second.
    """
    noise, whole = signal_noise(design, chips), turning(design, chips, weight=weight).whole
    jerk = 0.8**2 * 0.1**3 / 3 * whole
    factor = np.linalg.cholesky(1.05 * noise + jerk)
    white = np.linalg.solve(factor, np.linalg.solve(factor, whole).T)
    return factor @ np.linalg.eigh(white)[1][:, 0]
