"""What two touches at once do to each other: drags.

Each touch that sticks holds the sheet in the plane under it, so that the other one drags it. How
much follows from how vertices give way (`ResponseTable.grip`), and a table of single touches knows
what drags do. What else keeps two touches from adding up is that fields are not linear in motion
(`smoskin.magnetics.nonlinearity`). The equations are those of "Pairs" in `docs/derivations.md`.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats

PAD: Final = 1e-12
"""m/N: how much a touch gives way by itself, so that two on one place share what they hold."""


def mutual_drags(grip: Floats, shares: Floats, press: Floats) -> Floats:
    """What two straight touches that stick pull at each other.

    Parameters
    ----------
    grip : Floats, shape (H, 2, H, 3)
        G, m/N, as `ResponseTable.grip`.
    shares : Floats, shape (B, 2, H)
        Share a of each vertex in each touch.
    press : Floats, shape (B, 2)
        Normal forces p, N, positive.

    Returns
    -------
    Floats, shape (B, 2, 2)
        N: the sideways force t of each on the sheet beyond that which it has alone.

    Notes
    -----
    ``t_i = (-C^-1 S p)_i + C_ii^-1 S_ii p_i`` with ``C = a G a`` in the plane, ``S = a G a`` down.
    """
    rows = len(shares)
    flat = grip.reshape(len(grip), -1)
    half = (shares.reshape(2 * rows, -1) @ flat).reshape(rows, 2, 2, len(grip), 3)
    moved = np.einsum("bidke,bjk->bidje", half, shares)
    c, s = moved[..., :2], moved[..., 2]
    alone = [
        np.linalg.solve(
            c[:, k, :, k] + PAD * np.eye(2), (s[:, k, :, k] * press[:, k, None])[..., None]
        )[..., 0]
        for k in (0, 1)
    ]
    pushed = np.einsum("bidj,bj->bid", s, press).reshape(rows, 4, 1)
    both = np.linalg.solve(c.reshape(rows, 4, 4) + PAD * np.eye(4), pushed)
    return np.asarray(np.stack(alone, axis=1) - both.reshape(rows, 2, 2))
