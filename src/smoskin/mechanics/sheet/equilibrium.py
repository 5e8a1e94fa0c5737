"""Equilibria of a lattice under many loads at once.

Panels are some hundred thousand times stiffer than columns, so that Newton's iteration with the
tangent at rest would overshoot for ever. Here the forces of bars and panel hinges are unknowns of
their own (u: displacements, s: stretches and bends, q: their forces, C the compliances):

    B(u)^T q + f_soft(u) = f + W^T r,    s(u) = C q,    W u + G r = 0,

with W the patches that touches hold and G what gives way behind them. The tangent at rest, with q
eliminated, is then good for every load: a step is a product with one inverse that all presses
share, and some five to ten steps suffice. What does not converge so is left to
`smoskin.mechanics.sheet.continuation`, which renews its tangents.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from smoskin.arrays import Bools, Floats, Ints
from smoskin.mechanics.sheet import elements
from smoskin.mechanics.sheet.continuation import LIGHTEST, LOST, Press, Standing, follow
from smoskin.mechanics.sheet.lattice import Lattice
from smoskin.mechanics.sheet.tangent import RestInverse, Tangent

_STEPS: Final = 24
"""Steps after which a press is left to the method that renews its tangents."""
_LANES: Final = 11_000
"""Nodes of all presses that are solved side by side: what a processor's cache holds."""
_FEW: Final = (1, 16)
"""Widths for few presses; each width is compiled once for a shape of sheet."""


class Net(NamedTuple):
    """A lattice and its inverse at rest, on the device, nodes in the inverse's order."""

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
    """(E + P, 1), N/m and N m/rad: 1 / C, of bars and panels' hinges; their forces are unknowns."""
    crease_stiffness: Array
    """(H - P, 1), N m/rad."""
    ground: Array
    """(V, 3, 1), N/m: springs to the board."""
    top: Array
    """(T,): nodes that can be touched."""
    inverse: Array
    """(Z, b, b): inverses of the factor's diagonal blocks, or, where Z is 1, of the tangent."""
    forward: Array
    """(Z, b, b): each inverse times the block to its left."""
    backward: Array
    """(Z, b, b): each inverse, transposed, times the block below it, transposed."""


class Loads(NamedTuple):
    """Loads on the nodes that can be touched, batch last."""

    shares: Array
    """(K, T, B): share of each touch that each node takes; sum 1."""
    force: Array
    """(K, 3, B), N: forces that follow no motion."""
    held: Array
    """(K, B): 1 for a patch that is held in the plane, 0 for one that is not; K may be 0."""
    link: Array
    """(2K, 2K, B), m/N: G, how much held patches give way under their reactions."""


class Path(NamedTuple):
    """State of an iteration."""

    motion: Array
    """(V, 3, B), m: u."""
    curved: Array
    """(E + P, B), N or N m: forces of the last strains less those of their linear parts."""
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Relaxed:
    """Equilibria, one a row."""

    displacements: Floats
    """(B, V, 3), m."""
    reaction: Floats
    """(B, K, 2), N: sideways forces on the patches that are held."""
    residual: Floats
    """(B,): unbalanced force over the load, or over `LIGHTEST`."""
    iterations: Ints
    """(B,): steps taken, those of lost attempts included."""


class _Strain(NamedTuple):
    """Strains of all elements at one state."""

    stretch: elements.Stretch
    fold: elements.Fold
    value: Array
    """(E + P, B): stretches of bars, bends of panels."""
    linear: Array
    """(E + P, B): their linear parts."""


def _strain(net: Net, motion: Array) -> _Strain:
    """Stretches and folds of all elements."""
    panels = net.rest_gradient.shape[1]
    growth = motion[net.bars[1]] - motion[net.bars[0]]
    stretch = elements.stretch(net.span, net.length, growth)
    moved = motion[net.hinges]
    fold = elements.fold(net.arms, moved)
    bends = [elements.dot(net.rest_gradient[k], moved[k, :panels]) for k in range(4)]
    return _Strain(
        stretch=stretch,
        fold=fold,
        value=jnp.concatenate([stretch.value, fold.angle[:panels]]),
        linear=jnp.concatenate([elements.dot(net.rest_along, growth), sum(bends)]),
    )


def _moments(net: Net, strain: _Strain, force: Array) -> Array:
    """Moments of all hinges, (H, B), when bars and panels carry `force`, (E + P, B)."""
    bars, panels = len(net.length), net.rest_gradient.shape[1]
    turn = strain.fold.angle[panels:] - net.rest_angle[panels:]
    return jnp.concatenate([force[bars:], net.crease_stiffness * turn])


def _gather(net: Net, at_bars: Array, at_hinges: Array) -> Array:
    """Sum of the elements' forces at the nodes, (V, 3, B)."""
    lanes = at_bars.shape[-1]
    total = jnp.zeros((len(net.ground), 3, lanes)).at[net.bars[1]].add(at_bars)
    total = total.at[net.bars[0]].add(-at_bars)
    return total.at[net.hinges.reshape(-1)].add(at_hinges.reshape(-1, 3, lanes))


def _solve(net: Net, right: Array) -> Array:
    """Displacements that these forces give at rest, both (V, 3, ...)."""
    flat = right.reshape(net.ground.size, -1)
    blocks, size, _ = net.inverse.shape
    if blocks == 1:
        return (net.inverse[0] @ flat).reshape(right.shape)
    padded = jnp.pad(flat, ((0, blocks * size - len(flat)), (0, 0))).reshape(blocks, size, -1)

    def step(before: Array, part: tuple[Array, Array]) -> tuple[Array, Array]:
        coupling, own = part
        now = own - coupling @ before
        return now, now

    start = jnp.zeros_like(padded[0])
    _, down = jax.lax.scan(step, start, (net.forward, net.inverse @ padded))
    own = net.inverse.swapaxes(1, 2) @ down
    _, up = jax.lax.scan(step, start, (net.backward, own), reverse=True)
    return up.reshape(blocks * size, -1)[: len(flat)].reshape(right.shape)


def _spread(net: Net, shares: Array, force: Array) -> Array:
    """Forces of touches at the nodes, (V, D, B), of (K, T, B) and (K, D, B)."""
    at_top = (shares[:, :, None] * force[:, None]).sum(axis=0)
    return jnp.zeros((len(net.ground), *at_top.shape[1:])).at[net.top].set(at_top)


def _outer(net: Net, loads: Loads, reaction: Array) -> tuple[Array, Array]:
    """Forces from outside, (V, 3, B), and the load's size, (B,)."""
    dead = _spread(net, loads.shares, loads.force)
    touches, lanes = loads.held.shape
    sideways = _spread(net, loads.shares, reaction.reshape(touches, 2, lanes))
    norm = jnp.sqrt((dead**2).sum(axis=(0, 1)))
    outer = dead + jnp.pad(sideways, ((0, 0), (0, 1), (0, 0)))
    return outer, jnp.maximum(norm, LIGHTEST)


def _patch_motion(shares: Array, at_top: Array) -> Array:
    """Mean motion of patches in the plane, (2K, ..., B), of (K, T, B) and (T, 3, ..., B)."""
    mean = jnp.einsum("ktb,td...b->kd...b", shares, at_top[:, :2])
    return mean.reshape(2 * mean.shape[0], *mean.shape[2:])


def _held_patches(net: Net, loads: Loads) -> tuple[Array, Array]:
    """Motions of unit reactions (V, 3, 2T, B), and stiffness of held patches (2T, 2T, B)."""
    touches, lanes = loads.held.shape
    pulls = jnp.einsum("ktb,de->tdkeb", loads.shares, jnp.eye(2))
    right = jnp.zeros((len(net.ground), 3, 2 * touches, lanes))
    right = right.at[net.top, :2].set(pulls.reshape(len(net.top), 2, 2 * touches, lanes))
    yielding = _solve(net, right) if touches else right
    mask = jnp.repeat(loads.held, 2, axis=0)
    sag = _patch_motion(loads.shares, yielding[net.top]) + loads.link
    give = mask[:, None] * mask[None] * sag + jnp.eye(2 * touches)[..., None] * (1 - mask)[None]
    return yielding, jnp.moveaxis(jnp.linalg.inv(jnp.moveaxis(give, -1, 0)), 0, -1)


def _start(net: Net, loads: Loads, motion: Array, reaction: Array) -> Path:
    """Path that has taken no step; presses without a load rest."""
    loaded = jnp.abs(loads.force).max(axis=(0, 1)) > 0
    return Path(
        motion=jnp.where(loaded, motion, 0.0),
        curved=jnp.zeros((len(net.stiffness), len(loaded))),
        reaction=reaction,
        residual=jnp.where(loaded, 1.0, 0.0),
        steps=jnp.zeros(len(loaded), dtype=jnp.int64),
        still=jnp.ones(len(loaded), dtype=bool),
        going=loaded,
        tick=jnp.zeros((), dtype=jnp.int64),
    )


# Products on one thread each give the same digits on any number of cores; chunks of presses
# keep the cores busy.
@partial(jax.jit, static_argnames="limit", compiler_options={"xla_cpu_multi_thread_eigen": False})
def _relax(
    net: Net, loads: Loads, motion: Array, reaction: Array, tolerance: Array, limit: int
) -> Path:
    """Iterate with the tangent at rest until every press converges or is lost."""
    touches = len(loads.held)
    bars, panels = len(net.length), net.rest_gradient.shape[1]
    mask = jnp.repeat(loads.held, 2, axis=0)
    yielding, stiff = _held_patches(net, loads)

    def advance(path: Path) -> Path:
        strain = _strain(net, path.motion)
        primal, linear = net.stiffness * strain.value, net.stiffness * strain.linear
        mixed = jnp.where(path.still, primal, path.curved + linear)
        excess = primal - mixed
        at_bars = strain.stretch.direction * mixed[:bars, None]
        at_bars = at_bars + net.rest_along * excess[:bars, None]
        at_hinges = elements.pushes(strain.fold, _moments(net, strain, mixed))
        at_hinges = at_hinges.at[:, :panels].add(net.rest_gradient * excess[bars:, None])
        outer, scale = _outer(net, loads, path.reaction)
        right = outer - net.ground * path.motion - _gather(net, at_bars, at_hinges)
        residual = jnp.sqrt((right**2).sum(axis=(0, 1))) / scale
        step, reaction = _solve(net, right), path.reaction
        if touches:
            sag = _patch_motion(loads.shares, (path.motion + step)[net.top])
            sag = mask * (sag + (loads.link * reaction[None]).sum(axis=1))
            change = -(stiff * sag[None]).sum(axis=1)
            step = step + (yielding * change).sum(axis=2)
            reaction = reaction + change
        balanced = residual <= tolerance
        go = path.going & ~(balanced & (path.steps > 0))
        return Path(
            motion=jnp.where(go, path.motion + step, path.motion),
            curved=primal - linear,
            reaction=jnp.where(go, reaction, path.reaction),
            residual=residual,
            steps=path.steps + go,
            still=~go,
            going=path.going & (residual < LOST) & ~(path.still & balanced & ~go),
            tick=path.tick + 1,
        )

    start = _start(net, loads, motion, reaction)
    return jax.lax.while_loop(lambda p: (p.tick <= limit) & p.going.any(), advance, start)


class Equilibrium:
    """Finds the equilibria of one lattice.

    Parameters
    ----------
    lattice : Lattice
        It is at rest without stress, its panels flat.

    Raises
    ------
    DesignError
        If the lattice can move without resistance.
    """

    def __init__(self, lattice: Lattice) -> None:
        self.tangent = Tangent(lattice)
        rest = self.tangent.at_rest()
        self._order, self._place = rest.order, np.argsort(rest.order)
        with jax.enable_x64(True):
            self._net = _net(lattice, self.tangent, rest)
        self._give = np.ones(lattice.loaded.size)
        if len(rest.inverse) == 1:
            down = 3 * self._place[lattice.loaded.ravel()] + 2
            self._give = rest.inverse[0, down, down]
        lanes = 2 ** int(np.log2(_LANES / len(lattice.nodes)))
        self._lanes = max(16, lanes if jax.default_backend() == "cpu" else 32 * lanes)

    def relax(
        self,
        shares: Floats,
        force: Floats,
        held: Bools,
        link: Floats,
        *,
        tolerance: float,
        start: Floats | None = None,
    ) -> Relaxed:
        """Equilibria under these touches.

        Parameters
        ----------
        shares : Floats, shape (B, K, T)
            Shares of each touch that the nodes take which can be touched.
        force : Floats, shape (B, K, 3)
            Dead loads, N.
        held : Bools, shape (B, K)
            Patches that are held in the plane.
        link : Floats, shape (B, 2K, 2K)
            How much held patches give way under their reactions, m/N.
        tolerance : float
            Largest residual, relative to the load or to 10 mN.
        start : Floats, shape (B, V, 3), optional
            Displacements to start from, m; at rest by default.
        """
        rows, touches = held.shape
        given = (shares, force, held.astype(float), link)
        relaxed = Relaxed(
            displacements=np.empty((rows, len(self._order), 3)),
            reaction=np.empty((rows, touches, 2)),
            residual=np.empty(rows),
            iterations=np.empty(rows, dtype=np.int64),
        )
        width = next((few for few in _FEW if rows <= few), self._lanes)
        chunks = self._chunks(shares, force, width)
        solve = partial(self._solve_chunk, relaxed, given, start, tolerance, width)
        if len(chunks) == 1:
            solve(chunks[0])
        else:
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                list(pool.map(solve, chunks))
        for row in np.flatnonzero(~(relaxed.residual <= tolerance)):
            press = self.one_press(shares[row], force[row], held[row], link[row])
            standing = follow(self.tangent, press, tolerance)
            if standing is not None:
                _put(relaxed, int(row), held[row], standing)
        return relaxed

    def _chunks(self, shares: Floats, force: Floats, width: int) -> list[Ints]:
        """Rows that are solved side by side, at most `width` each."""
        order = np.arange(len(force))
        if len(force) > width:
            # Presses of like depth take as many steps; none waits for a harder one beside it.
            depth = np.einsum("bkt,t,bk->b", shares, self._give, np.linalg.norm(force, axis=-1))
            order = np.argsort(depth, kind="stable")
        return [order[first : first + width] for first in range(0, len(force), width)]

    def one_press(self, shares: Floats, force: Floats, held: Bools, link: Floats) -> Press:
        """A row of `relax` on all nodes."""
        top = self.tangent.lattice.loaded.ravel()
        dead = np.zeros((len(self._order), 3))
        dead[top] = shares.T @ force
        patches = shares[held]
        pulls = np.zeros((len(self._order), 3, len(patches), 2))
        pulls[top, 0, :, 0] = pulls[top, 1, :, 1] = patches.T
        both = np.repeat(held, 2)
        return Press(
            dead=dead,
            pulls=pulls.reshape(len(dead), 3, -1),
            link=link[np.ix_(both, both)],
        )

    def _solve_chunk(
        self,
        relaxed: Relaxed,
        given: tuple[Floats, ...],
        start: Floats | None,
        tolerance: float,
        width: int,
        chunk: Ints,
    ) -> None:
        """Solve some rows side by side and put them where they belong."""
        rows, touches = len(chunk), given[2].shape[1]
        begin = np.zeros((len(self._order), 3, width))
        if start is not None:
            begin[..., :rows] = np.moveaxis(np.nan_to_num(start[chunk]), 0, -1)[self._order]
        with jax.enable_x64(True):
            # The compiled function takes NumPy's arrays over as they are.
            loads = Loads(*cast("list[Array]", [_lanes(array[chunk], width) for array in given]))
            reaction = np.zeros((2 * touches, width))
            path = _relax(self._net, loads, begin, reaction, tolerance, _STEPS)
        motion = np.asarray(path.motion)[self._place, :, :rows]
        relaxed.displacements[chunk] = np.moveaxis(motion, -1, 0)
        relaxed.reaction[chunk] = np.asarray(path.reaction)[:, :rows].T.reshape(rows, touches, 2)
        relaxed.residual[chunk] = np.where(path.going, np.inf, path.residual)[:rows]
        relaxed.iterations[chunk] = np.asarray(path.steps)[:rows]


def _put(relaxed: Relaxed, row: int, held: Bools, standing: Standing) -> None:
    """Put a followed equilibrium into its row; its steps come on top of those that were lost."""
    relaxed.displacements[row] = standing.motion
    relaxed.reaction[row] = 0.0
    relaxed.reaction[row, held] = standing.reaction.reshape(-1, 2)
    relaxed.residual[row] = standing.residual
    relaxed.iterations[row] += standing.steps


def _net(lattice: Lattice, tangent: Tangent, rest: RestInverse) -> Net:
    """The lattice on the device."""
    order, place = rest.order, np.argsort(rest.order)
    panels = lattice.panel_hinges
    span = np.diff(lattice.nodes[lattice.bars], axis=1)[:, 0, :, None]
    length = np.linalg.norm(span, axis=1)
    own_forces = np.concatenate([lattice.bar_stiffness, lattice.hinge_stiffness[:panels]])
    put = jnp.asarray
    return Net(
        bars=put(place[lattice.bars.T]),
        span=put(span),
        length=put(length),
        hinges=put(place[lattice.hinges.T]),
        arms=put(tangent.arms),
        rest_angle=put(tangent.rest_angle[:, None]),
        rest_along=put(span / length[:, None]),
        rest_gradient=put(tangent.rest_gradient[:, :panels, :, None]),
        stiffness=put(own_forces[:, None]),
        crease_stiffness=put(lattice.hinge_stiffness[panels:, None]),
        ground=put(lattice.ground[order, :, None]),
        top=put(place[lattice.loaded.ravel()]),
        inverse=put(rest.inverse),
        forward=put(rest.forward),
        backward=put(rest.backward),
    )


def _lanes(rows: Floats, width: int) -> Floats:
    """Rows put last, with unloaded ones added up to `width`."""
    filled = np.zeros((*rows.shape[1:], width))
    filled[..., : len(rows)] = np.moveaxis(rows, 0, -1)
    return filled
