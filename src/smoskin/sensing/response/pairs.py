"""What two touches at once do to each other: drags ("Pairs" in `docs/derivations.md`).

Each touch that sticks holds the sheet in the plane under it, so that the other one drags it. How
much follows from how vertices give way (`ResponseTable.grip`), and a table of single touches knows
what drags do.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats

_PAD: Final = 1e-12
"""m/N: how much a touch gives way by itself, so that two on one place share what they hold."""


def mutual_drags(grip: Floats, shares: Floats, press: Floats) -> tuple[Floats, Floats]:
    """What two straight touches that stick pull at each other, (B, 2, 2), N, with its slopes.

    `grip`, (H, 2, H, 3), m/N, is G of `ResponseTable`; `shares`, (B, 2, R, H), is the share a of
    each vertex in each touch, with R = 3 its slopes along x and y, 1/m, as well; `press`, (B, 2),
    N, are normal forces p. The drags t, sideways forces on the sheet beyond those of each touch
    alone, have derivatives (B, 2, R, 2, 2) by x and y, where these are given, and press of each.

    Notes
    -----
    ``t_i = (-C^-1 S p)_i + C_ii^-1 S_ii p_i`` with ``C = a G a`` in the plane, ``S = a G a`` down.
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
    drags, slopes = _holding_forces(np.concatenate([moved, alone]), np.tile(press, (2, 1)))
    return drags[:batch] - drags[batch:], slopes[:batch] - slopes[batch:]


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
