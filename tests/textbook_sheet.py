"""The sheet's energy and forces by the textbook, element by element, apart from the solver."""

import numpy as np

from barhinge_oracle import hinge_gradient


def angles(points):
    """Angles of hinges between two triangles, (H, 4, 3) to (H,)."""
    start, end, first, second = np.moveaxis(points, 1, 0)
    axis = end - start
    left, right = np.cross(axis, first - start), np.cross(second - start, axis)
    sine = (np.cross(left, right) * axis).sum(axis=1) / np.linalg.norm(axis, axis=1)
    return np.arctan2(sine, (left * right).sum(axis=1))


def sway_stiffness(load, unit, height, share):
    """Haringx's column, clamped and guided, N/m, in extended precision; `unit` is EI / h^3."""
    z = np.asarray(load, np.longdouble) / (unit * height)
    z = np.where(np.abs(z) < 1e-6, np.longdouble(1e-6), z)  # the closed form divides by it
    more = 1 + share * z
    q = np.sqrt((z * more).astype(np.clongdouble))
    return unit * (z / (2 * more * np.tan(q / 2) / q - 1)).real


def at_columns(lattice, motion):
    """Motion of the columns' tops along the columns' own axes, (C, 3)."""
    axes = np.swapaxes(lattice.supports.axes, 1, 2)
    return (axes @ motion[lattice.feet][..., None])[..., 0]


def column_loads(lattice, motion):
    """Compression of each column, N, by bisection of the shortening, and its sway stiffness."""
    made = lattice.supports
    moved = at_columns(lattice, motion).astype(np.longdouble)
    wide, short = (moved[:, :2] ** 2).sum(axis=1), -moved[:, 2]

    def stiffness(load):
        return sway_stiffness(load, made.unit, made.height, made.shear_share)

    def slope(load):
        step = 1e-2 * made.unit * made.height
        near = [stiffness(load + k * step) for k in (-2, -1, 1, 2)]
        return (near[0] - 8 * near[1] + 8 * near[2] - near[3]) / (12 * step)

    low = -0.7 * made.unit * made.height / made.shear_share
    high = 1.05 * made.buckling_load
    low, high = low.astype(np.longdouble), high.astype(np.longdouble)
    for _ in range(70):
        middle = (low + high) / 2
        more = short - middle / made.axial + slope(middle) * wide / 2 > 0
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    return low, stiffness(low)


def energy(lattice, motion):
    """Energy of all parts over a board that stands still, J; stops as sharp as they are."""
    moved = lattice.nodes + motion
    rest, growth = (np.diff(part[lattice.bars], axis=1)[:, 0] for part in (lattice.nodes, motion))
    stretch = ((2 * rest + growth) * growth).sum(axis=1) / (2 * np.linalg.norm(rest, axis=1))
    turn = angles(moved[lattice.hinges]) - unstressed_angles(lattice)
    load, stiffness = column_loads(lattice, motion)
    at_feet = at_columns(lattice, motion).astype(np.longdouble)
    of_columns = stiffness * (at_feet[:, :2] ** 2).sum(axis=1) / 2 - load * at_feet[:, 2]
    of_columns -= load**2 / (2 * lattice.supports.axial)
    stops = lattice.stops
    past = (motion[stops.nodes] * stops.normal).sum(axis=1) - stops.free
    return (
        0.5 * (lattice.bar_stiffness * stretch**2).sum()
        + 0.5 * (lattice.hinge_stiffness * turn**2).sum()
        + of_columns.sum()
        + 0.5 * (stops.stiffness * np.clip(past, 0, None) ** 2).sum()
    )


def unstressed_angles(lattice):
    """Angles of the hinges without moment."""
    kept = np.concatenate([np.zeros(lattice.panel_hinges), lattice.crease_set])
    return kept * angles(lattice.nodes[lattice.hinges])


def inner_force(lattice, motion):
    """Forces of all parts at the nodes, N, with the oracle's derivative of an angle."""
    moved = lattice.nodes + motion
    force = np.zeros_like(motion)
    load, stiffness = column_loads(lattice, motion)
    at_feet = stiffness[:, None] * at_columns(lattice, motion)
    at_feet[:, 2] = -load
    force[lattice.feet] = (lattice.supports.axes @ at_feet[..., None])[..., 0]
    stops = lattice.stops
    past = (motion[stops.nodes] * stops.normal).sum(axis=1) - stops.free
    inside = np.clip(past / stops.rounding, -1, 1)
    push = stops.stiffness * (stops.rounding * (inside + 1) ** 2 / 4 + past.clip(stops.rounding))
    push -= stops.stiffness * stops.rounding
    np.add.at(force, stops.nodes, push[:, None] * stops.normal)
    for (i, j), k in zip(lattice.bars, lattice.bar_stiffness, strict=True):
        rest, now = lattice.nodes[j] - lattice.nodes[i], moved[j] - moved[i]
        length = np.linalg.norm(rest)
        push = k * (now @ now - rest @ rest) / (2 * length) * now / length
        force[j] += push
        force[i] -= push
    turn = angles(moved[lattice.hinges]) - unstressed_angles(lattice)
    for nodes, k, by in zip(lattice.hinges, lattice.hinge_stiffness, turn, strict=True):
        # The oracle's angle has the other sign.
        force[nodes] -= k * by * hinge_gradient(moved[nodes])
    return force


def outer_force(model, touches, pressed, row):
    """Forces of the touches at the nodes, N."""
    case = model._loads(touches)
    force = touches.force[row].copy()
    force[:, :2] += pressed.reaction[row]
    loads = np.zeros_like(model.lattice.nodes)
    shared = case.shares[row].T @ force
    turned = (model.lattice.loaded_axes @ shared[..., None])[..., 0]
    loads[model.lattice.loaded.ravel()] = turned
    return loads
