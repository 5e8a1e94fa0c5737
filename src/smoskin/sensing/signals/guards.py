"""Readings that cannot be true: chips that fail without a word, and clocks that start again.

Decides which numbers no chip says while it works: a field at the rail, a temperature outside the
chip's range, apart from the other chips' or jumping, a field that stays while the others' move.
Hides what must be remembered of earlier readings.
"""

import functools
import math
import operator
from collections.abc import Sequence
from typing import Final

import numpy as np

from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag, Reading, Status

PLAUSIBLE: Final = (-40.0, 125.0)
"""The chip's operating range, degC; a report outside it is not believed."""
BACK: Final = 2.0
"""Seconds by which a clock must go back to be one that has started again."""
_BAD: Final = int(ChipFlag.MISSING | ChipFlag.INVALID)
_FULL: Final = int(ChipFlag.SATURATED | ChipFlag.WRAPPED)
_OLD: Final = int(ChipFlag.OLD)
_KNOWN: Final = functools.reduce(operator.or_, map(int, ChipFlag))
_APART: Final = 15.0
"""Largest difference of temperature between chips of one skin, K."""
_JUMP: Final = (5.0, 1.0)
"""Largest change of a chip's temperature from reading to reading, K, and more for each second."""
_LARGEST: Final = 1e6
"""T; squares of more overflow."""
_STILL: Final = 10
"""Readings that a chip repeats to count as frozen, if the others have moved meanwhile."""
_MOVED: Final = 60e-6
"""Change of another chip's field along an axis, T, that no noise makes."""


def check_chips(reading: object, chips: int, owner: str) -> None:
    """Raise an `ArgumentError` unless this is a `Reading` of so many chips, as its owner has."""
    if not isinstance(reading, Reading):
        raise ArgumentError(f"reading must be a Reading; got {reading!r:.100}")
    if len(reading.field) != chips:
        raise ArgumentError(
            f"reading must come from {chips} chips, as the {owner} has; got {len(reading.field)}"
        )


class Clock:
    """Times of readings, which rise; a clock that goes back far has started again."""

    def __init__(self) -> None:
        self._last = -math.inf
        self.anew = False
        """Whether the last reading began a new clock."""

    def stale(self, time: float) -> bool:
        """Whether a reading at this time, s, is no newer than the last; the next one may follow."""
        if time > self._last:
            self._last, self.anew = time, False
            return False
        self.anew = time < self._last - BACK
        if self.anew:
            self._last = time
        return True


class ChipGuard:
    """Faults of the chips that are used, one reading after the other.

    Parameters
    ----------
    chips : sequence of int
        Chips that are used, by their place in a reading.
    setting : HallSetting, optional
        Setting of the chips, for their range; without it any field counts that squares well.
    """

    def __init__(self, chips: Sequence[int], setting: HallSetting | None = None) -> None:
        self._chips = list(chips)
        rail, jump = np.full(3, _LARGEST), np.full(3, np.inf)
        if setting is not None:
            full = mlx90393.full_scale(setting)
            if mlx90393.wraps(setting):
                rail, jump = np.full(3, 1.01 * float(full.max())), full
            else:
                # From there on the field may be anything beyond.
                rail = full - 1.5 * mlx90393.sensitivity(setting)
        self._rail: list[float] = np.tile(rail, len(self._chips)).tolist()
        self._jump: list[float] = np.tile(jump, len(self._chips)).tolist()
        self._wraps = bool(np.isfinite(jump).any())
        self.forget()

    def forget(self) -> None:
        """Forget earlier readings."""
        self._last: list[float] = []
        self._since = [0] * len(self._chips)
        self._then: list[list[float]] = [[]] * len(self._chips)
        self._warm = [math.nan] * len(self._chips)
        self._warm_time = -math.inf

    def bad(self, reading: Reading) -> Status | None:
        """What is wrong with a reading by itself."""
        return self._marked(reading) or self._limits(self._values(reading), self._warmth(reading))

    def step(self, reading: Reading) -> Status | None:
        """What is wrong with the next reading, by itself or after those before it."""
        marked = self._marked(reading)
        if marked is not None:
            return marked
        # Plain numbers: for nine of them NumPy takes longer to start than Python to finish.
        values, warmth = self._values(reading), self._warmth(reading)
        fault = self._limits(values, warmth)
        if fault is not None:
            return fault
        if self._heated(reading.time, warmth):
            return Status.CHIP_MISSING
        frozen = self._frozen(values)
        wrapped = self._wraps and any(
            abs(now - before) > jump
            for now, before, jump in zip(values, self._last, self._jump, strict=False)
        )
        if wrapped:
            return Status.SATURATED
        self._last = values
        return Status.CHIP_MISSING if frozen else None

    def _values(self, reading: Reading) -> list[float]:
        """Fields of the used chips in a row."""
        rows: list[float] = reading.field.ravel().tolist()
        if len(rows) == 3 * len(self._chips):
            return rows
        return [value for chip in self._chips for value in rows[3 * chip : 3 * chip + 3]]

    def _warmth(self, reading: Reading) -> list[float]:
        """Temperatures of the used chips."""
        given: list[float] = reading.temperature.tolist()
        return [given[chip] for chip in self._chips]

    def _marked(self, reading: Reading) -> Status | None:
        """What the flags of the used chips say."""
        marks = reading.flags.tolist()
        if not any(marks):
            return None
        flags = functools.reduce(operator.or_, [marks[chip] for chip in self._chips])
        if flags & ~_KNOWN or flags & _BAD:
            return Status.CHIP_MISSING
        if flags & _FULL:
            return Status.SATURATED
        return Status.STALE if flags & _OLD else None

    def _limits(self, values: list[float], warmth: list[float]) -> Status | None:
        """What no chip can say, of fields and temperatures."""
        for value, rail in zip(values, self._rail, strict=True):
            if not -rail < value < rail:
                finite = all(map(math.isfinite, values))
                return Status.SATURATED if finite else Status.CHIP_MISSING
        (least, most), low, high = PLAUSIBLE, math.inf, -math.inf
        for degrees in warmth:
            if degrees < low:
                low = degrees
            if degrees > high:
                high = degrees
        # Chips that tell no temperature are as warm as each other, and within every limit.
        if not (least < low and high < most and high - low < _APART):
            return Status.CHIP_MISSING
        return None

    def _heated(self, time: float, warmth: list[float]) -> bool:
        """Whether a chip's temperature has jumped since it was last believed."""
        step, rate = _JUMP
        most = step + rate * (time - self._warm_time)
        warm = []
        for now, last in zip(warmth, self._warm, strict=True):
            if abs(now - last) > most:
                return True
            warm.append(now if now == now else last)
        self._warm, self._warm_time = warm, time
        return False

    def _frozen(self, values: list[float]) -> bool:
        """Whether a chip repeats its field to the bit while the others' fields move."""
        frozen, last, since = False, self._last, self._since
        for k in range(len(since)):
            own = slice(3 * k, 3 * k + 3)
            if values[own] != last[own]:
                since[k], self._then[k] = 0, values
                continue
            since[k] += 1
            if since[k] >= _STILL:
                then = self._then[k]
                frozen |= any(abs(a - b) > _MOVED for a, b in zip(values, then, strict=True))
        return frozen
