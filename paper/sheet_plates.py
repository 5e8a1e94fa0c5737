"""Draws the whole sheet's motion under one press, and what cover panels change (Figure S16)."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from paper.sheet_presses import FORCE, PRESSED, Coverage, Covers, PressField
from paper.style import BLUE, GREY, INK, ORANGE, RED, Plate, lay_out, styled
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry

_MAP: Final = "cividis"
_SINK_MAP: Final = "Blues"
_ARROW: Final = 14.0
"""mm on the paper's skin for the longest arrow."""


def press_plate(design: SkinDesign, found: PressField) -> Plate:
    """Motion of columns, magnets and sheet under one press, beside the reduced model's."""
    n, m = PRESSED
    sheet = geometry(design).sheet
    feet = sheet.columns
    with styled():
        figure = Figure(figsize=(7.2, 7.0), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=(3.2, 1))
        whole, reduced = (figure.add_subplot(grid[0, k]) for k in range(2))
        section = figure.add_subplot(grid[1, :])
        sunk = -found.moved[:, 2] * 1e6
        shades = Normalize(min(0.0, float(sunk[feet].min())), float(sunk[feet].max()))
        _draw_plan(whole, design, sunk, shades)
        _draw_plan(reduced, design, np.zeros_like(sunk), shades)
        own = _draw_arrows(whole, found.vertices[feet], found.moved[feet][..., :2])
        other = _draw_arrows(reduced, found.vertices[feet], found.reduced)
        _draw_magnets(whole, design, found, own)
        whole.set_title(f"(a) whole sheet, arrows x {own:.0f}")
        reduced.set_title(f"(b) reduced model, arrows x {other:.0f}")
        colours = whole.collections[0]
        bar = figure.colorbar(colours, ax=[whole, reduced], shrink=0.7, label="sink (µm)")
        bar.outline.set_visible(False)
        if bar.solids is not None:
            bar.solids.set(rasterized=False, edgecolor="face")
        _draw_section(section, design, found)
        lay_out(figure)
    moved = np.linalg.norm(found.moved[feet][..., :2], axis=-1).max() * 1e6
    theory = np.linalg.norm(found.reduced, axis=-1).max() * 1e6
    tilt = np.linalg.norm(found.magnets[:, 3:5], axis=1).max() * 1e3
    return Plate(
        name="displacement_field",
        title="Displacement field under a press",
        caption=f"A press of {FORCE:g} N on cell ({n + 1},{m + 1}); not in the paper. (a) The "
        f"whole sheet sinks by {found.press * 1e3:.2f} mm at the pressed vertex; columns move by "
        f"up to {moved:.0f} µm in the plane (arrows), colours show how far the sheet sinks; "
        f"circles are the magnets, with what they move in the plane; they sink by up to "
        f"{-found.magnets[:, 2].min() * 1e3:.2f} mm and tilt by up to {tilt:.1f} mrad. (b) The "
        f"reduced model under the same force: {found.reduced_press * 1e3:.2f} mm, up to "
        f"{theory:.0f} µm, and no column sinks. (c) The row of vertices through the pressed one "
        "and the columns on either side: the sheet sinks and tilts on its columns much as a rigid "
        f"plate would ({found.plate * 1e3:.2f} mm in the mean), so that what is pressed hardly "
        "folds.",
        figure=figure,
    )


def _draw_plan(axis: Axes, design: SkinDesign, sunk: Floats, shades: Normalize) -> None:
    """Panels from above, coloured by how far their corners sink, mm."""
    sheet = geometry(design).sheet
    place = sheet.vertices[:, :2] * 1e3
    side = 2 * design.cells[0] + 1
    x, y, z = (one.reshape(side, -1) for one in (place[:, 0], place[:, 1], sunk))
    axis.pcolormesh(
        x, y, (z[:-1, :-1] + z[1:, :-1] + z[1:, 1:] + z[:-1, 1:]) / 4, cmap=_SINK_MAP,
        norm=shades, edgecolor="white", linewidth=0.2,
    )  # fmt: skip
    axis.plot(*place[sheet.loaded[PRESSED]], "v", color=RED, markersize=6, markeredgecolor="white",
              zorder=5)  # fmt: skip
    low, high = place.min(axis=0) - _ARROW, place.max(axis=0) + _ARROW
    axis.set(xlabel="x (mm)", ylabel="y (mm)", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axis.set_aspect("equal")
    axis.spines[:].set_visible(False)


def _draw_arrows(axis: Axes, rest: Floats, moved: Floats) -> float:
    """Motion of the columns; returns how many times it is enlarged."""
    longest = float(np.linalg.norm(moved, axis=-1).max()) * 1e3
    factor = float(f"{_ARROW / longest:.1g}")
    place, shift = rest.reshape(-1, 3)[:, :2] * 1e3, moved.reshape(-1, 2) * 1e3 * factor
    axis.quiver(*place.T, *shift.T, **_quiver(), color=INK, width=0.005)
    return factor


def _quiver() -> dict[str, Any]:
    """Arrows in the units of the axes."""
    return {"angles": "xy", "scale_units": "xy", "scale": 1, "zorder": 4, "headwidth": 3.5}


def _draw_magnets(axis: Axes, design: SkinDesign, found: PressField, factor: float) -> None:
    """Magnets of the sheet, what they move in the plane and by how much they tilt."""
    places = geometry(design).magnets * 1e3
    for magnet, place, motion in zip(design.magnets, places, found.magnets, strict=True):
        if magnet.mount != "sheet":
            continue
        x, y = float(place[0]), float(place[1])
        axis.add_patch(Circle((x, y), magnet.radius * 1e3, facecolor="none", edgecolor=ORANGE,
                              linewidth=1.4, zorder=5))  # fmt: skip
        axis.quiver(x, y, *(motion[:2] * 1e3 * factor), **_quiver(), color=ORANGE, width=0.008)
        tilt = float(np.linalg.norm(motion[3:5])) * 1e3
        axis.annotate(
            f"{magnet.name}: {tilt:.1f} mrad", (x, y), (0, -19), textcoords="offset points",
            ha="center", fontsize=6.5, zorder=6,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"},
        )  # fmt: skip


def _draw_section(axis: Axes, design: SkinDesign, found: PressField) -> None:
    """Sink along x of the pressed row of top vertices and of the columns beside it."""
    side = 2 * design.cells[0] + 1
    x = found.vertices[:, 0].reshape(side, -1) * 1e3
    sunk = -found.moved[:, 2].reshape(side, -1) * 1e3
    row = 2 * PRESSED[1] + 1
    axis.plot(x[:, row], sunk[:, row], "-o", color=INK, markersize=3, label="top vertices")
    for beside, colour, name in (
        (row - 1, BLUE, "columns before it"), (row + 1, ORANGE, "columns behind it")
    ):  # fmt: skip
        axis.plot(x[:, beside], sunk[:, beside], "-s", color=colour, markersize=2.5, linewidth=0.8,
                  label=name)  # fmt: skip
    axis.plot(x[2 * PRESSED[0] + 1, row], found.reduced_press * 1e3, "v", color=RED, markersize=5,
              label="pressed vertex, reduced model")  # fmt: skip
    axis.axhline(0, color=GREY, linewidth=0.5)
    axis.invert_yaxis()
    axis.set(title="(c) sink along the pressed row", xlabel="x (mm)", ylabel="sink (mm)")
    axis.legend(fontsize=6.5, ncols=2, loc="lower right")
    for edge in ("top", "right"):
        axis.spines[edge].set_visible(False)


def cover_plate(found: Covers) -> Plate:
    """Figure S16: presses all over each cell, by a bare finger and through cover panels."""
    bare, covered = found.bare, found.covered
    with styled():
        figure = Figure(figsize=(7.2, 6.6), layout="constrained")
        grid = figure.add_gridspec(2, 2)
        one = figure.add_subplot(grid[0, 0])
        other = figure.add_subplot(grid[0, 1], sharex=one, sharey=one)
        _draw_motions(one, bare)
        _draw_motions(other, covered)
        one.legend(fontsize=6.5, markerscale=3, ncols=2, handletextpad=0.1, columnspacing=0.8)
        one.set_title("(a) bare finger")
        other.set_title("(b) through cover panels")
        _draw_spread(figure.add_subplot(grid[1, 0]), bare)
        _draw_errors(figure.add_subplot(grid[1, 1]), found)
        lay_out(figure)
    cells = bare.spread.size
    return Plate(
        name="figure_s16",
        title="Figure S16",
        caption="What the structure of Figure S16 does, by the model; the paper prints no number. "
        f"{FORCE:g} N at {bare.places.shape[2]} places of each cell. (a, b) Motion in x of both "
        "magnets; rings: a press on the cell's vertex. Under a bare finger it spreads with the "
        f"place, by {_percent(bare.spread.mean())} in the mean (c); a cover panel, guided along z, "
        f"makes it the same all over the cell, to {_rounding(float(covered.spread.max()))}. Named "
        "by the vertex whose press moves both magnets most nearly the same way, without noise, "
        f"{_percent(bare.found.mean())} and {_percent(covered.found.mean())} of the places fall "
        f"to their own cell, whose middle is {bare.place_error.mean() * 1e3:.1f} and "
        f"{covered.place_error.mean() * 1e3:.1f} mm away in the mean (d): covers make every place "
        "count, as the paper says, without making the skin finer. The theoretical table is not "
        f"enough on this sheet: its signs hold for {bare.agreeing} of {cells} cells under a finger "
        f"and for {covered.agreeing} through covers.",
        figure=figure,
    )


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _rounding(spread: float) -> str:
    """A spread of rounding, or its percent."""
    return "rounding" if spread < 1e-9 else f"{100 * spread:.2g} %"


def _draw_motions(axis: Axes, found: Coverage) -> None:
    """Motion in x of the two magnets, for each place of each cell, µm."""
    columns = found.motion.shape[0]
    colours = [f"C{k}" for k in range(columns)]
    for n in range(columns):
        points = found.motion[n, ..., 0].reshape(-1, found.motion.shape[-2]) * 1e6
        axis.plot(points[:, 0], points[:, 1], ".", color=colours[n], markersize=2.2,
                  markeredgewidth=0, label=f"n = {n + 1}")  # fmt: skip
        table = found.table[n, ..., 0] * 1e6
        axis.plot(table[:, 0], table[:, 1], "o", color=colours[n], markersize=4.5,
                  markeredgecolor=INK, markeredgewidth=0.5)  # fmt: skip
    axis.axhline(0, color=GREY, linewidth=0.4)
    axis.axvline(0, color=GREY, linewidth=0.4)
    axis.set(xlabel="magnet 2, x (µm)", ylabel="magnet 3, x (µm)")
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def _draw_spread(axis: Axes, found: Coverage) -> None:
    """Spread of the motion within each cell, and the share of places named right."""
    spread = 100 * found.spread
    columns, rows = spread.shape
    axis.pcolormesh(
        np.arange(columns + 1) + 0.5, np.arange(rows + 1) + 0.5, spread.T, cmap=_MAP, vmin=0,
        vmax=40, edgecolor="white", linewidth=0.6,
    )  # fmt: skip
    for n, m in np.ndindex(columns, rows):
        axis.text(
            n + 1, m + 1, f"{spread[n, m]:.0f}\n({100 * found.found[n, m]:.0f})", ha="center",
            va="center", fontsize=6, color="black" if spread[n, m] > 20 else "white",
            linespacing=1.1,
        )  # fmt: skip
    axis.set(title="(c) spread in a cell (places found), %", xlabel="cell n along x")
    axis.set_ylabel("cell m along y")
    axis.set(xticks=range(1, columns + 1), yticks=range(1, rows + 1))
    axis.set_aspect("equal")
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)


def _draw_errors(axis: Axes, found: Covers) -> None:
    """Share of the places over how far the named cell's middle is from the touch."""
    for one, name, colour in (
        (found.bare, "bare finger", BLUE), (found.covered, "cover panels", ORANGE)
    ):  # fmt: skip
        errors = np.sort(one.place_error.ravel()) * 1e3
        axis.plot(errors, 100 * (np.arange(errors.size) + 1) / errors.size, color=colour,
                  linewidth=1.2, label=name)  # fmt: skip
    axis.set(
        title="(d) place error", xlabel="touch to the middle of the cell named (mm)",
        ylabel="share of places (%)", xlim=(0, None), ylim=(0, 101),
    )  # fmt: skip
    axis.legend(fontsize=6.5, loc="lower right")
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
