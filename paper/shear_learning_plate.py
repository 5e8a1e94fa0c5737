"""Draws Figure S11 anew: a model trained without shear, under shear, before and after."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from paper.shear_learning import (
    DRAGS,
    FORCES,
    SHOWN,
    Jointly,
    Readings,
    Sheared,
    ShearLearning,
    SheetTrial,
)
from paper.style import BLUE, GREEN, GREY, INK, ORANGE, RED, Plate, lay_out, styled

_WAYS: Final = (
    ("as it comes", ORANGE, "o"),
    ("preprocessed", BLUE, "s"),
    ("joint estimator", GREEN, "D"),
)


def shear_learning_plate(found: ShearLearning, jointly: tuple[Jointly, Jointly]) -> Plate:
    """Figures S11a to S11f, and what decides them: the drag, the sheet, and taking drags along."""
    whole, theory = found.whole, found.theory
    with styled():
        figure = Figure(figsize=(7.2, 7.4), layout="constrained")
        axes = figure.subplots(3, 3)
        for row, (name, sheared, joint) in enumerate(
            zip("XY", (whole.x, whole.y), jointly, strict=True)
        ):
            ways = (sheared.raw, sheared.preprocessed, joint.readings)
            letters = "abcdef"[3 * row : 3 * row + 3]
            _draw_force(axes[row][0], sheared, ways)
            axes[row][0].set_title(f"({letters[0]}) normal force, shear along {name}")
            for column, place in ((1, "x"), (2, "y")):
                _draw_cells(axes[row][column], sheared, ways, column - 1)
                axes[row][column].set_title(
                    f"({letters[column]}) {place} error, shear along {name}"
                )
        _draw_drags(axes[2][0], (whole.x.raw, whole.y.raw), 0)
        _draw_drags(axes[2][0], (whole.x.preprocessed, whole.y.preprocessed), 1)
        _draw_drags(axes[2][0], [one.readings for one in jointly], 2)
        axes[2][0].set_title("(g) the whole sheet")
        _draw_drags(axes[2][1], (theory.x.raw, theory.y.raw), 0)
        _draw_drags(axes[2][1], (theory.x.preprocessed, theory.y.preprocessed), 1)
        axes[2][1].set_title("(h) theory's own sheet")
        for axis in axes[2][:2]:
            axis.set(ylim=(0.2, 200), xlabel="shear (N)", ylabel="mean place error (mm)")
        _draw_answers(axes[2][2], whole)
        axes[0][0].legend(fontsize=6.5, handlelength=1.2, loc="upper left")
        for axis in axes.flat:
            for side in ("top", "right"):
                axis.spines[side].set_visible(False)
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
        f"finger that sticks, {whole.unasked:.2f} N in the mean without any drag, so that "
        "preprocessing spoils even presses without shear.",
        figure=figure,
    )


def _draw_force(axis: Axes, sheared: Sheared, ways: tuple[Readings, ...]) -> None:
    """Force said over the true one."""
    axis.plot([0, 1.1], [0, 1.1], color=GREY, linewidth=0.6)
    for k, (one, (label, colour, marker)) in enumerate(zip(ways, _WAYS, strict=True)):
        groups = [one.force[SHOWN][sheared.true == force] for force in FORCES]
        axis.errorbar(
            np.array(FORCES) + 0.02 * (k - 1), [group.mean() for group in groups],
            [group.std() for group in groups], fmt=marker, color=colour, markersize=3.5,
            linewidth=0.9, label=label,
        )  # fmt: skip
    axis.set(
        xlim=(0.2, 1.1), ylim=(0.2, 1.25), xlabel="normal force (N)", ylabel="normal force said (N)"
    )


def _draw_cells(axis: Axes, sheared: Sheared, ways: tuple[Readings, ...], along: int) -> None:
    """Place error of each cell along one axis, mm."""
    for one, (label, colour, marker) in zip(ways, _WAYS, strict=True):
        errors = sheared.by_cell(np.abs(one.place[SHOWN][:, along])) * 1e3
        axis.plot(np.arange(len(errors)) + 1, errors, marker, color=colour, markersize=2.6,
                  label=label)  # fmt: skip
    _logarithmic(axis)
    axis.set(ylim=(0.05, 200), xlabel="cell, along x first", ylabel="error (mm)")


def _draw_drags(axis: Axes, readings: "list[Readings] | tuple[Readings, ...]", way: int) -> None:
    """Mean place error over the drag, both axes together."""
    label, colour, marker = _WAYS[way]
    errors = np.mean([one.distance.mean(axis=1) for one in readings], axis=0) * 1e3
    axis.plot(DRAGS, errors, marker + "-", color=colour, markersize=3.5, linewidth=1.0, label=label)
    _logarithmic(axis)


def _draw_answers(axis: Axes, whole: SheetTrial) -> None:
    """What the drag along X adds to the upper chips' B_x, cell by cell, and what theory says."""
    for k, colour in enumerate((INK, RED)):
        axis.plot(np.arange(len(whole.answers)) + 1, whole.answers[:, k] * 1e6, ".",
                  color=colour, markersize=4, label=f"chip {k + 2}")  # fmt: skip
        axis.axhline(whole.slide[k] * 1e6, color=colour, linewidth=0.8, linestyle="--")
    axis.set(
        title="(i) what shear adds", xlabel="cell, along x first", ylabel="change of $B_x$ (µT)"
    )
    axis.margins(y=0.25)
    axis.legend(fontsize=6.5, handlelength=1.0, loc="upper center", ncols=2)


def _logarithmic(axis: Axes) -> None:
    axis.set_yscale("log")
    axis.minorticks_off()
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
