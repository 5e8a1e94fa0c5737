"""The lattice's stiffness, at rest and at any place: element blocks added into a band.

Nodes are ordered so that the band is as wide as the sheet's shorter side has nodes, twice over.
Decides whether a sheet is stable at all, and in which form its inverse at rest is kept.
"""

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


class Elements(NamedTuple):
    """Bars and hinges of a lattice on the device, P of the hinges within panels."""

    bars: Array
    """(2, E): nodes at the bars' ends."""
    span: Array
    """(E, 3, 1), m: from the first end to the second at rest."""
    length: Array
    """(E, 1), m."""
    hinges: Array
    """(4, H): both nodes of each axis, then both wings."""
    arms: Array
    """(3, H, 3, 1), m: from the start of each hinge's axis to its end and wings at rest."""
    rest_angle: Array
    """(H, 1), rad: 0 within panels, which are flat."""
    rest_along: Array
    """(E, 3, 1): unit vectors along the bars."""
    rest_gradient: Array
    """(4, P, 3, 1), rad/m: derivatives of the panels' bends at rest."""
    stiffness: Array
    """(E + P, 1), N/m and N m/rad: bars, then panels' hinges."""
    crease_stiffness: Array
    """(H - P, 1), N m/rad."""


class RestInverse(NamedTuple):
    """The inverse of the tangent at rest, in blocks."""

    place: Ints
    """(3V,): place of each displacement in the blocks; where Z is 1 they keep their own order."""
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


class Place(NamedTuple):
    """Lattice at some displacement: its forces, and its stiffness factorised."""

    blocks: Blocks
    """The elements, one by one."""
    inner: Floats
    """(4, V, 3), N: forces of bars, panels' hinges, creases and springs to the board."""
    factor: Floats
    """(w + 1, 3V): Cholesky factor of the tangent, a lower band in the band's order."""


class Tangent:
    """Stiffness of a lattice without stress at rest: second derivative of its energy by its nodes.

    Notes
    -----
    With strains s(u) of elements, their stiffnesses k, forces q and the springs g to the board:
    K = sum over elements of k (ds/du)(ds/du)' + q d2s/du2, plus g.
    """

    def __init__(self, lattice: Lattice) -> None:
        self.lattice = lattice
        with jax.enable_x64(True):
            self.elements = _elements(lattice)
        place = _narrow_places(lattice)
        self._where = (3 * place[:, None] + np.arange(3)).ravel()
        below = [_entries(place, nodes) for nodes in (lattice.bars, lattice.hinges)]
        self._width = int(max((rows - columns).max(initial=0) for rows, columns, _ in below))
        size = lattice.nodes.size
        self._cells = [(rows - columns) * size + columns for rows, columns, _ in below]
        self._picks = [pick for _, _, pick in below]

    def at_rest(self) -> RestInverse:
        """The inverse that all presses share.

        It raises a `DesignError` if the lattice can move without resistance.
        """
        made = self.blocks(np.zeros_like(self.lattice.nodes))
        band = self._band(made.bars, made.hinges)
        try:
            factor = cholesky_banded(band, lower=True)
        except np.linalg.LinAlgError as error:
            raise DesignError(f"the sheet must hold its shape; {_UNSTABLE}") from error
        self._check_stable(band, factor)
        size = self.lattice.nodes.size
        if size > _WHOLE:
            return RestInverse(self._where, *_factor_blocks(factor, self._width))
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
        whole = lower_upper.solve(np.eye(size))[np.ix_(self._where, self._where)][None]
        return RestInverse(np.arange(size), whole, whole[:0], whole[:0])

    def at(self, motion: Floats, force: Floats | None = None) -> Place:
        """The lattice at a displacement (V, 3), m.

        Forces of bars, N, and panels, N m, (E + P,), stiffen or soften it; by default they are
        those of their own strains.

        Raises
        ------
        numpy.linalg.LinAlgError
            If no stable equilibrium can be here.
        """
        made = self.blocks(motion, force)
        return Place(
            blocks=made,
            inner=np.concatenate([made.pushes, (self.lattice.ground * motion)[None]]),
            factor=cholesky_banded(self._band(made.bars, made.hinges), lower=True),
        )

    def blocks(self, motion: Floats, force: Floats | None = None) -> Blocks:
        """Parts of the tangent and of the forces at a displacement, element by element."""
        with jax.enable_x64(True):
            made = _blocks_at(self.elements, motion[..., None], force)
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
        panels = self.lattice.panel_hinges
        growth = np.diff(motion[self.lattice.bars], axis=1)[:, 0]
        moved = motion[self.lattice.hinges[:panels]]
        bends = np.einsum("ked,ekd->e", place.blocks.turns[:, :panels], moved)
        return np.concatenate([(place.blocks.along * growth).sum(axis=1), bends])

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
            shape = np.asarray(cho_solve_banded((factor, True), shape / np.linalg.norm(shape)))
        softest = 1 / float(np.linalg.norm(shape))
        if not softest > _SINGULAR * band[0].max():
            node, axis = divmod(int(np.argmax(np.abs(shape[self._where]))), 3)
            x, y = self.lattice.nodes[node, :2] * 1e3
            raise DesignError(
                f"the sheet must hold its shape; {_UNSTABLE}: the vertex at ({x:.1f}, {y:.1f}) mm "
                f"moves along {'xyz'[axis]} against {softest:.1g} N/m"
            )


_UNSTABLE: Final = "some motion of it meets no stiffness of columns, frame, creases or panels"


def _elements(lattice: Lattice) -> Elements:
    """The lattice's elements on the device."""
    panels = lattice.panel_hinges
    span = np.diff(lattice.nodes[lattice.bars], axis=1)[:, 0, :, None]
    length = np.linalg.norm(span, axis=1)
    corners = lattice.nodes[lattice.hinges.T][..., None]
    arms = corners[1:] - corners[0]
    angle, gradient = _bend(arms, np.zeros_like(corners))
    own = np.concatenate([lattice.bar_stiffness, lattice.hinge_stiffness[:panels]])
    return Elements(
        bars=jnp.asarray(lattice.bars.T),
        span=jnp.asarray(span),
        length=jnp.asarray(length),
        hinges=jnp.asarray(lattice.hinges.T),
        arms=jnp.asarray(arms),
        rest_angle=angle,
        rest_along=jnp.asarray(span / length[:, None]),
        rest_gradient=gradient[:, :panels],
        stiffness=jnp.asarray(own[:, None]),
        crease_stiffness=jnp.asarray(lattice.hinge_stiffness[panels:, None]),
    )


@jax.jit
def _bend(arms: Array, moved: Array) -> tuple[Array, Array]:
    """Angles of hinges and their derivatives."""
    bent = elements.fold(arms, moved)
    return bent.angle, elements.pushes(bent, jnp.ones_like(bent.angle))


@jax.jit
def _blocks_at(net: Elements, motion: Array, force: Array | None) -> tuple[Array, ...]:
    """Parts of `Blocks` for the motion (V, 3, 1) of one press."""
    bars, panels = len(net.length), net.rest_gradient.shape[1]
    stretch = elements.stretch(net.span, net.length, motion[net.bars[1]] - motion[net.bars[0]])
    moved = motion[net.hinges]
    bent = elements.fold(net.arms, moved)
    turn = bent.angle - net.rest_angle
    strain = jnp.concatenate([stretch.value, turn[:panels]])
    own, along = net.stiffness * strain, stretch.direction
    rigidity = jnp.concatenate([net.stiffness[bars:], net.crease_stiffness])
    moment, gradient = rigidity * turn, elements.pushes(bent, jnp.ones_like(turn))
    ends, at_hinges = jnp.stack([-along, along]), moment[:, None] * gradient
    still = jnp.zeros_like(motion)
    pushes = [
        still.at[net.bars].add(own[:bars, None] * ends),
        still.at[net.hinges[:, :panels]].add(at_hinges[:, :panels]),
        still.at[net.hinges[:, panels:]].add(at_hinges[:, panels:]),
    ]
    if force is not None:
        own = force[:, None]
        moment = moment.at[:panels].set(own[bars:])
    rates = jnp.moveaxis(ends[..., 0], 0, 1).reshape(bars, 6)
    apart = jnp.kron(jnp.array([[1.0, -1.0], [-1.0, 1.0]]), jnp.eye(3))
    of_bars = _outer(net.stiffness[:bars], rates) + (own[:bars] / net.length)[..., None] * apart
    turns = jnp.moveaxis(gradient[..., 0], 0, 1).reshape(len(turn), 12)
    of_hinges = _outer(rigidity, turns)
    of_hinges = of_hinges + moment[..., None] * elements.fold_curvature(net.arms, moved)
    pushed = jnp.stack(pushes)[..., 0]
    return strain[:, 0], along[..., 0], gradient[..., 0], of_bars, of_hinges, pushed


def _outer(stiffness: Array, rates: Array) -> Array:
    """Blocks of springs that resist each element's one strain."""
    return stiffness[..., None] * rates[:, :, None] * rates[:, None]


def _narrow_places(lattice: Lattice) -> Ints:
    """Place of each node in an order that keeps coupled ones near each other."""
    count = len(lattice.nodes)
    pairs = np.concatenate([_pairs(nodes) for nodes in (lattice.bars, lattice.hinges)], axis=1)
    links = coo_array((np.ones(pairs.shape[1]), tuple(pairs)), (count, count)).tocsr()
    return np.argsort(reverse_cuthill_mckee(links, symmetric_mode=True))


def _pairs(each: Ints) -> Ints:
    """Rows and columns of the entries that couple all members of a row, (2, ...)."""
    count = each.shape[1]
    return np.stack([np.repeat(each, count, axis=1).ravel(), np.tile(each, (1, count)).ravel()])


def _entries(place: Ints, nodes: Ints) -> tuple[Ints, Ints, Ints]:
    """Rows and columns, in the band, of an element block's entries below the diagonal.

    The third result is their index among the blocks' entries, all of them in a row.
    """
    where = (3 * place[nodes][..., None] + np.arange(3)).reshape(len(nodes), -1)
    rows, columns = _pairs(where)
    pick = np.flatnonzero(rows >= columns)
    return rows[pick], columns[pick], pick


def _factor_blocks(factor: Floats, width: int) -> tuple[Floats, Floats, Floats]:
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
    return inverse, forward, backward
