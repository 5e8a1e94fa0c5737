"""The lattice's stiffness, at rest and at any place: element blocks added into a band.

Nodes are ordered so that the band is as wide as the sheet's shorter side has nodes, twice over.
Decides whether a sheet is stable at all, and in which form its inverse at rest is kept.
"""

from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.linalg import cho_solve_banded, cholesky_banded, solve_triangular
from scipy.sparse import coo_array, csc_array, dia_array
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from smoskin.arrays import Floats, Ints
from smoskin.errors import DesignError
from smoskin.mechanics.sheet import elements
from smoskin.mechanics.sheet.lattice import Lattice

_WHOLE: Final = 1024
"""Unknowns up to which the inverse itself is kept: one product beats a band's many small ones."""
_SINGULAR: Final = 1e-12
"""Smallest over largest stiffness below which the sheet holds its shape by rounding only."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RestInverse:
    """The inverse of the tangent at rest, in blocks."""

    order: Ints
    """(V,): nodes in the order of the blocks."""
    inverse: Floats
    """(Z, b, b): inverses of the factor's diagonal blocks, or, where Z is 1, of the tangent."""
    forward: Floats
    """(Z, b, b): each inverse times the factor's block to its left."""
    backward: Floats
    """(Z, b, b): each inverse, transposed, times the factor's block below it, transposed."""


class Blocks(NamedTuple):
    """Strains, forces and stiffness of the elements at some displacement, one by one."""

    strain: Floats
    """(E + P,): stretches of bars, m, and bends of panels, rad."""
    along: Floats
    """(E, 3): derivative of each stretch by the bar's second end."""
    turns: Floats
    """(4, H, 3), rad/m: derivative of each angle by the nodes of the hinge."""
    bars: Floats
    """(E, 6, 6), N/m: second derivative of each bar's energy."""
    hinges: Floats
    """(H, 12, 12), N/m: second derivative of each hinge's energy."""
    pushes: Floats
    """(3, V, 3), N: forces of bars, panels' hinges and creases at the nodes."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Place:
    """Lattice at some displacement: its forces, and its stiffness factorised."""

    inner: Floats
    """(4, V, 3), N: forces of bars, panels' hinges, creases and springs to the board."""
    strain: Floats
    """(E + P,): stretches of bars, m, and bends of panels, rad."""
    rates: tuple[Floats, Floats]
    """(E, 2, 3) and (P, 4, 3): derivatives of `strain` by the nodes of each element."""
    factor: Floats
    """(w + 1, 3V): Cholesky factor of the tangent, a lower band in the band's order."""


class _Elements(NamedTuple):
    """Elements of a lattice on the device, nodes as the lattice numbers them."""

    bars: Array
    span: Array
    length: Array
    hinges: Array
    arms: Array
    rest_angle: Array
    bar_stiffness: Array
    hinge_stiffness: Array


class Tangent:
    """Stiffness of one lattice: the second derivative of its energy by its nodes.

    Parameters
    ----------
    lattice : Lattice
        It is at rest without stress.

    Notes
    -----
    With strains s(u) of elements, their stiffnesses k, forces q and the springs g to the board:
    K = sum over elements of k (ds/du)(ds/du)' + q d2s/du2, plus g.
    """

    def __init__(self, lattice: Lattice) -> None:
        self.lattice = lattice
        span = np.diff(lattice.nodes[lattice.bars], axis=1)[:, 0]
        length = np.linalg.norm(span, axis=1)
        with jax.enable_x64(True):
            corners = lattice.nodes[lattice.hinges.T][..., None]
            self.arms = corners[1:] - corners[0]
            bent = _bend(self.arms, np.zeros_like(corners))
            self.rest_angle = np.asarray(bent[0])[:, 0]
            self.rest_gradient = np.asarray(bent[1])[..., 0]
            self._elements = _Elements(
                *(
                    jnp.asarray(part)
                    for part in (
                        lattice.bars.T,
                        span[..., None],
                        length[:, None],
                        lattice.hinges.T,
                        self.arms,
                        self.rest_angle[:, None],
                        lattice.bar_stiffness[:, None],
                        lattice.hinge_stiffness[:, None],
                    )
                )
            )
        self._along = span / length[:, None]
        self.order = _narrow_order(lattice)
        place = np.argsort(self.order)
        self._where = (3 * place[:, None] + np.arange(3)).ravel()
        below = [_entries(place, nodes) for nodes in (lattice.bars, lattice.hinges)]
        self._width = int(max((rows - columns).max(initial=0) for rows, columns, _ in below))
        size = lattice.nodes.size
        self._cells = [(rows - columns) * size + columns for rows, columns, _ in below]
        self._picks = [pick for _, _, pick in below]

    def at_rest(self) -> RestInverse:
        """The inverse that all presses share.

        Raises
        ------
        DesignError
            If the lattice can move without resistance.
        """
        lattice = self.lattice
        rates = np.stack([-self._along, self._along], axis=1).reshape(len(lattice.bars), 6)
        turns = np.moveaxis(self.rest_gradient, 0, 1).reshape(len(lattice.hinges), 12)
        band = self._band(
            rates[:, :, None] * rates[:, None] * lattice.bar_stiffness[:, None, None],
            turns[:, :, None] * turns[:, None] * lattice.hinge_stiffness[:, None, None],
        )
        try:
            factor = cholesky_banded(band, lower=True)
        except np.linalg.LinAlgError as error:
            raise DesignError(f"the sheet must hold its shape; {_UNSTABLE}") from error
        self._check_stable(band, factor)
        size = lattice.nodes.size
        if size <= _WHOLE:
            # SuperLU in the band's own order gives the same digits on any number of threads;
            # LAPACK does not.
            below = dia_array((band, -np.arange(len(band))), (size, size))
            above = dia_array((band[1:], -np.arange(1, len(band))), (size, size)).T
            lower_upper = splu(
                csc_array(below + above),
                permc_spec="NATURAL",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
            whole = lower_upper.solve(np.eye(size))[None]
            return RestInverse(
                order=self.order, inverse=whole, forward=whole[:0], backward=whole[:0]
            )
        return RestInverse(order=self.order, **_factor_blocks(factor, self._width))

    def at(self, motion: Floats, force: Floats | None = None) -> Place:
        """The lattice at a displacement.

        Parameters
        ----------
        motion : Floats, shape (V, 3)
            m.
        force : Floats, shape (E + P,), optional
            Forces of bars and panels that stiffen or soften the tangent, N and N m; those of
            their own strains by default.

        Raises
        ------
        numpy.linalg.LinAlgError
            If no stable equilibrium can be here.
        """
        made = self.blocks(motion, force)
        return Place(
            inner=np.concatenate([made.pushes, (self.lattice.ground * motion)[None]]),
            strain=made.strain,
            rates=(
                np.stack([-made.along, made.along], axis=1),
                np.moveaxis(made.turns[:, : self.lattice.panel_hinges], 0, 1),
            ),
            factor=cholesky_banded(self._band(made.bars, made.hinges), lower=True),
        )

    def blocks(self, motion: Floats, force: Floats | None = None) -> Blocks:
        """Parts of the tangent and of the forces at a displacement, element by element."""
        given = np.zeros((0, 1)) if force is None else force[:, None]
        with jax.enable_x64(True):
            made = _blocks_at(self._elements, motion[..., None], given, self.lattice.panel_hinges)
        return Blocks(*(np.asarray(part) for part in made))

    def solve(self, place: Place, right: Floats) -> Floats:
        """Displacements that small forces give at a place, both (V, 3, ...)."""
        flat = right.reshape(self.lattice.nodes.size, -1)
        ordered = np.empty_like(flat)
        ordered[self._where] = flat
        moved = cho_solve_banded((place.factor, True), ordered)
        return np.asarray(moved[self._where].reshape(right.shape))

    def strain_change(self, place: Place, motion: Floats) -> Floats:
        """Change of the strains of bars and panels with a small motion (V, 3), (E + P,)."""
        bars, panels = self.lattice.bars, self.lattice.hinges[: self.lattice.panel_hinges]
        return np.concatenate(
            [
                np.einsum("ekd,ekd->e", place.rates[0], motion[bars]),
                np.einsum("ekd,ekd->e", place.rates[1], motion[panels]),
            ]
        )

    def _band(self, bars: Floats, hinges: Floats) -> Floats:
        """Sum of element blocks (E, 6, 6) and (H, 12, 12), and of the ground, as a lower band."""
        size = self.lattice.nodes.size
        cells = (self._width + 1) * size
        total = np.zeros(cells)
        for blocks, where, pick in zip((bars, hinges), self._cells, self._picks, strict=True):
            total += np.bincount(where, weights=blocks.ravel()[pick], minlength=cells)
        band = total.reshape(self._width + 1, size)
        band[0, self._where] += self.lattice.ground.ravel()
        return band

    def _check_stable(self, band: Floats, factor: Floats) -> None:
        """Refuse a sheet whose softest motion has next to no stiffness."""
        shape: Floats = np.cos(np.arange(band.shape[1]))
        for _ in range(6):
            shape = np.asarray(cho_solve_banded((factor, True), shape / _length(shape)))
        softest = 1 / _length(shape)
        if not softest > _SINGULAR * band[0].max():
            node, axis = divmod(int(np.argmax(np.abs(shape[self._where]))), 3)
            x, y = self.lattice.nodes[node, :2] * 1e3
            raise DesignError(
                f"the sheet must hold its shape; {_UNSTABLE}: the vertex at ({x:.1f}, {y:.1f}) mm "
                f"moves along {'xyz'[axis]} against {softest:.1g} N/m"
            )


_UNSTABLE: Final = "some motion of it meets no stiffness of columns, frame, creases or panels"


@jax.jit
def _bend(arms: Array, moved: Array) -> tuple[Array, Array]:
    """Angles of hinges and their derivatives."""
    bent = elements.fold(arms, moved)
    return bent.angle, elements.pushes(bent, jnp.ones_like(bent.angle))


@partial(jax.jit, static_argnames="panels")
def _blocks_at(net: _Elements, motion: Array, given: Array, panels: int) -> tuple[Array, ...]:
    """Parts of `Blocks` for the motion (V, 3, 1) of one press."""
    bars = len(net.length)
    stretch = elements.stretch(net.span, net.length, motion[net.bars[1]] - motion[net.bars[0]])
    moved = motion[net.hinges]
    bent = elements.fold(net.arms, moved)
    turn = bent.angle - net.rest_angle
    strain = jnp.concatenate([stretch.value, turn[:panels]])
    tension, moment = net.bar_stiffness * stretch.value, net.hinge_stiffness * turn
    along, gradient = stretch.direction, elements.pushes(bent, jnp.ones_like(turn))
    ends = jnp.stack([-along, along])
    pushes = [
        jnp.zeros_like(motion).at[net.bars].add(tension[:, None] * ends),
        jnp.zeros_like(motion)
        .at[net.hinges[:, :panels]]
        .add(moment[:panels, None] * gradient[:, :panels]),
        jnp.zeros_like(motion)
        .at[net.hinges[:, panels:]]
        .add(moment[panels:, None] * gradient[:, panels:]),
    ]
    if len(given):
        tension, moment = given[:bars], moment.at[:panels].set(given[bars:])
    rates = jnp.moveaxis(ends[..., 0], 0, 1).reshape(bars, 6)
    apart = jnp.kron(jnp.array([[1.0, -1.0], [-1.0, 1.0]]), jnp.eye(3))
    of_bars = _outer(net.bar_stiffness, rates) + (tension / net.length)[..., None] * apart
    turns = jnp.moveaxis(gradient[..., 0], 0, 1).reshape(len(turn), 12)
    of_hinges = _outer(net.hinge_stiffness, turns)
    of_hinges = of_hinges + moment[..., None] * elements.fold_curvature(net.arms, moved)
    return (
        strain[:, 0],
        along[..., 0],
        gradient[..., 0],
        of_bars,
        of_hinges,
        jnp.stack(pushes)[..., 0],
    )


def _outer(stiffness: Array, rates: Array) -> Array:
    """Blocks of springs that resist each element's one strain."""
    return stiffness[..., None] * rates[:, :, None] * rates[:, None]


def _length(vector: Floats) -> float:
    """Length of a vector."""
    return float(np.linalg.norm(vector))


def _narrow_order(lattice: Lattice) -> Ints:
    """Nodes in an order that keeps coupled ones near each other."""
    count = len(lattice.nodes)
    rows, columns = [], []
    for nodes in (lattice.bars, lattice.hinges):
        each = nodes.shape[1]
        rows.append(np.repeat(nodes, each, axis=1).ravel())
        columns.append(np.tile(nodes, (1, each)).ravel())
    where = np.concatenate(rows), np.concatenate(columns)
    links = coo_array((np.ones(len(where[0])), where), (count, count)).tocsr()
    return np.asarray(reverse_cuthill_mckee(links, symmetric_mode=True), dtype=np.int64)


def _entries(place: Ints, nodes: Ints) -> tuple[Ints, Ints, Ints]:
    """Rows and columns, in the band, of an element block's entries below the diagonal.

    The third result is their index among the blocks' entries, all of them in a row.
    """
    where = (3 * place[nodes][..., None] + np.arange(3)).reshape(len(nodes), -1)
    rows = np.repeat(where, where.shape[1], axis=1).ravel()
    columns = np.tile(where, (1, where.shape[1])).ravel()
    pick = np.flatnonzero(rows >= columns)
    return rows[pick], columns[pick], pick


def _factor_blocks(factor: Floats, width: int) -> dict[str, Floats]:
    """A banded Cholesky factor as blocks that couple with their neighbours alone."""
    size = factor.shape[1]
    block = 3 * -(-width // 3)
    count = -(-size // block)
    padded = np.zeros((block + 1, count * block))
    padded[: width + 1, :size] = factor
    padded[0, size:] = 1.0
    near, far = np.indices((block, block))
    inverse = np.zeros((count, block, block))
    forward, backward = np.zeros_like(inverse), np.zeros_like(inverse)
    for z in range(count):
        own = np.where(near >= far, padded[np.maximum(near - far, 0), z * block + far], 0.0)
        inverse[z] = solve_triangular(own, np.eye(block), lower=True)
        if z:
            gap = block + near - far
            left = np.where(
                gap <= block, padded[np.minimum(gap, block), (z - 1) * block + far], 0.0
            )
            forward[z] = inverse[z] @ left
            backward[z - 1] = inverse[z - 1].T @ left.T
    return {"inverse": inverse, "forward": forward, "backward": backward}
