"""What two touches at once do to each other: drags and softer columns ("Pairs" in the derivations).

Each touch that sticks holds the sheet in the plane under it, so that the other one drags it. How
much follows from how vertices give way (`ResponseTable.grip`), and a table of single touches knows
what drags do. A column that one touch loads holds less against the other, which is a product of
both (`ResponseTable.coupling`).
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats

_PADS: Final = 1e-12 * np.eye(4)
"""m/N: how much a touch gives way by itself, so that two on one place share what they hold."""
_ALONE: Final = np.eye(2)[:, :, None, None, None]
"""Patches that do not move each other."""
_ONE, _OTHER = np.array([0, 1, 2, 0, 0]), np.array([0, 0, 0, 1, 2])
"""Which slope of either is taken in a product of two touches' shares and its slopes."""


def held(grip: Floats, shares: Floats, press: Floats) -> tuple[Floats, Floats]:
    """What two straight touches that stick hold the sheet with, together and each alone.

    Sideways forces t of each, N, with their slopes by press of one and the other, (B, 2, 3, 2).
    `grip`, (H, 2, H, 3), m/N, is G of `ResponseTable`; `shares`, (B, 2, H), is the share a of each
    vertex in each touch; `press`, (B, 2), N, are normal forces p.

    Notes
    -----
    ``t = -C^-1 S p`` with ``C = a G a`` in the plane, ``S = a G a`` down; alone of its own alone.
    """
    batch, count, vertices = shares.shape
    half = (shares.reshape(-1, vertices) @ grip.reshape(vertices, -1)).reshape(
        batch, count, 2, vertices, 3
    )
    moved = half.swapaxes(-1, -2) @ shares.swapaxes(1, 2)[:, None, None]
    return _held(np.moveaxis(moved, -1, 2)[:, :, :, None], press)


def mutual_drags(grip: Floats, shares: Floats, press: Floats) -> tuple[Floats, Floats]:
    """What two straight touches that stick pull at each other, (B, 2, 2), N, and slopes by press.

    Arguments are those of `held`. The drags are sideways forces on the sheet beyond those of each
    touch alone; derivatives by the press of each have shape (B, 2, 2, 2), that press first.
    """
    together, alone = held(grip, shares, press)
    drags = together - alone
    return drags[:, :, 0], drags[:, :, 1:].swapaxes(1, 2)


class NearPairs:
    """Shares of the V vertices near both touches of B pairs, from which both answers follow.

    `shares`, (B, 2, 3, V), are those of these vertices with their slopes along x and y.
    """

    def __init__(self, shares: Floats) -> None:
        self._shape = (*shares.shape[:2], shares.shape[1], len(_ONE), shares.shape[-1] ** 2)
        first = shares.take(_ONE, axis=2)[:, :, None, :, :, None]
        self._products = first * shares.take(_OTHER, axis=2)[:, None, :, :, None]

    def held(self, grip: Floats, press: Floats) -> tuple[Floats, Floats]:
        """The same as of all vertices, with slopes by x, y and press of each, (B, 2, 7, 2).

        `grip`, (B, 2, 2, V, V, 6), is G between those near either touch.
        """
        products = self._products.reshape(self._shape)
        moved = products @ grip.reshape(*self._shape[:3], -1, 6)
        return _held(moved.reshape(*self._shape[:4], 2, 3), press)

    def coupled(self, coupling: Floats, forces: Floats) -> Floats:
        """What they add to the sum of what each reads, with slopes by all unknowns, (B, 7, C).

        `coupling`, (B, V, V, 9 C), is Q between those near one and those near the other; `forces`,
        (B, 2, 7, 3), are those on the sheet with their slopes.
        """
        products = self._products[:, 0, 1].reshape(-1, *self._shape[3:])
        batch, rates, _ = products.shape
        whole = (products @ coupling.reshape(batch, self._shape[4], -1)).reshape(
            batch, rates, 9, -1
        )
        here = forces[:, :, 0]
        both = forces[:, 0, :, :, None] * here[:, 1, None, None]
        both += here[:, 0, None, :, None] * forces[:, 1, :, None]
        both[:, 0] *= 0.5
        both = both.reshape(batch, -1, 9)
        out = both @ whole[:, 0]
        by_place = (both[:, None, :1] @ whole[:, 1:])[:, :, 0]
        out[:, 1:3] += by_place[:, :2]
        out[:, 4:6] += by_place[:, 2:]
        return np.asarray(out)


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


def _held(moved: Floats, press: Floats) -> tuple[Floats, Floats]:
    """Forces t = -C^-1 S p of touches that stick, together and each alone.

    Rows (B, K, 1 + K R, 2) are t of each and its slopes; `moved`, (B, K, K, 2 R - 1, 2, 3), is the
    motion of one patch by a force on another, m/N, with slopes by the places of one and the other.
    """
    batch, count, _, rates = moved.shape[:4]
    places = rates // 2
    # Beside both together, each alone.
    moved = np.concatenate([moved, moved * _ALONE])
    press = np.concatenate([press, press])
    whole = moved[:, :, :, 0].swapaxes(2, 3).reshape(2 * batch, 2 * count, count, 3)
    inverse = np.linalg.inv(whole[..., :2].reshape(2 * batch, 2 * count, 2 * count) + _PADS)
    by_press = inverse @ whole[..., 2]
    forces = by_press @ press[..., None]
    rows = np.empty((2 * batch, count, 1 + count * (1 + places), 2))
    rows[:, :, 0] = forces.reshape(2 * batch, count, 2)
    slopes = rows[:, :, 1:].reshape(2 * batch, count, count, 1 + places, 2)
    slopes[:, :, :, -1] = by_press.reshape(2 * batch, count, 2, count).swapaxes(2, 3)
    if places:
        load = np.empty((2 * batch, 1, count, 1, 3, 1))
        load[:, 0, :, 0, :2, 0] = -rows[:, :, 0]
        load[:, 0, :, 0, 2, 0] = press
        # What moves where a touch is elsewhere: all patches by its force, its own by all forces.
        gaps = (moved[:, :, :, 1:] @ load)[..., 0]
        by_place = gaps[:, :, :, places:].copy()
        own = gaps[:, :, :, :places].sum(axis=2)
        for k in range(count):
            by_place[:, k, k] += own[:, k]
        turned = by_place.transpose(0, 2, 3, 1, 4).reshape(2 * batch, -1, 2 * count)
        turned = turned @ inverse.swapaxes(1, 2)
        turned = turned.reshape(2 * batch, count, places, count, 2)
        slopes[:, :, :, :-1] = turned.transpose(0, 3, 1, 2, 4)
    np.negative(rows, out=rows)
    return rows[:batch], rows[batch:]
