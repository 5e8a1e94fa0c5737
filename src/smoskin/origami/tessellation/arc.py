"""The Miura sheet on a cylinder in closed form: every bottom vertex on it, and it folds.

Decides which of the many such sheets is taken: one with the planar cell's width along the surface,
its height, and its zigzag at half the height.
"""

import numpy as np
from scipy.optimize import brentq

from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.errors import DesignError
from smoskin.origami.cell import size


def zigzag_angles(cell: MiuraCell, radius: float) -> tuple[float, float]:
    r"""Angles about the axis between neighbours of a zigzag line, bottom and top, rad.

    With cells of the angle :math:`\Delta`, top vertices at :math:`\rho = 1 + \eta` times the
    radius, and the angles :math:`\delta` at the bottom and :math:`\varepsilon` at the top, panels
    are plane where

    .. math:: \rho^2 \sin\varepsilon - 2 \rho \cos\tfrac{\Delta}{2}
        \sin\tfrac{\delta + \varepsilon}{2} + \sin\delta = 0 .

    Parameters
    ----------
    radius : float
        Radius of the cylinder, m; negative where the sheet lies inside.

    Raises
    ------
    DesignError
        If the cylinder is so tight that the zigzag of the top vanishes.

    Notes
    -----
    It is solved for :math:`\tau = (\varepsilon - \delta) / 2` with a given mean, in the same form
    without its cancelling terms; see docs/derivations_curved.md.
    """
    _, width, height = (float(extent) for extent in size(cell))
    eta, half = height / radius, width / (2 * radius)
    mean = cell.panel_b * float(np.cos(cell.fold_angle)) / (radius + height / 2)

    def warp(tau: float) -> float:
        """Left side of the equation."""
        product = np.sin((half + tau) / 2) * np.sin((half - tau) / 2)
        turned = 2 * np.cos(mean) * np.sin(tau) + eta * np.sin(mean + tau)
        return float(4 * (1 + eta) * np.sin(mean) * product + eta * turned)

    least = -abs(mean)
    if max(abs(half), abs(mean)) > np.pi / 2 or warp(least) * warp(0.0) >= 0.0:
        raise DesignError(
            f"a cell {1e3 * width:.3g} mm wide and {1e3 * height:.3g} mm high cannot follow a "
            f"cylinder of radius {1e3 * abs(radius):.3g} mm; take smaller cells or a larger radius"
        )
    tau = float(brentq(warp, least, 0.0, xtol=1e-300, rtol=1e-15))
    return mean - tau, mean + tau


def arc_sheet(cell: MiuraCell, cells: tuple[int, int], radius: float) -> tuple[Floats, Floats]:
    """Parameters (2N + 1, 2M + 1, 2) and heights (2N + 1, 2M + 1), m, on a cylinder along x.

    A plane has an infinite radius. Rows run along the axis, and the middle of the sheet lies at
    the parameters (0, 0); heights are those over the surface.
    """
    length, width, height = (float(extent) for extent in size(cell))
    if np.isinf(radius):
        bottom = top = cell.panel_b * float(np.cos(cell.fold_angle))
    else:
        bottom, top = (radius * angle for angle in zigzag_angles(cell, radius))
    i, j = np.indices((2 * cells[0] + 1, 2 * cells[1] + 1))
    zigzag = np.where(j % 2, top, bottom) * np.where(i % 2, -0.5, 0.5)
    along, across = (i - cells[0]) * length / 2, (j - cells[1]) * width / 2 + zigzag
    return np.stack([along, across], axis=-1), np.where(j % 2, height, 0.0)
