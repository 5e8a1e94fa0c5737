"""From readings to the signals that response tables speak of, and how noisy these are.

A signal is what a chip reads, turned as designed, at reference temperature, less what it reads
untouched. Decides what is taken off a conditioned reading: the drift of the untouched skin, which
is followed while nothing touches, and the creep of the rubber, which is undone so that a signal
is the one at which a touch that stays would settle. Hides the memory that both need.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics import mlx90393, sector
from smoskin.magnetics.inversion import FieldInverse, rest_cross_talk
from smoskin.magnetics.nonlinearity import bent, field_curvature, straightened
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, temperature_factor
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.origami.layout import chip_offset
from smoskin.records import Reading, Status
from smoskin.sensing.signals.conditioning import Conditioner, ZeroTracking

FOLLOWING: Final = ZeroTracking(hold=0.2, time_constant=2.0)
"""How fast a zero usually follows drift while nothing touches."""
_THERMAL_SMOOTHING: Final = 0.05
"""Share of a new temperature in the rubber's: chips round to a fiftieth of a degree."""


class Signal(NamedTuple):
    """One reading's signals."""

    values: Floats
    """(S, 3), T."""
    temperature: float
    """degC, of the rubber as the chips report it."""
    status: Status | None
    """What forbids to use them; None where nothing does."""


class Settling:
    """Undoes creep: from a creeping response to the elastic one behind it.

    Parameters
    ----------
    prony : Prony
        Of the elastomer.

    Notes
    -----
    With u the creeping and r the elastic response, u = (1 - sum c_k) r + sum c_k y_k and
    dy_k/dt = (r - y_k) / lambda_k, exact for r that changes evenly between steps: the inverse of
    `smoskin.mechanics.viscoelasticity.Memory`. Valid for responses that are proportional to
    motion, as fields freed of their curvature are to second order.

    Examples
    --------
    >>> from smoskin.mechanics.viscoelasticity import Memory
    >>> prony = Prony(moduli=[0.2], times=[1.0])
    >>> memory, settling = Memory(prony, 0.0), Settling(prony)
    >>> [round(float(settling.step(dt, memory.step(dt, r))), 9) for dt, r in ((0.1, 2.0), (1.0, 3))]
    [2.0, 3.0]
    """

    def __init__(self, prony: Prony) -> None:
        self._rates = 1 / prony.retardation_times
        self._shares = prony.retardation_shares
        self._prompt = float(1 - self._shares.sum())
        self._late: Floats | None = None
        self._last: Floats = np.zeros(())

    def reset(self) -> None:
        """Forget: the skin has rested untouched."""
        self._late = None

    def step(self, duration: float, response: Floats) -> Floats:
        """The elastic response, so many seconds after the last one."""
        if self._late is None:
            self._late = np.zeros((len(self._rates), *np.shape(response)))
            self._last = np.zeros(np.shape(response))
        part = self._rates * max(duration, 0.0)
        kept = np.exp(-part)
        mean = np.divide(-np.expm1(-part), part, out=np.ones_like(part), where=part > 0)
        before, after = mean - kept, 1 - mean
        wide = (slice(None),) + (None,) * np.ndim(response)
        moved = kept[wide] * self._late + before[wide] * self._last
        crept = np.tensordot(self._shares, moved, 1)
        elastic = (response - crept) / (self._prompt + float(self._shares @ after))
        self._late = moved + after[wide] * elastic
        self._last = elastic
        return np.asarray(elastic)


class Signals:
    """Signals of readings one after the other.

    Parameters
    ----------
    design : SkinDesign
    creep : Prony, optional
        Of the rubber, to undo its creep; by default signals are taken as they come.
    tracking : ZeroTracking, optional
        How fast and how far the untouched skin's drift is followed.
    """

    def __init__(
        self,
        design: SkinDesign,
        *,
        creep: Prony | None = None,
        tracking: ZeroTracking | None = None,
    ) -> None:
        self._tracking = tracking or ZeroTracking()
        self._rest = FieldInverse(design).rest_field
        # The drift is followed here, where creep is undone first.
        still = ZeroTracking(time_constant=np.inf)
        self._conditioner = Conditioner(design, self._rest, rest_cross_talk(design), tracking=still)
        self._settling = None if creep is None else Settling(creep)
        self._curvature = field_curvature(design)
        self._drift: Floats = np.zeros_like(self._rest)
        self._last: Floats = self._drift
        self._elapsed, self._temperature = 0.0, np.nan
        self._time, self._idle_since = -np.inf, -np.inf

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return np.array(self._drift)

    def reset(self) -> None:
        """Return to the design's zero and forget earlier readings."""
        self._conditioner.reset()
        self._forget()

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take the mean of these readings of the untouched skin as its zero.

        Raises
        ------
        ArgumentError
            As `Conditioner.zero`.
        """
        self._conditioner.zero(readings)
        self._forget()

    def step(self, reading: Reading) -> Signal:
        """Signals of the next reading.

        Raises
        ------
        ArgumentError
            If it has another number of chips than the design.
        """
        conditioned = self._conditioner.step(reading)
        status = conditioned.status
        if status is not None and status is not Status.NO_CONTACT:
            return Signal(self._last - self._drift, self._degrees, status)
        values = conditioned.field - self._rest
        elapsed = reading.time - self._time if np.isfinite(self._time) else 0.0
        self._time = reading.time
        if self._settling is not None:
            # Motions creep, and fields are not linear in them.
            straight = straightened(self._curvature, values)
            settled = self._settling.step(elapsed, straight)
            values = bent(self._curvature, settled)
        self._elapsed = elapsed
        self._last = values
        warmths = reading.temperature[np.isfinite(reading.temperature)]
        if len(warmths):
            now = float(warmths.mean())
            before = self._temperature if np.isfinite(self._temperature) else now
            self._temperature = before + _THERMAL_SMOOTHING * (now - before)
        drifted = np.abs(self._drift).max() > self._tracking.drift_bound
        status = Status.NOT_CALIBRATED if drifted else None
        return Signal(values - self._drift, self._degrees, status)

    @property
    def _degrees(self) -> float:
        """Of the rubber; at reference where no chip has said."""
        return self._temperature if np.isfinite(self._temperature) else REFERENCE_TEMPERATURE

    def follow(self) -> None:
        """Let the zero follow the last reading: nothing touched the skin in it."""
        if not np.isfinite(self._idle_since):
            self._idle_since = self._time
        if self._time - self._idle_since >= self._tracking.hold:
            share = -np.expm1(-self._elapsed / self._tracking.time_constant)
            self._drift = self._drift + share * (self._last - self._drift)

    def touched(self) -> None:
        """Something touched the skin in the last reading: the zero stays."""
        self._idle_since = -np.inf

    def _forget(self) -> None:
        self._drift, self._last = np.zeros_like(self._rest), np.zeros_like(self._rest)
        self._time = self._idle_since = -np.inf
        self._elapsed = 0.0
        self._temperature = np.nan
        if self._settling is not None:
            self._settling.reset()


def signal_noise(design: SkinDesign, chips: Sequence[int] | None = None) -> Floats:
    """Covariance of an untouched skin's signals.

    Parameters
    ----------
    design : SkinDesign
    chips : sequence of int, optional
        Which of its chips; all by default.

    Returns
    -------
    Floats, shape (3 S, 3 S)
        T^2: noise and rounding of the field, and rounding of the temperature by which the rest
        field is scaled.
    """
    setting = design.hall_setting
    # Of each chip's own magnet, by which `Signals` scales.
    rest = np.stack(
        [
            sector.field(design.magnet(site.magnet), [0.0, 0.0, chip_offset(design, site)])
            for site in design.halls
        ]
    )
    used = range(len(rest)) if chips is None else chips
    own = mlx90393.noise(setting) ** 2 + mlx90393.sensitivity(setting) ** 2 / 12
    step = float(mlx90393.degrees(1) - mlx90393.degrees(0))
    warm = float(temperature_factor(REFERENCE_TEMPERATURE + 1) - 1)
    noise = np.zeros((3 * len(used), 3 * len(used)))
    for row, chip in enumerate(used):
        # Chips may stand at any turn: their noise along the skin's axes.
        turn = mlx90393.rotation(design.halls[chip])
        shift = warm * rest[chip]
        part = slice(3 * row, 3 * row + 3)
        noise[part, part] = turn @ np.diag(own) @ turn.T + np.outer(shift, shift) * step**2 / 12
    return noise
