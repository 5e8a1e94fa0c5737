"""What recordings tell of the rig itself: how it gives way, and how the skin lags behind its gauge.

Decides that a rig's own give, measured on something rigid, is taken off the probe's depth, and
which touches are sharp enough to tell a lag.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.report.courses import Course, phase_of
from smoskin.commands.report.figures import Figure
from smoskin.records import HeldTouch
from smoskin.sensing.characteristics import Measured, mean_of, slope

_LONGEST: Final = 0.25
"""Lag that is looked for, either way, s."""
_STEP: Final = 1e-3
"""Lags that are tried are so far apart, s."""
_FEWEST: Final = 8
"""Samples of the gauge on the rise, and as many readings, that a lag is told by."""
_ALIKE: Final = 0.98
"""Correlation of force and signal from which their lag is told."""
_PRESSED: Final = 0.2
"""Share of the largest force from which a rigid block is pressed evenly."""


def compliance_of(courses: Sequence[Course]) -> Measured:
    """How far the rig itself gives way, m/N, by touches of something rigid; NaN where none tells.

    The slope of the probe's depth over the force, from a fifth of the largest on.
    """
    values = []
    for course in courses:
        loop = course.loop
        if loop is None:
            continue
        chosen = np.flatnonzero(loop.force[: loop.loaded + 1] > _PRESSED * loop.force.max())
        if len(chosen) >= 3 and np.ptp(loop.force[chosen]) > 0.0:
            values.append(slope(loop.force[chosen], loop.depth[chosen]).value)
    return mean_of(values)


def less_compliance(course: Course, compliance: float) -> Course:
    """The course with depths of the skin alone, of which a rig with this compliance, m/N, took."""
    if course.loop is None:
        return course
    loop = course.loop
    return replace(course, loop=replace(loop, depth=loop.depth - compliance * loop.force))


def lag_of(touch: HeldTouch, course: Course) -> float:
    """How much later than its gauge the skin says that it is pressed, s; NaN where nothing tells.

    The shift at which force and signal are most alike from the rest to the middle of the hold,
    between tried ones by a parabola. Corners tell it: press as quickly as the rig does.
    """
    if touch.trace is None or (hold := phase_of(touch.trace, "hold")) is None:
        return np.nan
    moments, force = touch.trace.gauge[:, 0], -touch.trace.gauge[:, 3]
    near = course.times[-1] - _LONGEST, course.times[0] + _LONGEST
    # Beyond it a gauge that is early would tell of the release, where both have loops of their own.
    within = (moments >= near[1]) & (moments <= min(sum(hold) / 2, near[0]))
    moments, force = moments[within], force[within]
    if len(force) < 2 * _FEWEST:
        return np.nan
    rising = (force > 0.1 * force.max()) & (force < 0.9 * force.max())
    if not len(np.unique(force)) >= _FEWEST or not rising.any():
        return np.nan
    shifts = np.arange(-_LONGEST, _LONGEST + _STEP / 2, _STEP)
    alike = np.array(
        [_correlation(force, np.interp(moments + s, course.times, course.signal)) for s in shifts]
    )
    best = int(alike.argmax())
    if alike[best] < _ALIKE or not 0 < best < len(shifts) - 1:
        return np.nan
    before, at, after = alike[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    return float(shifts[best] + (0.5 * _STEP * (before - after) / bend if bend < 0.0 else 0.0))


def _correlation(first: Floats, second: Floats) -> float:
    """Correlation of two series; 0 where one does not change."""
    first, second = first - first.mean(), second - second.mean()
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size > 0.0 else 0.0


def rig_figures(compliance: Measured, lags: Sequence[float]) -> tuple[Figure, ...]:
    """Both as figures of a report, with why they are not known."""
    return (
        _filled(
            _COMPLIANCE,
            compliance,
            lambda m: 1e6 * m,
            "no recording of a rigid block was given, with gauge and stage",
        ),
        _filled(
            _LAG,
            mean_of(lags),
            lambda m: 1e3 * m,
            "no touch rose with its gauge read from the rest on",
        ),
    )


def _filled(figure: Figure, measured: Measured, unit: Callable[[float], float], why: str) -> Figure:
    if not measured.count:
        return replace(figure, reason=why)
    value, deviation = unit(measured.value), unit(measured.deviation)
    return replace(figure, measured=replace(measured, value=value, deviation=deviation))


_COMPLIANCE: Final = Figure(
    name="rig_compliance",
    title="Compliance of the rig, taken off depths",
    unit="um/N",
    equation="slope of the probe's depth over F on a rigid block, from 0.2 F_max on",
    source="this project's definition",
)
_LAG: Final = Figure(
    name="gauge_lag",
    title="Lag of the skin behind the gauge",
    unit="ms",
    equation="argmax over tau of the correlation of F(t) and s(t + tau), rest to mid-hold",
    source="this project's definition",
)
