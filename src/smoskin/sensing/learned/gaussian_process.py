"""Gaussian processes trained on recordings: what such a model is, and its use at run time.

Decides what is answered of a touch, when it may be believed, and what its file holds; hides arrays
and file format. Needs NumPy and SciPy alone; files need `safetensors`. Training lives in
`smoskin.sensing.learned.training`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import Enum
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats, floats, frozen
from smoskin.errors import ArgumentError, ModelError
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.files import TensorFile, freeze_model
from smoskin.sensing.learned.inputs import Encoding, Form, History, Past
from smoskin.sensing.signals.guards import ChipGuard, Clock, check_chips
from smoskin.sensing.signals.idle import IdleBand
from smoskin.sensing.signals.signals import LET_GO
from smoskin.sensing.signals.zero import Zero, ZeroTracking

_FILE: Final = TensorFile("a model file", "smoskin_model", 4, older=(3,))
_ROWS: Final = 5  # of an estimate's covariance
_LIMITS: Final = {
    **dict.fromkeys(("centre", "intercept"), (-1e4, 1e4)),
    **dict.fromkeys(("support", "weights", "slope"), (-1e9, 1e9)),
    "place": (-10.0, 10.0),
    "scale": (1e-12, 1e9),
    "residual": (-1e9, 1e9),  # in variances of what a fit states, huge where that is tiny
    "noise": (0.0, 1e9),
    "gain": (0.0, 1e3),
    "gain_after": (1e-3, 1e9),
    "touch_field": (0.0, 1.0),
    "reach": (1e-9, 1e9),
}
"""Least and largest numbers of a model, SI."""
_LOUDEST: Final = 15e-6  # T; no chip at rest is noisier


class Output(Enum):
    """A quantity that a model gives; values below 5 are rows of an estimate's covariance."""

    X = 0
    Y = 1
    FX = 2
    FY = 3
    FZ = 4
    XX = 5
    XY = 6
    YY = 7
    """Mean square of y about Y, as XX and XY: of all touches, whose centre X and Y then are."""

    @property
    def unit(self) -> str:
        """SI unit."""
        return "m" if self.value < 2 else "N" if self.value < 5 else "m^2"


class Metric(NamedTuple):
    """One figure that a model reached on examples held out from its training."""

    name: str
    value: float
    unit: str

    @property
    def shown(self) -> tuple[str, str]:
        """Value and unit for people."""
        shares = {"m": (1e3, "mm"), "m^2": (1e6, "mm^2"), "1": (100.0, "%")}
        scale, unit = shares.get(self.unit, (1.0, self.unit))
        return f"{self.value * scale:.3g}", unit


class Prediction(NamedTuple):
    """A model's answers to B touches, O quantities each, SI; a network's are x, y, Fx, Fy, Fz."""

    values: Floats
    """(B, O)."""
    covariance: Floats
    """(B, O, O): what the values may be off; zero along a drag that is known to be none."""
    novelty: Floats
    """(B,): distance from what was seen in training, over the farthest that is believed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LearnedModel:
    """A trained model, complete with what it may be used for.

    With u the inputs, centred and scaled to lengths, and u_n those of the examples, it gives f(u) =
    sum_n k(|u - u_n|) w_n + S^T u + c, where k(r) = (1 + r) e^-r is the Matern 3/2 covariance, w
    the weights, S the slope and c the intercept. It raises a `ModelError` if the arrays do not fit
    each other or are not finite.
    """

    encoding: Encoding
    """Layout of its inputs: of the field less the mean of readings of the untouched skin."""
    chips_in_reading: int
    """Chips that a reading must have."""
    outputs: tuple[Output, ...]
    """Quantities that it gives."""
    place: Floats
    """(2,), m: place of training, given as the position by a model without X and Y."""
    touch_field: float
    """Length of the field below which there is no touch, T."""
    centre: Floats
    """(D,): mean of the inputs."""
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
    gain: Floats
    """(O,): share of itself by which each quantity may be off besides, in another session."""
    gain_after: float
    """s of use after which it is off by as much in the same session."""
    reach: float
    """Distance to the nearest example, in standard deviations of each input, that is believed."""
    data_sha256: str
    """Hash of the examples that it was trained on."""
    split: str
    """How the held-out examples were chosen, in words."""
    metrics: tuple[Metric, ...]
    """Figures on the held-out examples."""

    def __post_init__(self) -> None:
        inputs, outputs, rows = self.encoding.columns, len(self.outputs), len(self.support)
        freeze_model(
            self,
            "model",
            _LIMITS,
            place=(2,),
            centre=(inputs,),
            scale=(inputs,),
            support=(rows, inputs),
            weights=(rows, outputs),
            slope=(inputs, outputs),
            intercept=(outputs,),
            residual=(outputs, outputs),
            noise=(2,),
            gain=(outputs,),
        )
        if not rows or not outputs:
            raise ModelError("model: must have examples and outputs")
        chips = self.encoding.chips
        if self.chips_in_reading <= max(chips):
            raise ModelError(f"model: uses the chips {chips} of {self.chips_in_reading}")

    def predict(self, inputs: Floats, age: Floats | None = None) -> Prediction:
        """Outputs for encoded fields, (T, D), as `Encoding.encode` gives them.

        Ages, (T,), are s since the middle of what was learned, in the same session: the square of
        the gain has grown in proportion. Without them it is that of another session. Another number
        of inputs, or a negative age, raises an `ArgumentError`.
        """
        inputs = floats("inputs", inputs, (None, len(self.centre)))
        grown = np.ones(len(inputs))
        if age is not None:
            grown = np.minimum(floats("age", age, (len(inputs),)) / self.gain_after, 1.0)
            if not (grown >= 0.0).all():
                raise ArgumentError(f"age must be >= 0 s; got {np.min(age)}")
        row = (inputs - self.centre) / self.scale
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.spatial.distance import cdist

        distance = cdist(row, self.support)
        kernel = (1.0 + distance) * np.exp(-distance)
        # Row by row, so that a run at once and each of its readings alone give the same bits.
        parts = [k @ self.weights + u @ self.slope for k, u in zip(kernel, row, strict=True)]
        values = np.reshape(parts, (len(row), len(self.outputs))) + self.intercept
        covariance = self.noise_factor(inputs)[:, None, None] * self.residual
        gained = grown[:, None] * (self.gain * values) ** 2
        covariance += gained[..., None] * np.eye(len(self.outputs))
        return Prediction(values, covariance, self.distances(inputs).min(axis=1) / self.reach)

    def noise_factor(self, inputs: Floats) -> Floats:
        """Factor of the residuals' covariance for encoded fields, (T,)."""
        return np.asarray(self.noise[0] + self.noise[1] * self.encoding.faintness(inputs))

    def distances(self, inputs: Floats) -> Floats:
        """Distances of encoded fields, (T, D), to the examples remembered, (T, N).

        They are in standard deviations of each input over the examples, not in lengths of the
        process: those of inputs that tell little are so long that a board with its chips swapped
        would look like any touch. Another number of inputs raises an `ArgumentError`.
        """
        inputs = floats("inputs", inputs, (None, len(self.centre)))
        from scipy.spatial.distance import cdist

        spread = self.support.std(axis=0)
        spread[spread == 0] = 1.0
        row = (inputs - self.centre) / self.scale
        return np.asarray(cdist(row / spread, self.support / spread))

    def save(self, path: Path | str) -> None:
        """Write the model file: arrays, and what they mean as JSON in the file's header.

        It raises as `TensorFile.write`.
        """
        encoding = self.encoding
        header = {
            "input": {
                "chips_in_reading": self.chips_in_reading,
                "chips": encoding.chips,
                "axes": "x, y, z of each chip in turn",
                "unit": "T",
                "zero": "less the mean of readings of the untouched skin",
                "form": encoding.form.name,
                "time_constants_s": encoding.time_constants,
                "past": encoding.past.name,
                "floor_T": encoding.floor,
            },
            "outputs": [{"name": output.name, "unit": output.unit} for output in self.outputs],
            "touch_field_T": self.touch_field,
            "reach": self.reach,
            "gain_after_s": self.gain_after,
            "data_sha256": self.data_sha256,
            "split": self.split,
            "metrics": [metric._asdict() for metric in self.metrics],
        }
        _FILE.write(path, {name: getattr(self, name) for name in _TENSORS}, header)


_TENSORS: Final = tuple(field.name for field in fields(LearnedModel) if field.type == Floats)
_OLDEST: Final = tuple(name for name in _TENSORS if name != "gain")
"""Those that files of format 3 have."""


def load_model(path: Path | str) -> LearnedModel:
    """Read a model file.

    Raises
    ------
    ModelError
        If it cannot be read, is no model of this package or of a later format, or is damaged.
    MissingExtraError
        If `safetensors` is not installed.
    """
    return _FILE.read(path, _OLDEST, _model, newer=("gain",))


def _model(arrays: dict[str, Floats], spec: dict[str, Any]) -> LearnedModel:
    """The model of a file's arrays and its specification."""
    given = spec["input"]
    arrays.setdefault("gain", np.zeros(len(spec["outputs"])))
    return LearnedModel(
        encoding=Encoding(
            chips=tuple(int(chip) for chip in given["chips"]),
            form=Form[given["form"]],
            time_constants=tuple(float(tau) for tau in given["time_constants_s"]),
            past=Past[given["past"]],
            floor=float(given["floor_T"]),
        ),
        chips_in_reading=int(given["chips_in_reading"]),
        outputs=tuple(Output[output["name"]] for output in spec["outputs"]),
        touch_field=float(spec["touch_field_T"]),
        reach=float(spec["reach"]),
        gain_after=float(spec.get("gain_after_s", 1.0)),
        data_sha256=str(spec["data_sha256"]),
        split=str(spec["split"]),
        metrics=tuple(Metric(**metric) for metric in spec["metrics"]),
        **arrays,
    )


class LearnedEstimator(Estimator):
    """Touches that a trained model finds.

    Quantities that the model does not give are NaN, in contacts and in the covariance; a model
    of force alone gives the place that it was trained at.

    Parameters
    ----------
    model : LearnedModel
        Model from `load_model` or `smoskin.sensing.learned.training.train_model`.
    zero : Floats, shape (S, 3), optional
        Field of the untouched skin, T, where it is known; zeros for a source that takes its own
        zero off. Without it every estimate says `NOT_CALIBRATED` until `zero` is called.
    tracking : ZeroTracking, optional
        How the zero follows drift while the skin is idle; by default it stays, and no reading
        counts as idle.
    idle_field : float
        Change on every axis, T, below which a field counts as idle.

    Raises
    ------
    ArgumentError
        If the zero is not finite, or the model tells several touches by their spread.
    """

    @typed
    def __init__(
        self,
        model: LearnedModel,
        zero: Floats | None = None,
        *,
        tracking: ZeroTracking | None = None,
        idle_field: float = 40e-6,
    ) -> None:
        if any(output.value >= _ROWS for output in model.outputs):
            names = ", ".join(output.name for output in model.outputs)
            raise ArgumentError(f"model must give one touch; got one of {names}")
        self.model = model
        self._tracking = tracking or ZeroTracking()
        band = IdleBand(idle_field)
        self._idle = None if tracking is None else band
        self._idle_field = idle_field
        self._chips = list(model.encoding.chips)
        self._guard = ChipGuard(self._chips)
        self._given: Floats | None = None
        if zero is not None:
            whole = frozen("zero", zero, (model.chips_in_reading, 3))
            if not np.isfinite(whole).all():
                raise ArgumentError(f"zero must be finite; got {whole}")
            self._given = self._used(whole)
        self.reset()

    def reset(self) -> None:
        """Return to the zero given at the start, and forget earlier readings."""
        self._clock = Clock()
        self._zero: Zero | None
        self._before: Zero | None = None
        self._begin(self._given)

    @property
    def drift(self) -> Floats:
        """Change of the zero since it was set, (S, 3), T; 0 of chips not used."""
        drift = np.zeros((self.model.chips_in_reading, 3))
        if self._zero is not None:
            drift[self._chips] = self._zero.drift.reshape(-1, 3)
        return drift

    @typed
    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Take the mean of these readings, made while nothing touches, as the zero.

        It raises an `ArgumentError` if there are none in which the used chips are good, they move
        by more than noise or, to the present zero, are a touch: unless `force` says they are none.
        """
        for reading in readings:
            check_chips(reading, self.model.chips_in_reading, "model")
        good = [self._used(each.field) for each in readings if self._guard.bad(each) is None]
        if not good:
            raise ArgumentError(
                "readings must hold at least one in which the used chips are good; "
                f"got {len(readings)} readings"
            )
        mean = np.mean(good, axis=0)
        if not force:
            moved = float(np.std(good, axis=0).max())
            if moved > _LOUDEST:
                raise ArgumentError(f"{LET_GO}; got readings that move by {moved * 1e6:.3g} uT")
            if self._zero is not None and self._touches(mean - self._zero.offset):
                raise ArgumentError(f"{LET_GO}; got what reads as a touch")
        before = self._zero
        self._begin(mean)
        self._before = before

    def unzero(self) -> None:
        """Return to the zero before the last; `ArgumentError` if there is none."""
        if self._before is None:
            raise ArgumentError("zero must have been set, once for each time it is taken back")
        self._zero, self._before = self._before, None
        self._rest()

    def step(self, reading: Reading) -> Estimate:
        """The touch that one reading shows.

        A reading of another number of chips than the model was made for raises an `ArgumentError`.
        """
        inputs = self._condition(reading)
        if isinstance(inputs, Status):
            return Estimate(time=reading.time, status=inputs)
        predicted = self.model.predict(inputs[None])
        if not predicted.novelty[0] <= 1.0:
            return Estimate(time=reading.time, status=Status.OUT_OF_RANGE)
        rows = [output.value for output in self.model.outputs]
        values, covariance = np.full(_ROWS, np.nan), np.full((1, _ROWS, _ROWS), np.nan)
        values[:2] = self.model.place
        values[rows] = predicted.values[0]
        covariance[0][np.ix_(rows, rows)] = predicted.covariance[0]
        return Estimate(
            time=reading.time,
            status=Status.CONTACT,
            contacts=(Contact(position=values[:2], force=values[2:]),),
            covariance=covariance,
        )

    def _begin(self, zero: Floats | None) -> None:
        """Start from this zero, with no past."""
        noise = self._idle_field**2 * np.eye(3 * len(self._chips))
        self._zero = None if zero is None else Zero(self._tracking, self._idle, zero, noise)
        self._rest()

    def _rest(self) -> None:
        """Begin with no past; the zero stays."""
        self._history = History(self.model.encoding.time_constants)
        self._guard.forget()
        if self._zero is not None:
            self._zero.rest()

    def _touches(self, used: Floats) -> bool:
        """Whether a change of the used chips' field (C,), T, lies among those of training."""
        if np.sqrt(used @ used) < self.model.touch_field:
            return False
        encoding = self.model.encoding
        inputs = encoding.lay_out(used[None], np.zeros((1, encoding.lags)))
        return bool(self.model.predict(inputs).novelty[0] <= 1.0)

    def _used(self, field: Floats) -> Floats:
        """Field of the used chips in a row."""
        return np.asarray(field[self._chips].reshape(-1))

    def _condition(self, reading: Reading) -> Floats | Status:
        """Inputs (D,) of one reading, or why there are none."""
        check_chips(reading, self.model.chips_in_reading, "model")
        if self._clock.stale(reading.time):
            if self._clock.anew:
                self._rest()
            return Status.STALE
        fault = self._guard.step(reading)
        if self._zero is None:
            return fault or Status.NOT_CALIBRATED
        if fault is not None:
            self._zero.interrupt(reading.time)
            return fault
        field = self._used(reading.field)
        used = field - self._zero.offset
        idle = self._zero.step(reading.time, field)
        encoding = self.model.encoding
        lags = self._history.step(reading.time, encoding.followed(used[None])[0])
        if not self._zero.believed:
            return Status.NOT_CALIBRATED
        if idle or np.sqrt(used @ used) < self.model.touch_field:
            return Status.NO_CONTACT
        return np.asarray(encoding.lay_out(used[None], lags[None])[0])
