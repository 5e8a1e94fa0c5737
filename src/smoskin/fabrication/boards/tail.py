"""The slack tail from the floating board to its base: its flat circuit and how little it holds.

Decides its shape: two legs at a right angle, each formed into a hump, so that motion along x bends
one hump and motion along y the other. Its solder holes lie over the boards' lands.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.materials import FILMS
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.boards import parts
from smoskin.fabrication.boards.circuit import tail_circuit
from smoskin.fabrication.boards.layout import Layout, Placed, Point, Track, rounded
from smoskin.fabrication.boards.rules import BEND_RATIO
from smoskin.mechanics.board import board_of

SHARE: Final = 0.05
"""Most of the shear layer's stiffness that the tail may add."""
THICKNESS: Final = 0.11
"""mm: film of 25 um, adhesive of 15 um and cover films of 27.5 um with 12 um of copper between."""
_COPPER: Final = (0.012, 0.0335)
"""mm: thickness of the copper and its distance from the middle plane; one face alone has any."""
_COPPER_MODULUS: Final = 117e9
"""Pa: Young's modulus of copper foil."""
_WIDTH, _PITCH, _LINE = 3.7, 0.5, 0.2
"""mm: width of the tail's legs, pitch and width of its lines."""
_FLAT: Final = 3.0
"""mm: straight ends of a leg."""
_CORNER: Final = 5.0
"""mm: radius of the corner between the legs, in the tail's plane."""
_FAN: Final = 4.0
"""mm: length over which the lines spread to the lands' pitch."""
_RADII: Final = tuple(np.arange(4.0, 12.5, 0.5))
"""mm: radii of the humps that are tried."""
_STEPS: Final = 120
"""Points of a piece at which its bending is summed."""
_END: Final = (3.2, 8.4)
"""mm: length and width of the ends with the solder holes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tail:
    """A tail soft enough for a design."""

    radius: float
    """mm: radius to which its humps are formed."""
    stiffness: float
    """N/m: largest against a sideways motion of the board."""
    share: float
    """Stiffness over that of the shear layer."""

    @property
    def leg(self) -> float:
        """Flat length of a leg, mm."""
        return round(2 * _FLAT + 2 * np.pi * self.radius, 3)


def tail_of(design: SkinDesign) -> Tail:
    """The tail with the tightest humps that a design admits.

    Raises
    ------
    DesignError
        If even the widest humps hold the board too much.
    """
    layer = float(board_of(design).stiffness[0])
    for radius in _RADII:
        stiffness = float(np.linalg.eigvalsh(tail_stiffness(radius * 1e-3)[:2, :2])[-1])
        tail = Tail(radius=float(radius), stiffness=stiffness, share=stiffness / layer)
        if tail.share <= SHARE and radius >= BEND_RATIO * THICKNESS:
            return tail
    raise DesignError(
        f"the tail must hold the board with at most {SHARE:.0%} of the shear layer's "
        f"{layer:.3g} N/m; got {stiffness:.3g} N/m with humps of {_RADII[-1]:g} mm"
    )


def section() -> tuple[float, float, float]:
    """Stiffness of the tail's section, N m2: bent over its face, over its edge, and twisted.

    Notes
    -----
    A composite beam: film and adhesive taken as film throughout, which is stiffer than they are,
    and copper in the lines of one face, about their common neutral axis; the twist is the film's,
    as lines with gaps between them carry no shear across.
    """
    film = FILMS["polyimide"]
    width, thickness = _WIDTH * 1e-3, THICKNESS * 1e-3
    copper, offset = _COPPER[0] * 1e-3, _COPPER[1] * 1e-3
    lines = len(parts.TAIL_NETS) * _LINE * 1e-3
    pull, pull_copper = film.young_modulus * width * thickness, _COPPER_MODULUS * lines * copper
    face = film.young_modulus * width * thickness**3 / 12
    face += _COPPER_MODULUS * lines * copper**3 / 12
    face += pull * pull_copper / (pull + pull_copper) * offset**2
    edge = film.young_modulus * thickness * width**3 / 12 + pull_copper * width**2 / 12
    shear = film.young_modulus / (2 * (1 + film.poisson_ratio))
    return face, edge, shear * width * thickness**3 / 3


Piece = tuple[float, float, Literal["straight", "face", "plane"]]
"""A piece of a formed strip: degrees of its bend (0 where it is straight), its radius (or length),
m, and whether it bends over its face or in its plane."""


def tail_stiffness(radius: float) -> Floats:
    """Stiffness of a tail with humps of a radius, m, against motion of the board, (3, 3), N/m."""
    hump: list[Piece] = [(90, radius, "face"), (-180, radius, "face"), (90, radius, "face")]
    flat: Piece = (0, _FLAT * 1e-3, "straight")
    corner: Piece = (90, _CORNER * 1e-3, "plane")
    return strip_stiffness([flat, *hump, flat, corner, flat, *hump, flat], section())


def strip_stiffness(pieces: Sequence[Piece], rigidity: tuple[float, float, float]) -> Floats:
    """Stiffness of a formed strip against motion of its end without turning, (3, 3), N/m.

    Parameters
    ----------
    pieces : sequence of Piece
        From the moved end, which points along -x with its face upwards, to the held one.
    rigidity : tuple of float
        Over the face, over the edge and in twist, N m2.

    Notes
    -----
    A thin curved beam, free of load as formed. Its flexibility is the integral of B^T D B along
    it (unit loads; Timoshenko, Strength of Materials), of bending and twist alone; its inverse is
    the stiffness.

    Examples
    --------
    A straight strip of 10 mm and 1e-6 N m2 resists a lift of its end by 12 EI / L^3:

    >>> stiffness = strip_stiffness([(0, 10e-3, "straight")], (1e-6, 1e-3, 1e-6))
    >>> round(float(stiffness[2, 2]), 2)
    12.0
    """
    face, edge, twist = rigidity
    place, frame = np.zeros(3), np.array([[-1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]])
    flexibility = np.zeros((6, 6))
    for angle, size, about in pieces:
        length = abs(np.radians(angle)) * size if angle else size
        step, turn = length / _STEPS, np.radians(angle) / _STEPS / 2
        for _ in range(_STEPS):
            frame = _turned(frame, turn, about)
            tangent, normal, across = frame
            bend = (
                np.outer(tangent, tangent) / twist
                + np.outer(across, across) / face
                + np.outer(normal, normal) / edge
            )
            x, y, z = -(place + tangent * step / 2)
            moment = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            load = np.hstack([moment, np.eye(3)])
            flexibility += load.T @ bend @ load * step
            place = place + tangent * step
            frame = _turned(frame, turn, about)
    # Straight strips are rigid along themselves here: no pull, only bending and twist.
    return np.asarray(np.linalg.pinv(flexibility, rcond=1e-14)[:3, :3])


def _turned(frame: Floats, angle: float, about: str) -> Floats:
    """Tangent, normal and width's direction after a bend over the face or in the plane."""
    tangent, normal, across = frame
    c, s = np.cos(angle), np.sin(angle)
    if about == "face":
        return np.array([c * tangent + s * normal, c * normal - s * tangent, across])
    if about == "plane":  # to the left, seen from above
        left = np.cross(normal, tangent)
        turned = c * tangent + s * left
        return np.array([turned, normal, np.cross(turned, normal)])
    return frame


def tail_layout(tail: Tail) -> Layout:
    """The tail's flat circuit; its first solder hole's row stands at the origin, mm."""
    leg, many = tail.leg, len(parts.TAIL_NETS)
    start = -_END[0] / 2 - _FAN
    turn = start - leg  # x at which the corner begins
    low = -_CORNER - leg  # y at which the second leg ends
    tracks = []
    for j, net in enumerate(parts.TAIL_NETS):
        wide, narrow = (j - (many - 1) / 2) * parts.TAIL_PITCH, (j - (many - 1) / 2) * _PITCH
        points: list[Point] = [(0.0, wide), (-_END[0] / 2, wide), (start, narrow), (turn, narrow)]
        angles = np.radians(np.arange(97.5, 180.0, 7.5))
        reach = _CORNER + narrow
        points += [
            (float(turn + reach * np.cos(a)), float(-_CORNER + reach * np.sin(a))) for a in angles
        ]
        x, x_wide = turn - _CORNER - narrow, turn - _CORNER - wide
        end = low - _FAN
        points += [(x, -_CORNER), (x, low), (x_wide, end), (x_wide, end - _END[0] / 2)]
        points = [(round(a, 4), round(b, 4)) for a, b in points]
        tracks += [
            Track(net=net, face="B", start=a, end=b, width=_LINE) for a, b in pairwise(points)
        ]
    # The two grounds meet on the free face, beside the first row of holes.
    first, last = (
        round((j - (many - 1) / 2) * parts.TAIL_PITCH, 4)
        for j, net in enumerate(parts.TAIL_NETS)
        if net == "GND"
    )
    ground = [(0.0, first), (0.85, first), (0.85, last), (0.0, last)]
    tracks += [Track(net="GND", face="F", start=a, end=b, width=_LINE) for a, b in pairwise(ground)]
    ends = {c.reference: c for c in tail_circuit().components}
    foot = round(low - _FAN - _END[0] / 2, 4)
    across = round(turn - _CORNER, 4)
    half = _WIDTH / 2
    return Layout(
        name="tail",
        circuit=tail_circuit(),
        outline=_outline(start, turn, low, foot, across),
        thickness=THICKNESS,
        placed=(
            Placed(component=ends["J1"], x=0.0, y=0.0, face="F"),
            Placed(component=ends["J2"], x=across, y=foot, face="F", turn=1),
        ),
        tracks=tuple(tracks),
        bends=(
            (turn + _FLAT, -half, start - _FLAT, half),
            (across - half, low + _FLAT, across + half, -_CORNER - _FLAT),
        ),
    )


def _outline(start: float, turn: float, low: float, foot: float, across: float) -> Floats:
    """Corners of the flat tail, counter-clockwise, with wide ends."""
    half, wide, end = _WIDTH / 2, _END[1] / 2, _END[0] / 2
    arc = np.radians(np.arange(90.0, 180.1, 7.5))
    outer = [
        (turn + (_CORNER + half) * np.cos(a), -_CORNER + (_CORNER + half) * np.sin(a)) for a in arc
    ]
    inner = [
        (turn + (_CORNER - half) * np.cos(a), -_CORNER + (_CORNER - half) * np.sin(a))
        for a in arc[::-1]
    ]
    leg_end = low - _FAN
    head = rounded(
        [
            (turn, -half),
            (start, -half),
            (-end, -wide),
            (end, -wide),
            (end, wide),
            (-end, wide),
            (start, half),
            (turn, half),
        ],
        0.4,
    )
    heel = rounded(
        [
            (across - half, -_CORNER),
            (across - half, low),
            (across - wide, leg_end),
            (across - wide, foot - end),
            (across + wide, foot - end),
            (across + wide, leg_end),
            (across + half, low),
            (across + half, -_CORNER),
        ],
        0.4,
    )
    corner = len(head) // 8  # points of one corner; the outermost are those of the legs
    head, heel = head[corner:-corner], heel[corner:-corner]
    return np.round(np.concatenate([head, outer, heel, inner]), 4)
