"""Touches for networks to learn from, drawn from a response table as often as one likes.

Every draw is another skin: the table's modes with random weights, at a random temperature, with
all that spoils a reading (what the table misses, the chips' noise, drift, the creep that undoing
it leaves). A table of a design gives all skins made of it; one calibrated to a skin gives what is
still open of that skin. Decides how touches and disturbances are spread; needs NumPy alone.
"""

import hashlib
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.sensing.response.table import ResponseTable

Singles: TypeAlias = NDArray[np.float32]

_FEW: Final = 16
"""Skins whose touches are laid out at once."""
_NOTHING: Final = 1e-9
"""Share of a vertex in a touch that is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchSpread:
    """How touches and what spoils them are spread.

    Raises
    ------
    ArgumentError
        If a number is negative, or a range does not rise.
    """

    margin: float = 2.5e-3
    """m: how far past the rim places are drawn, so that the rim itself is not the limit of all
    that was ever seen."""
    drag: float = 0.0
    """N: largest drag, of any direction, evenly spread; 0: touches are straight."""
    straight: float = 0.4
    """Share of touches without drag, where others have one."""
    uneven: float = 0.5
    """Share of normal forces that are even in their logarithm; the others are even."""
    temperatures: tuple[float, float] = (15.0, 35.0)
    """degC, from and to, even."""
    drift: float = 0.5e-6
    """T: standard deviation on each axis of the zero that has not been followed."""

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


class TouchSource:
    """Touches of skins of a table.

    Parameters
    ----------
    table : ResponseTable
    noise : Floats, shape (C, C)
        T^2: covariance of the signals' noise (`smoskin.sensing.signals.signals.signal_noise`).
    spread : TouchSpread, optional
    creep : Prony, optional
        Of the rubber, where the estimator undoes its creep: what that leaves is drawn too.

    Notes
    -----
    Undoing creep takes signals to be proportional to motion. While the motion still lacks a share
    c of where it will settle, what is of order n in the force is read as if weakened by
    (1 - c)^(n - 1). The touches that a table rests on lacked a share of their own, so that c is
    drawn evenly about none, over as much as the rubber creeps.
    """

    def __init__(
        self,
        table: ResponseTable,
        noise: Floats,
        spread: TouchSpread | None = None,
        creep: Prony | None = None,
    ) -> None:
        self.table = table
        self.spread = spread or TouchSpread()
        self._creep = 0.0 if creep is None else float(creep.retardation_shares.sum())
        self._noise = noise + self.spread.drift**2 * np.eye(table.count)
        self._noise_root = np.linalg.cholesky(self._noise).astype(np.float32)
        # What the table misses may be nothing at all, which has no Cholesky factor.
        power, ways = np.linalg.eigh(table.misfit)
        self._misfit_root = (ways * np.sqrt(np.maximum(power, 0.0))).astype(np.float32)
        flat = len(table.modes), table.mean.size
        self._modes = table.modes.reshape(flat).astype(np.float32)
        self._mean, self._warmth = (
            one.ravel().astype(np.float32) for one in (table.mean, table.warmth)
        )

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
        coefficients = weights @ self._modes + self._mean
        coefficients += warmer.astype(np.float32) * self._warmth
        settled = 1 - self._creep * rng.uniform(-0.5, 0.5, (total, 1))
        order = table.basis.exponents.sum(axis=1)
        products = table.basis.products(push)[0] * settled ** (order - 1)
        x, y = table.basis.along_x(where[:, 0])[0], table.basis.along_y(where[:, 1])[0]
        # What is left of differences by rounding would be multiplied down to numbers so small
        # that processors take them a hundred times slower.
        x[np.abs(x) < _NOTHING] = y[np.abs(y) < _NOTHING] = 0.0
        p, q, d = table.basis.shape
        along = x.reshape(skins, touches, p).astype(np.float32)
        held = along @ coefficients.reshape(skins, p, q * d * table.count)
        others = (y[:, :, None] * products[:, None, :]).reshape(total, 1, q * d)
        signals = (others.astype(np.float32) @ held.reshape(total, q * d, table.count))[:, 0]
        size = np.linalg.norm(push, axis=1, keepdims=True).astype(np.float32)
        for root, scale in ((self._noise_root, np.float32(1.0)), (self._misfit_root, size)):
            signals += scale * (rng.standard_normal(signals.shape, dtype=np.float32) @ root.T)
        return Drawn(signals, np.concatenate([where, push], axis=1).astype(np.float32))

    def sha256(self) -> str:
        """Hash of everything that draws depend on."""
        table = self.table
        digest = hashlib.sha256(repr((table.design_hash, table.chips, self.spread)).encode())
        lines = table.basis.extent, table.basis.lines_x, table.basis.lines_y
        for array in (*lines, self._mean, self._warmth, self._modes, table.misfit, self._noise):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(
            repr((table.softening, table.forces, table.basis.radius, self._creep)).encode()
        )
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
