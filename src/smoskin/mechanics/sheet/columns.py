"""Columns that bend under load, and the frame that stops those of the rim: forces and stiffness.

Arrays carry the batch last, (..., 3, B). A column is one element between the board and its vertex;
its compression is found inside it, so that it is a function of its top's motion alone.
"""

from typing import Final, NamedTuple

import jax.numpy as jnp
from jax import Array

from smoskin.mechanics import beam

_STEPS: Final = 7
"""Newton's steps to a column's compression; past some, they come from above and never pass it."""


class Columns(NamedTuple):
    """The columns of a lattice on the device."""

    feet: Array
    """(C,): nodes on their tops."""
    axes: Array
    """(C, 3, 3, 1): local axes there, in columns; they stand along the last one."""
    unit: Array
    """(C, 1), N/m: EI / h^3."""
    height: Array
    """(C, 1), m: h."""
    share: Array
    """(C, 1): shear share s of `smoskin.mechanics.beam`."""
    softness: Array
    """(C, 1): EI / (h^3 k_a), with k_a the stiffness along the axis."""
    slackest: Array
    """(C, 1): lowest z; a column pulled harder keeps the slope that it has there."""
    crushing: Array
    """(C, 1): z that no force passes."""


class Bent(NamedTuple):
    """Columns under their tops' motion along their axes, in units of h, EI / h^2 and EI / h."""

    aside: Array
    """(C, 2, B): sway of the top."""
    load: Array
    """(C, B): compression z."""
    sway: beam.Sway
    """Stiffness against sway, and its derivatives by z, (C, B) each."""
    give: Array
    """(C, B): shortening per load with the sway held."""


class Stops(NamedTuple):
    """The frame's stops of rim columns on the device."""

    nodes: Array
    """(S,): nodes on the stopped columns' tops."""
    normal: Array
    """(S, 3, 1): outward from the rim."""
    stiffness: Array
    """(S, 1), N/m: what the stop adds at the top."""
    free: Array
    """(S, 1), m: sway of the top at which the column meets the frame."""
    rounding: Array
    """(S, 1), m: half of the sway over which the stop's force sets in."""
    by_board: Array
    """(S, 6): what a motion of the board adds to the sway; 0 where the frame stands on it."""


def along_axes(axes: Array, vectors: Array) -> Array:
    """Components of vectors (N, 3, ...) along local axes (N, 3, J, ...), (N, J, ...).

    Three products in a row: compilers make of them what they do not of a sum over three.
    """
    x, y, z = (axes[:, d] * vectors[:, d, None] for d in range(3))
    return x + y + z


def off_axes(axes: Array, components: Array) -> Array:
    """Vectors (N, 3, ...) of components (N, J, ...) along local axes (N, 3, J, ...)."""
    parts = [axes[:, :, j] * components[:, j, None] for j in range(components.shape[1])]
    return sum(parts[1:], parts[0])


def bend(columns: Columns, motion: Array) -> Bent:
    """Columns whose tops have moved by `motion`, (C, 3, B), m, in the skin's frame.

    Notes
    -----
    The energy over EI / h is the maximum over z of f(z) v^2 / 2 + z d - b z^2 / 2, f the `sway`, v
    the sway and d the shortening over h, b the `softness`: f is concave, so that there is one.
    Hence the force f v aside, z along, and the shortening d = b z - f' v^2 / 2 by load and sway.
    """
    local = along_axes(columns.axes, motion)
    aside = local[:, :2] / columns.height[:, None]
    short = -local[:, 2] / columns.height
    wide = (aside * aside).sum(axis=1) / 2
    load = jnp.minimum(short / columns.softness, 0.75 * columns.crushing)
    for _ in range(_STEPS):
        sway = _sway(columns, load)
        gap = short - columns.softness * load + wide * sway.slope
        new = load + gap / (columns.softness - wide * sway.curvature)
        load = jnp.minimum(new, (load + columns.crushing) / 2)
    sway = _sway(columns, load)
    return Bent(aside, load, sway, columns.softness - wide * sway.curvature)


def column_forces(columns: Columns, bent: Bent) -> Array:
    """Forces that the tops need, (C, 3, B), N, in the skin's frame."""
    along = bent.sway.value[:, None] * bent.aside
    force = jnp.concatenate([along, -bent.load[:, None]], axis=1)
    return _whole(columns, force * (columns.unit * columns.height)[:, None])


def column_blocks(columns: Columns, bent: Bent) -> Array:
    """Second derivatives of the columns' energies for one press, (C, 3, 3), N/m."""
    rate = jnp.concatenate(
        [bent.sway.slope[:, None] * bent.aside, -jnp.ones_like(bent.load)[:, None]], axis=1
    )[..., 0]
    flat = bent.sway.value[..., None] * jnp.diag(jnp.array([1.0, 1.0, 0.0]))
    own: Array = flat + rate[:, :, None] * rate[:, None] / bent.give[..., None]
    axes = columns.axes[..., 0]
    turned: Array = axes @ own @ jnp.swapaxes(axes, 1, 2)
    return turned * columns.unit[..., None]


def column_changes(columns: Columns, bent: Bent) -> tuple[Array, Array]:
    """Change of the forces with the stiffness sideways and along, relative, (C, 3, B) each, N."""
    wide = (bent.aside * bent.aside).sum(axis=1) / 2
    value, slope, curvature = bent.sway
    loads = (-bent.load * curvature * wide / bent.give, columns.softness * bent.load / bent.give)
    own = (value - bent.load * slope, jnp.zeros_like(value))
    changes = [
        jnp.concatenate([(direct + slope * load)[:, None] * bent.aside, -load[:, None]], axis=1)
        * (columns.unit * columns.height)[:, None]
        for direct, load in zip(own, loads, strict=True)
    ]
    return _whole(columns, changes[0]), _whole(columns, changes[1])


def stop_forces(stops: Stops, motion: Array, board: Array) -> tuple[Array, Array]:
    """Forces of the stops along their normals, N, and their slopes, N/m, both (S, B).

    Tops have moved over the board by `motion`, (V, 3, B), m, and the board by `board`, (6, B).

    Notes
    -----
    k (x)_+ past the free sway, its corner rounded by a parabola.
    """
    sway = (motion[stops.nodes] * stops.normal).sum(axis=1) + stops.by_board @ board
    past, width = sway - stops.free, stops.rounding
    onset = jnp.clip(past + width, 0.0, 2 * width)
    push = onset * onset / (4 * width) + jnp.maximum(past - width, 0.0)
    return stops.stiffness * push, stops.stiffness * onset / (2 * width)


def _whole(columns: Columns, local: Array) -> Array:
    """Forces along the columns' axes, (C, 3, B), in the skin's frame."""
    return off_axes(columns.axes, local)


def _sway(columns: Columns, load: Array) -> beam.Sway:
    """Stiffness against sway, straight on beyond the largest pull."""
    inside = jnp.maximum(load, columns.slackest)
    value, slope, curvature = beam.sway(inside, columns.share)
    return beam.Sway(
        value + slope * (load - inside), slope, jnp.where(load < inside, 0.0, curvature)
    )
