"""The dividing line 1.51 between cells (1,1) and (2,1): every reading of it that was tried.

The four displacements printed beside it fix the cell and v_a, and with those the SI's own rule,
the mean of the two cells' ratios U_2x/U_3x, gives another number (U1 of the errata).
"""

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import brentq

from paper.maps import sheet_magnets
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.reduced.attenuation import FoldFrom, cell_change, profiles

PRINTED: Final = 1.51
RATIO: Final = 0.7313 / 0.6721
"""Greater over lesser of the two printed displacements in x."""
_PRESS: Final = -1e-3


class Attempt(NamedTuple):
    """One reading of the dividing line."""

    how: str
    line: float

    @property
    def gives_it(self) -> bool:
        """Whether it rounds to the printed number."""
        return abs(self.line - PRINTED) <= 0.005


def attempts(design: SkinDesign) -> tuple[Attempt, ...]:
    """All readings tried, the SI's own first."""
    second, third = (2 * magnet.corner[0] for magnet in sheet_magnets(design))
    v = design.coefficients.attenuation[0]
    motion = _motion(design, v)
    u2, u3 = motion[:, second], motion[:, third]
    first, next_ = (u2 / u3)[:2]
    swept = _sweep(design)
    elsewhere = _other_places(swept, (second, third))
    found = [
        Attempt("the mean of the two ratios, as the SI says", (first + next_) / 2),
        Attempt("the geometric mean", math.sqrt(first * next_)),
        Attempt("the harmonic mean", 2 / (1 / first + 1 / next_)),
        Attempt("the sum of U_2x over the sum of U_3x", u2[:2].sum() / u3[:2].sum()),
        Attempt(
            "the middle of the two directions",
            math.tan((math.atan(first) + math.atan(next_)) / 2),
        ),
        Attempt("labels 2 and 3 as in the text", (1 / first + 1 / next_) / 2),
    ]
    sources: tuple[FoldFrom, ...] = ("width", "mean")
    for source in sources:
        parts = profiles(design.cell, design.cells, (v, v), _PRESS, fold_from=source)
        ratio = parts.x[:2, second] / parts.x[:2, third]
        found.append(Attempt(f"fold from the {source} instead of the length", ratio.mean()))
    parts = profiles(design.cell, design.cells, (v, v), _PRESS, kinematics="exact")
    found.append(
        Attempt(
            "exact inverse of S1 at 1 mm, dl attenuated",
            (parts.x[:2, second] / parts.x[:2, third]).mean(),
        )
    )
    for press in (1e-4, 1e-3, 3e-3):
        shift = _attenuated_height(design, v, press)
        found.append(
            Attempt(
                f"exact inverse of S1 at {press * 1e3:g} mm, dh attenuated instead of dl",
                (shift[:2, second] / shift[:2, third]).mean(),
            )
        )
    found += [
        Attempt(
            "magnets at the mean of the two nearest middle lines, v_a fitted again",
            _hung_between_middles(swept, second, third),
        ),
        Attempt(
            "the nearest of all other pairs of lines and middles for the magnets, v_a fitted again",
            _nearest(elsewhere),
        ),
        Attempt(
            "the mean over cells (2,1) and (3,1), by magnitude",
            float(np.abs(u2 / u3)[1:3].mean()),
        ),
    ]
    return tuple(Attempt(one.how, float(one.line)) for one in found)


def attenuation_needed(design: SkinDesign) -> float:
    """The v_a at which the SI's own rule gives the printed line."""
    second, third = (2 * magnet.corner[0] for magnet in sheet_magnets(design))

    def miss(v: float) -> float:
        motion = _motion(design, v)
        return float((motion[:2, second] / motion[:2, third]).mean() - PRINTED)

    return float(brentq(miss, 0.05, 0.95))


def _motion(design: SkinDesign, attenuation: float) -> Floats:
    """Motion in x of all lines and middles for a press on each column of cells, (N, 2N + 1)."""
    return profiles(design.cell, design.cells, (attenuation, attenuation), _PRESS).x


def _attenuated_height(design: SkinDesign, attenuation: float, press: float) -> Floats:
    """Motion in x of the lines between cells if each cell's dh is attenuated, (2, 2N + 1)."""
    columns = design.cells[0]
    growth = [
        float(cell_change(design.cell, -press * attenuation**k, "exact").dl) for k in range(columns)
    ]
    reach = np.concatenate([[growth[0] / 2], growth[0] / 2 + np.cumsum(growth[1:])])
    motion = np.zeros((2, 2 * columns + 1))
    for loaded in range(2):
        for line in range(columns + 1):
            right = line > loaded
            between = line - 1 - loaded if right else loaded - line
            motion[loaded, 2 * line] = reach[between] if right else -reach[between]
    return motion


def _sweep(design: SkinDesign) -> Floats:
    """Motion for many v_a, (V, N, 2N + 1)."""
    return np.stack([_motion(design, v) for v in np.linspace(0.01, 0.99, 197)])


def _fitted_lines(second: Floats, third: Floats) -> list[float]:
    """Lines of two magnets whose v_a is first fitted to the printed ratio, whichever is greater.

    Both arguments are (V, 2): motion over v_a for a press on the first two columns.
    """
    moving = np.abs(third).min(axis=1) > 0
    ratio = second[moving] / third[moving]
    lines = []
    for target in (RATIO, 1 / RATIO):
        miss = np.abs(ratio[:, 0]) - target
        for k in np.flatnonzero(miss[:-1] * miss[1:] < 0):
            share = miss[k] / (miss[k] - miss[k + 1])
            mean = ratio[k : k + 2].mean(axis=1)
            lines.append(float(mean[0] + share * (mean[1] - mean[0])))
    return lines


def _hung_between_middles(swept: Floats, second: int, third: int) -> float:
    """The line if a magnet moves with the mean of the two middle lines beside it."""
    beside = [(swept[:, :2, i - 1] + swept[:, :2, i + 1]) / 2 for i in (second, third)]
    return _nearest(_fitted_lines(beside[0], beside[1]))


def _other_places(swept: Floats, own: tuple[int, int]) -> list[float]:
    """Lines of all other pairs of lines and middles at which the two magnets could sit."""
    wide = swept.shape[2]
    return [
        line
        for second in range(wide)
        for third in range(wide)
        if second != third and (second, third) not in (own, own[::-1])
        for line in _fitted_lines(swept[:, :2, second], swept[:, :2, third])
    ]


def _nearest(lines: list[float]) -> float:
    """The line nearest to the printed one."""
    return min(lines, key=lambda line: abs(line - PRINTED))
