"""What stands between the board and the sheet: columns that bend, and how magnets are magnetised.

Decides how both are drawn. Hides the triangles of the columns.
"""

from typing import Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import Magnet, SkinDesign
from smoskin.origami.geometry import from_columns, geometry

_SIDES: Final = 6
_RINGS: Final = 5
_ARROW_LIFT: Final = 1e-4
"""m: place of the arrows over a magnet's upper face."""


class Columns:
    r"""The columns of a design, each a bent prism whose head follows the sheet.

    Notes
    -----
    Between two ends that do not turn a column bends as :math:`u(s) = u_h\,(3 s^2 - 2 s^3)` with
    the share :math:`s` of its height; its axial shortening is uniform.
    """

    def __init__(self, design: SkinDesign) -> None:
        skin = geometry(design)
        heads = skin.sheet.columns.ravel()
        stands = np.ones(len(heads), dtype=bool)
        for magnet, place in zip(design.magnets, skin.magnets, strict=True):
            if magnet.mount == "sheet" and magnet.driver == "vertex":
                # The magnet hangs there in place of a column.
                stands &= from_columns(skin, place) > magnet.radius
        heads = heads[stands]
        self.heads: Ints = heads
        """(C,): index of the sheet's vertex on each column."""
        axes = skin.axes[heads]
        self._normal = axes[..., 2]
        self._feet = skin.sheet.vertices[heads] - design.columns.height * self._normal
        around = 2 * np.pi * np.arange(_SIDES) / _SIDES
        self._ring = design.columns.radius * (
            np.cos(around)[:, None] * axes[:, None, :, 0]
            + np.sin(around)[:, None] * axes[:, None, :, 1]
        )

    @property
    def triangles(self) -> Ints:
        """Triangles of all the columns' sides, (T, 3), over the rows of `places`."""
        ring, side = np.divmod(np.arange((_RINGS - 1) * _SIDES), _SIDES)
        low, after = ring * _SIDES + side, ring * _SIDES + (side + 1) % _SIDES
        high, beyond = low + _SIDES, after + _SIDES
        column = np.concatenate(
            [np.stack([low, after, beyond], axis=-1), np.stack([low, beyond, high], axis=-1)]
        )
        starts = _RINGS * _SIDES * np.arange(len(self.heads))
        return np.asarray(column + starts[:, None, None]).reshape(-1, 3)

    def places(self, vertices: Floats) -> Floats:
        """Vertices of all the columns under a sheet with such vertices (V, 3), both in m."""
        whole = vertices[self.heads] - self._feet
        along = (whole * self._normal).sum(axis=1)[:, None] * self._normal
        share = np.linspace(0.0, 1.0, _RINGS)[:, None, None]
        axis = self._feet + share * along + share**2 * (3 - 2 * share) * (whole - along)
        rings = axis[..., None, :] + self._ring
        return np.asarray(np.moveaxis(rings, 0, 1)).reshape(-1, 3)


def inward_arrows(magnet: Magnet) -> Floats:
    """Lines of one arrow on each sector of a magnet, (12, 2, 3), m, in the magnet's frame.

    Each points as its sector is magnetised, along the bisector.
    """
    turn = 0.5 * np.pi * (np.arange(4) + 0.5)
    out = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * magnet.radius
    across = np.stack([-out[:, 1], out[:, 0]], axis=-1)
    tail, tip = (0.85 * out, 0.25 * out)[:: magnet.polarity]
    back = tip + 0.3 * (tail - tip)
    barbs = [np.stack([tip, back + way * 0.15 * across], axis=1) for way in (-1, 1)]
    lines = np.concatenate([np.stack([tail, tip], axis=1), *barbs])
    height = np.full((*lines.shape[:2], 1), magnet.height / 2 + _ARROW_LIFT)
    return np.concatenate([lines, height], axis=-1)
