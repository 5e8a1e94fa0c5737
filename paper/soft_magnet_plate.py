"""Draws Figure S10 anew: magnetisation loop, soft magnet under a press, folded sheet beside it."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import FuncFormatter, MaxNLocator

from paper.models.magnetisation import OERSTED, MagnetisationLoop
from paper.models.soft_magnet import STANDOFF, magnetisation
from paper.soft_magnet_figure import AWAY, DEPTHS, PATCH, POINTS, Comparison
from paper.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    RED,
    Plate,
    lay_out,
    styled,
)
from smoskin.arrays import Ints

_MAP: Final = "cividis"
_MOVED_MAP: Final = "Blues"
_CHANGES: Final = (0.3, 1.0, 3.0, 10.0, 30.0)
"""mT: lines of equal change."""
_STATES: Final = ("at rest", "pressed")


def soft_magnet_plate(found: Comparison, loop: MagnetisationLoop) -> Plate:
    """Figures S10a to S10e, and the folded sheet against distance."""
    with styled():
        figure = Figure(figsize=(7.2, 7.2), layout="constrained")
        parts = figure.subfigures(2, 1, squeeze=False, height_ratios=(2, 1))
        axes = parts[0, 0].subplots(2, 2)
        _draw_loop(axes[0, 0], loop)
        _draw_depths(axes[0, 1], found)
        _draw_plan(axes[1, 0], found)
        _draw_distances(axes[1, 1], found)
        _draw_sections(parts[1, 0], found)
        lay_out(figure)
    length, width, height = (side * 1e3 for side in found.magnet.block.size)
    near, far = np.linalg.norm(found.points.changes[-1], axis=-1) * 1e6
    others = "; ".join(
        f"{one.name}: {np.linalg.norm(one.change[1]) * 1e6:.2g} µT" for one in found.variants
    )
    away = np.hypot(*found.sheet.offsets.T) >= AWAY
    return Plate(
        name="figure_s10",
        title="Figures S10a to S10e",
        caption=f"Figure S10, by the model. A soft magnet of {length:.0f} x {width:.0f} x "
        f"{height:.1f} mm (the skin's plan; with the points {STANDOFF * 1e3:.0f} mm under it as "
        "thick as the skin), magnetised towards its middle as S3, bonded below, is pressed by "
        f"{DEPTHS[-1] * 1e3:g} mm on a disc of {PATCH * 1e3:.0f} mm radius. The field changes by "
        f"{near:.0f} µT at (0, 0, -3) and by {far:.2g} µT at (100, 100, -3) mm, which lies beyond "
        f"the magnet's corner: {found.visibility[0]:.0f} and {found.visibility[1]:.2g} times the "
        "noise of one reading on the axis that shows it best. Pressed as deep on cell (1,1), the "
        "folded sheet changes the field at chips 100 mm and more away by "
        f"{found.sheet_visibility[away].min():.0f} times the noise or more. Choices that the "
        f"paper leaves open move the far change, magnetised or held otherwise: {others}. White "
        "lines in (e): change of the field, mT. The loop runs through the two printed points; its "
        "form between them is assumed.",
        figure=figure,
    )


def _draw_loop(axis: Axes, loop: MagnetisationLoop) -> None:
    """Magnetisation against field, in the paper's units."""
    field = np.linspace(-2.2, 2.2, 401) * loop.coercivity
    for branch in (loop.descending(field), loop.ascending(field)):
        axis.plot(field / OERSTED / 1e3, branch / 1e6, color=BLUE, linewidth=1.1)
    axis.axhline(0, color=GREY, linewidth=0.5)
    axis.axvline(0, color=GREY, linewidth=0.5)
    axis.plot(0, loop.remanence / 1e6, "o", color=RED, markersize=4)
    axis.plot(-loop.coercivity / OERSTED / 1e3, 0, "o", color=RED, markersize=4)
    axis.annotate(f"$M_r$ = {loop.remanence / 1e6:.3f}", (0, loop.remanence / 1e6), (-6, 5),
                  textcoords="offset points", ha="right")  # fmt: skip
    axis.annotate(f"$H_{{ci}}$ = {-loop.coercivity / OERSTED:.2f} Oe".replace("-", "−"),
                  (-loop.coercivity / OERSTED / 1e3, 0), (5, 4), textcoords="offset points",
                  fontsize=6.5)  # fmt: skip
    axis.set(title="(a) magnetisation loop", xlabel="field H (kOe)", ylabel="M (emu/mm³)",
             xlim=(-13, 13))  # fmt: skip
    _open(axis)


def _draw_depths(axis: Axes, found: Comparison) -> None:
    """Change against depth, near and far, and the folded sheet's chip nearest to the far point."""
    depth = found.points.depths * 1e3
    nearest = _nearest(found)
    lines = (
        ("soft magnet, (0, 0)", found.points.changes[:, 0], BLUE, "o"),
        ("soft magnet, (100, 100)", found.points.changes[:, 1], ORANGE, "s"),
        (f"folded sheet, {_place(found, nearest)}", found.sheet.changes[:, nearest], GREEN, "D"),
    )
    for name, change, colour, marker in lines:
        size = np.linalg.norm(change, axis=-1) * 1e6
        axis.plot(depth[1:], size[1:], marker, linestyle="-", color=colour, markersize=3.5,
                  linewidth=1.1, label=name)  # fmt: skip
    _draw_noise(axis, found)
    axis.set_yscale("log")
    axis.set(title="(b) change of the field", xlabel="depth of the press (mm)",
             ylabel="|ΔB| (µT)", xlim=(0, None), ylim=(0.05, 1e7))  # fmt: skip
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.legend(fontsize=6.5, loc="upper left", ncols=2, columnspacing=1.0, handlelength=1.6)
    _open(axis)


def _draw_plan(axis: Axes, found: Comparison) -> None:
    """What is pressed and watched, seen from above."""
    length, width, _ = (side * 1e3 for side in found.magnet.block.size)
    axis.add_patch(Rectangle((-length / 2, -width / 2), length, width, facecolor="#eef1f4",
                             edgecolor=GREY, linewidth=0.8))  # fmt: skip
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 5) * length, np.linspace(-0.4, 0.4, 5) * width)
    places = np.stack([x, y, np.zeros_like(x)], axis=-1) * 1e-3
    inward = magnetisation(found.magnet, places) / found.magnet.remanence
    axis.quiver(x, y, inward[..., 0], inward[..., 1], color=GREY, width=0.004, scale=14)
    axis.add_patch(Circle((0, 0), PATCH * 1e3, facecolor=RED, edgecolor="none", alpha=0.6))
    for (px, py), colour, name in zip(POINTS, (BLUE, ORANGE), ("near", "far"), strict=True):
        axis.plot(px * 1e3, py * 1e3, "o", color=colour, markersize=4)
        axis.annotate(f"{name} ({px * 1e3:.0f}, {py * 1e3:.0f}, −{STANDOFF * 1e3:.0f})",
                      (px * 1e3, py * 1e3), (5, -9), textcoords="offset points",
                      fontsize=6.5)  # fmt: skip
    axis.set(title="(c) set-up, from above", xlabel="x (mm)", ylabel="y (mm)", xlim=(-70, 160),
             ylim=(-88, 118))  # fmt: skip
    axis.set_aspect("equal")
    _open(axis)


def _draw_distances(axis: Axes, found: Comparison) -> None:
    """Change against distance from the press, after the whole press."""
    apart = np.hypot(*found.line.offsets.T) * 1e3
    size = np.linalg.norm(found.line.changes[-1], axis=-1) * 1e6
    axis.plot(apart, size, "s-", color=BLUE, markersize=3, linewidth=1.1,
              label="under the soft magnet")  # fmt: skip
    chips = np.hypot(*found.sheet.offsets.T) * 1e3
    axis.plot(chips, np.linalg.norm(found.sheet.changes[-1], axis=-1) * 1e6, "D", color=GREEN,
              markersize=3, label="chips under the folded sheet")  # fmt: skip
    _draw_noise(axis, found, label=None)
    axis.set_yscale("log")
    axis.set(title="(f) both against distance", xlabel="distance from the press (mm)",
             ylabel=f"|ΔB| at {DEPTHS[-1] * 1e3:g} mm (µT)", ylim=(0.05, 1e6))  # fmt: skip
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.legend(fontsize=6.5, loc="lower left")
    _open(axis)


def _draw_sections(figure: SubFigure, found: Comparison) -> None:
    """Motion inside and field outside, in the plane y = 0, at rest and pressed."""
    axes = figure.subplots(1, 2, sharey=True)
    x, z = found.section_x * 1e3, found.section_z * 1e3
    height = found.magnet.block.size[2] * 1e3
    shades = Normalize(0.0, float(found.section.max()) * 1e3)
    moved = Normalize(0.0, DEPTHS[-1] * 1e3)
    faces = _face(found)
    for k, (axis, state) in enumerate(zip(axes, (0, -1), strict=True)):
        for part in (z < 0, z > height):
            colours = axis.contourf(x, z[part], found.section[k][part] * 1e3,
                                    np.linspace(0, shades.vmax or 1, 31), norm=shades,
                                    cmap=_MAP)  # fmt: skip
            colours.set_edgecolor("face")
            if state:
                lines = axis.contour(x, z[part], found.section_change[part] * 1e3, _CHANGES,
                                     colors="white", linewidths=0.6)  # fmt: skip
                axis.clabel(lines, fmt=lambda value: f"{value:g}", fontsize=6)
        shift = found.pressed.displacements[state]
        corners = (found.pressed.mesh.nodes + shift)[faces][..., [0, 2]] * 1e3
        length = np.linalg.norm(shift, axis=-1)[faces].mean(axis=1) * 1e3
        block = PolyCollection(list(corners), array=length, norm=moved, cmap=_MOVED_MAP,
                               edgecolor=GREY, linewidth=0.2)  # fmt: skip
        axis.add_collection(block)
        axis.plot(0, -STANDOFF * 1e3, "o", color="white", markeredgecolor=INK, markersize=4)
        axis.set(title=f"({'de'[k]}) {_STATES[k]}", xlim=(x[0], x[-1]), ylim=(z[0], z[-1]),
                 xlabel="x (mm), section y = 0")  # fmt: skip
        axis.set_aspect("equal")
        _open(axis)
    axes[0].set_ylabel("z (mm)")
    for axis, shown, label in zip(
        axes, (colours, block), ("|B| outside (mT)", "|U| inside (mm)"), strict=True
    ):
        bar = figure.colorbar(shown, ax=axis, orientation="horizontal", label=label, aspect=40,
                              format=FuncFormatter(lambda value, _: f"{value:g}"))  # fmt: skip
        bar.outline.set_visible(False)
        bar.locator = MaxNLocator(5)
        bar.update_ticks()
        if bar.solids is not None:
            bar.solids.set(rasterized=False, edgecolor="face")


def _face(found: Comparison) -> Ints:
    """Corner nodes (F, 4) of the cells' faces in the plane y = 0 that belong to y > 0."""
    mesh = found.pressed.mesh
    here = np.isclose(mesh.nodes[:, 1], 0.0, atol=1e-9)
    behind = mesh.nodes[mesh.cells][..., 1].mean(axis=1) > 0
    touching = mesh.cells[behind & (here[mesh.cells].sum(axis=1) == 4)]
    four = touching[here[touching]].reshape(-1, 4)  # two below, in order, and the two over them
    return np.asarray(four[:, [0, 1, 3, 2]])


def _nearest(found: Comparison) -> int:
    """The sheet's chip that lies most nearly where the SI's far point does."""
    return int(np.linalg.norm(found.sheet.offsets - np.array(POINTS[1]), axis=-1).argmin())


def _place(found: Comparison, chip: int) -> str:
    x, y = found.sheet.offsets[chip] * 1e3
    return f"({x:.0f}, {y:.0f})"


def _draw_noise(
    axis: Axes, found: Comparison, label: str | None = "noise of one reading (x, y)"
) -> None:
    axis.axhline(float(found.noise[0]) * 1e6, color=INK, linewidth=0.7, linestyle=":", label=label)


def _open(axis: Axes) -> None:
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
