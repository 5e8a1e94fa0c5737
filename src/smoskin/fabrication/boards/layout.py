"""A board's layout: parts at their places, copper on two faces, holes and areas kept free.

Hides how a part's frame lies on either face. Lengths are millimetres; x and y are the skin's, seen
from above on both faces.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from smoskin.arrays import Floats
from smoskin.fabrication.boards.circuit import Circuit, Component
from smoskin.fabrication.boards.parts import Pad

Face = Literal["F", "B"]
"""Upper (front) and lower (back) face."""
Point = tuple[float, float]


def other(face: Face) -> Face:
    """The opposite face."""
    return "B" if face == "F" else "F"


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """A component on the board."""

    component: Component
    x: float
    """mm: middle."""
    y: float
    """mm: middle."""
    face: Face
    turn: int = 0
    """Quarter turns counter-clockwise, seen from above, of a part that on the lower face was first
    flipped over top to bottom."""

    def to_board(self, u: float, v: float) -> Point:
        """A point of the part's frame on the board, mm."""
        v = v if self.face == "F" else -v
        for _ in range(self.turn % 4):
            u, v = -v, u
        return round(self.x + u, 6), round(self.y + v, 6)

    def on_board(self, pads: Sequence[Pad]) -> Iterator[Pad]:
        """Pads of the part as they lie on the board."""
        for pad in pads:
            x, y = self.to_board(pad.x, pad.y)
            width, height = (pad.width, pad.height)[:: 1 if self.turn % 2 == 0 else -1]
            yield replace(pad, x=x, y=y, width=width, height=height)


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A straight piece of copper."""

    net: str
    face: Face
    start: Point
    end: Point
    width: float
    """mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Via:
    """A plated hole from face to face, covered by the mask."""

    net: str
    x: float
    y: float


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepOut:
    """A round area of one face on which something else stands."""

    what: str
    """What stands there, as a message names it."""
    face: Face
    x: float
    y: float
    radius: float
    """mm."""
    vias: bool
    """Whether covered vias may lie under it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stiffener:
    """A glued-on plate of glass-epoxy that keeps a flexible circuit flat under its solder."""

    face: Face
    left: float
    low: float
    right: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """A board that can be made."""

    name: str
    """Name of its files."""
    circuit: Circuit
    outline: Floats
    """(K, 2), mm: corners, counter-clockwise."""
    thickness: float
    """mm."""
    placed: tuple[Placed, ...]
    tracks: tuple[Track, ...]
    vias: tuple[Via, ...] = ()
    holes: tuple[tuple[float, float, float], ...] = ()
    """Unplated holes: middle and diameter, mm."""
    keep_outs: tuple[KeepOut, ...] = ()
    stiffeners: tuple[Stiffener, ...] = ()
    bends: tuple[tuple[float, float, float, float], ...] = ()
    """Rectangles (left, low, right, high), mm, that are bent for use: tracks alone lie there."""

    @property
    def flexible(self) -> bool:
        """Whether it is a circuit of polyimide film."""
        return self.thickness <= FLEXIBLE

    def faces_of(self, placed: Placed, pad: Pad) -> tuple[Face, ...]:
        """Faces on which a pad's copper lies."""
        return ("F", "B") if pad.hole else (placed.face,)


FLEXIBLE = 0.3
"""mm: thickest board that is a flexible circuit."""
THINNEST = 0.8
"""mm: thinnest board that is a rigid one."""


def rounded(corners: Sequence[Point], radius: float) -> Floats:
    """A polygon with its corners rounded by short edges, (K, 2), mm; counter-clockwise."""
    points = np.asarray(corners, dtype=float)
    out = []
    for before, at, after in zip(
        np.roll(points, 1, axis=0), points, np.roll(points, -1, axis=0), strict=True
    ):
        back, on = before - at, after - at
        reach = min(radius, np.linalg.norm(back) / 2, np.linalg.norm(on) / 2)
        back, on = back / np.linalg.norm(back), on / np.linalg.norm(on)
        middle = at + reach * (back + on)
        for k in range(7):
            angle = k / 6 * np.pi / 2
            out.append(middle - reach * (np.sin(angle) * back + np.cos(angle) * on))
    return np.round(np.array(out), 4)
