"""Moulds and jigs of a skin, each standing on z = 0 as it is made.

Decides that every mould is open enough to be emptied: columns are pushed out of a plate open at
both ends, so that they need no taper, which would cost lateral stiffness.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np
import shapely
import shapely.affinity
from shapely import MultiPoint, Polygon

from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.layout import column_places, frame_box
from smoskin.fabrication.moulds.assembly import (
    cast_height,
    folded_panels,
    frame_opening,
    scale,
)
from smoskin.fabrication.moulds.solids import Part, box, disc, prism, triangles_of, under_surface
from smoskin.fabrication.pattern.flat import FlatSheet, bend_allowance
from smoskin.fabrication.pattern.sheets import carrier_size, pin_places
from smoskin.fabrication.workshop import MAGNET_TEMPERATURE, Workshop
from smoskin.origami.cell import dihedral_angles, fold_angle, size
from smoskin.origami.geometry import geometry
from smoskin.origami.sheet import build_sheet

FOLD_STAGES: Final = (0.4, 0.7, 1.0)
"""Shares of the way from flat to folded in height, a pair of creasing moulds each; the sheet draws
in between them, so that no stroke tears it."""
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
        foot_jig(design, workshop),
        fold_jig(design, workshop, sheet),
        *creasing_moulds(design, workshop),
        laminating_plate(workshop, sheet),
        scale_mould(design, workshop),
        *magnet_moulds(design, workshop),
    ]


def column_mould(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A plate with a hole for every column, the plate it stands on, and pins that empty it.

    Raises
    ------
    DesignError
        If the walls between columns are too thin.
    """
    places, radius = column_places(design), design.columns.radius
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


def foot_jig(design: SkinDesign, workshop: Workshop) -> Part:
    """A plate on the board that places the columns' feet, chips in its windows."""
    outline = frame_opening(design).buffer(-workshop.fit, join_style="mitre")
    reach = design.columns.radius + workshop.fit
    windows: list[Any] = [disc(place, reach) for place in column_places(design)]
    for place in geometry(design).chips:
        windows.append(Polygon(place[:2] + 3e-3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])))
    outline = outline.difference(shapely.union_all(windows))
    outline = max(getattr(outline, "geoms", [outline]), key=lambda piece: piece.area)
    return Part(
        name="foot_jig",
        title="jig of the columns' feet, within the frame; lift it off before holders go in",
        solid=prism(outline, 0.0, min(_FLOOR, design.columns.height / 3)),
        silicone=True,
    )


def fold_jig(design: SkinDesign, workshop: Workshop, sheet: FlatSheet) -> Part:
    """A ring on the frame's wall that holds the sheet folded until the drip has cured.

    It closes round the folded sheet in the plane; the frame stays, the jig is lifted off.
    """
    vertices = geometry(design).sheet.vertices
    shadows = [Polygon(vertices[f, :2]) for f in geometry(design).sheet.facets]
    at_rim = np.asarray(np.isin(sheet.facets, sheet.rim).any(axis=1))
    for solid in folded_panels(design, sheet, workshop, only=at_rim):
        shadows.append(MultiPoint(triangles_of(solid)[0][:, :2]).convex_hull)
    room = shapely.union_all(shadows).buffer(workshop.fit, join_style="mitre")
    wall = frame_box(design)
    outer = Polygon(wall.wider(workshop.fit + 1.5e-3).corners)
    lip = outer.difference(Polygon(wall.wider(workshop.fit).corners))
    skirt = outer.difference(Polygon(wall.wider(-3e-3).corners))
    top, bottom = float(vertices[:, 2].max()), _OVER_DRIP
    rest = design.frame.held_height - design.columns.height
    ring = prism(outer.difference(room), bottom, top)
    # Solids that are joined overlap: faces that only meet would stay two.
    solid = ring + prism(skirt, rest, top) + prism(lip, rest - 2e-3, top)
    turned = solid.transform(np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, top]]))
    return Part(
        name="fold_jig", title="jig that holds the folded sheet over its columns", solid=turned
    )


def stage_cell(design: SkinDesign, workshop: Workshop, share: float) -> MiuraCell:
    """The cell at a stage: so high a share of its height, its panels as far apart as film then is.

    Film that bends evenly takes up less length the less it is folded: so do the sheet's panels.
    """
    cell = design.cell
    angle = float(fold_angle(cell, height=share * float(size(cell).height)))
    if workshop.bend == "sharp":
        return replace(cell, fold_angle=angle)
    shorter = [
        bend_allowance(design.creases.gap, float(np.pi - folded))
        - bend_allowance(design.creases.gap, float(np.pi - now))
        for folded, now in zip(dihedral_angles(cell), dihedral_angles(cell, angle), strict=True)
    ]
    sine = float(np.sin(cell.sector_angle))
    return replace(
        cell,
        fold_angle=angle,
        panel_a=cell.panel_a - shorter[1] / sine,
        panel_b=cell.panel_b - shorter[0] / sine,
    )


def creasing_moulds(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A die and a punch for every stage of folding.

    Their faces are the sheet's, moved apart by its panels and the clearance; all panels are equally
    steep, so that both are the sheet's own shape, moved up and down.
    """
    parts = []
    for number, share in enumerate(FOLD_STAGES, 1):
        sheet = build_sheet(stage_cell(design, workshop, share), design.cells)
        sides = sheet.vertices[sheet.facets[0]]
        normal = np.cross(sides[1] - sides[0], sides[3] - sides[0])
        steep = float(np.linalg.norm(normal) / normal[2])
        apart = 2 * (workshop.plate(design) + workshop.fit) * steep
        height = float(sheet.vertices[:, 2].max())
        die = under_surface(np.add(sheet.vertices, [0.0, 0.0, _FLOOR]), sheet.facets, 0.0)
        over = sheet.vertices * [1.0, -1.0, -1.0] + [0.0, 0.0, height + _FLOOR]
        punch = under_surface(over, sheet.facets[:, ::-1], 0.0)
        title = f"stage {number} of {len(FOLD_STAGES)}: closes on {1e3 * apart:.2f} mm, upright"
        parts += [
            Part(name=f"crease_{name}_{number}", title=f"creasing {name}, {title}", solid=solid)
            for solid, name in ((die, "die"), (punch, "punch"))
        ]
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
    """An open mould of scales, as many as fit the printer's bed or half a dozen pairs."""
    shape, cavity = scale(design, workshop), scale(design, workshop, open_by=1e-3)
    low, high = np.array(shape.bounding_box()).reshape(2, 3)
    pitch = high - low + workshop.wall + 1e-3
    total = design.cells[0] * design.cells[1]
    across = max(1, min(3, int((workshop.bed[0] - _RIM) / pitch[0])))
    along = max(
        1, min(-(-total // across), _SCALES // across, int((workshop.bed[1] - _RIM) / pitch[1]))
    )
    size_x, size_y = across * pitch[0] + _RIM, along * pitch[1] + _RIM
    deep = high[2] - low[2]
    solid = box(np.array([[0, 0], [size_x, 0], [size_x, size_y], [0, size_y]]), 0.0, deep + 2e-3)
    # Scales lie on their backs: pads at the open face, patches down.
    for k in range(across):
        for row in range(along):
            middle = np.array([k + 0.5, row + 0.5]) * pitch[:2] + _RIM / 2
            solid = solid - cavity.translate((float(middle[0]), float(middle[1]), 2e-3))
    return Part(
        name="scale_mould",
        title=f"open mould of {across * along} scales; {total} are needed",
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
