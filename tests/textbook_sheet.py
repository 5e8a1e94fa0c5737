"""The sheet's energy and forces by the textbook, element by element, apart from the solver."""

import numpy as np

from barhinge_oracle import hinge_gradient


def angles(points):
    """Angles of hinges between two triangles, (H, 4, 3) to (H,)."""
    start, end, one, other = np.moveaxis(points, 1, 0)
    axis = end - start
    left, right = np.cross(axis, one - start), np.cross(other - start, axis)
    sine = (np.cross(left, right) * axis).sum(axis=1) / np.linalg.norm(axis, axis=1)
    return np.arctan2(sine, (left * right).sum(axis=1))


def energy(lattice, motion):
    """Energy of all springs, J."""
    moved = lattice.nodes + motion
    rest, growth = (np.diff(part[lattice.bars], axis=1)[:, 0] for part in (lattice.nodes, motion))
    stretch = ((2 * rest + growth) * growth).sum(axis=1) / (2 * np.linalg.norm(rest, axis=1))
    turn = angles(moved[lattice.hinges]) - angles(lattice.nodes[lattice.hinges])
    return 0.5 * (
        (lattice.bar_stiffness * stretch**2).sum()
        + (lattice.hinge_stiffness * turn**2).sum()
        + (lattice.ground * motion**2).sum()
    )


def inner_force(lattice, motion):
    """Forces of all springs at the nodes, N, with the oracle's derivative of an angle."""
    moved = lattice.nodes + motion
    force = lattice.ground * motion
    for (i, j), k in zip(lattice.bars, lattice.bar_stiffness, strict=True):
        rest, now = lattice.nodes[j] - lattice.nodes[i], moved[j] - moved[i]
        length = np.linalg.norm(rest)
        push = k * (now @ now - rest @ rest) / (2 * length) * now / length
        force[j] += push
        force[i] -= push
    turn = angles(moved[lattice.hinges]) - angles(lattice.nodes[lattice.hinges])
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
    loads[model.lattice.loaded.ravel()] = case.shares[row].T @ force
    return loads
