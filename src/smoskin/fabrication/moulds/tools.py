"""Moulds and jigs of a skin, each standing on z = 0 as it is made.

Decides that every mould is open enough to be emptied: columns are pushed out of a plate open at
both ends, so that they need no taper, which would cost lateral stiffness.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
import shapely
import shapely.affinity
from shapely import MultiPoint, Polygon

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.layout import chip_places, column_places, columns_developed
from smoskin.fabrication.moulds.assembly import frame_opening, pillar_height
from smoskin.fabrication.moulds.creasing import creasing_moulds
from smoskin.fabrication.moulds.roll import rolled
from smoskin.fabrication.moulds.sheet import cast_height, folded_panels, scale
from smoskin.fabrication.moulds.solids import (
    Part,
    Slab,
    box,
    disc,
    extruded,
    laid,
    prism,
    triangles_of,
)
from smoskin.fabrication.pattern.flat import FlatSheet
from smoskin.fabrication.pattern.sheets import carrier_size, pin_places
from smoskin.fabrication.workshop import MAGNET_TEMPERATURE, Workshop
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import Box, arcs_at, boxed, frame_box, frame_level, level_of

_RIM: Final = 4e-3
"""m: mould round its outermost cavity."""
_FLOOR: Final = 3e-3
"""m: plates of moulds and jigs."""
_OVER_DRIP: Final = 0.5e-3
"""m: fold jig over the columns' tops, clear of what is dripped on them."""
_SCALES: Final = 12
"""Scales cast at once at most."""


def tools(design: SkinDesign, workshop: Workshop, sheet: FlatSheet) -> list[Part]:
    """Every mould and jig.

    Raises
    ------
    DesignError
        If a wall would be thinner than the printer makes; the message has the measure.
    """
    return [
        *column_mould(design, workshop),
        pillar_mould(design, workshop),
        *foot_jig(design, workshop),
        *fold_jig(design, workshop, sheet),
        *creasing_moulds(design, workshop, sheet),
        laminating_plate(workshop, sheet),
        *([scale_mould(design, workshop)] if workshop.top == "scales" else []),
        *magnet_moulds(design, workshop),
    ]


def column_mould(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A plate with a hole for every column, the plate it stands on, and pins that empty it.

    Raises
    ------
    DesignError
        If the walls between columns are too thin.
    """
    places, radius = columns_developed(design), design.columns.radius
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    thin = float(apart[~np.eye(len(places), dtype=bool)].min()) - 2 * radius
    if thin < workshop.wall:
        raise DesignError(
            f"the column mould's walls must be at least {1e3 * workshop.wall:.2f} mm, what the "
            f"printer makes; got {1e3 * thin:.2f} mm between columns"
        )
    outline = _outline_of(places, radius + _RIM)
    holed = outline.difference(shapely.union_all([disc(place, radius) for place in places]))
    height = cast_height(design, workshop)
    pins = shapely.union_all([disc(place, radius - workshop.fit) for place in places])
    ejector = prism(outline, 0.0, _FLOOR) + prism(pins, 0.0, _FLOOR + height)
    return [
        Part(
            name="column_plate",
            title="mould of the columns, open at both ends",
            solid=prism(holed, 0.0, height),
            silicone=True,
        ),
        Part(
            name="column_floor",
            title="floor of the column mould",
            solid=prism(outline, 0.0, _FLOOR),
            silicone=True,
        ),
        Part(name="column_ejector", title="pins that push the columns out", solid=ejector),
    ]


def pillar_mould(design: SkinDesign, workshop: Workshop) -> Part:
    """A plate with a hole for every pillar of the shear layer, open at both ends."""
    count, radius = design.shear_layer.pillars, design.shear_layer.radius
    across = int(np.ceil(np.sqrt(count)))
    places = (2 * radius + _RIM) * np.array([divmod(k, across) for k in range(count)])
    holes = shapely.union_all([disc(place, radius) for place in places])
    return Part(
        name="pillar_mould",
        title="mould of the shear layer's pillars, open at both ends, on the columns' floor",
        solid=prism(
            _outline_of(places, radius + _RIM).difference(holes), 0.0, pillar_height(design)
        ),
        silicone=True,
    )


def foot_jig(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A plate on the board that places the columns' feet, chips in its windows.

    On a limb it comes in strips, a row of columns each: no whole one would come off them.
    """
    edge, own, roll = frame_level(design), level_of(design), geometry(design).roll
    opening = shapely.transform(
        frame_opening(design), lambda at: roll.flat(roll.from_flat(at, edge), own)
    )
    outline = opening.buffer(-workshop.fit, join_style="mitre")
    reach = design.columns.radius + workshop.fit
    windows: list[Any] = [disc(place, reach) for place in column_places(design)]
    for place in chip_places(design):
        windows.append(Polygon(place + 3e-3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])))
    outline = outline.difference(shapely.union_all(windows))
    foot = -design.columns.height
    title = "jig of the columns' feet, within the frame; lift it off before holders go in"
    rows = geometry(design).developed[geometry(design).sheet.columns][..., 1].mean(axis=0)
    between = (rows[1:] + rows[:-1]) / 2 if design.limb else np.empty(0)
    parts = []
    for name, piece in _strips(design, "foot_jig", outline, between, own, workshop):
        slab = Slab(_largest(piece), foot, foot + min(_FLOOR, design.columns.height / 3))
        parts.append(laid(rolled(design, extruded(name, title, slab, silicone=True))))
    return parts


def _largest(outline: Any) -> Any:
    """The largest piece of an outline."""
    return max(getattr(outline, "geoms", [outline]), key=lambda piece: piece.area)


def _strips(
    design: SkinDesign, name: str, outline: Any, rows: Floats, level: float, workshop: Workshop
) -> list[tuple[str, Any]]:
    """An outline at a level cut along rows, developed y, m, each strip with its name.

    It stays whole where there are no rows.
    """
    if not len(rows):
        return [(name, outline)]
    whole, gap = _box_round(design, outline, level).wider(1e-3), workshop.fit / 2
    ends = [whole.low, *arcs_at(design, rows, 0.0, level).tolist(), whole.high]
    strips = [replace(whole, low=a + gap, high=b - gap) for a, b in pairwise(ends)]
    return [
        (f"{name}_{k}", outline.intersection(Polygon(boxed(design, strip, level))))
        for k, strip in enumerate(strips, 1)
    ]


def _box_round(design: SkinDesign, outline: Any, level: float) -> Box:
    """The smallest box at a level round an outline that is laid flat there."""
    places = geometry(design).roll.from_flat(shapely.get_coordinates(outline), level)
    (left, low), (right, high) = places.min(axis=0).tolist(), places.max(axis=0).tolist()
    low, high = arcs_at(design, [low, high], 0.0, level).tolist()
    return Box(left=left, low=low, right=right, high=high)


def fold_jig(design: SkinDesign, workshop: Workshop, sheet: FlatSheet) -> list[Part]:
    """A ring on the frame's wall that holds the sheet folded until the drip has cured.

    It closes round the folded sheet; the frame stays, the jig is lifted off. On a limb it comes in
    halves, which are slid round the limb until they are clear of the sheet.
    """
    roll, own = geometry(design).roll, geometry(design).developed
    shadows = [Polygon(roll.flat(own[f, :2], 0.0)) for f in geometry(design).sheet.facets]
    at_rim = np.asarray(np.isin(sheet.facets, sheet.rim).any(axis=1))
    for panel in folded_panels(design, sheet, workshop, only=at_rim):
        corners = roll.developed(triangles_of(panel.solid)[0])
        shadows.append(MultiPoint(roll.flat(corners[:, :2], 0.0)).convex_hull)
    room = shapely.union_all(shadows).buffer(workshop.fit, join_style="mitre")
    if design.limb is not None:  # straight at the sides along which its halves slide
        rows = own[geometry(design).sheet.columns, 1]
        low, high = float(rows[:, 0].max()), float(rows[:, -1].min())
        clear = replace(_box_round(design, room, 0.0), low=low, high=high)
        room = room.union(Polygon(boxed(design, clear, 0.0)))
    outer, inner, wall = (
        Polygon(boxed(design, frame_box(design, 0.0).wider(by), 0.0))
        for by in (workshop.fit + 1.5e-3, workshop.fit, -3e-3)
    )
    lip, skirt = outer.difference(inner), outer.difference(wall)
    top, rest = float(own[:, 2].max()), frame_level(design)
    title = "jig that holds the folded sheet over its columns"
    parts = []
    halves = np.array([roll.middle] if design.limb else [])
    for name, piece in _strips(design, "fold_jig", outer, halves, 0.0, workshop):
        # Solids that are joined overlap: faces that only meet would stay two.
        slabs = (
            Slab(piece.difference(room), _OVER_DRIP, top),
            Slab(piece.intersection(skirt), rest, top),
            Slab(piece.intersection(lip), rest - 2e-3, top),
        )
        ring = rolled(design, extruded(name, title, *slabs), 0.0)
        parts.append(laid(ring, upside_down=True))
    return parts


def laminating_plate(workshop: Workshop, sheet: FlatSheet) -> Part:
    """A plate with holes for the pins on which panels and film meet."""
    width, height = carrier_size(sheet, workshop)
    outline: Any = shapely.box(0.0, 0.0, width, height)
    for place in pin_places(sheet, workshop):
        outline = outline.difference(disc(place, workshop.pin / 2))
    return Part(
        name="laminating_plate",
        title=f"plate for four pins of {1e3 * workshop.pin:g} mm on which the layers meet",
        solid=prism(outline, 0.0, 2 * _FLOOR),
    )


def scale_mould(design: SkinDesign, workshop: Workshop) -> Part:
    """An open mould of scales, as many as fit the printer's bed or half a dozen pairs.

    On a cone every row along x has scales of its own width, one after the other.
    """
    kinds = range(design.cells[0] if geometry(design).roll.rise else 1)
    cavities = [scale(design, workshop, row, open_by=1e-3) for row in kinds]
    shapes = [np.array(scale(design, workshop, row).bounding_box()).reshape(2, 3) for row in kinds]
    low, high = max(shapes, key=lambda ends: float(ends[1, 1]))
    pitch = high - low + workshop.wall + 1e-3
    total, most = design.cells[0] * design.cells[1], max(_SCALES, len(kinds))
    across = max(1, min(3, int((workshop.bed[0] - _RIM) / pitch[0])))
    along = max(
        1, min(-(-total // across), -(-most // across), int((workshop.bed[1] - _RIM) / pitch[1]))
    )
    size_x, size_y = across * pitch[0] + _RIM, along * pitch[1] + _RIM
    deep = high[2] - low[2]
    solid = box(np.array([[0, 0], [size_x, 0], [size_x, size_y], [0, size_y]]), 0.0, deep + 2e-3)
    # Scales lie on their backs: pads at the open face, patches down.
    for k in range(across * along):
        middle = np.array([k // along + 0.5, k % along + 0.5]) * pitch[:2] + _RIM / 2
        cavity = cavities[k % len(kinds)]
        solid = solid - cavity.translate((float(middle[0]), float(middle[1]), 2e-3))
    widths = f" of {len(kinds)} widths" if len(kinds) > 1 else ""
    return Part(
        name="scale_mould",
        title=f"open mould of {across * along} scales{widths}; {total} are needed",
        solid=solid,
        silicone=True,
    )


def sector(radius: float, grow: float = 0.0) -> Any:
    """Outline of a quarter of a disc between +45 and -45 degrees, larger by `grow`, m."""
    quarter = disc((0.0, 0.0), radius).intersection(
        Polygon([(0.0, 0.0), (2 * radius, -2 * radius), (2 * radius, 2 * radius)])
    )
    return quarter.buffer(grow, join_style="mitre") if grow else quarter


def magnet_moulds(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """Moulds of the sectors, open at both ends, and jigs that hold a sector along the coil."""
    sizes: dict[tuple[float, float], int] = {}
    for magnet in design.magnets:
        key = (magnet.radius, magnet.height)
        sizes[key] = sizes.get(key, 0) + 1
    parts = []
    for number, ((radius, height), count) in enumerate(sizes.items(), 1):
        pitch = 2 * radius + 2e-3
        wide, high = 4 * (radius + 3e-3) + _RIM, count * pitch + _RIM
        outline: Any = shapely.box(0.0, 0.0, wide, high)
        for row in range(count):
            for k in range(4):
                place = (_RIM + k * (radius + 3e-3), _RIM / 2 + (row + 0.5) * pitch)
                quarter = shapely.affinity.translate(sector(radius), *place)
                outline = outline.difference(quarter)
        parts.append(
            Part(
                name=f"magnet_mould_{number}",
                title=f"mould of {4 * count} sectors between aluminium plates; parting agent",
                solid=prism(outline, 0.0, height),
                heat=MAGNET_TEMPERATURE,
            )
        )
        parts.append(_coil_jig(workshop, number, radius, height))
    return parts


def _coil_jig(workshop: Workshop, number: int, radius: float, height: float) -> Part:
    """A block whose pocket holds a sector with its bisector along the block, an arrow's notch."""
    outline = shapely.box(-6e-3, -radius - 4e-3, radius + 6e-3, radius + 4e-3)
    arrow = Polygon([(-6e-3, -2e-3), (-6e-3, 2e-3), (-3e-3, 0.0)])
    pocket = sector(radius, workshop.fit)
    solid = prism(outline.difference(arrow), 0.0, height + _FLOOR) - prism(
        pocket, _FLOOR, 2 * height + _FLOOR
    )
    return Part(
        name=f"coil_jig_{number}",
        title="holds a sector in the coil; the notch points along its magnetisation, to the centre",
        solid=solid,
        pulse=True,
    )


def _outline_of(places: Floats, margin: float) -> Any:
    """The rectangle round places, so much wider."""
    (left, low), (right, high) = places.min(axis=0) - margin, places.max(axis=0) + margin
    return shapely.box(left, low, right, high)
