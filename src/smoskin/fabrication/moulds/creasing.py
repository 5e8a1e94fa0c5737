"""Moulds that crease the sheet in stages, between flat and folded.

Decides the shape of the sheet on the way: a closed form, but on a cone. A planar sheet is creased
whole; one of a limb, which wraps it, so many rows of cells at once that a punch comes down on them.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.moulds.solids import Part, under_surface
from smoskin.fabrication.pattern.flat import (
    FlatSheet,
    bend_allowance,
    beside_panels,
    sides_of,
    within_edges,
)
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.cell import dihedral_angles, fold_angle, size
from smoskin.origami.geometry import geometry
from smoskin.origami.sheet import build_sheet
from smoskin.origami.tessellation.hinges import fold, fold_angles, frame_of
from smoskin.origami.tessellation.unfold import by_lengths, unfold

FOLD_STAGES: Final = (0.4, 0.7, 1.0)
"""Shares of the way from flat to folded in height, a pair of creasing moulds each; the sheet draws
in between them, so that no stroke tears it."""
_FLOOR: Final = 3e-3
"""m: moulds under their lowest place."""
_STEEPEST: Final = np.radians(70)
"""Steepest panel on to which a punch comes down."""


def creasing_moulds(design: SkinDesign, workshop: Workshop, sheet: FlatSheet) -> list[Part]:
    """A die and a punch for every stage of folding.

    Raises
    ------
    DesignError
        If panels of a limb's sheet are too steep for any punch.
    """
    parts = []
    for number, share in enumerate(FOLD_STAGES, 1):
        lower, upper, facets, closing = faces(design, workshop, sheet, share)
        bottom, top = float(lower[:, 2].min()), float(upper[:, 2].max())
        die = under_surface(np.add(lower, [0.0, 0.0, _FLOOR - bottom]), facets, 0.0)
        over = upper * [1.0, -1.0, -1.0] + [0.0, 0.0, top + _FLOOR]
        punch = under_surface(over, facets[:, ::-1], 0.0)
        title = f"stage {number} of {len(FOLD_STAGES)}: {closing}"
        parts += [
            Part(name=f"crease_{name}_{number}", title=f"creasing {name}, {title}", solid=solid)
            for solid, name in ((die, "die"), (punch, "punch"))
        ]
    return parts


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


def faces(
    design: SkinDesign, workshop: Workshop, sheet: FlatSheet, share: float
) -> tuple[Floats, Floats, Ints, str]:
    """Vertices of a die's and a punch's face, (V, 3) each, m, their panels, and how they close.

    Raises
    ------
    DesignError
        As `creasing_moulds`.
    """
    if design.limb is None:
        return _planar(design, workshop, share)
    rows = design.cells[1]
    if geometry(design).roll.rise == 0.0:
        stage = stage_of_limb(design, workshop, sheet, share)
        return _on_limb(design, workshop, lambda many: stage.vertices((design.cells[0], many)))
    whole = stage_on_cone(design, workshop, sheet, share).reshape(-1, 2 * rows + 1, 3)

    def strip(many: int) -> Floats:
        first = (rows - many) // 2 * 2
        return _upright(whole[:, first : first + 2 * many + 1])

    return _on_limb(design, workshop, strip)


def _planar(
    design: SkinDesign, workshop: Workshop, share: float
) -> tuple[Floats, Floats, Ints, str]:
    """Faces of the whole planar sheet.

    All panels are equally steep, so that both are the sheet's own shape, moved up and down.
    """
    sheet = build_sheet(stage_cell(design, workshop, share), design.cells)
    sides = sheet.vertices[sheet.facets[0]]
    normal = np.cross(sides[1] - sides[0], sides[3] - sides[0])
    steep = float(np.linalg.norm(normal) / normal[2])
    apart = 2 * (workshop.plate(design) + workshop.fit) * steep
    return (
        sheet.vertices,
        sheet.vertices,
        sheet.facets,
        f"closes on {1e3 * apart:.2f} mm, upright",
    )


class ArcStage(NamedTuple):
    """A strip of panels on the way from flat to a limb, all of one shape."""

    step: float
    """m: from one a-crease to the next along the axis."""
    radii: tuple[float, float]
    """m: of bottom and top vertices."""
    zigzags: tuple[float, float]
    """rad: about the axis between neighbours of bottom and top rows."""
    turn: float
    """rad: from a bottom row to the next top row."""

    def vertices(self, cells: tuple[int, int]) -> Floats:
        """Vertices of so many cells, (V, 3), m, upright in their middle, the axis at z = 0."""
        i, j = np.indices((2 * cells[0] + 1, 2 * cells[1] + 1)).reshape(2, -1)
        zigzag = np.where(j % 2, self.zigzags[1], self.zigzags[0]) * np.where(i % 2, -0.5, 0.5)
        angle, radius = (j - cells[1]) * self.turn + zigzag, np.where(j % 2, *self.radii[::-1])
        return np.stack([i * self.step, radius * np.sin(angle), radius * np.cos(angle)], axis=-1)


def arc_stage(panel: Floats, fold: float) -> ArcStage:
    """The sheet of a limb's panels (4, 2), m, drawn in so far, m, across each a-crease.

    Notes
    -----
    Panels' a-edges stay in planes across the axis, all parallel to each other there: a zigzag's
    edge of (w, s) flat, w across and s along them, has s and q = sqrt(w^2 - X^2) in that plane, X
    along the axis. Rows mirror panels at the planes through the middles of both zigzags, which
    meet in the axis. q goes from 0, flat, to that of the design.
    """
    width = float(panel[1, 0] - panel[0, 0])
    even, odd = (float(panel[end, 1] - panel[start, 1]) for start, end in ((0, 3), (1, 2)))
    slope = float(panel[1, 1] - panel[0, 1])
    # In the plane: the even a-edge along (1, 0), the zigzags' edges from even to odd ones.
    ends = np.array([[0.0, 0.0], [slope, fold], [even, 0.0], [slope + odd, fold]])
    chords = np.array([ends[1] - ends[0], ends[3] - ends[2]])
    middles = np.array([ends[0] + ends[1], ends[2] + ends[3]]) / 2
    axis = np.linalg.solve(chords, (chords * middles).sum(axis=1))
    arms = ends - axis
    along = np.arctan2(arms[:, 1], arms[:, 0])
    rows = np.arctan2(*(middles - axis).T[::-1])

    def between(first: float, second: float) -> float:
        """The smaller turn from one angle to another."""
        return float((second - first + np.pi) % (2 * np.pi) - np.pi)

    turn = between(rows[0], rows[1])
    sense = np.sign(turn)
    return ArcStage(
        step=float(np.sqrt(width**2 - fold**2)),
        radii=(float(np.hypot(*arms[0])), float(np.hypot(*arms[2]))),
        zigzags=(
            float(sense * between(along[1], along[0])),
            float(sense * between(along[3], along[2])),
        ),
        turn=float(abs(turn)),
    )


def stage_of_limb(
    design: SkinDesign, workshop: Workshop, sheet: FlatSheet, share: float
) -> ArcStage:
    """The sheet of a limb at a stage: so high a share of its height over the bottom vertices."""
    columns, rows = 2 * design.cells[0], 2 * design.cells[1]
    middle = (columns // 2) * rows + rows // 2
    middle -= middle % 2 + (middle // rows % 2) * rows
    flat = sheet.vertices[sheet.facets[middle]]
    skin = geometry(design).sheet
    ideal = within_edges(flat[None], -sheet.allowances[middle][None])[0]
    corners = skin.vertices[skin.facets[middle]]
    whole = float(np.sqrt((ideal[1, 0] - ideal[0, 0]) ** 2 - (corners[1, 0] - corners[0, 0]) ** 2))

    def height(panel: Floats, fold: float) -> float:
        low, high = arc_stage(panel, fold).radii
        return high - low

    def folded(panel: Floats) -> ArcStage:
        aim = share * height(ideal, whole)
        most = 0.999 * float(panel[1, 0] - panel[0, 0])
        return arc_stage(panel, float(brentq(lambda q: height(panel, q) - aim, 1e-3 * whole, most)))

    if workshop.bend == "sharp":
        return folded(ideal)
    made = folded(ideal)
    small = build_sheet(design.cell, (2, 2))
    hinges = frame_of(made.vertices((2, 2)), small.facets, small.creases).creases
    folds = np.abs(fold_angles(made.vertices((2, 2)), hinges))
    kinds = [~small.along_a & ~small.mountain, small.along_a, ~small.along_a & small.mountain]
    bent = [bend_allowance(design.creases.gap, float(folds[kind].mean())) / 2 for kind in kinds]
    return folded(within_edges(flat[None], -np.array([[bent[0], bent[1], bent[2], bent[1]]]))[0])


def stage_on_cone(design: SkinDesign, workshop: Workshop, sheet: FlatSheet, share: float) -> Floats:
    """The sheet of a cone at a stage, (V, 3), m: so high a share of its height.

    Its panels are those of the flat sheet, as far apart as film then is, folded by lengths and fold
    angles alone; the tangents of half the angles grow together, as in any sheet that folds flat.
    """
    skin = geometry(design)
    facets = skin.sheet.facets
    frame = frame_of(skin.sheet.vertices, facets, skin.sheet.creases)
    angles = fold_angles(skin.sheet.vertices, frame.creases)
    whole, _ = unfold(skin.sheet.vertices, facets, skin.developed[:, :2])
    way = fold(whole, frame, angles).steps
    heights = [_height(places, design.cells) for places in way]
    part = PchipInterpolator(heights, np.linspace(0.0, 1.0, len(way)))(share * heights[-1])
    now = 2 * np.arctan(part * np.tan(angles / 2))
    if workshop.bend == "even":
        bent = [bend_allowance(design.creases.gap, abs(float(fold))) / 2 for fold in now]
        beside = beside_panels(facets, skin.sheet.creases, np.array(bent))
        panels = within_edges(sheet.vertices[facets], -beside)
        whole = by_lengths(whole, *sides_of(facets, panels))
    return np.asarray(fold(whole, frame, now).steps[-1])


def _height(places: Floats, cells: tuple[int, int]) -> float:
    """Mean height of top vertices over the middle between their bottom neighbours, m."""
    rows = places.reshape(2 * cells[0] + 1, 2 * cells[1] + 1, 3)
    away = rows[:, 1::2] - (rows[:, :-1:2] + rows[:, 2::2]) / 2
    return float(np.linalg.norm(away, axis=2).mean())


def _upright(rows: Floats) -> Floats:
    """A strip of vertices (2N + 1, 2M + 1, 3), m, as (V, 3): its tops upward, its axis along x."""
    tops, bottoms = rows[:, 1::2].mean(axis=(0, 1)), rows[:, ::2].mean(axis=(0, 1))
    along = (rows[-1] - rows[0]).mean(axis=0)
    along /= np.linalg.norm(along)
    up = tops - bottoms
    up -= (up @ along) * along
    up /= np.linalg.norm(up)
    return np.asarray(rows.reshape(-1, 3) @ np.stack([along, np.cross(up, along), up], axis=1))


def _on_limb(
    design: SkinDesign, workshop: Workshop, strip: Callable[[int], Floats]
) -> tuple[Floats, Floats, Ints, str]:
    """Faces of as many rows of cells as a punch comes down on, of strips (V, 3), m, of so many."""
    columns, rows = design.cells
    for many in range(rows, 0, -1):
        vertices = strip(many)
        facets = build_sheet(design.cell, (columns, many)).facets
        if np.arccos(_normals(vertices, facets)[:, 2].min()) <= _STEEPEST:
            break
    else:
        raise DesignError(
            f"panels on a limb must be at most {np.degrees(_STEEPEST):.0f} deg steep in a row of "
            "cells, so that a punch comes down on them: take a larger radius or a flatter fold"
        )
    away = workshop.plate(design) + workshop.fit
    lower, upper = (_offset(vertices, facets, by) for by in (-away, away))
    closing = "closes on the panels' faces"
    if many < rows:
        closing += f"; {many} of {rows} rows of cells at once, moved on row by row"
    return lower, upper, facets, closing


def _normals(vertices: Floats, facets: Ints) -> Floats:
    """Upward normals of panels, (F, 3)."""
    corners = vertices[facets]
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def _offset(vertices: Floats, facets: Ints, by: float) -> Floats:
    """Vertices of the surface whose panels lie so far over those of another, m.

    The planes of four panels at a vertex still meet in a point: on a cylinder they mirror each
    other, on a cone of 70 to 90 mm they miss it by less than 0.1 um.
    """
    normals = _normals(vertices, facets)
    moved = vertices.copy()
    for vertex in range(len(vertices)):
        beside = normals[(facets == vertex).any(axis=1)]
        moved[vertex] += np.linalg.lstsq(beside, np.full(len(beside), by), rcond=1e-9)[0]
    return moved
