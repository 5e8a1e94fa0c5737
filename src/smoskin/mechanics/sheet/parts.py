"""The lattice's parts on the device, and their strains, forces and stiffness one by one.

Decides how data of a lattice becomes arrays that the compiled functions take; hides the pieces of
the tangent, which `smoskin.mechanics.sheet.tangent` adds up.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from smoskin.arrays import Floats
from smoskin.mechanics import beam
from smoskin.mechanics.board import Board
from smoskin.mechanics.sheet import columns, elements
from smoskin.mechanics.sheet.lattice import Lattice


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
    folded: Array
    """(H, 1), rad: angles as folded; 0 within panels, which are flat."""
    rest_angle: Array
    """(H, 1), rad: angles without moment."""
    rest_along: Array
    """(E, 3, 1): derivatives of the bars' stretches at rest."""
    rest_gradient: Array
    """(4, P, 3, 1), rad/m: derivatives of the panels' bends at rest."""
    stiffness: Array
    """(E + P, 1), N/m and N m/rad: bars, then panels' hinges."""
    crease_stiffness: Array
    """(H - P, 1), N m/rad."""
    columns: columns.Columns
    """Columns under the sheet."""
    stops: columns.Stops
    """The frame."""


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
    columns: Floats
    """(C, 3, 3), N/m: second derivative of each column's energy."""
    stops: Floats
    """(S, 3, 3), N/m: second derivative of each stop's energy."""
    coupling: Floats
    """(V, 3, 6): second derivative of the stops' energies by nodes and board."""
    board: Floats
    """(6, 6): second derivative of the stops' energies by the board."""
    board_push: Floats
    """(6,): forces and moments of the stops on the board."""
    pushes: Floats
    """(5, V, 3), N: forces of bars, panels' hinges, creases, columns and stops at the nodes."""
    by_column: Floats
    """(2, V, 3), N: change of the columns' forces with their stiffness sideways and along,
    relative."""
    compression: Floats
    """(C,), N: load of each column."""
    stopped: Floats
    """(S,), N: force of each stop."""


def elements_of(lattice: Lattice, board: Board) -> Elements:
    """The lattice's elements on the device."""
    panels = lattice.panel_hinges
    span = np.diff(lattice.nodes[lattice.bars], axis=1)[:, 0, :, None]
    length = np.linalg.norm(span, axis=1)
    corners = lattice.nodes[lattice.hinges.T][..., None]
    arms = corners[1:] - corners[0]
    angle, gradient = _bend(arms, np.zeros_like(corners))
    own = np.concatenate([lattice.bar_stiffness, lattice.hinge_stiffness[:panels]])
    kept = np.concatenate([np.zeros(panels), lattice.crease_set])[:, None]
    return Elements(
        bars=jnp.asarray(lattice.bars.T),
        span=jnp.asarray(span),
        length=jnp.asarray(length),
        hinges=jnp.asarray(lattice.hinges.T),
        arms=jnp.asarray(arms),
        folded=angle,
        rest_angle=angle * kept,
        rest_along=jnp.asarray(span / length[:, None]),
        rest_gradient=gradient[:, :panels],
        stiffness=jnp.asarray(own[:, None]),
        crease_stiffness=jnp.asarray(lattice.hinge_stiffness[panels:, None]),
        columns=_columns(lattice),
        stops=_stops(lattice, board),
    )


def _columns(lattice: Lattice) -> columns.Columns:
    """The lattice's columns on the device."""
    made = lattice.supports
    share = made.shear_share
    # A column without stiffness one way is finite all the same: it buckles, or sinks, at once.
    unit = np.maximum(made.unit, 1e-12 * made.axial + 1e-15)
    axes = made.axes[..., None]
    parts = (
        unit,
        made.height,
        share,
        unit / np.maximum(made.axial, 1e-9 * unit),
        beam.slackest(share),
        beam.crushing(share),
    )
    own = (jnp.asarray(part[:, None]) for part in parts)
    return columns.Columns(jnp.asarray(made.feet), jnp.asarray(axes), *own)


def _stops(lattice: Lattice, board: Board) -> columns.Stops:
    """The frame's stops on the device."""
    made = lattice.stops
    by_board = np.zeros((len(made.nodes), 6))
    if made.on_base:
        moved = np.einsum("sd,sdb->sb", made.normal, board.carries(made.places))
        by_board = moved / made.lever[:, None]
    parts = (made.stiffness, made.free, made.rounding)
    stiffness, free, rounding = (jnp.asarray(part[:, None]) for part in parts)
    return columns.Stops(
        nodes=jnp.asarray(made.nodes),
        normal=jnp.asarray(made.normal[..., None]),
        stiffness=stiffness,
        free=free,
        rounding=rounding,
        by_board=jnp.asarray(by_board),
    )


@jax.jit
def _bend(arms: Array, moved: Array) -> tuple[Array, Array]:
    """Angles of hinges and their derivatives."""
    bent = elements.fold(arms, moved)
    return bent.angle, elements.pushes(bent, jnp.ones_like(bent.angle))


@jax.jit
def blocks_at(net: Elements, motion: Array, board: Array, force: Array | None) -> tuple[Array, ...]:
    """Parts of `Blocks` for the motion (V, 3, 1) of one press, and the board's (6, 1)."""
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
    of_columns, by_column, load, at_feet = _column_parts(net.columns, motion)
    of_stops, coupling, on_board, board_push, at_stops, stopped = _stop_parts(
        net.stops, motion, board
    )
    return (
        strain[:, 0],
        along[..., 0],
        gradient[..., 0],
        of_bars,
        of_hinges,
        of_columns,
        of_stops,
        coupling,
        on_board,
        board_push,
        jnp.stack([*pushes, at_feet, at_stops])[..., 0],
        by_column,
        load,
        stopped,
    )


def _column_parts(made: columns.Columns, motion: Array) -> tuple[Array, Array, Array, Array]:
    """Columns' blocks, changes with their stiffness, loads and forces at the nodes."""
    still = jnp.zeros_like(motion)
    bent = columns.bend(made, motion[made.feet])
    changes = [still.at[made.feet].set(part) for part in columns.column_changes(made, bent)]
    return (
        columns.column_blocks(made, bent),
        jnp.stack(changes)[..., 0],
        (bent.load * made.unit * made.height)[:, 0],
        still.at[made.feet].set(columns.column_forces(made, bent)),
    )


def _stop_parts(made: columns.Stops, motion: Array, board: Array) -> tuple[Array, ...]:
    """Stops' blocks by nodes, nodes and board, and board; forces on the board and the nodes."""
    push, slope = columns.stop_forces(made, motion, board)
    normal = made.normal[..., 0]
    coupled = slope[..., None] * normal[:, :, None] * made.by_board[:, None]
    return (
        _outer(slope, normal),
        jnp.zeros((*motion.shape[:2], 6)).at[made.nodes].add(coupled),
        made.by_board.T @ (slope * made.by_board),
        (made.by_board.T @ push)[:, 0],
        jnp.zeros_like(motion).at[made.nodes].add((push * normal)[..., None]),
        push[:, 0],
    )


def _outer(stiffness: Array, rates: Array) -> Array:
    """Blocks of springs that resist each element's one strain."""
    return stiffness[..., None] * rates[:, :, None] * rates[:, None]
