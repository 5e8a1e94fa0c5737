"""What a network is taught and examined with: lessons of drawn touches, and held-out ones.

Decides how touches become centred and scaled examples, which touches end a training, set the
stated spread and give the figures (skins of their own for each), and how weights become a model
with its range of validity. Needs NumPy alone.
"""

import hashlib
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ModelError
from smoskin.sensing.learned.gaussian_process import Metric
from smoskin.sensing.network.model import Layer, NetworkModel, Prediction, Singles, encode
from smoskin.sensing.network.samples import Drawn, TouchSource

_FLOOR: Final = 1e-6
"""T, in the length of signals: a fraction of the chips' noise."""
_SKINS: Final = 128
"""Skins of each held-out set."""
_TOUCHES: Final = 96
"""Touches of each of them."""
_HOLDS: Final = 0.9
"""Share of truths that stated regions of so much shall hold."""
_NORMAL: Final = {2: 4.605170185988092, 1: 2.705543454095404}
"""Squared deviations that hold 90 % of a normal of so many dimensions."""
_BEYOND: Final = 1.3
"""A model is believed to this multiple of the distance at which held-out touches lie at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingEffort:
    """How large an ensemble is, and how long it learns.

    Raises
    ------
    ArgumentError
        If a number is not positive.
    """

    members: int = 4
    """Networks, each from weights of its own."""
    width: int = 64
    """Of every hidden layer."""
    depth: int = 3
    """Hidden layers, at least two."""
    epochs: int = 60
    """At most."""
    steps: int = 200
    """In an epoch."""
    batch: int = 1024
    """Touches in a step."""
    touches: int = 64
    """Of each skin that is drawn."""
    rate: float = 1e-2
    """Of learning at the start; it falls to nothing along half a cosine."""
    patience: int = 12
    """Epochs without anything gained after which training ends."""
    seconds: float = np.inf
    """s that training may take, over all its resumptions."""
    seed: int = 0

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            least = {"seed": 0, "depth": 2}.get(one.name, 1 if one.type is int else 0)
            if not value >= least or (one.type is float and not value > 0):
                raise ArgumentError(f"{one.name} must be at least {least}; got {value}")
        if (self.steps * self.batch) % self.touches:
            raise ArgumentError(
                f"an epoch of {self.steps} x {self.batch} touches must be whole skins of "
                f"{self.touches}"
            )


class Lesson(NamedTuple):
    """Examples of an epoch."""

    inputs: Singles
    """(steps, batch, D)."""
    targets: Singles
    """(steps, batch, O)."""


class Lessons:
    """All that stays the same during a training."""

    def __init__(
        self, design: SkinDesign, source: TouchSource, work: TrainingEffort,
        start: NetworkModel | None,
    ) -> None:  # fmt: skip
        table = source.table
        self.source, self.work = source, work
        self.design_hash = design.content_hash
        self.outputs = 5 if source.spread.drag else 3
        self.extremes = table.forces
        first = self.held_out(0)
        if start is None:
            inputs, targets = self._natural(first)
            self.centre, self.scale = inputs.mean(axis=0), inputs.std(axis=0)
            self.middle, self.size = targets.mean(axis=0), targets.std(axis=0)
            self.layers = self._random_layers(inputs.shape[1])
        else:
            if start.design_hash != design.content_hash or start.chips != table.chips:
                raise ModelError(
                    f"start must be of the same design and chips {table.chips}; got one of "
                    f"{start.design_hash[:12]} and {start.chips}"
                )
            if bool(start.drag) is not bool(source.spread.drag):
                raise ModelError(f"start must know drags as the touches do; got {start.drag} N")
            self.centre, self.scale = start.centre, start.scale
            self.middle, self.size = start.middle, start.size
            self.layers = start.layers
        self.judges = self._standard(first)
        # A training may be given more time, or more patience, when it goes on.
        same = replace(work, seconds=np.inf, patience=1)
        digest = hashlib.sha256(repr((source.sha256(), same)).encode())
        for layer in self.layers:
            digest.update(layer.weights.tobytes() + layer.bias.tobytes())
        self.key = digest.hexdigest()

    def epoch(self, number: int) -> Lesson:
        """Examples of one epoch, the same whenever they are drawn."""
        work = self.work
        rng = np.random.default_rng([work.seed, 1, number])
        total = work.steps * work.batch
        inputs, targets = self._standard(self.source.draw(rng, total // work.touches, work.touches))
        order = rng.permutation(total).reshape(work.steps, work.batch)
        return Lesson(inputs[order], targets[order])

    def held_out(self, which: int) -> Drawn:
        """Touches of skins that no lesson holds: for stopping, for the spread, for figures."""
        rng = np.random.default_rng([self.work.seed, 2, which])
        return self.source.draw(rng, _SKINS, _TOUCHES)

    def model(self, weights: Any) -> NetworkModel:
        """The model of these weights, with its spread, reach and figures."""
        layers = tuple(Layer(np.asarray(w), np.asarray(b)) for w, b in weights)
        inputs = self._natural(self.held_out(1))[0]
        inputs = (inputs - self.centre) / self.scale
        # By their covariance: signals that are usual one by one may be unheard of together.
        whitener = np.linalg.inv(np.linalg.cholesky(inputs.T @ inputs / len(inputs))).T
        reach = _BEYOND * float(np.sqrt(((inputs @ whitener) ** 2).sum(axis=1)).max())

        def made(stretch: Floats, metrics: tuple[Metric, ...]) -> NetworkModel:
            return NetworkModel(
                design_hash=self.design_hash,
                chips=self.source.table.chips,
                layers=layers,
                centre=self.centre,
                scale=self.scale,
                middle=self.middle,
                size=self.size,
                stretch=stretch,
                whitener=whitener,
                reach=reach,
                forces=self.extremes,
                drag=self.source.spread.drag,
                floor=_FLOOR,
                softening=self.source.table.softening,
                data_sha256=self.source.sha256(),
                split=f"skins of their own: {_SKINS} to end training, {_SKINS} for the spread, "
                f"{_SKINS} for the figures, of {_TOUCHES} touches each",
                metrics=metrics,
            )

        blank = made(np.ones(self.outputs), ())
        stretch = _stretch(*self._judged(blank, self.held_out(1)), self.outputs)
        ready = made(stretch, ())
        return made(stretch, _metrics(*self._judged(ready, self.held_out(2)), self.outputs))

    def _judged(self, model: NetworkModel, drawn: Drawn) -> tuple[Prediction, Floats]:
        """What a model says of touches, and the truth."""
        return model.predict(drawn.signals.astype(np.float64)), drawn.values.astype(np.float64)

    def _natural(self, drawn: Drawn) -> tuple[Floats, Floats]:
        """Inputs (B, D) and targets (B, O) in their own units."""
        inputs, length = encode(drawn.signals.astype(np.float64), _FLOOR)
        values = drawn.values.astype(np.float64)
        drags = [values[:, 2:4] / length] if self.outputs == 5 else []
        targets = [values[:, :2], *drags, np.log(-values[:, 4:] / length)]
        return inputs, np.concatenate(targets, axis=1)

    def _standard(self, drawn: Drawn) -> tuple[Singles, Singles]:
        """The same, centred and scaled."""
        inputs, targets = self._natural(drawn)
        return (
            ((inputs - self.centre) / self.scale).astype(np.float32),
            ((targets - self.middle) / self.size).astype(np.float32),
        )

    def _random_layers(self, inputs: int) -> tuple[Layer, ...]:
        """Weights to begin with."""
        work = self.work
        rng = np.random.default_rng([work.seed, 0])
        last = self.outputs * (self.outputs + 3) // 2
        sizes = [inputs, *[work.width] * work.depth, last]
        layers = []
        for before, after in pairwise(sizes):
            weights = rng.standard_normal((work.members, before, after)) * np.sqrt(2 / before)
            bias = np.zeros((work.members, 1, after), np.float32)
            layers.append(Layer(weights.astype(np.float32), bias))
        # Statements begin near the middle, with a spread like the targets' own.
        layers[-1] = Layer(layers[-1].weights * np.float32(0.1), layers[-1].bias)
        return tuple(layers)


def _stretch(said: Prediction, truth: Floats, outputs: int) -> Floats:
    """By which stated deviations are multiplied so that 90 % regions hold 90 %, (O,)."""
    parts = [slice(0, 2), *[slice(k, k + 1) for k in range(2, 5)]]
    used = parts if outputs == 5 else [parts[0], parts[3]]
    factors: list[float] = []
    for part in used:
        wide = part.stop - part.start
        squared = _squared(said, truth, part)
        factors += [float(np.sqrt(np.quantile(squared, _HOLDS) / _NORMAL[wide]))] * wide
    return np.array(factors)


def _squared(said: Prediction, truth: Floats, part: slice) -> Floats:
    """Squared deviations of truths (B,) in what was stated of some of the values."""
    apart = said.values[:, part] - truth[:, part]
    sure = np.linalg.solve(said.covariance[:, part, part], apart[..., None])[..., 0]
    return np.asarray((apart * sure).sum(axis=1))


def _metrics(said: Prediction, truth: Floats, outputs: int) -> tuple[Metric, ...]:
    """Figures of touches from 0.3 N on."""
    firm = truth[:, 4] <= -0.3
    apart = said.values - truth
    place = np.hypot(apart[:, 0], apart[:, 1])
    inside = _squared(said, truth, slice(0, 2)) <= _NORMAL[2]
    found = [
        Metric("mean distance of the place", float(place[firm].mean()), "m"),
        Metric("mean error of the normal force", float(
            np.abs(apart[firm, 4] / truth[firm, 4]).mean()), "1"),
        Metric("truths in their stated 90 % region of place", float(inside[firm].mean()), "1"),
    ]  # fmt: skip
    if outputs == 5:
        drag = np.hypot(apart[:, 2], apart[:, 3])
        found.append(Metric("mean error of the drag", float(drag[firm].mean()), "N"))
    return tuple(found)
