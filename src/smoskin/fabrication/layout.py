"""Places of the parts that a design does not place: columns, chips, magnets and pillars.

z = 0 is the surface of the bottom vertices, x and y those of the sheet, metres. On a limb parts are
laid out flat, as the board is before it is rolled on to its shell, with true lengths at a level, by
default the board's; heights are as they are. On a planar skin every level is the same.
"""

from typing import Any

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import Magnet, SkinDesign
from smoskin.errors import DesignError
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import board_box, laid_flat, shell_thickness


def pose(design: SkinDesign, developed: Any) -> Floats:
    """Pose (3, 4) of a solid drawn over the origin: upright at a developed place."""
    roll = geometry(design).roll
    x, y = float(developed[0]), float(developed[1])
    return np.concatenate([roll.axes(y), roll.places([x, y, 0.0])[:, None]], axis=1)


def column_places(design: SkinDesign) -> Floats:
    """Places of the columns on the board, (C, 2), m."""
    return laid_flat(design, columns_developed(design))


def columns_developed(design: SkinDesign) -> Floats:
    """Developed places of the columns, (C, 2), m, without those whose place a magnet takes."""
    skin = geometry(design)
    places = skin.developed[skin.sheet.columns.ravel(), :2]
    there = np.ones(len(places), dtype=bool)
    for magnet, at in zip(design.magnets, skin.magnet_places, strict=True):
        if magnet.mount == "sheet" and magnet.driver == "vertex":
            there[np.linalg.norm(places - at, axis=1).argmin()] = False
    return places[there]


def chip_places(design: SkinDesign) -> Floats:
    """Places of the chips on the board, (S, 2), m."""
    skin = geometry(design)
    names = [magnet.name for magnet in design.magnets]
    watched = [names.index(site.magnet) for site in design.halls]
    return laid_flat(design, skin.magnet_places[watched])


def chip_rows(design: SkinDesign) -> list[tuple[float, float]]:
    """Developed y of each chip, m, and the angle, rad, of its generator on the flat board."""
    roll = geometry(design).roll
    arcs = roll.developed(geometry(design).chips)[:, 1].round(9)
    return list(zip(arcs.tolist(), roll.flat_turn(arcs).tolist(), strict=True))


def magnet_height(design: SkinDesign, magnet: Magnet) -> float:
    """Height of a magnet's middle, m.

    On a limb the base's magnet stands higher than in `geometry` by the shell: its chip lies in the
    shell's window under the film and not under the shell, and keeps its gap.
    """
    skin = geometry(design)
    k = design.magnets.index(magnet)
    height = float(skin.roll.developed(skin.magnets[k])[2])
    return height + (shell_thickness(design) if magnet.mount == "base" else 0.0)


def pillar_places(design: SkinDesign) -> Floats:
    """Middles of the shear layer's pillars, (P, 2), m, evenly round and clear of magnets and chips.

    Pillars stand in rows as near to square as their number allows; one that would meet a base
    magnet's pocket or a chip on the board's lower face moves straight away from it.

    Raises
    ------
    DesignError
        If pillars run into each other, or stand beside the board.
    """
    skin = geometry(design)
    count, extent = design.shear_layer.pillars, skin.extent
    rows = max(1, round(float(np.sqrt(count * extent[1] / extent[0]))))
    sizes = [len(part) for part in np.array_split(np.arange(count), rows)]
    places = [
        ((k + 0.5) / size * extent[0], (row + 0.5) / rows * extent[1])
        for row, size in enumerate(sizes)
        for k in range(size)
    ]
    moved = laid_flat(design, np.array(places))
    middles = laid_flat(design, skin.magnet_places)
    for magnet, at in zip(design.magnets, middles, strict=True):
        if magnet.mount != "base":
            continue
        room = magnet.radius + design.shear_layer.radius + 2e-3
        off = moved - at
        apart = np.linalg.norm(off, axis=1)
        near = apart < room
        away = np.where(apart[near, None] > 1e-9, off[near], [1.0, 0.0])
        away = away / np.linalg.norm(away, axis=1, keepdims=True)
        moved[near] = at + room * away
    _check_pillars(design, moved)
    return moved


def _check_pillars(design: SkinDesign, places: Floats) -> None:
    """Refuse pillars that run into each other or stand beside the board."""
    wide = 2 * design.shear_layer.radius
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    apart[np.diag_indices(len(places))] = np.inf
    if apart.min() < wide:
        raise DesignError(
            f"the shear layer's pillars must stand {1e3 * wide:.2f} mm apart, their diameter; got "
            f"{1e3 * float(apart.min()):.2f} mm: take fewer or thinner ones"
        )
    low, _, high, _ = board_box(design).wider(-wide / 2).corners
    if not ((places >= low) & (places <= high)).all():
        raise DesignError(
            f"the shear layer's pillars must stand under the board, {1e3 * wide / 2:.2f} mm within "
            "its edge; got one outside: take thinner pillars or another place for the base's magnet"
        )
