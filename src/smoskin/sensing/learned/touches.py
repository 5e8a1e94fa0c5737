"""Learning from touches of known place and force: sheets to examples, a model and its honest error.

Decides which rest counts for a touch (the last one before it), which quantities there are to learn,
and that a sheet's error is told by folds of whole places, since a few touches held out once tell
little.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from smoskin.arguments import Seed, typed
from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.measurement import TouchTable
from smoskin.roles import Progress, unheard
from smoskin.sensing.learned.gaussian_process import LearnedModel, Metric, Output
from smoskin.sensing.learned.inputs import Encoding, Form
from smoskin.sensing.learned.training import Examples, FittingEffort, train_model

_FOLDS: Final = 5
_LEAST_PLACES: Final = 5
_PLACE_GRID: Final = 1e-4
"""Places that round to the same multiple are one, m."""
_SPREAD: Final = 1e-4
"""Range of a coordinate, m, or force, N, from which it is one to learn."""
_FAINT: Final = 30e-6
"""Field below which there is no touch, T, at least."""
_NINETY: Final = 4.605
"""Square of the deviation that nine of ten draws in the plane stay below, in variances."""


class Learned(NamedTuple):
    """A model of touches and what it reached on touches of places held out."""

    model: LearnedModel
    metrics: tuple[Metric, ...]
    """Figures over all folds; `model.metrics` are those of its own held-out places."""
    split: str
    """How places were held out, in words."""


def examples_of(tables: Sequence[TouchTable]) -> Examples:
    """The touches of sheets as examples: fields less those of the rest before, by place.

    Each sheet is a run of its own. Learned are x and y if they vary, and each force that does.

    Raises
    ------
    ArgumentError
        If sheets are of boards with different numbers of chips, a touch has no rest before it, or
        nothing varies.
    """
    fields: list[Floats] = []
    targets: list[Floats] = []
    runs: list[int] = []
    for number, table in enumerate(tables):
        rest: Floats | None = None
        for row in np.flatnonzero(np.isfinite(table.field).all(axis=(1, 2))):
            if not table.touched[row]:
                rest = table.field[row]
                continue
            if rest is None:
                raise ArgumentError(
                    f"touches: row {row + 1} must come after a row of the untouched skin, without "
                    "a place"
                )
            if fields and table.field[row].shape != fields[0].shape:
                raise ArgumentError("touches must be of boards with as many chips each")
            fields.append(table.field[row] - rest)
            targets.append(np.concatenate([table.position[row], table.force[row]]))
            runs.append(number)
    if not fields:
        raise ArgumentError("touches must hold some that were read; got none")
    known = np.array(targets)
    vary = np.ptp(known, axis=0) > _SPREAD
    vary[:2] = vary[:2].any()
    if not vary.any():
        raise ArgumentError("touches must differ in place or force; got the same every time")
    _, place = np.unique(np.round(known[:, :2] / _PLACE_GRID), axis=0, return_inverse=True)
    # Where the place stays, each touch is held out by itself.
    group = place.reshape(-1) if vary[0] else np.arange(len(known))
    return Examples(
        time=np.arange(len(known), dtype=float),
        field=np.array(fields),
        targets=known[:, vary],
        outputs=tuple(output for output, varies in zip(Output, vary, strict=False) if varies),
        group=group,
        run=np.array(runs),
    )


@typed
def learn_touches(
    tables: Sequence[TouchTable],
    *,
    seed: Seed = 0,
    effort: FittingEffort | None = None,
    progress: Progress = unheard,
) -> Learned:
    """A model of the touches of sheets, by all chips, with its error on places held out.

    Places are held out in five folds, whole; the model is then trained on all touches. It raises
    an `ArgumentError` as `examples_of`, or if there are fewer than five places.
    """
    examples = examples_of(tables)
    encoding = Encoding(chips=tuple(range(examples.field.shape[1])), form=Form.DIRECTION)
    groups = np.unique(examples.group)
    if len(groups) < _LEAST_PLACES:
        raise ArgumentError(f"touches must be at {_LEAST_PLACES} places or more; got {len(groups)}")
    place = tables[0].position[tables[0].touched][0]
    size = np.sqrt((examples.field**2).sum(axis=(1, 2)))
    faint = max(_FAINT, 0.5 * float(np.quantile(size, 0.05)))

    def trained(part: Examples, share: float) -> LearnedModel:
        return train_model(
            part,
            encoding,
            seed=seed,
            effort=effort,
            place=place if Output.X not in examples.outputs else (0.0, 0.0),
            touch_field=faint,
            progress=lambda what, done: progress(what, (share + done / (_FOLDS + 1))),
        )

    fold = np.random.default_rng(seed).permutation(len(groups)) % _FOLDS
    values = np.empty_like(examples.targets)
    covariance = np.empty((len(values), values.shape[1], values.shape[1]))
    inputs = examples.encode(encoding)
    for k in range(_FOLDS):
        held = np.isin(examples.group, groups[fold == k])
        model = trained(examples.where(~held), k / (_FOLDS + 1))
        values[held], covariance[held], _ = model.predict(inputs[held])
    split = f"{_FOLDS} folds of {len(groups)} places, drawn with seed {seed}"
    if Output.X not in examples.outputs:
        split = f"{_FOLDS} folds of {len(groups)} touches at one place, drawn with seed {seed}"
    metrics = _metrics(examples, values - examples.targets, covariance)
    return Learned(trained(examples, _FOLDS / (_FOLDS + 1)), metrics, split)


def _metrics(examples: Examples, error: Floats, covariance: Floats) -> tuple[Metric, ...]:
    """Figures of errors (T, O), SI, whose covariances are stated."""
    found = [
        Metric(
            f"rmse_{output.name.lower()}", float(np.sqrt(np.mean(error[:, k] ** 2))), output.unit
        )
        for k, output in enumerate(examples.outputs)
    ]
    if examples.outputs[:2] == (Output.X, Output.Y):
        miss = error[:, :2]
        found.append(Metric("mean_error", float(np.hypot(*miss.T).mean()), "m"))
        inside = np.linalg.solve(covariance[:, :2, :2], miss[..., None])[..., 0]
        share = float(((miss * inside).sum(axis=1) <= _NINETY).mean())
        found.append(Metric("inside_90_percent_region", share, ""))
    return tuple(found)
