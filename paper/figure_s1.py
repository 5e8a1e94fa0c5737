"""
Figure S1: Poisson's ratios of a cell
=====================================

Both out-of-plane Poisson's ratios of a Miura-ori cell (S2) over all angles at which it can fold,
and what Text S1 says of them.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.colors import LogNorm

from paper.shared.rows import Row, stated
from paper.shared.setting import Setting
from paper.shared.style import COLOURS, GREY, INK, Plate, canvas, colour_bar, lay_out, note, styled
from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.origami.cell import poisson_ratios


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoissonMap:
    """Out-of-plane Poisson's ratios of a cell; NaN where it cannot fold."""

    angle: Floats
    """(A,), rad: sector angles, and fold angles."""
    nu_13: Floats
    """(A, A): sector angle first."""
    nu_23: Floats
    """(A, A): likewise."""
    reference: tuple[float, float]
    """alpha and phi of the design, rad."""


def poisson_map(design: SkinDesign, steps: int = 121) -> PoissonMap:
    """Compute both ratios from 5 to 85 degrees."""
    angles = np.radians(np.linspace(5.0, 85.0, steps))
    nu_13 = np.full((steps, steps), np.nan)
    nu_23 = nu_13.copy()
    for row, alpha in enumerate(angles):
        cell = MiuraCell(panel_a=0.01, panel_b=0.01, sector_angle=alpha, fold_angle=alpha / 2)
        foldable = angles < alpha
        ratios = poisson_ratios(cell, angles[foldable])
        nu_13[row, foldable], nu_23[row, foldable] = ratios.nu_13, ratios.nu_23
    reference = design.cell.sector_angle, design.cell.fold_angle
    return PoissonMap(angle=angles, nu_13=nu_13, nu_23=nu_23, reference=reference)


# %%
# Printed beside computed


def poisson_rows(result: PoissonMap) -> list[Row]:
    """What Text S1 says of the figure."""

    def falls(axis: int, sign: int) -> bool:
        steps = [sign * np.diff(nu, axis=axis) for nu in (result.nu_13, result.nu_23)]
        return all((step[np.isfinite(step)] < 0).all() for step in steps)

    place, why = "Text S1", "S2 over 5 to 85 degrees"
    computed = f"so in all of {np.isfinite(result.nu_13).sum()} points"
    phi = "at one alpha nu_13 and nu_23 decrease as phi increases"
    alpha = "at one phi both increase with alpha"
    return [
        stated("figure_s1.phi", place, phi, computed, falls(1, 1), why),
        stated("figure_s1.alpha", place, alpha, computed, falls(0, -1), why),
    ]


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Figures S1a and S1b: both ratios over alpha and phi."""
    result = poisson_map(setting.design)
    levels = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
    degrees, norm = np.degrees(result.angle), LogNorm(0.01, 1000)
    fine = np.geomspace(0.01, 1000, 31)
    with styled():
        figure = canvas(7.2, 3.5)
        axes = figure.subplots(1, 2, sharey=True)
        names, ratios = (r"$\nu_{13}$", r"$\nu_{23}$"), (result.nu_13, result.nu_23)
        for axis, letter, name, nu in zip(axes, "ab", names, ratios, strict=True):
            grid = degrees, degrees, np.ma.masked_invalid(nu.T)
            colours = axis.contourf(*grid, fine, norm=norm, cmap=COLOURS, extend="both")
            colours.set_edgecolor("face")
            lines = axis.contour(*grid, levels, colors="white", linewidths=0.7, norm=norm)
            axis.clabel(lines, lines.levels[2:], fmt=lambda value: f"{value:g}", fontsize=7)
            axis.plot([5, 85], [5, 85], color=INK, linewidth=0.8)
            axis.plot(*np.degrees(result.reference), "o", color="white", markeredgecolor=INK)
            axis.text(40, 62, "cannot fold:\n$\\phi > \\alpha$", color=GREY, ha="center")
            at = np.degrees(result.reference).tolist()
            note(axis, "reference\ndesign", at, (-30, 8), fontsize=7, ha="center")
            axis.set(title=f"({letter}) {name}", xlabel="sector angle α (°)")
            axis.set(xlim=(5, 85), ylim=(5, 85), aspect="equal")
        axes[0].set_ylabel("fold angle φ (°)")
        colour_bar(figure, colours, axes, "Poisson's ratio (no unit)", ticks=levels[::2])
        lay_out(figure)
    return Plate(
        name="figure_s1",
        title="Figures S1a, b",
        caption="Figures S1a and S1b, computed here: out-of-plane Poisson's ratios of a Miura-ori "
        "cell over sector angle and fold angle (S2). Both fall as the fold angle grows and rise "
        "with the sector angle.",
        figure=figure,
        rows=tuple(poisson_rows(result)),
    )


if __name__ == "__main__":
    plate(Setting()).show()
