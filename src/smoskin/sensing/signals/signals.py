"""From readings to signals, one after the other, and how noisy these are.

Decides which readings are refused and why, what counts as a temperature, and what is taken off:
the offset, found while the skin is untouched; the creep of the rubber, undone so that a signal is
the one at which a touch that stays would settle; and the drift of the idle skin.
"""

import functools
import math
import operator
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393, sector
from smoskin.magnetics.inversion import rest_cross_talk
from smoskin.magnetics.nonlinearity import Bend, field_curvature
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, temperature_factor
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.origami.geometry import geometry
from smoskin.records import ChipFlag, Reading, Status
from smoskin.sensing.signals.settling import Settling
from smoskin.sensing.signals.zero import IdleTest, Zero, ZeroTracking

_BAD: Final = int(ChipFlag.MISSING | ChipFlag.INVALID)
_FULL: Final = int(ChipFlag.SATURATED | ChipFlag.WRAPPED)
_OLD: Final = int(ChipFlag.OLD)
_PLAUSIBLE: Final = (-40.0, 125.0)
"""The chip's operating range, degC; a report outside it is not believed."""
_THERMAL_SMOOTHING: Final = 0.05
"""Share of a new temperature in the rubber's: chips round to a fiftieth of a degree."""


class Thermometer:
    """Temperatures of S magnets and the rubber, by the chips' reports that can be true."""

    def __init__(self, chips: int) -> None:
        self._last = [math.nan] * chips
        self._rubber = math.nan

    @property
    def magnets(self) -> list[float]:
        """Last plausible report of each chip, degC; the reference temperature before it."""
        return [REFERENCE_TEMPERATURE if math.isnan(last) else last for last in self._last]

    @property
    def rubber(self) -> float:
        """Smoothed mean of the chips that reported, degC; the reference temperature until then."""
        return REFERENCE_TEMPERATURE if math.isnan(self._rubber) else self._rubber

    def step(self, reported: Floats) -> None:
        """Take in what each chip reports, (S,), degC."""
        least, most = _PLAUSIBLE
        self._last = [
            now if least < now < most else before
            for now, before in zip(reported.tolist(), self._last, strict=True)
        ]
        plausible = [last for last in self._last if not math.isnan(last)]
        if plausible:
            mean = sum(plausible) / len(plausible)
            before = mean if math.isnan(self._rubber) else self._rubber
            self._rubber = before + _THERMAL_SMOOTHING * (mean - before)


class Signal(NamedTuple):
    """One reading's signals."""

    values: Floats
    """Signals, (S, 3), T; NaN where the reading was refused."""
    temperature: float
    """Temperature of the rubber, degC."""
    status: Status | None
    """What forbids to estimate a touch from them, `NO_CONTACT` of an idle skin; None where
    nothing does."""


class Signals:
    """Signals of readings one after the other.

    A chip reads ``f(T) (B + X) + e``: the field B of its own magnet and X of the others at rest,
    weakened by f as they warm, plus an offset e of electronics and surroundings. A signal is what
    is left of B, turned as designed and at reference temperature, less what it is untouched.
    Source: SI Text S11 (5 % per 10 degC).

    Parameters
    ----------
    correction : tuple of Floats (S, 3, 3) and (S, 3), optional
        S6 of each chip: what turns and scales a field, in the skin's axes, to that of the magnet
        as designed, and what is added, T. Chips and magnets are as designed by default.
    creep : Prony, optional
        Solid of the rubber, to undo its creep; by default signals are taken as they come.
    tracking : ZeroTracking, optional
        How the zero follows drift.
    idle : IdleTest, optional
        Which signals count as those of the idle skin; by default none, and the zero stays.
    """

    def __init__(
        self,
        design: SkinDesign,
        *,
        correction: tuple[Floats, Floats] | None = None,
        creep: Prony | None = None,
        tracking: ZeroTracking | None = None,
        idle: IdleTest | None = None,
    ) -> None:
        self.rest_field = rest_field(design)
        """Field of each untouched chip's own magnet, (S, 3), T."""
        self._to_field = mlx90393.rotations(design.halls)
        # What is added to the field leaves with the cross-talk.
        self._ideal = self.rest_field + rest_cross_talk(design)
        if correction is not None:
            self._to_field = correction[0] @ self._to_field
            self._ideal = self._ideal - correction[1]
        setting = design.hall_setting
        # No chip reads more than this.
        self._limit = 1.01 * float(mlx90393.full_scale(setting).max())
        self._jump = mlx90393.full_scale(setting) if mlx90393.wraps(setting) else None
        self._tracking, self._idle = tracking or ZeroTracking(), idle
        self._settling = None if creep is None or not len(creep.times) else Settling(creep)
        self._bend = None if self._settling is None else Bend(field_curvature(design))
        self.reset()

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._zero.drift

    def reset(self) -> None:
        """Return to the design's zero and forget earlier readings."""
        self._last_time = -math.inf
        self._last_raw: Floats | None = None
        self._thermometer = Thermometer(len(self.rest_field))
        self._begin(np.zeros_like(self.rest_field))

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take the mean of these readings, made while nothing touches, as the zero.

        Raises
        ------
        ArgumentError
            If none has all chips good, or one has another number of chips than the design.
        """
        for reading in readings:
            self._check_chips(reading)
        good = [reading for reading in readings if self._fault(reading) is None]
        offsets = [self._own_field(reading) - self._ideal for reading in good]
        if not offsets:
            raise ArgumentError(
                f"readings must hold at least one with all chips good; got {len(readings)} readings"
            )
        self._begin(np.mean(offsets, axis=0))

    def step(self, reading: Reading) -> Signal:
        """Signals of the next reading; the zero follows those of an idle skin."""
        self._check_chips(reading)
        if not reading.time > self._last_time:
            return self._refused(Status.STALE)
        self._last_time = reading.time
        fault = self._fault(reading)
        if fault is not None:
            self._zero.interrupt(reading.time)
            return self._refused(fault)
        self._last_raw = reading.field
        raised = self._settled(reading.time, self._own_field(reading) - self._untouched)
        values = raised - self._zero.offset
        status = Status.NO_CONTACT if self._zero.step(reading.time, raised) else None
        if not self._zero.believed:
            status = Status.NOT_CALIBRATED
        return Signal(values, self._thermometer.rubber, status)

    def _begin(self, offset: Floats) -> None:
        """Start from an offset, (S, 3), T, of the chips turned as designed; the skin has rested."""
        # At reference temperature: nearly all of it is what a made skin's magnets differ from the
        # designed ones, which weakens as they do.
        self._untouched = self._ideal + offset
        self._zero = Zero(self._tracking, self._idle, np.zeros_like(self.rest_field))
        self._settled_time = math.inf
        if self._settling is not None:
            self._settling.reset()

    def _settled(self, time: float, raised: Floats) -> Floats:
        """Signals with creep undone."""
        if self._settling is None or self._bend is None:
            return raised
        elapsed = max(time - self._settled_time, 0.0)
        self._settled_time = time
        # Motions creep, and fields are not linear in them.
        straight = self._bend.straightened(raised)
        return self._bend.bent(self._settling.step(elapsed, straight))

    def _refused(self, status: Status) -> Signal:
        return Signal(np.full_like(self.rest_field, np.nan), self._thermometer.rubber, status)

    def _check_chips(self, reading: Reading) -> None:
        """Raise unless the reading has the design's number of chips."""
        if reading.field.shape != self.rest_field.shape:
            raise ArgumentError(
                f"reading must come from {len(self.rest_field)} chips, as the design has; "
                f"got {len(reading.field)}"
            )

    def _fault(self, reading: Reading) -> Status | None:
        """What is wrong with the reading as a measurement."""
        # Plain numbers: for nine of them NumPy takes longer to start than Python to finish.
        marks = reading.flags.tolist()
        if any(marks):
            flags = functools.reduce(operator.or_, marks)
            if flags & _BAD:
                return Status.CHIP_MISSING
            if flags & _FULL:
                return Status.SATURATED
            if flags & _OLD:
                return Status.STALE
        values = reading.field.ravel().tolist()
        if not all(abs(value) <= self._limit for value in values):
            finite = all(map(math.isfinite, values))
            return Status.SATURATED if finite else Status.CHIP_MISSING
        if self._jump is None or self._last_raw is None:
            return None
        jumped = np.abs(reading.field - self._last_raw) > self._jump
        return Status.SATURATED if jumped.any() else None

    def _own_field(self, reading: Reading) -> Floats:
        """Fields B + X + e of the chips, (S, 3), turned as designed, at reference temperature."""
        self._thermometer.step(reading.temperature)
        turned = (self._to_field @ reading.field[:, :, None])[:, :, 0]
        return np.asarray(turned / temperature_factor(self._thermometer.magnets)[:, None])


def rest_field(design: SkinDesign) -> Floats:
    """Field of each chip's own magnet at rest, in the skin's frame, (S, 3), T."""
    return np.stack(
        [
            sector.field(design.magnet(site.magnet), rest)
            for site, rest in zip(design.halls, geometry(design).rest, strict=True)
        ]
    )


def chip_noise(design: SkinDesign) -> Floats:
    """Noise of one reading along each axis of a chip, its rounding included, (3,), T."""
    setting = design.hall_setting
    return np.asarray(np.hypot(mlx90393.noise(setting), mlx90393.sensitivity(setting) / 12**0.5))


def signal_noise(design: SkinDesign, chips: Sequence[int] | None = None) -> Floats:
    """Covariance N of an untouched skin's signals, of all its chips or those chosen.

    Returns
    -------
    Floats, shape (3 S, 3 S)
        T^2: noise and rounding of the field, and rounding of the temperature by which the rest
        field is scaled.
    """
    rest = rest_field(design)
    used = range(len(rest)) if chips is None else chips
    own = np.diag(chip_noise(design) ** 2)
    step = float(mlx90393.degrees(1) - mlx90393.degrees(0))
    warm = float(temperature_factor(REFERENCE_TEMPERATURE + 1) - 1)
    noise = np.zeros((3 * len(used), 3 * len(used)))
    for row, chip in enumerate(used):
        # Chips may stand at any turn: their noise along the skin's axes.
        turn = mlx90393.rotation(design.halls[chip])
        shift = warm * rest[chip]
        part = slice(3 * row, 3 * row + 3)
        noise[part, part] = turn @ own @ turn.T + np.outer(shift, shift) * step**2 / 12
    return noise
