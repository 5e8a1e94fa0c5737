"""What a skin reads untouched at every pose of its arm, learned while nothing touches it.

Decides that whoever knows how the arm holds the skin need not guess how it turns: the Earth's field
and the skin's weight are taken off each reading before it is estimated. Hides the least squares.
"""

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
from smoskin.mechanics.weight import sags
from smoskin.origami.geometry import geometry
from smoskin.records import Estimate, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.signals.signals import Thermometer, signal_noise
from smoskin.sensing.signals.turning import change_by_weight

_EARTH: Final = 40e-6
"""Spread of the Earth's field along each axis of the room, T."""
_UNLIKE: Final = 0.3
"""Share of a chip's change by weight in which a made skin differs from the designed one."""
_WANDERS: Final = 0.5e-6
"""Random walk of all else in a second, T."""
_BENDS: Final = 0.01
"""Share of what a pose has changed since the skin was last untouched that may be otherwise."""
_SURE: Final = 0.5
"""Time for which it must be untouched to be sure of that, s."""
_MISSED: Final = 1e-3
"""Chance of a reading of an untouched skin not to be taken for one by what is not known of it."""
_LONGEST: Final = 10.0
"""Longest time that counts between two readings, s: a clock may jump."""


@final
class PosedEstimator(Estimator):
    """An estimator on an arm whose pose is known.

    Parameters
    ----------
    estimator : Estimator
        What makes estimates of the readings left, as of a skin that stands.
    design : SkinDesign
        Skin, its chips in the readings' order.
    turn : callable
        Function that gives the rotation from the skin's frame to the room's, (3, 3), at the newest
        reading; the room's z points up.

    Notes
    -----
    Chip s reads :math:`y_s = c_s + Q_s^T (A_s^T R^T E + G_s R^T d)`: E the Earth's field, d down,
    :math:`G_s` (3, 3) the change by 1 g along its local axes :math:`A_s`, :math:`Q_s` how it is
    soldered, :math:`c_s` all else; the rubber creeps under :math:`R^T d`. E, G and c are followed
    by recursive least squares over readings of the untouched skin; a priori G is the designed one.
    """

    _known: Floats
    _spread: Floats
    _rest: Floats
    _idle: float
    _walked: float
    _time: float | None
    _pull: Memory | None
    _changed: Floats | None
    _straightening: Straightening | None

    def __init__(
        self, estimator: Estimator, design: SkinDesign, turn: Callable[[], Floats]
    ) -> None:
        # Here, so that whoever only imports the package does not wait for it.
        from scipy.linalg import block_diag
        from scipy.stats import chi2

        self._estimator, self._design, self._turn = estimator, design, turn
        chips = range(len(design.halls))
        inward = np.swapaxes(geometry(design).chip_axes, 1, 2)
        own = np.stack([mlx90393.rotation(site).T for site in design.halls])
        self._own, self._inward = own, own @ inward
        sagged = sags(design)
        self._designed = np.stack([change_by_weight(design, chip, sagged) for chip in chips])
        self._creep = elastomer_prony(design.columns.material)
        turns = block_diag(*own)
        self._noise = turns @ signal_noise(design) @ turns.T
        self._limit = float(chi2.isf(_MISSED, len(self._noise)))
        self._lying = self._pulled(np.array([0.0, 0.0, -1.0]))
        self._forget()

    @property
    def drift(self) -> Floats:
        """How far the zero has followed, poses apart, since it was set, shape (S, 3), T."""
        gone = (self._known[self._count :] - self._rest).reshape(-1, 3)
        return self._estimator.drift + (self._in_skin(gone) if len(gone) else 0.0)

    def zero(self, readings: Sequence[Reading], *, force: bool = False) -> None:
        """Take the mean of readings, all at the present pose, as the zero."""
        if readings:
            self._thermometer.step(readings[-1].temperature)
        changes = self._pattern(self._turn(), 0.0)
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
        if reading.field.shape != self._designed.shape[:2]:
            return self._estimator.step(reading)  # which says what is wrong
        elapsed = 0.0 if self._time is None else min(max(reading.time - self._time, 0.0), _LONGEST)
        self._time = reading.time
        self._thermometer.step(reading.temperature)
        changes = self._pattern(self._turn(), elapsed)
        estimate = self._estimator.step(self._left(reading, changes))
        if not np.isfinite(reading.field).all():
            return estimate
        field = (reading.field / self._factor).ravel()
        unsure = self._unsure(changes, elapsed)
        touched = estimate.status in (Status.CONTACT, Status.AMBIGUOUS)
        if touched and self._explained(field, changes, unsure):
            estimate = Estimate(time=reading.time, status=Status.NO_CONTACT)
        untouched = estimate.status is Status.NO_CONTACT
        self._idle = self._idle + elapsed if untouched else 0.0
        if untouched:
            self._learn(field, changes, unsure)
        if self._idle > _SURE or self._changed is None:
            self._changed = changes @ self._known[: self._count]
        return estimate

    def _left(self, reading: Reading, changes: Floats) -> Reading:
        """A reading without what its pose changes: a touch moves magnets that have sunk already."""
        changed = (changes @ self._known[: self._count]).reshape(-1, 3)
        left = reading.field / self._factor - changed
        if self._straightening is not None:
            # What is learned of poses must not look like a touch: all else goes on as it began.
            left -= (self._known[self._count :] - self._rest).reshape(-1, 3)
            rest = self._rest.reshape(-1, 3)
            tilted = (changes[:, 3:] - self._lying) @ self._known[3 : self._count]
            weight = self._in_skin(tilted.reshape(-1, 3))
            sunk, both = self._straightening.straightened(
                np.stack([weight, weight + self._in_skin(left - rest)])
            )
            own = self._straightening.bent(both - sunk)
            left = rest + np.einsum("sab,sb->sa", self._own, own)
        return Reading(
            time=reading.time,
            field=self._factor * left,
            temperature=reading.temperature,
            flags=reading.flags,
        )

    def _in_skin(self, fields: Floats) -> Floats:
        """Fields (S, 3) along the chips' axes, along the skin's."""
        return np.asarray(np.einsum("sba,sb->sa", self._own, fields))

    @property
    def _factor(self) -> Floats:
        """Field of each magnet over its field at the reference temperature, (S, 1)."""
        return np.asarray(temperature_factor(self._thermometer.magnets))[:, None]

    def _unsure(self, changes: Floats, elapsed: float) -> Floats:
        """Variances (C,), T^2, by which less is known of all else than at the reading before.

        Fields bend otherwise under another weight; while the arm stands that is nothing.
        """
        self._walked += _WANDERS**2 * elapsed
        changed = changes @ self._known[: self._count]
        gone = 0.0 if self._changed is None else changed - self._changed
        return np.asarray(self._walked + (_BENDS * gone) ** 2 + 0.0 * changed)

    def _explained(self, field: Floats, changes: Floats, unsure: Floats) -> bool:
        """Whether what is not known of the present pose explains all of a field (C,), T.

        It is what a touch leaves that has moved the arm; at a pose that is known it is nothing.
        """
        if not len(self._rest):
            return False
        pattern = np.hstack([changes, np.eye(len(changes))])
        left = field - pattern @ self._known
        spread = pattern @ self._spread @ pattern.T + self._noise + np.diag(unsure)
        return bool(left @ np.linalg.solve(spread, left) < self._limit)

    def _learn(self, field: Floats, changes: Floats, unsure: Floats) -> None:
        """Take in one field (C,), T, of the untouched skin."""
        if not len(self._rest):
            self._begin(field, changes)
            return
        constants = np.arange(self._count, len(self._known))
        self._spread[constants, constants] += unsure
        self._walked = 0.0
        pattern = np.hstack([changes, np.eye(len(changes))])
        met = pattern @ self._spread
        gain = np.linalg.solve(met @ pattern.T + self._noise, met).T
        self._known = self._known + gain @ (field - pattern @ self._known)
        spread = self._spread - gain @ met
        self._spread = (spread + spread.T) / 2

    def _begin(self, field: Floats, changes: Floats) -> None:
        """Take all else from a first field (C,), T: it is what poses do not explain."""
        rest = field - changes @ self._known
        crossed = changes @ self._spread
        self._known, self._rest = np.append(self._known, rest), rest
        lying = rest + self._lying @ self._known[3 : self._count]
        own = self._in_skin(lying.reshape(-1, 3)) - rest_cross_talk(self._design)
        self._straightening = Straightening(self._design, own)
        self._spread = np.block(
            [[self._spread, -crossed.T], [-crossed, crossed @ changes.T + self._noise]]
        )

    def _pattern(self, turn: Floats, elapsed: float) -> Floats:
        """What E and G change of all readings so many seconds later, (3 S, 3 + 9 S)."""
        pattern = np.empty((3 * len(self._own), self._count))
        if self._pull is None:
            self._pull = Memory(self._creep, -turn[2])
        pattern[:, :3] = np.concatenate(self._inward @ turn.T)
        pattern[:, 3:] = self._pulled(self._pull.step(elapsed, -turn[2]))
        return pattern

    def _pulled(self, down: Floats) -> Floats:
        """What G changes of all readings where weight pulls so, (3 S, 9 S)."""
        chips = range(len(self._own))
        changes = np.zeros((len(chips), 3, len(chips), 9))
        changes[chips, :, chips] = np.kron(self._own, down)
        return changes.reshape(3 * len(chips), 9 * len(chips))

    def _forget(self) -> None:
        """Know no more than the design."""
        self._count = 3 + 9 * len(self._own)
        self._known = np.append(np.zeros(3), self._designed)
        sizes = _UNLIKE / 3 * np.linalg.norm(self._designed, axis=(1, 2))
        self._spread = np.diag(np.append(np.full(3, _EARTH), np.repeat(sizes, 9)) ** 2)
        self._rest = np.zeros(0)
        self._straightening = None
        self._pull = None
        self._thermometer = Thermometer(len(self._own))
        self._changed = None
        self._idle = self._walked = 0.0
        self._time = None
