"""The routing template of the floating board, for chips anywhere, turned by any quarter.

Every chip has the same module, with a ring of each net on the other face; a row's chips share five
lines, and all rows meet five at one edge, which lead to a tab with the tail's lands. On a cone
chips are parallel, and rows lie as generators do. Sides on which lines pass their chips, the same
for all rows of a face and then any, and the edge are tried in order.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations, pairwise, product
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import HallSite, SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.boards import parts
from smoskin.fabrication.boards.check import layout_faults
from smoskin.fabrication.boards.circuit import Circuit, Component, skin_circuit
from smoskin.fabrication.boards.layout import (
    FLEXIBLE,
    THINNEST,
    Face,
    KeepOut,
    Layout,
    Placed,
    Point,
    Stiffener,
    Track,
    Via,
    other,
    rounded,
)
from smoskin.fabrication.layout import chip_places, chip_rows, column_places, pillar_places
from smoskin.origami.outline import board_box, circuit_thickness

_RINGS: Final = {"TRIG": 2.4, "SDA": 3.0, "SCL": 3.6, "+3V3": 4.3, "GND": 4.95}
"""mm: half the side of each net's ring, from the innermost."""
_TAPS: Final = {"TRIG": 1.7, "SDA": 2.35, "SCL": 3.0, "+3V3": 3.7, "GND": 4.4}
"""mm: where a ring is left for its line, from the middle of its side, clockwise."""
_LINES: Final = {"TRIG": 5.65, "SDA": 6.3, "SCL": 6.95, "+3V3": 7.65, "GND": 8.35}
"""mm: from a row's middle to its lines."""
_TILTED: Final = {
    "TRIG": (2.7, 0.11),
    "SDA": (3.5, 0.13),
    "SCL": (4.3, 0.15),
    "+3V3": (5.1, 0.17),
    "GND": (5.9, 0.19),
}
"""mm: by how much every unit of a row's slope takes them nearer to vias beside them, and how much
of that there is to spare."""
_WIDTHS: Final = {"TRIG": 0.2, "SDA": 0.2, "SCL": 0.2, "+3V3": 0.4, "GND": 0.4}
"""mm: width of lines; rings and what leads to pins are 0.2."""
_THIN: Final = 0.2
_FANS: Final = (
    ("2", ((-1.475, 0.25), (-1.95, 0.25), (-2.25, 0.55), (-4.3, 0.55))),
    ("3", ((-1.475, -0.25), (-3.6, -0.25))),
    ("5", ((-0.75, -1.475), (-0.75, -3.0))),
    ("7", ((0.25, -1.475), (0.25, -2.05), (0.0, -2.3), (0.0, -2.4))),
    ("8", ((0.75, -1.475), (0.75, -2.0), (1.05, -2.3), (1.05, -2.5), (2.05, -2.5), (2.05, -4.3))),
    ("13", ((0.75, 1.475), (0.75, 2.85), (0.75, 4.95))),
    ("15", ((-0.25, 1.475), (-0.25, 2.1), (-0.75, 2.6), (-0.75, 2.85), (-0.75, 4.3))),
    ("11", ((1.475, 0.25), (0.0, 0.25))),
    ("12", ((1.475, 0.75), (1.95, 0.75), (2.4, 1.2), (0.0, 1.2))),
)
"""Pins and the way, in the chip's frame, from each to a via on its net's ring; a strap's last x is
that of its ring."""
_EXTRA: Final = (("17", ((0.75, 0.75), (0.75, 1.475))), ("13", ((1.05, -4.0), (1.05, -4.95))))
"""The pad in the middle, to VSS beside it; and the second capacitor's ground to its ring."""
_CAPACITORS: Final = ((0.0, 2.85, 0), (1.05, -3.25, -1))
"""Places of the two capacitors in the chip's frame and their quarter turns: pin 1 is the supply."""
_TRUNK: Final = {"TRIG": 1.0, "SDA": 1.7, "SCL": 2.4, "+3V3": 3.1, "GND": 3.9}
"""mm: from the board's edge to each line along it."""
_SWITCH: Final = {"TRIG": 4.75, "SDA": 5.25, "SCL": 4.75, "+3V3": 5.25, "GND": 4.75}
"""mm: from the edge to where lines of the upper face change to the lower one."""
_TAB: Final = (14.5, 9.6)
"""mm: length and width of the tab."""
_TAB_COLUMNS: Final = {"R2": 3.2, "R3": 6.4, "R1": 6.4, "C": 9.6, "J1": 13.0}
"""mm: from the edge to the middle of each part on the tab."""
_MODULE: Final = 10.7
"""mm: extent of a chip's module along x and y."""
_HOLE: Final = 2.2
"""mm: holes for M2 screws of nylon."""


def skin_layout(design: SkinDesign) -> Layout:
    """Layout of the floating board of a design.

    Raises
    ------
    DesignError
        If the board is neither rigid nor flexible, if a chip cannot lie on it as its axes say, or
        if no choice of the template keeps the rules; the message names the first broken one with
        its measure and limit.
    """
    thickness = round(circuit_thickness(design) * 1e3, 6)
    if FLEXIBLE < thickness < THINNEST:
        raise DesignError(
            f"board.thickness must be at most {FLEXIBLE} mm, a flexible circuit, or at least "
            f"{THINNEST} mm, a rigid board; got {thickness:g} mm"
        )
    if crowded := _crowded(design):
        raise DesignError(f"the board of {design.name!r} has no room: {crowded}")
    circuit, first = skin_circuit(design), None
    for sides, edge in product(_sides(sorted(set(_rows(design)))), (-1, 1)):
        layout = _Router(design, circuit, sides, edge).layout(thickness)
        faults = layout_faults(layout)
        if not faults:
            return layout
        first = first or faults[0]
    raise DesignError(f"the board of {design.name!r} has no room: {first}")


class _Row(NamedTuple):
    """A row of chips of a face that share their lines."""

    face: Face
    arc: float
    """m: their developed y."""
    slope: float
    """Slope of its lines on the flat board."""

    def line(self, net: str) -> float:
        """Way from its middle to a line, mm."""
        nearer, spare = _TILTED[net]
        return _LINES[net] + max(0.0, nearer * abs(self.slope) - spare)


def _rows(design: SkinDesign) -> list[_Row]:
    """The row of each chip."""
    faces: list[Face] = [
        "F" if design.magnet(site.magnet).mount == "sheet" else "B" for site in design.halls
    ]
    places = zip(faces, chip_rows(design), strict=True)
    return [_Row(face, arc, math.tan(turn)) for face, (arc, turn) in places]


def _sides(rows: list[_Row]) -> Iterator[dict[_Row, int]]:
    """Sides on which lines pass the chips of each row, those alike on a face first."""
    alike = [
        {row: up if row.face == "F" else down for row in rows}
        for up, down in product((-1, 1), (1, -1))
    ]
    any_side = (dict(zip(rows, s, strict=True)) for s in product((-1, 1), repeat=len(rows)))
    yield from alike
    yield from (sides for sides in any_side if sides not in alike)


def _crowded(design: SkinDesign) -> str:
    """Two chips whose modules overlap, in a sentence; empty where there are none."""
    chips = chip_places(design) * 1e3
    names = [site.name for site in design.halls]
    for i, j in combinations(range(len(names)), 2):
        apart = float(np.abs(chips[i] - chips[j]).max())
        if apart < _MODULE:
            return (
                f"chips {names[i]!r} and {names[j]!r} must stand {_MODULE:g} mm apart along x or y "
                f"for the routing template; got {apart:.3g} mm"
            )
    return ""


def _basis(site: HallSite, face: Face) -> int:
    """Quarter turns of a chip that lies on a face with its axes as the design says."""
    wanted = "+z" if face == "F" else "-z"
    if site.axes[2] != wanted:
        raise DesignError(
            f"hall site {site.name!r}.axes must have {wanted} last, as it lies on the board's "
            f"{'upper' if face == 'F' else 'lower'} face; got {site.axes}"
        )
    return ("+x", "+y", "-x", "-y").index(site.axes[0])


def _ring(places: list[Point], half: float) -> list[Point]:
    """The square ring through places on it, cut open where they lie farthest apart."""

    def along(place: Point) -> float:
        u, v = place
        if u >= half - 1e-9:
            return v + half
        if v >= half - 1e-9:
            return 3 * half - u
        return 5 * half - v if u <= 1e-9 - half else 7 * half + u

    whole = 8 * half
    marks = sorted((along(place), place) for place in places)
    steps = [(marks[k][0] - marks[k - 1][0]) % whole for k in range(len(marks))]
    first = int(np.argmax(steps))
    marks = marks[first:] + marks[:first]
    corners = [
        (0.0, (half, -half)),
        (2.0, (half, half)),
        (4.0, (-half, half)),
        (6.0, (-half, -half)),
    ]
    way = [(0.0, marks[0][1])]
    way += [((s - marks[0][0]) % whole, place) for s, place in marks[1:]]
    end = way[-1][0]
    for turns, corner in corners:
        if 0.0 < (s := (turns * half - marks[0][0]) % whole) < end:
            way.append((s, corner))
    return [place for _, place in sorted(way)]


@dataclass
class _Copper:
    """Copper as it is laid."""

    tracks: list[Track] = field(default_factory=list)
    vias: list[Via] = field(default_factory=list)

    def way(self, net: str, face: Face, points: list[Point], width: float = _THIN) -> None:
        """Tracks from point to point."""
        for start, end in pairwise(points):
            if start != end:
                self.tracks.append(Track(net=net, face=face, start=start, end=end, width=width))

    def via(self, net: str, place: Point) -> None:
        self.vias.append(Via(net=net, x=place[0], y=place[1]))


class _Router:
    """One choice of the template: on which side of its chips a row's lines pass, and the edge."""

    def __init__(
        self, design: SkinDesign, circuit: Circuit, sides: dict[_Row, int], edge: int
    ) -> None:
        self._design, self._circuit, self._sides = design, circuit, sides
        box = board_box(design)
        self._low, self._high = box.low * 1e3, box.high * 1e3
        self._far, self._edge = box.right * 1e3, box.left * 1e3
        if edge > 0:
            self._far, self._edge = self._edge, self._far
        self._inward = -edge
        self._by = {component.reference: component for component in circuit.components}
        self._copper = _Copper()
        self._placed: list[Placed] = []
        self._lines: dict[_Row, dict[str, list[Point]]] = {}
        self._trunk: dict[str, list[float]] = {net: [] for net in _TRUNK}

    def _in(self, distance: float) -> float:
        """A place's x so far inside the edge, mm."""
        return round(self._edge + self._inward * distance, 6)

    def layout(self, thickness: float) -> Layout:
        """The board of this choice, whether or not it keeps the rules."""
        chips = chip_places(self._design) * 1e3
        for k, (site, row) in enumerate(zip(self._design.halls, _rows(self._design), strict=True)):
            x, y = (round(float(c), 4) for c in chips[k, :2])
            part, turn = self._by[f"U{k + 1}"], _basis(site, row.face)
            chip = Placed(component=part, x=x, y=y, face=row.face, turn=turn)
            both = [self._by[f"C{2 * k + 1}"], self._by[f"C{2 * k + 2}"]]
            self._module(chip, both, row)
        for row, taps in sorted(self._lines.items()):
            self._row(row, taps)
        middle = self._tab()
        for net, reach in self._trunk.items():
            x = self._in(_TRUNK[net])
            self._copper.way(net, "F", [(x, min(reach)), (x, max(reach))], _WIDTHS[net])
        return Layout(
            name="skin",
            circuit=self._circuit,
            outline=self._outline(middle),
            thickness=thickness,
            placed=tuple(self._placed),
            tracks=tuple(self._copper.tracks),
            vias=tuple(self._copper.vias),
            holes=tuple(
                (round(x, 4), round(y, 4), _HOLE)
                for x in (self._in(3.0), self._far - 3.0 * self._inward)
                for y in (self._low + 3.0, self._high - 3.0)
            ),
            keep_outs=self._keep_outs(),
            stiffeners=self._stiffeners(middle) if thickness <= FLEXIBLE else (),
        )

    def _module(self, chip: Placed, capacitors: list[Component], row: _Row) -> None:
        """A chip, its capacitors, the rings and their taps to the lines of a row."""
        face, nets = chip.face, chip.component.nets
        self._placed.append(chip)
        for component, (u, v, turns) in zip(capacitors, _CAPACITORS, strict=True):
            x, y = chip.to_board(u, v)
            turn = chip.turn + (turns if face == "F" else -turns)
            self._placed.append(Placed(component=component, x=x, y=y, face=face, turn=turn % 4))
        used: dict[str, list[Point]] = {net: [] for net in _RINGS}
        for number, way in (*_FANS, *_EXTRA):
            net = nets[number]
            points = list(way)
            if points[-1][0] == 0.0 and number in ("11", "12"):
                points[-1] = (_RINGS[net], points[-1][1])
            self._copper.way(net, face, [chip.to_board(*point) for point in points])
            if number != "17":
                used[net].append(points[-1])
        n = next(
            n
            for n in ((1, 0), (0, 1), (-1, 0), (0, -1))
            if np.allclose(chip.to_board(*n), (chip.x, chip.y + self._sides[row]))
        )
        t = n[1], -n[0]
        for net, half in _RINGS.items():
            tap, line = (
                (n[0] * out + t[0] * _TAPS[net], n[1] * out + t[1] * _TAPS[net])
                for out in (half, row.line(net))
            )
            used[net].append(tap)
            end = chip.to_board(*line)
            self._copper.way(net, face, [chip.to_board(*tap), end])
            self._copper.via(net, end)
            self._lines.setdefault(row, {}).setdefault(net, []).append(end)
            for place in used[net]:
                self._copper.via(net, chip.to_board(*place))
            ring = [chip.to_board(*point) for point in _ring(used[net], half)]
            self._copper.way(net, other(face), ring, 0.3 if _WIDTHS[net] > _THIN else _THIN)

    def _row(self, row: _Row, taps: dict[str, list[Point]]) -> None:
        """The lines of a row's chips, and where they meet the trunk."""
        for net, ends in taps.items():
            far = max(ends, key=lambda end: abs(end[0] - self._edge))
            trunk, change = (
                (x, round(far[1] + row.slope * (x - far[0]), 6))
                for x in (self._in(_TRUNK[net]), self._in(_SWITCH[net]))
            )
            if row.face == "F":
                self._copper.way(net, "B", [trunk, far], _WIDTHS[net])
            else:
                self._copper.way(net, "F", [change, far], _WIDTHS[net])
                self._copper.via(net, change)
                self._copper.way(net, "B", [trunk, change], _WIDTHS[net])
            self._copper.via(net, trunk)
            self._trunk[net].append(trunk[1])

    def _tab_middle(self) -> float:
        """The tab's y: as near to the edge's middle as rows and chips allow, mm."""
        half = _TAB[1] / 2
        bands = [y for reach in self._trunk.values() for y in reach]
        chips = [(p.x, p.y) for p in self._placed if p.component.part is parts.MLX90393]
        near = self._in(-_TAB_COLUMNS["R2"] + 1.5)
        middle = (self._low + self._high) / 2
        reach = (self._high - self._low) / 2 - half - 6.0
        for k in range(int(2 * reach)):
            y = round(middle + (k + 1) // 2 * 0.5 * (1 if k % 2 else -1), 4)
            if all(abs(y - band) > half for band in bands) and all(
                np.hypot(near - x, max(abs(y - at) - half, 0.0)) > 10.0 for x, at in chips
            ):
                return y
        return middle

    def _tab(self) -> float:
        """The tab with the tail's lands, pull-ups and capacitor; gives y of its middle, mm."""
        middle = self._tab_middle()
        count = len(parts.TAIL_NETS)
        y = [
            round(middle + self._inward * (j - (count - 1) / 2) * parts.TAIL_PITCH, 6)
            for j in range(count)
        ]
        back = 0 if self._inward > 0 else 2  # the tab on the right is that on the left, turned
        land, stop = self._in(-_TAB_COLUMNS["J1"]), self._in(1.9 - _TAB_COLUMNS["J1"])
        self._placed.append(Placed(component=self._by["J1"], x=land, y=middle, face="F", turn=back))
        for j, net in enumerate(parts.TAIL_NETS):
            trunk = self._in(_TRUNK[net])
            self._copper.way(net, "B", [(trunk, y[j]), (stop, y[j])], _WIDTHS[net])
            self._copper.way(net, "F", [(stop, y[j]), (land, y[j])], _WIDTHS[net])
            self._copper.via(net, (trunk, y[j]))
            self._copper.via(net, (stop, y[j]))
            self._trunk[net].append(y[j])
        bulk = f"C{2 * len(self._design.halls) + 1}"
        for reference, pair, turn in (
            ("R2", (2, 3), 1),
            ("R3", (0, 1), 1),
            ("R1", (3, 4), 3),
            (bulk, (3, 5), 1),
        ):
            x = self._in(-_TAB_COLUMNS[reference if reference in _TAB_COLUMNS else "C"])
            at = round((y[pair[0]] + y[pair[1]]) / 2, 6)
            part = Placed(
                component=self._by[reference], x=x, y=at, face="F", turn=(turn + back) % 4
            )
            self._placed.append(part)
            for pad in part.on_board(part.component.part.pads):
                net = part.component.nets[pad.number]
                lines = y[pair[0]], y[pair[1]]
                line = lines[int(abs(lines[1] - pad.y) < abs(lines[0] - pad.y))]
                via = (round(x + self._inward * 1.05, 6), line)
                self._copper.way(net, "F", [(pad.x, pad.y), via])
                self._copper.via(net, via)
        return middle

    def _outline(self, middle: float) -> Floats:
        """Corners of the board with its tab."""
        low, high, half = self._low, self._high, _TAB[1] / 2
        tip = self._in(-_TAB[0])
        corners = [
            (self._edge, low),
            (self._far, low),
            (self._far, high),
            (self._edge, high),
            (self._edge, middle + half),
            (tip, middle + half),
            (tip, middle - half),
            (self._edge, middle - half),
        ]
        if self._inward < 0:  # counter-clockwise as well with the tab on the right
            corners.reverse()
        return rounded(corners, 2.0)

    def _keep_outs(self) -> tuple[KeepOut, ...]:
        """Feet of the columns on the upper face, pillars under the lower one."""
        feet, pillars = column_places(self._design) * 1e3, pillar_places(self._design) * 1e3
        radii = self._design.columns.radius * 1e3, self._design.shear_layer.radius * 1e3
        rows: tuple[tuple[str, Face, Floats, float, bool], ...] = (
            ("a column's foot", "F", feet, radii[0], False),
            ("a pillar", "B", pillars, radii[1], True),
        )
        return tuple(
            KeepOut(
                what=what,
                face=face,
                x=round(float(x), 4),
                y=round(float(y), 4),
                radius=radius,
                vias=vias,
            )
            for what, face, places, radius, vias in rows
            for x, y in places
        )

    def _stiffeners(self, middle: float) -> tuple[Stiffener, ...]:
        """Plates opposite every chip's module and under the tab."""
        plates = [
            Stiffener(
                face=other(p.face), left=p.x - 5.4, low=p.y - 5.4, right=p.x + 5.4, high=p.y + 5.4
            )
            for p in self._placed
            if p.component.part is parts.MLX90393
        ]
        ends = sorted((self._in(-_TAB[0] + 0.5), self._in(4.6)))
        low, high = middle - _TAB[1] / 2 + 0.5, middle + _TAB[1] / 2 - 0.5
        plates.append(Stiffener(face="B", left=ends[0], low=low, right=ends[1], high=high))
        return tuple(plates)
