"""
Calibration touches against error
=================================

Not in the paper: how the errors of the Bayesian estimator fall with the touches that calibrate a
made skin, planned and random, beside the paper's network after 825 presses for each force.
"""

from typing import Final

import numpy as np
from matplotlib.axes import Axes

from paper.models.touch_curve import CurveEffort, TouchCurve, touch_curve
from paper.shared.setting import SEEDS, Setting, upper_chips
from paper.shared.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    Look,
    Plate,
    canvas,
    lay_out,
    note,
    open_axes,
    styled,
)
from smoskin.arrays import Floats

EFFORT: Final = CurveEffort(seeds=SEEDS, counts=(2, 6, 20, 60), forces=(0.5,), places=20)
_TICKS: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 1, 2, 3, 5, 10, 20)
_PRINTED_PLACE: Final = 1.89
"""mm: mean error of the paper's network on one skin, after 825 presses for each force."""
_PRINTED_FORCE: Final = 8.0
"""Per cent, likewise."""


def plate(setting: Setting) -> Plate:
    """Errors of place and of force over the number of touches, planned and random."""
    table = setting.table.of_chips(upper_chips(setting.design))
    return draw(touch_curve(setting.design, table, EFFORT))


def draw(result: TouchCurve) -> Plate:
    """Place on the left, force on the right."""
    with styled():
        figure = canvas(7.2, 3.1)
        place, force = figure.subplots(1, 2)
        _curves(place, result.counts, 1e3 * result.planned, 1e3 * result.random)
        look: Look = {"color": BLUE, "linewidth": 0.8, "linestyle": ":"}
        place.plot(result.counts, 1e3 * result.expected, label="expected of planned ones", **look)
        _level(place, 1e3 * result.bound, "bound by noise")
        _level(place, _PRINTED_PLACE, "paper, 825 presses a force")
        place.set(title="(a) place", ylabel="mean error (mm)")
        _curves(force, result.counts, 100 * result.planned_force, 100 * result.random_force)
        _level(force, _PRINTED_FORCE, "paper")
        force.set(title="(b) normal force", ylabel="mean error (%)")
        for axis in (place, force):
            axis.set(xscale="log", yscale="log", xlabel="touches of the calibration")
            axis.set_xticks(result.counts, [str(count) for count in result.counts])
            open_axes(axis)
            low, high = axis.get_ylim()
            ticks = [item for item in _TICKS if low <= item <= high]
            axis.set_yticks(ticks, [f"{item:g}" for item in ticks])
            axis.minorticks_off()
        place.legend(loc="upper right", bbox_to_anchor=(1.0, 0.9))
        lay_out(figure)
    least, most = result.counts[0], result.counts[-1]
    chips = f"{3 * len(result.chips)} signals"
    return Plate(
        name="calibration_touches",
        title="Calibration touches against error",
        caption=f"Not in the paper: mean errors of the Bayesian estimator with {chips} on "
        f"{len(result.planned)} made skins after a calibration of {least} to {most} touches, "
        "straight touches from rim to rim at 15 to 35 °C on rubber that creeps, under chips that "
        "drift. Every touch counts; one that is not told as one touch is taken to lie in the "
        "middle. Blue: each touch is the one that tells most after those before it; orange: "
        f"anywhere; bands from the best to the worst skin. After {most} planned touches "
        f"{1e3 * result.planned[:, -1].mean():.2f} mm and "
        f"{100 * result.planned_force[:, -1].mean():.2f} % remain; by the "
        f"chips' noise alone {1e3 * result.bound:.2f} mm would; "
        f"{100 * result.inside[:, -1].mean():.0f} % of the truths lie in the stated 90 % regions. "
        f"The paper's network has {_PRINTED_PLACE} mm and {_PRINTED_FORCE:g} % after 825 presses "
        "for each force.",
        figure=figure,
    )


def _curves(axis: Axes, counts: tuple[int, ...], planned: Floats, random: Floats) -> None:
    """Means over the skins, in bands from the best to the worst."""
    kinds = (planned, BLUE, "o", "planned touches"), (random, ORANGE, "s", "random touches")
    for values, colour, marker, name in kinds:
        low, high = values.min(axis=0), values.max(axis=0)
        axis.fill_between(counts, low, high, color=colour, alpha=0.15, linewidth=0)
        look: Look = {"color": colour, "marker": marker, "markersize": 3, "linewidth": 1.0}
        axis.plot(counts, np.mean(values, axis=0), label=name, **look)


def _level(axis: Axes, value: float, name: str) -> None:
    """A line across, with its name."""
    axis.axhline(value, color=GREY, linewidth=0.8, linestyle="--")
    look: Look = {"xycoords": ("axes fraction", "data"), "ha": "right", "color": INK}
    note(axis, name, (1.0, value), (-2, 2), **look)


if __name__ == "__main__":
    plate(Setting()).show()
