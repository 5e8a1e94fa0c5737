"""The lattice's stiffness, at rest and at any place: element blocks added into a band.

The board's six motions stand beside it: only a frame on the base couples them to the sheet. Nodes
are ordered so that the band is as wide as the sheet's shorter side has nodes, twice over. Decides
whether a sheet is stable at all, and in which form its inverse at rest is kept.
"""

from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded, solve_triangular
from scipy.sparse import coo_array, csc_array, dia_array
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from smoskin.arrays import Floats, Ints
from smoskin.errors import DesignError
from smoskin.mechanics.board import Board
from smoskin.mechanics.sheet.lattice import Lattice
from smoskin.mechanics.sheet.parts import Blocks, Elements, blocks_at, elements_of

_WHOLE: Final = 1024
"""Unknowns up to which the inverse itself is kept: one product beats a band's many small ones."""
_SINGULAR: Final = 1e-12
"""Smallest over largest stiffness below which the sheet holds its shape by rounding only."""


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


class Place(NamedTuple):
    """Lattice at some displacement: its forces, and its stiffness factorised."""

    blocks: Blocks
    """The elements, one by one."""
    board: Floats
    """(6, 6): stiffness of the board on its pillars and against the frame."""
    board_push: Floats
    """(6,): forces and moments that pillars and frame put up."""
    factor: Floats
    """(w + 1, 3V): Cholesky factor of the tangent, a lower band in the band's order."""


class Tangent:
    """Stiffness of a lattice on its board: second derivative of its energy by its nodes.

    Notes
    -----
    With strains s(u) of bars and hinges, their stiffnesses k and forces q, and the energies of
    columns and stops: K = sum of k (ds/du)(ds/du)' + q d2s/du2 and of the second derivatives.
    """

    def __init__(self, lattice: Lattice, board: Board) -> None:
        self.lattice, self.board = lattice, board
        with jax.enable_x64(True):
            self.elements = elements_of(lattice, board)
        place = _narrow_places(lattice)
        self._where = (3 * place[:, None] + np.arange(3)).ravel()
        feet, stops = lattice.feet[:, None], lattice.stops.nodes[:, None]
        below = [_entries(place, nodes) for nodes in (lattice.bars, lattice.hinges, feet, stops)]
        self._width = int(max((rows - columns).max(initial=0) for rows, columns, _ in below))
        size = lattice.nodes.size
        self._cells = [(rows - columns) * size + columns for rows, columns, _ in below]
        self._picks = [pick for _, _, pick in below]

    def rest_inverse(self, made: Blocks) -> RestInverse:
        """The inverse that all presses share, of the elements at rest.

        It raises a `DesignError` if the lattice can move without resistance.
        """
        band = self._band(made)
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

    def at(
        self, motion: Floats, board: Floats, force: Floats | None = None, *, fold: float = 1.0
    ) -> Place:
        """The lattice at a displacement (V, 3), m, over the board, which has moved by (6,).

        Forces of bars, N, and panels, N m, (E + P,), stiffen or soften it; by default they are
        those of their own strains. `fold` is the share of the way from the angles as folded to
        those without moment that the creases have gone.

        Raises
        ------
        numpy.linalg.LinAlgError
            If no stable equilibrium can be here.
        """
        made = self.blocks(motion, board, force, fold=fold)
        softer = self.board.softening @ board
        return Place(
            blocks=made,
            board=np.diag(self.board.stiffness) + softer + made.board,
            board_push=self.board.stiffness * board + softer @ board / 2 + made.board_push,
            factor=cholesky_banded(self._band(made), lower=True),
        )

    def blocks(
        self, motion: Floats, board: Floats, force: Floats | None = None, *, fold: float = 1.0
    ) -> Blocks:
        """Parts of the tangent and of the forces, element by element; arguments as of `at`."""
        with jax.enable_x64(True):
            net, share = self.elements, float(fold)
            if share != 1.0:
                net = net._replace(rest_angle=share * net.rest_angle + (1 - share) * net.folded)
            made = blocks_at(net, motion[..., None], board[:, None], force)
        return Blocks(*(np.asarray(part) for part in made))

    def elements_at(self, made: Blocks) -> Elements:
        """The elements with the derivatives of another place in those at rest."""
        panels = self.lattice.panel_hinges
        with jax.enable_x64(True):
            return self.elements._replace(
                rest_along=jnp.asarray(made.along[..., None]),
                rest_gradient=jnp.asarray(made.turns[:, :panels, :, None]),
            )

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

    def _band(self, made: Blocks) -> Floats:
        """Sum of element blocks as a lower band."""
        size = self.lattice.nodes.size
        cells = (self._width + 1) * size
        total = np.zeros(cells)
        parts = (made.bars, made.hinges, made.columns, made.stops)
        for blocks, where, pick in zip(parts, self._cells, self._picks, strict=True):
            total += np.bincount(where, weights=blocks.ravel()[pick], minlength=cells)
        return total.reshape(self._width + 1, size)

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
