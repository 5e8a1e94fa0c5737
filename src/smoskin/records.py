"""Records that flow through the package: readings in, estimates out.

These records hide nothing and decide nothing; they are checked once, here, where they are
made, so that everything downstream can trust shapes and units.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from enum import Enum, IntFlag
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arguments import typed
from smoskin.arrays import Bools, Floats, Ints, assign, freeze, frozen, wholes
from smoskin.errors import ArgumentError


class ChipFlag(IntFlag):
    """Faults of one chip's part of a reading; zero is good."""

    GOOD = 0
    MISSING = 1
    """The chip did not answer; its numbers mean nothing."""
    SATURATED = 2
    """At least one axis stands at the end of its range."""
    WRAPPED = 4
    """At least one axis has run over its window of bits and come back with a false value."""
    OLD = 8
    """The chip had not converted anew since it was last read."""
    INVALID = 16
    """The numbers are not finite."""


class Status(Enum):
    """State of an estimate; the value is a sentence for people."""

    CONTACT = "The skin is touched; the contacts are estimated."
    NO_CONTACT = "The skin is not touched."
    SATURATED = "A chip stands at the end of its range; press less or move the magnet away."
    OUT_OF_RANGE = "The field fits no touch of the skin as hard as is known."
    AMBIGUOUS = "The displacements fit more than one place, or none."
    STALE = "The reading is older than the one before it, or its chips had nothing new."
    CHIP_MISSING = "A chip did not answer, or answered with numbers that cannot be true."
    NOT_CALIBRATED = "The zero is unknown or has drifted past its bound; zero the skin untouched."


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reading:
    """One moment of all chips.

    Raises
    ------
    ArgumentError
        If the shapes disagree or the time is not finite. Fields that are not finite are
        accepted: they are measurements, and conditioning turns them into a status.
    """

    time: float
    """Seconds on the source's monotonic clock."""
    field: Floats
    """(S, 3), T, in each chip's own axes."""
    temperature: Floats
    """(S,), degC, as each chip reports it; NaN where it does not."""
    flags: Ints
    """(S,), `ChipFlag` of each chip."""

    def __init__(
        self,
        *,
        time: float,
        field: ArrayLike,
        temperature: ArrayLike | None = None,
        flags: ArrayLike | None = None,
    ) -> None:
        try:
            seconds = float(time) if math.isfinite(time) else math.nan
        except (TypeError, OverflowError):
            seconds = math.nan
        if math.isnan(seconds):
            raise ArgumentError(f"time must be finite; got {time!r:.100}")
        values = frozen("field", field, (None, 3))
        chips = len(values)
        degrees = np.full(chips, np.nan) if temperature is None else temperature
        marks = wholes("flags", np.zeros(chips, int) if flags is None else flags, (chips,))
        assign(self, time=seconds, field=values, temperature=degrees, flags=marks)
        freeze(self, temperature=(chips,))

    def __eq__(self, other: object) -> bool:
        return _same(self, other)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contact:
    """One touch, in the skin's frame; on a limb in that of its surface there.

    Examples
    --------
    >>> Contact(position=(0.045, 0.080), force=(0.0, 0.0, -0.5)).normal_force
    0.5
    """

    position: Floats
    """(2,), m: place on the undeformed skin; y is along the arc."""
    force: Floats
    """(3,), N, that the toucher exerts on the skin along x, y and outward; pressing is negative
    z."""

    def __init__(self, *, position: ArrayLike, force: ArrayLike) -> None:
        assign(self, position=position, force=force)
        freeze(self, position=(2,), force=(3,))
        if not np.isfinite(self.position).all():
            raise ArgumentError(f"position must be finite; got {self.position} m")

    @property
    def normal_force(self) -> float:
        """How hard the skin is pressed, N; positive when pressed."""
        return -float(self.force[2])

    def __eq__(self, other: object) -> bool:
        return _same(self, other)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """Touches that an estimator finds in one reading."""

    time: float
    """The reading's time, s."""
    status: Status
    """Whether to believe the contacts, and why not."""
    contacts: tuple[Contact, ...] = ()
    """The touches; empty unless the status is `CONTACT` or `AMBIGUOUS`."""
    covariance: Floats = field(default_factory=lambda: np.zeros((0, 5, 5)))
    """(C, 5, 5): covariance of (x, y, Fx, Fy, Fz) of each contact, in m and N; NaN where
    unknown."""

    def __post_init__(self) -> None:
        # By hand: one is made for every reading.
        for name, kind, what in _ESTIMATED:
            if not isinstance(value := getattr(self, name), kind):
                raise ArgumentError(f"{name} must be {what}; got {value!r:.100}")
        freeze(self, covariance=(len(self.contacts), 5, 5))

    def __eq__(self, other: object) -> bool:
        return _same(self, other)


_ESTIMATED: Final = (
    ("time", (float, int), "a number"),
    ("status", Status, "a Status"),
    ("contacts", tuple, "a tuple of contacts"),
)
"""Fields of an estimate, with their types and these in words."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """What a rig's own parts did while it made a touch, on the clock of the readings.

    It raises an `ArgumentError` if times fall or are not finite, or a phase ends before it begins.
    """

    gauge: Floats
    """(N, 4): time, s, and the force that the toucher exerts on the skin along x, y and z, N."""
    stage: Floats
    """(M, 4): time, s, and place of the probe's tip in the skin's frame, m."""
    phases: tuple[tuple[str, float, float], ...] = ()
    """Name, begin and end, s, of what the rig did, in its order."""

    def __init__(
        self, *, gauge: ArrayLike, stage: ArrayLike, phases: Sequence[tuple[str, float, float]] = ()
    ) -> None:
        spans = tuple((str(name), float(begin), float(end)) for name, begin, end in phases)
        assign(self, gauge=gauge, stage=stage, phases=spans)
        freeze(self, gauge=(None, 4), stage=(None, 4))
        for name in ("gauge", "stage"):
            times = getattr(self, name)[:, 0]
            if not (np.isfinite(times).all() and (np.diff(times) >= 0).all()):
                raise ArgumentError(f"times of the {name} must be finite and never fall")
        if not all(-math.inf < begin <= end < math.inf for _, begin, end in spans):
            raise ArgumentError(f"phases must end after they begin; got {spans}")

    def __eq__(self, other: object) -> bool:
        return _same(self, other)


@typed
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeldTouch:
    """A touch of known place and force, with what the chips read before it and during it.

    Raises
    ------
    ArgumentError
        If there are no readings, or the times do not follow each other.
    """

    contact: Contact
    """The touch as its toucher knows it."""
    readings: tuple[Reading, ...]
    """All readings since the touch before, in time; some may be of the release after it."""
    rest: tuple[float, float]
    """Start and end of the rest without any touch, s, on the readings' clock."""
    held: tuple[float, float]
    """Start and end of the still hold, s."""
    trace: Trace | None = None
    """What gauge and stage said meanwhile; None where the rig does not tell."""

    def __post_init__(self) -> None:
        times = (*self.rest, *self.held)
        if not self.readings or not np.isfinite(times).all():
            raise ArgumentError(f"readings must be there and times finite; got {times} s")
        if not self.rest[0] <= self.rest[1] <= self.held[0] <= self.held[1]:
            raise ArgumentError(f"rest must end before held begins; got {self.rest}, {self.held} s")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pose:
    """How an arm holds and moves a skin at a moment."""

    turn: Floats
    """(3, 3): rotation from the skin's frame to the room's, whose z points up."""
    acceleration: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,), m/s^2: of the skin's middle, in the room's frame."""

    def __post_init__(self) -> None:
        freeze(self, turn=(3, 3), acceleration=(3,))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """How far magnets and board have moved from rest, for any batch of states.

    A state that is no state of the skin holds NaN, so that nothing computed from it can pass for
    an answer. Indexing takes states out of the batch as it does with arrays.

    Examples
    --------
    >>> rest = Motion.rest(3, (2,))
    >>> rest.magnets.shape, rest.board.shape, rest[0].valid.tolist()
    ((2, 3, 6), (2, 6), True)
    """

    magnets: Floats
    """(..., G, 6): shift of each magnet's middle over the board along its local axes, m, and its
    rotation vector about them, rad; zero for a magnet on the base."""
    board: Floats
    """(..., 6): shift of the board over the base along x, y and z, m, and its rotation vector about
    the middle of the pillars' tops, rad."""

    @property
    def valid(self) -> Bools:
        """Which states are states of the skin at all, shape (...,)."""
        return np.asarray(
            np.isfinite(self.magnets).all(axis=(-2, -1)) & np.isfinite(self.board).all(axis=-1)
        )

    @classmethod
    def rest(cls, magnets: int, batch: tuple[int, ...] = ()) -> "Motion":
        """An untouched skin with so many magnets, in every state of a batch."""
        return cls(magnets=np.zeros((*batch, magnets, 6)), board=np.zeros((*batch, 6)))

    @classmethod
    def stack(cls, motions: Sequence["Motion"]) -> "Motion":
        """A batch whose states are these motions, along a new first axis."""
        return cls(
            magnets=np.stack([motion.magnets for motion in motions]),
            board=np.stack([motion.board for motion in motions]),
        )

    @classmethod
    def concatenate(cls, motions: Sequence["Motion"]) -> "Motion":
        """One batch after the other along their first axis."""
        return cls(
            magnets=np.concatenate([motion.magnets for motion in motions]),
            board=np.concatenate([motion.board for motion in motions]),
        )

    def __getitem__(self, index: Any) -> "Motion":
        return Motion(magnets=self.magnets[index], board=self.board[index])

    def where(self, valid: Bools) -> "Motion":
        """The same motion, invalid in every state in which `valid` (...,) is false."""
        return Motion(
            magnets=np.where(valid[..., None, None], self.magnets, np.nan),
            board=np.where(valid[..., None], self.board, np.nan),
        )

    def scaled(self, magnets: ArrayLike, board: ArrayLike | None = None) -> "Motion":
        """The motion with magnets and board moved so many times as far, a factor (...) a state.

        The board's factor is by default that of the magnets.
        """
        sheet, base = np.asarray(magnets), np.asarray(magnets if board is None else board)
        return Motion(
            magnets=sheet[..., None, None] * self.magnets, board=base[..., None] * self.board
        )


def _same(record: Any, other: Any) -> bool:
    """Whether two records are of one type and hold the same, NaN being the same as NaN."""
    if type(record) is not type(other):
        return False
    pairs = ((getattr(record, part.name), getattr(other, part.name)) for part in fields(record))
    return all(
        np.array_equal(mine, its, equal_nan=True) if isinstance(mine, np.ndarray) else mine == its
        for mine, its in pairs
    )
