"""
Displacement field under a press
================================

Not in the paper: what one press does to the whole sheet, its columns and magnets, beside what the
reduced model (S7-S11) says of the same force.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.patches import Circle

from paper.models.reduction import magnet_motion
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    RED,
    Look,
    Plate,
    canvas,
    colour_bar,
    lay_out,
    note,
    open_axes,
    styled,
)
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.reduced.attenuation import column_displacements, profiles
from smoskin.mechanics.reduced.stiffness import stiffness_map
from smoskin.mechanics.sheet.lattice import column_beam
from smoskin.mechanics.sheet.model import BarHinge
from smoskin.mechanics.sheet.touches import Sticking, Touches
from smoskin.origami.geometry import geometry

PRESSED: Final = (2, 2)
"""The pressed cell, from 0: (3,3) of the SI."""
FORCE: Final = 0.5
"""N."""
_POINT: Final = 1e-6
"""m: radius of a touch on one vertex."""
_ARROW: Final = 14.0
"""mm on the paper's skin for the longest arrow."""
_QUIVER: Final[Look] = {"angles": "xy", "scale_units": "xy", "scale": 1, "zorder": 4}
"""Arrows in the units of the axes."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressField:
    """The whole sheet under a press on one vertex, and the reduced one under the same force."""

    vertices: Floats
    """(V, 3), m: at rest."""
    moved: Floats
    """(V, 3), m: displacements over the board."""
    magnets: Floats
    """(G, 6), m and rad: motion of each magnet; zero on the base."""
    reduced: Floats
    """(2N + 1, M + 1, 2), m: motion of the columns by the reduced model; they sink by nothing."""
    press: float
    """m: sink of the loaded vertex."""
    reduced_press: float
    """m: its sink by the reduced model."""
    plate: float
    """m: mean sink of a rigid plate on the same columns."""


def press_field(design: SkinDesign) -> PressField:
    """Press one cell's vertex with a finger that sticks to it."""
    sheet = geometry(design).sheet
    vertex = sheet.loaded[PRESSED]
    pressed = BarHinge(design, grip=Sticking()).press(
        Touches(
            position=geometry(design).tops.reshape(-1, 1, 2),
            force=np.broadcast_to([0.0, 0.0, -FORCE], (sheet.loaded.size, 1, 3)),
            radius=_POINT,
        )
    )
    moved = pressed.displacements.reshape(*design.cells, -1, 3)[PRESSED]
    coefficients = design.coefficients
    reduced_press = FORCE / float(stiffness_map(design, coefficients)[PRESSED])
    parts = profiles(design.cell, design.cells, coefficients.attenuation, -reduced_press)
    return PressField(
        vertices=sheet.vertices,
        moved=moved,
        magnets=magnet_motion(design, moved),
        reduced=column_displacements(parts, PRESSED),
        press=float(-moved[vertex, 2]),
        reduced_press=reduced_press,
        plate=FORCE / (sheet.columns.size * column_beam(design).axial),
    )


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Motion of columns, magnets and sheet under one press, beside the reduced model's."""
    return draw(setting.design, press_field(setting.design))


def draw(design: SkinDesign, result: PressField) -> Plate:
    """Both plans, and a section through the pressed row."""
    n, m = PRESSED
    sheet = geometry(design).sheet
    feet = sheet.columns
    with styled():
        figure = canvas(7.2, 7.0)
        grid = figure.add_gridspec(2, 2, height_ratios=(3.2, 1))
        whole, reduced = (figure.add_subplot(grid[0, k]) for k in range(2))
        section = figure.add_subplot(grid[1, :])
        sunk = -result.moved[:, 2] * 1e6
        shades = Normalize(min(0.0, float(sunk[feet].min())), float(sunk[feet].max()))
        _draw_plan(whole, design, sunk, shades)
        _draw_plan(reduced, design, np.zeros_like(sunk), shades)
        own = _draw_arrows(whole, result.vertices[feet], result.moved[feet][..., :2])
        other = _draw_arrows(reduced, result.vertices[feet], result.reduced)
        _draw_magnets(whole, design, result, own)
        whole.set_title(f"(a) whole sheet, arrows x {own:.0f}")
        reduced.set_title(f"(b) reduced model, arrows x {other:.0f}")
        colour_bar(figure, whole.collections[0], [whole, reduced], "sink (µm)", shrink=0.7)
        _draw_section(section, design, result)
        lay_out(figure)
    moved = np.linalg.norm(result.moved[feet][..., :2], axis=-1).max() * 1e6
    theory = np.linalg.norm(result.reduced, axis=-1).max() * 1e6
    tilt = np.linalg.norm(result.magnets[:, 3:5], axis=1).max() * 1e3
    return Plate(
        name="displacement_field",
        title="Displacement field under a press",
        caption=f"A press of {FORCE:g} N on cell ({n + 1},{m + 1}); not in the paper. (a) The "
        f"whole sheet sinks by {result.press * 1e3:.2f} mm at the pressed vertex; columns move by "
        f"up to {moved:.0f} µm in the plane (arrows), colours show how far the sheet sinks; "
        f"circles are the magnets, with what they move in the plane; they sink by up to "
        f"{-result.magnets[:, 2].min() * 1e3:.2f} mm and tilt by up to {tilt:.1f} mrad. (b) The "
        f"reduced model under the same force: {result.reduced_press * 1e3:.2f} mm, up to "
        f"{theory:.0f} µm, and no column sinks. (c) The row of vertices through the pressed one "
        "and the columns on either side: the sheet sinks and tilts on its columns "
        f"({result.plate * 1e3:.2f} mm in the mean, as a rigid plate would) and folds round the "
        "pressed vertex.",
        figure=figure,
    )


def _draw_plan(axis: Axes, design: SkinDesign, sunk: Floats, shades: Normalize) -> None:
    """Panels from above, coloured by how far their corners sink, mm."""
    sheet = geometry(design).sheet
    place = sheet.vertices[:, :2] * 1e3
    side = 2 * design.cells[0] + 1
    x, y, z = (item.reshape(side, -1) for item in (place[:, 0], place[:, 1], sunk))
    sink = (z[:-1, :-1] + z[1:, :-1] + z[1:, 1:] + z[:-1, 1:]) / 4
    axis.pcolormesh(x, y, sink, cmap="Blues", norm=shades, edgecolor="white", linewidth=0.2)
    mark: Look = {"marker": "v", "color": RED, "markersize": 6, "zorder": 5}
    axis.plot(*place[sheet.loaded[PRESSED]], markeredgecolor="white", **mark)
    low, high = place.min(axis=0) - _ARROW, place.max(axis=0) + _ARROW
    axis.set(xlabel="x (mm)", ylabel="y (mm)", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axis.set_aspect("equal")
    axis.spines[:].set_visible(False)


def _draw_arrows(axis: Axes, rest: Floats, moved: Floats) -> float:
    """Motion of the columns; returns how many times it is enlarged."""
    longest = float(np.linalg.norm(moved, axis=-1).max()) * 1e3
    factor = float(f"{_ARROW / longest:.1g}")
    place, shift = rest.reshape(-1, 3)[:, :2] * 1e3, moved.reshape(-1, 2) * 1e3 * factor
    axis.quiver(*place.T, *shift.T, **_QUIVER, color=INK, width=0.005)
    return factor


def _draw_magnets(axis: Axes, design: SkinDesign, result: PressField, factor: float) -> None:
    """Magnets of the sheet, what they move in the plane and by how much they tilt."""
    places = geometry(design).magnets * 1e3
    for magnet, place, motion in zip(design.magnets, places, result.magnets, strict=True):
        if magnet.mount != "sheet":
            continue
        x, y = float(place[0]), float(place[1])
        ring = {"facecolor": "none", "edgecolor": ORANGE, "linewidth": 1.4, "zorder": 5}
        axis.add_patch(Circle((x, y), magnet.radius * 1e3, **ring))
        axis.quiver(x, y, *(motion[:2] * 1e3 * factor), **_QUIVER, color=ORANGE, width=0.008)
        tilt = float(np.linalg.norm(motion[3:5])) * 1e3
        box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
        text = f"{magnet.name}: {tilt:.1f} mrad"
        note(axis, text, (x, y), (0, -19), ha="center", zorder=6, bbox=box)


def _draw_section(axis: Axes, design: SkinDesign, result: PressField) -> None:
    """Sink along x of the pressed row of top vertices and of the columns beside it."""
    side = 2 * design.cells[0] + 1
    x = result.vertices[:, 0].reshape(side, -1) * 1e3
    sunk = -result.moved[:, 2].reshape(side, -1) * 1e3
    row = 2 * PRESSED[1] + 1
    axis.plot(x[:, row], sunk[:, row], "-o", color=INK, markersize=3, label="top vertices")
    line: Look = {"marker": "s", "markersize": 2.5, "linewidth": 0.8}
    axis.plot(x[:, row - 1], sunk[:, row - 1], color=BLUE, label="columns before it", **line)
    axis.plot(x[:, row + 1], sunk[:, row + 1], color=ORANGE, label="columns behind it", **line)
    vertex = x[2 * PRESSED[0] + 1, row], result.reduced_press * 1e3
    axis.plot(*vertex, "v", color=RED, markersize=5, label="pressed vertex, reduced model")
    axis.axhline(0, color=GREY, linewidth=0.5)
    axis.invert_yaxis()
    axis.set(title="(c) sink along the pressed row", xlabel="x (mm)", ylabel="sink (mm)")
    axis.legend(ncols=2, loc="lower right")
    open_axes(axis)


if __name__ == "__main__":
    plate(Setting()).show()
