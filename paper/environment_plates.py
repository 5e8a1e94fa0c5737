"""Draws Figures S9 and S15 anew: recovery after a press, and a magnet that warms up."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from paper.environment import FORCE, HELD, PARTS, Recovery, Warmth
from paper.style import BLUE, GREEN, INK, ORANGE, Plate, lay_out, styled

_LETTERS: Final = "abcdefghi"
_AXES: Final = (("x", BLUE, "o"), ("y", ORANGE, "s"), ("z", GREEN, "D"))
_SHOWN: Final = (-2.0, 12.0)
"""s round the release."""


def recovery_plate(found: Recovery) -> Plate:
    """Figures S9a to S9f: how much of the loaded signal is left after the release."""
    with styled():
        figure = Figure(figsize=(7.2, 4.6), layout="constrained")
        rows = -(-len(found.cells) // 3)
        axes = figure.subplots(rows, 3, sharex=True, sharey=True, squeeze=False)
        for k, axis in enumerate(axes.flat[: len(found.cells)]):
            _draw_recovery(axis, found, k)
        for axis in axes.flat[len(found.cells) :]:
            axis.remove()
        for axis in axes[-1]:
            axis.set_xlabel("time after the release (s)")
        for axis in axes[:, 0]:
            axis.set_ylabel("change of field (µT)")
        axes[-1, 0].legend(loc=(0.3, 0.5), fontsize=6.5, handlelength=1.6)
        lay_out(figure)
    slowest = found.settled.max(axis=0)
    return Plate(
        name="figure_s9",
        title="Figures S9a to S9f",
        caption=f"Figures S9a to S9f, by the model: a load of {FORCE:g} N held for {HELD:g} s on "
        "cells (1,1) to (6,6) of the whole sheet and taken away at once; change of the field at "
        f"the two chips under the sheet. The slowest cell is back to {100 * PARTS[0]:g} % "
        f"{_after(slowest[0])}, to {100 * PARTS[1]:g} % {_after(slowest[1])}, to "
        f"{100 * PARTS[2]:g} % {_after(slowest[2])}. The values of the paper's figure are "
        "not in its text, and the rubber's series is assumed (design.materials): fit a recorded "
        "recovery (mechanics.recovery.fit_prony) before trusting the tail. The sheet's inertia is "
        "left out.",
        figure=figure,
    )


def _draw_recovery(axis: Axes, found: Recovery, k: int) -> None:
    """One cell."""
    n, m = found.cells[k]
    inside = (found.times >= _SHOWN[0]) & (found.times <= _SHOWN[1])
    for s, (name, colour) in enumerate(zip(("chip 2", "chip 3"), (BLUE, ORANGE), strict=True)):
        axis.plot(found.times[inside], found.signal[k, inside, s] * 1e6, color=colour, label=name,
                  linewidth=1.1)  # fmt: skip
    axis.axhline(found.noise * 1e6, color=INK, linewidth=0.6, linestyle=":",
                 label="noise of one reading")  # fmt: skip
    axis.set_yscale("log")
    axis.minorticks_off()
    axis.set(xlim=_SHOWN, ylim=(1, 2e4), title=f"({_LETTERS[k]}) cell ({n},{m})")
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    times = [
        f"to {100 * part:g} %: {_duration(seconds)}"
        for part, seconds in zip(PARTS, found.settled[k], strict=True)
    ]
    axis.text(0.97, 0.95, "\n".join(times), transform=axis.transAxes, ha="right", va="top",
              fontsize=6.5, linespacing=1.3)  # fmt: skip
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def _duration(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 1e-3:
        return "at once"
    return f"{seconds * 1e3:.0f} ms" if seconds < 1 else f"{seconds:.1f} s"


def _after(seconds: float) -> str:
    """The same in a sentence."""
    duration = _duration(seconds)
    return duration if duration == "at once" else f"after {duration}"


def warmth_plate(found: Warmth) -> Plate:
    """Figure S15b: a magnet's field over temperature, its losses, and the chip's correction."""
    with styled():
        figure = Figure(figsize=(7.2, 2.9), layout="constrained")
        fields, losses, rest = figure.subplots(1, 3)
        start = found.field[0]
        for k, (name, colour, marker) in enumerate(_AXES):
            share = found.read[:, k] / start[k]
            fields.plot(found.temperature, np.abs(found.field[:, k]) * 1e3, color=colour,
                        linewidth=0.8)  # fmt: skip
            fields.plot(found.temperature, np.abs(found.read[:, k]) * 1e3, marker, color=colour,
                        markersize=3, label=f"$|B_{name}|$")  # fmt: skip
            losses.plot(found.temperature, 100 * (share - 1), marker, color=colour, markersize=3,
                        label=f"$B_{name}$: {100 * found.loss[k]:.2f} % per 10 °C")  # fmt: skip
            rest.plot(found.temperature, 100 * (found.corrected[:, k] / start[k] - 1), marker,
                      color=colour, markersize=3, label=f"$B_{name}$")  # fmt: skip
        span = found.temperature[[0, -1]]
        losses.plot(span, -0.5 * (span - span[0]), color=INK, linewidth=0.6, linestyle="--",
                    label="printed: 5 % per 10 °C")  # fmt: skip
        fields.set(title="(a) field", ylabel="field at the chip (mT)", ylim=(0, None))
        losses.set(title="(b) change", ylabel="change from 25 °C (%)")
        rest.set(title="(c) corrected by the chip's °C", ylabel="error of the field (%)")
        reach = 100 * found.left
        rest.set_ylim(-4 * reach, 4 * reach)
        for axis in (fields, losses, rest):
            axis.set_xlabel("temperature (°C)")
            axis.legend(fontsize=6.5, handlelength=1.4)
            for side in ("top", "right"):
                axis.spines[side].set_visible(False)
        lay_out(figure)
    return Plate(
        name="figure_s15",
        title="Figure S15b",
        caption="Figure S15b, by the model: the field of a magnet of the skin, 1.0 and 0.7 mm "
        "beside its chip, from 25 to 75 °C; lines the model, marks one noisy reading each. The "
        "model takes the printed loss of about 5 % per 10 °C in, alike for all three components; "
        "the paper's own fields are not in its text. (c) divides each reading by the magnet's "
        "factor at the temperature that the chip itself reads.",
        figure=figure,
    )
