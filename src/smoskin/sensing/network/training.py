"""Trains the networks that `smoskin.sensing.network.model` runs, on touches drawn anew every epoch.

Decides the loss (the likelihood of the truth under what members state), how the rate falls, when
training ends (held-out skins get no better), what a checkpoint holds (a training that was killed
goes on to the same numbers as one that was not), and how weights become a model with its range of
validity. Needs the extra `train`.
"""

import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from scipy.stats import chi2

from smoskin.arrays import Bools, Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import MissingExtraError, ModelError
from smoskin.magnetics.nonlinearity import field_curvature
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.origami.geometry import places_to_the_rim
from smoskin.outputs import write_output
from smoskin.roles import Progress, stopwatch, unheard
from smoskin.sensing.files import TensorFile
from smoskin.sensing.learned.gaussian_process import Metric, Prediction
from smoskin.sensing.network.model import SPREADS, Layer, NetworkModel, Singles
from smoskin.sensing.network.samples import (
    Drawn,
    Lessons,
    TouchSource,
    TouchSpread,
    TrainingEffort,
    Turns,
)
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise
from smoskin.sensing.signals.turning import turning

try:
    import jax
    import jax.numpy as jnp
    import optax
    import optax.contrib
    from jax import Array
except ImportError as error:
    raise MissingExtraError("training networks", "train") from error

State: TypeAlias = Any
"""Weights, their running average and the optimiser's memory: a tree of arrays."""
Examples: TypeAlias = tuple[Singles, Singles]

_CHECKPOINT: Final = TensorFile("a training checkpoint", "smoskin_training", 1)
_CLIP: Final = 5.0  # length of the gradient above which it is shortened
_HOLDS: Final = 0.9  # share of truths that stated regions shall hold
_BEYOND: Final = 1.3  # distance that is believed, over the largest of held-out touches
_FINISHING: Final = 3.0  # time of the end, which draws held-out touches twice, over the beginning's
_FIRM: Final = 0.3  # N; normal force from which touches count for the figures
_MEMORY: Final = 0.99  # share of the running mean of squared gradients that a step keeps
_POOR: Final = 2.0
"""Ratio of errors to what is attainable from which people are warned: trainings of half a minute
come to 0.96 on a design's table and 1.23 on a skin's, one epoch of the latter to 5."""
_STEP: Final = 0.2  # root mean square of a step of Muon's, over the rate; Adam's is about 1
_AVERAGED: Final = 0.98  # share of the running average of weights that a step keeps


class Epoch(NamedTuple):
    """A point of the learning curve."""

    epoch: int
    seconds: float
    """Time spent so far."""
    rate: float
    training: float
    """Loss, mean over the epoch: negative log likelihood, nats a touch."""
    held_out: float
    """Loss of the running average on skins that training never sees."""


class HeldOut(NamedTuple):
    """A network's answers to B touches of 0.3 N and more, on skins that no lesson holds."""

    position: Floats
    """(B, 2), m."""
    errors: Floats
    """(B, 5), m and N: x, y, Fx, Fy and Fz answered, less the true ones."""
    scaled: Floats
    """(B, 5): the same over the deviation that was stated of each; zero where none was."""


class Trained(NamedTuple):
    """A training that has ended."""

    model: NetworkModel
    curve: tuple[Epoch, ...]
    """Learning curve, a point an epoch."""
    ended: str
    """Why it ended, in words."""
    attainable: float
    """Mean distance of the place, m, that noise and the spread of skins leave a touch."""
    held_out: HeldOut
    """What the network misses on skins held out from training."""

    @property
    def warning(self) -> str:
        """What people are warned of: a network far worse than can be; empty where it is not."""
        error = self.model.metrics[0].value if self.model.metrics else 0.0
        if error <= _POOR * self.attainable:
            return ""
        return (
            f"held-out touches are {1e3 * error:.2f} mm off, where noise and the spread of skins "
            f"leave {1e3 * self.attainable:.2f} mm; train longer"
        )

    def save(self, path: Path | str) -> None:
        """Write the network's file, as `NetworkModel.save` does."""
        self.model.save(path)

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        last = self.curve[-1]
        return {
            "design_hash": self.model.design_hash,
            "data_sha256": self.model.data_sha256,
            "chips": list(self.model.chips),
            "drag_N": self.model.drag,
            "epochs": last.epoch,
            "seconds": last.seconds,
            "ended": self.ended,
            "held_out_nats": min(point.held_out for point in self.curve),
            "metrics": [metric._asdict() for metric in self.model.metrics],
            "attainable_place_error_mm": round(1e3 * self.attainable, 4),
            "warning": self.warning or None,
        }


def train_network(
    design: SkinDesign,
    table: ResponseTable,
    *,
    spread: TouchSpread | None = None,
    creep: Prony | None = None,
    effort: TrainingEffort | None = None,
    start: NetworkModel | None = None,
    checkpoint: Path | None = None,
    curve: Path | None = None,
    progress: Progress = unheard,
    clock: Callable[[], float] | None = None,
) -> Trained:
    """A network for skins of a table, which holds the chips that the network shall read.

    `smoskin.commands.train.train` says what most arguments mean. `spread` is that of touches and
    disturbances, `creep` that of the rubber where the estimator undoes it. It raises a `ModelError`
    if the table or the start belong to another design, or the checkpoint to another training.
    """
    clock = clock or stopwatch()
    effort = effort or TrainingEffort()
    design.check_own("table", table.design_hash)
    spread, noise = spread or TouchSpread(), signal_noise(design, table.chips)
    turns = None
    if spread.arm:
        curvature = field_curvature(design)[list(table.chips)]
        turns = Turns(turning(design, table.chips).whole, curvature)
    source = TouchSource(table, noise, spread, creep, turns)
    before = clock()
    lessons = Lessons(design, source, effort, start)
    finishing = _FINISHING * (clock() - before)
    with jax.enable_x64(False), ThreadPoolExecutor(max_workers=1) as ahead:
        course = _Course(lessons, checkpoint, finishing)
        earlier = course.seconds
        course.save(checkpoint, curve)
        coming = ahead.submit(lessons.epoch, len(course.curve))
        while not (ended := course.ended()):
            share = max(len(course.curve) / effort.epochs, course.seconds / course.time)
            progress(course.summary(), share)
            examples = coming.result()
            coming = ahead.submit(lessons.epoch, len(course.curve) + 1)
            course.learn(examples, share, lambda: earlier + clock())
            course.save(checkpoint, curve)
        coming.cancel()
        progress(f"stopped: {ended}", 1.0)
        finished, held_out = _finished(lessons, course.best)
        unknown = noise if turns is None else noise + turns.unfollowed
        attainable = _attainable(table, unknown, finished)
        return Trained(finished, tuple(course.curve), ended, attainable, held_out)


class _Course:
    """How far a training has come: as a checkpoint left it, from the beginning without one."""

    def __init__(self, lessons: Lessons, checkpoint: Path | None, finishing: float) -> None:
        self._lessons = lessons
        self.time = max(lessons.effort.seconds - finishing, finishing)
        """Seconds that epochs may take, so that spread and figures come in time."""
        weights = [(jnp.asarray(w), jnp.asarray(b)) for w, b in lessons.model.layers]
        self._state: State = (weights, weights, _optimiser(weights).init(weights))
        self.best: State = weights
        """Averaged weights of the epoch that did best on held-out skins."""
        self.curve: list[Epoch] = []
        if checkpoint is not None and checkpoint.exists():
            names = [str(k) for k in range(len(jax.tree.leaves((self._state, self.best))))]
            _CHECKPOINT.read(checkpoint, names, self._resume)

    def _resume(self, arrays: dict[str, Any], header: dict[str, Any]) -> None:
        """Go on from what a checkpoint holds."""
        if header["training"] != self._lessons.key:
            raise ModelError(
                "must be of this training, of the same table, touches and effort; remove it to "
                "begin anew"
            )
        leaves, shape = jax.tree.flatten((self._state, self.best))
        # The file knows no arrays without dimensions, such as the optimiser's count.
        loaded = [jnp.asarray(arrays[str(k)]).reshape(leaf.shape) for k, leaf in enumerate(leaves)]
        self._state, self.best = jax.tree.unflatten(shape, loaded)
        self.curve = [Epoch(**point) for point in header["curve"]]

    @property
    def seconds(self) -> float:
        """Time spent so far."""
        return self.curve[-1].seconds if self.curve else 0.0

    @property
    def _pace(self) -> float:
        """Time that the last epoch took, s."""
        return self.seconds - (self.curve[-2].seconds if len(self.curve) > 1 else 0.0)

    def learn(self, examples: Examples, share: float, spent: Callable[[], float]) -> None:
        """Take in an epoch's examples, that share of the training being over."""
        rate = self._lessons.effort.rate * 0.5 * (1 + np.cos(np.pi * min(share, 1.0)))
        self._state, loss = _learn(self._state, examples, np.float32(rate))
        average = self._state[1]
        held_out = float(likelihood_loss(average, *self._lessons.judges))
        if held_out < min((past.held_out for past in self.curve), default=np.inf):
            self.best = average
        number = len(self.curve) + 1
        self.curve.append(Epoch(number, spent(), float(rate), float(loss), held_out))

    def ended(self) -> str:
        """Why training is over; empty while it is not."""
        effort = self._lessons.effort
        losses = [point.held_out for point in self.curve]
        if len(losses) >= effort.epochs:
            return f"all {effort.epochs} epochs are done"
        if self.curve and self.seconds + self._pace > self.time:
            first = ": the first epoch, which compiles, took most of them"
            return f"its {effort.seconds:.0f} s are over{first if len(losses) == 1 else ''}"
        if losses and not np.isfinite(losses[-1]):
            return "the loss is no longer finite"
        if losses and len(losses) - 1 - int(np.argmin(losses)) >= effort.patience:
            return f"{effort.patience} epochs gained nothing on held-out skins"
        return ""

    def summary(self) -> str:
        """State of the training, for people."""
        if not self.curve:
            return "learning"
        last = self.curve[-1]
        return f"epoch {last.epoch}, {last.held_out:.3f} nats on held-out skins"

    def save(self, checkpoint: Path | None, curve: Path | None) -> None:
        """Write the files that are wanted; whoever kills the program leaves the last ones whole."""
        points = [point._asdict() for point in self.curve]
        if checkpoint is not None and points:
            leaves = jax.tree.leaves((self._state, self.best))
            arrays = {str(k): np.asarray(leaf) for k, leaf in enumerate(leaves)}
            _CHECKPOINT.write(checkpoint, arrays, {"training": self._lessons.key, "curve": points})
        if curve is not None:
            lines = [json.dumps(point) + "\n" for point in points]
            write_output(curve, "".join(lines).encode())


def _optimiser(weights: State) -> optax.GradientTransformation:
    """Muon on hidden layers, Adam on the others; the rate is applied by whoever steps.

    Muon makes the steps of a matrix orthogonal, so that directions that gradients hardly show are
    learned as fast as the others: after 1,400 steps on one skin's table a single network is off by
    0.77 mm, where with Adam alone it is by 0.91 mm.
    """
    # Axes of the matrices of hidden layers, (M, inputs, outputs); None for all else.
    matrix = optax.contrib.MuonDimensionNumbers(reduction_axis=1, output_axis=2)
    axes = [(None, None), *[(matrix, None)] * (len(weights) - 2), (None, None)]
    muon = optax.contrib.muon(
        1.0, muon_weight_dimension_numbers=axes, adam_b2=_MEMORY, consistent_rms=_STEP
    )
    return optax.chain(optax.clip_by_global_norm(_CLIP), muon)


@jax.jit
def _learn(state: State, lesson: Examples, rate: Array) -> tuple[State, Array]:
    """An epoch's steps, and their mean loss."""
    optimiser = _optimiser(state[0])

    def step(state: State, examples: Examples) -> tuple[State, Array]:
        weights, average, memory = state
        loss, slope = jax.value_and_grad(likelihood_loss)(weights, *examples)
        move, memory = optimiser.update(slope, memory, weights)
        weights = jax.tree.map(lambda w, m: w + rate * m, weights, move)
        average = jax.tree.map(lambda a, w: _AVERAGED * a + (1 - _AVERAGED) * w, average, weights)
        return (weights, average, memory), loss

    state, losses = jax.lax.scan(step, state, lesson)
    return state, losses.mean()


@jax.jit
def likelihood_loss(weights: State, inputs: Array, targets: Array) -> Array:
    """Negative log likelihood of targets (B, O), nats a touch, mean over members.

    With residuals r = t - m of a normal with factor L of its covariance, whose diagonal holds the
    deviations: sum_i (w_i^2 / 2 + log L_ii + log(2 pi) / 2), where w = L^-1 r, independent
    residuals by forward substitution, as L is lower triangular.
    """
    count = targets.shape[-1]
    hidden = inputs
    for w, b in weights[:-1]:
        hidden = jax.nn.silu(hidden @ w + b)
    numbers = hidden @ weights[-1][0] + weights[-1][1]
    size = jnp.clip(numbers[..., count : 2 * count], *SPREADS)
    shares = numbers[..., 2 * count :]
    residuals = (targets - numbers[..., :count]) * jnp.exp(-size)
    white: list[Array] = []
    for row in range(count):
        first = row * (row - 1) // 2
        shared = sum(shares[..., first + k] * white[k] for k in range(row))
        white.append(residuals[..., row] - shared)
    squared = sum(w * w for w in white)
    loss: Array = (0.5 * squared + size.sum(axis=-1) + 0.5 * count * np.log(2 * np.pi)).mean()
    return loss


def _finished(lessons: Lessons, weights: State) -> tuple[NetworkModel, HeldOut]:
    """The model of these weights, with its spread, reach and figures, and what these are of."""
    inputs = lessons.standard_inputs(lessons.held_out(1))
    # By their covariance: signals that are usual one by one may be unheard of together.
    whitener = np.linalg.inv(np.linalg.cholesky(inputs.T @ inputs / len(inputs))).T
    reach = _BEYOND * float(np.sqrt(((inputs @ whitener) ** 2).sum(axis=1)).max())
    layers = tuple(Layer(np.asarray(w), np.asarray(b)) for w, b in weights)
    model = replace(lessons.model, layers=layers, whitener=whitener, reach=reach)
    model = replace(model, stretch=_stretch(model, lessons.held_out(1)))
    drawn = lessons.held_out(2)
    predicted, residuals = _residuals(model, drawn)
    firm = drawn.values[:, 4] <= -_FIRM
    stated = np.sqrt(np.einsum("bii->bi", predicted.covariance))
    scaled = np.divide(residuals, stated, out=np.zeros_like(residuals), where=stated > 0)
    position = drawn.values[:, :2].astype(np.float64)
    held_out = HeldOut(*(part[firm] for part in (position, residuals, scaled)))
    inside = (_squared(predicted, residuals, slice(0, 2)) <= chi2.ppf(_HOLDS, 2))[firm]
    return replace(
        model, metrics=_metrics(model, held_out, drawn.values[firm, 4], inside)
    ), held_out


def _attainable(table: ResponseTable, noise: Floats, model: NetworkModel) -> float:
    """Mean distance from its place that a touch of 0.5 N leaves at best, m.

    It is sqrt(pi) / 2 of the root mean square, as of normal errors, of the bound with the
    covariance N + E |F|^2 + sum_k m_k m_k^T of the signals, drags being anywhere in the disc of
    training.
    """
    rows = list(model.rows)
    place = places_to_the_rim(table.basis.extent, (7, 9)).reshape(-1, 2)
    force = np.tile([0.0, 0.0, -0.5], (len(place), 1))
    slopes, modes = table.slopes(place, force)[..., rows], table.mode_signals(place, force)
    spread = noise + 0.25 * table.misfit + np.einsum("bkc,bkd->bcd", modes, modes)
    before = np.diag([4 / model.drag**2 if row in (2, 3) else 0.0 for row in rows])
    bound = np.linalg.inv(before + slopes.swapaxes(1, 2) @ np.linalg.solve(spread, slopes))
    return float(np.sqrt(np.pi) / 2 * np.sqrt((bound[:, 0, 0] + bound[:, 1, 1]).mean()))


def _stretch(model: NetworkModel, drawn: Drawn) -> Floats:
    """Factors (O,) on stated deviations with which 90 % regions hold 90 % of these touches."""
    predicted, residuals = _residuals(model, drawn)
    parts = [slice(0, 2), *(slice(row, row + 1) for row in model.rows[2:])]
    wider = [
        np.quantile(_squared(predicted, residuals, part), _HOLDS)
        / chi2.ppf(_HOLDS, part.stop - part.start)
        for part in parts
    ]
    return np.sqrt([wider[0], *wider])


def _metrics(
    model: NetworkModel, held_out: HeldOut, force: Floats, inside: Bools
) -> tuple[Metric, ...]:
    """Figures of touches of these normal forces (B,), N, inside their stated region of place."""
    errors = held_out.errors
    figures = [
        ("mean distance of the place", np.hypot(errors[:, 0], errors[:, 1]), "m"),
        ("mean error of the normal force", np.abs(errors[:, 4] / force.astype(np.float64)), "1"),
        ("truths in their stated 90 % region of place", inside, "1"),
    ]
    if model.drag:
        figures.append(("mean error of the drag", np.hypot(errors[:, 2], errors[:, 3]), "N"))
    return tuple(Metric(name, float(values.mean()), unit) for name, values, unit in figures)


def _residuals(model: NetworkModel, drawn: Drawn) -> tuple[Prediction, Floats]:
    """A model's answers to touches, and what they are off, (B, 5)."""
    predicted = model.predict(drawn.signals.astype(np.float64))
    return predicted, predicted.values - drawn.values.astype(np.float64)


def _squared(predicted: Prediction, residuals: Floats, part: slice) -> Floats:
    """Squared deviations (B,) of residuals of some of the values in what was stated of them."""
    off = residuals[:, part]
    white = np.linalg.solve(predicted.covariance[:, part, part], off[..., None])[..., 0]
    return np.asarray((off * white).sum(axis=1))
