"""Designs whose boards are made in tests."""

from dataclasses import replace

import numpy as np

from smoskin.design.document import read_design
from smoskin.design.skin import SkinDesign

UPPER = (("+x", "+y", "+z"), ("+y", "-x", "+z"), ("-x", "-y", "+z"), ("-y", "+x", "+z"))
LOWER = (("+x", "-y", "-z"), ("+y", "+x", "-z"), ("-x", "+y", "-z"), ("-y", "-x", "-z"))

PLANAR = read_design("planar")


def arranged(
    corners: list[tuple[int, int]],
    turns: list[int],
    *,
    thickness: float = 1.6e-3,
    cells: tuple[int, int] = (6, 6),
    addresses: tuple[int, ...] = (0x0C, 0x0D, 0x0E, 0x0F),
) -> SkinDesign:
    """The planar design with its first chip below the board and the others above it."""
    base, sheet = PLANAR.magnets[:2]
    magnets = [replace(base, corner=corners[0])]
    magnets += [
        replace(sheet, name=f"M{k + 2}", corner=corner) for k, corner in enumerate(corners[1:])
    ]
    halls = [
        replace(
            PLANAR.halls[min(k, 1)],
            name=f"S{k + 1}",
            magnet=f"M{k + 1}",
            axes=(LOWER if k == 0 else UPPER)[turn],
            address=addresses[k],
        )
        for k, turn in enumerate(turns)
    ]
    return replace(
        PLANAR,
        cells=cells,
        magnets=tuple(magnets),
        halls=tuple(halls),
        board=replace(PLANAR.board, thickness=thickness),
    )


CURVED = arranged([(4, 4), (4, 2), (2, 4), (2, 2)], [0, 0, 0, 0], thickness=0.11e-3)
"""The arrangement of the paper's flexible circuit: three chips above and one below."""


MANY = arranged(
    [(5, 1), (1, 1), (3, 1), (5, 3), (1, 3), (3, 5), (1, 5), (5, 5)],
    [0, 1, 2, 3, 0, 1, 2, 3],
    addresses=tuple(range(0x0C, 0x14)),
)
"""Eight chips of two order codes."""


def random_design(seed: int) -> SkinDesign:
    """Chips at places drawn at random, turned at random."""
    rng = np.random.default_rng(seed)
    cells = int(rng.integers(5, 9)), int(rng.integers(5, 9))
    many = int(rng.integers(3, 5))
    spots = [(p, q) for p in range(1, cells[0]) for q in range(1, cells[1])]
    picked = [spots[k] for k in rng.choice(len(spots), size=many, replace=False)]
    turns = [int(t) for t in rng.integers(0, 4, size=many)]
    addresses = tuple(0x0C + int(a) for a in rng.permutation(4)[:many])
    thickness = float(rng.choice([0.11e-3, 1.0e-3, 1.6e-3]))
    return arranged(picked, turns, thickness=thickness, cells=cells, addresses=addresses)
