"""How zeroed fields are laid out as the inputs of a learned model.

Decides which chips are used, whether strength is told apart from direction, and how much of the
past is shown; training and run time share it, so that both see the same numbers. History is causal:
an input depends on its own field and on earlier ones alone.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from smoskin.arrays import Floats, floats
from smoskin.errors import ArgumentError

_LONGEST: Final = 1e9  # s
_FAINTEST: Final = 1e-15  # T


class Form(Enum):
    """How a field is laid out for a model; the value is a sentence for people."""

    COMPONENTS = "Every component of the used chips' zeroed field, in T."
    DIRECTION = "The same over its length across all of these chips, and that length's logarithm."


class Past(Enum):
    """The part of a field that is set against its past; the value is a sentence for people."""

    COMPONENTS = "Every component of the used chips' zeroed field, in T."
    STRENGTH = (
        "The logarithm of the field's length: hysteresis is a share of the load, at any load."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoding:
    """Inputs of a model: fields of some chips, now and against their recent past."""

    chips: tuple[int, ...]
    """Chips used, by their index in the reading."""
    form: Form = Form.COMPONENTS
    """Layout of the present field."""
    time_constants: tuple[float, ...] = ()
    """Time constants, s, of trailing means; `past` less each is fed too (hysteresis, creep)."""
    past: Past = Past.COMPONENTS
    """Part of the field that the time constants apply to."""
    floor: float = 1e-6
    """Length added in quadrature, T: a much fainter field has no direction, a finite logarithm."""

    def __post_init__(self) -> None:
        if not self.chips or min(self.chips) < 0 or len(set(self.chips)) != len(self.chips):
            raise ArgumentError(f"chips must be distinct indices from 0; got {self.chips}")
        if not all(0 < tau <= _LONGEST for tau in self.time_constants):
            raise ArgumentError(
                f"time_constants must be positive, up to {_LONGEST:g} s; got {self.time_constants}"
            )
        if not _FAINTEST <= self.floor <= 1.0:
            raise ArgumentError(f"floor must be positive, {_FAINTEST:g} to 1 T; got {self.floor} T")

    @property
    def columns(self) -> int:
        """Number of inputs that a model with this encoding has."""
        present = 3 * len(self.chips)
        return present + (self.form is Form.DIRECTION) + self.lags

    @property
    def lags(self) -> int:
        """Number of those that tell of the past."""
        followed = 3 * len(self.chips) if self.past is Past.COMPONENTS else 1
        return followed * len(self.time_constants)

    def encode(self, time: Floats, field: Floats) -> Floats:
        """Inputs (T, columns) of zeroed fields (T, S, 3), T, of all chips at rising times (T,), s.

        Each row sees only what came before it. It raises an `ArgumentError` if the shapes disagree,
        or the field has fewer chips than are used.
        """
        field = floats("field", field, (len(time), None, 3))
        if max(self.chips) >= field.shape[1]:
            raise ArgumentError(
                f"field must have the chips {self.chips}; got {field.shape[1]} chips"
            )
        used = field[:, list(self.chips)].reshape(len(field), -1)
        lags = np.zeros((len(used), 0))
        if self.time_constants:
            history, followed = History(self.time_constants), self.followed(used)
            steps = zip(time, followed, strict=True)
            lags = np.stack([history.step(float(t), row) for t, row in steps])
        return self.lay_out(used, lags)

    def followed(self, used: Floats) -> Floats:
        """The part of the used chips' fields (T, C) that a history follows."""
        if self.past is Past.COMPONENTS:
            return used
        return direction_and_strength(used, self.floor)[0][:, -1:]

    def lay_out(self, used: Floats, lags: Floats) -> Floats:
        """Inputs (T, D) from the used chips' fields (T, C) and the lags of what is followed."""
        present = used
        if self.form is Form.DIRECTION:
            present, _ = direction_and_strength(used, self.floor)
        return np.concatenate([present, lags], axis=1)

    def faintness(self, inputs: Floats) -> Floats:
        """One over the squared length of each row's field, (T,), T^-2; 0 where it is not told."""
        if self.form is Form.COMPONENTS:
            return np.zeros(len(inputs))
        return np.asarray(np.exp(-2.0 * inputs[:, 3 * len(self.chips)]))


class History:
    """Trailing exponential means m of a quantity x, one for each time constant tau.

    dm/dt = (x - m) / tau, exact for an x that stays from step to step.
    """

    def __init__(self, time_constants: tuple[float, ...]) -> None:
        self._time_constants = np.array(time_constants)[:, None]
        self._means: Floats | None = None
        self._time = 0.0

    def step(self, time: float, now: Floats) -> Floats:
        """The quantity (C,) less each mean, shape (L * C,); the first call starts the means."""
        if self._means is None:
            self._means = np.tile(now, (len(self._time_constants), 1))
        weight = -np.expm1(-(time - self._time) / self._time_constants)
        self._time = time
        self._means = self._means + weight * (now - self._means)
        return np.asarray((now - self._means).reshape(-1))


def direction_and_strength(field: Floats, floor: float) -> tuple[Floats, Floats]:
    """Fields (T, C) over their lengths l, with log l behind, (T, C + 1); and l, (T, 1), T.

    l^2 = sum of squares + floor^2, so that no logarithm is infinite.
    """
    length = np.sqrt((field * field).sum(axis=1, keepdims=True) + floor * floor)
    return np.concatenate([field / length, np.log(length)], axis=1), length
