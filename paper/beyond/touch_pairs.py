"""
Two touches at once
===================

Pairs of touches on a made skin, over their distance and force: how many are found to be two, how
far their places are off, and the bound by noise; with what Text S8 says of several touches, which
it leaves open.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize

from paper.shared.rows import Row, stated
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    GREY,
    ORANGE,
    Plate,
    canvas,
    draw_map,
    draw_shares,
    lay_out,
    logarithmic,
    open_axes,
    styled,
)
from paper.shared.touch_errors import (
    DISTANCES,
    FORCES,
    PairErrors,
    TouchErrors,
    pair_errors,
    touch_errors,
)
from smoskin.arrays import Floats


def touch_error_rows(single: TouchErrors, pairs: PairErrors) -> list[Row]:
    """What Text S8 says of two touches at once, beside what came out."""
    apart = pairs.apart
    far = pairs.each[apart]
    return [
        stated(
            "touch.solved",
            "Text S8",
            "two touches have 6 unknowns and the skin 9 signals: mathematically it can be solved",
            f"the signals' slopes by the unknowns have rank 6 for {100 * pairs.identifiable:.0f} % "
            f"of {pairs.each.size} pairs; by the chips' noise alone the places of pairs from 40 mm "
            "and 0.3 N on could be told to "
            f"{1e3 * np.median(pairs.each_bound[apart]):.1f} mm in the median, and are told to "
            f"{1e3 * np.nanmean(far):.1f} mm in the mean",
            pairs.identifiable == 1.0,
            "Cramer-Rao bound and Bayesian estimator on a made skin after 60 calibration touches",
        ),
        stated(
            "touch.switch",
            "Text S8",
            "the learned algorithm cannot tell one touch from several; improvement is required",
            f"counted right: {100 * pairs.counted[apart].mean():.0f} % of the pairs from 40 mm and "
            f"0.3 N on, {100 * single.counted:.0f} % of single touches, "
            f"{100 * single.idle:.0f} % of the moments without touch",
            min(pairs.counted[apart].mean(), single.counted, single.idle) > 0.9,
            "by the evidence of one and of two touches on the response table of a made skin",
        ),
    ]


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Three maps over distance and force, and the distribution of the far pairs' errors."""
    single = touch_errors(setting.design, setting.skins)
    return draw(pair_errors(setting.design, setting.skins[0]), single)


def draw(result: PairErrors, single: TouchErrors) -> Plate:
    """Shares found, place errors, bounds, and the errors of pairs far apart."""
    errors = 1e3 * result.distance, 1e3 * result.bound
    finite = np.concatenate([item[np.isfinite(item)] for item in errors])
    norm = LogNorm(float(finite.min()), float(finite.max()))
    with styled():
        figure = canvas(7.2, 5.6)
        axes = figure.subplots(2, 2)
        _draw(axes[0][0], 100 * result.counted, Normalize(0, 100), "{:.0f} %")
        axes[0][0].set_title("(a) found as two touches")
        _draw(axes[0][1], errors[0], norm, "{:.1f}")
        axes[0][1].set_title("(b) mean place error of those (mm)")
        _draw(axes[1][0], errors[1], norm, "{:.2f}")
        axes[1][0].set_title("(c) bound by noise alone, median (mm)")
        axis = axes[1][1]
        draw_shares(axis, 1e3 * result.each_bound[result.apart], "bound by noise", ORANGE)
        draw_shares(axis, 1e3 * result.each[result.apart], "error", BLUE)
        axis.axvline(5, color=GREY, linewidth=0.6, linestyle="--")
        logarithmic(axis.xaxis)
        axis.set(title="(d) pairs from 40 mm and 0.3 N on", ylim=(0, 101))
        axis.set(xlabel="place (mm)", ylabel="share of pairs (%)")
        axis.set_xticks([0.1, 0.3, 1, 3, 10, 30, 100])
        axis.legend(loc="upper left")
        open_axes(axis)
        lay_out(figure)
    far = result.each[result.apart]
    return Plate(
        name="touch_pairs",
        title="Two touches at once",
        caption="Not in the paper, which leaves several touches open (Text S8): pairs of straight "
        "touches on a made skin after 60 calibration touches of single touches, by how far apart "
        f"they are and by their force; {result.each.shape[2]} pairs a field. (a) Pairs whose "
        "reading is found to be of two touches, by the evidence of one and of two. (b) How far "
        "their places are off. (c) Cramer-Rao bound of the nine signals for the six unknowns. (d) "
        "Pairs from 40 mm and 0.3 N on, a pair not found as two counting as infinitely far off: "
        f"{100 * np.isfinite(far).mean():.0f} % are found, half of these within "
        f"{1e3 * np.nanmedian(far):.1f} mm, in the mean {1e3 * np.nanmean(far):.1f} mm. Noise is "
        "not what limits them, but how well the table knows what two touches do beyond adding up; "
        "pairs nearer than a cell, 27 mm, are not among those that it was judged on.",
        figure=figure,
        rows=tuple(touch_error_rows(single, result)),
    )


def _draw(axis: Axes, values: Floats, norm: Normalize, form: str) -> None:
    """One map, a number a field."""
    texts = [
        [form.format(item) if np.isfinite(item) else "none" for item in line] for line in values.T
    ]
    distances, forces = (np.arange(count + 1.0) for count in values.shape)
    draw_map(axis, values.T, norm, edges=(forces, distances), texts=texts, size=7)
    axis.set_xticks(forces, [f"{item:g}" for item in FORCES])
    axis.set_yticks(distances, [f"{1e3 * item:g}" for item in DISTANCES])
    axis.set(xlabel="force of each (N)", ylabel="distance apart (mm)")


if __name__ == "__main__":
    plate(Setting()).show()
