"""Ensembles of small neural networks that tell a touch from signals: what such a model is.

Signals span decades with force, while where a touch is shows in their direction: so the direction
and the logarithm of the length are fed, and forces come out in units of that length. Decides this
layout, what is believed, and the model's file; hides how all members run at once. Needs NumPy
alone; files need `safetensors`. Training lives in `smoskin.sensing.network.training`.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smoskin.arguments import typed
from smoskin.arrays import Floats, assign, floats
from smoskin.errors import ModelError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.sensing.files import NETWORK, TensorFile, check_filled, check_within, freeze_model
from smoskin.sensing.learned.gaussian_process import Metric, Prediction
from smoskin.sensing.signals.loops import Loops

Singles: TypeAlias = NDArray[np.float32]

_FILE: Final = TensorFile("a network file", NETWORK, 1)
_TENSORS: Final = ("centre", "scale", "middle", "size", "stretch", "whitener")
_LAYERS: Final = {"first": slice(0, 1), "hidden": slice(1, -1), "last": slice(-1, None)}
_LIMITS: Final = {
    "centre": (-1e3, 1e3),
    "scale": (1e-9, 1e6),
    "stretch": (1e-6, 1e6),
    "whitener": (-1e9, 1e9),
    "reach": (1e-9, 1e9),
    "forces": (1e-6, 1e3),
    "drag": (0.0, 1e3),
    "floor": (1e-15, 1.0),
    "softening": (-1.0, 1.0),
}
"""Least and largest numbers, SI."""
_LARGEST: Final = np.array([1.0, 1.0, 1e9, 1e9, 50.0])
"""The largest of a target's middle and spread: m, N/T and log(N/T)."""
_HEAVIEST: Final = 1e6
"""The largest weight."""
SPREADS: Final = (-9.0, 2.0)
"""Least and largest logarithm of a stated standard deviation, in units of the target's own."""


class Layer(NamedTuple):
    """One layer of M members."""

    weights: Singles
    """(M, inputs, outputs)."""
    bias: Singles
    """(M, 1, outputs)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NetworkModel:
    """A trained ensemble, complete with what it may be used for.

    Inputs are D = C + 1 numbers: the C signals over their length l, and log l. Hidden layers pass x
    on as x / (1 + e^-x). Each member gives O means: x, y, then Fx / l and Fy / l where it knows
    drags, and log(-Fz / l); O logarithms of deviations; and for each pair how much of what an
    earlier target is off a later one is off too, both in their deviations: row by row below the
    diagonal of a factor L_k of their covariance L_k L_k^T. It raises a `ModelError` if arrays do
    not fit each other or are not finite.
    """

    design_hash: str
    """Content hash of the design."""
    chips: tuple[int, ...]
    """Chips that are read, by their place in a reading."""
    layers: tuple[Layer, ...]
    """Layers from inputs to outputs, of all M members."""
    centre: Floats
    """(D,): mean of the inputs."""
    scale: Floats
    """(D,): spread of the inputs."""
    middle: Floats
    """(O,): mean of the targets, in m, N/T and log(N/T)."""
    size: Floats
    """(O,): spread of the targets."""
    stretch: Floats
    """(O,): factors on stated deviations with which regions hold what they should."""
    whitener: Floats
    """(D, D): turns inputs, centred and scaled, into distances from those of training."""
    reach: float
    """Distance up to which it is believed."""
    forces: tuple[float, float]
    """Least and largest normal force of training, N."""
    drag: float
    """Largest drag of training, N; 0 where touches are known to be straight."""
    floor: float
    """Length added to the signals' in quadrature, T, so that its logarithm is finite."""
    softening: float
    """Relative stiffening of the rubber by a degree, 1/K."""
    data_sha256: str
    """Hash of the response table and of how touches were drawn from it."""
    split: str
    """How held-out touches were chosen, in words."""
    metrics: tuple[Metric, ...]
    """Figures on them."""
    loops: Loops | None = None
    """Hysteresis of the skin's signals, undone before they are read; none is known by default."""

    def __post_init__(self) -> None:
        inputs, outputs = 3 * len(self.chips) + 1, len(self.rows)
        numbers = outputs * (outputs + 3) // 2
        largest = _LARGEST[list(self.rows)]
        freeze_model(
            self,
            "network",
            _LIMITS | {"middle": (-largest, largest), "size": (1e-9, largest)},
            **dict.fromkeys(("centre", "scale"), (inputs,)),
            **dict.fromkeys(("middle", "size", "stretch"), (outputs,)),
            whitener=(inputs, inputs),
        )
        layers = tuple(Layer(*(_read_only(part) for part in layer)) for layer in self.layers)
        shapes = [(layer.weights.shape, layer.bias.shape) for layer in layers]
        members, _, width = shapes[0][0] if shapes else (0, 0, 0)
        widths = [inputs, *[width] * (len(layers) - 1), numbers]
        fitting = [((members, a, b), (members, 1, b)) for a, b in pairwise(widths)]
        if len(layers) < 3 or shapes != fitting:
            raise ModelError(
                f"network: must have {inputs} inputs, two or more hidden layers of one width and "
                f"{numbers} outputs; got weights {[weights for weights, _ in shapes]}"
            )
        for part in (part for layer in layers for part in layer):
            check_within("network: weights", part, -_HEAVIEST, _HEAVIEST)
        if not self.forces[0] < self.forces[1]:
            raise ModelError(f"network: forces must rise from above 0; got {self.forces} N")
        if self.loops is not None and len(self.loops.reach) != inputs - 1:
            raise ModelError(
                f"network: loops must be of its {inputs - 1} signals; got {len(self.loops.reach)}"
            )
        assign(self, layers=layers)

    @property
    def rows(self) -> tuple[int, ...]:
        """Places of the targets among x, y, Fx, Fy, Fz."""
        return (0, 1, 2, 3, 4) if self.drag else (0, 1, 4)

    @property
    def members(self) -> int:
        """Number of networks, M."""
        return len(self.layers[0].weights)

    @typed
    def predict(self, signals: ArrayLike, temperature: float = REFERENCE_TEMPERATURE) -> Prediction:
        """The touches behind signals (B, 3 S), T, of the model's chips, on rubber at so many degC.

        Signals are those that `smoskin.sensing.response.table.ResponseTable` defines; another
        number of them raises an `ArgumentError`.
        """
        count = len(self.centre) - 1
        rows = floats("signals", signals, (count,)).reshape(-1, count)
        return Ensemble(self).predict(rows, temperature)

    def save(self, path: Path | str) -> None:
        """Write the model file: arrays, and what they mean as JSON in the file's header.

        It raises as `TensorFile.write`.
        """
        arrays: dict[str, NDArray[Any]] = {name: getattr(self, name) for name in _TENSORS}
        for name, some in _LAYERS.items():
            for kind in Layer._fields:
                parts = [getattr(layer, kind) for layer in self.layers[some]]
                arrays[f"{name}_{kind}"] = np.stack(parts)
        drags = ["Fx / length", "Fy / length"] if self.drag else []
        header = {
            "design": self.design_hash,
            "input": {
                "chips": list(self.chips),
                "signals": "x, y, z of each chip in turn, in the skin's axes, T, less the rest "
                "field, at reference temperature",
                "form": "signals over their length, then the logarithm of that length over 1 T",
                "floor_T": self.floor,
            },
            "output": ["x / m", "y / m", *drags, "log(-Fz / length)"],
            "reach": self.reach,
            "forces_N": list(self.forces),
            "drag_N": self.drag,
            "softening_per_K": self.softening,
            "data_sha256": self.data_sha256,
            "split": self.split,
            "metrics": [metric._asdict() for metric in self.metrics],
            "loops": self.loops and self.loops.as_json(),
        }
        _FILE.write(path, arrays, header)


class Ensemble:
    """A model laid out for use: all members side by side, in few large steps.

    Members with means m_k and covariances L_k L_k^T are taken as a mixture: its mean m is that of
    the m_k, its covariance the mean of L_k L_k^T + (m_k - m)(m_k - m)^T. So the columns of all L_k
    and m_k - m, over the root of M, stand side by side as one factor of it.
    """

    def __init__(self, model: NetworkModel) -> None:
        self.model = model
        members, inputs, outputs = model.members, len(model.centre), len(model.middle)
        # One product gives the first layer of all members and, below, the distance from training.
        # Before hidden units come halves: x / (1 + e^-x) is h + h tanh(h) with h = x / 2.
        first, *hidden, last = model.layers
        rows = 0.5 * first.weights.transpose(0, 2, 1).reshape(-1, inputs).astype(np.float64)
        rows = np.concatenate([rows, model.whitener.T / model.reach]) / model.scale
        bias = np.concatenate([0.5 * first.bias.ravel(), np.zeros(inputs)])
        self.first, self.first_bias = rows, (bias - rows @ model.centre)[:, None]
        self.width = members * first.bias.shape[-1]
        """Hidden units of a layer, of all members."""
        self.hidden = [_columns(layer, 0.5) for layer in hidden]
        # The last layer gives a 0 and a 1 too, of which factors are made by picking.
        numbers = last.bias.shape[-1]
        blank = np.zeros((members, last.weights.shape[1], 2), np.float32)
        constant = np.broadcast_to(np.array([0.0, 1.0], np.float32), (members, 1, 2))
        weights = np.concatenate([last.weights, blank], axis=-1)
        self.last = _columns(Layer(weights, np.concatenate([last.bias, constant], axis=-1)))
        left, right = picks = np.full((2, members, 5, outputs + 1), numbers)
        self.middle, self.size, self.stretch = np.zeros((3, 5, 1))
        for row, at in enumerate(model.rows):
            shares = 2 * outputs + row * (row - 1) // 2
            left[:, at, : row + 1] = outputs + row
            right[:, at, :row] = range(shares, shares + row)
            left[:, at, -1] = row
            right[:, at, [row, -1]] = numbers + 1
            self.middle[at], self.size[at] = model.middle[row], model.size[row]
            self.stretch[at] = model.size[row] * model.stretch[row] / np.sqrt(members)
        picks += (numbers + 2) * np.arange(members)[:, None, None]
        self.picks = picks.swapaxes(1, 2).reshape(2, 5, -1)
        """(2, 5, M (O + 1)): two numbers whose product is the factor of second moments, of M."""
        self.deviations = slice(outputs, 2 * outputs)
        """Rows of each member's numbers that are logarithms of deviations."""
        self.beside = slice(outputs, None, outputs + 1)
        """Columns of the factor that hold the members' means."""
        self.means = np.zeros(members * (outputs + 1))
        self.means[self.beside] = 1 / members

    def predict(self, signals: Floats, temperature: float = REFERENCE_TEMPERATURE) -> Prediction:
        """The touches behind B rows of signals, (B, C), T, on rubber at a temperature, degC."""
        model, count = self.model, len(signals)
        length = np.sqrt(np.add.reduce(signals * signals, axis=1) + model.floor**2)
        inputs = np.empty((signals.shape[1] + 1, count))
        np.divide(signals.T, length, out=inputs[:-1])
        np.log(length, out=inputs[-1])
        both = self.first @ inputs
        both += self.first_bias
        far = both[self.width :]
        novelty = np.sqrt(np.add.reduce(far * far, axis=0))
        half = both[: self.width].astype(np.float32).reshape(model.members, -1, count)
        for weights, bias in self.hidden:
            half = weights @ _passed(half)
            half += bias
        weights, bias = self.last
        numbers = (weights @ _passed(half) + bias).astype(np.float64)
        logarithms = numbers[:, self.deviations]
        np.maximum(logarithms, SPREADS[0], out=logarithms)
        np.minimum(logarithms, SPREADS[1], out=logarithms)
        np.exp(logarithms, out=logarithms)
        left, right = numbers.reshape(-1, count).take(self.picks, axis=0)
        factor = left * right
        mean = self.means @ factor
        values = self.middle + self.size * mean
        strength = length * (1 + model.softening * (temperature - REFERENCE_TEMPERATURE))
        values[2:4] *= strength
        values[4] = -strength * np.exp(values[4])
        units = self.stretch.repeat(count, axis=1)
        units[2:4] *= strength
        units[4] *= values[4]
        factor[:, self.beside] -= mean[:, None]
        factor *= units[:, None]
        root = factor.transpose(2, 0, 1)
        return Prediction(values.T, root @ root.transpose(0, 2, 1), novelty)


def load_network(path: Path | str) -> NetworkModel:
    """Read a network's file.

    Raises
    ------
    ModelError
        If it cannot be read, is no network of this package or of a later format, or is damaged.
    MissingExtraError
        If `safetensors` is not installed.
    """
    parts = [f"{name}_{kind}" for name in _LAYERS for kind in Layer._fields]
    return _FILE.read(path, (*_TENSORS, *parts), _network)


def _network(arrays: dict[str, NDArray[Any]], header: dict[str, Any]) -> NetworkModel:
    """The model of a file's arrays and header."""
    check_filled("network", arrays, "whitener")
    given = header["input"]
    low, high = (float(force) for force in header["forces_N"])
    layers = [
        Layer(weights, bias)
        for name in _LAYERS
        for weights, bias in zip(arrays[f"{name}_weights"], arrays[f"{name}_bias"], strict=True)
    ]
    return NetworkModel(
        design_hash=str(header["design"]),
        chips=tuple(int(chip) for chip in given["chips"]),
        layers=tuple(layers),
        reach=float(header["reach"]),
        forces=(low, high),
        drag=float(header["drag_N"]),
        floor=float(given["floor_T"]),
        softening=float(header["softening_per_K"]),
        data_sha256=str(header["data_sha256"]),
        split=str(header["split"]),
        metrics=tuple(Metric(**metric) for metric in header["metrics"]),
        loops=Loops.from_json(header.get("loops")),
        **{name: arrays[name] for name in _TENSORS},
    )


def _passed(half: Singles) -> Singles:
    """Outputs x / (1 + e^-x) of hidden units, from x / 2, without overflow."""
    hidden = np.tanh(half)
    hidden += 1
    hidden *= half
    return hidden


def _columns(layer: Layer, factor: float = 1.0) -> tuple[Singles, Singles]:
    """Weights (M, outputs, inputs) and bias (M, outputs, 1) times a factor, for columns."""
    weights, bias = (np.float32(factor) * part.swapaxes(1, 2) for part in layer)
    return np.ascontiguousarray(weights), np.ascontiguousarray(bias)


def _read_only(part: Singles) -> Singles:
    """A copy that nobody changes."""
    copy = np.array(part, dtype=np.float32)
    copy.flags.writeable = False
    return copy
