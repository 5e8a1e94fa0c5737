"""
The device that the paper built
===============================

Not in the paper: which sizes of columns, film, panels and frame, none of them printed, bring a
whole sheet closest to all that the SI says of its device, what excludes what, and how far the sizes
are determined by it.
"""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from paper.models.device import UNKNOWNS, Trials, device, seek
from paper.models.observations import OBSERVATIONS, press_all
from paper.shared.setting import Setting
from paper.shared.style import (
    BLUE,
    GREY,
    ORANGE,
    SMALL,
    Plate,
    canvas,
    draw_map,
    lay_out,
    open_axes,
    percent,
    styled,
)
from smoskin.design.skin import SkinDesign

NEAR: Final = 0.25
"""Cost over the best, in observations, up to which designs count as nearly as good."""


def plate(setting: Setting) -> Plate:
    """The search, drawn."""
    return draw(setting.design, seek(setting.design))


def draw(design: SkinDesign, trials: Trials) -> Plate:
    """A table of the observations, which are met together, and how far the sizes are known."""
    best, met = trials.best, trials.met
    with styled():
        figure = canvas(7.2, 7.6)
        grid = figure.add_gridspec(2, 2, height_ratios=(1, 1.15), width_ratios=(1.25, 1))
        _draw_observations(figure.add_subplot(grid[0, :]), design, trials)
        _draw_together(figure.add_subplot(grid[1, 0]), trials)
        _draw_unknowns(figure.add_subplot(grid[1, 1]), trials)
        lay_out(figure)
    never = [
        f"{OBSERVATIONS[i].name} with {OBSERVATIONS[k].name}"
        for i, k in np.argwhere(np.triu(trials.together == 0, 1)).tolist()
        if trials.together[i, i] and trials.together[k, k]
    ]
    alone = [item.name for k, item in enumerate(OBSERVATIONS) if not met[:, k].any()]
    count = len(trials.values)
    return Plate(
        name="device_search",
        title="The device that the paper built",
        caption="Not in the paper: eleven statements of the SI on its device's mechanics, read off "
        f"the whole sheet of {count} designs, {trials.random} drawn and the rest sought, with the "
        "paper's cells and materials. (a) What the closest design shows, how far off it is in "
        f"tolerances, and the share of drawn designs that meet each; it meets "
        f"{int(met[best].sum())} of {len(OBSERVATIONS)}, no design more than "
        f"{int(met.sum(axis=1).max())}. (b) Designs that meet both, of all that were tried. "
        f"{_list('Met by none', alone)}{_list('Never met together', never)}"
        "(c) Ends of each size among the "
        f"{int((trials.cost <= trials.cost.min() + NEAR).sum())} designs that cost at most "
        f"{NEAR:g} more than the closest (dot), over what was tried (line). Recovery times "
        "(Figure S9) are drawn in the SI and not in its text, and not used.",
        figure=figure,
    )


def _list(opening: str, names: list[str]) -> str:
    """A sentence that lists names, if there are any."""
    return f"{opening}: {'; '.join(names)}. " if names else ""


def _draw_observations(axis: Axes, design: SkinDesign, trials: Trials) -> None:
    """What the closest design shows of each observation, one a line."""
    pressing = press_all(device(design, trials.values[trials.best]))
    drawn = trials.met[: trials.random].mean(axis=0)
    lefts = (0.0, 0.24, 0.33, 0.58, 0.84, 0.91)
    heads = ("(a) the SI says", "where", "asked", "the closest design", "off", "drawn")
    axis.axis("off")
    axis.set(xlim=(0, 1), ylim=(-len(OBSERVATIONS) - 0.2, 1.0))
    for left, head in zip(lefts, heads, strict=True):
        axis.text(left, 0.1, head, va="bottom", fontsize=SMALL, weight="bold")
    axis.axhline(-0.1, color=GREY, linewidth=0.5)
    for line, item in enumerate(OBSERVATIONS):
        shown = ", ".join(f"{value:.2g}" for value in item.read(pressing))
        miss = float(trials.misses[trials.best, line])
        cells = (item.name, item.source, item.asked, shown, f"{miss:.1f}", percent(drawn[line]))
        for left, text in zip(lefts, cells, strict=True):
            colour = ORANGE if left == lefts[4] and miss > 1.0 else "black"
            axis.text(left, -line - 0.65, text, va="center", fontsize=SMALL, color=colour)


def _draw_together(axis: Axes, trials: Trials) -> None:
    """Designs that meet two observations."""
    together = trials.together
    edges = np.asarray(np.arange(len(OBSERVATIONS) + 1) + 0.5)
    counts = np.where(together > 0, together, np.nan)
    words = [[f"{value:.0f}" for value in row] for row in together]
    norm = LogNorm(1, max(2.0, float(together.max())))
    draw_map(axis, counts, norm, edges=(edges, edges), texts=words, size=5)
    numbers = range(1, len(OBSERVATIONS) + 1)
    axis.set_xticks(numbers, [str(number) for number in numbers])
    names = [f"{item.name}  {k}" for k, item in enumerate(OBSERVATIONS, 1)]
    axis.set_yticks(numbers, names, fontsize=SMALL)
    axis.invert_yaxis()
    axis.set_title("(b) designs that meet both")


def _draw_unknowns(axis: Axes, trials: Trials) -> None:
    """How far each size is known, as a share of what was tried."""
    for line, (unknown, ends) in enumerate(zip(UNKNOWNS, trials.spread(NEAR), strict=True)):
        span = np.log(unknown.high / unknown.low)
        low, high = np.log(ends / unknown.low) / span
        at = np.log(trials.values[trials.best, line] / unknown.low) / span
        axis.plot([0, 1], [line, line], color=GREY, linewidth=0.6)
        axis.plot([low, high], [line, line], color=BLUE, linewidth=4, solid_capstyle="butt")
        axis.plot(at, line, "o", color=ORANGE, markersize=4)
        factor = 1e3 if unknown.unit == "mm" else 1.0
        text = f"{factor * ends[0]:.2g} to {factor * ends[1]:.2g} {unknown.unit}"
        axis.text(1.02, line, text, va="center", fontsize=SMALL)
    names = [
        f"{u.name}, {(1e3 if u.unit else 1) * u.low:.2g} to {(1e3 if u.unit else 1) * u.high:.2g}"
        for u in UNKNOWNS
    ]
    axis.set_yticks(range(len(UNKNOWNS)), names, fontsize=SMALL)
    axis.set(xticks=[], xlim=(-0.02, 1.02), title="(c) sizes that do nearly as well")
    axis.invert_yaxis()
    open_axes(axis)
    axis.spines[["left", "bottom"]].set_visible(False)


if __name__ == "__main__":
    plate(Setting()).show()
