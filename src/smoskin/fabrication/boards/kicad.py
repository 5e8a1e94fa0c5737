"""Boards and schematics as KiCad files (S-expressions), which KiCad 6 and newer open.

Decides nothing of the circuit. Hides the format: the sheet's y runs down, a part on the lower face
is written flipped, and every item has an id, taken here from the design so that files repeat.
"""

import math
import uuid
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Final

import numpy as np

from smoskin.fabrication.boards.circuit import GROUND, SUPPLY, Circuit, Component
from smoskin.fabrication.boards.layout import Layout, Placed, Point
from smoskin.fabrication.boards.parts import Pad, Part, Role
from smoskin.fabrication.boards.rules import MASK_MARGIN, house_of

_BOARD_FORMAT: Final = 20211014
_SCHEMATIC_FORMAT: Final = 20211123
_MORE_LAYERS: Final = (
    "B.Adhes F.Adhes B.Paste F.Paste B.SilkS F.SilkS B.Mask F.Mask Dwgs.User Cmts.User Eco1.User "
    "Eco2.User Edge.Cuts Margin B.CrtYd F.CrtYd B.Fab F.Fab User.1 User.2 User.3"
)
"""Layers from number 32 on."""
_STIFFENERS: Final = {"F": "User.1", "B": "User.2"}
"""Layers on which stiffeners are drawn; User.3 has the bends."""
_PIN_TYPES: Final[dict[Role, str]] = {
    "supply": "power_in",
    "ground": "power_in",
    "bus": "bidirectional",
    "input": "input",
    "output": "output",
    "strap": "input",
    "passive": "passive",
    "contact": "passive",
    "none": "no_connect",
}
_FONT: Final = "(effects (font (size 1.27 1.27)){})"
_PIN: Final = 2.54
"""mm: pitch of a symbol's pins, and their length."""
_CELL: Final = (71.12, 12.7)
"""mm: width of a column of symbols on the sheet, and room between two of them."""
MARK_WIDTH: Final = 0.15
"""mm: width of the printed mark beside pin 1."""


class _Ids:
    """Ids that depend on the design, the file and the item alone."""

    def __init__(self, seed: str, name: str) -> None:
        self._space = uuid.uuid5(uuid.NAMESPACE_URL, f"smoskin:{seed}:{name}")
        self._count = 0

    def of(self, item: str) -> str:
        """The id of a named item."""
        return str(uuid.uuid5(self._space, item))

    def next(self) -> str:
        """The id of the next of many items."""
        self._count += 1
        return self.of(f"item {self._count}")


def _n(value: float) -> str:
    """A number without noise digits."""
    return f"{value:.6f}".rstrip("0").rstrip(".") if value else "0"


def _text(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


class _Sheet:
    """From the skin's frame to the board file's, whose y runs down."""

    def __init__(self, layout: Layout) -> None:
        self._left = float(layout.outline[:, 0].min()) - 50.0
        self._top = float(layout.outline[:, 1].max()) + 50.0

    def at(self, point: Point) -> str:
        return f"{_n(round(point[0] - self._left, 6))} {_n(round(self._top - point[1], 6))}"


def board_file(layout: Layout, seed: str) -> str:
    """A board as the text of a ``.kicad_pcb`` file; `seed` is the design's hash."""
    ids, sheet, house = _Ids(seed, f"{layout.name}.kicad_pcb"), _Sheet(layout), house_of(layout)
    links = _Ids(seed, f"{layout.name}.kicad_sch")
    nets = {net: k + 1 for k, net in enumerate(layout.circuit.nets)}
    out = [
        f"(kicad_pcb (version {_BOARD_FORMAT}) (generator smoskin)",
        f"  (general (thickness {_n(layout.thickness)}))",
        '  (paper "A3")',
        f"  (title_block (title {_text('smoskin ' + layout.name)})",
        f"    (comment 1 {_text('design ' + seed[:12])}) (comment 2 {_text(house.name)})",
        f"    (comment 3 {_text(house.source)}))",
        "  (layers",
        '    (0 "F.Cu" signal) (31 "B.Cu" signal)',
        *(f'    ({k + 32} "{name}" user)' for k, name in enumerate(_MORE_LAYERS.split())),
        "  )",
        f"  (setup (pad_to_mask_clearance {MASK_MARGIN})",
        f"    (solder_mask_min_width {house.mask_bridge})",
        f"    (aux_axis_origin {sheet.at((0.0, 0.0))}))",
        '  (net 0 "")',
        *(f"  (net {number} {_text(net)})" for net, number in nets.items()),
    ]
    for placed in layout.placed:
        out += _footprint(placed, sheet, nets, ids, links)
    for k, (x, y, diameter) in enumerate(layout.holes):
        out += _screw_hole(k, sheet.at((x, y)), diameter, ids)
    out += _drawings(layout, sheet, ids)
    for track in layout.tracks:
        out.append(
            f"  (segment (start {sheet.at(track.start)}) (end {sheet.at(track.end)}) "
            f'(width {_n(track.width)}) (layer "{track.face}.Cu") (net {nets[track.net]}) '
            f"(tstamp {ids.next()}))"
        )
    for via in layout.vias:
        out.append(
            f"  (via (at {sheet.at((via.x, via.y))}) (size {_n(house.via)}) "
            f'(drill {_n(house.drill)}) (layers "F.Cu" "B.Cu") (net {nets[via.net]}) '
            f"(tstamp {ids.next()}))"
        )
    out += _keep_outs(layout, sheet, ids)
    return "\n".join([*out, ")", ""])


def _footprint(
    placed: Placed, sheet: _Sheet, nets: dict[str, int], ids: _Ids, links: _Ids
) -> Iterator[str]:
    """A component; on the lower face its frame is mirrored about x."""
    component, face, angle = placed.component, placed.face, 90 * (placed.turn % 4)
    flip = 1 if face == "F" else -1
    part = component.part
    mirror = " (justify mirror)" if face == "B" else ""
    text = f"(effects (font (size 1 1) (thickness 0.15)){mirror})"
    holed = any(pad.hole for pad in part.pads)
    kind = "through_hole" if holed else "smd"
    if not part.mounted:
        kind = "exclude_from_pos_files exclude_from_bom"
    yield f'  (footprint {_text("smoskin:" + part.name)} (layer "{face}.Cu")'
    at = sheet.at((placed.x, placed.y))
    yield f"    (tstamp {ids.of(component.reference)}) (at {at} {angle})"
    yield f"    (path {_text('/' + links.of(component.reference))}) (attr {kind})"
    height = part.body[1] / 2 + 1.0
    for what, value, y in (
        ("reference", component.reference, -height),
        ("value", component.value, height),
    ):
        yield (
            f"    (fp_text {what} {_text(value)} (at 0 {_n(y * flip)} {angle}) "
            f'(layer "{face}.Fab") {text} (tstamp {ids.next()}))'
        )
    x, y = part.body[0] / 2, part.body[1] / 2
    corners = [(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)]
    lines = [(f"{face}.CrtYd", 0.05, corners)]
    lines.append((f"{face}.SilkS", MARK_WIDTH, list(part.mark)))
    for layer, width, points in lines:
        for (a, b), (c, d) in pairwise(points):
            yield (
                f"    (fp_line (start {_n(a)} {_n(-b * flip)}) (end {_n(c)} {_n(-d * flip)}) "
                f'(layer "{layer}") (width {_n(width)}) (tstamp {ids.next()}))'
            )
    for pad in part.pads:
        net = component.nets.get(pad.number)
        joined = f" (net {nets[net]} {_text(net)})" if net else ""
        yield _pad(pad, face, flip, angle, joined, ids)
    for pad in part.paste_pads:
        yield (
            f'    (pad "" smd rect (at {_n(pad.x)} {_n(-pad.y * flip)} {angle}) '
            f'(size {_n(pad.width)} {_n(pad.height)}) (layers "{face}.Paste") '
            f"(tstamp {ids.next()}))"
        )
    yield "  )"


def _pad(pad: Pad, face: str, flip: int, angle: int, net: str, ids: _Ids) -> str:
    at = f"(at {_n(pad.x)} {_n(-pad.y * flip)} {angle}) (size {_n(pad.width)} {_n(pad.height)})"
    if pad.hole:
        return (
            f"    (pad {_text(pad.number)} thru_hole circle {at} (drill {_n(pad.hole)}) "
            f'(layers "*.Cu" "*.Mask"){net} (tstamp {ids.next()}))'
        )
    paste = f' "{face}.Paste"' if pad.paste else ""
    return (
        f'    (pad {_text(pad.number)} smd rect {at} (layers "{face}.Cu" "{face}.Mask"{paste})'
        f"{net} (tstamp {ids.next()}))"
    )


def _screw_hole(k: int, at: str, diameter: float, ids: _Ids) -> Iterator[str]:
    text = "(effects (font (size 1 1) (thickness 0.15)))"
    around = diameter / 2 + 0.25
    yield '  (footprint "smoskin:Screw_hole" (layer "F.Cu")'
    yield f"    (tstamp {ids.of(f'hole {k}')}) (at {at})"
    yield "    (attr board_only exclude_from_pos_files exclude_from_bom)"
    for what, value, y in (("reference", f"H{k + 1}", -2.5), ("value", "M2, nylon", 2.5)):
        yield (
            f'    (fp_text {what} "{value}" (at 0 {_n(y)}) (layer "F.Fab") {text} '
            f"(tstamp {ids.next()}))"
        )
    yield (
        f'    (fp_circle (center 0 0) (end {_n(around)} 0) (layer "F.CrtYd") (width 0.05) '
        f"(fill none) (tstamp {ids.next()}))"
    )
    yield (
        f'    (pad "" np_thru_hole circle (at 0 0) (size {_n(diameter)} {_n(diameter)}) '
        f'(drill {_n(diameter)}) (layers "*.Cu" "*.Mask") (tstamp {ids.next()}))'
    )
    yield "  )"


def _drawings(layout: Layout, sheet: _Sheet, ids: _Ids) -> Iterator[str]:
    """Outline, stiffeners and bends."""

    def closed(points: Iterable[Point], layer: str, width: float) -> Iterator[str]:
        points = list(points)
        for start, end in zip(points, points[1:] + points[:1], strict=True):
            yield (
                f"  (gr_line (start {sheet.at(start)}) (end {sheet.at(end)}) "
                f'(layer "{layer}") (width {_n(width)}) (tstamp {ids.next()}))'
            )

    def box(left: float, low: float, right: float, high: float) -> list[Point]:
        return [(left, low), (right, low), (right, high), (left, high)]

    yield from closed([(float(x), float(y)) for x, y in layout.outline], "Edge.Cuts", 0.05)
    for plate in layout.stiffeners:
        corners = box(plate.left, plate.low, plate.right, plate.high)
        yield from closed(corners, _STIFFENERS[plate.face], 0.1)
        yield _note(
            "stiffener FR-4 0.2", (plate.left, plate.low - 1.2), _STIFFENERS[plate.face], sheet, ids
        )
    for bend in layout.bends:
        yield from closed(box(*bend), "User.3", 0.1)
        yield _note("bends here: lines alone", (bend[0], bend[1] - 1.2), "User.3", sheet, ids)


def _note(text: str, place: Point, layer: str, sheet: _Sheet, ids: _Ids) -> str:
    return (
        f'  (gr_text {_text(text)} (at {sheet.at(place)}) (layer "{layer}") (tstamp {ids.next()}) '
        "(effects (font (size 1 1) (thickness 0.15)) (justify left)))"
    )


def _keep_outs(layout: Layout, sheet: _Sheet, ids: _Ids) -> Iterator[str]:
    """Rule areas under what stands on the board, and where it bends."""
    for area in layout.keep_outs:
        reach = area.radius / math.cos(math.pi / 24)
        corners = [
            (area.x + reach * np.cos(a), area.y + reach * np.sin(a))
            for a in np.arange(24) * math.pi / 12
        ]
        vias = "allowed" if area.vias else "not_allowed"
        yield _rule_area(area.what, f"{area.face}.Cu", vias, corners, sheet, ids)
    for left, low, right, high in layout.bends:
        corners = [(left, low), (right, low), (right, high), (left, high)]
        for face in ("F", "B"):
            yield _rule_area("a bend", f"{face}.Cu", "not_allowed", corners, sheet, ids)


def _rule_area(
    what: str, layer: str, vias: str, corners: list[Point], sheet: _Sheet, ids: _Ids
) -> str:
    points = " ".join(f"(xy {sheet.at(corner)})" for corner in corners)
    return (
        f'  (zone (net 0) (net_name "") (layer "{layer}") (tstamp {ids.next()}) '
        f"(name {_text(what)}) (hatch edge 0.508) (connect_pads (clearance 0)) "
        f"(min_thickness 0.254) (keepout (tracks allowed) (vias {vias}) (pads not_allowed) "
        "(copperpour allowed) (footprints not_allowed)) "
        "(fill (thermal_gap 0.508) (thermal_bridge_width 0.508)) "
        f"(polygon (pts {points})))"
    )


def schematic_file(circuit: Circuit, seed: str) -> str:
    """A circuit as the text of a ``.kicad_sch`` file; nets are joined by labels at the pins."""
    ids = _Ids(seed, f"{circuit.name}.kicad_sch")
    out = [
        f"(kicad_sch (version {_SCHEMATIC_FORMAT}) (generator smoskin)",
        f"  (uuid {ids.of('sheet')})",
        '  (paper "A3")',
        f"  (title_block (title {_text('smoskin ' + circuit.name)})",
        f"    (comment 1 {_text('design ' + seed[:12])}))",
        "  (lib_symbols",
        *_symbols(circuit, "smoskin:"),
        "  )",
    ]
    paths = []
    x, y, lowest = 50.8, 38.1, 260.0
    for component in circuit.components:
        height = _half(component.part) * 2
        if y + height > lowest:
            x, y = x + _CELL[0], 38.1
        middle = (x, round((y + height / 2) / 1.27) * 1.27)
        out += _instance(component, middle, ids)
        y += height + _CELL[1]
        paths.append((component.reference, component.value, "smoskin:" + component.part.name))
    for k, net in enumerate((SUPPLY, GROUND)):
        out += _flag(k, net, (50.8 + k * 25.4, 276.86), ids)
        paths.append((f"#FLG{k + 1}", "PWR_FLAG", ""))
    out += ['  (sheet_instances (path "/" (page "1")))', "  (symbol_instances"]
    out += [
        f"    (path {_text('/' + ids.of(reference))} (reference {_text(reference)}) (unit 1) "
        f"(value {_text(value)}) (footprint {_text(footprint)}))"
        for reference, value, footprint in paths
    ]
    return "\n".join([*out, "  )", ")", ""])


def symbol_library(circuit: Circuit) -> str:
    """The symbols of a schematic as a library (``.kicad_sym``), so that KiCad finds them again."""
    head = f"(kicad_symbol_lib (version {_BOARD_FORMAT}) (generator smoskin)"
    return "\n".join([head, *_symbols(circuit, ""), ")", ""])


SYMBOL_TABLE: Final = (
    '(sym_lib_table\n  (lib (name "smoskin")(type "KiCad")'
    '(uri "${KIPRJMOD}/smoskin.kicad_sym")(options "")(descr ""))\n)\n'
)
"""A project's list of libraries (``sym-lib-table``)."""


def _symbols(circuit: Circuit, library: str) -> Iterator[str]:
    """Every symbol of a circuit; in a sheet its name has the library before it."""
    for part in {c.part.name: c.part for c in circuit.components}.values():
        yield from _symbol(part, library)
    yield from _flag_symbol(library)


def _rows(part: Part) -> tuple[list[str], list[str]]:
    """Pins on the left and on the right of a symbol, from the top."""
    numbers = list(part.pins)
    middle = (len(numbers) + 1) // 2
    return numbers[:middle], numbers[middle:]


def _half(part: Part) -> float:
    """Half the height of a symbol, mm."""
    return _PIN * (len(_rows(part)[0]) + 1) / 2


def _pin_places(part: Part) -> dict[str, tuple[float, float, int]]:
    """Ends of a symbol's pins, its y running up, and the direction from there to the body."""
    places = {}
    for numbers, x, angle in zip(_rows(part), (-15.24, 15.24), (0, 180), strict=True):
        top = _PIN * ((len(_rows(part)[0]) - 1) // 2)
        for k, number in enumerate(numbers):
            places[number] = (x, top - k * _PIN, angle)
    return places


def _symbol(part: Part, library: str) -> Iterator[str]:
    """A part's symbol."""
    half, font = _half(part) + _PIN / 2, _FONT.format("")
    yield f"    (symbol {_text(library + part.name)} (pin_names (offset 1.016))"
    yield "      (in_bom yes) (on_board yes)"
    yield from _properties(part.prefix, part.name, "", (0.0, 0.0), half)
    yield f"      (symbol {_text(part.name + '_0_1')}"
    yield (
        f"        (rectangle (start -12.7 {_n(half)}) (end 12.7 {_n(-half)}) "
        "(stroke (width 0.254) (type default) (color 0 0 0 0)) (fill (type background))))"
    )
    yield f"      (symbol {_text(part.name + '_1_1')}"
    for number, (x, y, angle) in _pin_places(part).items():
        name, role = part.pins[number]
        yield (
            f"        (pin {_PIN_TYPES[role]} line (at {_n(x)} {_n(y)} {angle}) (length {_PIN}) "
            f"(name {_text(name)} {font}) (number {_text(number)} {font}))"
        )
    yield "      )"
    yield "    )"


def _properties(
    reference: str, value: str, footprint: str, at: Point, half: float
) -> Iterator[str]:
    """The four fields that every symbol has."""
    x, y = at
    rows = (
        ("Reference", reference, y - half - 2.54, ""),
        ("Value", value, y + half + 2.54, ""),
        ("Footprint", footprint, y, " hide"),
        ("Datasheet", "", y, " hide"),
    )
    for k, (name, text, row, hide) in enumerate(rows):
        yield (
            f"      (property {_text(name)} {_text(text)} (id {k}) "
            f"(at {_n(x)} {_n(row)} 0) {_FONT.format(hide)})"
        )


def _instance(component: Component, at: Point, ids: _Ids) -> Iterator[str]:
    """A component on the sheet with a label at every connected pin; the others' type says so."""
    part, (x, y) = component.part, at
    yield f"  (symbol (lib_id {_text('smoskin:' + part.name)}) (at {_n(x)} {_n(y)} 0) (unit 1)"
    yield f"    (in_bom {'yes' if part.mounted else 'no'}) (on_board yes)"
    yield f"    (uuid {ids.of(component.reference)})"
    footprint = "smoskin:" + part.name
    half = _half(part) + _PIN / 2
    yield from _properties(component.reference, component.value, footprint, at, half)
    for number in part.pins:
        yield f"    (pin {_text(number)} (uuid {ids.next()}))"
    yield "  )"
    for number, (u, v, angle) in _pin_places(part).items():
        place = f"{_n(x + u)} {_n(y - v)}"
        net = component.nets.get(number)
        if net is not None:
            yield _label(net, place, angle, ids)


def _label(net: str, place: str, angle: int, ids: _Ids) -> str:
    turned, side = (180, "right") if angle == 0 else (0, "left")
    return (
        f"  (label {_text(net)} (at {place} {turned}) {_FONT.format(f' (justify {side} bottom)')} "
        f"(uuid {ids.next()}))"
    )


def _flag_symbol(library: str) -> Iterator[str]:
    """The mark that a net is supplied from outside."""
    yield f'    (symbol "{library}PWR_FLAG" (power) (pin_names (offset 0) hide)'
    yield "      (in_bom no) (on_board no)"
    yield from _properties("#FLG", "PWR_FLAG", "", (0.0, 0.0), 0.0)
    yield (
        '      (symbol "PWR_FLAG_0_0" (pin power_out line (at 0 0 90) (length 0) '
        f'(name "pwr" {_FONT.format("")}) (number "1" {_FONT.format("")}))))'
    )


def _flag(k: int, net: str, at: Point, ids: _Ids) -> Iterator[str]:
    place, reference = f"{_n(at[0])} {_n(at[1])}", f"#FLG{k + 1}"
    yield f'  (symbol (lib_id "smoskin:PWR_FLAG") (at {place} 0) (unit 1) (in_bom no) (on_board no)'
    yield f"    (uuid {ids.of(reference)})"
    yield from _properties(reference, "PWR_FLAG", "", at, 0.0)
    yield f'    (pin "1" (uuid {ids.next()})))'
    yield _label(net, place, 180, ids)
