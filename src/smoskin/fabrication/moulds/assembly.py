"""The skin as it stands when it is assembled: a solid of every part, in the skin's frame.

Decides what the design leaves open of printed parts: frame, carrier shell and base.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np
import shapely
import shapely.affinity
from shapely import Polygon

from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.layout import columns_developed, magnet_height, pillar_places, pose
from smoskin.fabrication.moulds.covers import covers, guide
from smoskin.fabrication.moulds.holders import holders
from smoskin.fabrication.moulds.roll import rolled
from smoskin.fabrication.moulds.sheet import cast_height, folded_panels, scales
from smoskin.fabrication.moulds.solids import Part, Slab, disc, extruded, prism, triangles_of
from smoskin.fabrication.pattern.flat import FlatSheet
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import (
    Box,
    arcs_at,
    board_box,
    boxed,
    circuit_thickness,
    frame_box,
    frame_level,
    laid_flat,
    level_of,
    shell_thickness,
)

BASE_FLOOR: Final = 2.0e-3
"""m: base under the pocket of its magnet."""
_SCREW: Final = 1.6e-3
"""m: radius of the base's holes, for screws of nylon or brass."""
_SCREW_EDGE: Final = 4e-3
"""m: from their middles to the base's edge."""
_MODULE: Final = 5.4e-3
"""m: half the side of the stiffener under a chip and its capacitors."""
_STIFFENER: Final = 0.2e-3
"""m: its thickness."""
_SOLDER: Final = 0.05e-3
"""m: between a flat package and film that is bent under it."""


def columns(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """The columns as they are cast, shorter by the rubber that is dripped on them.

    Their feet are flat: on a limb a drop of rubber fills what the shell falls away under them.
    """
    foot = -design.columns.height
    slab = Slab(disc((0.0, 0.0), design.columns.radius), foot, foot + cast_height(design, workshop))
    return [
        extruded(f"column_{k + 1}", "support column", slab, pose=pose(design, place))
        for k, place in enumerate(columns_developed(design))
    ]


def frame(design: SkinDesign) -> Part:
    """The constraint frame: a wall whose upper edge meets rim columns after their clearance.

    Raises
    ------
    DesignError
        If a tooth between two rim columns of the zigzag would be too thin.
    """
    level = frame_level(design)
    outer = Polygon(boxed(design, frame_box(design, level), level))
    outline = outer.difference(frame_opening(design))
    slab = Slab(outline, -design.columns.height, level)
    part = extruded("frame", "constraint frame, on the board", slab, silicone=True)
    return rolled(design, part, level)


def frame_opening(design: SkinDesign) -> Any:
    """What the frame leaves free at its upper edge: the rim columns' zigzag and their clearance."""
    skin, level = geometry(design), frame_level(design)
    roll, rows = skin.roll, skin.developed[skin.sheet.columns, :2]
    radius, clearance = design.columns.radius, design.frame.clearance
    reach = radius + clearance
    half = float(np.diff(rows[..., 0], axis=0).min()) - radius - 2 * clearance
    if half < radius / 2:
        raise DesignError(
            f"the frame's teeth must be at least {1e3 * radius:.2f} mm wide to stop "
            f"a column of the zigzag; got {2e3 * max(half, 0.0):.2f} mm between its neighbours"
        )
    (left, low), (right, high) = rows.min(axis=(0, 1)), rows.max(axis=(0, 1))
    low, high = arcs_at(design, [low, high], 0.0, level).tolist()
    middles = Box(left=float(left), low=low, right=float(right), high=high)
    inner = Polygon(boxed(design, middles, level)).buffer(reach, join_style="mitre")
    teeth = []
    for row, outward in ((rows[:, 0], -1.0), (rows[:, -1], 1.0)):
        outermost = float((outward * row[:, 1]).max())
        for place in row:
            back = outermost - outward * float(place[1])
            if back > 1e-9:
                back *= float(roll.stretch(level, place[0]))
                ends = sorted((outward * reach, outward * (back + 2 * reach)))
                tooth = shapely.box(-half, ends[0], half, ends[1])
                turn = float(roll.flat_turn(place[1]))
                tooth = shapely.affinity.rotate(tooth, turn, origin=(0, 0), use_radians=True)
                teeth.append(shapely.affinity.translate(tooth, *laid_flat(design, place, level)))
    return inner.difference(shapely.union_all(teeth))


def board(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """The board as a plate; on a limb a flexible circuit and the shell that carries it."""
    foot, outline = -design.columns.height, Polygon(board_box(design).corners)
    title = "circuit board" if design.limb is None else "flexible circuit"
    under = foot - circuit_thickness(design)
    parts = [rolled(design, extruded("board", title, Slab(outline, under, foot)))]
    return parts if design.limb is None else [*parts, _shell(design, workshop, outline, under)]


def _shell(design: SkinDesign, workshop: Workshop, outline: Polygon, top: float) -> Part:
    """The stiff shell under a flexible circuit, which floats on the pillars as a board does.

    A chip on the circuit's lower face hangs in a window with its capacitors; under the chips on the
    upper face lie flat pockets for the stiffeners that keep the film flat under their solder.

    Raises
    ------
    DesignError
        If the shell would be too thin under a pocket.
    """
    thick = shell_thickness(design)
    deep = _STIFFENER + workshop.adhesive
    if thick - deep < workshop.wall:
        least = circuit_thickness(design) + deep + workshop.wall
        raise DesignError(
            f"board.thickness must be at least {1e3 * least:.2f} mm on a limb, circuit, stiffener "
            f"and the thinnest wall; got {1e3 * design.board.thickness:.2f} mm"
        )
    title = "carrier shell of the flexible circuit, with the lower chips' windows"
    part = rolled(design, extruded("shell", title, Slab(outline, top - thick, top), silicone=True))
    half = _MODULE + workshop.fit
    square, solid = shapely.box(-half, -half, half, half), part.solid
    for site, place in zip(design.halls, _chip_poses(design), strict=True):
        through = design.magnet(site.magnet).mount == "base"
        low = top - 2 * thick if through else top - deep
        solid = solid - prism(square, low, top + thick).transform(place)
    return replace(part, solid=solid)


def _chip_poses(design: SkinDesign) -> list[Any]:
    """Pose of each chip's solid, over its magnet's place or under it."""
    skin = geometry(design)
    by_name = dict(zip([m.name for m in design.magnets], skin.magnet_places, strict=True))
    return [
        np.concatenate([axes, pose(design, by_name[site.magnet])[:, 3:]], axis=1)
        for site, axes in zip(design.halls, skin.chip_axes, strict=True)
    ]


def chips(design: SkinDesign) -> list[Part]:
    """Packages of the chips, 3 x 3 x 1 mm, on either face of the board."""
    foot, square = -design.columns.height, shapely.box(-1.5e-3, -1.5e-3, 1.5e-3, 1.5e-3)
    under = foot - circuit_thickness(design) - (0.0 if design.limb is None else _SOLDER)
    parts = []
    for site, place in zip(design.halls, _chip_poses(design), strict=True):
        above = design.magnet(site.magnet).mount == "sheet"
        slab = Slab(square, foot, foot + 1e-3) if above else Slab(square, under - 1e-3, under)
        parts.append(extruded(f"chip_{site.name}", "MLX90393", slab, pose=place))
    return parts


def magnets(design: SkinDesign) -> list[Part]:
    """The magnets as discs."""
    parts = []
    for magnet, place in zip(design.magnets, geometry(design).magnet_places, strict=True):
        low = magnet_height(design, magnet) - magnet.height / 2
        slab = Slab(disc((0.0, 0.0), magnet.radius), low, low + magnet.height)
        parts.append(
            extruded(f"magnet_{magnet.name}", "four sectors", slab, pose=pose(design, place))
        )
    return parts


def pillar_height(design: SkinDesign) -> float:
    """Height to which pillars are cast, m.

    Under a limb's hollow shell they end where their rims meet it; rubber fills the rest.
    """
    layer = design.shear_layer
    if design.limb is None:
        return layer.height
    inner = min(design.limb.radii) - design.columns.height - design.board.thickness
    return layer.height - layer.radius**2 / (2 * inner) - _SOLDER


def pillars(design: SkinDesign) -> list[Part]:
    """The pillars of the shear layer, flat at both ends."""
    places, low = pillar_places(design), base_top(design)
    slab = Slab(disc((0.0, 0.0), design.shear_layer.radius), low, low + pillar_height(design))
    places = geometry(design).roll.from_flat(places, level_of(design))
    return [
        extruded(f"pillar_{k + 1}", "pillar of the shear layer", slab, pose=pose(design, place))
        for k, place in enumerate(places)
    ]


def base_top(design: SkinDesign) -> float:
    """Height of the base's face, m."""
    return -design.columns.height - design.board.thickness - design.shear_layer.height


def base_inner_radii(design: SkinDesign, workshop: Workshop) -> tuple[float, float]:
    """Radii of a limb's base on its inner face, m, where the skin begins and where it ends."""
    [whole, *_] = base(design, workshop)
    skin, (points, _) = geometry(design), triangles_of(whole.solid)
    lowest = float(skin.roll.developed(points)[:, 2].min())
    near, far = (float(skin.roll.stretch(lowest, x)) for x in (0.0, skin.extent[0]))
    return near / design.curvature, far / design.curvature


def base(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """The base under the shear layer, with pockets of its magnets and their plugs.

    Raises
    ------
    DesignError
        If a magnet on the base would stand in the shear layer.
    """
    top, window = base_top(design), shell_thickness(design)
    package = 1e-3 + workshop.fit - window
    if any(m.mount == "base" for m in design.magnets) and design.shear_layer.height < package:
        raise DesignError(
            f"shear_layer.height must be at least {1e3 * package:.2f} mm, so that the chip under "
            f"the board clears the base; got {1e3 * design.shear_layer.height:.2f} mm"
        )
    edge, parts, pockets = board_box(design, top).wider(2 * _SCREW_EDGE), [], []
    floor, least = top - 4e-3, design.shear_layer.height + window - design.board.sensing_height
    for magnet, place in zip(design.magnets, geometry(design).magnet_places, strict=True):
        if magnet.mount != "base":
            continue
        middle, there = magnet_height(design, magnet), pose(design, place)
        low, high = middle - magnet.height / 2, middle + magnet.height / 2
        if high > top:
            gap = min(site.gap for site in design.halls if site.magnet == magnet.name)
            raise DesignError(
                f"magnet {magnet.name!r} must lie below the base's face, its gap at least "
                f"{1e3 * least:.2f} mm; got {1e3 * gap:.2f} mm"
            )
        floor = min(floor, low - BASE_FLOOR)
        pocket = disc((0.0, 0.0), magnet.radius + workshop.fit)
        pockets.append(prism(pocket, low, top + 1e-3).transform(there))
        if top - high > workshop.wall:
            plug = Slab(disc((0.0, 0.0), magnet.radius), high, top)
            parts.append(extruded(f"plug_{magnet.name}", "plug of the pocket", plug, pose=there))
    outline: Any = Polygon(edge.corners)
    for corner in edge.wider(-_SCREW_EDGE).corners:
        outline = outline.difference(disc(corner, _SCREW))
    title = "base of the shear layer"
    whole = rolled(design, extruded("base", title, Slab(outline, floor, top), silicone=True), top)
    solid = whole.solid
    for pocket in pockets:
        solid = solid - pocket
    return [replace(whole, solid=solid, slabs=() if pockets else whole.slabs), *parts]


def top(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """Parts over the sheet that are touched, and what guides them."""
    if workshop.top == "covers":
        return [guide(design, workshop), *covers(design, workshop)]
    return scales(design, workshop)


def assembled(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """Every part but the sheet, where it stands."""
    return [
        *columns(design, workshop),
        frame(design),
        *board(design, workshop),
        *chips(design),
        *magnets(design),
        *holders(design, workshop),
        *pillars(design),
        *base(design, workshop),
        *top(design, workshop),
    ]


def whole_skin(design: SkinDesign, sheet: FlatSheet, workshop: Workshop) -> list[Part]:
    """Every part of the assembled skin with its panels."""
    return [*assembled(design, workshop), *folded_panels(design, sheet, workshop)]
