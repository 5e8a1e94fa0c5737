"""
Figure S11: a model trained without shear, under shear
======================================================

A model learns place and normal force from presses without shear; then every cell is pressed and
dragged. Its readings of the signals as they come, after the SI's preprocessing (Text S7), and those
of the joint estimator, which takes drags for unknowns.
"""

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from paper.shared.rows import Row, stated
from paper.shared.setting import Setting
from paper.shared.shear_learning import (
    DRAGS,
    FORCES,
    SHOWN,
    Jointly,
    Readings,
    Sheared,
    ShearLearning,
    SheetTrial,
    read_jointly,
    shear_learning,
)
from paper.shared.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    RED,
    Look,
    Plate,
    canvas,
    lay_out,
    logarithmic,
    open_axes,
    styled,
)
from smoskin.arrays import Floats

_WAYS: Final = (
    ("as it comes", ORANGE, "o"),
    ("preprocessed", BLUE, "s"),
    ("joint estimator", GREEN, "D"),
)


def shear_learning_rows(result: ShearLearning, jointly: tuple[Jointly, Jointly]) -> list[Row]:
    """What Text S7 says of Figure S11, beside what came out."""
    place, whole, theory = "Text S7, Figure S11", result.whole, result.theory
    both = whole.x, whole.y
    raw, preprocessed = [item.raw for item in both], [item.preprocessed for item in both]
    joint = [item.readings for item in jointly]
    true = whole.x.true
    unsheared = max(float(item.force_error(true)[0]) for item in raw)
    still = max(_distance(raw, 0))
    nearer = (whole.x.nearer, whole.y.nearer)
    sides = theory.x, theory.y
    ideal = [item.raw for item in sides], [item.preprocessed for item in sides]
    printed = [item.printed for item in both]
    folding = "v_f is calibrated on this sheet"
    if not np.isfinite(whole.folding).any():
        folding = "this sheet does not stiffen under drag: its calibrated v_f is infinite"
    return [
        stated(
            "figure_s11.without",
            place,
            "without the preprocess the normal force estimation was quite inaccurate",
            f"off by {_percents(_force(raw, true))} with {DRAGS[SHOWN]:g} N of shear along X, Y; "
            f"without shear by {100 * unsheared:.1f} %",
            min(_force(raw, true)) > max(0.05, 5 * unsheared),
            "a learned model of the six upper signals, trained on 1650 presses of one made skin "
            "without shear; mean over 0.3 to 1 N on all 36 cells. By itself it would have refused "
            f"{100 * whole.refused:.0f} % of the sheared signals as unlike what it has seen",
        ),
        stated(
            "figure_s11.force",
            place,
            "with the shear-induced influence deducted it becomes more accurate (a, d)",
            f"off by {_percents(_force(preprocessed, true))}",
            all(np.less(_force(preprocessed, true), _force(raw, true))),
            f"{folding}; with the printed v_f it would be {_percents(_force(printed, true))}. On "
            f"theory's own sheet {_percents(_force(ideal[0], true))} fall to "
            f"{_percents(_force(ideal[1], true))} with them",
        ),
        stated(
            "figure_s11.place",
            place,
            "for most of the cells the localization error was reduced, but they were still large "
            "(b, c, e, f)",
            f"smaller on {_percents(nearer)} of the cells: {_millimetres(_distance(raw))} fall to "
            f"{_millimetres(_distance(preprocessed))}; without shear {1e3 * still:.1f} mm",
            min(nearer) > 0.5 and min(_distance(preprocessed)) > 5 * still,
            "not because of the learning: on theory's sheet the same model and correction come to "
            f"{_millimetres(_distance(ideal[1]))}. The whole sheet does not slide as a whole: "
            f"theory's slide leaves {100 * whole.left / whole.induced:.0f} % of what shear adds to "
            "the signals, the best multiple of the lower chip's "
            f"{100 * whole.fitted_left / whole.induced:.0f} %; and a finger that sticks pulls by "
            f"{whole.unasked:.2f} N without being dragged",
        ),
        stated(
            "figure_s11.open",
            place,
            "a more suitable correction or calibration method is to be found",
            f"{_millimetres(_distance(joint))}, force off by {_percents(_force(joint, true))}, the "
            f"drag itself by {1e3 * max(float(item.drag_error[SHOWN]) for item in jointly):.0f} "
            "mN",
            max(_distance(joint)) < 0.2 * min(_distance(preprocessed)),
            "all nine signals for five unknowns, on a response table of the design that 60 "
            "labelled touches fitted to the skin",
        ),
    ]


def _force(readings: Sequence[Readings], true: Floats, drag: int = SHOWN) -> list[float]:
    """Mean relative errors of the force, along X and Y."""
    return [float(item.force_error(true)[drag]) for item in readings]


def _distance(readings: Sequence[Readings], drag: int = SHOWN) -> list[float]:
    """Mean errors of the place, along X and Y, m."""
    return [float(item.distance[drag].mean()) for item in readings]


def _percents(values: Iterable[float]) -> str:
    return " and ".join(f"{100 * item:.1f}" for item in values) + " %"


def _millimetres(values: Iterable[float]) -> str:
    return " and ".join(f"{1e3 * item:.1f}" for item in values) + " mm"


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Figures S11a to S11f, and what decides them: the drag, the sheet, and taking drags along."""
    skin = setting.skins[0]
    result = shear_learning(skin.twin)
    return draw(result, read_jointly(skin, result.whole))


def draw(result: ShearLearning, jointly: tuple[Jointly, Jointly]) -> Plate:
    """Forces, errors of each cell, errors over the drag, and what a drag adds."""
    whole, theory = result.whole, result.theory
    with styled():
        figure = canvas(7.2, 7.4)
        axes = figure.subplots(3, 3)
        sides = zip("XY", (whole.x, whole.y), jointly, strict=True)
        for row, (name, sheared, joint) in enumerate(sides):
            kinds = (sheared.raw, sheared.preprocessed, joint.readings)
            letters = "abcdef"[3 * row : 3 * row + 3]
            _draw_force(axes[row][0], sheared, kinds)
            axes[row][0].set_title(f"({letters[0]}) normal force, shear along {name}")
            for column, place in ((1, "x"), (2, "y")):
                _draw_cells(axes[row][column], sheared, kinds, column - 1)
                title = f"({letters[column]}) {place} error, shear along {name}"
                axes[row][column].set_title(title)
        titles = (whole, "(g) the whole sheet"), (theory, "(h) theory's own sheet")
        for axis, (sheet, title) in zip(axes[2], titles, strict=False):
            _draw_drags(axis, [sheet.x.raw, sheet.y.raw], 0)
            _draw_drags(axis, [sheet.x.preprocessed, sheet.y.preprocessed], 1)
            axis.set(title=title, ylim=(0.2, 200), xlabel="shear (N)")
            axis.set_ylabel("mean place error (mm)")
        _draw_drags(axes[2][0], [item.readings for item in jointly], 2)
        _draw_answers(axes[2][2], whole)
        axes[0][0].legend(handlelength=1.2, loc="upper left")
        open_axes(*axes.flat)
        lay_out(figure)
    return Plate(
        name="figure_s11",
        title="Figures S11a to S11f",
        caption="Figures S11a to S11f, on the twin; the values of the paper's figure are not in "
        "its text. A model trained on presses of one made skin without shear, with the six signals "
        f"of the upper chips, reads presses with {DRAGS[SHOWN]:g} N of shear on all 36 cells: "
        "signals as they come, after the SI's preprocessing (Text S7), and beside them the joint "
        "estimator, which takes all nine signals for place, drag and normal force after 60 "
        "labelled touches. (a, d) Normal force, mean and standard deviation; (b, c, e, f) place "
        f"error of each cell, mean over {FORCES[0]:g} to {FORCES[-1]:g} N. As the paper says, "
        "preprocessing helps on most cells and the errors stay large. (g) The same over the shear; "
        "(h) on the SI's own theory, where the drag slides the sheet as a whole, the same model "
        "and correction lose little: what fails is the slide, not the learning. (i) What the shear "
        "along X adds to one signal of each upper chip (dots) and what theory's slide makes of it "
        "(lines): how the whole sheet answers a drag depends on where it acts, which the lower "
        f"chip does not see; {100 * whole.left / whole.induced:.0f} % of what shear adds is left, "
        f"and {100 * whole.fitted_left / whole.induced:.0f} % after the best multiple of the lower "
        "chip's signals. That chip also reads the pull of a "
        "finger that sticks and the tilt of its board, together "
        f"{whole.unasked:.2f} N in the mean without any drag, so that "
        "preprocessing spoils even presses without shear.",
        figure=figure,
        rows=tuple(shear_learning_rows(result, jointly)),
    )


def _draw_force(axis: Axes, sheared: Sheared, kinds: tuple[Readings, ...]) -> None:
    """Force read over the true one."""
    axis.plot([0, 1.1], [0, 1.1], color=GREY, linewidth=0.6)
    for k, (readings, (label, colour, marker)) in enumerate(zip(kinds, _WAYS, strict=True)):
        groups = [readings.force[SHOWN][sheared.true == force] for force in FORCES]
        look: Look = {"fmt": marker, "color": colour, "markersize": 3.5, "linewidth": 0.9}
        middle, spread = [item.mean() for item in groups], [item.std() for item in groups]
        axis.errorbar(np.array(FORCES) + 0.02 * (k - 1), middle, spread, label=label, **look)
    axis.set(xlim=(0.2, 1.1), ylim=(0.2, 1.25))
    axis.set(xlabel="normal force (N)", ylabel="normal force read (N)")


def _draw_cells(axis: Axes, sheared: Sheared, kinds: tuple[Readings, ...], along: int) -> None:
    """Place error of each cell along one axis, mm."""
    for readings, (label, colour, marker) in zip(kinds, _WAYS, strict=True):
        errors = sheared.by_cell(np.abs(readings.place[SHOWN][:, along])) * 1e3
        cells = np.arange(len(errors)) + 1
        axis.plot(cells, errors, marker, color=colour, markersize=2.6, label=label)
    logarithmic(axis.yaxis)
    axis.set(ylim=(0.05, 200), xlabel="cell, along x first", ylabel="error (mm)")


def _draw_drags(axis: Axes, readings: Sequence[Readings], way: int) -> None:
    """Mean place error over the drag, both axes together."""
    label, colour, marker = _WAYS[way]
    errors = np.mean([item.distance.mean(axis=1) for item in readings], axis=0) * 1e3
    axis.plot(DRAGS, errors, marker + "-", color=colour, markersize=3.5, linewidth=1.0, label=label)
    logarithmic(axis.yaxis)


def _draw_answers(axis: Axes, whole: SheetTrial) -> None:
    """What the drag along X adds to the upper chips' B_x, cell by cell, and what theory says."""
    cells = np.arange(len(whole.answers)) + 1
    for k, colour in enumerate((INK, RED)):
        label = f"chip {k + 2}"
        axis.plot(cells, whole.answers[:, k] * 1e6, ".", color=colour, markersize=4, label=label)
        axis.axhline(whole.slide[k] * 1e6, color=colour, linewidth=0.8, linestyle="--")
    axis.set(title="(i) what shear adds", xlabel="cell, along x first")
    axis.set_ylabel("change of $B_x$ (µT)")
    axis.margins(y=0.25)
    axis.legend(handlelength=1.0, loc="upper center", ncols=2)


if __name__ == "__main__":
    plate(Setting()).show()
