"""Draws Figure S6: the sheet's creases and columns in plan, and one cell in space."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper.style import BLUE, GREEN, GREY, INK, ORANGE, RED, Plate, lay_out, styled
from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.origami.cell import size
from smoskin.origami.sheet import build_sheet

_AZIMUTH, _ELEVATION = np.radians(-76.0), np.radians(48.0)
_TOWARDS: Final = np.array(
    [
        np.cos(_ELEVATION) * np.cos(_AZIMUTH),
        np.cos(_ELEVATION) * np.sin(_AZIMUTH),
        np.sin(_ELEVATION),
    ]
)
"""From the cell to the eye."""


def crease_plate(cell: MiuraCell, cells: tuple[int, int]) -> Plate:
    """Figure S6: creases, columns and cells of the sheet, and one cell's dimensions."""
    with styled():
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        plan, single = figure.subplots(1, 2, width_ratios=(1, 1))
        _draw_plan(plan, cell, cells)
        _draw_cell(single, cell)
        lay_out(figure)
    return Plate(
        name="figure_s6",
        title="Figure S6",
        caption="Figure S6, computed here. Left: plan of the folded sheet with mountain creases "
        "solid and valley creases dashed, one column under each bottom vertex, coloured by how "
        "many cells share it, and cells numbered n,m at their loaded top vertices. Right: one cell "
        "with its bottom vertices 1 to 6, its four top creases c1 to c4 and its dimensions.",
        figure=figure,
    )


def _draw_plan(axis: Axes, cell: MiuraCell, cells: tuple[int, int]) -> None:
    """The whole sheet from above, mm."""
    sheet = build_sheet(cell, cells)
    place = sheet.vertices[:, :2] * 1e3
    for facet in sheet.facets:
        axis.fill(*place[facet].T, facecolor="#f4f4f2", edgecolor="#bdbdbd", linewidth=0.4)
    for ends, mountain in zip(sheet.creases, sheet.mountain, strict=True):
        axis.plot(
            *place[ends].T, color=INK if mountain else BLUE, linewidth=0.9,
            linestyle="-" if mountain else (0, (3, 2)),
        )  # fmt: skip
    shares = ((1, GREEN, "o"), (2, ORANGE, "s"), (4, RED, "D"))
    for count, colour, marker in shares:
        chosen = place[sheet.columns[sheet.multiplicity == count]]
        axis.plot(*chosen.T, marker, color=colour, markersize=3.6, linestyle="none",
                  markeredgecolor="white", markeredgewidth=0.4)  # fmt: skip
    for n, m in np.ndindex(cells):
        axis.annotate(
            f"{n + 1},{m + 1}", _pair(place[sheet.loaded[n, m]]), ha="center", va="center",
            fontsize=5.5,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"},
            in_layout=False,
        )  # fmt: skip
    handles = [
        *(
            Line2D([], [], color=colour, marker=marker, linestyle="none", markersize=4,
                   label=f"column of {count} cell{'s' if count > 1 else ''}")
            for count, colour, marker in shares
        ),
        Line2D([], [], color=INK, linewidth=0.9, label="mountain crease"),
        Line2D([], [], color=BLUE, linewidth=0.9, linestyle=(0, (3, 2)), label="valley crease"),
    ]  # fmt: skip
    axis.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2,
                fontsize=7, handlelength=2.2, columnspacing=1.2)  # fmt: skip
    axis.set(xlabel="x (mm)", ylabel="y (mm)", title="sheet")
    axis.set_aspect("equal")
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def _draw_cell(axis: Axes, cell: MiuraCell) -> None:
    """One cell seen from the front, the right and above."""
    sheet, extent = build_sheet(cell, (1, 1)), size(cell)
    seen = _seen(sheet.vertices)
    grid, space = seen.reshape(3, 3, 2), sheet.vertices.reshape(3, 3, 3)
    distance = (sheet.vertices[sheet.facets].mean(axis=1) @ _TOWARDS).argsort()
    for facet in sheet.facets[distance]:
        axis.fill(*seen[facet].T, facecolor="#eef1f4", edgecolor=GREY, linewidth=0.7, alpha=0.85)
    for ends, mountain in zip(sheet.creases, sheet.mountain, strict=True):
        axis.plot(*seen[ends].T, color=INK if mountain else BLUE, linewidth=1.4,
                  linestyle="-" if mountain else (0, (3, 2)))  # fmt: skip
    numbers = {(2, 2): "1", (1, 2): "2", (0, 2): "3", (0, 0): "4", (1, 0): "5", (2, 0): "6"}
    for (i, j), number in numbers.items():
        axis.annotate(
            number, grid[i, j], ha="center", va="center", fontsize=7, color="white", zorder=5,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": GREEN, "edgecolor": "white"},
        )  # fmt: skip
    top = grid[1, 1]
    ends = {"c1": grid[1, 2], "c2": grid[2, 1], "c3": grid[1, 0], "c4": grid[0, 1]}
    for name, end in ends.items():
        right = name == "c2"
        axis.annotate(
            name, top + 0.55 * (end - top), (2, -9) if right else (-4, 1), color=RED,
            textcoords="offset points", ha="left" if right else "right",
        )  # fmt: skip
    axis.plot(*top, "o", color=INK, markersize=4.5)
    foot = space[1, 1] * (1, 1, 0)
    before, beside = np.array([0, -15e-3, 0]), np.array([4e-3, 0, 0])
    spans = (
        (space[0, 0] + before, space[2, 0] + before, "l"),
        (space[2, 0] + beside, space[2, 2] + beside, "w"),
        (foot, space[1, 1], "h"),
    )
    for start, end, name in spans:
        line = _seen(np.stack([start, end]))
        axis.annotate(
            "",
            _pair(line[0]),
            _pair(line[1]),
            arrowprops={"arrowstyle": "<->", "color": GREY, "linewidth": 0.8},
        )
        axis.annotate(name, line.mean(axis=0), (4, -9), textcoords="offset points", style="italic")
        axis.update_datalim(line)
    for edge, name in (((grid[2, 0], grid[2, 1]), "a"), ((grid[1, 0], grid[2, 0]), "b")):
        axis.annotate(name, (edge[0] + edge[1]) / 2, (4, -8), textcoords="offset points",
                      style="italic")  # fmt: skip
    sides = np.array([space[2, 0] - space[1, 0], space[1, 1] - space[1, 0]])
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    turn = np.linspace(0, 1, 20)[:, None]
    arc = (1 - turn) * sides[0] + turn * sides[1]
    arc *= 3.5e-3 / np.linalg.norm(arc, axis=1, keepdims=True)
    corner = _seen(space[1, 0] + arc)
    axis.plot(*corner.T, color=RED, linewidth=0.9)
    axis.annotate("α", corner[10], (3, 1), textcoords="offset points", color=RED)
    _draw_axes(axis, space[0, 0] + 0.6 * before - 2.5 * beside)
    axis.text(
        0.5, -0.06,
        f"a = {cell.panel_a * 1e3:.2f} mm   b = {cell.panel_b * 1e3:.2f} mm\n"
        f"α = {np.degrees(cell.sector_angle):.2f}°   φ = {np.degrees(cell.fold_angle):.2f}°, "
        "b-creases to y in plan\n"
        f"l = {float(extent.length) * 1e3:.2f} mm   w = {float(extent.width) * 1e3:.2f} mm   "
        f"h = {float(extent.height) * 1e3:.2f} mm",
        transform=axis.transAxes, ha="center", va="top", linespacing=1.6,
    )  # fmt: skip
    axis.set(title="cell")
    axis.set_aspect("equal")
    axis.autoscale_view()
    axis.axis("off")


def _seen(points: Floats) -> Floats:
    """Points of space on the paper, mm."""
    right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    return np.stack([points @ right, points @ np.cross(_TOWARDS, right)], axis=-1) * 1e3


def _pair(point: Floats) -> tuple[float, float]:
    """A point of the paper as Matplotlib's types want it."""
    return float(point[0]), float(point[1])


def _draw_axes(axis: Axes, origin: Floats) -> None:
    """The directions X, Y and Z."""
    start = _seen(origin)
    for name, unit in zip("XYZ", np.eye(3) * 6e-3, strict=True):
        end = _seen(origin + unit)
        axis.annotate("", _pair(end), _pair(start), arrowprops={"arrowstyle": "->", "color": INK})
        axis.update_datalim([start, start + 1.4 * (end - start)])
        axis.annotate(
            name, _pair(start + 1.25 * (end - start)), ha="center", va="center", fontsize=7
        )
