"""Draws where the reduced model is wrong, and what it would take to make it right."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from paper.assumptions import Assumptions, Variant
from paper.models.reduction import LEAST_ATTENUATION
from paper.style import BLUE, GREY, INK, ORANGE, RED, Plate, lay_out, styled

_MAP: Final = "cividis"
_MAPPED: Final = (0, 3, 5)
"""Variants that are drawn as maps."""


def assumption_plate(found: Assumptions) -> Plate:
    """Maps of what the fitted reduced model leaves, and the share of folding over the columns."""
    with styled():
        figure = Figure(figsize=(7.2, 7.8), layout="constrained")
        grid = figure.add_gridspec(3, 3, height_ratios=(1.15, 0.75, 1))
        for column, (letter, k) in enumerate(zip("abc", _MAPPED, strict=True)):
            axis = figure.add_subplot(grid[0, column])
            _draw_map(axis, found.variants[k])
            axis.set_title(f"({letter}) {_short(found.variants[k].name)}")
            if column == 0:
                axis.set_ylabel("cell m along y")
        _draw_table(figure.add_subplot(grid[1, :]), found)
        _draw_columns(figure.add_subplot(grid[2, :]), found)
        lay_out(figure)
    built, guided, hard, rigid = (found.variants[k] for k in (0, 1, 3, 5))
    half = float(np.interp(0.5, found.folding, np.log10(found.axial_factors)))
    return Plate(
        name="attenuation_fit",
        title="The reduced model fitted to the whole sheet",
        caption="Not in the paper: the attenuation model (S7-S11) fitted to the columns' motion in "
        "the plane on the whole sheet, for a small press on each cell. Maps: what is left, over "
        "that motion; a cross marks cells where some magnet moves against Table S1. As built "
        f"v_a = {_pair(built)} leaves {_percent(built.columns.residual)} and needs a scale of "
        f"{built.columns.scale:.3f}: columns are so soft along z that the sheet sinks on them like "
        f"a plate, and only {_percent(guided.presses.folding.mean())} of a press folds its cell. "
        "The SI does not provide for that: there bottom vertices move in the plane alone. With "
        f"columns rigid along z v_a = {_pair(hard)} leaves {_percent(hard.columns.residual)}; "
        "with no frame and nearly rigid panels as well "
        f"{_percent(rigid.columns.residual)}, the sheet's turn about the pressed vertex. Half of "
        f"the press would fold the cell only with columns {10**half:.0f} times as stiff along z at "
        "the same shear (d); shorter and thicker ones stiffen in shear as well. The columns' size "
        "is assumed, not printed (U5).",
        figure=figure,
    )


def _pair(variant: Variant) -> str:
    """v_aX and v_aY, fitted to the columns."""
    return "{:.2f}, {:.2f}".format(*variant.columns.attenuation)


def _attenuation(value: float) -> str:
    """v_a, unless the search ended at its lower end."""
    return f"{value:.2f}" if value > 2 * LEAST_ATTENUATION else "none"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _short(name: str) -> str:
    """A variant's name that fits over its map."""
    return name.removeprefix("guided, ").replace("...", "same").replace(", a finger sticks", "")


def _draw_map(axis: Axes, variant: Variant) -> None:
    """What is left for a press on each cell."""
    left = variant.columns.cell_residual
    columns, rows = left.shape
    axis.pcolormesh(
        np.arange(columns + 1) + 0.5, np.arange(rows + 1) + 0.5, left.T, cmap=_MAP, vmin=0, vmax=1,
        edgecolor="white", linewidth=0.6,
    )  # fmt: skip
    agree = np.asarray(variant.agree.all(axis=(2, 3)))
    for n, m in np.ndindex(left.shape):
        axis.text(
            n + 1, m + 1, f"{left[n, m]:.2f}", ha="center", va="center", fontsize=6,
            color="black" if left[n, m] > 0.5 else "white",
        )  # fmt: skip
        if not agree[n, m]:
            axis.plot(n + 1.32, m + 1.32, "x", color=RED, markersize=4, markeredgewidth=1.2)
    axis.set(xlabel="cell n along x", xticks=range(1, columns + 1), yticks=range(1, rows + 1))
    axis.set_aspect("equal")
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)


def _draw_table(axis: Axes, found: Assumptions) -> None:
    """All variants, one a line."""
    head = ("granted to the whole sheet", "v_aX, v_aY", "scale", "left", "left,\nscale 1",
            "magnets\nalone, left", "signs as\nTable S1", "press that\nfolds", "K mean\n(N/mm)",
            "S5: v_a,\nleft of K")  # fmt: skip
    lefts = (0.0, 0.27, 0.375, 0.445, 0.51, 0.585, 0.685, 0.77, 0.855, 0.925)
    axis.axis("off")
    axis.set(xlim=(0, 1), ylim=(-len(found.variants) - 0.2, 1.2))
    for left, text in zip(lefts, head, strict=True):
        axis.text(left, 0.1, text, va="bottom", fontsize=6.5, weight="bold")
    axis.axhline(-0.1, color=GREY, linewidth=0.5)
    for line, one in enumerate(found.variants):
        cells = one.presses.stiffness.size
        fit, bound = one.columns, one.stiffness
        texts = (
            one.name, _pair(one), f"{fit.scale:.3f}",
            _percent(fit.residual), _percent(one.unscaled.residual), _percent(one.magnets.residual),
            f"{one.cells_agreeing} of {cells}", _percent(one.presses.folding.mean()),
            f"{one.presses.stiffness.mean() / 1e3:.1f}",
            f"{_attenuation(bound.attenuation[0])}, {_percent(bound.residual)}",
        )  # fmt: skip
        for left, text in zip(lefts, texts, strict=True):
            axis.text(left, -line - 0.65, text, va="center", fontsize=6.5)


def _draw_columns(axis: Axes, found: Assumptions) -> None:
    """Share of the press that folds, over the columns' stiffness along z."""
    factors = np.asarray(found.axial_factors)
    axis.plot(factors, 100 * np.asarray(found.folding), "-o", color=BLUE, markersize=3,
              label="stiffer along z alone, with the frame")  # fmt: skip
    axis.plot(factors, 100 * np.asarray(found.folding_free), "-s", color=ORANGE, markersize=3,
              label="the same without the frame")  # fmt: skip
    designed = found.sizes[0].axial
    for k, one in enumerate(found.sizes):
        factor = one.axial / designed
        axis.plot(factor, 100 * one.folding, "D", color=RED, markersize=4,
                  label="columns of another size (r x h), which stiffen in shear as well"
                  if k == 0 else None)  # fmt: skip
        axis.annotate(
            f"{one.radius * 1e3:g} x {one.height * 1e3:g} mm\n{one.stiffness / 1e3:.1f} N/mm",
            (factor, 100 * one.folding), (4, -11), textcoords="offset points", fontsize=6,
            color=INK, linespacing=1.1,
        )  # fmt: skip
    axis.set_xscale("log")
    axis.minorticks_off()
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set(
        title="(d) what the SI's assumption needs of the columns", ylim=(-6, 105),
        xlabel="stiffness of a column along z over the designed one",
        ylabel="press that folds the cell (%)",
    )  # fmt: skip
    axis.legend(fontsize=6.5, loc="lower right")
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
