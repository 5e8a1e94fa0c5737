"""The attachment of a sheet to a surface, and the field of folds by which it takes up stretch.

Decides where the search for the vertices begins on surfaces that no flat sheet lies on without
stretch; the paper's energies, discretised on the lattice of the sheet's vertices. Their numerical
method is ours: the paper names none.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.optimize import minimize

from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.origami.cell import size
from smoskin.origami.surface.surface import Surface, forms

_ITERATIONS: Final = 150
"""Steps of the minimiser."""


_CORNERS: Final = ((0, 0), (1, 0), (0, 1), (1, 1))
"""Corners of a panel by its rows and columns of nodes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stiffness:
    """Weights of an attachment's energy over that of bending."""

    stretch: float = 100.0
    """tau: weight of stretch, over the square of a cell's length."""
    smooth: float = 100.0
    """Weight of the fold angle's differences between neighbouring panels, 1/rad^2."""


@dataclass(frozen=True, slots=True, eq=False)
class Attachment:
    """A lattice of a sheet on a surface."""

    parameters: Floats
    """(2N + 1, 2M + 1, 2), m: places of the lattice's nodes on the surface."""
    folds: Floats
    """(2N, 2M), rad: fold angle phi of each panel."""
    energy: float
    """Mean energy of a panel."""


def attach(
    surface: Surface, cell: MiuraCell, cells: tuple[int, int], stiffness: Stiffness = Stiffness()
) -> Attachment:
    """The attachment and the fold field of least energy, begun at the chart's own lattice.

    Notes
    -----
    Source: SI Eqs. (S30) and (S31), with the mean fold angle held and its differences weighted:
    with one angle for all, the least energy is that of a sheet folded to nothing.
    """
    energy = Energy(surface, cell, cells, stiffness)
    scale = float(size(cell).length)
    objective: Any = energy.value
    result = minimize(
        objective,
        np.concatenate([energy.lattice.ravel() / scale, np.zeros(4 * cells[0] * cells[1])]),
        args=(scale,),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": _ITERATIONS, "ftol": 1e-8, "gtol": 1e-6},
    )
    parameters, turns = energy.split(result.x, scale)
    return Attachment(parameters, cell.fold_angle + turns, float(result.fun) / turns.size)


def attached_sheet(
    attachment: Attachment, cell: MiuraCell, zigzag: Floats
) -> tuple[Floats, Floats]:
    """Parameters (2N + 1, 2M + 1, 2) and heights (2N + 1, 2M + 1), m, of a sheet on a lattice.

    The zigzag (2N + 1, 2M + 1), m, is what a vertex lies off the lattice's row on a surface
    without stretch; heights follow the fold angle.
    """
    rows = attachment.parameters
    across = np.gradient(rows, float(size(cell).width) / 2, axis=1)
    phi = np.pad(attachment.folds, 1, mode="edge")
    phi = (phi[1:, 1:] + phi[1:, :-1] + phi[:-1, 1:] + phi[:-1, :-1]) / 4
    # b cos(phi) over the stretch that the lattice has already.
    share = (np.cos(phi) / np.cos(cell.fold_angle)) ** 2
    top = np.indices(zigzag.shape)[1] % 2 == 1
    heights = np.where(top, size(cell, np.minimum(phi, cell.sector_angle)).height, 0.0)
    return rows + (share * zigzag)[..., None] * across, heights


class Energy:
    r"""Energy of a lattice on a surface.

    With the fold's stretches :math:`\lambda_x = \sin\phi / \sin\phi_0` and
    :math:`\lambda_y = \cos\phi_0 / \cos\phi` over the sheet at rest, and C measured by them,

    .. math:: W = \sum \lambda_x \lambda_y \left[ \tau \left( \operatorname{tr} C
        + \frac{1}{\det C} - 3 \right) + l^2\, b_{\alpha\beta} b_{\alpha\beta} \right]
        + \mu \sum (\Delta \phi)^2 .
    """

    def __init__(
        self,
        surface: Surface,
        cell: MiuraCell,
        cells: tuple[int, int],
        stiffness: Stiffness = Stiffness(),
    ) -> None:
        self._stiffness = stiffness
        self._surface, self._fold = surface, cell.fold_angle
        extent = size(cell)
        self._length, self._steps = float(extent.length), (extent.length / 2, extent.width / 2)
        i, j = np.indices((2 * cells[0] + 1, 2 * cells[1] + 1))
        self.lattice = np.stack(
            [(i - cells[0]) * self._steps[0], (j - cells[1]) * self._steps[1]], axis=-1
        )
        self._middle = cells

    def split(self, unknowns: Floats, scale: float) -> tuple[Floats, Floats]:
        """Parameters of the nodes, and what the panels' fold angles add to their mean."""
        count = self.lattice.size
        parameters = scale * unknowns[:count].reshape(self.lattice.shape)
        turns = unknowns[count:].reshape(self.lattice.shape[0] - 1, -1)
        return parameters, turns - turns.mean()

    def value(self, unknowns: Floats, scale: float) -> tuple[float, Floats]:
        """Energy and its derivatives; the node in the middle and its row's direction are held."""
        parameters, turns = self.split(unknowns, scale)
        at = forms(self._surface, parameters)
        stretch, by_places, by_turns = self._stretch(at.places, turns)
        bend, more, by_normals = self._bend(at.places, at.normals)
        by = np.einsum("ijk,ijka->ija", by_places + more, at.slopes)
        by += np.einsum("ijk,ijka->ija", by_normals, at.turns)
        n, m = self._middle
        by[n, m] = by[n + 1, m, 1] = 0.0
        rough = 0.0
        for axis in (0, 1):
            steps = np.diff(turns, axis=axis)
            rough += self._stiffness.smooth * float((steps**2).sum())
            pad = [(0, 0), (0, 0)]
            pad[axis] = (1, 1)
            by_turns -= 2 * self._stiffness.smooth * np.diff(np.pad(steps, pad), axis=axis)
        by_turns -= by_turns.mean()
        return stretch + bend + rough, np.concatenate([scale * by.ravel(), by_turns.ravel()])

    def _stretch(self, places: Floats, turns: Floats) -> tuple[float, Floats, Floats]:
        """Energy of stretch, by places and by fold angles."""
        phi = self._fold + turns
        along = np.sin(phi) / np.sin(self._fold)
        across = np.cos(self._fold) / np.cos(phi)
        weight = along * across / 4
        tau = self._stiffness.stretch
        total, by_places = 0.0, np.zeros_like(places)
        by_along, by_across = np.zeros_like(phi), np.zeros_like(phi)
        rows = (places[1:] - places[:-1]) / self._steps[0]
        columns = (places[:, 1:] - places[:, :-1]) / self._steps[1]
        lengths, widths = (rows**2).sum(-1), (columns**2).sum(-1)
        # At each corner of a panel by its own two edges: means over the panel would leave a
        # motion, up and down in turn, that costs nothing.
        for i, j in _CORNERS:
            side, end = _part(j), _part(i)
            first, second = rows[:, side], columns[end]
            c11, c22 = lengths[:, side] / along**2, widths[end] / across**2
            c12 = (first * second).sum(-1) / (along * across)
            det = c11 * c22 - c12**2
            density = tau * (c11 + c22 + 1 / det - 3)
            by11, by22 = tau * (1 - c22 / det**2), tau * (1 - c11 / det**2)
            by12 = 2 * tau * c12 / det**2
            total += float((weight * density).sum())
            mixed = (weight * by12 / (along * across))[..., None]
            push = 2 * first * (weight * by11 / along**2)[..., None] + second * mixed
            by_places[1:][:, side] += push / self._steps[0]
            by_places[:-1][:, side] -= push / self._steps[0]
            push = 2 * second * (weight * by22 / across**2)[..., None] + first * mixed
            by_places[end][:, 1:] += push / self._steps[1]
            by_places[end][:, :-1] -= push / self._steps[1]
            # C falls as the inverse squares of the stretches, and the area grows with them.
            by_along += across / 4 * density - weight * (2 * c11 * by11 + c12 * by12) / along
            by_across += along / 4 * density - weight * (2 * c22 * by22 + c12 * by12) / across
        by_turns = by_along * np.cos(phi) / np.sin(self._fold)
        by_turns += by_across * np.cos(self._fold) * np.sin(phi) / np.cos(phi) ** 2
        return total, by_places, by_turns

    def _bend(self, places: Floats, normals: Floats) -> tuple[float, Floats, Floats]:
        """Energy of bending, by places and by normals."""
        total, by_places, by_normals = 0.0, np.zeros_like(places), np.zeros_like(normals)
        for axis in (0, 1):
            p, n = np.moveaxis(places, axis, 0), np.moveaxis(normals, axis, 0)
            by_p, by_n = np.moveaxis(by_places, axis, 0), np.moveaxis(by_normals, axis, 0)
            factor = self._length / self._steps[axis] ** 2
            second = factor * (p[2:] - 2 * p[1:-1] + p[:-2])
            bend = (second * n[1:-1]).sum(-1)
            total += float((bend**2).sum())
            by_n[1:-1] += 2 * bend[..., None] * second
            push = 2 * factor * bend[..., None] * n[1:-1]
            by_p[2:] += push
            by_p[1:-1] -= 2 * push
            by_p[:-2] += push
        factor = self._length / (self._steps[0] * self._steps[1])
        mixed = factor * (places[1:, 1:] - places[1:, :-1] - places[:-1, 1:] + places[:-1, :-1])
        mean = (normals[1:, 1:] + normals[1:, :-1] + normals[:-1, 1:] + normals[:-1, :-1]) / 4
        twist = (mixed * mean).sum(-1)
        total += 2 * float((twist**2).sum())
        for i, j in _CORNERS:
            sign, part = (2 * i - 1) * (2 * j - 1), (_part(i), _part(j))
            by_places[part] += 4 * sign * factor * twist[..., None] * mean
            by_normals[part] += twist[..., None] * mixed
        return total, by_places, by_normals


def _part(end: int) -> slice:
    """Nodes at the first or the last end of every panel."""
    return slice(end, end - 1 or None)
