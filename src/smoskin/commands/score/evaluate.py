"""How good an estimator is on made skins that it has not seen: sessions of touches, and answers.

A session is one skin at one temperature: touches one after the other, each held for a moment, on
rubber that creeps, under chips that drift and make noise. Decides how such a session goes and at
which moment a touch is judged. Nothing here knows what is inside an estimator.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.datasets.patterns import far_pairs
from smoskin.mechanics.sheet.touches import Touches
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.origami.geometry import geometry, places_to_the_rim
from smoskin.records import Contact, Motion, Reading, Status
from smoskin.roles import Estimator
from smoskin.sensing.response.calibrate import LabelledTouches, Target
from smoskin.sensing.response.labels import Labeller, labelled_touches
from smoskin.twin.creep import Creep
from smoskin.twin.rig import VirtualRig, drifting_readings
from smoskin.twin.whole import Twin

_RAMP: Final = 0.02
"""Duration in which a touch comes, and in which it goes, s."""
_HOLD: Final = 0.3
"""Time after which a touch is judged and goes, s."""
_PERIOD: Final = 1.0
"""Time from touch to touch, s."""
_MOMENTS: Final = (0.0, _RAMP, _HOLD, _HOLD + _RAMP)
_JUDGED: Final = 2
"""Place among the moments at which a touch is read of the one at which it counts."""
_ZEROS: Final = 20
"""Readings of the untouched skin before the first touch."""
FORCES: Final = tuple(k / 10 for k in range(1, 11))
"""N: normal forces of a judgement."""
_INSIDE: Final = 4.605170185988092
"""Squared deviations that hold 90 % of a normal in the plane."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """What spoils a session besides the chips' noise."""

    creep: bool = True
    """Whether the rubber creeps."""
    drift: float = 0.3e-6
    """Random walk of each axis in a second, T; in four seconds twice as far."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Session:
    """Touches of one skin at one temperature, and where they hold its magnets once settled."""

    touches: Touches
    """(B, K) touches."""
    motion: Motion
    """(B,) motions, elastic."""
    temperature: float
    """Temperature of skin and chips, degC."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judged:
    """An estimator's answers to B touches with K places each."""

    truth: Floats
    """(B, K, 5): x, y, Fx, Fy, Fz."""
    error: Floats
    """(B, K, 5): answer less truth; NaN where another number of touches was told."""
    spread: Floats
    """(B, K, 5, 5): covariance that was stated."""
    count: Ints
    """(B,): touches that were told; -1 where the estimator could not tell."""
    idle: Ints
    """(B,): touches that were told just before each touch, where there is none."""

    @property
    def distance(self) -> Floats:
        """Distance of the place told from the true one, (B, K), m."""
        return np.asarray(np.hypot(self.error[..., 0], self.error[..., 1]))

    @property
    def inside(self) -> Bools:
        """Whether the truth lies in the stated 90 % region of place, (B, K)."""
        off = self.error[..., :2]
        answered = np.isfinite(off).all(axis=-1)
        inverse = np.linalg.inv(self.spread[answered][:, :2, :2])
        inside = np.zeros(answered.shape, dtype=bool)
        inside[answered] = (
            np.einsum("ti,tij,tj->t", off[answered], inverse, off[answered]) <= _INSIDE
        )
        return inside

    def __add__(self, other: "Judged") -> "Judged":
        """Both together."""
        names = [field.name for field in fields(Judged)]
        return Judged(
            **{name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names}
        )


def press(twin: Twin, touches: Touches, temperature: float) -> Session:
    """A session of these touches in this order."""
    return Session(
        touches=touches,
        motion=twin.motions(touches, temperature=temperature),
        temperature=temperature,
    )


def grid_sessions(
    twin: Twin,
    rng: np.random.Generator,
    *,
    places: tuple[int, int] = (25, 33),
    forces: Sequence[float] = FORCES,
    temperatures: tuple[float, float] = (15.0, 35.0),
    drag: float = 0.0,
    count: int | None = None,
) -> Iterator[Session]:
    """A session a force: every place from rim to rim once, in random order, at one temperature.

    Parameters
    ----------
    twin : Twin
    rng : numpy.random.Generator
        Draws order, temperatures and drags.
    places : tuple of int
        Numbers of places along x and y.
    forces : sequence of float
        Normal forces, N.
    temperatures : tuple of float
        Range of temperatures, degC.
    drag : float
        Largest drag, N, of any direction; evenly spread.
    count : int, optional
        Number of places, drawn anew for each force; all by default.
    """
    grid = places_to_the_rim(geometry(twin.design).extent, places)[:, None]
    for force in forces:
        push = np.zeros((len(grid), 1, 3))
        push[..., 2] = -force
        size, angle = rng.uniform(0, drag, len(grid)), rng.uniform(0, 2 * np.pi, len(grid))
        push[:, 0, 0], push[:, 0, 1] = size * np.cos(angle), size * np.sin(angle)
        touches = Touches(position=rng.permutation(grid)[:count], force=push[:count])
        yield press(twin, touches, float(rng.uniform(*temperatures)))


def pair_session(
    twin: Twin,
    rng: np.random.Generator,
    count: int,
    *,
    forces: tuple[float, float] = (0.3, 1.0),
    apart: float = 0.04,
    temperature: float = 25.0,
) -> Session:
    """Pairs of straight touches at once, anywhere but so far apart."""
    position = far_pairs(geometry(twin.design).extent, apart, count, rng)
    push = np.zeros((count, 2, 3))
    push[..., 2] = -rng.uniform(*forces, (count, 2))
    return press(twin, Touches(position=position, force=push), temperature)


def readings(
    twin: Twin, session: Session, rng: np.random.Generator, disturbance: Disturbance
) -> list[Reading]:
    """All that the chips read in a session: first untouched, then four times a touch."""
    moments = len(_MOMENTS)
    total = _ZEROS + moments * len(session.touches)
    starts = _PERIOD * np.arange(1, len(session.touches) + 1)
    times = np.concatenate([np.linspace(-1.0, 0.0, _ZEROS), np.add.outer(starts, _MOMENTS).ravel()])
    pressed = np.zeros((len(session.touches), moments), dtype=bool)
    pressed[:, 1 : _JUDGED + 1] = True
    pressed = np.concatenate([np.zeros(_ZEROS, dtype=bool), pressed.ravel()])
    steps = np.diff(times, prepend=times[0])
    state = np.full(total, -1)
    state[pressed] = np.repeat(np.arange(len(session.touches)), _JUDGED)
    rest = Motion.rest(len(twin.design.magnets), (1,))
    motion = Motion.concatenate([session.motion, rest])[state]
    if disturbance.creep:
        motion = Creep(twin.design).steps(steps, motion)
    walk = {"temperature": session.temperature, "drift": disturbance.drift}
    return list(drifting_readings(twin, motion, times, steps, rng, **walk)[0])


def judge(
    estimator: Estimator,
    twin: Twin,
    session: Session,
    rng: np.random.Generator,
    disturbance: Disturbance | None = None,
) -> Judged:
    """Answers of an estimator in a session, against the truth; it is zeroed first."""
    stream = readings(twin, session, rng, disturbance or Disturbance())
    estimator.reset()
    estimator.zero(stream[:_ZEROS])
    touches = session.touches
    count, places = touches.force.shape[:2]
    truth = np.concatenate([touches.position, touches.force], axis=-1)
    error = np.full((count, places, 5), np.nan)
    spread = np.full((count, places, 5, 5), np.nan)
    counts, idle = np.full(count, -1), np.full(count, -1)
    for k, reading in enumerate(stream):
        estimate = estimator.step(reading)
        row, moment = divmod(k - _ZEROS, len(_MOMENTS))
        answered = estimate.status in (Status.CONTACT, Status.NO_CONTACT)
        number = len(estimate.contacts) if answered else -1
        if row >= 0 and moment == 0:
            idle[row] = number
        elif row >= 0 and moment == _JUDGED:
            counts[row] = number
            if number == places:
                values = np.array(
                    [[*contact.position, *contact.force] for contact in estimate.contacts]
                )
                order = _matched(values, truth[row])
                error[row] = values[order] - truth[row]
                spread[row] = estimate.covariance[order]
    return Judged(truth=truth, error=error, spread=spread, count=counts, idle=idle)


def label(
    twin: Twin,
    plan: Sequence[Target],
    rng: np.random.Generator,
    *,
    temperature: float = 25.0,
    chips: Sequence[int] | None = None,
    disturbance: Disturbance | None = None,
    stage: float = 20e-6,
    gauge: float = 2e-3,
) -> LabelledTouches:
    """The labelled touches that a rig would make of a plan, on this skin.

    Touches under which a chip reaches the end of its range are left out.

    Parameters
    ----------
    twin : Twin
        The skin.
    plan : sequence of Target
        Touches to make.
    rng : numpy.random.Generator
        Draws noise, drift, and the rig's errors.
    temperature : float
        Temperature of skin and chips, degC.
    chips : sequence of int, optional
        Chips whose signals are kept; all by default.
    disturbance : Disturbance, optional
        Creep and drift meanwhile.
    stage, gauge : float
        Standard deviations of where the rig's stage stands, m, and of its gauge, N.
    """
    position = np.stack([target.position for target in plan])
    force = np.stack([target.force for target in plan])
    touches = Touches(position=position[:, None], force=force[:, None])
    motion = twin.motions(touches, temperature=temperature)
    spoilt = disturbance or Disturbance()
    rig = VirtualRig(
        twin,
        rng,
        temperature=temperature,
        creep=spoilt.creep,
        drift=spoilt.drift,
        stage=stage,
        gauge=gauge,
    )
    rubber = elastomer_prony(twin.design.columns.material) if spoilt.creep else None
    labeller = Labeller(twin.design, rubber)
    labels = [
        labeller.label(rig.hold(Contact(position=place, force=push), motion[row]))
        for row, (place, push) in enumerate(zip(position, force, strict=True))
    ]
    used = range(len(twin.design.halls)) if chips is None else chips
    return labelled_touches(labels, tuple(used), place_spread=stage, force_spread=gauge)


def _matched(values: Floats, truth: Floats) -> Ints:
    """Order of at most two touches in which they lie nearest to the true ones."""
    orders = [np.arange(len(values)), np.arange(len(values))[::-1]]
    return min(
        orders, key=lambda order: float(np.hypot(*(values[order, :2] - truth[:, :2]).T).sum())
    )
