"""What an exam asks: sessions of touches on made skins that an estimator has not seen.

A session is one skin at one temperature: touches one after the other, each held for a moment, on
rubber that creeps, under chips that drift and make noise. Decides how such a session goes and at
which moment a touch is judged. Nothing here knows what is inside an estimator.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.commands.score.errors import Answers
from smoskin.datasets.patterns import far_pairs
from smoskin.errors import ArgumentError
from smoskin.mechanics.sheet.touches import Touches
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.origami.geometry import geometry, places_to_the_rim
from smoskin.records import ChipFlag, Contact, Estimate, Motion, Pose, Reading, Status
from smoskin.roles import ContactLaw, Estimator
from smoskin.sensing.response.calibrate import LabelledTouches, Target
from smoskin.sensing.response.labels import Labeller, labelled_touches
from smoskin.twin.creep import Creep
from smoskin.twin.rig import VirtualRig, drifting_readings
from smoskin.twin.whole import Twin
from smoskin.twin.world.effect import World
from smoskin.twin.world.worlds import PLAIN

FORCES: Final = tuple(k / 10 for k in range(1, 11))
"""Normal forces of an exam, N."""
HEADLINE: Final = 0.3
"""Least force of the headline, N."""
_UNSEEN: Final = 1_000_000
"""First of the seeds that response tables are made of."""
_RAMP: Final = 0.02
"""Duration in which a touch comes, and in which it goes, s."""
_HOLD: Final = 0.3
"""Time after which a touch is judged and goes, s."""
_PERIOD: Final = 1.0
"""Time from touch to touch, s; of pairs in turn that much longer as the first is alone."""
_LONGEST: Final = 10.0
"""Longest time for which it may be, s."""
_MOMENTS: Final = (0.0, _RAMP, _HOLD, _HOLD + _RAMP)
"""Times at which a touch is read in the plain world, where nothing happens between touches, s."""
_STREAM: Final = (0.0, _RAMP, 0.1, 0.2, _HOLD, _HOLD + _RAMP, *(k / 10 for k in range(4, 10)))
"""Likewise in others: a stream in which what surrounds the skin can be followed."""
_SWING: Final = 20.0
"""Time for which an arm that tells its pose turns untouched before, once to and fro, s."""
_ZEROS: Final = 20
"""Readings of the untouched skin before the first touch."""
_TEMPERATURES: Final = (15.0, 35.0)
"""Range of the skins' temperatures, degC."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exam:
    """Touches of one force after the other, 0.1 to 1 N, on made skins at 15 to 35 degC.

    Numbers out of their range raise an `ArgumentError`.
    """

    skins: tuple[int, ...] = (1, 2)
    """Seeds of the made skins, and of all that is drawn for each."""
    touches: int = 60
    """Labelled touches that calibrate each skin; 0: the file is taken as it is."""
    places: tuple[int, int] = (25, 33)
    """Places of the grid from rim to rim, along x and y."""
    count: int | None = 200
    """Number of these places that are pressed, drawn anew for each force; None: all of them."""
    drag: float = 0.0
    """Largest drag of a second round of touches, N, in any direction; 0: no such round. With it
    the first round is also read by the estimator that may not take touches to be straight."""
    pairs: int = 40
    """Pairs of straight touches on each skin, 0.3 to 1 N, at least 40 mm apart: such that land
    together, and as many whose touches land one after the other."""
    pairs_after: float = _HOLD
    """Time from the first touch of such a pair to the second, s."""
    chips: tuple[int, ...] | None = None
    """Chips that are read; None: all that the file has."""
    world: World = PLAIN
    """World in which the skins are made, calibrated and pressed."""
    contact: ContactLaw | None = None
    """Contact law of all the skins; None: the world's."""

    def __post_init__(self) -> None:
        if not self.skins or self.touches < 0 or self.pairs < 0:
            raise ArgumentError(
                "skins must be at least 1, touches and pairs at least 0; got "
                f"{len(self.skins)}, {self.touches} and {self.pairs}"
            )
        if not 2 <= min(self.places) <= max(self.places) <= 1000 or not (
            self.count is None or self.count >= 1
        ):
            raise ArgumentError(
                "places must be at least 2 along each axis, at most 1000, and count at least 1; "
                f"got {self.places} and {self.count}"
            )
        if not _RAMP <= self.pairs_after <= _LONGEST:
            raise ArgumentError(
                f"pairs_after must lie in {_RAMP:g} to {_LONGEST:g} s; got {self.pairs_after}"
            )
        if not 0 <= self.drag < float("inf"):
            raise ArgumentError(f"drag must be finite and >= 0 N; got {self.drag}")
        if not 0 <= min(self.skins) <= max(self.skins) < _UNSEEN:
            raise ArgumentError(
                f"seeds must lie in 0..{_UNSEEN - 1}, where no table has seen them; got "
                f"{min(self.skins)} to {max(self.skins)}"
            )

    @property
    def sessions(self) -> int:
        """Number of sessions of each skin."""
        return len(FORCES) * (3 if self.drag else 1) + 2 * (self.pairs > 0)

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        settings = asdict(replace(self, world=PLAIN, contact=None))
        settings["world"] = self.world.name
        settings["contact"] = self.contact and type(self.contact).__name__
        settings["drag_N"] = settings.pop("drag")
        settings["pairs_after_s"] = settings.pop("pairs_after")
        seeds = list(self.skins)
        counts = {"skins": len(seeds), "seed": seeds[0], "seeds": seeds}
        return settings | counts | {"forces_N": list(FORCES)}


def parse_places(text: str) -> tuple[int, int]:
    """Places of a grid as people write them; any other text raises an `ArgumentError`.

    Examples
    --------
    >>> parse_places("25x33")
    (25, 33)
    """
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(re.fullmatch(r"\s*\d{1,9}\s*", part) for part in parts):
        raise ArgumentError(f"places must be two whole numbers such as 25x33; got {text!r}")
    return int(parts[0]), int(parts[1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Session:
    """Touches of one skin at one temperature, and where they hold its magnets once settled."""

    touches: Touches
    """Touches of P presses with K each."""
    motion: Motion
    """Elastic motions, (P,)."""
    before: Motion | None = None
    """Those of the first touch of each press, while it is alone; None: they land together, (P,)."""
    after: float = 0.0
    """Time for which it is alone, s."""
    temperature: float
    """Temperature of skin and chips, degC."""
    world: World = PLAIN
    """World in which it takes place."""
    seed: tuple[int, ...] = ()
    """Seed of what happens in it."""


def press(
    twin: Twin,
    touches: Touches,
    temperature: float,
    world: World = PLAIN,
    seed: tuple[int, ...] = (),
) -> Session:
    """A session of these touches in this order, by fingers of this world."""
    touches = world.fingers(touches, seed)
    motion = twin.motions(touches, temperature=temperature)
    return Session(touches=touches, motion=motion, temperature=temperature, world=world, seed=seed)


def grid_sessions(
    twin: Twin,
    rng: np.random.Generator,
    *,
    places: tuple[int, int] = (25, 33),
    forces: Sequence[float] = FORCES,
    drag: float = 0.0,
    count: int | None = None,
    world: World = PLAIN,
    seed: tuple[int, ...] = (),
) -> Iterator[Session]:
    """A session a force, N: places from rim to rim once, in random order, at 15 to 35 degC.

    Of the grid's places, `count` are drawn anew for each force, all by default; drags up to
    `drag`, N, are of any direction and evenly spread.
    """
    grid = places_to_the_rim(geometry(twin.design).extent, places)[:, None]
    for number, force in enumerate(forces):
        push = np.zeros((len(grid), 1, 3))
        push[..., 2] = -force
        size, angle = rng.uniform(0, drag, len(grid)), rng.uniform(0, 2 * np.pi, len(grid))
        push[:, 0, 0], push[:, 0, 1] = size * np.cos(angle), size * np.sin(angle)
        touches = Touches(position=rng.permutation(grid)[:count], force=push[:count])
        yield press(twin, touches, float(rng.uniform(*_TEMPERATURES)), world, (*seed, number))


def pair_session(
    twin: Twin,
    rng: np.random.Generator,
    count: int,
    world: World = PLAIN,
    seed: tuple[int, ...] = (),
) -> Session:
    """Pairs of straight touches of 0.3 to 1 N, anywhere but 40 mm apart, at 25 degC."""
    position = far_pairs(geometry(twin.design).extent, 0.04, count, rng)
    push = np.zeros((count, 2, 3))
    push[..., 2] = -rng.uniform(0.3, 1.0, (count, 2))
    return press(twin, Touches(position=position, force=push), 25.0, world, seed)


def in_turn(twin: Twin, session: Session, after: float = _HOLD) -> Session:
    """The same pairs by the same fingers, the second touch of each so long after the first, s."""
    fingers = session.touches
    first = Touches(
        position=fingers.position[:, :1], force=fingers.force[:, :1], radius=fingers.radius[:, :1]
    )
    alone = twin.motions(first, temperature=session.temperature)
    return replace(session, before=alone, after=after)


def starts_in_range(twin: Twin) -> bool:
    """Whether all chips of the untouched skin are within their range, as its maker reads first."""
    rest, cold = Motion.rest(len(twin.design.magnets)), _TEMPERATURES[0]
    sample = twin.sample(rest, np.random.default_rng(0), temperature=cold)
    return bool((sample.flags == int(ChipFlag.GOOD)).all())


class Heard(NamedTuple):
    """What arrives of a session's readings, and what it is asked of each."""

    readings: Sequence[Reading | None]
    """None for one that does not arrive."""
    row: Ints
    """(T,): touch during or before whose time each is read; -1 before the first."""
    idle: Bools
    """(T,): whether it is the one just before its touch."""
    judged: Bools
    """(T,): whether it is the one at which its touch counts."""
    turns: Floats
    """(T, 3, 3): rotation from the skin's frame to the room's at each."""


def readings(
    twin: Twin,
    session: Session,
    rng: np.random.Generator,
    *,
    creep: bool = True,
    drift: float = 0.3e-6,
) -> Heard:
    """All that the chips read in a session: first untouched, then some times a touch.

    The rubber may creep; each axis of the chips walks at random by `drift` in a second, T.
    """
    world = session.world
    moments = np.array(_MOMENTS if world.plain else _STREAM)
    part = np.where((moments > 0) & (moments <= _HOLD), 0, -1)  # of a touch, -1 where there is none
    count, period = len(session.touches), _PERIOD
    held = [session.motion]
    if session.before is not None:
        alone = np.append(moments[moments < session.after], session.after)
        part = np.concatenate([np.where(alone > 0, 0, -1), np.where(part[1:] < 0, -1, 1)])
        moments = np.concatenate([alone, session.after + moments[1:]])
        period += session.after
        held = [session.before, session.motion]
    begin = _PERIOD + _SWING * world.posed
    starts = begin + period * np.arange(count)
    before = np.linspace(-1.0, 0.0, _ZEROS)
    if not world.plain:
        before = np.append(before, np.arange(0.1, begin, 0.1))
    times = np.concatenate([before, np.add.outer(starts, moments).ravel()])
    steps = np.diff(times, prepend=times[0])
    state = np.where(part < 0, -1, count * part + np.arange(count)[:, None])
    rest = Motion.rest(len(twin.design.magnets), (1,))
    motion = Motion.concatenate([*held, rest])
    untouched = np.full(len(before), -1)
    motion = motion[np.concatenate([untouched, state.ravel()])]
    run = None if world.plain else world.run(twin, session.seed)
    motion = motion if run is None else run.moved(times, motion)
    if creep:
        motion = Creep(twin.design).steps(steps, motion)
    around = None if run is None else run.around(times)
    read, _ = drifting_readings(
        twin, motion, times, steps, rng, temperature=session.temperature, drift=drift, around=around
    )
    return Heard(
        readings=read if run is None else run.arrived(read),
        row=np.append(untouched, np.repeat(np.arange(count), len(moments))),
        idle=np.append(untouched, np.tile(moments == 0.0, count)) > 0,
        judged=np.append(untouched, np.tile(moments == moments[part >= 0].max(), count)) > 0,
        turns=np.tile(np.eye(3), (len(times), 1, 1)) if run is None else run.poses(times),
    )


def judge(estimator: Estimator, twin: Twin, session: Session, rng: np.random.Generator) -> Answers:
    """Answers of an estimator in a session, against the truth; it is zeroed first.

    Where the reading that counts does not arrive, the last answer before it does.
    """
    stream, k = readings(twin, session, rng), 0
    if session.world.posed:
        estimator.carried_by(lambda: Pose(turn=stream.turns[k]))
    estimator.reset()
    zeros = [reading for reading in stream.readings[:_ZEROS] if reading is not None]
    estimator.zero(zeros, force=True)
    touches = session.touches
    truth = np.concatenate([touches.position, touches.force], axis=-1)
    presses, places = truth.shape[:2]
    error = np.full((presses, places, 5), np.nan)
    spread = np.full((presses, places, 5, 5), np.nan)
    count, idle = np.full(presses, -1), np.full(presses, -1)
    estimate: Estimate | None = None
    for k, reading in enumerate(stream.readings):
        row = int(stream.row[k])
        estimate = estimate if reading is None else estimator.step(reading)
        if not (stream.idle[k] or stream.judged[k]):
            continue
        answered = estimate is not None and estimate.status in (Status.CONTACT, Status.NO_CONTACT)
        contacts = estimate.contacts if estimate is not None and answered else ()
        number = len(contacts) if answered else -1
        if stream.idle[k]:
            idle[row] = number
        else:
            count[row] = number
        if stream.judged[k] and estimate is not None and number == places:
            values = np.array([[*contact.position, *contact.force] for contact in contacts])
            order = _matched(values, truth[row])
            error[row] = values[order] - truth[row]
            spread[row] = estimate.covariance[order]
        # What was told of a touch tells nothing of the next.
        estimate = None
    return Answers(
        extent=geometry(twin.design).extent,
        truth=truth.reshape(-1, 5),
        error=error.reshape(-1, 5),
        spread=spread.reshape(-1, 5, 5),
        bound=np.full((truth[..., 0].size, 2), np.nan),
        count=count,
        idle=idle,
    )


def label(
    twin: Twin,
    plan: Sequence[Target],
    rng: np.random.Generator,
    *,
    temperature: float = 25.0,
    chips: Sequence[int] | None = None,
    world: World = PLAIN,
    seed: tuple[int, ...] = (),
) -> LabelledTouches:
    """The labelled touches that a rig would make of a plan, on this skin at a temperature, degC.

    Signals are of these chips, all by default; touches under which a chip reaches the end of its
    range are left out. Of a world, what acts on a bench does, and the rig's tip is no finger.
    """
    position = np.stack([target.position for target in plan])[:, None]
    force = np.stack([target.force for target in plan])[:, None]
    motion = twin.motions(Touches(position=position, force=force), temperature=temperature)
    run = None if world.plain else world.run(twin, seed, bench=True)
    rig = VirtualRig(twin, rng, temperature=temperature, run=run)
    labeller = Labeller(twin.design, elastomer_prony(twin.design.columns.material))
    held = (
        rig.hold(Contact(position=target.position, force=target.force), motion[row])
        for row, target in enumerate(plan)
    )
    labels, loops = labeller.unlooped([labeller.label(touch) for touch in held])
    return labelled_touches(
        labels,
        tuple(range(len(twin.design.halls)) if chips is None else chips),
        place_spread=rig.place_spread,
        force_spread=rig.force_spread,
        loops=loops,
    )


def _matched(values: Floats, truth: Floats) -> Ints:
    """Order of at most two touches in which they lie nearest to the true ones."""
    orders = [np.arange(len(values)), np.arange(len(values))[::-1]]
    return min(
        orders, key=lambda order: float(np.hypot(*(values[order, :2] - truth[:, :2]).T).sum())
    )
