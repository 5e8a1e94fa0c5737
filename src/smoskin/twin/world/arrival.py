"""How readings arrive: some late, some not at all."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from smoskin.records import Reading
from smoskin.twin.world.effect import Effect


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival(Effect):
    """Readings that are stamped when they arrive, late, or are lost one by one and in bursts."""

    on_bench = False
    delay: float = 5e-3
    """Mean delay, s: a busy USB bus. No reading overtakes another."""
    lost: float = 0.03
    """Chance of a reading to be lost."""
    burst: float = 0.01
    """Chance of a burst to begin, in which `length` readings in a row are lost."""
    length: int = 2

    def arrived(
        self, readings: Sequence[Reading | None], rng: np.random.Generator
    ) -> Sequence[Reading | None]:
        """As `Effect.arrived`."""
        count = len(readings)
        late = rng.exponential(self.delay, count)
        lost = rng.uniform(size=count) < self.lost
        for start in np.flatnonzero(rng.uniform(size=count) < self.burst):
            lost[start : start + self.length] = True
        out: list[Reading | None] = []
        last = -np.inf
        for reading, wait, gone in zip(readings, late.tolist(), lost.tolist(), strict=True):
            if reading is None or gone:
                out.append(None)
                continue
            last = max(reading.time + wait, last + 1e-6)
            out.append(replace(reading, time=last))
        return out
