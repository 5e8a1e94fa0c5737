"""Learning from touches of known place and force: sheets to examples, a model and its honest error.

Decides which rest counts for a touch (the last one before it), which quantities there are to
learn, and that figures and stated covariance are those of folds of whole places, since a few
touches held out once tell little, and the reach that of each place beside all others. Touches of
another day or run are judged by themselves.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from smoskin.arguments import Seed, typed
from smoskin.arrays import Bools, Floats, Ints
from smoskin.errors import ArgumentError
from smoskin.measurement import TouchTable
from smoskin.roles import Progress, unheard
from smoskin.sensing.learned.gaussian_process import LearnedModel, Metric, Output
from smoskin.sensing.learned.inputs import Encoding, Form
from smoskin.sensing.learned.training import Examples, FittingEffort, judged, train_model

_FOLDS: Final = 5
_LEAST_PLACES: Final = 5
_ONE_PLACE: Final = 1e-4
"""Distance up to which two touches are at one place, m."""
_SPREAD: Final = 1e-4
"""Range of a coordinate from which it is one to learn, m."""
_VARIED: Final = 0.02
"""Standard deviation of a force over the largest of any, from which it is one to learn: where a
gauge's noise is learned as a force, places are learned as badly."""
_FAINT: Final = 30e-6
"""Field below which there is no touch, T, at least."""
_NINETY: Final = 4.605
"""Square of the deviation that nine of ten draws in the plane stay below, in variances."""
_NINETY_ALONE: Final = 2.706
"""The same of draws on a line."""


def examples_of(tables: Sequence[TouchTable]) -> Examples:
    """The touches of sheets as examples: fields less those of the rest before, by place.

    Each sheet is a run of its own. Learned are x and y if they vary, and each force that does
    by more than a gauge's noise, 2 % of the largest.

    Raises
    ------
    ArgumentError
        If sheets are of boards with different numbers of chips, a touch has no rest before it, or
        nothing varies.
    """
    field, known, run = _made(tables)
    vary = varying(known)
    if not vary.any():
        raise ArgumentError("touches must differ in place or force; got the same every time")
    # Where the place stays, each touch is held out by itself.
    group = places_of(known[:, :2]) if vary[0] else np.arange(len(known))
    return Examples(
        time=np.arange(len(known), dtype=float),
        field=field,
        targets=known[:, vary],
        outputs=tuple(output for output, varies in zip(Output, vary, strict=False) if varies),
        group=group,
        run=run,
    )


def varying(known: Floats) -> Bools:
    """Which of x, y and the forces of touches (T, 5) change enough to be learned, (5,)."""
    forces = known[:, 2:]
    placed = (np.ptp(known[:, :2], axis=0) > _SPREAD).any()
    return np.array([placed, placed, *(forces.std(axis=0) > _VARIED * np.abs(forces).max())])


def places_of(position: Floats) -> Ints:
    """Number of the place of each touch, (T,), at (T, 2), m: one is what stages tell of it."""
    # Here, so that whoever only imports the package does not wait for them.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    first, second = cKDTree(position).query_pairs(_ONE_PLACE, output_type="ndarray").T
    count = len(position)
    near = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(near, directed=False)[1], dtype=np.int64)


def _made(tables: Sequence[TouchTable]) -> tuple[Floats, Floats, Ints]:
    """Fields less the rest before, (T, S, 3), places with forces, (T, 5), and sheets, (T,)."""
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
    return np.array(fields), np.array(targets), np.array(runs)


@typed
def learn_touches(
    tables: Sequence[TouchTable],
    *,
    chips: Sequence[int] | None = None,
    seed: Seed = 0,
    effort: FittingEffort | None = None,
    progress: Progress = unheard,
    on_judged: Callable[[Floats, Floats], object] = lambda true, error: None,
) -> LearnedModel:
    """A model of the touches of sheets, by these chips or all, with its error on places held out.

    Places are held out in five folds, whole; the model is then trained on all touches, and its
    metrics and covariance are those of the folds; it believes what lies no farther from its touches
    than they from each other. `on_judged` gets what was true of the touches and what was missed as
    they were held out, (T, O) each. It raises an `ArgumentError` as `examples_of`, if there are
    fewer than five places, or a chip is not there.
    """
    examples = examples_of(tables)
    every = range(examples.field.shape[1])
    encoding = Encoding(chips=tuple(every if chips is None else chips), form=Form.DIRECTION)
    groups = np.unique(examples.group)
    if len(groups) < _LEAST_PLACES:
        raise ArgumentError(f"touches must be at {_LEAST_PLACES} places or more; got {len(groups)}")
    place = tables[0].position[tables[0].touched][0]
    inputs = examples.encode(encoding)
    size = np.sqrt((examples.field[:, list(encoding.chips)] ** 2).sum(axis=(1, 2)))
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
    error = np.empty_like(examples.targets)
    factor = np.empty(len(error))
    for k in range(_FOLDS):
        held = np.isin(examples.group, groups[fold == k])
        model = trained(examples.where(~held), k / (_FOLDS + 1))
        predicted = model.predict(inputs[held])
        error[held] = predicted.values - examples.targets[held]
        factor[held] = predicted.covariance[:, 0, 0] / model.residual[0, 0]
    on_judged(examples.targets, error)
    model = trained(examples, _FOLDS / (_FOLDS + 1))
    model = judged(model, error, factor, _apart(model, inputs, examples.group))
    what = "places" if Output.X in examples.outputs else "touches at one place"
    return replace(
        model,
        metrics=(*model.metrics, *held_share(model.outputs, error, _stated(model, factor))),
        split=f"{_FOLDS} folds of {len(groups)} {what}, drawn with seed {seed}",
    )


def _apart(model: LearnedModel, inputs: Floats, group: Ints) -> Floats:
    """Distance of each example, (T,), to the nearest that the model remembers of another place."""
    distance = model.distances(inputs)
    # What it remembers are some of these examples.
    own = group[distance.argmin(axis=0)]
    return np.asarray(np.where(group[:, None] == own, np.inf, distance).min(axis=1))


@typed
def judge_touches(model: LearnedModel, tables: Sequence[TouchTable]) -> tuple[Metric, ...]:
    """What a model misses on the touches of sheets that it has not learned.

    Beside the errors stand the share that its 90 % region of the place holds, and that of touches
    so unlike those it has learned that it would refuse them. It raises an `ArgumentError` if a
    touch has no rest before it, none was read, or the sheets are of another number of chips.
    """
    field, known, _ = _made(tables)
    if field.shape[1] != model.chips_in_reading:
        raise ArgumentError(
            f"touches must be of a board with {model.chips_in_reading} chips; got {field.shape[1]}"
        )
    predicted = model.predict(model.encoding.encode(np.arange(float(len(field))), field))
    error = predicted.values - known[:, [output.value for output in model.outputs]]
    factor = predicted.covariance[:, 0, 0] / model.residual[0, 0]
    figures = judged(model, error, factor, predicted.novelty).metrics
    refused = Metric("refused", float((predicted.novelty > 1.0).mean()), "")
    return (*figures, *held_share(model.outputs, error, predicted.covariance), refused)


def _stated(model: LearnedModel, factor: Floats) -> Floats:
    """Covariances (T, O, O) that the model states at these factors of its noise, (T,)."""
    return np.asarray(factor[:, None, None] * model.residual)


def held_share(outputs: Sequence[Output], error: Floats, covariance: Floats) -> tuple[Metric, ...]:
    """Shares of errors, (T, O), inside the stated 90 % region of place and ranges of force."""
    inside = {}
    if Output.X in outputs:
        miss = error[:, :2]
        squares = (miss * np.linalg.solve(covariance[:, :2, :2], miss[..., None])[..., 0]).sum(1)
        inside["region"] = squares <= _NINETY
    for k, output in enumerate(outputs):
        if output in (Output.FX, Output.FY, Output.FZ):
            inside[f"range_{output.name.lower()}"] = error[:, k] ** 2 <= (
                _NINETY_ALONE * covariance[:, k, k]
            )
    return tuple(
        Metric(f"inside_90_percent_{name}", float(held.mean()), "") for name, held in inside.items()
    )
