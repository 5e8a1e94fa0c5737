"""What two touches at once do to each other: drags.

Each touch that sticks holds the sheet in the plane under it, so that the other one drags it. How
much follows from how vertices give way (`ResponseTable.grip`), and a table of single touches knows
what drags do. What else keeps two touches from adding up is that fields are not linear in motion
(`smoskin.magnetics.nonlinearity`).
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
        m/N, as `ResponseTable.grip`.
    shares : Floats, shape (B, 2, H)
        Of each vertex in each touch.
    press : Floats, shape (B, 2)
        N, normal, positive.

    Returns
    -------
    Floats, shape (B, 2, 2)
        N: the sideways force of each on the sheet beyond that which it has alone.
    """
    rows = len(shares)
    flat = grip.reshape(len(grip), -1)
    half = (shares.reshape(2 * rows, -1) @ flat).reshape(rows, 2, 2, len(grip), 3)
    moved = np.einsum("bidke,bjk->bidje", half, shares)
    give, pushed = moved[..., :2], moved[..., 2]
    alone = [
        np.linalg.solve(
            give[:, k, :, k] + PAD * np.eye(2), (pushed[:, k, :, k] * press[:, k, None])[..., None]
        )[..., 0]
        for k in (0, 1)
    ]
    sag = np.einsum("bidj,bj->bid", pushed, press).reshape(rows, 4, 1)
    both = np.linalg.solve(give.reshape(rows, 4, 4) + PAD * np.eye(4), sag)
    return np.asarray(np.stack(alone, axis=1) - both.reshape(rows, 2, 2))
