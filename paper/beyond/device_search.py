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
from matplotlib.colors import Normalize

from paper.models.device import NEAR, UNKNOWNS, Study, Trials, device
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

_FAR: Final = 6.0
"""Tolerances at which the colours of the exclusions end."""


def plate(setting: Setting) -> Plate:
    """The search that is kept beside its model, drawn; it takes over an hour itself."""
    return draw(setting.design, Study.read())


def draw(design: SkinDesign, study: Study) -> Plate:
    """A table of the observations, which exclude each other, and how far the sizes are known."""
    trials = study.trials
    with styled():
        figure = canvas(7.2, 7.6)
        above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=(1, 1.15))[:, 0]
        _draw_observations(above.subplots(), design, study)
        left, right = below.subplots(1, 2, width_ratios=(1.25, 1))
        _draw_nearest(left, trials)
        _draw_unknowns(right, trials)
        lay_out(figure)
    alone = [item.name for k, item in enumerate(OBSERVATIONS) if trials.nearest[k, k] > 1.0]
    near = int((trials.cost <= trials.cost.min() + NEAR).sum())
    met = int(trials.met[trials.best].sum())
    return Plate(
        name="device_search",
        title="The device that the paper built",
        caption="Not in the paper: eleven statements of the SI on its device's mechanics, read off "
        f"the whole sheet of {study.tried} designs with the paper's cells and materials, "
        f"{study.drawn} drawn and the others sought ({study.command}, version {study.version}, "
        f"seed {study.seed}). (a) What the closest design shows, how far off it is in tolerances, "
        f"and the share of drawn designs that meet each; it meets {met} of {len(OBSERVATIONS)}, no "
        f"design more than {study.most_met}. {_unmet(alone)}(b) How near any design comes to two "
        "at once: the larger of the two misses, in tolerances, met up to 1; on the diagonal, to "
        f"the one. (c) Ends of each size among the {near} designs that cost at most {NEAR:g} more "
        "than the closest (dot), over what was tried (line). Recovery times (Figure S9) are drawn "
        "in the SI and not in its text, and not used.",
        figure=figure,
    )


def _unmet(names: list[str]) -> str:
    """A sentence that lists what no design meets, if there is any."""
    return f"Met by none: {'; '.join(names)}. " if names else ""


def _draw_observations(axis: Axes, design: SkinDesign, study: Study) -> None:
    """What the closest design shows of each observation, one a line."""
    trials, drawn = study.trials, study.met_by_drawn
    pressing = press_all(device(design, trials.values[trials.best]))
    lefts = (0.0, 0.22, 0.31, 0.57, 0.86, 0.93)
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


def _draw_nearest(axis: Axes, trials: Trials) -> None:
    """How near designs come to two observations at once."""
    nearest = trials.nearest
    edges = np.asarray(np.arange(len(OBSERVATIONS) + 1) + 0.5)
    words = [[f"{value:.1f}" for value in row] for row in nearest]
    draw_map(axis, nearest, Normalize(0.0, _FAR), edges=(edges, edges), texts=words, size=5)
    numbers = range(1, len(OBSERVATIONS) + 1)
    axis.set_xticks(numbers, [str(number) for number in numbers])
    names = [f"{item.name}  {k}" for k, item in enumerate(OBSERVATIONS, 1)]
    axis.set_yticks(numbers, names, fontsize=SMALL)
    axis.invert_yaxis()
    axis.set_title("(b) larger miss of two, at best")


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
