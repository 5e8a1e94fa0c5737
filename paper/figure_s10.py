"""
Figure S10: a soft magnet beside the folded sheet
=================================================

One soft magnet as large as the skin, pressed in its middle and watched at the SI's two points, and
the folded sheet pressed as deep on its corner cell, from which chips lie 100 mm away each way.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import SubFigure
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import MaxNLocator

from paper.models.magnetisation import OERSTED, MagnetisationLoop
from paper.models.soft_magnet import (
    STANDOFF,
    PressedSkin,
    PressResponse,
    SoftMagnet,
    magnet_field,
    magnetisation,
    skin_response,
    soft_magnet_like,
    soft_response,
    watched_everywhere,
)
from paper.models.solid import PressedBlock, press_block
from paper.shared.rows import Row, stated
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    INK,
    ORANGE,
    RED,
    Look,
    Plate,
    canvas,
    colour_bar,
    lay_out,
    logarithmic,
    note,
    open_axes,
    styled,
)
from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.mlx90393 import noise
from smoskin.origami.geometry import geometry
from smoskin.twin.whole import Twin

DEPTHS: Final = (0.0, 0.5e-3, 1.0e-3, 1.5e-3, 2.0e-3)
"""m; the last as printed."""
PATCH: Final = 5e-3
"""m: radius of the pressed disc. Assumed."""
POINTS: Final = ((0.0, 0.0), (0.1, 0.1))
"""m from the press, as printed."""
AWAY: Final = 0.1
"""m: what counts as far from the press."""
_LINE: Final = 9
"""Places from the press to the far point."""
_SECTION: Final = (13, 9)
"""Places of the field map along x, to either side of the middle, and along z above and below."""
_REACH: Final = (40e-3, 12e-3)
"""m that the map reaches along x, and above and below the magnet."""
_CLEAR: Final = 0.7e-3
"""m that the map keeps from the magnet."""


_CHANGES: Final = (0.3, 1.0, 3.0, 10.0, 30.0)
"""mT: lines of equal change."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Variant:
    """The same press of another soft magnet that the SI's words allow too."""

    name: str
    change: Floats
    """(2, 3), T: at both points, after the whole press."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """The soft magnet and the folded sheet under presses of the same depths."""

    magnet: SoftMagnet
    pressed: PressedBlock
    points: PressResponse
    """At the SI's two points."""
    line: PressResponse
    """On the line from one to the other."""
    sheet: PressResponse
    """At chips under the folded sheet."""
    variants: tuple[Variant, ...]
    noise: Floats
    """(3,), T: of one reading of a chip."""
    sheet_visibility: Floats
    """(S,): change over noise after the whole press."""
    visibility: Floats
    """(2,): the same at the SI's two points."""
    line_visibility: Floats
    """(L,): the same on the line."""
    section_x: Floats
    """(I,), m."""
    section_z: Floats
    """(J,), m; none lies within the magnet's height."""
    section: Floats
    """(2, J, I), T: magnitude of B in the plane y = 0 at rest and after the whole press."""
    section_change: Floats
    """(J, I), T: magnitude of the change from one to the other."""


def compare(design: SkinDesign, skin: PressedSkin, *, fineness: int = 6) -> Comparison:
    """Press both.

    Parameters
    ----------
    design : SkinDesign
        The skin whose dimensions the soft magnet takes.
    skin : PressedSkin
        A twin, without noise, of that skin with chips all over it
        (`paper.models.soft_magnet.watched_everywhere`).
    fineness : int, optional
        Of the soft magnet's mesh.

    Raises
    ------
    MissingExtraError
        If FElupe is not installed.
    """
    magnet = soft_magnet_like(design)
    pressed = press_block(magnet.block, DEPTHS, radius=PATCH, fineness=fineness)
    setting = design.hall_setting
    points = soft_response(magnet, pressed, POINTS)
    line = soft_response(
        magnet, pressed.at([-1]), np.linspace(0.0, 1.0, _LINE)[:, None] * np.array(POINTS[1])
    )
    sheet = skin_response(skin, geometry(design).tops[0, 0], DEPTHS)
    x, z, section, change = _section(magnet, pressed)
    return Comparison(
        magnet=magnet,
        pressed=pressed,
        points=points,
        line=line,
        sheet=sheet,
        variants=_variants(magnet, pressed, fineness),
        noise=noise(setting),
        sheet_visibility=sheet.visibility(setting)[-1],
        visibility=points.visibility(setting)[-1],
        line_visibility=line.visibility(setting)[-1],
        section_x=x,
        section_z=z,
        section=section,
        section_change=change,
    )


def _variants(magnet: SoftMagnet, pressed: PressedBlock, fineness: int) -> tuple[Variant, ...]:
    """Four sectors; a magnet that reaches over both points; one that slides on its base."""
    length, width, height = magnet.block.size
    wide = replace(magnet, block=replace(magnet.block, size=(2 * length, 2 * width, height)))
    loose = replace(magnet, block=replace(magnet.block, base="sliding"))
    result = [("in four sectors", replace(magnet, profile="sectors"), pressed.at([-1]))]
    for name, other in (("twice as long and wide", wide), ("sliding on its base", loose)):
        block = press_block(other.block, DEPTHS[-1:], radius=PATCH, fineness=fineness)
        result.append((name, other, block))
    return tuple(
        Variant(name=name, change=soft_response(other, block, POINTS).changes[-1])
        for name, other, block in result
    )


def _section(magnet: SoftMagnet, pressed: PressedBlock) -> tuple[Floats, Floats, Floats, Floats]:
    """Magnitudes of B and its change above and below the magnet; x < 0 mirrors the other half."""
    reach, beyond = _REACH
    height = magnet.block.size[2]
    half = np.linspace(0.0, reach, _SECTION[0])
    step = np.linspace(_CLEAR, beyond, _SECTION[1])
    z = np.concatenate([-step[::-1], height + step])
    where = np.stack(np.meshgrid(half, [0.0], z, indexing="ij"), axis=-1)[:, 0]
    field = magnet_field(magnet, pressed.at([0, -1]), where.reshape(-1, 3), tolerance=1e-3)
    both = np.concatenate([field, field[1:] - field[:1]])
    size = np.linalg.norm(both, axis=-1).reshape(3, len(half), len(z)).swapaxes(1, 2)
    whole = np.concatenate([size[:, :, :0:-1], size], axis=2)
    return np.concatenate([-half[:0:-1], half]), z, whole[:2], whole[2]


# %%
# Printed beside computed


def comparison_rows(result: Comparison) -> list[Row]:
    """What Text S6 says of Figure S10, beside what came out."""
    near, far = np.linalg.norm(result.points.changes[-1], axis=-1) * 1e6
    away = np.hypot(*result.sheet.offsets.T) >= AWAY
    least = np.linalg.norm(result.sheet.changes[-1, away], axis=-1).min() * 1e6
    others = "; ".join(
        f"{item.name} {np.linalg.norm(item.change[0]) * 1e6:.0f} and "
        f"{np.linalg.norm(item.change[1]) * 1e6:.2g} uT"
        for item in result.variants
    )
    place = "Text S6, Figure S10b"
    return [
        stated(
            "figure_s10.near",
            place,
            "a notable change in the magnetic field near the deformed area",
            f"{near:.0f} uT at (0, 0, -3) mm, {result.visibility[0]:.0f} times the chip's noise",
            bool(result.visibility[0] > 10),
            "finite elements of a bonded block, magnetised as S3, pressed by 2 mm on a disc of "
            "5 mm radius",
        ),
        stated(
            "figure_s10.far",
            place,
            "at (100, 100, -3) minimal change, which the chip does not detect",
            f"{far:.2g} uT, {result.visibility[1]:.2g} times the noise of one reading",
            bool(result.visibility[1] < 1),
            f"the same block; others that the words allow, near and far: {others}",
        ),
        stated(
            "figure_s10.sheet",
            "Text S6",
            "the comparison illustrates the effect of the folded structure",
            f"{least:.0f} uT or more at every chip {AWAY * 1e3:.0f} mm or more away, "
            f"{result.sheet_visibility[away].min():.0f} times the noise",
            bool(result.sheet_visibility[away].min() > 10),
            "the twin pressed by 2 mm on cell (1,1), chips under all inner corners of the cells",
        ),
    ]


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Figures S10a to S10e, and the folded sheet against distance."""
    skin = Twin(watched_everywhere(setting.design), seed=None)
    return draw(compare(setting.design, skin), MagnetisationLoop())


def draw(result: Comparison, loop: MagnetisationLoop) -> Plate:
    """Loop, changes, set-up, sections and distances."""
    with styled():
        figure = canvas(7.2, 7.2)
        parts = figure.subfigures(2, 1, squeeze=False, height_ratios=(2, 1))
        axes = parts[0, 0].subplots(2, 2)
        _draw_loop(axes[0, 0], loop)
        _draw_depths(axes[0, 1], result)
        _draw_plan(axes[1, 0], result)
        _draw_distances(axes[1, 1], result)
        _draw_sections(parts[1, 0], result)
        lay_out(figure)
    length, width, height = (side * 1e3 for side in result.magnet.block.size)
    near, far = np.linalg.norm(result.points.changes[-1], axis=-1) * 1e6
    others = "; ".join(
        f"{item.name}: {np.linalg.norm(item.change[1]) * 1e6:.2g} µT" for item in result.variants
    )
    away = np.hypot(*result.sheet.offsets.T) >= AWAY
    return Plate(
        name="figure_s10",
        title="Figures S10a to S10e",
        caption=f"Figure S10, by the model. A soft magnet of {length:.0f} x {width:.0f} x "
        f"{height:.1f} mm (the skin's plan; with the points {STANDOFF * 1e3:.0f} mm under it as "
        "thick as the skin), magnetised towards its middle as S3, bonded below, is pressed by "
        f"{DEPTHS[-1] * 1e3:g} mm on a disc of {PATCH * 1e3:.0f} mm radius. The field changes by "
        f"{near:.0f} µT at (0, 0, -3) and by {far:.2g} µT at (100, 100, -3) mm, which lies beyond "
        f"the magnet's corner: {result.visibility[0]:.0f} and {result.visibility[1]:.2g} times the "
        "noise of one reading on the axis that shows it best. Pressed as deep on cell (1,1), the "
        "folded sheet changes the field at chips 100 mm and more away by "
        f"{result.sheet_visibility[away].min():.0f} times the noise or more. Choices that the "
        f"paper leaves open move the far change, magnetised or held otherwise: {others}. White "
        "lines in (e): change of the field, mT. The loop runs through the two printed points; its "
        "form between them is assumed.",
        figure=figure,
        rows=tuple(comparison_rows(result)),
    )


def _draw_loop(axis: Axes, loop: MagnetisationLoop) -> None:
    """Magnetisation against field, in the paper's units."""
    field = np.linspace(-2.2, 2.2, 401) * loop.coercivity
    for branch in (loop.descending(field), loop.ascending(field)):
        axis.plot(field / OERSTED / 1e3, branch / 1e6, color=BLUE, linewidth=1.1)
    axis.axhline(0, color=GREY, linewidth=0.5)
    axis.axvline(0, color=GREY, linewidth=0.5)
    remanence, coercivity = loop.remanence / 1e6, -loop.coercivity / OERSTED
    axis.plot(0, remanence, "o", color=RED, markersize=4)
    axis.plot(coercivity / 1e3, 0, "o", color=RED, markersize=4)
    note(axis, f"$M_r$ = {remanence:.3f}", (0, remanence), (-6, 5), ha="right", fontsize=8)
    text = f"$H_{{ci}}$ = {coercivity:.2f} Oe".replace("-", "−")
    note(axis, text, (coercivity / 1e3, 0), (5, 4))
    axis.set(title="(a) magnetisation loop", xlabel="field H (kOe)", xlim=(-13, 13))
    axis.set_ylabel("M (emu/mm³)")
    open_axes(axis)


def _draw_depths(axis: Axes, result: Comparison) -> None:
    """Change against depth, near and far, and the folded sheet's chip nearest to the far point."""
    depth = result.points.depths * 1e3
    nearest = int(np.linalg.norm(result.sheet.offsets - np.array(POINTS[1]), axis=-1).argmin())
    x, y = result.sheet.offsets[nearest] * 1e3
    lines = (
        ("soft magnet, (0, 0)", result.points.changes[:, 0], BLUE, "o"),
        ("soft magnet, (100, 100)", result.points.changes[:, 1], ORANGE, "s"),
        (f"folded sheet, ({x:.0f}, {y:.0f})", result.sheet.changes[:, nearest], GREEN, "D"),
    )
    look: Look = {"linestyle": "-", "markersize": 3.5, "linewidth": 1.1}
    for name, change, colour, marker in lines:
        size = np.linalg.norm(change, axis=-1) * 1e6
        axis.plot(depth[1:], size[1:], marker, color=colour, label=name, **look)
    _draw_noise(axis, result)
    logarithmic(axis.yaxis)
    axis.set(title="(b) change of the field", xlabel="depth of the press (mm)")
    axis.set(ylabel="|ΔB| (µT)", xlim=(0, None), ylim=(0.05, 1e7))
    axis.legend(loc="upper left", ncols=2, columnspacing=1.0, handlelength=1.6)
    open_axes(axis)


def _draw_plan(axis: Axes, result: Comparison) -> None:
    """What is pressed and watched, seen from above."""
    length, width, _ = (side * 1e3 for side in result.magnet.block.size)
    look: Look = {"facecolor": "#eef1f4", "edgecolor": GREY, "linewidth": 0.8}
    axis.add_patch(Rectangle((-length / 2, -width / 2), length, width, **look))
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 5) * length, np.linspace(-0.4, 0.4, 5) * width)
    places = np.stack([x, y, np.zeros_like(x)], axis=-1) * 1e-3
    inward = magnetisation(result.magnet, places) / result.magnet.remanence
    axis.quiver(x, y, inward[..., 0], inward[..., 1], color=GREY, width=0.004, scale=14)
    axis.add_patch(Circle((0, 0), PATCH * 1e3, facecolor=RED, edgecolor="none", alpha=0.6))
    for point, colour, name in zip(POINTS, (BLUE, ORANGE), ("near", "far"), strict=True):
        px, py = (1e3 * side for side in point)
        axis.plot(px, py, "o", color=colour, markersize=4)
        note(axis, f"{name} ({px:.0f}, {py:.0f}, −{STANDOFF * 1e3:.0f})", (px, py), (5, -9))
    axis.set(title="(c) set-up, from above", xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    axis.set(xlim=(-70, 160), ylim=(-88, 118))
    open_axes(axis)


def _draw_distances(axis: Axes, result: Comparison) -> None:
    """Change against distance from the press, after the whole press."""
    sides = (
        (result.line, "s-", BLUE, "under the soft magnet"),
        (result.sheet, "D", GREEN, "chips under the folded sheet"),
    )
    for response, form, colour, name in sides:
        apart = np.hypot(*response.offsets.T) * 1e3
        size = np.linalg.norm(response.changes[-1], axis=-1) * 1e6
        axis.plot(apart, size, form, color=colour, markersize=3, linewidth=1.1, label=name)
    _draw_noise(axis, result, label=None)
    logarithmic(axis.yaxis)
    axis.set(title="(f) both against distance", xlabel="distance from the press (mm)")
    axis.set(ylabel=f"|ΔB| at {DEPTHS[-1] * 1e3:g} mm (µT)", ylim=(0.05, 1e6))
    axis.legend(loc="lower left")
    open_axes(axis)


def _draw_sections(figure: SubFigure, result: Comparison) -> None:
    """Motion inside and field outside, in the plane y = 0, at rest and pressed."""
    axes = figure.subplots(1, 2, sharey=True)
    x, z = result.section_x * 1e3, result.section_z * 1e3
    height, top = result.magnet.block.size[2] * 1e3, float(result.section.max()) * 1e3
    fine, shades, moved = np.linspace(0, top, 31), Normalize(0, top), Normalize(0, DEPTHS[-1] * 1e3)
    faces = _face(result)
    for state, axis, title in zip((0, -1), axes, ("(d) at rest", "(e) pressed"), strict=True):
        for part in (z < 0, z > height):
            field = result.section[state][part] * 1e3
            colours = axis.contourf(x, z[part], field, fine, norm=shades, cmap=COLOURS)
            colours.set_edgecolor("face")
            if state:
                change = result.section_change[part] * 1e3
                white: Look = {"colors": "white", "linewidths": 0.6}
                lines = axis.contour(x, z[part], change, _CHANGES, **white)
                axis.clabel(lines, fmt=lambda value: f"{value:g}", fontsize=6)
        shift = result.pressed.displacements[state]
        corners = (result.pressed.mesh.nodes + shift)[faces][..., [0, 2]] * 1e3
        length = np.linalg.norm(shift, axis=-1)[faces].mean(axis=1) * 1e3
        look: Look = {"cmap": "Blues", "edgecolor": GREY, "linewidth": 0.2}
        block = PolyCollection(list(corners), array=length, norm=moved, **look)
        axis.add_collection(block)
        axis.plot(0, -STANDOFF * 1e3, "o", color="white", markeredgecolor=INK, markersize=4)
        axis.set(title=title, xlabel="x (mm), section y = 0", aspect="equal")
        axis.set(xlim=(x[0], x[-1]), ylim=(z[0], z[-1]))
        open_axes(axis)
    axes[0].set_ylabel("z (mm)")
    labels = "|B| outside (mT)", "|U| inside (mm)"
    for axis, shown, label in zip(axes, (colours, block), labels, strict=True):
        bar = colour_bar(figure, shown, axis, label, orientation="horizontal", aspect=40)
        bar.locator = MaxNLocator(5)
        bar.update_ticks()


def _face(result: Comparison) -> Ints:
    """Corner nodes (F, 4) of the cells' faces in the plane y = 0 that belong to y > 0."""
    mesh = result.pressed.mesh
    here = np.isclose(mesh.nodes[:, 1], 0.0, atol=1e-9)
    behind = mesh.nodes[mesh.cells][..., 1].mean(axis=1) > 0
    touching = mesh.cells[behind & (here[mesh.cells].sum(axis=1) == 4)]
    four = touching[here[touching]].reshape(-1, 4)  # two below, in order, and the two over them
    return np.asarray(four[:, [0, 1, 3, 2]])


def _draw_noise(axis: Axes, result: Comparison, label: str | None = "noise of one reading") -> None:
    """A line across at the noise of one reading in x and y."""
    look: Look = {"color": INK, "linewidth": 0.7, "linestyle": ":"}
    axis.axhline(float(result.noise[0]) * 1e6, label=label, **look)


if __name__ == "__main__":
    plate(Setting()).show()
