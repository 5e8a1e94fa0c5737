"""Draws how well two touches at once are told apart, over their distance and force."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from paper.style import BLUE, GREY, ORANGE, Plate, lay_out, styled
from paper.touch_errors import DISTANCES, FORCES, PairErrors
from smoskin.arrays import Floats

_MAP: Final = "cividis"


def pairs_plate(found: PairErrors) -> Plate:
    """Three maps over distance and force, and the distribution of the far pairs' errors."""
    errors = 1e3 * found.distance, 1e3 * found.bound
    known = np.concatenate([one[np.isfinite(one)] for one in errors])
    norm = LogNorm(float(known.min()), float(known.max()))
    with styled():
        figure = Figure(figsize=(7.2, 5.6), layout="constrained")
        axes = figure.subplots(2, 2)
        _draw(axes[0][0], 100 * found.counted, Normalize(0, 100), "{:.0f} %")
        axes[0][0].set_title("(a) found as two touches")
        _draw(axes[0][1], errors[0], norm, "{:.1f}")
        axes[0][1].set_title("(b) mean place error of those (mm)")
        _draw(axes[1][0], errors[1], norm, "{:.2f}")
        axes[1][0].set_title("(c) bound by noise alone, median (mm)")
        _draw_shares(axes[1][1], found)
        lay_out(figure)
    far = found.each[found.apart]
    return Plate(
        name="touch_pairs",
        title="Two touches at once",
        caption="Not in the paper, which leaves several touches open (Text S8): pairs of straight "
        "touches on a made skin after 60 calibration touches of single touches, by how far apart "
        f"they are and by their force; {found.each.shape[2]} pairs a field. (a) Pairs whose "
        "reading is found to be of two touches, by the evidence of one and of two. (b) How far "
        "their places are off. (c) Cramer-Rao bound of the nine signals for the six unknowns. (d) "
        "Pairs from 40 mm and 0.3 N on, a pair not found as two counting as infinitely far off: "
        f"{100 * np.isfinite(far).mean():.0f} % are found, half of these within "
        f"{1e3 * np.nanmedian(far):.1f} mm, in the mean {1e3 * np.nanmean(far):.1f} mm. Noise is "
        "not what limits them, but how well the table knows what two touches do beyond adding up; "
        "pairs nearer than a cell, 27 mm, are not among those that it was judged on.",
        figure=figure,
    )


def _draw(axis: Axes, values: Floats, norm: Normalize, form: str) -> None:
    """One map, a number a field."""
    rows, columns = values.shape
    axis.pcolormesh(
        np.arange(columns + 1), np.arange(rows + 1), np.ma.masked_invalid(values), cmap=_MAP,
        norm=norm, edgecolor="white", linewidth=0.6,
    )  # fmt: skip
    for row, column in np.ndindex(values.shape):
        value = values[row, column]
        text = form.format(value) if np.isfinite(value) else "none"
        dark = np.isfinite(value) and float(norm(value)) <= 0.5
        axis.text(column + 0.5, row + 0.5, text, ha="center", va="center", fontsize=7,
                  color="white" if dark else "black")  # fmt: skip
    axis.set(
        xticks=range(columns + 1), xticklabels=[f"{one:g}" for one in FORCES],
        yticks=range(rows + 1), yticklabels=[f"{1e3 * one:g}" for one in DISTANCES],
        xlabel="force of each (N)", ylabel="distance apart (mm)",
    )  # fmt: skip
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)


def _draw_shares(axis: Axes, found: PairErrors) -> None:
    """Share of the far pairs over their place error, beside that of their bounds."""
    for values, label, colour in (
        (found.each_bound[found.apart], "bound by noise", ORANGE),
        (found.each[found.apart], "error", BLUE),
    ):
        ordered = np.sort(values.ravel()) * 1e3
        share = 100 * (np.arange(len(ordered)) + 1) / len(ordered)
        axis.plot(ordered, share, color=colour, linewidth=1.2, label=label)
    axis.axvline(5, color=GREY, linewidth=0.6, linestyle="--")
    axis.set_xscale("log")
    axis.minorticks_off()
    axis.set(
        title="(d) pairs from 40 mm and 0.3 N on", xlabel="place (mm)", ylabel="share of pairs (%)",
        ylim=(0, 101), xticks=[0.1, 0.3, 1, 3, 10, 30, 100],
        xticklabels=["0.1", "0.3", "1", "3", "10", "30", "100"],
    )  # fmt: skip
    axis.legend(fontsize=6.5, loc="upper left")
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
