"""The figures of a skin from the courses of its touches, each with how it is made or why it is not.

Decides which touches count for which figure, and in which units people read it.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.commands.report.courses import Course
from smoskin.design.skin import SkinDesign
from smoskin.origami.geometry import geometry
from smoskin.sensing.characteristics import (
    Measured,
    crosstalk,
    loop_share,
    mean_of,
    noise,
    recovery_time,
    relative_slope,
    repeatability,
    slope,
)

_SAME_PLACE: Final = 0.25e-3
"""Distance up to which two places are one, m."""
_SAME_FORCE: Final = 0.1
"""Relative difference up to which two touches are equally hard."""
_VARIED: Final = 1.5
"""Ratio of the hardest to the softest touch of a place from which a sensitivity is told."""
_WARMED: Final = 3.0
"""Span of temperature from which a coefficient is told, K."""
_PARTS: Final = (0.1, 0.05, 0.01)
"""Parts of the loaded signal that may be left of it."""
_SEEN: Final = 3.0
"""Deviations of a reading's noise that what may be left must exceed."""
_WINDOW: Final = 5
"""Readings whose median is one of a recovery."""
_LEAST: Final = 5
"""Samples that make a line."""


_NOTHING: Final = Measured(value=np.nan, deviation=np.nan, count=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One figure of a skin."""

    name: str
    """Key in the report."""
    title: str
    equation: str
    """How it is defined, in symbols."""
    source: str
    """Source of the definition."""
    unit: str
    measured: Measured = _NOTHING
    """In the unit; NaN where the recordings do not give it."""
    reason: str = ""
    """Why they do not; empty where they do."""
    parts: tuple[tuple[str, float], ...] = ()
    """The same of each place, chip or part, in the unit."""
    printed: str = ""
    """What the paper prints, where that compares."""

    def as_json(self) -> dict[str, Any]:
        """Plain values; None where nothing is known."""
        return {
            "name": self.name,
            "title": self.title,
            "value": _plain(self.measured.value),
            "deviation": _plain(self.measured.deviation),
            "unit": self.unit,
            "count": self.measured.count,
            "reason": self.reason,
            "parts": {label: _plain(value) for label, value in self.parts},
            "equation": self.equation,
            "source": self.source,
            "printed": self.printed,
        }


Group = tuple[str, list[Course]]
"""Touches that belong together, with their name."""
Made = tuple[Measured, list[tuple[str, float]]]
"""A figure in its unit, and its parts."""


class _Lacking(Exception):
    """The recordings do not give a figure, and why."""


def figures_of(courses: Sequence[Course], design: SkinDesign) -> tuple[Figure, ...]:
    """All figures, in the order of the report."""
    made: tuple[tuple[Figure, Callable[[], Made]], ...] = (
        (_NOISE, lambda: _noise(courses)),
        (_SENSITIVITY, lambda: _sensitivity(courses)),
        (_STIFFNESS, lambda: _stiffness(courses)),
        (_HYSTERESIS, lambda: _hysteresis(courses, depth=True)),
        (_SIGNAL_HYSTERESIS, lambda: _hysteresis(courses, depth=False)),
        (_REPEATABILITY, lambda: _repeatability(courses)),
        (_CROSSTALK, lambda: _crosstalk(courses, design)),
        *((_recovered(part), partial(_recovery, courses, part)) for part in _PARTS),
        (_REST_TEMPERATURE, lambda: _temperature(courses, rest=True)),
        (_TOUCH_TEMPERATURE, lambda: _temperature(courses, rest=False)),
    )
    figures = []
    for figure, make in made:
        try:
            measured, parts = make()
            figures.append(replace(figure, measured=measured, parts=tuple(parts)))
        except _Lacking as why:
            figures.append(replace(figure, reason=str(why)))
    return tuple(figures)


def _noise(courses: Sequence[Course]) -> Made:
    each = [noise(course.still) for course in courses if len(course.still) >= 3]
    if not each:
        raise _Lacking("no rest before a touch has three good readings")
    steps = np.array([measured.count - 1 for measured in each])
    squares = np.array([measured.value for measured in each]) ** 2
    sigma = float((squares @ steps / steps.sum()) ** 0.5)
    relative = np.array(
        [measured.deviation / measured.value if measured.value else 0.0 for measured in each]
    )
    spread = sigma * float(np.sqrt((relative * steps) @ (relative * steps)) / steps.sum())
    count = int(steps.sum()) + len(steps)
    return _in_unit(Measured(value=sigma, deviation=spread, count=count), 1e6), []


def _sensitivity(courses: Sequence[Course]) -> Made:
    parts = []
    for place, group in _by_run(courses, _places):
        forces = np.array([course.force for course in group])
        if len(group) < 2 or forces.max() < _VARIED * forces.min():
            continue
        mean = np.sum([course.change for course in group], axis=0)
        along = mean / np.linalg.norm(mean)
        parts.append((place, 1e6 * slope(forces, [(c.change * along).sum() for c in group]).value))
    if not parts:
        raise _Lacking("no place was pressed with two forces, one half as large again as the other")
    return mean_of([value for _, value in parts]), parts


def _stiffness(courses: Sequence[Course]) -> Made:
    def of(course: Course) -> float:
        loop = course.loop
        if loop is None:
            return np.nan
        chosen = np.flatnonzero(loop.force[: loop.loaded + 1] > 0.2 * loop.force.max())
        if len(chosen) < _LEAST or not np.ptp(loop.depth[chosen]) > 0.0:
            return np.nan
        return 1e-3 * slope(loop.depth[chosen], loop.force[chosen]).value

    return _by_place(courses, of, "gauge and stage were not read while a touch was pressed on")


def _hysteresis(courses: Sequence[Course], *, depth: bool) -> Made:
    def of(course: Course) -> float:
        loop = course.loop
        if loop is None or not loop.closed or not 0 < loop.turn < len(loop.force) - 1:
            return np.nan
        drive, response = (loop.depth, loop.force) if depth else (loop.force, loop.signal)
        return 100.0 * loop_share(drive, response, loop.turn)

    return _by_place(courses, of, "the gauge was not read while a touch was let go slowly")


def _repeatability(courses: Sequence[Course]) -> Made:
    parts, whole = [], []
    for label, group in _by_run(courses, _alike):
        if len(group) < 3:
            continue
        mean = np.sum([course.change for course in group], axis=0)
        along = mean / np.linalg.norm(mean)
        # How hard each was is known: what the gauge tells apart is no lack of repeatability.
        each = repeatability([(c.change * along).sum() / c.force for c in group])
        parts.append((label, 100.0 * each.value))
        whole.append(each)
    if not whole:
        raise _Lacking("no touch was made three times at one place with one force")
    free = np.array([measured.count - 1 for measured in whole])
    share = float(
        (np.array([measured.value for measured in whole]) ** 2 @ free / free.sum()) ** 0.5
    )
    spread = share * (0.5 / float(free.sum())) ** 0.5
    count = sum(measured.count for measured in whole)
    return _in_unit(Measured(value=share, deviation=spread, count=count), 100.0), parts


def _crosstalk(courses: Sequence[Course], design: SkinDesign) -> Made:
    skin = geometry(design)
    chips = skin.roll.developed(skin.chips)[:, :2]
    pressed = [course for course in courses if course.force > 0.0]
    sizes = np.array([np.linalg.norm(c.change, axis=1) / c.force for c in pressed])
    away = np.array([np.linalg.norm(chips - c.place, axis=1) for c in pressed])
    nearest = away.argmin(axis=1)
    shares = crosstalk(sizes, nearest)
    if not np.isfinite(shares).any():
        raise _Lacking("all touches are nearest to one chip")
    named = zip(design.halls, (100.0 * shares).tolist(), strict=True)
    parts = [(site.name, share) for site, share in named if np.isfinite(share)]
    return mean_of([share for _, share in parts]), parts


def _recovery(courses: Sequence[Course], part: float) -> Made:
    released = [course for course in courses if course.released is not None]
    if not released:
        raise _Lacking("no load was taken away at once with readings after it")
    sigma = 1e-6 * _noise(courses)[0].value
    seen = [course for course in released if part * course.size >= _SEEN * sigma]
    if not seen:
        raise _Lacking(
            f"{100 * part:g} % of a touch's signal is less than {_SEEN:g} times the noise of a "
            "reading"
        )

    def of(course: Course) -> float:
        assert course.released is not None
        smooth = _smoothed(course.signal, course.times, course.released)
        return float(
            recovery_time(course.times, smooth, course.released, within=part, rest=np.zeros(()))
        )

    mean, parts = _by_place(seen, of, f"{100 * part:g} % was not reached while the skin was read")
    # Nothing tells when between two readings it was reached, and when in the lifting it began.
    step = float(np.median(np.concatenate([np.diff(course.times) for course in seen])))
    lifting = max(course.lifting for course in seen)
    unsure = np.array([np.nan_to_num(mean.deviation), step / 12**0.5, lifting / 12**0.5])
    spread = float(np.linalg.norm(unsure))
    return replace(mean, deviation=spread), parts


def _temperature(courses: Sequence[Course], *, rest: bool) -> Made:
    warm = [course for course in courses if np.isfinite(course.temperature)]
    parts, spreads, span = [], [], 0.0
    for label, group in _places(warm) if rest else _alike(warm):
        degrees = np.array([course.temperature for course in group])
        if len(group) < 2 or np.ptp(degrees) < _WARMED:
            span = max(span, float(np.ptp(degrees)))
            continue
        if rest:
            level = np.array([course.still.mean(axis=0) for course in group])
        else:
            level = np.array([course.change.ravel() / course.force for course in group])
        along = level.mean(axis=0) / np.linalg.norm(level.mean(axis=0))
        each = relative_slope(degrees, level @ along)
        parts.append((label, 100.0 * each.value))
        spreads.append(100.0 * each.deviation)
    if not parts:
        raise _Lacking(
            f"the chips' temperature varied by {span:.1f} K at one place, less than {_WARMED:g} K: "
            "give recordings of a cold and a warm skin"
        )
    whole = mean_of([value for _, value in parts])
    if whole.count == 1:
        whole = replace(whole, deviation=spreads[0])
    return whole, parts


def _by_place(courses: Sequence[Course], of: Callable[[Course], float], reason: str) -> Made:
    """A figure of single touches: its mean over all, and that of each place."""
    pairs = [(course, of(course)) for course in courses]
    known = [(course, value) for course, value in pairs if np.isfinite(value)]
    if not known:
        raise _Lacking(reason)
    values = {id(course): value for course, value in known}
    parts = [
        (place, float(np.mean([values[id(course)] for course in group])))
        for place, group in _places([course for course, _ in known])
    ]
    return mean_of([value for _, value in known]), parts


def _places(courses: Sequence[Course]) -> Iterator[Group]:
    """Touches by their place, with its name."""
    left = list(courses)
    while left:
        place = left[0].place
        here = [np.linalg.norm(course.place - place) <= _SAME_PLACE for course in left]
        x, y = 1e3 * place
        yield f"({x:.1f}, {y:.1f}) mm", list(itertools.compress(left, here))
        left = [course for course, same in zip(left, here, strict=True) if not same]


def _by_run(
    courses: Sequence[Course], groups: Callable[[Sequence[Course]], Iterator[Group]]
) -> Iterator[Group]:
    """Groups of each recording for itself, as skins may be warmer in one than in another."""
    runs = sorted({course.run for course in courses})
    for run in runs:
        for label, group in groups([course for course in courses if course.run == run]):
            yield label if len(runs) == 1 else f"{label}, recording {run + 1}", group


def _alike(courses: Sequence[Course]) -> Iterator[Group]:
    """Touches by place and force, with their name."""
    for place, group in _places(courses):
        left = sorted(group, key=lambda course: course.force)
        while left:
            least = left[0].force
            alike = [course for course in left if course.force <= (1.0 + _SAME_FORCE) * least]
            mean = float(np.mean([course.force for course in alike]))
            yield f"{place}, {mean:.2f} N", alike
            left = left[len(alike) :]


def _smoothed(signal: Floats, times: Floats, released: float) -> Floats:
    """The running median of a signal after its release."""
    padded = np.pad(signal, _WINDOW // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW)
    return np.where(times <= released, signal, np.median(windows, axis=1))


def _in_unit(measured: Measured, factor: float) -> Measured:
    value, deviation = factor * measured.value, factor * measured.deviation
    return replace(measured, value=value, deviation=deviation)


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _recovered(part: float) -> Figure:
    return Figure(
        name=f"recovery_{100 * part:g}_percent",
        title=f"Recovery to {100 * part:g} % of the signal",
        unit="s",
        equation=f"least t after the release from which |s| stays below {part:g} s_held, medians "
        "of five",
        source="SI Text S6, Figure S9",
        printed="Figure S9 shows recoveries from 1 N; no number is printed",
    )


_NOISE: Final = Figure(
    name="noise",
    title="Noise of a reading at rest",
    unit="uT",
    equation="sigma^2 = mean (b_(i+1) - b_i)^2 / 2, one axis",
    source="von Neumann, Kent, Bellinson and Hart, 1941",
)
_SENSITIVITY: Final = Figure(
    name="sensitivity",
    title="Sensitivity",
    unit="uT/N",
    equation="slope of s over F by least squares, a place",
    source="s: change of all chips' fields along its mean direction",
)
_STIFFNESS: Final = Figure(
    name="stiffness",
    title="Stiffness where it is pressed",
    unit="N/mm",
    equation="slope of F over the probe's depth from 0.2 F_max on, loading",
    source="SI, Tactile skin characterisation",
)
_HYSTERESIS: Final = Figure(
    name="hysteresis",
    title="Hysteresis of force over depth",
    unit="%",
    equation="|closed integral of F dd| / integral of F dd, loading",
    source="share of the work that is lost",
)
_SIGNAL_HYSTERESIS: Final = Figure(
    name="signal_hysteresis",
    title="Hysteresis of the signal over force",
    unit="%",
    equation="|closed integral of s dF| / integral of s dF, loading",
    source="the same of signal and force",
)
_REPEATABILITY: Final = Figure(
    name="repeatability",
    title="Repeatability",
    unit="%",
    equation="standard deviation of s / F over its mean, one touch made N times",
    source="relative standard deviation, pooled over touches",
)
_CROSSTALK: Final = Figure(
    name="crosstalk",
    title="Cross-talk of chips",
    unit="%",
    equation="mean |b_c| / F of touches nearest to other chips over that of those nearest to c",
    source="this project's definition",
)
_REST_TEMPERATURE: Final = Figure(
    name="rest_temperature",
    title="Temperature coefficient of the rest field",
    unit="%/K",
    equation="b / (a + b T_0), field at rest a + b T, T_0 = 25 degC",
    source="SI Text S11, Figure S15",
    printed="-0.5 %/K (about 5 % less per 10 degC), of a magnet as its chip reads it",
)
_TOUCH_TEMPERATURE: Final = Figure(
    name="touch_temperature",
    title="Temperature coefficient of a touch's signal",
    unit="%/K",
    equation="b / (a + b T_0), signal per newton a + b T, T_0 = 25 degC",
    source="SI Text S11, Figure S15",
)
