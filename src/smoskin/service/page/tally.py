"""What the page remembers of the touches so far: how many, where, and how far off they were.

Decides what one touch is (from the first estimate of a contact to the first without) and that its
error is the median over it. Hides the open touch.
"""

import math
from collections import deque
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.records import Status
from smoskin.service.page.parts import html
from smoskin.service.page.scene import ESTIMATED, Moment

JUMP: Final = 3.0
"""s from one moment to the next past which it does not follow it."""
_TRAIL: Final = 150
_BINS: Final = 12
"""Squares of the map along each side of the skin."""


class Tally:
    """The touches so far on a skin of this extent (2,), m.

    Where moments are counted `once`, by their times, one that is shown again adds nothing, nor does
    the rest of a touch of which a part is shown again.
    """

    def __init__(self, extent: Floats, *, once: bool = False) -> None:
        self._extent = extent
        self._once = once
        self._seen: set[float] = set()
        self._last = math.nan
        self._counted = False
        """Whether the touch that is shown is one of those counted."""
        self._counts = np.zeros((_BINS, _BINS), dtype=int)
        self._errors: list[float] = []
        self._open: list[tuple[Floats, float]] = []
        self._trail: deque[Floats] = deque(maxlen=_TRAIL)
        self.touches = 0

    @property
    def trail(self) -> Floats:
        """Places that were estimated last, (N, 2), m, the oldest first."""
        return np.array(self._trail).reshape(-1, 2)

    def add(self, moment: Moment) -> None:
        """Take note of what a moment shows."""
        estimate, time = moment.estimate, moment.reading.time
        if not 0.0 < time - self._last <= JUMP:
            self._finish()
        again, self._last = time in self._seen, time
        if self._once:
            self._seen.add(time)
        if estimate is None or estimate.status is not Status.CONTACT:
            self._finish()
            return
        places = [contact.position for contact in estimate.contacts]
        self._trail.extend(places)
        if again or self._counted:
            self._counted, self._open = True, []
            return
        for place in places:
            offs = [float(np.linalg.norm(place - true.position)) for true in moment.truth]
            self._open.append((place, min(offs, default=np.nan)))

    def html(self) -> str:
        """The count, the error and the map, as HTML."""
        many = f"{self.touches} touch{'' if self.touches == 1 else 'es'} so far"
        if self._errors:
            many += f", off by {np.median(self._errors) * 1e3:.1f} mm (median)"
        width, depth = (self._extent * 1e3).round(1)
        step = np.array((width, depth)) / _BINS
        color, most = ",".join(map(str, ESTIMATED)), max(int(self._counts.max()), 1)
        spots = "".join(
            f'<rect x="{i * step[0]:.1f}" y="{depth - (j + 1) * step[1]:.1f}" '
            f'width="{step[0]:.1f}" height="{step[1]:.1f}" '
            f'fill="rgba({color},{0.25 + 0.75 * count / most:.2f})"/>'
            for (i, j), count in np.ndenumerate(self._counts)
            if count
        )
        return html(
            "tally",
            sentence=many,
            box=f"-30 -2 {width + 34:g} {depth + 14:g}",
            width=f"{width:g}",
            depth=f"{depth:g}",
            below=f"{depth + 9:g}",
            spots=spots,
        )

    def _finish(self) -> None:
        """Count the touch that has ended, if one was open."""
        self._counted = False
        if not self._open:
            return
        places, errors = zip(*self._open, strict=True)
        self._open = []
        self.touches += 1
        if np.isfinite(errors).any():
            self._errors.append(float(np.nanmedian(errors)))
        share = np.median(places, axis=0) / self._extent
        i, j = np.clip((share * _BINS).astype(int), 0, _BINS - 1)
        self._counts[i, j] += 1
