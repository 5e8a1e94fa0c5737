"""Draws Figures S1, S5 and S7 anew from computed data, as vector graphics.

A new figure is a function from data to a `Plate`. Loaded on demand alone, as Matplotlib is an
extra.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from paper.maps import PoissonMap, StiffnessMap, signs_text
from paper.style import BLUE, GREY, INK, ORANGE, Plate, lay_out, quiet, styled
from smoskin.sensing.closed_form.location import Zone

_LETTERS: Final = "abcdefghi"
_MAP: Final = "cividis"


def poisson_plate(found: PoissonMap) -> Plate:
    """Figures S1a and S1b: both ratios over alpha and phi."""
    levels = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
    alpha, phi = np.degrees(found.sector_angle), np.degrees(found.fold_angle)
    with styled():
        figure = Figure(figsize=(7.2, 3.5), layout="constrained")
        axes = figure.subplots(1, 2, sharey=True)
        for axis, letter, name, values in zip(
            axes, "ab", (r"$\nu_{13}$", r"$\nu_{23}$"), (found.nu_13, found.nu_23), strict=True
        ):
            masked = np.ma.masked_invalid(values.T)
            colours = axis.contourf(
                alpha, phi, masked, np.geomspace(0.01, 1000, 31), norm=LogNorm(0.01, 1000),
                cmap=_MAP, extend="both",
            )  # fmt: skip
            colours.set_edgecolor("face")
            lines = axis.contour(
                alpha, phi, masked, levels, colors="white", linewidths=0.7, norm=LogNorm(0.01, 1000)
            )
            axis.clabel(lines, lines.levels[2:], fmt=lambda value: f"{value:g}", fontsize=7)
            axis.plot([5, 85], [5, 85], color=INK, linewidth=0.8)
            axis.plot(*np.degrees(found.reference), "o", color="white", markeredgecolor=INK)
            axis.text(40, 62, "cannot fold:\n$\\phi > \\alpha$", color=GREY, ha="center")
            axis.annotate(
                "reference\ndesign", np.degrees(found.reference), (-30, 8),
                textcoords="offset points", fontsize=7, ha="center",
            )  # fmt: skip
            axis.set(
                title=f"({letter}) {name}", xlabel="sector angle α (°)", xlim=(5, 85), ylim=(5, 85)
            )
            axis.set_aspect("equal")
        axes[0].set_ylabel("fold angle φ (°)")
        bar = figure.colorbar(
            colours, ax=axes, ticks=levels[::2], label="Poisson's ratio (no unit)",
            format=FuncFormatter(lambda value, _: f"{value:g}"),
        )  # fmt: skip
        quiet(bar)
        lay_out(figure)
    return Plate(
        name="figure_s1",
        title="Figures S1a, b",
        caption="Figures S1a and S1b, computed here: out-of-plane Poisson's ratios of a Miura-ori "
        "cell over sector angle and fold angle (S2). Both fall as the fold angle grows and rise "
        "with the sector angle.",
        figure=figure,
    )


def zone_plate(zones: Sequence[Zone]) -> Plate:
    """Figures S5a to S5i: ratios of the four cells of each zone, and the lines between them."""
    with styled():
        figure = Figure(figsize=(7.2, 7.4), layout="constrained")
        axes = figure.subplots(3, 3)
        for zone in zones:
            row, column = divmod(zone.number - 1, 3)
            axis = axes[2 - row][column]
            _draw_zone(axis, zone)
            letter = _LETTERS[3 * (2 - row) + column]
            signs = " ".join(signs_text(zone)).replace("-", "−")
            axis.set_title(f"({letter}) zone {zone.number}:   {signs}")
        for axis in axes[-1]:
            axis.set_xlabel("$U_{2x}/U_{3x}$ (no unit)")
        for axis in axes[:, 0]:
            axis.set_ylabel("$U_{2y}/U_{3y}$ (no unit)")
        lay_out(figure)
    return Plate(
        name="figure_s5",
        title="Figures S5a to S5i",
        caption="Figures S5a to S5i, computed here: ratios of the two magnets' displacements for a "
        "press on each cell (dots), and the dividing lines halfway between neighbours (S12). "
        "Titles give the signs of dS2x, dS2y, dS3x, dS3y (Table S1, Z.5 corrected). The line "
        "printed as 1.51 in zone 1 comes out at 1.3248 (U1).",
        figure=figure,
    )


def _draw_zone(axis: Axes, zone: Zone) -> None:
    """One zone: four dots, a line each way, and the values of the lines."""
    x, y = zone.lines_x[0], zone.lines_y[0]
    for k, (n, rx) in enumerate(zip(zone.columns, zone.ratios_x, strict=True)):
        for m, ry in zip(zone.rows, zone.ratios_y, strict=True):
            axis.plot(rx, ry, "o", color=(BLUE, ORANGE)[k], markersize=5)
            axis.annotate(
                f"({n + 1},{m + 1})", (rx, ry), (0, 6), textcoords="offset points", ha="center"
            )
    half_x = max(abs(ratio - x) for ratio in zone.ratios_x)
    half_y = max(abs(ratio - y) for ratio in zone.ratios_y)
    axis.set(xlim=(x - 2 * half_x, x + 2 * half_x), ylim=(y - 2 * half_y, y + 2 * half_y))
    axis.axvline(x, color=INK, linewidth=0.8, linestyle="--")
    axis.axhline(y, color=INK, linewidth=0.8, linestyle="--")
    axis.annotate(f"{x:.4f}".replace("-", "−"), (x, 1), (3, -9), xycoords=("data", "axes fraction"),
                  textcoords="offset points", fontsize=7, color=INK)  # fmt: skip
    axis.annotate(f"{y:.4f}".replace("-", "−"), (1, y), (-3, 3), xycoords=("axes fraction", "data"),
                  textcoords="offset points", fontsize=7, color=INK, ha="right")  # fmt: skip
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def stiffness_plate(maps: Sequence[StiffnessMap]) -> Plate:
    """Figures S7a to S7i: normalised stiffness of every cell for nine attenuations."""
    with styled():
        figure = Figure(figsize=(7.2, 7.6), layout="constrained")
        axes = figure.subplots(3, 3, sharex=True, sharey=True)
        least = float(np.floor(10 * min(one.normalised.min() for one in maps)) / 10)
        for axis, letter, one in zip(axes.flat, _LETTERS, maps, strict=True):
            values = one.normalised
            columns, rows = values.shape
            picture = axis.pcolormesh(
                np.arange(columns + 1) + 0.5, np.arange(rows + 1) + 0.5, values.T, cmap=_MAP,
                vmin=least, vmax=1, edgecolor="white", linewidth=0.6,
            )  # fmt: skip
            for n, m in np.ndindex(values.shape):
                axis.text(
                    n + 1, m + 1, f"{values[n, m]:.2f}", ha="center", va="center", fontsize=5.5,
                    color="black" if values[n, m] > (1 + least) / 2 else "white", in_layout=False,
                )  # fmt: skip
            axis.set_title(f"({letter}) $v_{{a,X}} = v_{{a,Y}}$ = {one.attenuation:.1f}")
            axis.set_aspect("equal")
            axis.tick_params(length=0)
            axis.set(xticks=range(1, columns + 1), yticks=range(1, rows + 1))
            axis.spines[:].set_visible(False)
        for axis in axes[-1]:
            axis.set_xlabel("cell n along x")
        for axis in axes[:, 0]:
            axis.set_ylabel("cell m along y")
        bar = figure.colorbar(
            picture, ax=axes, shrink=0.6, label="stiffness over the stiffest cell's (no unit)"
        )
        quiet(bar)
        lay_out(figure)
    return Plate(
        name="figure_s7",
        title="Figures S7a to S7i",
        caption="Figures S7a to S7i, computed here: stiffness of a press on each cell, columns "
        "alone (S22-S24), over the stiffest cell's, for attenuations from 1 to 0.2. Rigid sheets "
        "are far stiffer at the corners; with lower attenuation the difference shrinks, until the "
        "centre is stiffer than cell (1,1), though not than the far corner (1,6): the zigzag "
        "leaves no mirror along y (E26).",
        figure=figure,
    )
