"""A board's layers as Gerber files (RS-274X with X2 attributes) and its drills as Excellon files.

Decides which layers a house gets and their names, those of KiCad's own plots. Coordinates are the
skin's, in millimetres; files carry no date, so that equal boards give equal bytes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from smoskin.fabrication.boards import kicad
from smoskin.fabrication.boards.check import pads_of
from smoskin.fabrication.boards.layout import Layout, Placed, Point
from smoskin.fabrication.boards.parts import Pad
from smoskin.fabrication.boards.rules import MASK_MARGIN, house_of

_FUNCTIONS: Final = {
    "F_Cu": "Copper,L1,Top",
    "B_Cu": "Copper,L2,Bot",
    "F_Mask": "Soldermask,Top",
    "B_Mask": "Soldermask,Bot",
    "F_Paste": "Paste,Top",
    "B_Paste": "Paste,Bot",
    "F_Silkscreen": "Legend,Top",
    "B_Silkscreen": "Legend,Bot",
    "Edge_Cuts": "Profile,NP",
}
_NEGATIVE: Final = ("F_Mask", "B_Mask")
_OUTLINE: Final = 0.05
"""mm: width of the drawn outline."""


def _c(value: float) -> str:
    """A coordinate in nanometres."""
    return str(round(value * 1e6))


@dataclass
class _Plot:
    """One layer as it is drawn."""

    apertures: dict[str, int] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    _at: int = 0

    def _use(self, shape: str) -> None:
        number = self.apertures.setdefault(shape, 10 + len(self.apertures))
        if number != self._at:
            self.lines.append(f"D{number}*")
            self._at = number

    def draw(self, start: Point, end: Point, width: float) -> None:
        """A straight line with round ends."""
        self._use(f"C,{width:.6f}")
        self.lines.append(f"X{_c(start[0])}Y{_c(start[1])}D02*")
        self.lines.append(f"X{_c(end[0])}Y{_c(end[1])}D01*")

    def flash(self, pad: Pad, grow: float = 0.0) -> None:
        """A land, wider by `grow` on every side; one with a hole is round."""
        width, height = pad.width + 2 * grow, pad.height + 2 * grow
        self._use(f"C,{width:.6f}" if pad.hole else f"R,{width:.6f}X{height:.6f}")
        self.lines.append(f"X{_c(pad.x)}Y{_c(pad.y)}D03*")

    def dot(self, x: float, y: float, diameter: float) -> None:
        self._use(f"C,{diameter:.6f}")
        self.lines.append(f"X{_c(x)}Y{_c(y)}D03*")

    def text(self, function: str, negative: bool) -> str:
        """The file."""
        head = [
            "%TF.GenerationSoftware,smoskin,boards,1*%",
            "%TF.SameCoordinates,Original*%",
            f"%TF.FileFunction,{function}*%",
            f"%TF.FilePolarity,{'Negative' if negative else 'Positive'}*%",
            "%FSLAX46Y46*%",
            "%MOMM*%",
            "%LPD*%",
            "G01*",
        ]
        shapes = [f"%ADD{number}{shape}*%" for shape, number in self.apertures.items()]
        return "\n".join([*head, *shapes, *self.lines, "M02*", ""])


def gerber_files(layout: Layout) -> dict[str, str]:
    """Text of every layer's file, by the file's name."""
    plots = {layer: _Plot() for layer in _FUNCTIONS}
    house = house_of(layout)
    for track in layout.tracks:
        plots[f"{track.face}_Cu"].draw(track.start, track.end, track.width)
    for _, _, pad, faces in pads_of(layout):
        for face in faces:
            plots[f"{face}_Cu"].flash(pad)
            plots[f"{face}_Mask"].flash(pad, MASK_MARGIN)
            if pad.paste:
                plots[f"{face}_Paste"].flash(pad)
    for placed in layout.placed:
        for pad in placed.on_board(placed.component.part.paste_pads):
            plots[f"{placed.face}_Paste"].flash(pad)
        for start, end in _marks(placed):
            plots[f"{placed.face}_Silkscreen"].draw(start, end, kicad.MARK_WIDTH)
    for via in layout.vias:
        for face in ("F", "B"):
            plots[f"{face}_Cu"].dot(via.x, via.y, house.via)
    for x, y, diameter in layout.holes:
        for face in ("F", "B"):
            plots[f"{face}_Mask"].dot(x, y, diameter + 2 * MASK_MARGIN)
    corners = [(float(x), float(y)) for x, y in layout.outline]
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        plots["Edge_Cuts"].draw(start, end, _OUTLINE)
    return {
        f"{layout.name}-{layer}.gbr": plot.text(_FUNCTIONS[layer], layer in _NEGATIVE)
        for layer, plot in plots.items()
    }


def _marks(placed: Placed) -> Iterator[tuple[Point, Point]]:
    """Lines of the printed mark beside pin 1."""
    yield from pairwise(placed.to_board(*point) for point in placed.component.part.mark)


def drill_files(layout: Layout) -> dict[str, str]:
    """Text of the drill files of plated and unplated holes, by the file's name."""
    house = house_of(layout)
    plated = [(via.x, via.y, house.drill) for via in layout.vias]
    plated += [(pad.x, pad.y, pad.hole) for _, _, pad, _ in pads_of(layout) if pad.hole]
    files = {}
    for kind, function, holes in (
        ("PTH", "Plated,1,2,PTH", plated),
        ("NPTH", "NonPlated,1,2,NPTH", list(layout.holes)),
    ):
        if holes:
            files[f"{layout.name}-{kind}.drl"] = _excellon(function, holes)
    return files


def _excellon(function: str, holes: list[tuple[float, float, float]]) -> str:
    sizes = sorted({diameter for _, _, diameter in holes})
    lines = ["M48", f"; #@! TF.FileFunction,{function}", "FMAT,2", "METRIC"]
    lines += [f"T{k + 1}C{diameter:.3f}" for k, diameter in enumerate(sizes)]
    lines += ["%", "G90", "G05"]
    for k, size in enumerate(sizes):
        lines.append(f"T{k + 1}")
        lines += [f"X{x:.4f}Y{y:.4f}" for x, y, diameter in holes if diameter == size]
    return "\n".join([*lines, "T0", "M30", ""])
