"""Learning force from whole courses of it: what rubber remembers is told by what was read before.

Decides which memory serves, how a later force is foretold, and how wrong it is stated to be: what
early parts of a course teach is judged by its later ones, as later touches will be. There forces
are off by a share of themselves, the gain of rubber that was used meanwhile, which no part held out
between others shows. It wanders: its square grows with the time between. Another session is stated
to be as far as three courses' lengths, whatever the clock says: skins are taken off and zeroed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from smoskin.arguments import Seed, typed
from smoskin.arrays import Bools, Floats, freeze
from smoskin.errors import ArgumentError
from smoskin.roles import Progress, unheard
from smoskin.sensing.learned.gaussian_process import LearnedModel, Metric, Output
from smoskin.sensing.learned.inputs import Encoding, Form, Past
from smoskin.sensing.learned.memory import choose_encoding
from smoskin.sensing.learned.touches import held_share, varying
from smoskin.sensing.learned.training import Examples, FittingEffort, judged, train_model

FORCES: Final = (Output.FX, Output.FY, Output.FZ)
"""Quantities that are forces."""
_PARTS: Final = 10
"""Parts of a course, one after the other, that are held out whole."""
_FEWEST: Final = 3
"""Parts from which later ones are foretold, at least."""
_HALF: Final = 5
"""Parts from which a model is about as sure as one of all."""
_LAST: Final = 8
"""Part that begins the last stretch of a course, by which the ranges themselves are judged."""
_AHEAD: Final = 3.0
"""Lengths of a course of use that another session counts as."""
_FAINT: Final = 30e-6
"""Field below which there is no touch, T, at least; nor a direction worth learning."""
_PRESSED: Final = 0.02
"""Share of the largest force from which something presses."""
_QUICK: Final = FittingEffort(rows=1500, evidence_rows=250, iterations=15)
"""Effort of trainings that only compare."""
_FULL: Final = FittingEffort(rows=3000)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """Forces on a skin over time, with what its chips read; T rows, S chips."""

    time: Floats
    """(T,), s, rising."""
    field: Floats
    """(T, S, 3), T, of all chips, less what they read at rest."""
    position: Floats
    """(T, 2), m; NaN where nothing touches or that is not known."""
    force: Floats
    """(T, 3), N, that the toucher exerts on the skin; NaN where it is not known."""

    def __post_init__(self) -> None:
        rows = len(self.time)
        freeze(self, time=(rows,), field=(rows, None, 3), position=(rows, 2), force=(rows, 3))
        if not (np.diff(self.time) > 0).all():
            raise ArgumentError("time must rise from reading to reading")


def examples_of_courses(courses: Sequence[Course]) -> Examples:
    """Every reading with a known force as an example, in parts of its course.

    Learned are x and y if places vary, and each force that does by more than a gauge's noise. It
    raises an `ArgumentError` if courses are of boards with different numbers of chips, nothing
    varies, or fewer readings have a known force than there are parts.
    """
    if len({course.field.shape[1] for course in courses}) != 1:
        raise ArgumentError("courses must be of boards with as many chips each")
    known = np.concatenate(
        [np.concatenate([course.position, course.force], axis=1) for course in courses]
    )
    whole = np.isfinite(known[:, 2:]).all(axis=1)
    if not whole.any():
        raise ArgumentError("courses must hold readings with a known force; got none")
    placed = known[whole & np.isfinite(known[:, :2]).all(axis=1)]
    vary = varying(placed if len(placed) else np.zeros((1, 5)))
    vary[2:] = varying(np.nan_to_num(known[whole]))[2:]
    if not vary.any():
        raise ArgumentError("courses must differ in place or force; got the same every time")
    targets = known[:, vary]
    lengths = [len(course.time) for course in courses]
    group, run = np.empty(len(known), dtype=np.int64), np.repeat(np.arange(len(courses)), lengths)
    labelled = np.isfinite(targets).all(axis=1)
    for k in range(len(courses)):
        mine = run == k
        # As many readings with an answer in each part, wherever in the course they are.
        before = np.cumsum(labelled[mine]) - labelled[mine]
        if (count := int(labelled[mine].sum())) < 2 * _PARTS:
            raise ArgumentError(
                f"course {k + 1} must have {2 * _PARTS} readings of known force; got {count}"
            )
        group[mine] = _PARTS * k + np.minimum(before * _PARTS // count, _PARTS - 1)
    return Examples(
        time=np.concatenate([course.time for course in courses]),
        field=np.concatenate([course.field for course in courses]),
        targets=targets,
        outputs=tuple(output for output, varies in zip(Output, vary, strict=False) if varies),
        group=group,
        run=run,
    )


def memories(chips: Sequence[int]) -> tuple[Encoding, ...]:
    """Encodings to choose from: fields alone, and against their past over seconds to a minute."""
    used = tuple(chips)
    plain = [Encoding(chips=used, time_constants=times) for times in ((), (3.0,))]
    relative = [
        Encoding(
            chips=used,
            form=Form.DIRECTION,
            time_constants=times,
            past=Past.STRENGTH,
            floor=_FAINT,
        )
        for times in ((), (1.0,), (3.0,), (3.0, 10.0), (3.0, 20.0), (3.0, 60.0))
    ]
    return (*plain, *relative)


@typed
def learn_courses(
    courses: Sequence[Course],
    *,
    chips: Sequence[int] | None = None,
    seed: Seed = 0,
    effort: FittingEffort | None = None,
    progress: Progress = unheard,
    on_judged: Callable[[Floats, Floats], object] = lambda true, error: None,
) -> LearnedModel:
    """A model of the force, and place, in courses, by these chips or all, with its error later on.

    The memory is the one that errs least on stretches held out. Each row of early parts of a course
    is then trained on and judged by all later ones: of their errors, what grows with a part's force
    is the gain that is not known, the rest the noise. With several courses each is also foretold by
    the others. `on_judged` gets what was true of later readings and what was missed, (T, O) each.
    Metrics are those of parts between others, of later ones, and the share of the last fifth of
    each course inside the ranges that a model of what was before states. It raises an
    `ArgumentError` as `examples_of_courses`, or if a chip is not there.
    """
    effort = effort or _FULL
    examples = examples_of_courses(courses)
    used = tuple(range(examples.field.shape[1]) if chips is None else chips)
    progress("memory", 0.0)
    encoding = choose_encoding(examples, memories(used), seed=seed, effort=_QUICK)
    inputs = examples.encode(encoding)
    place, faint = _place(courses), _faint(examples, used)

    def trained(rows: Bools, much: FittingEffort) -> LearnedModel:
        return train_model(
            examples.where(rows), encoding, seed=seed, effort=much, place=place, touch_field=faint
        )

    ahead = _AHEAD * float(np.mean([np.ptp(course.time) for course in courses]))
    misses, last = _foretold(examples, inputs, lambda rows: trained(rows, _QUICK), ahead, progress)
    error, answer = (
        np.concatenate([getattr(miss, name) for miss in misses if miss.enough])
        for name in ("error", "answer")
    )
    on_judged(answer - error, error)
    progress("final fit", 0.9)
    model = _stated(trained(examples.known, effort), misses, ahead)
    held = held_share(model.outputs, *map(np.concatenate, zip(*last, strict=True)))
    progress("done", 1.0)
    return replace(model, metrics=(*model.metrics, *map(_later, held)))


def _foretold(
    examples: Examples,
    inputs: Floats,
    trained: Callable[[Bools], LearnedModel],
    ahead: float,
    progress: Progress,
) -> "tuple[list[_Miss], list[tuple[Floats, Floats]]]":
    """What models of early parts, and of other courses, miss of each part.

    Beside it, for the last stretch of each course, errors and the covariances stated of them.
    """
    misses: list[_Miss] = []
    last: list[tuple[Floats, Floats]] = []
    splits = _splits(examples, int(examples.run.max()) + 1)
    for k, (rows, others) in enumerate(splits):
        progress("later parts", 0.3 + 0.6 * k / len(splits))
        early, later = trained(rows), others & examples.known
        age = examples.time - examples.time[rows].mean()
        parts, same = examples.group[rows], examples.run[rows][0] == examples.run[later][0]
        if same and parts.max() % _PARTS == _LAST - 1:
            before = [miss for miss in misses if parts.min() <= miss.part <= parts.max()]
            stated = _stated(early, before, ahead).predict(inputs[later], age[later])
            last.append((stated.values - examples.targets[later], stated.covariance))
        for part in np.unique(examples.group[later]):
            those = later & (examples.group == part)
            misses.append(
                _Miss.of(
                    early,
                    inputs[those],
                    examples.targets[those],
                    part=int(part),
                    later=float(age[those].mean()) if same else ahead,
                    enough=not same or len(np.unique(parts)) >= _HALF,
                )
            )
    return misses, last


def _splits(examples: Examples, courses: int) -> "list[tuple[Bools, Bools]]":
    """Rows to learn from and rows to judge by: early and later parts, and other courses."""
    splits = []
    for course in range(courses):
        mine, part = examples.run == course, examples.group % _PARTS
        splits += [
            (mine & (part < begin), mine & (part >= begin)) for begin in range(_FEWEST, _PARTS)
        ]
        if courses > 1:
            splits.append((~mine, mine))
    return splits


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Miss:
    """What a model misses on one later part of R readings."""

    error: Floats
    """(R, O)."""
    answer: Floats
    """(R, O): what it answers."""
    factor: Floats
    """(R,): factor of its noise."""
    distance: Floats
    """(R,): to the nearest that it remembers."""
    part: int
    """The part's number, over all courses."""
    later: float
    """s between its middle and that of what was learned."""
    enough: bool
    """Whether half of a course was learned, or more."""

    @classmethod
    def of(cls, model: LearnedModel, inputs: Floats, targets: Floats, **when: Any) -> "_Miss":
        """What it misses of these targets."""
        predicted = model.predict(inputs)
        return cls(
            error=predicted.values - targets,
            answer=predicted.values,
            factor=model.noise_factor(inputs),
            distance=model.distances(inputs).min(axis=1),
            **when,
        )

    def gains(self) -> Floats:
        """Share of itself by which each quantity was off, (O,), by weighted least squares."""
        weighed = self.answer / self.factor[:, None]
        return np.asarray((weighed * self.error).sum(axis=0) / (weighed * self.answer).sum(axis=0))


def _stated(model: LearnedModel, misses: Sequence[_Miss], ahead: float) -> LearnedModel:
    """The model with residuals, gain, reach and figures by what others like it missed.

    The gain is what it comes to so many seconds ahead; noise is that of models that learned enough.
    """
    forces = np.array([output in FORCES for output in model.outputs])
    gains = np.where(forces, [miss.gains() for miss in misses], 0.0)
    left = [
        (m.error - g * m.answer) / np.sqrt(m.factor)[:, None]
        for m, g in zip(misses, gains, strict=True)
        if m.enough
    ]
    error, factor, distance = (
        np.concatenate([getattr(miss, name) for miss in misses])
        for name in ("error", "factor", "distance")
    )
    later = np.array([miss.later for miss in misses])
    noise = np.concatenate(left)
    later_on = judged(model, error, factor, distance)
    return replace(
        later_on,
        residual=noise.T @ noise / len(noise),
        gain=np.sqrt((gains**2 * (ahead / later)[:, None]).mean(axis=0)),
        gain_after=ahead,
        split=f"{model.split}; later: {len(misses)} parts by earlier ones or other courses",
        metrics=(*model.metrics, *map(_later, later_on.metrics)),
    )


def _later(metric: Metric) -> Metric:
    """A metric of later parts, by its name."""
    return metric._replace(name=f"later_{metric.name}")


def _place(courses: Sequence[Course]) -> Floats:
    """Mean place of the touches, m; the origin where none is known."""
    position = np.concatenate([course.position for course in courses])
    known = position[np.isfinite(position).all(axis=1)]
    return np.asarray(known.mean(axis=0)) if len(known) else np.zeros(2)


def _faint(examples: Examples, chips: Sequence[int]) -> float:
    """Length of the field below which nothing presses, T."""
    size = np.sqrt((examples.field[:, list(chips)] ** 2).sum(axis=(1, 2)))
    forces = [k for k, output in enumerate(examples.outputs) if output in FORCES]
    force = np.abs(np.nan_to_num(examples.targets[:, forces])).max(axis=1, initial=0.0)
    pressed = size[force > _PRESSED * force.max()] if force.any() else size
    return max(_FAINT, 0.5 * float(np.quantile(pressed, 0.05)))


@typed
def judge_courses(
    model: LearnedModel, courses: Sequence[Course], *, age: float | None = None
) -> tuple[Metric, ...]:
    """What a model misses on courses that it has not learned, as `judge_touches` tells it.

    The age is in s, from the middle of what was learned to the courses' time 0, where that was one
    session; None for others.
    """
    errors, inside, refused = [], [], []
    for course in courses:
        known = np.concatenate([course.position, course.force], axis=1)
        targets = known[:, [output.value for output in model.outputs]]
        rows = np.isfinite(targets).all(axis=1)
        if course.field.shape[1] != model.chips_in_reading or not rows.any():
            raise ArgumentError(
                f"courses must be of a board with {model.chips_in_reading} chips and hold readings "
                f"of known force; got {course.field.shape[1]} chips and {rows.sum()} such readings"
            )
        inputs = model.encoding.encode(course.time, course.field)[rows]
        predicted = model.predict(inputs, None if age is None else age + course.time[rows])
        errors.append(predicted.values - targets[rows])
        inside.append(predicted.covariance)
        refused.append(predicted.novelty > 1.0)
    error, covariance = np.concatenate(errors), np.concatenate(inside)
    figures = judged(model, error, np.ones(len(error)), np.concatenate(refused).astype(float))
    share = Metric("refused", float(np.concatenate(refused).mean()), "")
    return (*figures.metrics, *held_share(model.outputs, error, covariance), share)
