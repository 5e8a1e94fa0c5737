"""Equilibria of a lattice under many loads at once.

Panels are some hundred thousand times stiffer than columns, so that Newton's iteration with the
tangent at rest would overshoot for ever; here the forces of bars and panels are unknowns of their
own. The inverse at rest then serves every step of every press, some five to ten of them. What does
not converge so is left to `smoskin.mechanics.sheet.continuation`, which renews its tangents.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from smoskin.arrays import Bools, Floats, Ints
from smoskin.mechanics.board import Board
from smoskin.mechanics.mixing import MEMORY, Trial, blank, mix
from smoskin.mechanics.sheet import columns, elements
from smoskin.mechanics.sheet.continuation import LIGHTEST, LOST, Press, Standing, follow, settle
from smoskin.mechanics.sheet.lattice import Lattice
from smoskin.mechanics.sheet.parts import Elements
from smoskin.mechanics.sheet.tangent import RestInverse, Tangent

_STEPS: Final = 40
"""Steps after which a press is left to the method that renews its tangents."""
_LANES: Final = 11_000
"""Nodes of all presses that are solved side by side: what a processor's cache holds."""
_PAD: Final = 1e-12
"""m/N: compliance of any touch by itself, so that two on one place share what they hold."""
_FEW: Final = (1, 16)
"""Widths for few presses; each width is compiled once for a shape of sheet."""


class Net(NamedTuple):
    """A lattice and its inverse at rest, on the device."""

    elements: Elements
    """Bars and hinges."""
    board: Array
    """(6, 1), N/m and N m/rad: stiffness of the board."""
    softening: Array
    """(6, 6, 6): its change with the board's motion."""
    top: Array
    """(T,): nodes that can be touched."""
    top_axes: Array
    """(T, 3, 3, 1): local axes there, in columns."""
    rest: RestInverse
    """The inverse of the tangent at rest."""
    rest_motion: Array
    """(V, 3, 1), m: from the sheet as folded to rest."""
    rest_board: Array
    """(6, 1), m and rad: the same of the board."""


class Loads(NamedTuple):
    """Touches of the nodes that can be touched, B cases; on the device the batch comes last."""

    shares: Floats
    """(B, K, T): share of each touch that each node takes; sum 1."""
    force: Floats
    """(B, K, 3), N: forces that follow no motion."""
    held: Bools
    """(B, K): patches that are held in the plane; K may be 0."""
    on_board: Floats
    """(B, 6), N and N m: what the board takes of forces that follow no motion."""
    reach: Floats
    """(B, 2K, 6): motion of the held patches with the board."""


class Path(NamedTuple):
    """State of an iteration."""

    motion: Array
    """(V, 3, B), m: u."""
    curved: Array
    """(E + P, B), N or N m: forces of the last strains less those of their linear parts."""
    board: Array
    """(6, B), m and rad: motion of the board."""
    reaction: Array
    """(2K, B), N: r."""
    residual: Array
    """(B,): unbalanced force over the load."""
    steps: Array
    """(B,): steps taken."""
    still: Array
    """(B,): no motion since the forces were those of the strains."""
    going: Array
    """(B,): neither in equilibrium nor lost."""
    tick: Array
    """(): turns of the loop."""
    last: Trial
    """The last turn."""
    past: Trial
    """Differences of the last turns from those before, (M, ...) each."""


class Relaxed(NamedTuple):
    """Equilibria, one a row."""

    displacements: Floats
    """(B, V, 3), m: from the sheet as folded."""
    board: Floats
    """(B, 6), m and rad."""
    compression: Floats
    """(B, C), N: load of each column."""
    reaction: Floats
    """(B, K, 2), N: sideways forces on the patches that are held."""
    residual: Floats
    """(B,): unbalanced force over the load, or over `LIGHTEST`."""
    iterations: Ints
    """(B,): steps taken, those of lost attempts included."""


def _inner(net: Net, path: Path) -> tuple[Array, Array, Array]:
    """Forces that the parts put up, (V, 3, B), the board's (6, B), and the next `Path.curved`."""
    made, motion = net.elements, path.motion
    bars, panels = len(made.length), made.rest_gradient.shape[1]
    growth = motion[made.bars[1]] - motion[made.bars[0]]
    stretch = elements.stretch(made.span, made.length, growth)
    moved = motion[made.hinges]
    fold = elements.fold(made.arms, moved)
    bends = [elements.dot(made.rest_gradient[k], moved[k, :panels]) for k in range(4)]
    flat = jnp.concatenate([elements.dot(made.rest_along, growth), sum(bends)])
    primal = made.stiffness * jnp.concatenate([stretch.value, fold.angle[:panels]])
    linear = made.stiffness * flat
    mixed = jnp.where(path.still, primal, path.curved + linear)
    excess = primal - mixed
    turn = fold.angle[panels:] - made.rest_angle[panels:]
    at_bars = stretch.direction * mixed[:bars, None] + made.rest_along * excess[:bars, None]
    moment = jnp.concatenate([mixed[bars:], made.crease_stiffness * turn])
    at_hinges = elements.pushes(fold, moment)
    at_hinges = at_hinges.at[:, :panels].add(made.rest_gradient * excess[bars:, None])
    total = jnp.zeros_like(motion).at[made.bars[1]].add(at_bars).at[made.bars[0]].add(-at_bars)
    total = total.at[made.hinges.reshape(-1)].add(at_hinges.reshape(-1, *motion.shape[1:]))
    feet, stops = made.columns.feet, made.stops
    bent = columns.bend(made.columns, motion[feet])
    push, _ = columns.stop_forces(stops, motion, path.board)
    total = total.at[feet].add(columns.column_forces(made.columns, bent))
    total = total.at[stops.nodes].add(push[:, None] * stops.normal)
    on_board = net.board * path.board + stops.by_board.T @ push
    on_board += jnp.einsum("ijk,jb,kb->ib", net.softening, path.board, path.board) / 2
    return total, on_board, primal - linear


def _solve(net: Net, right: Array) -> Array:
    """Displacements that these forces give at rest, both (V, 3, ...)."""
    flat = right.reshape(right.shape[0] * 3, -1)
    place, inverse, forward, backward = (jnp.asarray(part) for part in net.rest)
    blocks, size, _ = inverse.shape
    if blocks == 1:
        return (inverse[0] @ flat).reshape(right.shape)
    padded = jnp.zeros((blocks * size, flat.shape[1])).at[place].set(flat)
    padded = padded.reshape(blocks, size, -1)

    def step(before: Array, part: tuple[Array, Array]) -> tuple[Array, Array]:
        coupling, own = part
        now = own - coupling @ before
        return now, now

    start = jnp.zeros_like(padded[0])
    _, down = jax.lax.scan(step, start, (forward, inverse @ padded))
    own = inverse.swapaxes(1, 2) @ down
    _, up = jax.lax.scan(step, start, (backward, own), reverse=True)
    return up.reshape(blocks * size, -1)[place].reshape(right.shape)


def _outer(net: Net, nodes: int, shares: Array, force: Array) -> Array:
    """Forces of touches at the nodes, (V, 3, B), of (K, T, B) and (K, 3, B)."""
    local = (shares[:, :, None] * force[:, None]).sum(axis=0)
    at_top = columns.off_axes(net.top_axes, local)
    return jnp.zeros((nodes, *at_top.shape[1:])).at[net.top].set(at_top)


def _patch_motion(net: Net, shares: Array, at_top: Array) -> Array:
    """Mean motion of patches aside, (2K, ..., B), of (K, T, B) and (T, 3, ..., B)."""
    aside = net.top_axes[:, :, :2].reshape(-1, 3, 2, *[1] * (at_top.ndim - 2))
    local = columns.along_axes(aside, at_top)
    mean = jnp.einsum("ktb,td...b->kd...b", shares, local)
    return mean.reshape(2 * mean.shape[0], *mean.shape[2:])


def _held_patches(net: Net, nodes: int, loads: Any) -> tuple[Array, Array]:
    """Motions of unit reactions (V, 3, 2T, B), and stiffness of held patches (2T, 2T, B)."""
    touches, lanes = loads.held.shape
    pulls = jnp.einsum("ktb,de->tdkeb", loads.shares, jnp.eye(2))
    right = jnp.zeros((nodes, 3, 2 * touches, lanes))
    local = pulls.reshape(len(net.top), 2, 2 * touches, lanes)
    right = right.at[net.top].set(columns.off_axes(net.top_axes[..., None], local))
    yielding = _solve(net, right) if touches else right
    mask = jnp.repeat(loads.held, 2, axis=0)
    sag = _patch_motion(net, loads.shares, yielding[net.top])
    sag += jnp.einsum("rsb,qsb,s->rqb", loads.reach, loads.reach, 1 / net.board[:, 0])
    sag += _PAD * jnp.eye(2 * touches)[..., None]
    give = mask[:, None] * mask[None] * sag + jnp.eye(2 * touches)[..., None] * (1 - mask)[None]
    return yielding, jnp.moveaxis(jnp.linalg.inv(jnp.moveaxis(give, -1, 0)), 0, -1)


def _begin(net: Net, loads: Any, motion: Array) -> Path:
    """Start of an iteration from displacements, (V, 3, B), m; unloaded presses are at rest."""
    touches, lanes = loads.held.shape
    loaded = (jnp.abs(loads.force).max(axis=(0, 1)) > 0) | (loads.on_board != 0).any(axis=0)
    none = blank(len(motion), len(net.elements.stiffness), 2 * touches, lanes)
    return Path(
        last=none,
        past=jax.tree.map(lambda part: jnp.zeros((MEMORY, *part.shape)), none),
        motion=jnp.where(loaded, motion, net.rest_motion),
        curved=jnp.zeros((len(net.elements.stiffness), lanes)),
        board=net.rest_board + loads.on_board / net.board,
        reaction=jnp.zeros((2 * touches, lanes)),
        residual=jnp.where(loaded, 1.0, 0.0),
        steps=jnp.zeros(lanes, dtype=jnp.int64),
        still=jnp.ones(lanes, dtype=bool),
        going=loaded,
        tick=jnp.zeros((), dtype=jnp.int64),
    )


# Products on one thread each give the same digits on any number of cores; chunks of presses
# keep the cores busy.
@partial(jax.jit, compiler_options={"xla_cpu_multi_thread_eigen": False})
def _relax(
    net: Net, loads: Any, motion: Array, tolerance: Array, limit: Array
) -> tuple[Path, Array]:
    """Iterate with the tangent at rest until every press converges or is lost.

    The second answer are the columns' loads, (C, B), N.
    """
    touches, lanes = loads.held.shape
    nodes = len(motion)
    mask = jnp.repeat(loads.held, 2, axis=0)
    yielding, stiff = _held_patches(net, nodes, loads)
    dead = _outer(net, nodes, loads.shares, loads.force)
    scale = jnp.maximum(jnp.sqrt((dead**2).sum(axis=(0, 1))), LIGHTEST)

    def advance(path: Path) -> Path:
        inner, of_board, curved = _inner(net, path)
        sideways = path.reaction.reshape(touches, 2, lanes)
        pull = jnp.pad(sideways, ((0, 0), (0, 1), (0, 0)))
        right = dead + _outer(net, nodes, loads.shares, pull) - inner
        on_board = loads.on_board + (loads.reach * path.reaction[:, None]).sum(axis=0) - of_board
        residual = jnp.sqrt((right**2).sum(axis=(0, 1)) + (on_board[:3] ** 2).sum(axis=0)) / scale
        step, shift, reaction = _solve(net, right), on_board / net.board, path.reaction
        if touches:
            sag = _patch_motion(net, loads.shares, (path.motion + step - net.rest_motion)[net.top])
            sag += (loads.reach * (path.board + shift - net.rest_board)).sum(axis=1)
            sag = mask * (sag + _PAD * reaction)
            change = -(stiff * sag[None]).sum(axis=1)
            step = step + (yielding * change).sum(axis=2)
            shift = shift + (loads.reach * change[:, None]).sum(axis=0) / net.board
            reaction = reaction + change
        balanced = residual <= tolerance
        go = path.going & ~(balanced & (path.steps > 0))
        trial = Trial(path.motion + step, path.board + shift, reaction, curved, step, right)
        past, better = mix(path.last, path.past, trial, path.steps > 0, path.tick)
        return Path(
            last=trial,
            past=past,
            motion=jnp.where(go, better.motion, path.motion),
            curved=better.curved,
            board=jnp.where(go, better.board, path.board),
            reaction=jnp.where(go, better.reaction, path.reaction),
            residual=residual,
            steps=path.steps + go,
            still=~go,
            going=path.going & (residual < LOST) & ~(path.still & balanced & ~go),
            tick=path.tick + 1,
        )

    start = _begin(net, loads, motion)
    end = jax.lax.while_loop(lambda p: (p.tick <= limit) & p.going.any(), advance, start)
    made = net.elements.columns
    load = columns.bend(made, end.motion[made.feet]).load
    return end, load * made.unit * made.height


class Equilibrium:
    """Finds the equilibria of one lattice on its board.

    As folded its panels are flat and without stress; its rest differs where the creases would lie
    at other angles. It raises a `DesignError` if the lattice can move without resistance.

    Notes
    -----
    With displacements u, stretches and bends s of bars and panels, q their forces, C the
    compliances, b the board's motion and K_b its stiffness: B(u)' q + f_soft(u, b) = f + W r,
    s(u) = C q, K_b b + f_frame(u, b) = S' (f + r) and W' u + S b = 0, W the patches that touches
    hold and S what the board moves of them. A step is a product with the inverse at rest, q
    eliminated.
    """

    def __init__(self, lattice: Lattice, board: Board) -> None:
        self.tangent = Tangent(lattice, board)
        self.rest = settle(self.tangent)
        made = self.tangent.blocks(self.rest.motion, self.rest.board, self.rest.force)
        rest = self.tangent.rest_inverse(made)
        with jax.enable_x64(True):
            self._net = Net(
                elements=self.tangent.elements_at(made),
                board=jnp.asarray(board.stiffness[:, None]),
                softening=jnp.asarray(board.softening),
                top=jnp.asarray(lattice.loaded.ravel()),
                top_axes=jnp.asarray(lattice.loaded_axes[..., None]),
                rest=jax.tree.map(jnp.asarray, rest),
                rest_motion=jnp.asarray(self.rest.motion[..., None]),
                rest_board=jnp.asarray(self.rest.board[:, None]),
            )
        self._give = np.ones(lattice.loaded.size)
        if len(rest.inverse) == 1:
            at = 3 * lattice.loaded.ravel()[:, None] + np.arange(3)
            own, down = rest.inverse[0, at[:, :, None], at[:, None]], lattice.loaded_axes[..., 2]
            self._give = np.einsum("ti,tij,tj->t", down, own, down)
        lanes = 2 ** int(np.log2(_LANES / len(lattice.nodes)))
        self._lanes = max(16, lanes if jax.default_backend() == "cpu" else 32 * lanes)

    def relax(self, loads: Loads, *, tolerance: float, start: Floats | None = None) -> Relaxed:
        """Equilibria under these touches, from displacements (B, V, 3), m; from rest by default.

        Displacements are from the sheet as folded. `tolerance` is the largest residual, relative
        to the load or to 10 mN.
        """
        rows, touches = loads.held.shape
        relaxed = Relaxed(
            displacements=np.empty((rows, *self.tangent.lattice.nodes.shape)),
            board=np.empty((rows, 6)),
            compression=np.empty((rows, len(self.tangent.lattice.feet))),
            reaction=np.empty((rows, touches, 2)),
            residual=np.empty(rows),
            iterations=np.empty(rows, dtype=np.int64),
        )
        width = next((few for few in _FEW if rows <= few), self._lanes)
        chunks = self._chunks(loads, width)
        solve = partial(self._solve_chunk, relaxed, loads, start, tolerance, width)
        if len(chunks) == 1:
            solve(chunks[0])
        else:
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                list(pool.map(solve, chunks))
        for row in np.flatnonzero(~(relaxed.residual <= tolerance)).tolist():
            standing = follow(self.tangent, self.one_press(loads, row), tolerance, self.rest)
            if standing is not None:
                self._put(relaxed, row, loads.held[row], standing)
        return relaxed

    def _chunks(self, loads: Loads, width: int) -> list[Ints]:
        """Rows that are solved side by side, at most `width` each."""
        rows = len(loads.force)
        order = np.arange(rows)
        if rows > width:
            # Presses of like depth take as many steps; none waits for a harder one beside it.
            push = np.linalg.norm(loads.force, axis=-1)
            depth = np.einsum("bkt,t,bk->b", loads.shares, self._give, push)
            order = np.argsort(depth, kind="stable")
        return [order[first : first + width] for first in range(0, rows, width)]

    def one_press(self, loads: Loads, row: int) -> Press:
        """A case of `loads` on all nodes."""
        shares, force, held, on_board, reach = (part[row] for part in loads)
        top = self.tangent.lattice.loaded.ravel()
        dead = np.zeros(self.tangent.lattice.nodes.shape)
        axes = self.tangent.lattice.loaded_axes
        dead[top] = np.einsum("tij,tj->ti", axes, shares.T @ force)
        patches = shares[held]
        pulls = np.zeros((len(dead), 3, len(patches), 2))
        pulls[top] = np.einsum("tid,kt->tikd", axes[..., :2], patches)
        both = np.repeat(held, 2)
        flat = pulls.reshape(len(dead), 3, -1)
        return Press(
            dead=dead,
            on_board=on_board,
            pulls=flat,
            reach=reach[both],
            place=np.einsum("vdr,vd->r", flat, self.rest.motion) + reach[both] @ self.rest.board,
            link=_PAD * np.eye(int(both.sum())),
        )

    def _solve_chunk(
        self,
        relaxed: Relaxed,
        loads: Loads,
        start: Floats | None,
        tolerance: float,
        width: int,
        chunk: Ints,
    ) -> None:
        """Solve some rows side by side and put them where they belong."""
        rows = len(chunk)
        begin = np.repeat(self.rest.motion[..., None], width, axis=-1)
        if start is not None:
            near = np.where(np.isfinite(start[chunk]), start[chunk], self.rest.motion)
            begin[..., :rows] = np.moveaxis(near, 0, -1)
        with jax.enable_x64(True):
            # The compiled function takes NumPy's arrays over as they are.
            some = Loads._make(_lanes(part[chunk], width) for part in loads)
            path, load = _relax(self._net, some, begin, tolerance, _STEPS)
        relaxed.displacements[chunk] = np.moveaxis(np.asarray(path.motion)[..., :rows], -1, 0)
        relaxed.compression[chunk] = np.asarray(load)[:, :rows].T
        relaxed.board[chunk] = np.asarray(path.board)[:, :rows].T
        reaction = np.asarray(path.reaction)[:, :rows].T
        relaxed.reaction[chunk] = reaction.reshape(rows, *relaxed.reaction.shape[1:])
        relaxed.residual[chunk] = np.where(path.going, np.inf, path.residual)[:rows]
        relaxed.iterations[chunk] = np.asarray(path.steps)[:rows]

    def _put(self, relaxed: Relaxed, row: int, held: Bools, standing: Standing) -> None:
        """Put a followed equilibrium into its row; its steps come on top of those lost."""
        blocks = self.tangent.blocks(standing.motion, standing.board)
        relaxed.displacements[row] = standing.motion
        relaxed.board[row] = standing.board
        relaxed.compression[row] = blocks.compression
        relaxed.reaction[row] = 0.0
        relaxed.reaction[row, held] = standing.reaction.reshape(-1, 2)
        relaxed.residual[row] = standing.residual
        relaxed.iterations[row] += standing.steps


def _lanes(rows: Floats | Bools, width: int) -> Floats:
    """Rows put last, with unloaded ones added up to `width`."""
    filled = np.zeros((*rows.shape[1:], width))
    filled[..., : len(rows)] = np.moveaxis(rows, 0, -1)
    return filled
