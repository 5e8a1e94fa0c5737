"""One touch or two on a grid of cells: how many, and where, on pairs of cells never trained on.

Decides what is held out: of pairs the whole pair, of single touches a fifth of each file's time, so
that every cell was felt alone before pairs are judged. Decides how two touches that cannot be told
first from second become what a model can learn: their centre and the mean products of their offsets
from it, which are the same in any order and vanish for one touch; back to places by the principal
axis of those products. Pairs that nobody recorded are made by adding the fields of single touches,
where that helps on pairs held out within the training part. Lengths are in cells.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.errors import RecordingError
from smoskin.sensing.learned.gaussian_process import Output
from smoskin.sensing.learned.inputs import Encoding, Form
from smoskin.sensing.learned.training import Examples, train_model
from studies.recordings.eflesh import TouchRun
from studies.recordings.scores import Score
from studies.recordings.trial import Trial, joined

_FOLDS: Final = 5
_TOUCHED: Final = 1.0
"""N: rows with a smaller load are neither trained on nor judged."""
_APART: Final = 0.5
"""Cells: places that are farther from each other count as two; half of neighbours' distance."""
_SUMS: Final = 1000
"""Pairs that are made of single touches."""
_OUTPUTS: Final = (Output.X, Output.Y, Output.XX, Output.XY, Output.YY)


def score_touches(trial: Trial, runs: Sequence[TouchRun]) -> Iterator[Score]:
    """Share of rows whose touches are counted right, and errors of their places.

    Raises
    ------
    RecordingError
        If a file holds more than two touches, or files were made with different chips.
    """
    rows = _loaded(trial, runs)
    pairs, singles = (len(np.unique(rows.cells[of], axis=0)) for of in (rows.two, ~rows.two))
    if 0 < pairs < _FOLDS or pairs + singles < 2:
        trial.notes.append(
            f"touches: {pairs} pairs of cells and {singles} single cells; a test needs two cells, "
            f"and {_FOLDS} pairs or none"
        )
        return
    split = (
        f"{_FOLDS} folds of {pairs} pairs of cells, all files of a pair together, "
        f"and of fifths in time of files of {singles} single cells"
    )
    for model, answer in _answers(trial, rows).items():
        result = places(answer)
        distance = np.linalg.norm(result[:, 0] - result[:, 1], axis=1)
        centre = np.linalg.norm(result.mean(axis=1) - rows.cells.mean(axis=1), axis=1)
        judged: list[tuple[str, str, Bools, Floats, str]] = [
            ("both places", "mean_error", rows.two, _miss(result, rows.cells), "cells"),
            ("one place", "mean_error", ~rows.two, centre, "cells"),
        ]
        if pairs and singles:
            right = ((distance > _APART) == rows.two).astype(float)
            everywhere = np.ones(len(right), dtype=bool)
            judged.insert(0, ("count of touches, 1 or 2", "right", everywhere, right, ""))
        for test, metric, of, values, unit in judged:
            if of.any():
                yield Score(
                    set="touches",
                    test=test,
                    split=split,
                    chips=rows.field.shape[1],
                    model=model,
                    metric=metric,
                    value=float(values[of].mean()),
                    unit=unit,
                )


def moments(touches: Floats) -> Floats:
    """Centre of two places and the mean products of their offsets from it.

    Parameters
    ----------
    touches : Floats, shape (..., 2, 2)
        Two places; one touch is the same place twice.

    Returns
    -------
    Floats, shape (..., 5)
        x, y of the centre; xx, xy, yy.

    Examples
    --------
    >>> moments(np.array([[1.0, 1.0], [3.0, 2.0]]))
    array([2.  , 1.5 , 1.  , 0.5 , 0.25])
    """
    centre = touches.mean(axis=-2)
    dx, dy = np.moveaxis(touches[..., 1, :] - centre, -1, 0)
    return np.concatenate([centre, np.stack([dx * dx, dx * dy, dy * dy], axis=-1)], axis=-1)


def places(answer: Floats) -> Floats:
    """Two places with such moments, the lower x first; the nearest pair where none has them.

    Parameters
    ----------
    answer : Floats, shape (..., 5)
        As `moments` gives them.

    Returns
    -------
    Floats, shape (..., 2, 2)

    Examples
    --------
    >>> places(np.array([2.0, 1.5, 1.0, 0.5, 0.25])).round(9).tolist()
    [[1.0, 1.0], [3.0, 2.0]]
    """
    xx, xy, yy = np.moveaxis(answer[..., 2:], -1, 0)
    lengths, axes = np.linalg.eigh(np.stack([xx, xy, xy, yy], axis=-1).reshape(*xx.shape, 2, 2))
    offset = axes[..., 1] * np.sqrt(np.maximum(lengths[..., 1], 0.0))[..., None]
    offset = np.where(offset[..., :1] < 0, -offset, offset)
    return np.stack([answer[..., :2] - offset, answer[..., :2] + offset], axis=-2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rows:
    """Readings of touches on known cells, from any number of files."""

    field: Floats
    """(T, S, 3), T."""
    cells: Floats
    """(T, 2, 2): in order; one touch is the same cell twice."""
    part: Ints
    """(T,): file and fifth of its time, for single touches; -1 for pairs, held out as pairs."""

    @property
    def two(self) -> Bools:
        """(T,): rows of two touches."""
        return np.asarray((self.cells[:, 0] != self.cells[:, 1]).any(axis=1))

    @property
    def examples(self) -> Examples:
        """What to learn of them, held out as pairs and parts of files."""
        named = np.column_stack([self.cells.reshape(-1, 4), self.part])
        _, group = np.unique(named, axis=0, return_inverse=True)
        return Examples(
            time=np.arange(len(self.field), dtype=np.float64),
            field=self.field,
            targets=moments(self.cells),
            outputs=_OUTPUTS,
            group=group.reshape(-1),
            run=np.zeros(len(self.field), dtype=np.int64),
        )

    def with_sums(self, single: Bools, rng: np.random.Generator) -> "_Rows":
        """The same, and after them pairs made of these single touches on different cells."""
        item, other = rng.choice(np.flatnonzero(single), (2, _SUMS))
        both = np.stack([self.cells[item, 0], self.cells[other, 0]], axis=1)
        apart = (both[:, 0] != both[:, 1]).any(axis=1)
        return _Rows(
            field=np.concatenate([self.field, (self.field[item] + self.field[other])[apart]]),
            cells=np.concatenate([self.cells, _ordered(both[apart])]),
            part=np.concatenate([self.part, np.full(apart.sum(), -1)]),
        )


def _loaded(trial: Trial, runs: Sequence[TouchRun]) -> _Rows:
    """Rows of all files under load."""
    loaded = [run.load >= _TOUCHED for run in runs]
    cells, part = [], []
    for k, (run, rows) in enumerate(zip(runs, loaded, strict=True)):
        if run.cells.shape[1] > 2:
            raise RecordingError(f"{run.name}: must hold one or two touches; got more")
        held = _ordered(run.cells[rows][:, [0, -1]])
        alone = (held[:, 0] == held[:, 1]).all(axis=1)
        fifth = np.arange(len(held)) * _FOLDS // max(len(held), 1)
        cells.append(held)
        part.append(np.where(alone, _FOLDS * k + fifth, -1))
    read, dropouts = sum(len(run.time) for run in runs), sum(run.dropouts for run in runs)
    field, _ = joined(
        [run.field[rows] for run, rows in zip(runs, loaded, strict=True)],
        [run.name for run in runs],
    )
    trial.notes.append(
        f"touches: {len(runs)} files; {dropouts} of {read + dropouts} rows were dropouts; of the "
        f"rest {len(field)} bore {_TOUCHED:g} N or more and were used"
    )
    return _Rows(field=field, cells=np.concatenate(cells), part=np.concatenate(part))


def _ordered(cells: Floats) -> Floats:
    """Pairs of cells (T, 2, 2) with the lower x, then the lower y, first."""
    order = np.lexsort((cells[..., 1], cells[..., 0]))
    return np.take_along_axis(cells, order[..., None], axis=1)


def _answers(trial: Trial, rows: _Rows) -> dict[str, Floats]:
    """Moments that each model predicts for every row, trained on other pairs and times."""
    fold = trial.folds(rows.examples.group, _FOLDS)
    answers: dict[str, Floats] = {}
    for k in range(_FOLDS):
        trial.report(f"touches, fold {k + 1}", k / _FOLDS)
        judged = fold == k
        rng = np.random.default_rng((trial.seed, k))
        given = rows
        if _sums_help(trial, rows, ~judged, rng):
            given = rows.with_sums(~judged & ~rows.two, rng)
            trial.notes.append(f"touches, fold {k + 1}: trained on sums of single touches too")
        asked = np.zeros(len(given.field), dtype=bool)
        asked[: len(judged)] = judged
        examples, usual, varies = _varying(given.examples, ~asked)
        for model, answer in trial.answers(examples, asked, _encoding(rows)).items():
            result = answers.setdefault(model, np.empty((len(judged), len(_OUTPUTS))))
            result[judged] = usual
            result[np.ix_(judged, varies)] = answer
    return answers


def _sums_help(trial: Trial, rows: _Rows, trained: Bools, rng: np.random.Generator) -> bool:
    """Whether sums of single touches help on pairs held out within the training part."""
    single = trained & ~rows.two
    if not single.any() or not (trained & rows.two).any():
        return False
    group = rows.examples.group
    drawn = rng.permutation(np.unique(group[trained & rows.two]))
    held = np.isin(group, drawn[: max(1, len(drawn) // _FOLDS)])

    def miss(given: _Rows) -> float:
        seen = np.ones(len(given.field), dtype=bool)
        seen[: len(trained)] = trained & ~held
        examples, usual, varies = _varying(given.examples, seen)
        model = train_model(
            examples.where(seen), _encoding(rows), seed=trial.seed, effort=trial.quick
        )
        predicted = np.tile(usual, (int(held.sum()), 1))
        predicted[:, varies] = model.predict(rows.examples.encode(_encoding(rows))[held]).values
        return float(_miss(places(predicted), rows.cells[held]).mean())

    return miss(rows.with_sums(single, rng)) < miss(rows)


def _varying(examples: Examples, trained: Bools) -> tuple[Examples, Floats, Bools]:
    """The targets that change while trained, the first of all of them, and which those are.

    Without pairs nothing is spread, and what never changes cannot be trained on.
    """
    targets = examples.targets[trained]
    varies = np.ptp(targets, axis=0) > 0
    outputs = tuple(name for name, kept in zip(_OUTPUTS, varies, strict=True) if kept)
    return (
        replace(examples, targets=examples.targets[:, varies], outputs=outputs),
        targets[0],
        varies,
    )


def _encoding(rows: _Rows) -> Encoding:
    """What models are fed."""
    return Encoding(chips=tuple(range(rows.field.shape[1])), form=Form.DIRECTION)


def _miss(result: Floats, true: Floats) -> Floats:
    """Mean distance of two found places from the two true ones, paired as they lie nearest."""
    orders = [
        np.linalg.norm(result - pair, axis=-1).mean(axis=-1) for pair in (true, true[:, ::-1])
    ]
    return np.asarray(np.minimum(*orders))
