"""From readings to signals, one after the other, and how noisy these are.

Decides what counts as a temperature, which readings can be a zero, and what is taken off: the
offset, found while the skin is untouched; the creep of the rubber, undone so that a signal is the
one at which a touch that stays would settle; and the drift of the idle skin.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393, sector
from smoskin.magnetics.inversion import rest_cross_talk
from smoskin.magnetics.nonlinearity import field_curvature
from smoskin.magnetics.straightening import Straightening, bent_amiss
from smoskin.magnetics.temperature import REFERENCE_TEMPERATURE, temperature_factor
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.origami.geometry import geometry
from smoskin.records import Pose, Reading, Status
from smoskin.sensing.signals.guards import ChipGuard, Clock, check_chips
from smoskin.sensing.signals.idle import IdleTest
from smoskin.sensing.signals.loops import Loops, Unlooping, no_loops
from smoskin.sensing.signals.poses import Poses, Stand
from smoskin.sensing.signals.settling import Settling
from smoskin.sensing.signals.thermometer import Thermometer
from smoskin.sensing.signals.turning import Turning, turning
from smoskin.sensing.signals.zero import TouchTest, Zero, ZeroTracking

_LOUDER: Final = 3.0
"""Noise of a real chip over the one assumed, at most, where readings are said to be at rest."""
_UNLIKELY: Final = 1e-9
"""Chance of readings at rest to be refused as a zero for their noise."""
_OFF: Final = 0.5
"""Share of its magnet's rest field by which a chip of a made skin may be off the design's: a wrong
chip or axis is off by more, a touch by less than skins differ."""
LET_GO: Final = "readings must be of a skin that nothing touches: let go first"
"""Beginning of what is said to a zero under a touch."""
_AGAIN: Final = 3
"""Times that the skin that lies is found from one that does not: fields bend otherwise there."""


class Signal(NamedTuple):
    """One reading's signals."""

    values: Floats
    """Signals, (S, 3), T; NaN where the reading was refused."""
    temperature: float
    """Temperature of the rubber, degC."""
    status: Status | None
    """What forbids to estimate a touch from them, `NO_CONTACT` of an idle skin; None where
    nothing does."""


class _Zeroed(NamedTuple):
    """A zero that was taken, and whether it is known and of this skin."""

    untouched: Floats
    straightening: Straightening
    zero: Zero
    known: bool
    taken: bool
    left: Floats
    """What touches had left in the signals then, (C,), T."""
    stand: Stand | None
    """The arm's pose then, where it is known."""


class Signals:
    """Signals of readings one after the other.

    A chip reads ``f(T) (B + X) + e``: the field B of its own magnet and X of the others at rest,
    lessened by f as chip and magnets warm, plus an offset e of electronics and surroundings. A
    signal is what is left of B, turned as designed and at reference temperature, less what it is
    untouched. Source: SI Text S11 (5 % per 10 degC).

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
    zeroed : bool
        Whether the design, or the correction, holds the zero; else it is unknown until `zero`.
    chips : sequence of int, optional
        Chips whose zero is followed, all by default; the others' stays.
    left : Floats, shape (C, C), optional
        Covariance of what a touch leaves in their signals, T^2.
    loops : Loops, optional
        Hysteresis of their signals, which is undone.
    touched : TouchTest, optional
        Decision between a touch, by its signals, and a turn, as `Zero` takes it.
    """

    def __init__(
        self,
        design: SkinDesign,
        *,
        correction: tuple[Floats, Floats] | None = None,
        creep: Prony | None = None,
        tracking: ZeroTracking | None = None,
        idle: IdleTest | None = None,
        zeroed: bool = True,
        chips: Sequence[int] | None = None,
        left: Floats | None = None,
        loops: Loops | None = None,
        touched: TouchTest | None = None,
    ) -> None:
        self.rest_field = rest_field(design)
        """Field of each untouched chip's own magnet, (S, 3), T."""
        self._to_field = mlx90393.rotations(design.halls)
        # What is added to the field leaves with the cross-talk.
        self._designed = self.rest_field + rest_cross_talk(design)
        self._ideal = self._designed
        if correction is not None:
            self._to_field = correction[0] @ self._to_field
            self._ideal = self._designed - correction[1]
        self._guard = ChipGuard(range(len(self.rest_field)), design.hall_setting)
        self._precision = np.linalg.inv(signal_noise(design))
        self._given = zeroed
        self._tracking, self._idle = tracking or ZeroTracking(), idle
        self._settling = None if creep is None or not len(creep.times) else Settling(creep)
        self._chips = list(range(len(self.rest_field)) if chips is None else chips)
        self._design = design
        self._curvature = field_curvature(design)[self._chips]
        prompt = 1.0 if creep is None else 1 - float(creep.retardation_shares.sum())
        self.noise = signal_noise(design, self._chips) / prompt**2
        """Covariance N of these chips' signals untouched, (C, C), T^2: undoing creep raises what
        changes from reading to reading by what is missing of a prompt answer."""
        self._turning: Turning | None = turning(design, self._chips, weight=self._tracking.arm)
        self._poses: Poses | None = None
        self._left = np.zeros_like(self.noise) if left is None else left
        self._touched = touched
        self._looped = loops is not None
        self._unlooping = Unlooping(loops or no_loops(len(self.noise)))
        self.reset()

    def carried_by(self, pose: Callable[[], Pose]) -> None:
        """Know from here on how an arm holds the skin at the newest reading; begin anew."""
        self._tracking, self._turning = replace(self._tracking, arm=True), None
        self._poses = Poses(self._design, self._chips, self.noise, pose)
        self.reset()

    @property
    def drift(self) -> Floats:
        """How far the zero has followed since it was set, known poses apart, shape (S, 3), T."""
        return self._of_all(self._zero.drift)

    @property
    def followed(self) -> Zero:
        """The zero of the chips' signals as if fields were linear in motion."""
        return self._zero

    @property
    def rest(self) -> Floats:
        """Field of each chip's own magnet untouched, turned and scaled by S6 alone, (S, 3), T."""
        return np.asarray(
            self.rest_field + (self._untouched - self._designed) + self._zero.offset.reshape(-1, 3)
        )

    @property
    def temperature(self) -> float:
        """Temperature of the rubber, degC."""
        return self._thermometer.rubber

    def bent_amiss(self, signals: Floats) -> Floats:
        """Covariance (C, C), T^2, of what signals (C,) hold that the design's curvature does not.

        A skin's weight moves magnets over chips as far as touches do, and made skins' fields bend
        otherwise than the designed ones.
        """
        if not self._tracking.arm:
            return np.zeros_like(self.noise)
        felt = self.straightening.straightened(self._of_all(signals))[self._chips].ravel()
        moved = self._zero.drift
        if self._poses is not None:
            moved = moved + self._poses.stand.sunk + self._poses.moved
        return np.diag(bent_amiss(self._curvature, moved, felt) ** 2)

    def reset(self) -> None:
        """Return to the zero of the start and forget earlier readings."""
        self.clock = Clock()
        self._time: float | None = None
        if self._poses is not None:
            self._poses.forget()
        self._guard.forget()
        self._thermometer = Thermometer(len(self.rest_field))
        self.zeroed = self._given
        """Whether the zero is known."""
        self.taken = False
        """Whether the zero was taken from readings of this skin."""
        self._before: _Zeroed | None = None
        self._unlooping.reset()
        self._begin(np.zeros_like(self.rest_field))

    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Take the mean of these readings, made while nothing touches, as the zero.

        With `force` they need not be at rest, nor near the design's rest field.

        Raises
        ------
        ArgumentError
            If none has all chips good, one has another number of chips than the design, they move
            among themselves by more than noise, or they are not of a skin of this design.
        """
        offsets = self._offsets(readings)
        mean = np.mean(offsets, axis=0)
        if not force:
            self._check_rest(offsets - mean)
            size = np.sqrt((self.rest_field**2).sum(axis=1))
            if (np.sqrt((mean * mean).sum(axis=1)) > _OFF * size).any():
                raise ArgumentError(
                    "readings must be near the design's rest field, each chip over its own magnet; "
                    f"got chips off by {np.abs(mean).max(axis=1) * 1e3} mT"
                )
        self._before = _Zeroed(
            self._untouched,
            self.straightening,
            self._zero,
            self.zeroed,
            self.taken,
            self._unlooping.offset,
            None if self._poses is None else self._poses.stand,
        )
        self._unlooping.zero()
        self._begin(mean)
        self.zeroed = self.taken = True

    def unzero(self) -> None:
        """Return to the zero before the last; `ArgumentError` if there is none."""
        if self._before is None:
            raise ArgumentError("zero must have been set, once for each time it is taken back")
        before, self._before = self._before, None
        self._untouched, self.straightening, self._zero = before[:3]
        self.zeroed, self.taken, self._unlooping.offset = before[3:6]
        if self._poses is not None:
            self._poses.begin(before.stand)
        self._rest()

    def change(self, readings: Sequence[Reading]) -> Floats:
        """Mean of these readings against the present zero, (S, 3), T; errors are those of `zero`.

        Creep is not undone.
        """
        mean = np.mean(self._offsets(readings), axis=0)
        return self._less_zero(self._straight(mean + self._ideal))

    def step(self, reading: Reading) -> Signal:
        """Signals of the next reading; the zero follows those of an idle skin."""
        check_chips(reading, len(self.rest_field), "design")
        if self.clock.stale(reading.time):
            if self.clock.anew:
                self._rest()
            return self._refused(Status.STALE)
        fault = self._guard.step(reading)
        if fault is not None:
            self._zero.interrupt(reading.time)
            return self._refused(fault)
        field, elapsed = self._own_field(reading), self._elapsed(reading.time)
        if self._poses is not None:
            self._poses.step(elapsed)
        raised = self._settled(elapsed, self._straight(field))
        status: Status | None = Status.NOT_CALIBRATED
        if self.zeroed:
            if self._looped:
                self._zero.left = self._left + self._unlooping.covariance
            idle = self._idles(reading.time, raised[self._chips].ravel())
            if idle and self._zero.settled:
                self._unlooping.rest()
            if self._zero.believed:
                status = Status.NO_CONTACT if idle else None
        return Signal(self._less_zero(raised), self._thermometer.rubber, status)

    def _idles(self, time: float, linear: Floats) -> bool:
        """Whether linear signals (C,), T, are an idle skin's; zero and poses follow them."""
        if (poses := self._poses) is None:
            return self._zero.step(time, linear)
        self._zero.carried(poses.covariance, poses.jolted)
        idle = self._zero.step(time, linear - poses.moved)
        if idle:
            poses.learn(linear)
        return idle

    def _likelier_touched(self, change: Floats, density: float) -> bool:
        """Whether a change (C,), T, of linear signals is likelier a touch's than a turn's."""
        signals = self.straightening.bent(self._of_all(change))[self._chips].ravel()
        return self._touched is not None and self._touched(signals, density)

    def _begin(self, offset: Floats) -> None:
        """Start from an offset, (S, 3), T, of the chips turned as designed; the skin has rested."""
        # At reference temperature: nearly all of it is what a made skin's magnets differ from the
        # designed ones, which weakens as they do.
        self._untouched = self._ideal + offset
        self.straightening = self._of_lying()
        """Signals that are linear in motion, of this skin as its zero has it, and back."""
        if self._poses is not None:
            self._poses.begin()
            sunk = self._of_all(self._poses.stand.sunk)
            for _ in range(_AGAIN if sunk.any() else 0):
                self._untouched = self._ideal + offset - self.straightening.bent(sunk)
                self.straightening = self._of_lying()
        self._zero = Zero(
            self._tracking,
            self._idle,
            np.zeros(len(self.noise)),
            self.noise,
            turning=self._turning,
            left=self._left,
            touched=self._touched and self._likelier_touched,
        )
        self._rest()

    def _of_lying(self) -> Straightening:
        """Signals linear in motion of the skin that lies, as it is taken to read then."""
        return Straightening(self._design, self.rest_field + self._untouched - self._designed)

    def _rest(self) -> None:
        """Begin with no past, as after a long rest; the zero stays."""
        self._zero.rest()
        self._guard.forget()
        self._time = None
        if self._settling is not None:
            self._settling.reset()

    def _offsets(self, readings: Sequence[Reading]) -> Floats:
        """Fields of the good ones of these readings less the design's, (N, S, 3), T."""
        for reading in readings:
            check_chips(reading, len(self.rest_field), "design")
        good = [reading for reading in readings if self._guard.bad(reading) is None]
        if not good:
            raise ArgumentError(
                f"readings must hold at least one with all chips good; got {len(readings)} readings"
            )
        return np.stack([self._own_field(reading) - self._ideal for reading in good])

    def _check_rest(self, deviations: Floats) -> None:
        """Raise unless noise explains deviations (N, S, 3), T, of readings from their mean."""
        from scipy.special import chdtri  # so that whoever imports the package does not wait

        flat = deviations.reshape(len(deviations), -1)
        freedom = (len(flat) - 1) * flat.shape[1]
        moved = float(np.einsum("bi,ij,bj->", flat, self._precision, flat)) / _LOUDER**2
        if freedom and moved > chdtri(freedom, _UNLIKELY):
            rms = 1e6 * np.sqrt((flat**2).mean())
            raise ArgumentError(f"{LET_GO}; got readings that move by {rms:.3g} uT")

    def _elapsed(self, time: float) -> float:
        """Seconds since the last reading that was good."""
        before, self._time = self._time, time
        return 0.0 if before is None else max(time - before, 0.0)

    def _straight(self, field: Floats) -> Floats:
        """Signals (S, 3), T, of fields as if these were linear in motions, from those of the zero.

        What the Earth's field changes moves nothing.
        """
        raised = field - self._untouched
        if (poses := self._poses) is None:
            return self.straightening.straightened(raised)
        straight = self.straightening.straightened(raised - self._of_all(poses.even))
        return straight - self._of_all(poses.stand.sunk)

    def _settled(self, elapsed: float, straight: Floats) -> Floats:
        """Linear signals so many seconds after the last, with creep and hysteresis undone."""
        if self._settling is not None:
            straight = self._settling.step(elapsed, straight)
        if not self._looped:
            return straight
        elastic = straight.copy()
        used = self._unlooping.step(straight[self._chips].ravel())
        elastic[self._chips] = used.reshape(-1, 3)
        return elastic

    def _less_zero(self, straight: Floats) -> Floats:
        """Signals (S, 3), T, of straight ones less the zero: motions add up, fields do not."""
        offset = self._zero.offset
        if self._poses is not None:
            offset = offset + self._poses.moved
        return self.straightening.bent(straight - self._of_all(offset))

    def _of_all(self, used: Floats) -> Floats:
        """Numbers (C,) of the chips that are used, 0 of others, (S, 3)."""
        whole = np.zeros_like(self.rest_field)
        whole[self._chips] = used.reshape(-1, 3)
        return whole

    def _refused(self, status: Status) -> Signal:
        return Signal(np.full_like(self.rest_field, np.nan), self._thermometer.rubber, status)

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
