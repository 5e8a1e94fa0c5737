"""What is drawn of the skin's coordinates: rulers in millimetres on its board, and its cells.

Decides the ticks and when an estimate is a cell: where it is exactly the place of a cell's top.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from smoskin.service.page.markers import LIFT, UNITS, attitude
from smoskin.service.page.stack import board_corners

if TYPE_CHECKING:
    import viser

_INK: Final = (118, 124, 132)
_TICK: Final = 10.0
"""mm from tick to tick; every second one carries its number."""
_GAP: Final = 0.35
"""Units of the scene between the board and the rulers."""


def draw_rulers(server: "viser.ViserServer", design: SkinDesign) -> None:
    """Draw a ruler along x in front of the board and one along y at its left."""
    skin = geometry(design)
    low, level, extent = board_corners(design)[0], -design.columns.height, skin.extent * 1e3
    lines = []

    def drawn(place: Floats) -> Floats:
        return np.asarray(skin.roll.places(place / UNITS) * UNITS)

    for axis, name in enumerate("xy"):
        along, out = np.zeros(3), np.zeros(3)
        along[axis], out[1 - axis] = 1.0, -1.0
        start = np.array((0.0, 0.0, level * UNITS)) + out * (_GAP - (low * UNITS)[1 - axis])
        ticks = np.arange(0.0, extent[axis] + 0.01, _TICK)
        stations = [*ticks[ticks < extent[axis] - 0.01], extent[axis]]
        line = [drawn(start + along * at / 1e3 * UNITS) for at in stations]
        lines += [[*ends] for ends in pairwise(line)]
        for number, tick in enumerate(ticks):
            place = start + along * tick / 1e3 * UNITS
            numbered = number % 2 == 0
            lines.append([drawn(place), drawn(place + out * (0.35 if numbered else 0.2))])
            if numbered:
                label = f"/rulers/{name}{number}"
                _write(server, label, f"{tick:.0f}", drawn(place + 0.75 * out))
        between = (2 * round(extent[axis] / (4 * _TICK)) + 1) * _TICK  # two numbers
        middle = start + along * between / 1e3 * UNITS + 1.6 * out
        _write(server, f"/rulers/{name}", f"{name}, mm", drawn(middle))
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
        self._roll = geometry(design).roll
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
                over = self._roll.places([*place, height(place) + LIFT / UNITS])
                outline.position = tuple(over * UNITS)
                outline.wxyz = attitude(self._roll.axes(place[1]))

    def _is_top(self, place: Floats) -> bool:
        """Whether a place is that of a cell's top, to the last digits."""
        return bool((np.abs(self._tops - place) < 1e-9).all(axis=1).any())
