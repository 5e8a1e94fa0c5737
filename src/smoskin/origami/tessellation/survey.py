"""What a surface asks of a sheet, told before the sheet is sought.

Decides what is refused at once: a surface that a cell cannot follow, one that is bent along the
sheet's x alone, and more Gaussian curvature than cells' folds can take up. The last is a bound for
equal cells by their lengths alone: thickness, sector angles and bending are left to the gates.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError, DesignError
from smoskin.origami.cell import fold_angle, size
from smoskin.origami.surface.surface import Forms, Surface, curvatures, forms
from smoskin.origami.tessellation.validity import DEPTH, Gate

_TIGHTEST: Final = 0.8
"""Largest product of a curvature and a cell's width that a cell can follow."""
_ONE_WAY: Final = 0.1
"""Largest Gaussian curvature over the square of the largest one at which a surface is bent one
way; charts of noisy meshes stay below."""
_NODES: Final = 31
"""Nodes each way at which the fold angle is sought."""
_REACH: Final = 1.2
"""Size of the patch whose least curvature counts, over the sheet's."""
_STEPS: Final = 60
"""Most steps of the search for the fold angles."""
_HALVINGS: Final = 7
"""Steps by which the largest patch is sought."""


class TooBentError(DesignError):
    """A surface that no sheet of such cells lies on, told before one is sought."""

    def __init__(self, message: str, name: str, bound: tuple[float, float, str]) -> None:
        super().__init__(message)
        value, limit, unit = bound
        self.gate = Gate(name=name, value=value, limit=limit, unit=unit, holds=False)
        """What is asked, and the most that cells can give."""


def survey(surface: Surface, cell: MiuraCell, cells: tuple[int, int]) -> tuple[float, bool]:
    """Radius along y in the mean, m, positive outside; whether the surface is bent one way."""
    length, width, height = (float(extent) for extent in size(cell))
    x = np.linspace(-0.5, 0.5, 2 * cells[0] + 1) * cells[0] * length
    y = np.linspace(-0.5, 0.5, 2 * cells[1] + 1) * cells[1] * width
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    known = surface.holds(grid)
    _refuse_tight(forms(surface, grid[known]), width, height)
    if not known.all():
        raise ArgumentError("the surface must reach under the whole sheet; take fewer cells")
    at = forms(surface, grid)
    principal = curvatures(at)
    largest = np.abs(principal).max(axis=-1)
    gauss = np.median(np.abs(principal.prod(axis=-1)))
    one_way = bool(gauss <= _ONE_WAY * np.median(largest) ** 2)
    along, bend = (-float(np.mean(at.second[..., k, k] / at.metric[..., k, k])) for k in (0, 1))
    if one_way and abs(along) > max(abs(bend), 1e-6):
        raise ArgumentError(
            "the surface must be bent along the sheet's y, and be straight along its x, the axis; "
            "turned otherwise a sheet does not fold: turn the direction by 90 degrees"
        )
    return (1 / bend if abs(bend) * height > 1e-9 else np.inf), one_way


def _refuse_tight(at: Forms, width: float, height: float) -> None:
    """Raise where a surface is bent more tightly than a cell can follow, at the tightest place."""
    principal = curvatures(at)
    largest = np.abs(principal).max(axis=-1)
    tight = np.maximum(largest * width, 2 * principal[..., 1] * height)
    if tight.max(initial=0.0) <= _TIGHTEST:
        return
    worst = int(np.argmax(tight))
    place = ", ".join(f"{1e3 * v:.0f}" for v in at.places[worst])
    share = _TIGHTEST / float(tight[worst])
    raise TooBentError(
        f"the surface's radius of {1e3 / float(largest[worst]):.3g} mm at ({place}) mm is too "
        f"tight for a cell {1e3 * width:.3g} mm wide; take cells {share:.2f} times as large",
        "curvature_times_cell",
        (float(tight[worst]), _TIGHTEST, "1"),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldRange:
    """Fold angles that a patch asks of a sheet of equal cells, and those that its depth leaves."""

    rim: float
    """rad: fold angle of the rim, the last one that is left."""
    middle: float
    """rad: what the middle then has at the least on a dome, at the most on a saddle."""
    left: tuple[float, float]
    """rad: least and largest fold angle at which the depth holds."""

    @property
    def holds(self) -> bool:
        """Whether what is asked is left."""
        return self.left[0] <= self.middle <= self.left[1]


def fold_range(
    surface: Surface, cell: MiuraCell, cells: tuple[int, int], share: float = 1.0
) -> FoldRange:
    r"""The least range of fold angles with which such cells lie on a patch of a surface.

    Parameters
    ----------
    share : float
        Factor on the sheet's extent, with the patch's curvature kept.

    Notes
    -----
    Equal cells folded by :math:`\phi` have the metric :math:`\lambda_x^2 dX^2 + \lambda_y^2 dY^2`,
    whose Gaussian curvature is the patch's where, with :math:`c = \sin\phi_0 \cos\phi_0`,

    .. math:: c\, (\tan\phi)_{XX} + \frac1c \left( \frac\phi2 + \frac{\sin 2\phi}{4} \right)_{YY}
        = -K \frac{\tan\phi}{\tan\phi_0} .

    On a dome the fold angle is largest inside, and there it is least where all of the rim is folded
    as far as the depth's limit lets it; on a saddle it is the other way round. K is the least, by
    magnitude, near the patch, and zero where its sign changes.
    """
    length, width, height = (float(extent) for extent in size(cell))
    deepest = min((1 + DEPTH) * height, cell.panel_a * float(np.sin(cell.sector_angle)))
    least, most = (float(fold_angle(cell, height=h)) for h in (deepest, (1 - DEPTH) * height))
    extent = np.multiply(cells, (length, width))
    curvature = _curvature(surface, extent)
    rim = least if curvature > 0.0 else most
    middle = rim
    if curvature != 0.0:
        middle = _middle(curvature, share * extent, cell.fold_angle, rim, (least, most))
    return FoldRange(rim=rim, middle=middle, left=(least, most))


def largest_share(surface: Surface, cell: MiuraCell, cells: tuple[int, int]) -> float:
    """Size, over a sheet's that a patch asks too much of, up to which it would not."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        low, high = (share, high) if fold_range(surface, cell, cells, share).holds else (low, share)
    return low


def _curvature(surface: Surface, extent: Floats) -> float:
    """Gaussian curvature that the patch has everywhere at least, 1/m^2, with its sign."""
    x, y = (np.linspace(-0.5, 0.5, 15) * _REACH * side for side in extent)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    gauss = curvatures(forms(surface, grid[surface.holds(grid)])).prod(axis=-1)
    return float(max(gauss.min(), 0.0) + min(gauss.max(), 0.0))


def _middle(
    curvature: float, sides: Floats, planar: float, rim: float, left: tuple[float, float]
) -> float:
    """Fold angle in the middle of a sheet whose rim is folded so far, rad.

    Beyond what is left the equation goes on with its values there, so that it has a solution; one
    that stays inside solves the equation itself.
    """
    steps = sides / (_NODES + 1)
    second = sparse.diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(_NODES, _NODES))
    unit = sparse.eye_array(_NODES)
    along, across = (
        sparse.kron(second / steps[0] ** 2, unit),
        sparse.kron(unit, second / steps[1] ** 2),
    )
    c = np.sin(planar) * np.cos(planar)
    turn = np.zeros(_NODES**2)
    for _ in range(_STEPS):
        fold = np.clip(rim + turn, *left)
        # Differences of tan(phi), and of phi / 2 + sin(2 phi) / 4, over those of phi itself.
        even = np.sinc((fold - rim) / np.pi)
        by_x = even / (np.cos(fold) * np.cos(rim))
        by_y = 0.5 + even * np.cos(fold + rim) / 2
        matrix = along @ sparse.diags_array(c * by_x) + across @ sparse.diags_array(by_y / c)
        before = turn
        turn = splu(matrix.tocsc()).solve(-curvature * np.tan(fold) / np.tan(planar))
        if np.abs(turn - before).max() < 1e-6:
            break
    return float(rim + turn[np.argmax(np.abs(turn))])
