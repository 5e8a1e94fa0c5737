"""The assembled skin as a page with a slider that takes it apart, one file, nothing from outside.

Decides which parts move together and in which order they come apart, that of assembly.
"""

from collections.abc import Sequence
from typing import Final

from smoskin.fabrication.moulds.solids import Part, joined_mesh
from smoskin.fabrication.process.pictures import COLOURS
from smoskin.space import Body, page

_LEVELS: Final = (
    ("base", -2.0, ("base", "plug")),
    ("magnets of the base", -1.5, ("sunk",)),
    ("pillars", -1.0, ("pillar",)),
    ("board", 0.0, ("board",)),
    ("chips", 0.0, ("chip",)),
    ("frame", 0.6, ("frame",)),
    ("columns", 1.2, ("column",)),
    ("holders", 2.0, ("holder",)),
    ("magnets", 2.0, ("magnet",)),
    ("panels below the film", 3.0, ("lower",)),
    ("panels above the film", 3.6, ("upper",)),
    ("scales", 4.6, ("scale",)),
)
"""What moves together, how far it is lifted, and which parts it has."""
LARGEST: Final = 150
"""Cells of the largest skin whose page a browser loads at once."""


def view(parts: Sequence[Part], title: str) -> bytes:
    """The page of an assembled skin."""
    bodies = []
    floor = min(float(p.solid.bounding_box()[2]) for p in parts if p.name.startswith("pillar"))
    for name, level, kinds in _LEVELS:
        mine = [part for part in parts if _kind(part, floor) in kinds]
        if not mine:
            continue
        vertices, triangles = joined_mesh(mine)
        bodies.append(
            Body(
                name=name,
                level=level,
                colour=COLOURS[kinds[0]],
                frames=vertices[None],
                triangles=triangles,
            )
        )
    return page(bodies, title, "apart")


def _kind(part: Part, floor: float) -> str:
    """Kind of a part; magnets below the base's face, m, are sunk."""
    kind = part.name.split("_")[0]
    sunk = kind == "magnet" and float(part.solid.bounding_box()[5]) <= floor + 1e-9
    return "sunk" if sunk else kind
