"""Field of magnetic rubber that is deformed: moments carried along by the cells of a mesh.

Decides how a cell's field is integrated, by as many Gauss points a side as its distance needs;
hides the choice, and the cutting of cells that a point comes close to.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints, floats
from smoskin.errors import ArgumentError
from smoskin.magnetics.sector import VACUUM_PERMEABILITY

_ORDERS: Final = (2, 4, 7)
"""Gauss nodes along the side of a box; one that needs more is cut in two."""
_DEEPEST: Final = 14
"""Halvings of a cell after which a point counts as touching the rubber."""
_FACE: Final = ((-1, -1), (1, -1), (1, 1), (-1, 1))
_CORNERS: Final = np.array([(x, y, z) for z in (-1, 1) for x, y in _FACE], dtype=np.float64)
"""Corners of the reference cube, in the order of a cell's corners."""


class _Boxes(NamedTuple):
    """Pieces of cells: boxes within the reference cube."""

    cell: Ints
    """(B,)."""
    middle: Floats
    """(B, 3)."""
    half: Floats
    """(B, 3): half of each side."""

    def some(self, chosen: Bools) -> "_Boxes":
        """Those that are chosen."""
        return _Boxes(self.cell[chosen], self.middle[chosen], self.half[chosen])


class _Dipoles(NamedTuple):
    """What stands for some boxes in each state."""

    place: Floats
    """(3, K, B, G), m."""
    moment: Floats
    """(3, K, B, G), A m^2."""


class MagneticRubber:
    """Hexahedra that carry remanent magnetisation, at rest and in K deformed states.

    Parameters
    ----------
    rest : Floats, shape (C, 8, 3)
        Corners of each cell at rest, m: four counter-clockwise seen from above, then the four
        over them.
    states : Floats, shape (K, C, 8, 3)
        The same in each state.
    magnetisation : callable
        From places (..., 3) at rest, m, to the magnetisation there (..., 3), A/m; smooth within
        each cell.
    strength : float
        Its largest magnitude, A/m.
    smoothness : float, optional
        Distance over which it changes, m: 2/k of a wave of wave number k. Constant by default.

    Notes
    -----
    A piece of rubber keeps its moment but for stretch and turn, m = F m_0 a reference volume, as
    ideal hard-magnetic rubber does. Magnetisation that the field induces is left out: recoil
    permeability one.
    """

    def __init__(
        self,
        rest: Floats,
        states: Floats,
        magnetisation: Callable[[Floats], Floats],
        *,
        strength: float,
        smoothness: float = math.inf,
    ) -> None:
        self._rest = rest
        self._states = states
        self._magnetisation = magnetisation
        self._strength = strength
        self._smooth = smoothness
        count = len(rest)
        self._share = 0.1 / count
        self._whole = _Boxes(np.arange(count), np.zeros((count, 3)), np.ones((count, 3)))
        self._wide = self._frames(self._whole)
        self._coarse = self._sample(self._whole, (_ORDERS[0],) * 3)

    def field(self, points: Floats, *, tolerance: float = 1e-7) -> Floats:
        """Flux density outside.

        Parameters
        ----------
        points : Floats, shape (Q, 3)
            Where, m, fixed in space.
        tolerance : float, optional
            Quadrature error of each component, T.

        Returns
        -------
        Floats, shape (K, Q, 3)
            T. All states share their quadrature, so that a change between two of them is free of
            what far, unmoved rubber contributes.

        Raises
        ------
        ArgumentError
            If a shape or the tolerance is wrong, or a point lies in the rubber or touches it.
        """
        where = floats("points", points, (None, 3))
        if where.ndim != 2 or not np.isfinite(where).all():
            raise ArgumentError(f"points must be (Q, 3) and finite; got {where}")
        if not tolerance > 0.0:
            raise ArgumentError(f"tolerance must be positive; got {tolerance}")
        result = np.empty((len(self._states), len(where), 3))
        for index, point in enumerate(where):
            result[:, index] = self._field(point, tolerance)
        return result

    def _field(self, point: Floats, tolerance: float) -> Floats:
        """B (K, 3) at one point."""
        needs = self._needs(self._whole, self._wide, point, tolerance)
        easy = np.all(needs == 0, axis=1)
        total = _field_of(self._coarse, point, easy)
        boxes, needs = self._whole.some(~easy), needs[~easy]
        for _ in range(_DEEPEST):
            ready = np.all(needs < len(_ORDERS), axis=1)
            orders, group = np.unique(needs[ready], axis=0, return_inverse=True)
            resolved = boxes.some(ready)
            for index, order in enumerate(orders.tolist()):
                some = resolved.some(np.equal(group, index))
                dipoles = self._sample(some, tuple(_ORDERS[item] for item in order))
                total += _field_of(dipoles, point, np.ones(len(some.cell), dtype=bool))
            if ready.all():
                return total
            boxes = _halved(boxes.some(~ready), needs[~ready] == len(_ORDERS))
            needs = self._needs(boxes, self._frames(boxes), point, tolerance)
        raise ArgumentError(
            f"points must lie outside the rubber in every state; {point} m does not"
        )

    def _needs(
        self, boxes: _Boxes, frames: tuple[Floats, Floats], point: Floats, tolerance: float
    ) -> Ints:
        """Index into `_ORDERS` of the rule each box needs along each side, (B, 3).

        The tolerance is dealt out to the cells alike, as errors may add up, and a tenth of it, as
        bent cells are not quite what the rule below takes them for.

        A Gauss rule of n nodes on a side of half length e errs by rho^(-2n), where the integrand
        is analytic in the ellipse through the point at distance d: rho = d/e + sqrt((d/e)^2 + 1).
        A magnetisation that varies over the side counts as a point at its smoothness.
        """
        middle, axes = frames
        apart = point - middle
        with np.errstate(all="ignore"):  # at distance zero the bound is not finite: cut further
            local = np.clip(np.linalg.solve(axes, apart[..., None]), -1.0, 1.0)
            away = np.linalg.norm(apart - (axes @ local)[..., 0], axis=-1)
            slim = np.minimum(away, self._smooth)[..., None] / np.linalg.norm(axes, axis=-2)
            growth = 2.0 * np.log(slim + np.sqrt(slim * slim + 1.0))
            moment = self._strength * 8.0 * np.abs(np.linalg.det(axes))
            size = VACUUM_PERMEABILITY / (4.0 * np.pi) * moment / away**3
            digits = np.log(np.maximum(size / (self._share * tolerance), 1.0))
            nodes = digits[..., None] / growth
        needed = np.max(np.where(np.isfinite(nodes), nodes, np.inf), axis=0)
        return np.asarray(np.searchsorted(_ORDERS, needed), dtype=np.int64)

    def _frames(self, boxes: _Boxes) -> tuple[Floats, Floats]:
        """Middles (K, B, 3) of boxes and, in columns, their half sides (K, B, 3, 3), m."""
        nodes = self._states[:, boxes.cell]
        weights = _shape(boxes.middle)
        slopes = _shape_slopes(boxes.middle) * boxes.half[:, None]
        middle = np.einsum("bn,kbnx->kbx", weights, nodes)
        return middle, np.einsum("bnj,kbnx->kbxj", slopes, nodes)

    def _sample(self, boxes: _Boxes, orders: tuple[int, ...]) -> _Dipoles:
        """Gauss points of boxes, so many along each side, with their moments.

        With A = dX/dxi at rest and a = dx/dxi deformed, F m_0 dV = a (A^-1 M_0 det A) dxi: what
        stands in brackets belongs to the rubber, whatever its state.
        """
        rules = [_gauss(order) for order in orders]
        grid = np.meshgrid(*(nodes for nodes, _ in rules), indexing="ij")
        local = np.stack([item.ravel() for item in grid], axis=-1)
        heavy = np.einsum("i,j,k->ijk", *(weights for _, weights in rules)).ravel()
        middle, half = boxes.middle, boxes.half
        if np.all(half == 1.0):  # whole cells, whose shape functions are all alike
            middle, half = middle[:1], half[:1]
        spots = middle[:, None] + half[:, None] * local
        weights, slopes = _shape(spots), _shape_slopes(spots)
        rest, states = self._rest[boxes.cell], self._states[:, boxes.cell]
        material = self._magnetisation(weights @ rest)
        along = [np.swapaxes(slopes[..., side] @ rest, 0, 2) for side in range(3)]
        volume = np.swapaxes(heavy * np.prod(half, axis=1)[:, None], 0, 1)
        inward = np.swapaxes(material, 0, 2)
        carried = np.stack(
            [
                _triple(inward, along[(side + 1) % 3], along[(side + 2) % 3]) * volume
                for side in range(3)
            ]
        )
        lines = (slopes @ np.swapaxes(carried, 0, 2)[..., None])[..., 0]
        return _Dipoles(
            place=np.moveaxis(weights @ states, -1, 0), moment=np.moveaxis(lines @ states, -1, 0)
        )


@cache
def _gauss(order: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights on (-1, 1)."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return nodes, weights


def _field_of(dipoles: _Dipoles, point: Floats, chosen: Bools) -> Floats:
    """B (K, 3) of the chosen boxes, summed."""
    rx, ry, rz = (
        coordinate - place[:, chosen]
        for coordinate, place in zip(point, dipoles.place, strict=True)
    )
    mx, my, mz = (moment[:, chosen] for moment in dipoles.moment)
    square = rx * rx + ry * ry + rz * rz
    cube = 1.0 / (square * np.sqrt(square))
    along = 3.0 * (mx * rx + my * ry + mz * rz) * cube / square
    total = [(along * r - m * cube).sum(axis=(1, 2)) for r, m in ((rx, mx), (ry, my), (rz, mz))]
    return VACUUM_PERMEABILITY / (4.0 * np.pi) * np.stack(total, axis=-1)


def _triple(a: Floats, b: Floats, c: Floats) -> Floats:
    """Product a . (b x c), components first."""
    return np.asarray(
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def _halved(boxes: _Boxes, across: Bools) -> _Boxes:
    """Boxes cut in two across each side that is marked, (B, 3)."""
    cell, middle, half = boxes
    for side in range(3):
        cut = across[:, side]
        half = np.where(cut[:, None] & (np.arange(3) == side), 0.5 * half, half)
        shift = np.zeros_like(half)
        shift[cut, side] = half[cut, side]
        cell = np.concatenate([cell, cell[cut]])
        middle = np.concatenate([middle - shift, (middle + shift)[cut]])
        half = np.concatenate([half, half[cut]])
        across = np.concatenate([across, across[cut]])
    return _Boxes(cell, middle, half)


def _shape(spots: Floats) -> Floats:
    """Trilinear shape functions (..., 8) at places (..., 3) of the reference cube."""
    x, y, z = np.moveaxis(1.0 + spots[..., None, :] * _CORNERS, -1, 0)
    return np.asarray(x * y * z / 8.0)


def _shape_slopes(spots: Floats) -> Floats:
    """Their derivatives, (..., 8, 3)."""
    x, y, z = np.moveaxis(1.0 + spots[..., None, :] * _CORNERS, -1, 0)
    return np.asarray(np.stack([y * z, z * x, x * y], axis=-1) * _CORNERS / 8.0)
