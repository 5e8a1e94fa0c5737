"""The scripted hand of the demonstration, and what is said of its touches.

Decides when fingers or a new zero push it aside, and how a touch is judged: by the median of the
estimates made while it was held.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.records import Contact, Estimate, Status
from smoskin.twin.hand import HOLD, PERIOD, RAMP

_UNREAD: Final = "NO_READING"
_FOUND: Final = 5e-3
"""Distance within which a touch counts as found, about a fingertip's radius, m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One side of a judged touch, in the units people read."""

    x_mm: float
    y_mm: float
    fx_N: float
    fy_N: float
    fz_N: float

    @classmethod
    def of(cls, contact: Contact) -> "Touch":
        """A contact in millimetres and newtons."""
        x, y, fx, fy, fz = (
            round(float(value), 4) + 0.0  # no negative zero
            for value in (*contact.position * 1e3, *contact.force)
        )
        return cls(x_mm=x, y_mm=y, fx_N=fx, fy_N=fy, fz_N=fz)


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedTouch:
    """A scripted touch beside what the estimator said of it."""

    true: Touch
    """The touch as it was made."""
    estimated: Touch | None = None
    """The median over the hold; None where no contact was reported for most of it."""
    status: str
    """The commonest status while it was held; NO_READING where nothing was read then."""
    found: bool = False
    """Whether the estimate lies within 5 mm of the touch."""
    position_error_mm: float | None = None
    """Distance of the estimate from the touch."""
    force_error_percent: float | None = None
    """Error of the force vector, relative to the true force."""

    @property
    def was_read(self) -> bool:
        """Whether the skin was read at all while the touch was held."""
        return self.status != _UNREAD


class Hand:
    """The scripted hand, people's fingers beside it, and what was estimated meanwhile.

    It makes the touches of its script one after the other, and starts over if it shall repeat.
    """

    def __init__(self, script: Sequence[Contact], *, repeat: bool) -> None:
        self.fingers: tuple[Contact, ...] = ()
        """What people press the skin with."""
        self.still = False
        """Whether the hand stays where it is, beside their fingers."""
        self._kept: Contact | None = None
        self._script = script
        self._repeat = repeat
        self._start = math.inf
        self._held: dict[int, list[Estimate]] = {}
        self._latest = -math.inf
        self._lifted_until = -math.inf
        self._spoilt: set[int] = set()

    def begin(self, time: float) -> None:
        """Begin the first touch at this time, s, unless it has begun."""
        self._start = min(self._start, time)

    def lift(self, until: float) -> None:
        """Let go of the skin until this time, s; fingers too."""
        self._lifted_until = until

    def spoil(self, time: float) -> None:
        """Leave the touch of this time out of what is judged."""
        if time >= self._start:
            self._spoilt.add(self._phase(time)[0])

    def contacts(self, time: float) -> tuple[Contact, ...]:
        """What touches the skin at a time; fingers push aside a hand that does not stay."""
        if time < self._start:
            return ()
        # Times that differ in their last bits alone are one, lest the twin be solved for each.
        number, since = self._phase(round(time, 6))
        touch, fingers, lifted = self._touch(number), self.fingers, time < self._lifted_until
        self._kept = (self._kept or touch) if self.still else None
        if fingers or lifted or self._kept is not None:
            self._spoilt.add(number)
            hand = () if self._kept is None else (self._kept,)
            return () if lifted else (*hand, *fingers)
        strength = min(since / RAMP, 1.0, (HOLD + 2 * RAMP - since) / RAMP)
        if touch is None or strength <= 0:
            return ()
        return (Contact(position=touch.position, force=strength * touch.force),)

    def note(self, estimate: Estimate) -> None:
        """Keep an estimate that was made while a touch was held."""
        self._latest = estimate.time
        if estimate.time < self._start:
            return
        number, since = self._phase(estimate.time)
        if self._touch(number) is not None and RAMP < since < RAMP + HOLD:
            self._held.setdefault(number, []).append(estimate)

    def judge(self) -> tuple[JudgedTouch, ...]:
        """Every touch that the hand finished and nothing spoilt, read or not."""
        if self._latest < self._start:
            return ()
        number, since = self._phase(self._latest)
        finished = number + (since >= RAMP + HOLD)
        return tuple(
            judge(touch, self._held.get(number, []))
            for number in range(finished)
            if number not in self._spoilt and (touch := self._touch(number)) is not None
        )

    def _phase(self, time: float) -> tuple[int, float]:
        """Running number of a time's touch, and the time since that touch began, s."""
        number = math.floor((time - self._start) / PERIOD)
        return number, time - self._start - number * PERIOD

    def _touch(self, number: int) -> Contact | None:
        """The scripted touch of a running number."""
        if number < 0 or (number >= len(self._script) and not self._repeat):
            return None
        return self._script[number % len(self._script)]


def judge(true: Contact, held: Sequence[Estimate]) -> JudgedTouch:
    """A touch against the estimates made while it was held."""
    commonest = Counter(estimate.status for estimate in held).most_common(1)
    status = commonest[0][0] if commonest else None
    if status is not Status.CONTACT:
        name = _UNREAD if status is None else status.name
        return JudgedTouch(true=Touch.of(true), status=name)
    contacts = [contact for estimate in held for contact in estimate.contacts]
    median = Contact(
        position=np.median([contact.position for contact in contacts], axis=0),
        force=np.median([contact.force for contact in contacts], axis=0),
    )
    off = float(np.linalg.norm(median.position - true.position))
    missed = float(np.linalg.norm(median.force - true.force) / np.linalg.norm(true.force))
    return JudgedTouch(
        true=Touch.of(true),
        estimated=Touch.of(median),
        status=status.name,
        found=off <= _FOUND,
        position_error_mm=round(off * 1e3, 3),
        force_error_percent=round(100 * missed, 3),
    )
