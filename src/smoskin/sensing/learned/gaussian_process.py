"""Estimators that were trained on data: what such a model is, and its use at run time.

A model is a Gaussian process's mean over an encoding of the zeroed field: a Matern 3/2 part
with one length per input, and a linear part that takes over beyond the data. Decides what is
said of a touch, when it may be believed, and what its file holds; hides arrays and file
format. Needs NumPy and SciPy alone; reading and writing files needs `safetensors`. Files carry
no code. Training lives in `smoskin.sensing.learned.training`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats, floats, frozen
from smoskin.errors import ArgumentError, ModelError
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.files import TensorFile
from smoskin.sensing.learned.inputs import Encoding, Form, History, Past
from smoskin.sensing.signals.zero import IdleBand, Zero, ZeroTracking

_FILE: Final = TensorFile("a model file", "smoskin_model", 2)
_BAD: Final = int(ChipFlag.MISSING | ChipFlag.INVALID)
_FULL: Final = int(ChipFlag.SATURATED | ChipFlag.WRAPPED)
_ROWS: Final = 5
"""Of an estimate's covariance."""
_LARGEST: Final = 1e6
"""T: no chip measures more, and squares of more overflow."""
_TENSORS: Final = (
    "centre",
    "scale",
    "support",
    "weights",
    "slope",
    "intercept",
    "residual",
    "noise",
    "place",
)


class Output(Enum):
    """What a model may give; the value is its row in an estimate's covariance, if it is below 5."""

    X = 0
    Y = 1
    FX = 2
    FY = 3
    FZ = 4
    XX = 5
    """Mean square of x about X over all touches; X and Y are then the touches' centre."""
    XY = 6
    """Mean product of x and y about X and Y."""
    YY = 7
    """Mean square of y about Y."""

    @property
    def unit(self) -> str:
        """SI unit."""
        return "m" if self.value < 2 else "N" if self.value < 5 else "m^2"


class Metric(NamedTuple):
    """One figure that a model reached on examples held out from its training."""

    name: str
    value: float
    unit: str


class Prediction(NamedTuple):
    """What a model says about T rows of inputs."""

    values: Floats
    """(T, O), SI."""
    covariance: Floats
    """(T, O, O), SI: of the held-out residuals, scaled to the strength of the field."""
    novelty: Floats
    """(T,): distance to the nearest example over the farthest at which the model is believed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LearnedModel:
    """A trained model, complete with what it may be used for.

    Raises
    ------
    ModelError
        If the arrays do not fit each other or are not finite.
    """

    encoding: Encoding
    """What it is fed: the field less the mean of readings of the untouched skin."""
    chips_in_reading: int
    """Chips that a reading must have."""
    outputs: tuple[Output, ...]
    """What it gives."""
    place: Floats
    """(2,), m: where it was trained, given as the position by a model without X and Y."""
    touch_field: float
    """T: a field shorter than this is no touch."""
    centre: Floats
    """(D,): of the inputs."""
    scale: Floats
    """(D,): one length of the process along each input."""
    support: Floats
    """(N, D): centred and scaled inputs of the examples that it remembers."""
    weights: Floats
    """(N, O), SI unit of the outputs."""
    slope: Floats
    """(D, O), likewise, over the centred and scaled inputs."""
    intercept: Floats
    """(O,), likewise."""
    residual: Floats
    """(O, O): covariance of held-out residuals over their noise factor, SI."""
    noise: Floats
    """(2,): the noise factor is the first plus the second over the squared field in T."""
    reach: float
    """Distance to the nearest example, in lengths, up to which it is believed."""
    data_sha256: str
    """Of the examples that it was trained on."""
    split: str
    """How the held-out examples were chosen, in words."""
    metrics: tuple[Metric, ...]
    """Figures on the held-out examples."""

    def __post_init__(self) -> None:
        inputs, outputs, rows = self.encoding.columns, len(self.outputs), len(self.support)
        shapes = {
            "centre": (inputs,),
            "scale": (inputs,),
            "support": (rows, inputs),
            "weights": (rows, outputs),
            "slope": (inputs, outputs),
            "intercept": (outputs,),
            "residual": (outputs, outputs),
            "noise": (2,),
            "place": (2,),
        }
        for name, shape in shapes.items():
            try:
                array = frozen(name, getattr(self, name), shape)
            except ArgumentError as error:
                raise ModelError(f"model: {error}") from error
            if not np.isfinite(array).all():
                raise ModelError(f"model: {name} must be finite")
            object.__setattr__(self, name, array)
        if not (self.scale > 0).all() or not rows or not outputs:
            raise ModelError("model: must have examples, outputs and positive scales")
        if not (self.reach > 0 and self.touch_field >= 0):
            raise ModelError("model: reach must be positive and touch_field not negative")
        if self.chips_in_reading <= max(self.encoding.chips):
            raise ModelError(
                f"model: uses the chips {self.encoding.chips} of {self.chips_in_reading}"
            )

    def predict(self, inputs: Floats) -> Prediction:
        """Outputs for encoded fields.

        Parameters
        ----------
        inputs : Floats, shape (T, D)
            As `Encoding.encode` gives them.

        Raises
        ------
        ArgumentError
            If there is another number of inputs.

        Notes
        -----
        Source: k(r) = (1 + r) e^-r, the Matern 3/2 covariance, r in lengths.
        """
        inputs = floats("inputs", inputs, (None, len(self.centre)))
        row = (inputs - self.centre) / self.scale
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.spatial.distance import cdist

        distance = cdist(row, self.support)
        kernel = (1.0 + distance) * np.exp(-distance)
        values = kernel @ self.weights + row @ self.slope + self.intercept
        factor = self.noise[0] + self.noise[1] * self.encoding.faintness(inputs)
        return Prediction(
            values, factor[:, None, None] * self.residual, distance.min(axis=1) / self.reach
        )

    def save(self, path: Path | str) -> None:
        """Write the model file: arrays, and what they mean as JSON in the file's header.

        Raises
        ------
        MissingExtraError
            If `safetensors` is not installed.
        """
        arrays = {name: getattr(self, name) for name in _TENSORS}
        _FILE.write(path, arrays, self._specification())

    def _specification(self) -> dict[str, object]:
        """The JSON part of the file."""
        return {
            "input": {
                "chips_in_reading": self.chips_in_reading,
                "chips": list(self.encoding.chips),
                "axes": "x, y, z of each chip in turn",
                "unit": "T",
                "zero": "less the mean of readings of the untouched skin",
                "form": self.encoding.form.name,
                "time_constants_s": list(self.encoding.time_constants),
                "past": self.encoding.past.name,
                "floor_T": self.encoding.floor,
            },
            "outputs": [{"name": one.name, "unit": one.unit} for one in self.outputs],
            "touch_field_T": self.touch_field,
            "reach": self.reach,
            "data_sha256": self.data_sha256,
            "split": self.split,
            "metrics": [metric._asdict() for metric in self.metrics],
        }


def load_model(path: Path | str) -> LearnedModel:
    """Read a model file.

    Raises
    ------
    ModelError
        If it cannot be read, is no model of this package or of a later format, or is damaged.
    MissingExtraError
        If `safetensors` is not installed.
    """
    return _FILE.read(path, _TENSORS, _model)


def _model(arrays: dict[str, Floats], spec: dict[str, Any]) -> LearnedModel:
    """The model of a file's arrays and its specification."""
    given = spec["input"]
    return LearnedModel(
        encoding=Encoding(
            chips=tuple(int(chip) for chip in given["chips"]),
            form=Form[given["form"]],
            time_constants=tuple(float(tau) for tau in given["time_constants_s"]),
            past=Past[given["past"]],
            floor=float(given["floor_T"]),
        ),
        chips_in_reading=int(given["chips_in_reading"]),
        outputs=tuple(Output[one["name"]] for one in spec["outputs"]),
        touch_field=float(spec["touch_field_T"]),
        reach=float(spec["reach"]),
        data_sha256=str(spec["data_sha256"]),
        split=str(spec["split"]),
        metrics=tuple(Metric(**one) for one in spec["metrics"]),
        **arrays,
    )


class LearnedEstimator(Estimator):
    """Estimates touches with a trained model.

    Parameters
    ----------
    model : LearnedModel
        From `load_model` or `smoskin.sensing.learned.training.train`.
    zero : Floats, shape (S, 3), optional
        T: the untouched skin's field, where it is known; zeros for a source that takes its
        own zero off. Without it every estimate says `NOT_CALIBRATED` until `zero` is called.
    tracking : ZeroTracking, optional
        How the zero follows drift while the skin is idle; by default it stays, and no reading
        counts as idle.
    idle_field : float
        T: a field that changes by less than this on every axis counts as idle.

    Notes
    -----
    Quantities that the model does not give are NaN, in contacts and in the covariance; a model
    of force alone gives the place that it was trained at.

    Raises
    ------
    ArgumentError
        If the zero is not finite, or the model tells several touches by their spread.
    """

    def __init__(
        self,
        model: LearnedModel,
        zero: Floats | None = None,
        *,
        tracking: ZeroTracking | None = None,
        idle_field: float = 40e-6,
    ) -> None:
        if any(one.value >= _ROWS for one in model.outputs):
            raise ArgumentError(
                "model must give one touch; got one of "
                + ", ".join(one.name for one in model.outputs)
            )
        self.model = model
        self._tracking = tracking or ZeroTracking()
        self._idle = None if tracking is None else IdleBand(idle_field)
        self._chips = list(model.encoding.chips)
        shape = (model.chips_in_reading, 3)
        self._given = None if zero is None else frozen("zero", zero, shape)
        if self._given is not None and not np.isfinite(self._given).all():
            raise ArgumentError(f"zero must be finite; got {self._given}")
        self.reset()

    def reset(self) -> None:
        """Return to the zero given at the start, and forget earlier readings."""
        self._last_time = -np.inf
        self._set_zero(None if self._given is None else self._given[self._chips].reshape(-1))

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, (S, 3), T; 0 of chips not used."""
        drift = np.zeros((self.model.chips_in_reading, 3))
        if self._zero is not None:
            drift[self._chips] = self._zero.drift.reshape(-1, 3)
        return drift

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take the mean of these readings, made while nothing touches, as the zero.

        Raises
        ------
        ArgumentError
            If there are none in which the used chips are good.
        """
        good = [self._used(one) for one in readings if self._fault(one) is None]
        if not good:
            raise ArgumentError(
                "readings must hold at least one in which the used chips are good; "
                f"got {len(readings)} readings"
            )
        self._set_zero(np.mean(good, axis=0))

    def step(self, reading: Reading) -> Estimate:
        """The touch that one reading shows.

        Raises
        ------
        ArgumentError
            If the reading has another number of chips than the model was made for.
        """
        return self.batch([reading])[0]

    def batch(self, readings: Sequence[Reading]) -> list[Estimate]:
        """The same as `step` on each reading in turn, faster.

        Raises
        ------
        ArgumentError
            If a reading has another number of chips than the model was made for.
        """
        for reading in readings:
            self._check(reading)
        found = [self._condition(reading) for reading in readings]
        rows = [one for one in found if not isinstance(one, Status)]
        answers = iter(self._answers(np.stack(rows)) if rows else ())
        return [
            Estimate(time=reading.time, status=one)
            if isinstance(one, Status)
            else self._estimate(reading.time, *next(answers))
            for reading, one in zip(readings, found, strict=True)
        ]

    def _check(self, reading: Reading) -> None:
        """Refuse a reading of another skin."""
        if len(reading.field) != self.model.chips_in_reading:
            raise ArgumentError(
                f"reading must come from {self.model.chips_in_reading} chips, as the model's "
                f"examples did; got {len(reading.field)}"
            )

    def _set_zero(self, zero: Floats | None) -> None:
        """Start from this zero, with no past."""
        self._zero = None if zero is None else Zero(self._tracking, self._idle, zero)
        self._history = History(self.model.encoding.time_constants)

    def _used(self, reading: Reading) -> Floats:
        """Field of the used chips in a row."""
        return reading.field[self._chips].reshape(-1)

    def _fault(self, reading: Reading) -> Status | None:
        """What is wrong with the used chips' part of a reading."""
        self._check(reading)
        flags = int(np.bitwise_or.reduce(reading.flags[self._chips]))
        if flags & _BAD or not np.isfinite(self._used(reading)).all():
            return Status.CHIP_MISSING
        if flags & _FULL or not (np.abs(self._used(reading)) <= _LARGEST).all():
            return Status.SATURATED
        return Status.STALE if flags & int(ChipFlag.OLD) else None

    def _condition(self, reading: Reading) -> Floats | Status:
        """Inputs of one reading, or why there are none."""
        if not reading.time > self._last_time:
            return Status.STALE
        self._last_time = reading.time
        fault = self._fault(reading)
        if self._zero is None:
            return fault or Status.NOT_CALIBRATED
        if fault is not None:
            self._zero.interrupt(reading.time)
            return fault
        read = self._used(reading)
        used = read - self._zero.offset
        idle = self._zero.step(reading.time, read)
        encoding = self.model.encoding
        lags = self._history.step(reading.time, encoding.followed(used[None])[0])
        if not self._zero.believed:
            return Status.NOT_CALIBRATED
        if idle or np.sqrt(used @ used) < self.model.touch_field:
            return Status.NO_CONTACT
        return np.asarray(encoding.lay_out(used[None], lags[None])[0])

    def _answers(self, inputs: Floats) -> list[tuple[Floats, Floats, float]]:
        """(x, y, Fx, Fy, Fz), its covariance and the novelty, for each row."""
        said = self.model.predict(inputs)
        at = [one.value for one in self.model.outputs]
        values = np.full((len(inputs), _ROWS), np.nan)
        values[:, :2] = self.model.place
        values[:, at] = said.values
        spread = np.full((len(inputs), _ROWS, _ROWS), np.nan)
        spread[np.ix_(range(len(inputs)), at, at)] = said.covariance
        return list(zip(values, spread, said.novelty.tolist(), strict=True))

    def _estimate(self, time: float, values: Floats, spread: Floats, novelty: float) -> Estimate:
        """One answer as an estimate."""
        if not novelty <= 1.0:
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        return Estimate(
            time=time,
            status=Status.CONTACT,
            contacts=(Contact(position=values[:2], force=values[2:]),),
            covariance=spread[None],
        )
