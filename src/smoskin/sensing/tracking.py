"""A touch followed over time: places move on with their speed, forces wander.

Wraps an estimator that states covariances (the Bayesian one, which has undone creep before) and
passes single touches through a Kalman filter of constant velocity. Anything else (no touch, two
touches, a bad measurement) is passed on as it is and ends the track.
"""

from dataclasses import dataclass

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import ArgumentError
from smoskin.records import Contact, Estimate, Reading, Status
from smoskin.roles import Estimator


@dataclass(frozen=True, slots=True, kw_only=True)
class Agility:
    """How fast touches change.

    Raises
    ------
    ArgumentError
        If a number is not positive.
    """

    acceleration: float = 0.5
    """m/s^2, of a touch that slides, root of the spectral density times a second."""
    force_rate: float = 2.0
    """N, that each force wanders in a second."""
    longest_gap: float = 0.2
    """s between readings after which a track is begun anew."""

    def __post_init__(self) -> None:
        for name in ("acceleration", "force_rate", "longest_gap"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive; got {getattr(self, name)}")


class TrackingEstimator(Estimator):
    """Another estimator's single touches, filtered.

    Parameters
    ----------
    estimator : Estimator
        That states finite covariances; drags that it knows to be none may have none.
    agility : Agility, optional
    """

    def __init__(self, estimator: Estimator, agility: Agility | None = None) -> None:
        self._inner = estimator
        self._agility = agility or Agility()
        self._time = -np.inf
        self._state: Floats = np.zeros(7)
        self._spread: Floats = np.zeros((7, 7))

    @property
    def velocity(self) -> Floats:
        """Of the touch that is followed, (2,), m/s."""
        return np.array(self._state[5:])

    def reset(self) -> None:
        """Forget the track and everything that the inner estimator remembers."""
        self._inner.reset()
        self._time = -np.inf

    def step(self, reading: Reading) -> Estimate:
        """The touches that one reading shows, a single one filtered.

        Raises
        ------
        ArgumentError
            As the inner estimator.
        """
        said = self._inner.step(reading)
        if said.status is not Status.CONTACT or len(said.contacts) != 1:
            self._time = -np.inf
            return said
        contact, spread = said.contacts[0], said.covariance[0]
        values = np.concatenate([contact.position, contact.force])
        if not np.isfinite(spread).all():
            self._time = -np.inf
            return said
        elapsed = said.time - self._time
        if elapsed > self._agility.longest_gap:
            self._begin(values, spread)
        else:
            self._follow(elapsed, values, spread)
        self._time = said.time
        return Estimate(
            time=said.time,
            status=Status.CONTACT,
            contacts=(Contact(position=self._state[:2], force=self._state[2:5]),),
            covariance=self._spread[None, :5, :5],
        )

    def _begin(self, values: Floats, spread: Floats) -> None:
        """Begin a track at rest."""
        self._state = np.concatenate([values, np.zeros(2)])
        self._spread = np.zeros((7, 7))
        self._spread[:5, :5] = spread
        self._spread[[5, 6], [5, 6]] = (self._agility.acceleration * 0.1) ** 2

    def _follow(self, elapsed: float, values: Floats, spread: Floats) -> None:
        """Move on and take in what is said now."""
        onward = np.eye(7)
        onward[[0, 1], [5, 6]] = elapsed
        noise = np.zeros((7, 7))
        jolt = self._agility.acceleration**2
        for place, speed in ((0, 5), (1, 6)):
            noise[place, place] = jolt * elapsed**3 / 3
            noise[place, speed] = noise[speed, place] = jolt * elapsed**2 / 2
            noise[speed, speed] = jolt * elapsed
        # A drag that is known to be none stays none.
        free = np.diag(spread)[2:] > 0
        noise[[2, 3, 4], [2, 3, 4]] = self._agility.force_rate**2 * elapsed * free
        state, before = onward @ self._state, onward @ self._spread @ onward.T + noise
        known = np.diag(spread) > 0
        rows = np.eye(7)[:5][known]
        seen = spread[np.ix_(known, known)]
        gain = np.linalg.solve(rows @ before @ rows.T + seen, rows @ before).T
        self._state = state + gain @ (values[known] - rows @ state)
        kept = np.eye(7) - gain @ rows
        # Joseph's form: positive whatever the rounding.
        self._spread = kept @ before @ kept.T + gain @ seen @ gain.T
