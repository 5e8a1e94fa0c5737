"""Where the magnets and chips of a skin stand at rest, in the skin's frame.

z = 0 is the plane of the bottom vertices; the board's upper face lies a column's height below.
A magnet on the sheet hangs above its chip on the board's upper face; a magnet on the base lies
below its chip on the lower face.
"""

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import HallSite, SkinDesign
from smoskin.origami.cell import size


def skin_extent(design: SkinDesign) -> Floats:
    """Length and width of the sensing area, shape (2,), m.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> (skin_extent(read_design("planar")) * 1e3).round(1)
    array([120., 160.])
    """
    cell = size(design.cell)
    return np.multiply(design.cells, [cell.length, cell.width])


def places_to_the_rim(extent: Floats, counts: tuple[int, int]) -> Floats:
    """A grid of places on a skin from rim to rim, shape (P, 2), m; y changes fastest."""
    lines = [np.linspace(0.0, end, count) for end, count in zip(extent, counts, strict=True)]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)


def middles_of_fields(extent: Floats, counts: tuple[int, int]) -> Floats:
    """The middles of as many equal fields of a skin, in the same order."""
    lines = [
        (np.arange(count) + 0.5) * end / count for end, count in zip(extent, counts, strict=True)
    ]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)


def chip_offset(design: SkinDesign, site: HallSite) -> float:
    """Height of a chip's sensing point over the middle of its magnet at rest, m.

    Negative for a magnet on the sheet, which hangs above its chip.
    """
    magnet = design.magnet(site.magnet)
    reach = site.gap + magnet.height / 2
    return -reach if magnet.mount == "sheet" else reach


def hall_positions(design: SkinDesign) -> Floats:
    """Sensing points of the chips at rest, shape (S, 3), m."""
    upper = -design.columns.height + design.board.sensing_height
    lower = -design.columns.height - design.board.thickness - design.board.sensing_height
    places = []
    for site in design.halls:
        magnet = design.magnet(site.magnet)
        x, y = _corner(design, magnet.corner)
        places.append([x, y, upper if magnet.mount == "sheet" else lower])
    return np.array(places)


def magnet_positions(design: SkinDesign) -> Floats:
    """Middles of the magnets at rest, shape (G, 3), m.

    A magnet that no chip watches lies as high as one of its mount that is watched.
    """
    heights = {
        design.magnet(site.magnet).name: place[2] - chip_offset(design, site)
        for site, place in zip(design.halls, hall_positions(design), strict=True)
    }
    by_mount = {design.magnet(name).mount: z for name, z in heights.items()}
    return np.array(
        [
            [*_corner(design, magnet.corner), heights.get(magnet.name, by_mount[magnet.mount])]
            for magnet in design.magnets
        ]
    )


def _corner(design: SkinDesign, corner: tuple[int, int]) -> tuple[float, float]:
    """A corner of the grid of cells, m."""
    extent = size(design.cell)
    return float(corner[0] * extent.length), float(corner[1] * extent.width)
