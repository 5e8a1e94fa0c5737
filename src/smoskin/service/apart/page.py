"""The live page of a live source, in a process of its own: drawing takes no time from the loop.

Decides how often the page is told of a moment, and what it is told of the pace.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, final

from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.errors import require
from smoskin.records import Contact, Estimate, Reading
from smoskin.roles import Sink
from smoskin.service.apart.process import Remote
from smoskin.service.page.carpet import Bound
from smoskin.service.page.view import View

_EVERY: Final = 1.0 / 25.0
"""s: the page draws no more often."""
_RATE_WINDOW: Final = 1.0


@final
class PageApart(Sink):
    """A `View` in a process of its own: a sink that never waits and shows the newest reading.

    Takes what `View` takes but a player, and raises the same errors. Callbacks are called from a
    thread of the page.
    """

    def __init__(
        self, design: SkinDesign, **options: Callable[..., None] | Sequence[str] | int | None
    ) -> None:
        require("the live page", "view", "viser")
        self._remote = Remote(View, design, attributes=("url",), every=_EVERY, **options)
        self.url: str = self._remote.values["url"]
        """Address of the page, with the token that lets a browser in."""
        self._count, self._since, self._rate = 0, time.monotonic(), 0.0

    def show_bound(self, bound: Bound) -> None:
        """As `View.show_bound`."""
        self._remote.tell("show_bound", bound)

    def show_drift(self, drift: Floats) -> None:
        """As `View.show_drift`."""
        self._remote.tell("show_drift", drift)

    def show_recording(self, goes_on: bool, sentence: str, finished: Path | None = None) -> None:
        """As `View.show_recording`."""
        self._remote.tell("show_recording", goes_on, sentence, finished)

    def write(
        self,
        reading: Reading,
        estimate: Estimate | None = None,
        *,
        truth: Sequence[Contact] = (),
        vertices: Floats | None = None,
    ) -> None:
        """As `View.write`."""
        now = time.monotonic()
        self._count += 1
        if (elapsed := now - self._since) >= _RATE_WINDOW:
            self._rate, self._count, self._since = self._count / elapsed, 0, now
        self._remote.tell(
            "write", reading, estimate, truth=truth, vertices=vertices, rate=self._rate
        )

    def close(self) -> None:
        """As `View.close`."""
        self._remote.close()
