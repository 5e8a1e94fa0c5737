"""What a skin reads untouched at every pose of its arm, learned while nothing touches it.

Decides that whoever knows how the arm holds the skin need not guess how it turns: the Earth's field
and the skin's weight are taken off each reading before it is estimated. Hides the least squares.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.magnetics import mlx90393
from smoskin.magnetics.inversion import rest_cross_talk
from smoskin.magnetics.straightening import Straightening
from smoskin.magnetics.temperature import temperature_factor
from smoskin.mechanics.viscoelasticity import Memory, elastomer_prony
from smoskin.mechanics.weight import GRAVITY, sags
from smoskin.origami.geometry import geometry
from smoskin.records import Estimate, Pose, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.signals.settling import Settling
from smoskin.sensing.signals.signals import Thermometer, rest_field, signal_noise
from smoskin.sensing.signals.turning import change_by_weight

_EARTH: Final = 40e-6
"""Spread of the Earth's field along each axis of the room, T."""
_UNLIKE: Final = 0.3
"""Share of a chip's change by weight in which a made skin differs from the designed one."""
_WANDERS: Final = 0.5e-6
"""Random walk of all else in a second, T."""
_BENDS: Final = (10e-6, 1e-3)
"""Random walk of all else, T, over so much that poses change, T: made skins are not linear."""
_MISSED: Final = 1e-3
"""Chance of a reading of an untouched skin not to be taken for one by what is not known of it."""
_JOLT: Final = 0.02
"""What is not known of the skin's acceleration, at least, m/s^2."""
_LONGEST: Final = 10.0
"""Longest time that counts between two readings, s: a clock may jump."""
_LYING: Final = np.array([0.0, 0.0, -1.0])
"""Pull on a skin that lies face up, as it is calibrated, g."""
_AGAIN: Final = 3
"""Times that the skin that lies is found from one that does not: fields bend otherwise there."""


@final
class PosedEstimator(Estimator):
    """An estimator on an arm that tells how it holds the skin.

    Parameters
    ----------
    estimator : Estimator
        What makes estimates of the readings left, as of a skin that stands.
    design : SkinDesign
        Skin, its chips in the readings' order.
    pose : callable
        Function that gives how the arm holds and moves the skin at the newest reading.

    Notes
    -----
    Signals of chip s, straightened so that they are linear in motions, are :math:`y_s = c_s + A_s^T
    R^T E + G_s (R^T d - d_0)`: E the Earth's field, d down, :math:`d_0` that of the skin that lies
    face up, :math:`G_s` (3, 3) the change by 1 g along its local axes :math:`A_s`, :math:`c_s` all
    else; the rubber creeps under :math:`R^T d`. E, G and c are followed by recursive least squares
    over readings of the untouched skin; a priori G is the designed one.
    """

    _known: Floats
    _spread: Floats
    _rest: Floats
    _straightening: Straightening
    _begun: bool
    _walked: Floats
    _changes: Floats
    _accelerated: Floats
    _settling: Settling
    _first: Floats
    _settled_at: float
    _time: float | None
    _pull: Memory | None

    def __init__(self, estimator: Estimator, design: SkinDesign, pose: Callable[[], Pose]) -> None:
        from scipy.stats import chi2  # so that whoever only imports the package does not wait

        self._estimator, self._design, self._pose = estimator, design, pose
        chips = range(len(design.halls))
        self._inward = np.swapaxes(geometry(design).chip_axes, 1, 2)
        self._own = np.stack([mlx90393.rotation(site).T for site in design.halls])
        sagged = sags(design)
        self._designed = np.stack([change_by_weight(design, chip, sagged) for chip in chips])
        self._creep = elastomer_prony(design.columns.material)
        prompt = 1 - float(self._creep.retardation_shares.sum())
        self._noise = signal_noise(design) / prompt**2
        self._limit = float(chi2.isf(_MISSED, len(self._noise)))
        self._cross_talk = rest_cross_talk(design)
        self._forget()

    @property
    def drift(self) -> Floats:
        """How far the zero has followed, poses apart, since it was set, shape (S, 3), T."""
        return self._estimator.drift + self._known[self._count :].reshape(-1, 3)

    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Take the mean of readings, all at the present pose, as the zero."""
        changes, _ = self._patterns(self._pose(), 0.0)
        good = [reading for reading in readings if self._suits(reading)]
        if good:
            self._thermometer.step(good[-1].temperature)
            if not self._begun:
                mean = np.mean([self._field(reading) for reading in good], axis=0)
                self._lie(mean, changes)
        self._estimator.zero([self._left(reading, changes) for reading in readings], force=force)

    def unzero(self) -> None:
        """Return to the zero before the last."""
        self._estimator.unzero()

    def reset(self) -> None:
        """Forget everything, what was learned of poses too."""
        self._estimator.reset()
        self._forget()

    def step(self, reading: Reading) -> Estimate:
        """The other estimator's answer to what the pose leaves of a reading."""
        if not self._suits(reading):
            return self._estimator.step(reading)  # which says what is wrong
        elapsed = 0.0 if self._time is None else min(max(reading.time - self._time, 0.0), _LONGEST)
        self._time = reading.time
        self._thermometer.step(reading.temperature)
        pose = self._pose()
        crept, changes = self._patterns(pose, elapsed)
        estimate = self._estimator.step(self._left(reading, crept))
        if not np.isfinite(reading.field).all():
            return estimate
        noise, signals = self._shaken(pose), self._settled(reading, changes)
        unsure = self._unsure(changes, elapsed)
        felt = estimate.status in (Status.CONTACT, Status.AMBIGUOUS, Status.OUT_OF_RANGE)
        if felt and self._explained(signals, changes, noise + np.diag(unsure)):
            estimate = Estimate(time=reading.time, status=Status.NO_CONTACT)
        if estimate.status is Status.NO_CONTACT:
            if not self._begun:
                self._lie(self._field(reading), crept)
                signals = self._settled(reading, changes)
            self._learn(signals, changes, noise, unsure)
        return estimate

    def _suits(self, reading: Reading) -> bool:
        """Whether a reading is of as many chips as the design."""
        return reading.field.shape == self._designed.shape[:2]

    def _field(self, reading: Reading) -> Floats:
        """Field of a reading along the skin's local axes, at reference temperature, (S, 3), T."""
        return np.asarray(np.einsum("sba,sb->sa", self._own, reading.field / self._factor))

    def _straight(self, field: Floats, changes: Floats) -> Floats:
        """Signals (C,), T, linear in motions, of a field (S, 3) less that of the skin that lies.

        The Earth's field moves no magnet; it is added as it is.
        """
        even = (changes[:, :3] @ self._known[:3]).reshape(-1, 3)
        linear = self._straightening.straightened(field - self._rest - even)
        return np.asarray((linear + even).ravel())

    def _settled(self, reading: Reading, changes: Floats) -> Floats:
        """Signals (C,), T, with creep undone, so that what a touch leaves is not learned."""
        even = changes[:, :3] @ self._known[:3]
        straight = self._straight(self._field(reading), changes) - even
        elapsed = min(max(reading.time - self._settled_at, 0.0), _LONGEST)
        self._settled_at = reading.time
        return self._first + even + self._settling.step(elapsed, straight - self._first)

    def _left(self, reading: Reading, changes: Floats) -> Reading:
        """A reading of the skin that lies, under the same touch.

        Touches move magnets that have sunk already; what is learned of poses must not look like a
        touch either.
        """
        if not self._suits(reading):
            return reading
        pattern = np.hstack([changes, np.eye(len(changes))])
        own = self._straight(self._field(reading), changes) - pattern @ self._known
        field = self._rest + self._straightening.bent(own.reshape(-1, 3))
        return Reading(
            time=reading.time,
            field=self._factor * np.einsum("sab,sb->sa", self._own, field),
            temperature=reading.temperature,
            flags=reading.flags,
        )

    @property
    def _factor(self) -> Floats:
        """Field of each magnet over its field at the reference temperature, (S, 1)."""
        return np.asarray(temperature_factor(self._thermometer.magnets))[:, None]

    def _unsure(self, changes: Floats, elapsed: float) -> Floats:
        """Variances (C,), T^2, by which less is known of all else than when it was last learned."""
        walk, over = _BENDS
        by_pose = np.abs((changes - self._changes) @ self._known[: self._count])
        self._changes = changes
        self._walked = self._walked + _WANDERS**2 * elapsed + walk**2 * by_pose / over
        return self._walked

    def _shaken(self, pose: Pose) -> Floats:
        """Noise of signals (C, C), T^2, with what is not known of the skin's acceleration.

        That is the mean since a reading ago, half of whose change is as good as none.
        """
        change = _JOLT + 0.5 * np.abs(pose.acceleration - self._accelerated)
        self._accelerated = pose.acceleration
        # G_s has a row for each signal and a column for each axis of the skin.
        weighs = self._known[3 : self._count].reshape(-1, 3)
        moved = weighs @ (pose.turn.T * change / GRAVITY)
        return np.asarray(self._noise + moved @ moved.T)

    def _explained(self, signals: Floats, changes: Floats, noise: Floats) -> bool:
        """Whether what is not known of the present pose explains all of signals (C,), T.

        It is what a touch leaves that has moved the arm; at a pose that is known it is nothing.
        """
        if not self._begun:
            return False
        pattern = np.hstack([changes, np.eye(len(changes))])
        left = signals - pattern @ self._known
        spread = pattern @ self._spread @ pattern.T + noise
        return bool(left @ np.linalg.solve(spread, left) < self._limit)

    def _learn(self, signals: Floats, changes: Floats, noise: Floats, unsure: Floats) -> None:
        """Take in the signals (C,), T, of one reading of the untouched skin."""
        constants = np.arange(self._count, len(self._known))
        self._spread[constants, constants] += unsure
        self._walked = np.zeros(len(signals))
        pattern = np.hstack([changes, np.eye(len(changes))])
        met = pattern @ self._spread
        gain = np.linalg.solve(met @ pattern.T + noise, met).T
        self._known = self._known + gain @ (signals - pattern @ self._known)
        spread = self._spread - gain @ met
        self._spread = (spread + spread.T) / 2

    def _lie(self, field: Floats, changes: Floats) -> None:
        """Take the skin that lies from a first field (S, 3), T: it is what poses do not explain."""
        changed = (changes @ self._known[: self._count]).reshape(-1, 3)
        for _ in range(_AGAIN):
            self._rest = field - self._straightening.bent(changed)
            self._straightening = Straightening(self._design, self._rest - self._cross_talk)
        self._first = changed.ravel() - changes[:, :3] @ self._known[:3]
        self._settling.reset()
        own = slice(0, self._count)
        crossed = changes @ self._spread[own, own]
        self._spread = np.block(
            [
                [self._spread[own, own], -crossed.T],
                [-crossed, crossed @ changes.T + self._noise],
            ]
        )
        self._begun = True

    def _patterns(self, pose: Pose, elapsed: float) -> tuple[Floats, Floats]:
        """What E and G change of signals so many seconds later, (3 S, 3 + 9 S), crept and not."""
        pull = pose.turn.T @ (_LYING - pose.acceleration / GRAVITY)
        if self._pull is None:
            self._pull = Memory(self._creep, pull)
        by_earth = np.concatenate(self._inward @ pose.turn.T)
        chips = np.eye(len(self._own))
        crept, prompt = (
            np.hstack([by_earth, np.kron(chips, np.kron(np.eye(3), tilted - _LYING))])
            for tilted in (self._pull.step(elapsed, pull), pull)
        )
        return crept, prompt

    def _forget(self) -> None:
        """Know no more than the design."""
        self._count = 3 + 9 * len(self._own)
        sizes = _UNLIKE / 3 * np.linalg.norm(self._designed, axis=(1, 2))
        spread = np.append(np.full(3, _EARTH), np.repeat(sizes, 9))
        constants = np.zeros(3 * len(self._own))
        self._known = np.concatenate([np.zeros(3), self._designed.ravel(), constants])
        self._spread = np.diag(np.append(spread, constants) ** 2)
        own = rest_field(self._design)
        self._rest, self._straightening = own + self._cross_talk, Straightening(self._design, own)
        self._begun = False
        self._pull = None
        self._thermometer = Thermometer(len(self._own))
        self._walked, self._changes = constants, np.zeros((len(constants), self._count))
        self._accelerated = np.zeros(3)
        self._settling, self._first, self._settled_at = Settling(self._creep), constants, math.inf
        self._time = None
