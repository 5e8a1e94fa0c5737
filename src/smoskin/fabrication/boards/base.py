"""The base's board: the microcontroller, the tail's lands at one edge and holes for its screws."""

from itertools import pairwise
from typing import Final

from smoskin.fabrication.boards.circuit import base_circuit
from smoskin.fabrication.boards.layout import Face, Layout, Placed, Point, Track, Via, rounded

_SIZE: Final = (44.0, 54.0)
"""mm."""
_PICO: Final = (13.0, 28.6)
"""mm: middle of the module, whose USB socket stands out over the upper edge."""
_LANDS: Final = (36.5, 51.0)
"""mm: middle of the tail's lands; the tail comes over the upper edge."""
_HOLES: Final = ((28.5, 3.5, 2.2), (40.5, 3.5, 2.2), (28.5, 50.5, 2.2), (40.5, 22.0, 2.2))
"""mm: for M2 screws."""
_LEVELS: Final = {"SDA": 38.76, "SCL": 36.22, "TRIG": 31.14, "+3V3": 42.57, "GND": 47.65}
"""mm: y of each net's line on the lower face, between the module's pins where it passes them."""
_WIDTHS: Final = {"TRIG": 0.3, "SDA": 0.3, "SCL": 0.3, "+3V3": 0.6, "GND": 0.6}


def base_layout() -> Layout:
    """Layout of the base's board; its origin is its low left corner, mm.

    Lines run along x on the lower face and along y on the upper one, with a via where they meet.
    """
    circuit = base_circuit()
    by = {component.reference: component for component in circuit.components}
    pico = Placed(component=by["A1"], x=_PICO[0], y=_PICO[1], face="F")
    lands = Placed(component=by["J2"], x=_LANDS[0], y=_LANDS[1], face="F", turn=1)
    tracks: list[Track] = []
    vias: list[Via] = []

    def way(net: str, face: Face, *points: Point) -> None:
        for start, end in pairwise(points):
            tracks.append(Track(net=net, face=face, start=start, end=end, width=_WIDTHS[net]))

    for pad in pico.on_board(pico.component.part.pads):
        net = pico.component.nets.get(pad.number)
        if net is None:
            continue
        level = _LEVELS[net]
        ends = [
            land.x
            for land in lands.on_board(lands.component.part.pads)
            if lands.component.nets[land.number] == net
        ]
        aside = round(pad.x + abs(pad.y - level), 6)
        way(
            net,
            "B",
            (pad.x, pad.y),
            *([(aside, level)] if aside > pad.x else []),
            (max(ends), level),
        )
        for x in ends:
            vias.append(Via(net=net, x=x, y=level))
            way(net, "F", (x, level), (x, lands.y))
    return Layout(
        name="base",
        circuit=circuit,
        outline=rounded([(0.0, 0.0), (_SIZE[0], 0.0), _SIZE, (0.0, _SIZE[1])], 2.0),
        thickness=1.6,
        placed=(pico, lands),
        tracks=tuple(tracks),
        vias=tuple(vias),
        holes=_HOLES,
    )
