"""The folded sheet over the columns, and the scales on it, as they stand in the skin.

Decides size and bond of the scales, which the design leaves open.
"""

from typing import Any

import numpy as np
import shapely

from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.layout import pose
from smoskin.fabrication.moulds.solids import Part, Slab, disc, extruded
from smoskin.fabrication.pattern.flat import FlatSheet, bend_allowance, fold_at_b, outlines
from smoskin.fabrication.pattern.sheets import panels
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import SCALE_BOSS, SCALE_GAP, SCALE_RISE, cell_width


def folded_panels(
    design: SkinDesign,
    sheet: FlatSheet,
    workshop: Workshop,
    *,
    vertices: Floats | None = None,
    only: Bools | None = None,
) -> list[Part]:
    """Panels of both faces on the folded sheet, or on one of other vertices (V, 3), m.

    Each is the panel that is cut, carried from the flat sheet to where its film folds it; those of
    `only` (F,) where it is given.
    """
    folded = geometry(design).sheet.vertices if vertices is None else vertices
    near = design.creases.thickness / 2 + workshop.adhesive
    thick, shift = design.panels.thickness / 2, workshop.border + workshop.slot
    parts = []
    for upper, insets in ((True, sheet.upper), (False, sheet.lower)):
        shapes = panels(sheet, workshop, upper=upper).shapes
        flat = outlines(sheet, insets) + shift
        low, high = (near, near + thick) if upper else (-near - thick, -near)
        name = "upper" if upper else "lower"
        for k, (shape, corners) in enumerate(zip(shapes, flat, strict=True)):
            if only is not None and not only[k]:
                continue
            there = _carried(corners, folded[sheet.facets[k]], insets[k] + sheet.allowances[k])
            parts.append(extruded(f"{name}_{k}", "panel", Slab(shape, low, high), pose=there))
    return parts


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
    fold = fold_at_b(design, ridge=False)
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


def scales(design: SkinDesign, workshop: Workshop) -> list[Part]:
    """A scale over each cell, bonded to its top vertex by a small patch."""
    skin, over = geometry(design), clear_of_ridge(design, workshop)
    tops = skin.developed[skin.sheet.loaded.ravel()]
    return [
        extruded(
            f"scale_{k + 1}",
            "top scale",
            *_scale(design, workshop, float(top[2]) + over, k // design.cells[1]),
            pose=pose(design, top[:2]),
        )
        for k, top in enumerate(tops)
    ]


def clear_of_ridge(design: SkinDesign, workshop: Workshop) -> float:
    """Height of the panels' outer faces over a top vertex, and what is dripped there, m."""
    fold = fold_at_b(design, ridge=True)
    away = design.creases.gap / 2
    if workshop.bend == "even":
        away += bend_allowance(design.creases.gap, fold) / 2
    over = workshop.plate(design) * np.cos(fold / 2) - away * np.sin(fold / 2)
    return max(float(over), 0.0) + workshop.fit


def scale(design: SkinDesign, workshop: Workshop, row: int = 0, *, open_by: float = 0.0) -> Any:
    """A scale of a row along x, its patch downward, the patch's face at z = 0.

    Its pad is thicker by `open_by`, m.
    """
    return extruded("scale", "", *_scale(design, workshop, 0.0, row, open_by)).solid


def _scale(
    design: SkinDesign, workshop: Workshop, foot: float, row: int, open_by: float = 0.0
) -> tuple[Slab, Slab]:
    """Patch and pad of a scale whose patch begins at such a height, m."""
    length, width = float(geometry(design).cell.length), cell_width(design, row, 0.0)
    wide = np.array([length, width]) / 2 - SCALE_GAP / 2
    low = foot + SCALE_RISE
    return (
        Slab(disc((0.0, 0.0), SCALE_BOSS), foot, low + workshop.scale_pad / 2),
        Slab(shapely.box(*-wide, *wide), low, low + workshop.scale_pad + open_by),
    )
