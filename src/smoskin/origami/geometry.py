"""Places of everything of a skin at rest, in the skin's frame: computed once for a design.

Decides the heights of magnets and chips. z = 0 is the plane of the bottom vertices; the board's
upper face lies a column's height below. A magnet on the sheet hangs above its chip on the board's
upper face; a magnet on the base lies below its chip on the lower face. One in place of a column
stands under the bottom vertex next to its corner.
"""

from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np

from smoskin.arrays import Floats, freeze
from smoskin.design.skin import SkinDesign
from smoskin.origami.cell import CellSize, size
from smoskin.origami.sheet import Sheet, build_sheet

_DESIGNS = 64
"""Designs whose geometry is kept."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Geometry:
    """A design at rest; its arrays are read-only."""

    cell: CellSize
    """Extent of one cell, m."""
    extent: Floats
    """(2,), m: length and width of the sensing area."""
    sheet: Sheet
    """The folded sheet of all cells."""
    tops: Floats
    """(N, M, 2), m: place in the plane of each cell's loaded vertex."""
    magnets: Floats
    """(G, 3), m: middles of the magnets."""
    chips: Floats
    """(S, 3), m: sensing points of the chips."""
    rest: Floats
    """(S, 3), m: sensing point of each chip as seen from the middle of the magnet that it
    watches; it lies straight below a magnet on the sheet, straight above one on the base."""

    def __post_init__(self) -> None:
        places = (None, 3)
        freeze(self, extent=(2,), tops=(None, None, 2), magnets=places, chips=places, rest=places)
        for field in fields(self.sheet):
            getattr(self.sheet, field.name).flags.writeable = False


@lru_cache(maxsize=_DESIGNS)
def geometry(design: SkinDesign) -> Geometry:
    """Geometry of a design at rest.

    Notes
    -----
    A magnet that no chip watches lies as high as one of its mount that is watched.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> (geometry(read_design("planar")).extent * 1e3).round(1)
    array([120., 160.])
    """
    cell, sheet = size(design.cell), build_sheet(design.cell, design.cells)
    pitch = np.array([cell.length, cell.width])
    feet = sheet.vertices[sheet.columns.ravel(), :2]
    middles = {}
    for magnet in design.magnets:
        place = np.multiply(magnet.corner, pitch)
        if magnet.mount == "sheet" and magnet.driver == "vertex":
            place = feet[np.linalg.norm(feet - place, axis=1).round(9).argmin()]
        middles[magnet.name] = place
    upper = -design.columns.height + design.board.sensing_height
    lower = -design.columns.height - design.board.thickness - design.board.sensing_height
    chips, rest = np.empty((len(design.halls), 3)), np.zeros((len(design.halls), 3))
    heights = {}
    for s, site in enumerate(design.halls):
        magnet = design.magnet(site.magnet)
        on_sheet = magnet.mount == "sheet"
        reach = site.gap + magnet.height / 2
        chips[s] = *middles[magnet.name], upper if on_sheet else lower
        rest[s, 2] = -reach if on_sheet else reach
        heights[magnet.name] = chips[s, 2] - rest[s, 2]
    by_mount = {design.magnet(name).mount: height for name, height in heights.items()}
    magnets = [
        [*middles[magnet.name], heights.get(magnet.name, by_mount[magnet.mount])]
        for magnet in design.magnets
    ]
    return Geometry(
        cell=cell,
        extent=np.multiply(design.cells, pitch),
        sheet=sheet,
        tops=sheet.vertices[sheet.loaded, :2],
        magnets=np.array(magnets),
        chips=chips,
        rest=rest,
    )


def places_to_the_rim(extent: Floats, counts: tuple[int, int]) -> Floats:
    """A grid of places on a skin from rim to rim, shape (P, 2), m; y changes fastest."""
    return _grid([np.linspace(0.0, end, n) for end, n in zip(extent, counts, strict=True)])


def middles_of_fields(extent: Floats, counts: tuple[int, int]) -> Floats:
    """The middles of as many equal fields of a skin, in the same order."""
    return _grid([(np.arange(n) + 0.5) * end / n for end, n in zip(extent, counts, strict=True)])


def _grid(lines: list[Floats]) -> Floats:
    """Every place on two lines of coordinates, (P, 2)."""
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
