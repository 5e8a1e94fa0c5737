"""Estimates as lines, and the summary at their end.

Decides which estimates are worth a line, and what is said of it all.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, Final

from smoskin.records import Estimate, Status
from smoskin.service.bridges.values import estimate_values

_TOLD: Final = ("corrupt", "repeated", "late", "dropped", "restarts", "reconnections")
"""Counters of a line that a summary tells where they are not 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What was read, in a few numbers."""

    readings: int
    rate_hz: float | None
    """Rate of the last thousand readings."""
    latency_ms_median: float | None
    latency_ms_p99: float | None
    """Time from a reading's arrival until it is estimated and recorded."""
    statuses: dict[str, int]
    """Estimates of each status that occurred."""
    touches: int
    """How often an untouched skin became a touched one."""
    skipped: int
    """Readings that the source left out because nobody asked in time."""
    lost: int
    """Readings that are missing from the recording that was played, or on a board's line."""
    damage: str
    """Sentence about that recording's damage; empty where it is whole."""
    line: dict[str, int]
    """Counters of a board's serial line (`LineCounters`); empty for any other source."""
    not_recorded: int
    """Readings that could not be written."""
    failure: str
    """Sentence about why; empty where all could be."""

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines."""
        return asdict(self)

    def __str__(self) -> str:
        statuses = ", ".join(f"{count} {name}" for name, count in self.statuses.items())
        parts = [
            f"{self.readings} readings" + (f": {statuses}" if statuses else ""),
            f"{self.touches} touches",
            f"{self.rate_hz:.0f} Hz" if self.rate_hz else "",
            f"estimated in {self.latency_ms_median:.2f} ms, 99 % in {self.latency_ms_p99:.2f} ms"
            if self.latency_ms_median is not None and self.latency_ms_p99 is not None
            else "",
            f"{self.skipped} skipped" if self.skipped else "",
            f"{self.lost} lost" if self.lost else "",
            *(f"{count} {name}" for name, count in self.line.items() if name in _TOLD and count),
            f"{self.not_recorded} not recorded" if self.not_recorded else "",
        ]
        return "; ".join(filter(None, parts)) + "."


def thinned(
    estimates: Iterator[Estimate], *, every: float | None = None, changes: bool = False
) -> Iterator[tuple[Estimate, bool]]:
    """Estimates, and whether each is worth a line.

    With neither option all are; with `every` one in so many seconds is, with `changes` one whose
    status or number of touches differs from the one before.
    """
    due = -math.inf
    before: tuple[Status, int] | None = None
    for estimate in estimates:
        state = estimate.status, len(estimate.contacts)
        # A clock that was set back counts from there.
        late = every is not None and not due - every <= estimate.time < due
        if late:
            due = estimate.time + (every or 0.0)
        yield estimate, late or (changes and state != before) or (every is None and not changes)
        before = state


def estimate_line(estimate: Estimate, *, as_json: bool) -> str:
    """One estimate as a line of text, or of JSON, in millimetres and newtons."""
    values = estimate_values(estimate)
    if as_json:
        return json.dumps(values)
    places = "".join(
        f"  x {touch['x_mm']:6.1f} mm  y {touch['y_mm']:6.1f} mm  "
        "F ({:+.3f}, {:+.3f}, {:+.3f}) N".format(*touch["force_N"])
        for touch in values["contacts"]
    )
    return f"{estimate.time:10.3f} s  {estimate.status.name:<14}{places}"
