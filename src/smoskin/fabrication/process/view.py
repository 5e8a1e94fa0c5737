"""The assembled skin as a page with a slider that takes it apart, one file, nothing from outside.

Decides which parts move together and in which order they come apart, that of assembly.
"""

from collections.abc import Collection, Sequence
from typing import Final

from smoskin.fabrication.moulds.solids import Part, joined_mesh
from smoskin.fabrication.process.pictures import COLOURS
from smoskin.space import Body, page

_LEVELS: Final = (
    ("base", -2.0, ("base", "plug")),
    ("magnets of the base", -1.5, ("sunk",)),
    ("pillars", -1.0, ("pillar",)),
    ("carrier shell", -0.5, ("shell",)),
    ("board", 0.0, ("board",)),
    ("chips", 0.0, ("chip",)),
    ("frame", 0.6, ("frame",)),
    ("columns", 1.2, ("column",)),
    ("holders", 2.0, ("holder",)),
    ("magnets", 2.0, ("magnet",)),
    ("panels below the film", 3.0, ("lower",)),
    ("panels above the film", 3.6, ("upper",)),
    ("scales", 4.6, ("scale",)),
    ("guide of the covers", 4.2, ("guide",)),
    ("covers", 5.4, ("cover",)),
)
"""What moves together, how far it is lifted, and which parts it has."""
LARGEST: Final = 150
"""Cells of the largest skin whose page a browser loads at once."""


def view(parts: Sequence[Part], title: str, sunk: Collection[str] = ()) -> bytes:
    """The page of an assembled skin; magnets of such names lie in the base."""
    bodies = []
    for name, level, kinds in _LEVELS:
        mine = [part for part in parts if _kind(part, sunk) in kinds]
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


def _kind(part: Part, sunk: Collection[str]) -> str:
    """Kind of a part; magnets in the base are sunk."""
    kind, _, name = part.name.partition("_")
    return "sunk" if kind == "magnet" and name in sunk else kind
