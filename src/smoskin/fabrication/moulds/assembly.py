"""The skin as it stands when it is assembled: a solid of every part, in the skin's frame.

Decides what the design leaves open of printed parts: frame, holders, base, lids and scales.
"""

from typing import Any, Final

import numpy as np
import shapely
from shapely import Point, Polygon

from smoskin.arrays import Bools, Floats
from smoskin.design.skin import Magnet, SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.layout import board_box, column_places, frame_box, pillar_places
from smoskin.fabrication.moulds.solids import Part, box, disc, hole, joined, prism
from smoskin.fabrication.pattern.flat import FlatSheet, bend_allowance, outlines
from smoskin.fabrication.pattern.sheets import panels
from smoskin.fabrication.workshop import Workshop
from smoskin.mechanics.sheet.holders import holder_columns
from smoskin.origami.cell import dihedral_angles
from smoskin.origami.geometry import geometry

HOLDER_FLOOR: Final = 0.8e-3
"""m: plate under a magnet in its holder."""
LID: Final = 0.8e-3
"""m: plate over it; the four sectors push each other apart."""
_HOLDER_WALL: Final = 1.2e-3
"""m: wall of a holder round its magnet and its notches."""
BASE_FLOOR: Final = 2.0e-3
"""m: base under the pocket of its magnet."""
_DRIVER: Final = 2e-3
"""m: radius of the column by which the sheet drives a magnet."""
_SCREW: Final = 1.6e-3
"""m: radius of the base's holes, for screws of nylon or brass."""
_SCREW_EDGE: Final = 4e-3
"""m: from their middles to the base's edge."""
_SCALE_BOSS: Final = 2.0e-3
"""m: radius of the patch by which a scale is bonded to its top vertex."""
_SCALE_RISE: Final = 1.5e-3
"""m: height of that patch."""
_SCALE_GAP: Final = 1.0e-3
"""m: between neighbouring scales."""


def folded_panels(
    design: SkinDesign,
    sheet: FlatSheet,
    workshop: Workshop,
    *,
    vertices: Floats | None = None,
    only: Bools | None = None,
) -> list[Any]:
    """Solids of the panels of both faces on the folded sheet, or one of other vertices (V, 3), m.

    Each is the panel that is cut, carried from the flat sheet to where its film folds it; those of
    `only` (F,) where it is given.
    """
    folded = geometry(design).sheet.vertices if vertices is None else vertices
    folds = [float(np.pi - angle) for angle in dihedral_angles(design.cell)]
    even = float(workshop.bend == "even")
    more_a, more_b = (even * bend_allowance(design.creases.gap, f) / 2 for f in folds)
    inner = {tuple(sorted(pair)) for pair in sheet.creases.tolist()}
    more = np.array(
        [
            [
                (more_b, more_a)[k % 2] if tuple(sorted((f[k], f[(k + 1) % 4]))) in inner else 0.0
                for k in range(4)
            ]
            for f in sheet.facets.tolist()
        ]
    )
    near = design.creases.thickness / 2 + workshop.adhesive
    thick, shift = design.panels.thickness / 2, workshop.border + workshop.slot
    solids = []
    for upper, insets in ((True, sheet.upper), (False, sheet.lower)):
        shapes = panels(sheet, workshop, upper=upper).shapes
        flat = outlines(sheet, insets) + shift
        low, high = (near, near + thick) if upper else (-near - thick, -near)
        for k, (shape, corners) in enumerate(zip(shapes, flat, strict=True)):
            if only is not None and not only[k]:
                continue
            pose = _carried(corners, folded[sheet.facets[k]], insets[k] + more[k])
            solids.append(prism(shape, low, high).transform(pose))
    return solids


def _carried(flat: Floats, folded: Floats, insets: Floats) -> Floats:
    """The motion (3, 4) of a flat outline to its place within a folded facet's edges."""
    along = folded[1] - folded[0]
    along /= np.linalg.norm(along)
    up = np.cross(along, folded[3] - folded[0])
    up /= np.linalg.norm(up)
    across = np.cross(up, along)
    # The outline's first corner lies its insets from the first and the last edge.
    side = folded[3] - folded[0]
    sine = float(side @ across) / float(np.linalg.norm(side))
    cosine = float(side @ along) / float(np.linalg.norm(side))
    step = (insets[3] + insets[0] * cosine) / sine
    corner = folded[0] + step * along + insets[0] * across
    turn = np.stack([along, across, up], axis=1)
    line = (flat[1] - flat[0]) / np.linalg.norm(flat[1] - flat[0])
    back = np.array([[line[0], line[1], 0.0], [-line[1], line[0], 0.0], [0.0, 0.0, 1.0]])
    turn = turn @ back
    return np.concatenate([turn, (corner - turn @ np.append(flat[0], 0.0))[:, None]], axis=1)


def panel_dip(design: SkinDesign, workshop: Workshop) -> float:
    """Depth of the lower panels' edges below the bottom vertices at the rim, m."""
    fold = float(np.pi - dihedral_angles(design.cell).at_b)
    return workshop.plate(design) * float(np.cos(fold / 2))


def cast_height(design: SkinDesign, workshop: Workshop) -> float:
    """Height to which columns are cast: the drip on them makes up for the panels' plates, m.

    Raises
    ------
    DesignError
        If panels would stand on the columns.
    """
    least = panel_dip(design, workshop) + workshop.fit
    if workshop.drip < least:
        raise DesignError(
            f"workshop.drip must be at least {1e3 * least:.2f} mm, so that panels clear the "
            f"columns; got {1e3 * workshop.drip:.2f} mm"
        )
    if (height := design.columns.height - workshop.drip) < 2 * workshop.wall:
        raise DesignError(
            f"columns must be cast at least {2e3 * workshop.wall:.2f} mm high under the drip; got "
            f"{1e3 * height:.2f} mm"
        )
    return height


def columns(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """The columns as they are cast, shorter by the rubber that is dripped on them."""
    foot = -design.columns.height
    top = foot + cast_height(design, workshop)
    return [
        Part(
            name=f"column_{k + 1}",
            title="support column",
            solid=prism(disc(place, design.columns.radius), foot, top),
        )
        for k, place in enumerate(column_places(design))
    ]


def frame(design: SkinDesign) -> Part:
    """The constraint frame: a wall whose upper edge meets rim columns after their clearance.

    Raises
    ------
    DesignError
        If a tooth between two rim columns of the zigzag would be too thin.
    """
    outer = Polygon(frame_box(design).corners)
    foot = -design.columns.height
    outline = outer.difference(frame_opening(design))
    solid = prism(outline, foot, foot + design.frame.held_height)
    title = "constraint frame, on the board"
    return Part(name="frame", title=title, solid=solid, silicone=True)


def frame_opening(design: SkinDesign) -> Any:
    """What the frame leaves free: the zigzag of the rim columns and their clearance."""
    grid = geometry(design).sheet.vertices[geometry(design).sheet.columns, :2]
    reach = design.columns.radius + design.frame.clearance
    pitch = float(grid[1, 0, 0] - grid[0, 0, 0])
    half = pitch - design.columns.radius - 2 * design.frame.clearance
    if half < design.columns.radius / 2:
        raise DesignError(
            f"the frame's teeth must be at least {1e3 * design.columns.radius:.2f} mm wide to stop "
            f"a column of the zigzag; got {2e3 * max(half, 0.0):.2f} mm between its neighbours"
        )
    box_x = float(grid[0, 0, 0]) - reach, float(grid[-1, 0, 0]) + reach
    inner = shapely.box(
        box_x[0], float(grid[..., 1].min()) - reach, box_x[1], float(grid[..., 1].max()) + reach
    )
    teeth = []
    for row, outward in ((grid[:, 0], -1.0), (grid[:, -1], 1.0)):
        outermost = float((outward * row[:, 1]).max())
        for x, y in row.tolist():
            if outward * y < outermost - 1e-9:
                ends = sorted((y + outward * reach, outward * (outermost + reach)))
                left, right = max(x - half, box_x[0]), min(x + half, box_x[1])
                teeth.append(shapely.box(left, ends[0], right, ends[1]))
    return inner.difference(shapely.union_all(teeth))


def board(design: SkinDesign) -> Part:
    """The board as a plate."""
    foot = -design.columns.height
    solid = box(board_box(design).corners, foot - design.board.thickness, foot)
    return Part(name="board", title="circuit board", solid=solid)


def chips(design: SkinDesign) -> list[Part]:
    """Packages of the chips, 3 x 3 x 1 mm, on either face of the board."""
    foot, thick = -design.columns.height, design.board.thickness
    parts = []
    for site, place in zip(design.halls, geometry(design).chips, strict=True):
        ends = (foot, foot + 1e-3) if place[2] > foot else (foot - thick - 1e-3, foot - thick)
        corners = place[:2] + 1.5e-3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        parts.append(Part(name=f"chip_{site.name}", title="MLX90393", solid=box(corners, *ends)))
    return parts


def magnets(design: SkinDesign) -> list[Part]:
    """The magnets as discs."""
    return [
        Part(
            name=f"magnet_{magnet.name}",
            title="four sectors",
            solid=prism(
                disc(place, magnet.radius),
                place[2] - magnet.height / 2,
                place[2] + magnet.height / 2,
            ),
        )
        for magnet, place in zip(design.magnets, geometry(design).magnets, strict=True)
    ]


def holders(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A holder and a lid for every magnet on the sheet.

    Raises
    ------
    DesignError
        If columns with their play leave no room for a sound wall, or a chip is in the way.
    """
    parts = []
    for magnet, place in zip(design.magnets, geometry(design).magnets, strict=True):
        if magnet.mount == "sheet":
            parts += _holder(design, workshop, magnet, place)
    return parts


def _holder(design: SkinDesign, workshop: Workshop, magnet: Magnet, place: Floats) -> list[Part]:
    """One holder with its lid, where they stand."""
    bottom = float(place[2]) - magnet.height / 2 - HOLDER_FLOOR
    top = float(place[2]) + magnet.height / 2
    chip = -design.columns.height + 1e-3
    if bottom - chip < workshop.fit + 0.5e-3:
        raise DesignError(
            f"magnet {magnet.name!r}'s holder must stay {1e3 * workshop.fit + 0.5:.2f} mm above "
            f"its chip's package; got {1e3 * (bottom - chip):.2f} mm: widen the gap"
        )
    outline, pocket = holder_outline(design, workshop, magnet, place)
    walls = outline.difference(pocket).buffer(-workshop.wall / 2).buffer(workshop.wall / 2)
    if walls.area < 0.5 * outline.difference(pocket).area:
        raise DesignError(
            f"magnet {magnet.name!r}'s holder must have walls of {1e3 * workshop.wall:g} mm "
            "between pocket and columns; got less: take a smaller magnet, less play or thinner "
            "columns"
        )
    walls = walls.intersection(outline)
    body = prism(outline, bottom, bottom + HOLDER_FLOOR) + prism(walls, bottom, top)
    lid = prism(outline, top, top + LID)
    driver = []
    if magnet.driver == "column":
        driver.append(_driver(design, workshop, magnet, (*place[:2].tolist(), top + LID)))
    title = f"of {magnet.name}; its notches hang on the columns beside it"
    return [
        Part(name=f"holder_{magnet.name}", title=f"holder {title}", solid=body, silicone=True),
        Part(name=f"holder_lid_{magnet.name}", title=f"lid of {magnet.name}, glued on", solid=lid),
        *driver,
    ]


def _driver(
    design: SkinDesign, workshop: Workshop, magnet: Magnet, foot: tuple[float, float, float]
) -> Part:
    """The rubber column from a holder's lid to the sheet straight above, which moves the magnet."""
    vertices = geometry(design).sheet.vertices
    above = foot[2]
    for corners in vertices[geometry(design).sheet.facets]:
        if Polygon(corners[:, :2]).buffer(1e-9).covers(Point(foot[:2])):
            sides = np.stack([corners[1] - corners[0], corners[3] - corners[0]], axis=1)
            share = np.linalg.solve(sides[:2], np.array(foot[:2]) - corners[0, :2])
            above = max(above, float(corners[0, 2] + sides[2] @ share))
    top = above - _clear_of_sheet(design, workshop)
    if top - foot[2] < workshop.wall:
        raise DesignError(
            f"magnet {magnet.name!r}'s column to the sheet must be at least "
            f"{1e3 * workshop.wall:.2f} mm high; got {1e3 * (top - foot[2]):.2f} mm"
        )
    solid = prism(disc(foot, _DRIVER), foot[2], top)
    title = f"rubber column from the lid of {magnet.name} to the sheet, dripped to it"
    return Part(name=f"holder_driver_{magnet.name}", title=title, solid=solid, silicone=True)


def _clear_of_sheet(design: SkinDesign, workshop: Workshop) -> float:
    """Depth below the sheet at which a column of `_DRIVER`'s radius clears the lower panels, m."""
    fold = float(np.pi - dihedral_angles(design.cell).at_b)
    return workshop.plate(design) / float(np.cos(fold / 2)) + _DRIVER * float(np.tan(fold / 2))


def holder_outline(
    design: SkinDesign, workshop: Workshop, magnet: Magnet, place: Floats
) -> tuple[Any, Any]:
    """Outline of a holder without its notches, and the magnet's pocket."""
    places = column_places(design)
    gripping, bearing = holder_columns(design, magnet)
    vertices = geometry(design).sheet.vertices
    reach = design.columns.radius + magnet.play
    around = magnet.radius + workshop.fit + _HOLDER_WALL
    pieces = [disc(place, around)]
    for vertex in sorted({*gripping.tolist(), *bearing.tolist()}):
        arm = shapely.LineString([place[:2], vertices[vertex, :2]])
        pieces.append(arm.buffer(reach + _HOLDER_WALL, cap_style="flat"))
    outline = shapely.union_all(pieces)
    for column in places:
        outline = outline.difference(hole(column, reach))
    # Slivers that no printer makes go; the piece that holds the magnet stays.
    outline = outline.buffer(-workshop.wall / 2).buffer(workshop.wall / 2)
    outline = max(getattr(outline, "geoms", [outline]), key=lambda piece: piece.area)
    return outline, disc(place, magnet.radius + workshop.fit)


def pillars(design: SkinDesign) -> list[Part]:
    """The pillars of the shear layer."""
    top = -design.columns.height - design.board.thickness
    return [
        Part(
            name=f"pillar_{k + 1}",
            title="pillar of the shear layer",
            solid=prism(
                disc(place, design.shear_layer.radius), top - design.shear_layer.height, top
            ),
        )
        for k, place in enumerate(pillar_places(design))
    ]


def base(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """The base under the shear layer, with pockets of its magnets and their plugs.

    Raises
    ------
    DesignError
        If a magnet on the base would stand in the shear layer.
    """
    top = -design.columns.height - design.board.thickness - design.shear_layer.height
    package = 1e-3 + workshop.fit
    if any(m.mount == "base" for m in design.magnets) and design.shear_layer.height < package:
        raise DesignError(
            f"shear_layer.height must be at least {1e3 * package:.2f} mm, so that the chip under "
            f"the board clears the base; got {1e3 * design.shear_layer.height:.2f} mm"
        )
    edge, parts, pockets = board_box(design).wider(2 * _SCREW_EDGE), [], []
    floor = top - 4e-3
    for magnet, place in zip(design.magnets, geometry(design).magnets, strict=True):
        if magnet.mount != "base":
            continue
        low, high = float(place[2]) - magnet.height / 2, float(place[2]) + magnet.height / 2
        if high > top:
            raise DesignError(
                f"magnet {magnet.name!r} must lie below the base's face, its gap at least "
                f"{1e3 * (design.shear_layer.height - design.board.sensing_height):.2f} mm; got "
                f"{1e3 * _gap(design, magnet):.2f} mm"
            )
        floor = min(floor, low - BASE_FLOOR)
        pockets.append(prism(disc(place, magnet.radius + workshop.fit), low, top + 1e-3))
        if top - high > workshop.wall:
            plug = prism(disc(place, magnet.radius), high, top)
            parts.append(Part(name=f"plug_{magnet.name}", title="plug of the pocket", solid=plug))
    outline: Any = Polygon(edge.corners)
    for corner in edge.wider(-_SCREW_EDGE).corners:
        outline = outline.difference(disc(corner, _SCREW))
    solid = prism(outline, floor, top)
    for pocket in pockets:
        solid = solid - pocket
    return [Part(name="base", title="base of the shear layer", solid=solid, silicone=True), *parts]


def _gap(design: SkinDesign, magnet: Magnet) -> float:
    """Least gap of the chips that watch a magnet, m."""
    return min(site.gap for site in design.halls if site.magnet == magnet.name)


def scales(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A scale over each cell, bonded to its top vertex by a small patch."""
    cell = geometry(design).cell
    sheet = geometry(design).sheet
    return [
        Part(
            name=f"scale_{k + 1}",
            title="top scale",
            solid=scale(design, workshop).translate(
                (float(v[0]), float(v[1]), float(cell.height) + _clear(design, workshop))
            ),
        )
        for k, v in enumerate(sheet.vertices[sheet.loaded.ravel()])
    ]


def _clear(design: SkinDesign, workshop: Workshop) -> float:
    """Height of the panels' outer faces over a top vertex, and what is dripped there, m."""
    fold = float(np.pi - dihedral_angles(design.cell).at_b)
    away = design.creases.gap / 2
    if workshop.bend == "even":
        away += bend_allowance(design.creases.gap, fold) / 2
    over = workshop.plate(design) * np.cos(fold / 2) - away * np.sin(fold / 2)
    return max(float(over), 0.0) + workshop.fit


def scale(design: SkinDesign, workshop: Workshop, open_by: float = 0.0) -> Any:
    """One scale, its patch downward, the patch's face at z = 0; its pad thicker by `open_by`, m."""
    cell = geometry(design).cell
    wide = np.array([float(cell.length), float(cell.width)]) / 2 - _SCALE_GAP / 2
    pad = shapely.box(-wide[0], -wide[1], wide[0], wide[1])
    boss = prism(disc((0.0, 0.0), _SCALE_BOSS), 0.0, _SCALE_RISE + workshop.scale_pad / 2)
    return joined([boss, prism(pad, _SCALE_RISE, _SCALE_RISE + workshop.scale_pad + open_by)])


def assembled(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """Every part but the sheet, where it stands."""
    return [
        *columns(design, workshop),
        frame(design),
        board(design),
        *chips(design),
        *magnets(design),
        *holders(design, workshop),
        *pillars(design),
        *base(design, workshop),
        *scales(design, workshop),
    ]
