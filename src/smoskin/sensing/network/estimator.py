"""Touches read by a network, one reading after the other.

Decides whether the model may be believed; hides how all members of an ensemble run at once in a
few steps. Needs NumPy and SciPy alone.
"""

import math

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.records import Contact, Estimate, Status
from smoskin.sensing.network.model import SPREADS, Layer, NetworkModel, Singles
from smoskin.sensing.signals.estimator import SignalEstimator
from smoskin.sensing.signals.zero import ZeroTracking


class NetworkEstimator(SignalEstimator):
    """No or one touch, by a network, with its covariance.

    Parameters
    ----------
    design : SkinDesign
    model : NetworkModel
        Of the design, or of this skin.
    creep : Prony, optional
        Solid of the skin's rubber, to undo its creep; that of the design's columns by default,
        `smoskin.mechanics.viscoelasticity.ELASTIC` for none.
    tracking : ZeroTracking, optional
        How the zero follows drift while nothing touches.
    false_alarms : float
        Chance of a reading of the untouched skin to count as touched.

    Raises
    ------
    ModelError
        If the model belongs to another design.
    ArgumentError
        If the chance does not lie in (0, 1).
    """

    def __init__(
        self,
        design: SkinDesign,
        model: NetworkModel,
        *,
        creep: Prony | None = None,
        tracking: ZeroTracking | None = None,
        false_alarms: float = 1e-6,
    ) -> None:
        design.check_own("model", model.design_hash)
        super().__init__(
            design,
            model.chips,
            creep=creep,
            false_alarms=false_alarms,
            tracking=tracking,
        )
        self.model = model
        self._network = PointNetwork(model)

    def _forget(self) -> None:
        """Every reading is taken by itself."""

    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        touch, spread, novelty = self._network.at(signals, temperature)
        if not novelty <= 1.0:
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        return Estimate(
            time=time,
            status=Status.CONTACT,
            contacts=(Contact(position=touch[:2], force=touch[2:]),),
            covariance=spread[None],
        )


class PointNetwork:
    """A model laid out for one touch at a time: all members side by side, in few large steps.

    Parameters
    ----------
    model : NetworkModel
    """

    def __init__(self, model: NetworkModel) -> None:
        self._model = model
        members, inputs, outputs = model.members, len(model.centre), len(model.middle)
        self._floor = model.floor**2
        self._input = np.empty(inputs)
        # One product gives the first layer of all members and, below, the distance from training.
        # Before hidden units come halves: x / (1 + e^-x) is h + h tanh(h) with h = x / 2.
        first, *hidden, last = model.layers
        rows = 0.5 * first.weights.transpose(0, 2, 1).reshape(-1, inputs).astype(np.float64)
        rows = np.concatenate([rows, model.whitener.T / model.reach]) / model.scale
        bias = np.concatenate([0.5 * first.bias.ravel(), np.zeros(inputs)])
        self._first, self._first_bias = rows, bias - rows @ model.centre
        self._width = members * first.bias.shape[-1]
        self._hidden = [_columns(layer, 0.5) for layer in hidden]
        # The last layer says a 0 and a 1 too, of which factors are made by picking.
        numbers = last.bias.shape[-1]
        blank = np.zeros((members, last.weights.shape[1], 2), np.float32)
        constant = np.broadcast_to(np.array([0.0, 1.0], np.float32), (members, 1, 2))
        self._last = _columns(
            Layer(np.concatenate([last.weights, blank], axis=-1),
                  np.concatenate([last.bias, constant], axis=-1))
        )  # fmt: skip
        left, right = np.full((2, members, 5, outputs + 1), numbers)
        scales = np.zeros((3, 5))
        for row, at in enumerate(model.rows):
            shares = 2 * outputs + row * (row - 1) // 2
            left[:, at, : row + 1] = outputs + row
            right[:, at, :row] = range(shares, shares + row)
            left[:, at, -1] = row
            right[:, at, [row, -1]] = numbers + 1
            size = model.size[row]
            scales[:, at] = model.middle[row], size, size * model.stretch[row]
        # (5, M (O + 1)): the factor of all members' second moments, of M.
        offset = (numbers + 2) * np.arange(members)[:, None, None]
        self._left, self._right = (
            (one + offset).transpose(1, 0, 2).reshape(5, -1) for one in (left, right)
        )
        self._middle, self._size, self._stretch = (
            scales[0].tolist(),
            scales[1].tolist(),
            scales[2] / np.sqrt(members),
        )
        self._sizes = slice(outputs, 2 * outputs)
        self._beside = slice(outputs, None, outputs + 1)
        self._means = np.zeros(members * (outputs + 1))
        self._means[self._beside] = 1 / members

    def at(
        self, signals: Floats, temperature: float = REFERENCE_TEMPERATURE
    ) -> tuple[Floats, Floats, float]:
        """Values (5,), covariance (5, 5) and novelty, as `NetworkModel.predict` gives them."""
        length = math.sqrt(float(signals @ signals) + self._floor)
        row = self._input
        row[:-1] = signals
        row[:-1] /= length
        row[-1] = math.log(length)
        both = self._first @ row
        both += self._first_bias
        far = both[self._width :]
        novelty = math.sqrt(float(far @ far))
        half = both[: self._width].astype(np.float32).reshape(self._model.members, -1, 1)
        hidden = np.tanh(half)
        hidden += 1
        hidden *= half
        for weights, bias in self._hidden:
            half = weights @ hidden
            half += bias
            hidden = np.tanh(half)
            hidden += 1
            hidden *= half
        weights, bias = self._last
        said = (weights @ hidden + bias).astype(np.float64)
        sizes = said[:, self._sizes]
        np.maximum(sizes, SPREADS[0], out=sizes)
        np.minimum(sizes, SPREADS[1], out=sizes)
        np.exp(sizes, out=sizes)
        factor = said.take(self._left)
        factor *= said.take(self._right)
        mean = factor @ self._means
        x, y, drag_x, drag_y, force = (
            middle + size * one
            for middle, size, one in zip(self._middle, self._size, mean.tolist(), strict=True)
        )
        strength = length * self._model.stiffening(temperature)
        push = -strength * math.exp(force)
        turn = self._stretch * (1.0, 1.0, strength, strength, push)
        # What members are apart is a factor beside those that they state.
        factor[:, self._beside] -= mean[:, None]
        factor *= turn[:, None]
        values = np.array([x, y, strength * drag_x, strength * drag_y, push])
        return values, factor @ factor.T, novelty


def _columns(layer: Layer, factor: float = 1.0) -> tuple[Singles, Singles]:
    """Weights (M, outputs, inputs) and bias (M, outputs, 1) times a factor, for columns."""
    weights, bias = (np.float32(factor) * part.swapaxes(1, 2) for part in layer)
    return np.ascontiguousarray(weights), np.ascontiguousarray(bias)
