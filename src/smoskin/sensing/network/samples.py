"""Touches for networks to learn from, drawn from a response table as often as one likes.

Every draw is another skin: the table's modes with random weights, at a random temperature, with
all that spoils a reading. Decides how touches and disturbances are spread, how touches become
centred and scaled examples, and which are held out: skins of their own that no lesson sees. Needs
NumPy alone.
"""

import hashlib
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ModelError
from smoskin.magnetics.straightening import bent_amiss
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.sensing.learned.inputs import direction_and_strength
from smoskin.sensing.network.model import Layer, NetworkModel, Singles
from smoskin.sensing.response.table import ResponseTable

_FLOOR: Final = 1e-6  # T; added to the signals' length in quadrature, a fraction of their noise
_SKINS: Final = 128  # of each held-out set
_TOUCHES: Final = 96  # of each of these skins
_FEW: Final = 16  # skins whose touches are laid out at once
_KEPT: Final = ("layers", "centre", "scale", "middle", "size")  # what a training goes on from
_UNFOLLOWED: Final = 0.01
"""Turn that the zero of a skin on an arm has not followed, rad. Where touches come between turns,
its own uncertainty is 5 mrad in the median and up to three times as much."""
_NOTHING: Final = 1e-9  # share of a vertex in a touch that is none


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchSpread:
    """How touches and what spoils them are spread.

    Negative numbers, and ranges that do not rise, raise an `ArgumentError`.
    """

    margin: float = 2.5e-3
    """Distance past the rim, m, to which places are drawn: the rim is no end of what was seen."""
    drag: float = 0.0
    """Largest drag, N, of any direction, evenly spread; 0: touches are straight."""
    straight: float = 0.4
    """Share of touches without drag, where others have one."""
    uneven: float = 0.5
    """Share of normal forces that are even in their logarithm; the others are even."""
    temperatures: tuple[float, float] = (15.0, 35.0)
    """Range of temperatures, degC, even."""
    drift: float = 0.5e-6
    """Standard deviation on each axis of the zero that has not been followed, T."""
    arm: bool = False
    """Whether an arm turns the skin: its zero is known less well, and its weight bends its fields
    otherwise than the design's."""

    def __post_init__(self) -> None:
        for name in ("margin", "drag", "drift"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ArgumentError(f"{name} must be finite and >= 0; got {getattr(self, name)}")
        for name in ("straight", "uneven"):
            if not 0 <= getattr(self, name) <= 1:
                raise ArgumentError(f"{name} must lie in [0, 1]; got {getattr(self, name)}")
        if not self.temperatures[0] <= self.temperatures[1]:
            raise ArgumentError(f"temperatures must rise; got {self.temperatures}")


class Drawn(NamedTuple):
    """B touches, in order of their skins."""

    signals: Singles
    """(B, C), T."""
    values: Singles
    """(B, 5): x, y, m, and Fx, Fy, Fz, N, as rubber at reference temperature would need them."""


class Turns(NamedTuple):
    """What becomes of a skin's signals as it turns, and how much of that is not known."""

    pattern: Floats
    """Covariance of the change by a radian, (C, C), T^2."""
    curvature: Floats
    """Curvature of its chips' fields, (S, 3, 3, 3), 1/T."""

    @property
    def unfollowed(self) -> Floats:
        """Covariance of what a zero has not followed, (C, C), T^2."""
        return _UNFOLLOWED**2 * self.pattern

    def missed(self, rng: np.random.Generator, signals: Singles) -> Singles:
        """What is read amiss of touches of one skin each, (skins, touches, C), T.

        A skin stands turned by a random angle, so that its weight has moved its magnets.
        """
        root = np.linalg.cholesky(self.pattern)
        moved = rng.standard_normal((len(signals), 1, len(root))) @ root.T
        read = signals.astype(np.float64)
        size = bent_amiss(self.curvature, np.broadcast_to(moved, read.shape), read)
        return (size * rng.standard_normal(signals.shape)).astype(np.float32)


class TouchSource:
    """Touches of skins of a table: of all that a design gives, or what is open of a calibrated one.

    Undoing creep takes signals to be proportional to motion. While the motion still lacks a share
    c of where it will settle, what is of order n in the force is read as if weakened by
    (1 - c)^(n - 1). The touches that a table rests on lacked a share of their own, so that c is
    drawn evenly about none, over as much as the rubber creeps (`creep`, where that is undone).

    `noise` is the covariance of the signals' noise, (C, C), T^2
    (`smoskin.sensing.signals.signals.signal_noise`); `turns` are those of a skin on an arm.
    """

    def __init__(
        self,
        table: ResponseTable,
        noise: Floats,
        spread: TouchSpread | None = None,
        creep: Prony | None = None,
        turns: Turns | None = None,
    ) -> None:
        self.table = table
        self.spread = spread or TouchSpread()
        self._creep = 0.0 if creep is None else float(creep.retardation_shares.sum())
        self._noise = noise + self.spread.drift**2 * np.eye(table.count)
        self._turns = turns
        if turns is not None:
            self._noise = self._noise + turns.unfollowed
        self._noise_root = np.linalg.cholesky(self._noise).astype(np.float32)
        # What the table misses may be nothing at all, which has no Cholesky factor.
        power, modes = np.linalg.eigh(table.misfit)
        self._misfit_root = (modes * np.sqrt(np.maximum(power, 0.0))).astype(np.float32)
        flat = table.modes.reshape(len(table.modes), table.mean.size)
        self._held = flat.any(axis=1)
        self._modes = flat[self._held].astype(np.float32)
        self._warps = table.warps
        self._mean = table.mean.ravel().astype(np.float32)
        self._warmth = table.warmth.ravel().astype(np.float32)

    def draw(self, rng: np.random.Generator, skins: int, touches: int) -> Drawn:
        """So many touches of each of so many skins."""
        # A few skins at a time: what lies between the numbers drawn and the signals is large.
        parts = [
            self._of_few_skins(rng, min(_FEW, skins - done), touches)
            for done in range(0, skins, _FEW)
        ]
        return Drawn(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def _of_few_skins(self, rng: np.random.Generator, skins: int, touches: int) -> Drawn:
        """The same, all at once."""
        table, spread = self.table, self.spread
        total = skins * touches
        where = rng.uniform(-spread.margin, table.basis.extent + spread.margin, (total, 2))
        push = self._forces(rng, total)
        warmer = rng.uniform(*spread.temperatures, (skins, 1)) - REFERENCE_TEMPERATURE
        weights = rng.standard_normal((skins, len(table.modes)), dtype=np.float32)
        coefficients = weights[:, self._held] @ self._modes + self._mean
        coefficients += warmer.astype(np.float32) * self._warmth
        settled = 1 - self._creep * rng.uniform(-0.5, 0.5, (total, 1))
        order = table.basis.exponents.sum(axis=1)
        products = table.basis.products(push)[0] * settled ** (order - 1)
        warp, modes = self._warps
        moves = table.contact.functions(where)[0].reshape(skins, touches, len(warp), 2)
        moved = np.einsum("sw,stwd->std", warp + weights @ modes, moves)
        loads = where + moved.reshape(total, 2)
        x, y = table.basis.along_x(loads[:, 0])[0], table.basis.along_y(loads[:, 1])[0]
        # What is left of differences by rounding would be multiplied down to numbers so small
        # that processors take them a hundred times slower.
        x[np.abs(x) < _NOTHING] = y[np.abs(y) < _NOTHING] = 0.0
        p, q, d = table.basis.shape
        along = x.reshape(skins, touches, p).astype(np.float32)
        along_x = along @ coefficients.reshape(skins, p, q * d * table.count)
        others = (y[:, :, None] * products[:, None, :]).reshape(total, 1, q * d)
        signals = (others.astype(np.float32) @ along_x.reshape(total, q * d, table.count))[:, 0]
        size = np.linalg.norm(push, axis=1, keepdims=True).astype(np.float32)
        for root, scale in ((self._noise_root, np.float32(1.0)), (self._misfit_root, size)):
            signals += scale * (rng.standard_normal(signals.shape, dtype=np.float32) @ root.T)
        if self._turns is not None:
            missed = self._turns.missed(rng, signals.reshape(skins, touches, -1))
            signals += missed.reshape(signals.shape)
        return Drawn(signals, np.concatenate([where, push], axis=1).astype(np.float32))

    def sha256(self) -> str:
        """Hash of everything that draws depend on."""
        table, basis = self.table, self.table.basis
        digest = hashlib.sha256(repr((table.design_hash, table.chips, self.spread)).encode())
        lines = basis.extent, basis.lines_x, basis.lines_y
        for array in (
            *lines,
            self._mean,
            self._warmth,
            self._modes,
            *self._warps,
            table.misfit,
            self._noise,
        ):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(repr((table.softening, table.forces, basis.radius, self._creep)).encode())
        return digest.hexdigest()

    def _forces(self, rng: np.random.Generator, count: int) -> Floats:
        """Forces on the skin, (B, 3), N."""
        spread, (low, high) = self.spread, self.table.forces
        push = np.zeros((count, 3))
        even = rng.uniform(low, high, count)
        uneven = np.exp(rng.uniform(np.log(low), np.log(high), count))
        push[:, 2] = -np.where(rng.uniform(0, 1, count) < spread.uneven, uneven, even)
        if spread.drag:
            drag = spread.drag * np.sqrt(rng.uniform(0, 1, count))
            drag *= rng.uniform(0, 1, count) >= spread.straight
            angle = rng.uniform(0, 2 * np.pi, count)
            push[:, 0], push[:, 1] = drag * np.cos(angle), drag * np.sin(angle)
        return push


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingEffort:
    """How large an ensemble is, and how long it learns.

    Numbers that are not positive raise an `ArgumentError`.
    """

    members: int = 4
    """Networks, each from weights of its own."""
    width: int = 64
    """Units of every hidden layer."""
    depth: int = 3
    """Hidden layers, at least two."""
    epochs: int = 60
    """Most epochs."""
    steps: int = 200
    """Steps in an epoch."""
    batch: int = 1024
    """Touches in a step."""
    touches: int = 64
    """Touches of each skin that is drawn."""
    rate: float = 1e-2
    """Rate of learning at the start; it falls to nothing along half a cosine."""
    patience: int = 12
    """Epochs without anything gained after which training ends."""
    seconds: float = np.inf
    """Time that training may take, s, over all its resumptions."""
    seed: int = 0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            least = {"seed": 0, "depth": 2}.get(field.name, 1 if field.type is int else 0)
            if not value >= least or (field.type is float and not value > 0):
                raise ArgumentError(f"{field.name} must be at least {least}; got {value}")
        if (self.steps * self.batch) % self.touches:
            raise ArgumentError(
                f"an epoch of {self.steps} x {self.batch} touches must be whole skins of "
                f"{self.touches}"
            )


class Lessons:
    """All that stays the same during a training: examples of every epoch, and where it begins.

    With `start` it goes on from a network, whose layout, sizes and weights are taken. It raises a
    `ModelError` if the start is of another design, of other chips, or knows drags where touches
    have none.
    """

    def __init__(
        self,
        design: SkinDesign,
        source: TouchSource,
        effort: TrainingEffort,
        start: NetworkModel | None = None,
    ) -> None:
        self.source, self.effort = source, effort
        self._dragged = bool(source.spread.drag)
        judges = self.held_out(0)
        if start is not None:
            self._check_start(design, start)
        learned = self._untaught(judges) if start is None else {n: getattr(start, n) for n in _KEPT}
        inputs, outputs = 3 * len(source.table.chips) + 1, 5 if self._dragged else 3
        self.model = NetworkModel(
            design_hash=design.content_hash,
            chips=source.table.chips,
            stretch=np.ones(outputs),
            whitener=np.eye(inputs),
            reach=1.0,
            forces=source.table.forces,
            drag=source.spread.drag,
            floor=_FLOOR,
            softening=source.table.softening,
            data_sha256=source.sha256(),
            split=f"skins of their own: {_SKINS} to end training, {_SKINS} for the spread, "
            f"{_SKINS} for the figures, of {_TOUCHES} touches each",
            metrics=(),
            loops=source.table.loops,
            **learned,
        )
        """The network that training starts from, without spread, reach and figures."""
        self.judges = self._examples(judges)
        """Examples, as an epoch's, on which a training is judged, and ended."""
        # A training may be given more time, or more patience, when it goes on.
        same = replace(effort, seconds=np.inf, patience=1)
        digest = hashlib.sha256(repr((source.sha256(), same)).encode())
        for layer in self.model.layers:
            digest.update(layer.weights.tobytes() + layer.bias.tobytes())
        self.key = digest.hexdigest()
        """Hash of all that a training depends on."""

    def epoch(self, number: int) -> tuple[Singles, Singles]:
        """Inputs (steps, batch, D) and targets (steps, batch, O) of one epoch, always the same."""
        effort = self.effort
        rng = np.random.default_rng([effort.seed, 1, number])
        total = effort.steps * effort.batch
        drawn = self.source.draw(rng, total // effort.touches, effort.touches)
        inputs, targets = self._examples(drawn)
        order = rng.permutation(total).reshape(effort.steps, effort.batch)
        return inputs[order], targets[order]

    def held_out(self, which: int) -> Drawn:
        """Touches of skins that no lesson holds; 0: to end training, 1: spread, 2: figures."""
        rng = np.random.default_rng([self.effort.seed, 2, which])
        return self.source.draw(rng, _SKINS, _TOUCHES)

    def standard_inputs(self, drawn: Drawn) -> Floats:
        """Inputs of touches, (B, D), centred and scaled."""
        return np.asarray((self._natural(drawn)[0] - self.model.centre) / self.model.scale)

    def _natural(self, drawn: Drawn) -> tuple[Floats, Floats]:
        """Inputs (B, D) and targets (B, O) in their own units."""
        inputs, length = direction_and_strength(drawn.signals.astype(np.float64), _FLOOR)
        values = drawn.values.astype(np.float64)
        drags = [values[:, 2:4] / length] if self._dragged else []
        targets = [values[:, :2], *drags, np.log(-values[:, 4:] / length)]
        return inputs, np.concatenate(targets, axis=1)

    def _examples(self, drawn: Drawn) -> tuple[Singles, Singles]:
        """Inputs (B, D) and targets (B, O), centred and scaled."""
        targets = (self._natural(drawn)[1] - self.model.middle) / self.model.size
        return self.standard_inputs(drawn).astype(np.float32), targets.astype(np.float32)

    def _check_start(self, design: SkinDesign, start: NetworkModel) -> None:
        """Raise unless training may go on from a network."""
        chips = self.source.table.chips
        if start.design_hash != design.content_hash or start.chips != chips:
            raise ModelError(
                f"start must be of the same design and chips {chips}; got one of "
                f"{start.design_hash[:12]} and {start.chips}"
            )
        if bool(start.drag) is not self._dragged:
            raise ModelError(f"start must know drags as the touches do; got {start.drag} N")

    def _untaught(self, drawn: Drawn) -> dict[str, Any]:
        """What a network keeps: random weights, centre and scale of inputs and targets."""
        effort = self.effort
        inputs, targets = self._natural(drawn)
        rng = np.random.default_rng([effort.seed, 0])
        outputs = targets.shape[1]
        widths = [inputs.shape[1], *[effort.width] * effort.depth, outputs * (outputs + 3) // 2]
        layers = []
        for before, after in pairwise(widths):
            weights = rng.standard_normal((effort.members, before, after)) * np.sqrt(2 / before)
            bias = np.zeros((effort.members, 1, after), np.float32)
            layers.append(Layer(weights.astype(np.float32), bias))
        # Statements begin near the middle, with a spread like the targets' own.
        layers[-1] = Layer(layers[-1].weights * np.float32(0.1), layers[-1].bias)
        of_inputs, of_targets = ((a.mean(axis=0), a.std(axis=0)) for a in (inputs, targets))
        return dict(zip(_KEPT, (tuple(layers), *of_inputs, *of_targets), strict=True))
