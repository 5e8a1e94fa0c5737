"""What two touches at once do to each other: drags and softer columns ("Pairs" in the derivations).

Each touch that sticks holds the sheet in the plane under it, so that the other one drags it. How
much follows from how vertices give way (`ResponseTable.grip`), and a table of single touches knows
what drags do. A column that one touch loads holds less against the other, which is a product of
both (`ResponseTable.coupling`).
"""

from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats, Ints

_PAD: Final = 1e-12
"""m/N: how much a touch gives way by itself, so that two on one place share what they hold."""


class Held(NamedTuple):
    """Sideways forces of B pairs of straight touches that stick, on the sheet, N."""

    together: Floats
    """(B, 2, 2): t of each along x and y while the other presses too."""
    together_slopes: Floats
    """(B, 2, R, 2, 2): derivatives by x, y, where given, and press of each, of t of each."""
    alone: Floats
    """(B, 2, 2): t of each alone."""
    alone_slopes: Floats
    """(B, 2, R, 2, 2): derivatives likewise."""


def held(grip: Floats, shares: Floats, press: Floats) -> Held:
    """What two straight touches that stick hold the sheet with, together and each alone.

    `grip`, (H, 2, H, 3), m/N, is G of `ResponseTable`; `shares`, (B, 2, R, H), is the share a of
    each vertex in each touch, with R = 3 its slopes along x and y, 1/m, as well; `press`, (B, 2),
    N, are normal forces p.

    Notes
    -----
    ``t = -C^-1 S p`` with ``C = a G a`` in the plane, ``S = a G a`` down; alone of its own alone.
    """
    batch, _, rates, vertices = shares.shape
    rows = shares.reshape(batch, 2 * rates, vertices)
    half = (rows.reshape(-1, vertices) @ grip.reshape(vertices, -1)).reshape(
        batch, 2 * rates, 2, vertices, 3
    )
    moved = half.swapaxes(-1, -2) @ rows.swapaxes(1, 2)[:, None, None]
    moved = moved.reshape(batch, 2, rates, 2, 3, 2, rates)
    # Beside both together, each alone: patches that do not move each other.
    alone = moved * np.eye(2)[:, None, None, None, :, None]
    forces, slopes = _holding_forces(np.concatenate([moved, alone]), np.tile(press, (2, 1)))
    return Held(forces[:batch], slopes[:batch], forces[batch:], slopes[batch:])


def mutual_drags(grip: Floats, shares: Floats, press: Floats) -> tuple[Floats, Floats]:
    """What two straight touches that stick pull at each other, (B, 2, 2), N, with its slopes.

    Arguments are those of `held`. The drags, sideways forces on the sheet beyond those of each
    touch alone, have derivatives (B, 2, R, 2, 2) by x and y, where these are given, and press of
    each.
    """
    by = held(grip, shares, press)
    return by.together - by.alone, by.together_slopes - by.alone_slopes


def coupled(coupling: Floats, shares: Floats, forces: Floats) -> Floats:
    """What two touches add to the sum of what each reads, (B, C), T.

    `coupling`, (H, 3, H, 3, C), T/N^2, is Q of `ResponseTable`; `shares`, (B, 2, H), those of the
    vertices in each touch; `forces`, (B, 2, 3), N, on the sheet along x, along y and down.

    Notes
    -----
    ``sum over h, d, g, e of a_1h f_1d Q_hdgec f_2e a_2g``.
    """
    vertices, signals = coupling.shape[0], coupling.shape[-1]
    loads = (shares[..., None] * forces[:, :, None]).reshape(len(shares), 2, 3 * vertices)
    half = loads[:, 0] @ coupling.reshape(3 * vertices, -1)
    half = half.reshape(len(shares), 3 * vertices, signals)
    return np.asarray((loads[:, 1, None] @ half)[:, 0])


def coupled_with_slopes(
    coupling: Floats, vertices: Ints, rates: Floats, forces: Floats, slopes: Floats
) -> tuple[Floats, Floats]:
    """The same of B pairs, (B, C), and its slopes by x, y and press of each touch, (B, 6, C).

    `coupling` is (H, H, 3 3 C) here; `rates`, (B, 2, 3, V), are shares of the V `vertices` (B, 2,
    V) near each touch with their slopes along x and y, `slopes`, (B, 6, 2, 3), those of the forces
    (B, 2, 3).
    """
    batch, _, _, near = rates.shape
    part = coupling[vertices[:, 0, :, None], vertices[:, 1, None, :]]
    inner = (rates[:, 0] @ part.reshape(batch, near, -1)).reshape(batch, 3, near, -1)
    whole = (rates[:, 1, None] @ inner).reshape(batch, 3, 3, 3, 3, -1)  # by rates, then forces
    by_other = (forces[:, None, None, None, 1] @ whole[:, :, 0])[..., 0, :]  # (B, 3, 3, C)
    by_one = (forces[:, None, None, 0] @ whole[:, 0].reshape(batch, 3, 3, -1)).reshape(
        batch, 3, 3, -1
    )
    force = forces[:, :, None]
    value = (force[:, 0] @ by_other[:, 0])[:, 0]
    out = slopes[:, :, 0] @ by_other[:, 0] + slopes[:, :, 1] @ by_one[:, 0]
    out[:, :2] += (force[:, None, 0] @ by_other[:, 1:])[:, :, 0]
    out[:, 3:5] += (force[:, None, 1] @ by_one[:, 1:])[:, :, 0]
    return value, out


def _holding_forces(moved: Floats, press: Floats) -> tuple[Floats, Floats]:
    """Forces t = -C^-1 S p (B, K, 2) of touches that stick, and slopes (B, K, R, K, 2).

    `moved` (B, K, R, 2, 3, K, R) is the motion of one patch by a force on another, m/N.
    """
    batch, count = press.shape
    middle = moved[:, :, 0, ..., 0]
    c = middle[:, :, :, :2].swapaxes(3, 4).reshape(batch, 2 * count, 2 * count)
    s = middle[:, :, :, 2]
    inverse = np.linalg.inv(c + _PAD * np.eye(2 * count))
    pushed = s.reshape(batch, 2 * count, count) @ press[..., None]
    drags = -(inverse @ pushed).reshape(batch, count, 2)
    load = np.concatenate([drags, press[..., None]], axis=-1)
    # What moves where a touch is elsewhere: all patches by its force, its own by all forces.
    gaps = np.einsum("bkdejr,bje->bjrkd", moved[:, :, 0, ..., 1:], load)
    own = np.einsum("bkrdej,bje->bkrd", moved[:, :, 1:, ..., 0], load)
    for k in range(count):
        gaps[:, k, :, k] += own[:, k]
    gaps = np.concatenate([gaps, np.moveaxis(s, -1, 1)[:, :, None]], axis=2)
    slopes = gaps.reshape(batch, -1, 2 * count) @ inverse.swapaxes(1, 2)
    return drags, -slopes.reshape(gaps.shape)
