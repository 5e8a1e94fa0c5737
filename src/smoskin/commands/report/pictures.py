"""The picture of a characterisation: what was felt and read in the touches that figures are of."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from smoskin.commands.report.courses import Course
from smoskin.plots import BLUE, GREY, INK, ORANGE

_SHOWN: Final = 40
"""Touches drawn in one panel, at most."""


def draw_courses(courses: Sequence[Course]) -> Drawing:
    """Force over depth, signal over force, recoveries, and signal over force of all touches."""
    drawing = Drawing(figsize=(7.2, 5.2), layout="constrained")
    depth, signal, left, sizes = drawing.subplots(2, 2).flat
    looped = [course for course in courses if course.loop is not None][:_SHOWN]
    for course in looped:
        _draw_loop(course, depth, signal)
    depth.set(xlabel="depth of the probe (mm)", ylabel="force (N)", title="Force over depth")
    signal.set(xlabel="force (N)", ylabel="signal (mT)", title="Signal over force")
    released = [course for course in courses if course.released is not None][:_SHOWN]
    for course in released:
        assert course.released is not None
        share = np.abs(course.signal) / course.size if course.size else course.signal
        left.plot(course.times - course.released, 100 * share, color=BLUE, linewidth=0.6)
    if released:
        left.set(xlim=(-0.2, None), yscale="log")
    left.set(xlabel="time after the release (s)", ylabel="signal left (%)", title="Recovery")
    sizes.plot(
        [course.force for course in courses],
        [1e3 * course.size for course in courses],
        ".",
        color=ORANGE,
        markersize=3,
    )
    sizes.set(xlabel="force (N)", ylabel="signal (mT)", title="Held touches")
    for axes, shown in ((depth, looped), (signal, looped), (left, released)):
        if not shown:
            axes.text(0.5, 0.5, "not recorded", ha="center", color=GREY, transform=axes.transAxes)
    return drawing


def _draw_loop(course: Course, depth: Axes, signal: Axes) -> None:
    """Loading and unloading of a touch."""
    loop = course.loop
    assert loop is not None
    for part, colour in ((slice(0, loop.turn + 1), BLUE), (slice(loop.turn, None), INK)):
        depth.plot(1e3 * loop.depth[part], loop.force[part], color=colour, linewidth=0.6)
        signal.plot(loop.force[part], 1e3 * loop.signal[part], color=colour, linewidth=0.6)
