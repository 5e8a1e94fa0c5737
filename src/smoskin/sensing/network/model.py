"""Ensembles of small neural networks that tell a touch from signals: what such a model is.

A model reads the signals of some chips and says place and force with their covariance, in one
pass without search. Signals span decades with force, while where a touch is shows in their
direction: so the direction and the logarithm of the length are fed, and forces come out in units
of that length. Decides this layout, what is believed (a range of validity), and the model's file;
hides how members are taken together. Needs NumPy alone; files need `safetensors`. Readings are
met in `smoskin.sensing.network.estimator`; training lives in `smoskin.sensing.network.training`.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smoskin.arrays import Floats, floats, frozen
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.sensing.files import NETWORK, TensorFile
from smoskin.sensing.learned.gaussian_process import Metric

Singles: TypeAlias = NDArray[np.float32]

_FILE: Final = TensorFile("a network file", NETWORK, 1)
_TENSORS: Final = ("centre", "scale", "middle", "size", "stretch", "whitener")
_PARTS: Final = tuple(
    f"{name}_{kind}" for name in ("first", "hidden", "last") for kind in ("weights", "bias")
)
SPREADS: Final = (-9.0, 2.0)
"""Least and largest logarithm of a stated standard deviation, in units of the target's own."""


class Layer(NamedTuple):
    """One layer of M members."""

    weights: Singles
    """(M, inputs, outputs)."""
    bias: Singles
    """(M, 1, outputs)."""


class Prediction(NamedTuple):
    """What a model says of B touches."""

    values: Floats
    """(B, 5): x, y, m, and Fx, Fy, Fz, N."""
    covariance: Floats
    """(B, 5, 5), likewise; zero along a drag that is known to be none."""
    novelty: Floats
    """(B,): how far the signals lie from those of training, over what is still believed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NetworkModel:
    """A trained ensemble, complete with what it may be used for.

    Inputs are D = C + 1 numbers: the C signals over their length, and its logarithm. Hidden
    layers pass x on as x / (1 + e^-x). Each member gives O numbers: x, y, then Fx and Fy over the
    length where it knows drags, and the logarithm of the normal force over the length; and the
    factor of their covariance.

    Raises
    ------
    ModelError
        If arrays do not fit each other or are not finite.
    """

    design_hash: str
    """Content hash of the design."""
    chips: tuple[int, ...]
    """Which of the skin's chips it reads, by their place in a reading."""
    layers: tuple[Layer, ...]
    """From inputs to outputs, all M members."""
    centre: Floats
    """(D,): of the inputs."""
    scale: Floats
    """(D,): their spread."""
    middle: Floats
    """(O,): of what it gives, in m, N/T and log(N/T)."""
    size: Floats
    """(O,): its spread."""
    stretch: Floats
    """(O,): by which stated deviations are multiplied so that they hold what they should."""
    whitener: Floats
    """(D, D): turns inputs, centred and scaled, into distances from those of training."""
    reach: float
    """Distance up to which it is believed."""
    forces: tuple[float, float]
    """N: least and largest normal force of training."""
    drag: float
    """N: largest drag of training; 0 where touches are known to be straight."""
    floor: float
    """T, added to the length in quadrature, so that its logarithm is finite."""
    softening: float
    """1/K: how much stiffer a degree makes the rubber."""
    data_sha256: str
    """Of the response table and of how touches were drawn from it."""
    split: str
    """How held-out touches were chosen, in words."""
    metrics: tuple[Metric, ...]
    """Figures on them."""

    def __post_init__(self) -> None:
        inputs, outputs = 3 * len(self.chips) + 1, 5 if self.drag else 3
        shapes: dict[str, tuple[int | None, ...]] = {
            "centre": (inputs,),
            "scale": (inputs,),
            "middle": (outputs,),
            "size": (outputs,),
            "stretch": (outputs,),
            "whitener": (inputs, inputs),
        }
        for name, shape in shapes.items():
            try:
                array = frozen(name, getattr(self, name), shape)
            except ArgumentError as error:
                raise ModelError(f"network: {error}") from error
            if not np.isfinite(array).all():
                raise ModelError(f"network: {name} must be finite")
            object.__setattr__(self, name, array)
        numbers = outputs * (outputs + 3) // 2
        layers = tuple(Layer(*(_read_only(part) for part in layer)) for layer in self.layers)
        widths = [inputs, *[layer.bias.shape[-1] for layer in layers]]
        fits = all(
            layer.weights.shape == (self.members, before, after)
            and layer.bias.shape == (self.members, 1, after)
            for layer, (before, after) in zip(layers, pairwise(widths), strict=True)
        )
        if len(layers) < 3 or not fits or len(set(widths[1:-1])) != 1 or widths[-1] != numbers:
            raise ModelError(
                f"network: must have {inputs} inputs, two or more hidden layers of one width and "
                f"{numbers} outputs; got weights {[layer.weights.shape for layer in layers]}"
            )
        if not all(np.isfinite(part).all() for layer in layers for part in layer):
            raise ModelError("network: weights must be finite")
        for name in ("scale", "size", "stretch", "reach", "floor"):
            if not np.all(getattr(self, name) > 0):
                raise ModelError(f"network: {name} must be positive")
        if not (0 < self.forces[0] < self.forces[1] and self.drag >= 0):
            raise ModelError(f"network: forces must rise from above 0; got {self.forces} N")
        object.__setattr__(self, "layers", layers)

    @property
    def rows(self) -> tuple[int, ...]:
        """Where what it gives stands among x, y, Fx, Fy, Fz."""
        return (0, 1, 2, 3, 4) if self.drag else (0, 1, 4)

    @property
    def members(self) -> int:
        """How many networks there are, M."""
        return len(self.layers[0].weights)

    def predict(self, signals: ArrayLike, temperature: float = REFERENCE_TEMPERATURE) -> Prediction:
        """The touches behind B rows of signals.

        Parameters
        ----------
        signals : array_like, shape (B, 3 S)
            T, of the model's chips, as `smoskin.sensing.response.table.ResponseTable` defines them.
        temperature : float, optional
            degC, of the rubber.

        Raises
        ------
        ArgumentError
            If there is another number of signals.

        Notes
        -----
        Of members with means m_k and covariances S_k the mean is that of m_k, and the covariance
        the mean of S_k + (m_k - m)(m_k - m)^T.
        """
        count = len(self.centre) - 1
        inputs, length = encode(floats("signals", signals, (count,)).reshape(-1, count), self.floor)
        inputs = (inputs - self.centre) / self.scale
        hidden = inputs.astype(np.float32)
        for layer in self.layers[:-1]:
            half = 0.5 * (hidden @ layer.weights + layer.bias)
            # x / (1 + e^-x), which does not overflow so.
            hidden = half + half * np.tanh(half)
        last = self.layers[-1]
        said = (hidden @ last.weights + last.bias).astype(np.float64)
        count, rows = len(self.middle), list(self.rows)
        each = said[..., :count]
        mean = each.mean(axis=0)
        factor, apart = spread_factors(said, count), each - mean
        spread = (factor @ factor.swapaxes(-1, -2)).mean(axis=0)
        spread += np.einsum("mbi,mbj->bij", apart, apart) / self.members
        natural = self.middle + self.size * mean
        strength = length * self.stiffening(temperature)
        values, turn = np.zeros((len(mean), 5)), np.ones((len(mean), 5))
        values[:, rows] = natural
        values[:, 2:4] *= strength
        turn[:, 2:4] = strength
        turn[:, 4:] = values[:, 4:] = -strength * np.exp(natural[:, -1:])
        turn = turn[:, rows] * self.size * self.stretch
        covariance = np.zeros((len(mean), 5, 5))
        covariance[:, np.array(rows)[:, None], rows] = spread * turn[:, :, None] * turn[:, None]
        distance = np.sqrt(((inputs @ self.whitener) ** 2).sum(axis=1))
        return Prediction(values, covariance, distance / self.reach)

    def stiffening(self, temperature: float) -> float:
        """By which the rubber is stiffer at this temperature, degC, than at reference."""
        return 1 + self.softening * (temperature - REFERENCE_TEMPERATURE)

    def save(self, path: Path | str) -> None:
        """Write the model file: arrays, and what they mean as JSON in the file's header.

        Raises
        ------
        MissingExtraError
            If `safetensors` is not installed.
        """
        arrays: dict[str, NDArray[Any]] = {name: getattr(self, name) for name in _TENSORS}
        ends = {"first": self.layers[:1], "hidden": self.layers[1:-1], "last": self.layers[-1:]}
        for name, layers in ends.items():
            arrays[f"{name}_weights"] = np.stack([layer.weights for layer in layers])
            arrays[f"{name}_bias"] = np.stack([layer.bias for layer in layers])
        outputs = ["x / m", "y / m", *(["Fx / length", "Fy / length"] if self.drag else []),
                   "log(-Fz / length)"]  # fmt: skip
        header = {
            "design": self.design_hash,
            "input": {
                "chips": list(self.chips),
                "signals": "x, y, z of each chip in turn, in the skin's axes, T, less the rest "
                "field, at reference temperature",
                "form": "signals over their length, then the logarithm of that length over 1 T",
                "floor_T": self.floor,
            },
            "output": outputs,
            "reach": self.reach,
            "forces_N": list(self.forces),
            "drag_N": self.drag,
            "softening_per_K": self.softening,
            "data_sha256": self.data_sha256,
            "split": self.split,
            "metrics": [metric._asdict() for metric in self.metrics],
        }
        _FILE.write(path, arrays, header)


def load_network(path: Path | str) -> NetworkModel:
    """Read a network's file.

    Raises
    ------
    ModelError
        If it cannot be read, is no network of this package or of a later format, or is damaged.
    MissingExtraError
        If `safetensors` is not installed.
    """
    return _FILE.read(path, (*_TENSORS, *_PARTS), _network)


def _network(arrays: dict[str, NDArray[Any]], header: dict[str, Any]) -> NetworkModel:
    """The model of a file's arrays and header."""
    given = header["input"]
    low, high = (float(one) for one in header["forces_N"])
    layers = [
        Layer(weights, bias)
        for name in ("first", "hidden", "last")
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
        metrics=tuple(Metric(**one) for one in header["metrics"]),
        **{name: arrays[name] for name in _TENSORS},
    )


def encode(signals: Floats, floor: float) -> tuple[Floats, Floats]:
    """Inputs (B, C + 1) of signals (B, C) and their lengths (B, 1), T."""
    length = np.sqrt((signals * signals).sum(axis=1, keepdims=True) + floor * floor)
    return np.concatenate([signals / length, np.log(length)], axis=1), length


def _read_only(part: Singles) -> Singles:
    """A copy that nobody changes."""
    copy = np.array(part, dtype=np.float32)
    copy.flags.writeable = False
    return copy


def spread_factors(said: Floats, count: int) -> Floats:
    """Lower triangular factors (..., O, O) of the covariances that members state.

    Parameters
    ----------
    said : Floats, shape (..., O (O + 3) / 2)
        O means, O logarithms of deviations, and for each pair how much of what an earlier target
        is off a later one is off too, both in their deviations: row by row below the diagonal.
    count : int
        O.
    """
    size = np.exp(np.clip(said[..., count : 2 * count], *SPREADS))
    # Residuals are made independent by forward substitution: (1 + N) white = apart / size.
    shares = np.zeros((*said.shape[:-1], count, count))
    shares[..., *np.tril_indices(count, -1)] = said[..., 2 * count :]
    shares[..., range(count), range(count)] = 1.0
    return np.asarray(size[..., :, None] * shares)
