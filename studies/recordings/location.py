"""Location of a probe: on places never trained on, later than trained on, under three zeros.

Decides how drift is judged. The recording's own zero was taken anew before every press. Beside it
stand the zero of the first moment alone, and the zero that `smoskin.sensing.signals.zero.Zero`
follows through all readings in turn, without being told which of them are idle.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.sensing.learned.gaussian_process import Output
from smoskin.sensing.learned.inputs import Encoding, Form
from smoskin.sensing.learned.training import Examples
from smoskin.sensing.signals.idle import IdleBand
from smoskin.sensing.signals.zero import Zero, ZeroTracking
from studies.recordings.eflesh import ProbeRun
from studies.recordings.scores import Score
from studies.recordings.trial import Trial, joined

_FOLDS: Final = 5
_LEAST_PLACES: Final = 10
_EARLY: Final = 0.6
"""Share of a run that is trained on where later presses are judged."""
_PLACE_GRID: Final = 1e-4
"""m: positions that round to the same point are one place."""
_TRACKING: Final = ZeroTracking(hold=0.0, time_constant=30.0, widening_rate=2e-6)
"""The recording keeps one mean reading of every idle moment, so there is nothing to wait for;
30 s is the best of 10, 30 and 60 s with two passes trained on and the third judged."""
_BAND: Final = 40e-6
"""T: readings that change by less are idle."""
_TARGETS: Final = {5: 0.42, 2: 0.92}
"""mm, by the number of chips."""
_TARGET_RATIO: Final = 1.3


class _Zero(Enum):
    """What is taken off the readings; the value says it in the name of a test."""

    RECORDED = ""
    ONCE = ", raw: zero taken once"
    FOLLOWED = ", raw: zero followed"


def score_location(
    trial: Trial, runs: Sequence[ProbeRun], chips: int | None = None
) -> Iterator[Score]:
    """Error of the place, with places held out in folds, at any time and later than trained on.

    Raises
    ------
    ArgumentError
        If there are not that many chips.
    """
    present = runs[0].field.shape[1]
    if chips is not None and not 1 <= chips <= present:
        raise ArgumentError(f"chips must be 1 to {present}, as recorded; got {chips}")
    fewer = min(2, present) if chips is None else chips
    zeroed = {zero: _examples(trial, runs, zero) for zero in _Zero}
    recorded = zeroed[_Zero.RECORDED]
    places = len(np.unique(recorded.group))
    if places < _LEAST_PLACES:
        trial.notes.append(f"spatial_resolution: {places} places; location needs {_LEAST_PLACES}")
        return
    questions = _Questions(trial, zeroed, runs)
    for count in dict.fromkeys((present, fewer)):
        yield from questions.ask(count, later=False)
    yield from questions.ask(present, later=True)


_TRAININGS: Final = 3 * len(_Zero) * _FOLDS
"""Trainings of all questions: all chips, fewer chips, and later presses with all chips."""


class _Questions:
    """What is asked of the same presses under every zero."""

    def __init__(
        self, trial: Trial, zeroed: dict[_Zero, Examples], runs: Sequence[ProbeRun]
    ) -> None:
        self.trial = trial
        self.zeroed = zeroed
        self.recorded = zeroed[_Zero.RECORDED]
        self.fold = trial.folds(self.recorded.group, _FOLDS)
        self.late = np.concatenate(
            [np.arange(len(run.time)) >= _EARLY * len(run.time) for run in runs]
        )
        self.asked = 0

    def ask(self, count: int, *, later: bool) -> Iterator[Score]:
        """Scores with so many chips, of presses at any time or of later ones than trained on."""
        errors: dict[tuple[_Zero, str], list[Floats]] = {}
        chosen = []
        for k in range(_FOLDS):
            held = self.fold == k
            trained = ~held & ~self.late if later else ~held
            judged = held & self.late if later else held
            used = self.trial.best_chips(
                self.recorded.where(trained), Encoding(chips=(0,), form=Form.DIRECTION), count
            )
            chosen.append(used)
            encoding = Encoding(chips=used, form=Form.DIRECTION)
            for zero, examples in self.zeroed.items():
                self.trial.report(f"location, {count} chips, fold {k + 1}", self.asked / _TRAININGS)
                self.asked += 1
                seen = examples.where(trained | judged)
                for model, answer in self.trial.answers(seen, judged, encoding).items():
                    miss = np.linalg.norm(answer - examples.targets[judged], axis=1)
                    errors.setdefault((zero, model), []).append(miss)
        if count < self.recorded.field.shape[1]:
            listed = ", ".join(str(used) for used in chosen)
            self.trial.notes.append(f"spatial_resolution: best {count} chips by fold: {listed}")
        yield from self._scores(errors, count, later)

    def _scores(
        self, errors: dict[tuple[_Zero, str], list[Floats]], count: int, later: bool
    ) -> Iterator[Score]:
        """Mean errors under each zero, then their ratios to those under the recorded one."""
        places = len(np.unique(self.recorded.group))
        test = "held-out places, later" if later else "held-out places"
        split = f"{_FOLDS} folds of {places} places, all passes of a place together"
        if later:
            split += f"; trained on the first {_EARLY:.0%} of the time, judged on the rest"
        ratios: list[Score] = []
        mean = {key: float(np.concatenate(misses).mean()) for key, misses in errors.items()}
        for (zero, model), value in mean.items():
            recorded = zero is _Zero.RECORDED
            score = Score(
                set="spatial_resolution",
                test=test + zero.value,
                split=split,
                chips=count,
                model=model,
                metric="mean_error",
                value=1e3 * value,
                unit="mm",
                target=_TARGETS.get(count) if recorded and not later else None,
            )
            yield score
            if not recorded:
                ratio = value / mean[_Zero.RECORDED, model]
                target = _TARGET_RATIO if zero is _Zero.FOLLOWED else None
                ratios.append(replace(score, metric="ratio", value=ratio, unit="", target=target))
        yield from ratios


def _examples(trial: Trial, runs: Sequence[ProbeRun], zero: _Zero) -> Examples:
    """Presses and where they were."""
    fields = [_zeroed(trial, run, zero) for run in runs]
    field, run = joined(fields, [each.name for each in runs])
    position = np.concatenate([each.position[:, :2] for each in runs])
    _, place = np.unique(np.round(position / _PLACE_GRID), axis=0, return_inverse=True)
    return Examples(
        time=np.concatenate([each.time for each in runs]),
        field=field,
        targets=position,
        outputs=(Output.X, Output.Y),
        group=place.reshape(-1),
        run=run,
    )


def _zeroed(trial: Trial, run: ProbeRun, zero: _Zero) -> Floats:
    """Fields of the presses less a zero."""
    if zero is _Zero.RECORDED:
        return run.field_rezeroed
    idle = run.field - run.field_rezeroed
    if zero is _Zero.ONCE:
        return np.asarray(run.field - idle[0])
    # The idle moments are at unknown times between presses; halfway is as good as any.
    between = run.time - 0.5 * np.diff(run.time, prepend=2 * run.time[0] - run.time[1])
    follower = Zero(_TRACKING, IdleBand(_BAND), idle[0].ravel(), _BAND**2 * np.eye(idle[0].size))
    fields, missed, lost = [], 0, 0
    for before, now, at_rest, pressed in zip(between, run.time, idle, run.field, strict=True):
        missed += not follower.step(float(before), at_rest.ravel())
        lost += follower.step(float(now), pressed.ravel())
        fields.append(pressed - follower.offset.reshape(pressed.shape))
    trial.notes.append(
        f"spatial_resolution: {run.name}: of {len(idle)} idle readings {missed} were taken for "
        f"touches, of as many presses {lost} for idle"
    )
    return np.stack(fields)
