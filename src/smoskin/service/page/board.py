"""What is drawn of the skin's coordinates: rulers in millimetres on its board, and its cells.

Decides the ticks and when an estimate is a cell: where it is exactly the place of a cell's top.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from smoskin.service.page.markers import LIFT, UNITS

if TYPE_CHECKING:
    import viser

_INK: Final = (118, 124, 132)
_TICK: Final = 10.0
"""mm from tick to tick; every second one carries its number."""
_GAP: Final = 0.35
"""Units of the scene between the board and the rulers."""


def draw_rulers(server: "viser.ViserServer", design: SkinDesign) -> None:
    """Draw a ruler along x in front of the board and one along y at its left."""
    low = geometry(design).sheet.vertices.min(axis=0)
    level = -design.columns.height * UNITS
    extent = geometry(design).extent * 1e3
    lines = []
    for axis, name in enumerate("xy"):
        along, out = np.zeros(3), np.zeros(3)
        along[axis], out[1 - axis] = 1.0, -1.0
        start = np.array((0.0, 0.0, level)) + out * (_GAP - (low * UNITS)[1 - axis])
        lines.append([start, start + along * extent[axis] / 1e3 * UNITS])
        for number, tick in enumerate(np.arange(0.0, extent[axis] + 0.01, _TICK)):
            place = start + along * tick / 1e3 * UNITS
            numbered = number % 2 == 0
            lines.append([place, place + out * (0.35 if numbered else 0.2)])
            if numbered:
                _write(server, f"/rulers/{name}{number}", f"{tick:.0f}", place + 0.75 * out)
        between = (2 * round(extent[axis] / (4 * _TICK)) + 1) * _TICK  # two numbers
        _write(
            server,
            f"/rulers/{name}",
            f"{name}, mm",
            start + along * between / 1e3 * UNITS + 1.6 * out,
        )
    server.scene.add_line_segments("/rulers/lines", np.array(lines), _INK, thickness=0.05)


def _write(server: "viser.ViserServer", name: str, text: str, place: Floats) -> None:
    server.scene.add_label(
        name, text, position=tuple(place), font_screen_scale=0.75, anchor="center-center"
    )


class Cells:
    """Outlines of the cells that an estimate names, where it names cells."""

    def __init__(
        self, server: "viser.ViserServer", design: SkinDesign, color: tuple[int, int, int]
    ) -> None:
        self._tops = geometry(design).tops.reshape(-1, 2)
        width, depth = geometry(design).extent / design.cells / 2 * UNITS
        corners = np.array([(-width, -depth), (width, -depth), (width, depth), (-width, depth)])
        square = np.zeros((4, 2, 3))
        square[:, 0, :2], square[:, 1, :2] = corners, np.roll(corners, -1, axis=0)
        self._outlines = [
            server.scene.add_line_segments(
                f"/cells/{number}", square, color, thickness=0.12, visible=False
            )
            for number in range(2)
        ]

    def show(self, contacts: Sequence[Contact], height: Callable[[Floats], float]) -> None:
        """Outline the cells whose tops these contacts touch exactly; `height` of the sheet, m."""
        for number, outline in enumerate(self._outlines):
            place = contacts[number].position if number < len(contacts) else None
            outline.visible = place is not None and self._is_top(place)
            if place is not None:
                outline.position = (*place * UNITS, height(place) * UNITS + LIFT)

    def _is_top(self, place: Floats) -> bool:
        """Whether a place is that of a cell's top, to the last digits."""
        return bool((np.abs(self._tops - place) < 1e-9).all(axis=1).any())
