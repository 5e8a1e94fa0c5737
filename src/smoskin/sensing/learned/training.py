"""Training of the Gaussian processes that `learned.gaussian_process` runs.

Decides how examples are held out (whole groups: a place, a cycle), how lengths, amplitudes and
noise are found (the most probable ones, by SciPy's L-BFGS-B on the marginal likelihood), and how
accuracy is stated (residuals on what was held out). Needs NumPy and SciPy alone.
"""

import hashlib
import itertools
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotri
from scipy.optimize import fmin_l_bfgs_b
from scipy.spatial.distance import cdist

from smoskin.arguments import Seed, typed
from smoskin.arrays import Bools, Floats, Ints, assign, floats, freeze, frozen, wholes
from smoskin.errors import ArgumentError
from smoskin.roles import Progress, unheard
from smoskin.sensing.learned.gaussian_process import LearnedModel, Metric, Output
from smoskin.sensing.learned.inputs import Encoding, Form

_JITTER: Final = 1e-8  # variance added to the noise's, in units of the targets'
_USUAL_NOISE: Final = -3.0  # logarithm of a standard deviation, in units of the targets'
_HELD_OUT: Final = 0.15  # share of the groups that are held out
_BELIEVED_SHARE: Final = 0.99  # of the held-out examples, which decide how far a model is believed
_BEYOND: Final = 1.5  # distance that is believed, over that which holds the believed share


@typed
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Examples:
    """Readings with known answers.

    Raises
    ------
    ArgumentError
        If the shapes disagree or the fields are not finite.
    """

    time: Floats
    """(T,), time, s; increasing within a run."""
    field: Floats
    """(T, S, 3), zeroed fields of all chips, T."""
    targets: Floats
    """(T, O), SI; NaN in a row whose answer is not known (it still counts as history)."""
    outputs: tuple[Output, ...]
    """Quantities of the targets."""
    group: Ints
    """(T,): place or cycle that the row belongs to; held out only as a whole."""
    run: Ints
    """(T,): run that the row belongs to; history starts afresh in each."""

    def __post_init__(self) -> None:
        rows = len(frozen("time", self.time, (None,)))
        targets = (rows, len(self.outputs))
        freeze(self, time=(rows,), field=(rows, None, 3), targets=targets)
        for name in ("group", "run"):
            assign(self, **{name: wholes(name, getattr(self, name), (rows,))})
        if not (np.isfinite(self.field).all() and np.isfinite(self.time).all()):
            raise ArgumentError("field and time must be finite; drop the rows that are not")

    @property
    def known(self) -> Bools:
        """(T,): rows whose answer is known."""
        return np.asarray(np.isfinite(self.targets).all(axis=1))

    def encode(self, encoding: Encoding) -> Floats:
        """Inputs of every row, run by run, shape (T, D)."""
        inputs = np.empty((len(self.time), encoding.columns))
        for run in np.unique(self.run):
            rows = self.run == run
            inputs[rows] = encoding.encode(self.time[rows], self.field[rows])
        return inputs

    def where(self, rows: Bools) -> "Examples":
        """The same with the answers of all other rows unknown, so that histories stay whole."""
        return replace(self, targets=np.where(rows[:, None], self.targets, np.nan))

    def sha256(self) -> str:
        """Hash of everything in it that a model depends on."""
        digest = hashlib.sha256(",".join(output.name for output in self.outputs).encode())
        for array in (self.time, self.field, self.targets, self.group, self.run):
            digest.update(str(array.shape).encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class FittingEffort:
    """How much work training may do; less of it gives a rougher model, sooner.

    Numbers that are not positive raise an `ArgumentError`.
    """

    rows: int = 4000
    """Most examples that a model remembers; the rest are left out at random."""
    evidence_rows: int = 500
    """Examples from which lengths and noise are found."""
    iterations: int = 30
    """Most steps of that search."""

    def __post_init__(self) -> None:
        for name in ("rows", "evidence_rows", "iterations"):
            if getattr(self, name) < 1:
                raise ArgumentError(f"{name} must be at least 1; got {getattr(self, name)}")


@typed
def train_model(
    examples: Examples,
    encoding: Encoding,
    *,
    seed: Seed = 0,
    effort: FittingEffort | None = None,
    place: ArrayLike = (0.0, 0.0),
    touch_field: float = 30e-6,
    progress: Progress = unheard,
) -> LearnedModel:
    """A model of the examples; the same seed and examples give the same model.

    It is fitted on all examples; its metrics, covariance and reach come from a fit that lacked the
    held-out groups.

    Parameters
    ----------
    examples, encoding : Examples, Encoding
        Readings with known answers, and how the model's inputs are laid out.
    seed : int
        Seed of the draw of what is held out and left out.
    effort : FittingEffort, optional
        How much work is done.
    place : array_like, shape (2,)
        Place where the examples were made, m, for outputs without X and Y.
    touch_field : float
        Length of the field below which there is no touch, T.
    progress : Progress
        Listener.

    Raises
    ------
    ArgumentError
        If fewer than two groups have known answers, or an output never changes.
    """
    effort = effort or FittingEffort()
    inputs, targets = examples.encode(encoding)[examples.known], examples.targets[examples.known]
    rng = np.random.default_rng(seed)
    judges, split = _held_out(examples, rng)

    progress("lengths and noise", 0.0)
    fit_inputs, fit_targets = inputs[~judges], targets[~judges]
    standard = _Standard.of(encoding, fit_inputs, fit_targets)
    few = rng.permutation(len(fit_inputs))[: effort.evidence_rows]
    examined = standard.rows(fit_inputs[few], fit_targets[few])
    parameters = _most_probable(*examined, effort.iterations, progress)

    progress("held-out figures", 0.0)
    # Fewer rows suffice to see how residuals scale; the final fit sees them all.
    some = rng.permutation(len(fit_inputs))[: max(effort.rows // 2, 1)]
    blank = LearnedModel(
        encoding=encoding,
        chips_in_reading=examples.field.shape[1],
        outputs=examples.outputs,
        place=floats("place", place, (2,)),
        touch_field=touch_field,
        residual=np.eye(len(examples.outputs)),
        gain=np.zeros(len(examples.outputs)),
        gain_after=1.0,
        reach=1.0,
        data_sha256=examples.sha256(),
        split=f"{split} held out whole, drawn with seed {seed}",
        metrics=(),
        **_solve(standard, parameters, fit_inputs[some], fit_targets[some]),
    )
    judged = _judge(blank, inputs[judges], targets[judges])

    progress("final fit", 0.0)
    rows = np.sort(rng.permutation(len(inputs))[: effort.rows])
    model = replace(judged, **_solve(standard, parameters, inputs[rows], targets[rows]))
    progress("final fit", 1.0)
    return model


def _held_out(examples: Examples, rng: np.random.Generator) -> tuple[Bools, str]:
    """Which rows with a known answer are held out, and how many groups these are, in words."""
    targets, group = examples.targets[examples.known], examples.group[examples.known]
    groups = np.unique(group)
    if len(groups) < 2:
        raise ArgumentError(
            f"examples must hold at least two groups with known answers; got {len(groups)}"
        )
    if not (np.ptp(targets, axis=0) > 0).all():
        raise ArgumentError("examples: every output must take more than one value")
    count = max(1, round(_HELD_OUT * len(groups)))
    rows = np.isin(group, rng.permutation(groups)[:count])
    return rows, f"{count} of {len(groups)} groups"


class _Standard(NamedTuple):
    """Standardisation of inputs and targets, fixed once for all fits of one training."""

    encoding: Encoding
    centre: Floats
    spread: Floats
    mean: Floats
    size: Floats
    faint: float
    """Squared field at which both parts of the noise count as given, T^2."""

    @classmethod
    def of(cls, encoding: Encoding, inputs: Floats, targets: Floats) -> "_Standard":
        """The standardisation of examples that are fitted."""
        spread = inputs.std(axis=0)
        spread = np.where(spread > 0, spread, 1.0)
        faint = 0.0
        if encoding.form is Form.DIRECTION:
            faint = float(np.exp(2.0 * np.median(inputs[:, 3 * len(encoding.chips)])))
        size = targets.std(axis=0)
        return cls(encoding, inputs.mean(axis=0), spread, targets.mean(axis=0), size, faint)

    def rows(self, inputs: Floats, targets: Floats) -> tuple[Floats, Floats, Floats]:
        """Standardised inputs and targets, and the faintness of each row."""
        faintness = self.faint * self.encoding.faintness(inputs)
        return (inputs - self.centre) / self.spread, (targets - self.mean) / self.size, faintness


def _most_probable(
    x: Floats, y: Floats, faintness: Floats, iterations: int, progress: Progress
) -> Floats:
    """Parameters (D + 4,) of the greatest posterior density, from a subset of the examples."""
    columns = x.shape[1]
    usual = np.log(4.0 * np.sqrt(columns))
    # The noise bounds keep the covariance positive definite in float64.
    bounds = [(-2.0, 8.0)] * columns + [(-5.0, 4.0), (-7.0, 3.0), (-7.0, 1.0), (-7.0, 1.0)]
    done = itertools.count(1)
    best, _, _ = fmin_l_bfgs_b(
        negative_log_posterior,
        np.concatenate([np.full(columns, usual), [0.0, 0.0, _USUAL_NOISE, _USUAL_NOISE]]),
        args=(x, y, faintness, usual),
        bounds=bounds,
        maxiter=iterations,
        callback=lambda _: progress("lengths and noise", min(next(done) / iterations, 1.0)),
    )
    return np.exp(best)


def negative_log_posterior(
    vector: Floats, x: Floats, y: Floats, faintness: Floats, usual: float
) -> tuple[float, Floats]:
    """-log p(y), which training minimises, and its gradient (D + 4,); both over the number of rows.

    With K the covariance of the examples and a = K^-1 y, for each output -log p(y) = y' K^-1 y / 2
    + log det K / 2 + const and d(-log p) = tr((K^-1 - a a') dK) / 2. The vector, (D + 4,), holds
    logarithms of the lengths, of the amplitudes of the Matern and the linear part, and of the noise
    at any field and of a faint field; x, (T, D), and y, (T, O), are standardised inputs and
    targets; `faintness`, (T,), is the factor of the faint field's noise variance; `usual` is the
    mean of the prior of the lengths' logarithms. Those of the noise have one too, at 5 % of the
    targets' spread: fewer examples than inputs are met exactly by a plane, and would tell that
    there is no noise. Both priors have a standard deviation of 1.
    """
    parameters = np.exp(vector)
    lengths, (amplitude, strength, floor, faint) = parameters[:-4], parameters[-4:]
    rows, columns = x.shape
    scaled = x / lengths
    distance = cdist(scaled, scaled)
    decay = amplitude**2 * np.exp(-distance)
    matern = (1.0 + distance) * decay
    linear = strength**2 * (x @ x.T + 1.0)
    noise = floor**2 + faint**2 * faintness + _JITTER
    factor, lower = cho_factor(matern + linear + np.diag(noise), lower=True)
    a = cho_solve((factor, lower), y)
    triangle = dpotri(factor, lower=1)[0]
    inverse = np.tril(triangle) + np.tril(triangle, -1).T
    half = 0.5 * (y.shape[1] * inverse - a @ a.T)
    value = 0.5 * float((a * y).sum()) + y.shape[1] * float(np.log(np.diag(factor)).sum())
    off = vector - np.concatenate(
        [np.full(columns, usual), vector[columns:-2], np.full(2, _USUAL_NOISE)]
    )
    gradient = np.empty(columns + 4)
    # dK / d log(length) is the squared scaled difference along it, times the decay.
    pull = half * decay
    gradient[:columns] = 2.0 * (
        (scaled**2 * pull.sum(axis=1)[:, None]).sum(axis=0) - (scaled * (pull @ scaled)).sum(axis=0)
    )
    gradient[columns:] = [
        2.0 * (half * matern).sum(),
        2.0 * (half * linear).sum(),
        2.0 * floor**2 * np.trace(half),
        2.0 * faint**2 * float(np.diag(half) @ faintness),
    ]
    gradient += off
    return (value + 0.5 * float(off @ off)) / rows, gradient / rows


def _solve(
    standard: _Standard, parameters: Floats, inputs: Floats, targets: Floats
) -> dict[str, Any]:
    """Fields of `LearnedModel` that hold the process's mean k(x, X) a + c given these examples.

    a = (K + N)^-1 y; the linear part of the mean is gathered in the slope.
    """
    lengths, (amplitude, linear, floor, faint) = parameters[:-4], parameters[-4:]
    x, y, faintness = standard.rows(inputs, targets)
    support = x / lengths
    kernel = cdist(support, support)
    kernel = amplitude**2 * (1.0 + kernel) * np.exp(-kernel)
    kernel += linear**2 * (x @ x.T + 1.0)
    kernel[np.diag_indices(len(kernel))] += floor**2 + faint**2 * faintness + _JITTER
    a = cho_solve(cho_factor(kernel, lower=True, overwrite_a=True), y) * standard.size
    return {
        "centre": standard.centre,
        "scale": standard.spread * lengths,
        "support": support,
        "weights": amplitude**2 * a,
        "slope": linear**2 * lengths[:, None] * (x.T @ a),
        "intercept": linear**2 * a.sum(axis=0) + standard.mean,
        "noise": np.array([floor**2, faint**2 * standard.faint]),
    }


def _judge(model: LearnedModel, inputs: Floats, targets: Floats) -> LearnedModel:
    """The model with its residuals, reach and figures on held-out examples."""
    predicted = model.predict(inputs)
    factor = predicted.covariance[:, 0, 0] / model.residual[0, 0]
    return judged(model, predicted.values - targets, factor, predicted.novelty)


def judged(model: LearnedModel, error: Floats, factor: Floats, novelty: Floats) -> LearnedModel:
    """The model with its residuals, reach and figures by errors on held-out examples.

    Errors are (T, O), SI; with them go the factors of the stated covariance, (T,), and novelties,
    (T,).
    """
    near = float(np.quantile(novelty, _BELIEVED_SHARE))
    figures = {
        f"rmse_{output.name.lower()}": (float(np.sqrt(np.mean(error[:, k] ** 2))), output.unit)
        for k, output in enumerate(model.outputs)
    }
    if {Output.X, Output.Y} <= set(model.outputs):
        at = [model.outputs.index(output) for output in (Output.X, Output.Y)]
        figures["mean_error"] = (float(np.hypot(*error[:, at].T).mean()), "m")
    return replace(
        model,
        residual=(error / factor[:, None]).T @ error / len(error),
        reach=max(_BEYOND * near, _JITTER),
        metrics=tuple(Metric(name, *figure) for name, figure in figures.items()),
    )
