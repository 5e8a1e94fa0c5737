"""The heat map of the bound: how finely a touch can be placed, over the whole skin.

Decides its colours, which people of every colour vision tell apart, and the ends of their scale.
"""

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry
from smoskin.service.page.markers import UNITS
from smoskin.service.page.parts import css, html

if TYPE_CHECKING:
    import viser

_STEPS: Final = np.array([(0, 34, 78), (87, 92, 109), (164, 152, 112), (254, 232, 56)])
"""Colours from the finest place to the coarsest: darker is finer, in grey too."""
_OVER: Final = 0.12
"""Units of the scene between the sheet's tops and the dots."""


class Bound(NamedTuple):
    """Bounds of the place of a touch over the skin."""

    x: Floats
    """(L,), m."""
    y: Floats
    """(W,), m."""
    location: Floats
    """(L, W), m: root mean square distance from the true place."""
    force: float
    """N: force of the touch."""

    @property
    def scale(self) -> tuple[float, float]:
        """Ends of the colours, m: those between which 96 % of the places lie."""
        low, high = np.percentile(self.location, (2, 98)).tolist()
        return low, max(high, low + 1e-6)

    @property
    def colors(self) -> Floats:
        """(L, W, 3), 0 to 255."""
        low, high = self.scale
        share = np.clip((self.location - low) / (high - low), 0.0, 1.0)
        return _ramp(share)

    def legend(self) -> str:
        """The scale in words, as HTML."""
        low, high = (f"{1e3 * end:.2f}" for end in self.scale)
        colors = ", ".join(css(_rgb(step)) for step in _STEPS)
        return html("carpet", colors=colors, low=low, high=high, force=f"{self.force:g}")


class Carpet:
    """Dots over the sheet, coloured by a bound."""

    def __init__(self, server: "viser.ViserServer", design: SkinDesign) -> None:
        self._design = design
        self.node = server.scene.add_point_cloud(
            "/bound",
            np.zeros((0, 3)),
            (0, 0, 0),
            point_size=0.2,
            point_shape="rounded",
            visible=False,
        )

    def show(self, shown: bool) -> None:
        """Show the dots, or hide them."""
        if self.node.visible != shown:
            self.node.visible = shown

    def lay(self, bound: Bound) -> None:
        """Lay the dots of a bound."""
        skin = geometry(self._design)
        height = float(skin.cell.height) + _OVER / UNITS
        grid = np.stack(np.meshgrid(bound.x, bound.y, indexing="ij"), axis=-1).reshape(-1, 2)
        over = np.concatenate([grid, np.full((len(grid), 1), height)], axis=-1)
        self.node.points = (skin.roll.places(over) * UNITS).astype(np.float32)
        self.node.colors = bound.colors.reshape(-1, 3).astype(np.uint8)


def _ramp(share: Floats) -> Floats:
    """Colours at such shares of the scale, (..., 3), 0 to 255."""
    at = np.linspace(0.0, 1.0, len(_STEPS))
    return np.stack([np.interp(share, at, channel) for channel in _STEPS.T], axis=-1)


def _rgb(step: Floats) -> tuple[int, int, int]:
    red, green, blue = step.tolist()
    return int(red), int(green), int(blue)
