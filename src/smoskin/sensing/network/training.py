"""Trains the networks that `smoskin.sensing.network.model` runs, on touches drawn anew every epoch.

Held-out touches come from skins of their own, whose draws training never sees; when they stop
getting better, training ends, and on others of them the stated spread is set. Decides the loss
(the likelihood of the truth under what members state), how the rate falls, what a checkpoint
holds (a training that was killed goes on to the same numbers as one that was not), and how weights
become a model with its range of validity. Needs the extra `train`.
"""

import json
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import MissingExtraError, ModelError
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.roles import Progress, unheard
from smoskin.sensing.files import TensorFile
from smoskin.sensing.learned.gaussian_process import Metric
from smoskin.sensing.network.model import SPREADS, Layer, NetworkModel, Prediction
from smoskin.sensing.network.samples import (
    FLOOR,
    SKINS,
    TOUCHES,
    Drawn,
    Lesson,
    Lessons,
    TouchSource,
    TouchSpread,
    TrainingEffort,
)
from smoskin.sensing.response.table import ResponseTable
from smoskin.sensing.signals.signals import signal_noise

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

_CHECKPOINT: Final = TensorFile("a training checkpoint", "smoskin_training", 1)
_CLIP: Final = 5.0
"""Length of the gradient above which it is shortened."""
_HOLDS: Final = 0.9
"""Share of truths that stated regions of so much shall hold."""
_NORMAL: Final = {2: 4.605170185988092, 1: 2.705543454095404}
"""Squared deviations that hold 90 % of a normal of so many dimensions."""
_BEYOND: Final = 1.3
"""A model is believed to this multiple of the distance at which held-out touches lie at most."""
_FIRM: Final = 0.3
"""Normal force from which touches count for the figures, N."""
_MEMORY: Final = 0.99
"""Share of the running mean of squared gradients that a step keeps."""
_STEP: Final = 0.2
"""Root mean square of a step of Muon's, over the rate; one of Adam's is about 1."""
_AVERAGED: Final = 0.98
"""Share of the running average of weights that a step keeps."""


class Epoch(NamedTuple):
    """A point of the learning curve."""

    epoch: int
    """Number of epochs that were done."""
    seconds: float
    """Time spent so far."""
    rate: float
    """Rate of learning."""
    training: float
    """Loss, mean over the epoch: negative log likelihood, nats a touch."""
    held_out: float
    """Loss of the running average on skins that training never sees."""


class Trained(NamedTuple):
    """What a training has come to."""

    model: NetworkModel
    curve: tuple[Epoch, ...]
    ended: str
    """Why it ended, in words."""


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
    clock: Callable[[], float] = time.monotonic,
) -> Trained:
    """A network for skins of a table.

    Parameters
    ----------
    design : SkinDesign
        Design of the table.
    table : ResponseTable
        Table of the design, for any skin made of it; or one calibrated to a skin. Of the chips that
        the network shall read.
    spread : TouchSpread, optional
        How touches and disturbances are spread.
    creep : Prony, optional
        Creep of the rubber, where the estimator shall undo it.
    effort : TrainingEffort, optional
        Sizes and lengths.
    start : NetworkModel, optional
        A network to go on from, such as the design's for one skin of it; its sizes are kept.
    checkpoint : Path, optional
        File that is written after every epoch; where it exists, training goes on from there.
    curve : Path, optional
        File of the learning curve, a line of JSON for each epoch.
    progress : Progress, optional
        Listener.
    clock : callable
        Seconds that pass.

    Raises
    ------
    ModelError
        If the table or the start belong to another design, or the checkpoint to another
        training.
    """
    effort = effort or TrainingEffort()
    design.check_own("table", table.design_hash)
    source = TouchSource(table, signal_noise(design, table.chips), spread, creep)
    lessons = Lessons(design, source, effort, start)

    def keep(course: _Course) -> None:
        if checkpoint is not None and course.curve:
            course.save(checkpoint)
        if curve is not None:
            _write_curve(curve, course.curve)

    with jax.enable_x64(False), ThreadPoolExecutor(max_workers=1) as ahead:
        course = _Course.resume(lessons, checkpoint)
        began = clock() - course.seconds
        keep(course)
        coming = ahead.submit(lessons.epoch, course.epochs)
        while not (ended := course.ended()):
            share = max(course.epochs / effort.epochs, course.seconds / effort.seconds)
            progress(course.told(), share)
            lesson = coming.result()
            coming = ahead.submit(lessons.epoch, course.epochs + 1)
            course = course.after(lesson, share, lambda: clock() - began)
            keep(course)
        coming.cancel()
        progress(f"stopped: {ended}", 1.0)
        return Trained(_finished(lessons, course.best), course.curve, ended)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Course:
    """How far a training has come."""

    lessons: Lessons
    state: State
    best: State
    """Averaged weights of the epoch that did best on held-out skins."""
    curve: tuple[Epoch, ...]

    @classmethod
    def begin(cls, lessons: Lessons) -> "_Course":
        """Nothing learned yet."""
        weights = [(jnp.asarray(w), jnp.asarray(b)) for w, b in lessons.layers]
        state = weights, weights, _optimiser().init(weights)
        return cls(lessons=lessons, state=state, best=weights, curve=())

    @classmethod
    def resume(cls, lessons: Lessons, file: Path | None) -> "_Course":
        """The course as a checkpoint left it; from the beginning where there is none."""
        fresh = cls.begin(lessons)
        if file is None or not file.exists():
            return fresh
        leaves, shape = jax.tree.flatten((fresh.state, fresh.best))

        def build(arrays: dict[str, Any], header: dict[str, Any]) -> "_Course":
            if header["training"] != lessons.key:
                raise ModelError(
                    f"{file}: must be of this training, of the same table, touches and effort; "
                    f"remove it to begin anew"
                )
            # The file knows no arrays without dimensions, such as the optimiser's count.
            loaded = [
                jnp.asarray(arrays[str(k)]).reshape(leaf.shape) for k, leaf in enumerate(leaves)
            ]
            state, best = jax.tree.unflatten(shape, loaded)
            points = tuple(Epoch(**point) for point in header["curve"])
            return cls(lessons=lessons, state=state, best=best, curve=points)

        return _CHECKPOINT.read(file, [str(k) for k in range(len(leaves))], build)

    @property
    def epochs(self) -> int:
        """Number of epochs that are done."""
        return len(self.curve)

    @property
    def seconds(self) -> float:
        """Time spent so far."""
        return self.curve[-1].seconds if self.curve else 0.0

    def after(self, lesson: Lesson, share: float, spent: Callable[[], float]) -> "_Course":
        """One epoch on."""
        rate = self.lessons.effort.rate * 0.5 * (1 + np.cos(np.pi * min(share, 1.0)))
        state, loss = _learn(self.state, lesson, np.float32(rate))
        inputs, targets = self.lessons.judges
        point = Epoch(
            epoch=self.epochs + 1,
            training=float(loss),
            held_out=float(likelihood_loss(state[1], inputs, targets)),
            rate=float(rate),
            seconds=spent(),
        )
        better = point.held_out < min((past.held_out for past in self.curve), default=np.inf)
        return _Course(
            lessons=self.lessons,
            state=state,
            best=state[1] if better else self.best,
            curve=(*self.curve, point),
        )

    def ended(self) -> str:
        """Why training is over; empty while it is not."""
        effort = self.lessons.effort
        losses = [point.held_out for point in self.curve]
        if self.epochs >= effort.epochs:
            return f"all {effort.epochs} epochs are done"
        if self.seconds >= effort.seconds:
            return f"its {effort.seconds:.0f} s are over"
        if losses and not np.isfinite(losses[-1]):
            return "the loss is no longer finite"
        if losses and len(losses) - 1 - int(np.argmin(losses)) >= effort.patience:
            return f"{effort.patience} epochs gained nothing on held-out skins"
        return ""

    def told(self) -> str:
        """State of the training, for people."""
        if not self.curve:
            return "learning"
        last = self.curve[-1]
        return f"epoch {last.epoch}, {last.held_out:.3f} nats on held-out skins"

    def save(self, file: Path) -> None:
        """Write the checkpoint; whoever kills the program meanwhile leaves the last one whole."""
        leaves = jax.tree.leaves((self.state, self.best))
        arrays = {str(k): np.asarray(leaf) for k, leaf in enumerate(leaves)}
        header = {
            "training": self.lessons.key,
            "curve": [point._asdict() for point in self.curve],
        }
        fresh = file.with_name(file.name + ".new")
        _CHECKPOINT.write(fresh, arrays, header)
        os.replace(fresh, file)


def _optimiser() -> optax.GradientTransformation:
    """Muon on hidden layers, Adam on the others; the rate is applied by whoever steps.

    Muon makes the steps of a matrix orthogonal, so that directions that gradients hardly show are
    learned as fast as the others: after 1,400 steps on one skin's table a single network is off by
    0.77 mm, where with Adam alone it is by 0.91 mm.
    """

    def dimensions(weights: State) -> State:
        """Axes of the matrices of hidden layers, (M, inputs, outputs); None for all else."""
        matrix = optax.contrib.MuonDimensionNumbers(reduction_axis=1, output_axis=2)
        inner = [(matrix, None) for _ in weights[1:-1]]
        return [(None, None), *inner, (None, None)]

    muon = optax.contrib.muon(
        1.0, muon_weight_dimension_numbers=dimensions, adam_b2=_MEMORY, consistent_rms=_STEP
    )
    return optax.chain(optax.clip_by_global_norm(_CLIP), muon)


@jax.jit
def _learn(state: State, lesson: Lesson, rate: Array) -> tuple[State, Array]:
    """An epoch's steps, and their mean loss."""
    optimiser = _optimiser()

    def step(state: State, examples: Lesson) -> tuple[State, Array]:
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
        shared = sum((shares[..., first + k] * white[k] for k in range(row)), jnp.zeros(()))
        white.append(residuals[..., row] - shared)
    squared = sum((w * w for w in white), jnp.zeros(()))
    loss: Array = (0.5 * squared + size.sum(axis=-1) + 0.5 * count * np.log(2 * np.pi)).mean()
    return loss


def _finished(lessons: Lessons, weights: State) -> NetworkModel:
    """The model of these weights, with its spread, reach and figures."""
    inputs = lessons.standard_inputs(lessons.held_out(1))
    # By their covariance: signals that are usual one by one may be unheard of together.
    whitener = np.linalg.inv(np.linalg.cholesky(inputs.T @ inputs / len(inputs))).T
    reach = _BEYOND * float(np.sqrt(((inputs @ whitener) ** 2).sum(axis=1)).max())
    source = lessons.source
    blank = NetworkModel(
        design_hash=lessons.design_hash,
        chips=source.table.chips,
        layers=tuple(Layer(np.asarray(w), np.asarray(b)) for w, b in weights),
        centre=lessons.centre,
        scale=lessons.scale,
        middle=lessons.middle,
        size=lessons.size,
        stretch=np.ones(lessons.outputs),
        whitener=whitener,
        reach=reach,
        forces=source.table.forces,
        drag=source.spread.drag,
        floor=FLOOR,
        softening=source.table.softening,
        data_sha256=source.sha256(),
        split=f"skins of their own: {SKINS} to end training, {SKINS} for the spread, "
        f"{SKINS} for the figures, of {TOUCHES} touches each",
        metrics=(),
    )
    stretched = replace(blank, stretch=_stretch(blank, lessons.held_out(1)))
    return replace(stretched, metrics=_metrics(stretched, lessons.held_out(2)))


def _stretch(model: NetworkModel, drawn: Drawn) -> Floats:
    """Factors (O,) on stated deviations with which 90 % regions hold 90 % of these touches."""
    predicted, residuals = _residuals(model, drawn)
    factors: list[float] = []
    for part in (slice(0, 2), *(slice(row, row + 1) for row in model.rows[2:])):
        width = part.stop - part.start
        squared = _squared(predicted, residuals, part)
        factors += [float(np.sqrt(np.quantile(squared, _HOLDS) / _NORMAL[width]))] * width
    return np.array(factors)


def _metrics(model: NetworkModel, drawn: Drawn) -> tuple[Metric, ...]:
    """Figures of touches from 0.3 N on."""
    predicted, residuals = _residuals(model, drawn)
    firm = drawn.values[:, 4] <= -_FIRM
    place = np.hypot(residuals[:, 0], residuals[:, 1])
    force = np.abs(residuals[:, 4] / drawn.values[:, 4].astype(np.float64))
    inside = _squared(predicted, residuals, slice(0, 2)) <= _NORMAL[2]
    figures = [
        ("mean distance of the place", place, "m"),
        ("mean error of the normal force", force, "1"),
        ("truths in their stated 90 % region of place", inside, "1"),
    ]
    if model.drag:
        drag = np.hypot(residuals[:, 2], residuals[:, 3])
        figures.append(("mean error of the drag", drag, "N"))
    return tuple(Metric(name, float(values[firm].mean()), unit) for name, values, unit in figures)


def _residuals(model: NetworkModel, drawn: Drawn) -> tuple[Prediction, Floats]:
    """A model's answers to touches, and what they are off, (B, 5)."""
    predicted = model.predict(drawn.signals.astype(np.float64))
    return predicted, predicted.values - drawn.values.astype(np.float64)


def _squared(predicted: Prediction, residuals: Floats, part: slice) -> Floats:
    """Squared deviations (B,) of residuals of some of the values in what was stated of them."""
    off = residuals[:, part]
    white = np.linalg.solve(predicted.covariance[:, part, part], off[..., None])[..., 0]
    return np.asarray((off * white).sum(axis=1))


def _write_curve(file: Path, curve: tuple[Epoch, ...]) -> None:
    """All of the curve, a line of JSON for each epoch."""
    lines = [json.dumps(point._asdict()) + "\n" for point in curve]
    file.write_text("".join(lines), encoding="utf-8")
