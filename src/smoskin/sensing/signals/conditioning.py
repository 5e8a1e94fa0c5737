"""From what chips read to their magnets' field alone: zero, temperature, and what to distrust.

A chip reads ``f(T) (B + X) + e``: the field B of its own magnet and X of the others at rest,
weakened by f as they warm, plus an offset e of electronics and surroundings. A calibration turns
what a chip says, as it is mounted, and scales it to the magnet as designed (S6). The zero is the
offset found while the skin is untouched; it is followed slowly while the skin stays idle, up to
a bound past which the zero is no longer believed. What counts as idle widens for a while with the
time that nothing did, so that a zero that moved under a touch is found again. Source: SI Text S11
(5 % per 10 degC).
"""

import functools
import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, temperature_factor
from smoskin.records import ChipFlag, Reading, Status

_BAD = int(ChipFlag.MISSING | ChipFlag.INVALID)
_FULL = int(ChipFlag.SATURATED | ChipFlag.WRAPPED)
_OLD = int(ChipFlag.OLD)
_PLAUSIBLE = (-40.0, 125.0)
"""degC: the chip's operating range; a report outside it is not believed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroTracking:
    """How the zero follows the sensor while nothing touches it."""

    idle_field: float = 40e-6
    """T: a change below this on every axis counts as idle."""
    widening_rate: float = 1e-6
    """T/s that are added to it while nothing is idle: drift and recovery move the zero unseen."""
    widening_limit: float = 40e-6
    """T that are added to it at most; a steady touch fainter than the sum is taken for the zero."""
    hold: float = 1.0
    """s of idleness before the zero starts to follow."""
    time_constant: float = 10.0
    """s, of the exponential mean that the zero follows with; `inf` keeps it still."""
    drift_bound: float = 500e-6
    """T: the zero is no longer believed once it has moved this far."""

    def __post_init__(self) -> None:
        for name in ("idle_field", "time_constant", "drift_bound"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive; got {getattr(self, name)}")
        if not self.hold >= 0:
            raise ArgumentError(f"hold must be >= 0 s; got {self.hold}")
        for name in ("widening_rate", "widening_limit"):
            if not getattr(self, name) >= 0:
                raise ArgumentError(f"{name} must be >= 0; got {getattr(self, name)}")


class IdleZero:
    """An offset that follows what is read while nothing touches.

    Parameters
    ----------
    tracking : ZeroTracking
    offset : Floats, any shape
        T: the zero to start from.

    Examples
    --------
    >>> zero = IdleZero(ZeroTracking(hold=0.0, time_constant=1.0), np.zeros(3))
    >>> [zero.step(float(t), np.full(3, 2e-5)) for t in range(9)] == [True] * 9
    True
    >>> bool(np.allclose(zero.offset, 2e-5, rtol=1e-3))
    True
    """

    def __init__(self, tracking: ZeroTracking, offset: Floats) -> None:
        self.tracking = tracking
        self.offset = offset
        """T, the present zero."""
        self.believed = True
        """Whether it has stayed within its bound."""
        self._start = offset
        self._widening = 0.0
        self._last_time: float | None = None
        self._idle_since: float | None = None

    @property
    def drift(self) -> Floats:
        """How far it has moved since the start, T."""
        return np.asarray(self.offset - self._start)

    def step(self, time: float, read: Floats) -> bool:
        """Whether a reading, in T, is idle; the zero follows it once idleness has held."""
        elapsed = self._elapsed(time)
        tracking = self.tracking
        band = tracking.idle_field + self._widening
        # Plain numbers: for nine of them NumPy takes longer to start than Python to finish.
        if not all(abs(change) < band for change in (read - self.offset).ravel().tolist()):
            self._lose(elapsed)
            return False
        if self._idle_since is None:
            self._idle_since = time
        if time - self._idle_since >= tracking.hold:
            kept = math.exp(-elapsed / tracking.time_constant)
            self.offset = read + kept * (self.offset - read)
            # At the zero's own pace: sooner, and the zero would run out of the band.
            self._widening *= kept
            self.believed = float(np.abs(self.drift).max()) <= tracking.drift_bound
        return True

    def interrupt(self, time: float) -> None:
        """A reading came that cannot be believed: idleness has to hold anew."""
        self._lose(self._elapsed(time))

    def _elapsed(self, time: float) -> float:
        """Seconds since the last reading of any kind."""
        elapsed = 0.0 if self._last_time is None else time - self._last_time
        self._last_time = time
        return elapsed

    def _lose(self, elapsed: float) -> None:
        """Widen what counts as idle: nothing did, and the zero may move unseen."""
        self._idle_since = None
        if self.tracking.time_constant < math.inf:
            wider = self._widening + self.tracking.widening_rate * elapsed
            self._widening = min(wider, self.tracking.widening_limit)


class ChipCalibration(Protocol):
    """What a calibration knows of the chips of one skin."""

    @property
    def chip_rotation(self) -> ArrayLike:
        """Rotation vector of each chip against its design, (S, 3), rad."""

    @property
    def field_factor(self) -> ArrayLike:
        """Field of the designed magnet over that of the made one, (S,)."""

    @property
    def field_offset(self) -> ArrayLike:
        """Field that is added at each chip, (S, 3), T."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Conditioned:
    """One reading made ready for the models."""

    field: Floats
    """(S, 3), T: of the magnets, at reference temperature, in the skin's frame."""
    status: Status | None
    """What forbids an estimate; None where nothing does."""


class Conditioner:
    """Conditions readings one after the other.

    Parameters
    ----------
    design : SkinDesign
    rest_field : Floats, shape (S, 3)
        T: of each untouched chip's own magnet, in the skin's frame.
    cross_talk : Floats, shape (S, 3)
        T: of all other magnets there at rest, likewise.
    calibration : ChipCalibration, optional
        Of how the chips are turned and their magnets' strength; as designed by default.
    tracking : ZeroTracking, optional
        How the zero follows drift.
    """

    def __init__(
        self,
        design: SkinDesign,
        rest_field: Floats,
        cross_talk: Floats,
        *,
        calibration: ChipCalibration | None = None,
        tracking: ZeroTracking | None = None,
    ) -> None:
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.spatial.transform import Rotation

        self.tracking = tracking or ZeroTracking()
        # Turn and factor in one; what is added to the field leaves with the cross-talk.
        self._to_field = mlx90393.rotations(design.halls)
        self._cross_talk = cross_talk
        if calibration is not None:
            turns = Rotation.from_rotvec(np.array(calibration.chip_rotation)).as_matrix()
            factor = np.array(calibration.field_factor)[:, None, None]
            self._to_field = factor * turns @ self._to_field
            self._cross_talk = cross_talk - np.array(calibration.field_offset)
        self._rest = rest_field
        setting = design.hall_setting
        self._limit = 1.01 * float(
            mlx90393.full_scale(setting).max()
        )  # no chip says more than this
        self._jump = mlx90393.full_scale(setting) if mlx90393.wraps(setting) else None
        self.reset()

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, shape (S, 3), T."""
        return self._zero.drift

    def reset(self) -> None:
        """Return to the design's zero and forget earlier readings."""
        self._zero = IdleZero(self.tracking, np.zeros_like(self._rest))
        self._last_time = -np.inf
        self._last_raw: Floats | None = None
        self._last_degrees = [REFERENCE_TEMPERATURE] * len(self._rest)

    def zero(self, readings: Sequence[Reading]) -> None:
        """Take the mean of these readings, made while nothing touches, as the zero.

        Raises
        ------
        ArgumentError
            If there are none, or none in which all chips answered within their range, or one has
            another number of chips than the design.
        """
        for reading in readings:
            self._check_chips(reading)
        good = [r for r in readings if self._fault(r) is None]
        if not good:
            raise ArgumentError(
                f"readings must hold at least one with all chips good; got {len(readings)} readings"
            )
        offsets = [
            self._in_skin(r.field) - self._factors(r.temperature) * (self._rest + self._cross_talk)
            for r in good
        ]
        self._zero = IdleZero(self.tracking, np.mean(offsets, axis=0))

    def step(self, reading: Reading) -> Conditioned:
        """Condition the next reading.

        Raises
        ------
        ArgumentError
            If it has another number of chips than the design.
        """
        self._check_chips(reading)
        stale = not reading.time > self._last_time
        status = Status.STALE if stale else self._fault(reading)
        if stale:
            return Conditioned(field=self._rest, status=status)
        self._last_time = reading.time
        if status is not None:
            self._zero.interrupt(reading.time)
            return Conditioned(field=self._rest, status=status)
        self._last_raw = reading.field
        seen = self._in_skin(reading.field)
        factors = self._factors(reading.temperature)
        field = (seen - self._zero.offset) / factors - self._cross_talk
        if self._zero.step(reading.time, seen - factors * (self._rest + self._cross_talk)):
            status = Status.NO_CONTACT
        if not self._zero.believed:
            status = Status.NOT_CALIBRATED
        return Conditioned(field=field, status=status)

    def _check_chips(self, reading: Reading) -> None:
        """Raise unless the reading has the design's number of chips."""
        if reading.field.shape != self._rest.shape:
            raise ArgumentError(
                f"reading must come from {len(self._rest)} chips, as the design has; "
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
        if self._jump is not None and self._last_raw is not None:
            jumped = np.abs(reading.field - self._last_raw) > self._jump
            if jumped.any():
                return Status.SATURATED
        return None

    def _in_skin(self, field: Floats) -> Floats:
        """A chip's words as the designed magnet's field in the skin's axes."""
        return np.asarray((self._to_field @ field[:, :, None])[:, :, 0])

    def _factors(self, temperature: Floats) -> Floats:
        """f(T) of each chip's magnet, (S, 1); a report that cannot be is the last good one."""
        least, most = _PLAUSIBLE
        self._last_degrees = [
            now if least < now < most else before
            for now, before in zip(temperature.tolist(), self._last_degrees, strict=True)
        ]
        return temperature_factor(self._last_degrees)[:, None]
