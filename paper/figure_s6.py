"""
Figure S6: creases and columns of the sheet
===========================================

The folded sheet in plan with its creases and columns, one cell in space with its dimensions, and
the counts that the energy sums (S16, S22, S23) rest on.
"""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from paper.shared.rows import Row, compared, stated
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    RED,
    Look,
    Plate,
    canvas,
    lay_out,
    note,
    open_axes,
    styled,
)
from smoskin.arrays import Floats, Ints
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.origami.cell import size
from smoskin.origami.geometry import geometry
from smoskin.origami.sheet import build_sheet

_AZIMUTH, _ELEVATION = np.radians(-76.0), np.radians(48.0)
_ALONG: Final = np.array([np.cos(_AZIMUTH), np.sin(_AZIMUTH), 0.0])
_TOWARDS: Final = np.cos(_ELEVATION) * _ALONG + np.array([0.0, 0.0, np.sin(_ELEVATION)])
"""Direction from the cell to the eye."""
_SHARED: Final = ((1, GREEN, "o"), (2, ORANGE, "s"), (4, RED, "D"))
"""Cells that share a column, and how it is drawn."""
_DASHED: Final = (0, (3, 2))


def column_multiplicity(cells: tuple[int, int]) -> Ints:
    """How many cells share each column, shape (2N + 1, M + 1).

    Notes
    -----
    Source: SI Eq. (S23) and Figure S6. N (M + 1) + (N + 1) (M + 1) columns in all.
    """
    i = np.arange(2 * cells[0] + 1)
    across = np.where((i % 2 == 1) | (i == 0) | (i == 2 * cells[0]), 1, 2)
    along = np.full(cells[1] + 1, 2)
    along[[0, -1]] = 1
    return np.asarray(np.outer(across, along), dtype=np.int64)


def sheet_rows(design: SkinDesign) -> list[Row]:
    """Counts of the figure and of the energy sums."""
    sheet, (n, m) = geometry(design).sheet, design.cells
    at_vertex = int((sheet.creases == sheet.loaded[0, 0]).any(axis=1).sum())
    shared = column_multiplicity(design.cells)
    counted = 6 * n * m - int((shared == 2).sum()) - 3 * int((shared == 4).sum())
    each = "columns of a cell, shared ones counted for each"
    return [
        compared("figure_s6.creases", "S16", 4, at_vertex, "creases at one top vertex"),
        compared("figure_s6.columns", "S22", 6, shared.sum() / (n * m), each),
        stated(
            "figure_s6.each_once",
            "S23",
            "6 N M, less those counted twice, less 3 times those counted four times",
            f"{counted}, each of {sheet.columns.size} columns once",
            counted == sheet.columns.size,
            "column multiplicity of the sheet",
        ),
    ]


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Creases, columns and cells of the sheet, and one cell's dimensions."""
    with styled():
        figure = canvas(7.2, 5.0)
        plan, single = figure.subplots(1, 2)
        _draw_plan(plan, setting.design)
        _draw_cell(single, setting.design.cell)
        lay_out(figure)
    return Plate(
        name="figure_s6",
        title="Figure S6",
        caption="Figure S6, computed here. Left: plan of the folded sheet with mountain creases "
        "solid and valley creases dashed, one column under each bottom vertex, coloured by how "
        "many cells share it, and cells numbered n,m at their loaded top vertices. Right: one cell "
        "with its bottom vertices 1 to 6, its four top creases c1 to c4 and its dimensions.",
        figure=figure,
        rows=tuple(sheet_rows(setting.design)),
    )


def _crease(mountain: bool, width: float) -> Look:
    """How a crease is drawn."""
    line: Look = (
        {"color": INK, "linestyle": "-"} if mountain else {"color": BLUE, "linestyle": _DASHED}
    )
    return line | {"linewidth": width}


def _draw_plan(axis: Axes, design: SkinDesign) -> None:
    """The whole sheet from above, mm."""
    sheet = geometry(design).sheet
    place = sheet.vertices[:, :2] * 1e3
    for facet in sheet.facets:
        axis.fill(*place[facet].T, facecolor="#f4f4f2", edgecolor="#bdbdbd", linewidth=0.4)
    for ends, mountain in zip(sheet.creases, sheet.mountain, strict=True):
        axis.plot(*place[ends].T, **_crease(bool(mountain), 0.9))
    handles = []
    for count, colour, marker in _SHARED:
        chosen = place[sheet.columns[column_multiplicity(design.cells) == count]]
        column: Look = {"color": colour, "marker": marker, "linestyle": "none", "markersize": 4}
        axis.plot(*chosen.T, **column, markeredgecolor="white", markeredgewidth=0.4)
        label = f"column of {count} cell{'s' if count > 1 else ''}"
        handles.append(Line2D([], [], label=label, **column))
    for name, mountain in (("mountain", True), ("valley", False)):
        handles.append(Line2D([], [], label=f"{name} crease", **_crease(mountain, 0.9)))
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
    middle: Look = {"ha": "center", "va": "center", "bbox": box, "in_layout": False}
    for n, m in np.ndindex(design.cells):
        note(axis, f"{n + 1},{m + 1}", place[sheet.loaded[n, m]], (0, 0), fontsize=5.5, **middle)
    axis.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2)
    axis.set(xlabel="x (mm)", ylabel="y (mm)", title="sheet", aspect="equal")
    open_axes(axis)


def _draw_cell(axis: Axes, cell: MiuraCell) -> None:
    """One cell seen from the front, the right and above."""
    sheet, extent = build_sheet(cell, (1, 1)), size(cell)
    seen = _seen(sheet.vertices)
    grid, space = seen.reshape(3, 3, 2), sheet.vertices.reshape(3, 3, 3)
    distance = (sheet.vertices[sheet.facets].mean(axis=1) @ _TOWARDS).argsort()
    for facet in sheet.facets[distance]:
        axis.fill(*seen[facet].T, facecolor="#eef1f4", edgecolor=GREY, linewidth=0.7, alpha=0.85)
    for pair, mountain in zip(sheet.creases, sheet.mountain, strict=True):
        axis.plot(*seen[pair].T, **_crease(bool(mountain), 1.4))
    box = {"boxstyle": "circle,pad=0.25", "facecolor": GREEN, "edgecolor": "white"}
    for number, corner in enumerate(((2, 2), (1, 2), (0, 2), (0, 0), (1, 0), (2, 0)), start=1):
        at = grid[corner]
        note(axis, str(number), at, (0, 0), ha="center", va="center", color="white", bbox=box)
    top = grid[1, 1]
    for name, end in (("c1", (1, 2)), ("c2", (2, 1)), ("c3", (1, 0)), ("c4", (0, 1))):
        away, side = ((2, -9), "left") if name == "c2" else ((-4, 1), "right")
        note(axis, name, top + 0.55 * (grid[end] - top), away, color=RED, ha=side)
    axis.plot(*top, "o", color=INK, markersize=4.5)
    before, beside = np.array([0, -15e-3, 0]), np.array([4e-3, 0, 0])
    _draw_span(axis, space[0, 0] + before, space[2, 0] + before, "l")
    _draw_span(axis, space[2, 0] + beside, space[2, 2] + beside, "w")
    _draw_span(axis, space[1, 1] * (1, 1, 0), space[1, 1], "h")
    note(axis, "a", (grid[2, 0] + grid[2, 1]) / 2, (4, -8), style="italic")
    note(axis, "b", (grid[1, 0] + grid[2, 0]) / 2, (4, -8), style="italic")
    sides = np.array([space[2, 0] - space[1, 0], space[1, 1] - space[1, 0]])
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    share = np.linspace(0, 1, 20)[:, None]
    arc = (1 - share) * sides[0] + share * sides[1]
    arc *= 3.5e-3 / np.linalg.norm(arc, axis=1, keepdims=True)
    corner_arc = _seen(space[1, 0] + arc)
    axis.plot(*corner_arc.T, color=RED, linewidth=0.9)
    note(axis, "α", corner_arc[10], (3, 1), color=RED)
    origin = space[0, 0] + 0.6 * before - 2.5 * beside
    for name, unit in zip("XYZ", np.eye(3) * 6e-3, strict=True):
        _draw_span(axis, origin, origin + unit, name, style="->", at=1.25)
    length, width, height = (float(side) * 1e3 for side in extent)
    text = (
        f"a = {cell.panel_a * 1e3:.2f} mm   b = {cell.panel_b * 1e3:.2f} mm\n"
        f"α = {np.degrees(cell.sector_angle):.2f}°   φ = {np.degrees(cell.fold_angle):.2f}°, "
        f"b-creases to y in plan\nl = {length:.2f} mm   w = {width:.2f} mm   h = {height:.2f} mm"
    )
    axis.text(0.5, -0.06, text, transform=axis.transAxes, ha="center", va="top", linespacing=1.6)
    axis.set(title="cell", aspect="equal")
    axis.autoscale_view()
    axis.axis("off")


def _seen(points: Floats) -> Floats:
    """Points of space on the paper, mm."""
    right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    return np.stack([points @ right, points @ np.cross(_TOWARDS, right)], axis=-1) * 1e3


def _draw_span(
    axis: Axes, start: Floats, end: Floats, name: str, style: str = "<->", at: float = 0.5
) -> None:
    """An arrow in space with its name at a share of its length."""
    line = _seen(np.stack([start, end]))
    arrow = {"arrowstyle": style, "color": GREY, "linewidth": 0.8}
    first, last = ((float(x), float(y)) for x, y in line)
    axis.annotate("", last, first, arrowprops=arrow)
    apart = (4, -9) if at == 0.5 else (0, 0)
    note(axis, name, line[0] + at * (line[1] - line[0]), apart, style="italic")
    axis.update_datalim([first, tuple(line[0] + 1.4 * (line[1] - line[0]))])


if __name__ == "__main__":
    plate(Setting()).show()
