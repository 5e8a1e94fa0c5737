"""Recordings that are played on the page: their controls, and one that plays beside a live skin.

Decides how long a hand on the slider is left alone, and what is said while the place that was
sought is not reached. Hides the viewer's widgets and the thread that plays.
"""

import math
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Final

from smoskin.errors import RecordingError, SmoskinError
from smoskin.service.page.scene import Moment
from smoskin.service.recording import open_recording
from smoskin.service.replay import ReplaySource

if TYPE_CHECKING:
    import viser

_SPEEDS: Final = {"¼ ×": 0.25, "1 ×": 1.0, "4 ×": 4.0}
_HANDS_ON: Final = 0.7
"""s for which the slider stays where somebody has put it."""
_CLOSE_DEADLINE: Final = 5.0


class Player:
    """A folder of controls of what is played.

    It stands at a place among the page's controls; `caption` is what is said while it plays.
    """

    def __init__(
        self,
        server: "viser.ViserServer",
        source: ReplaySource,
        *,
        order: float | None = None,
        caption: str = "",
    ) -> None:
        self._source, self._caption = source, caption
        self._moved = -math.inf
        gui, duration = server.gui, max(source.recording.duration, 1e-3)
        step = 10.0 ** math.floor(math.log10(duration) - 2)
        self._folder = gui.add_folder("Recording", order=order)
        with self._folder:
            self._place = gui.add_slider(
                "Time, s",
                0.0,
                math.ceil(duration / step) * step,
                step,
                0.0,
                hint="Estimates there are those of playing on from the first reading.",
            )
            self._speed = gui.add_button_group("Speed", tuple(_SPEEDS))

        # The callbacks are coroutines so that the server runs them in order on its own loop.
        @self._place.on_update
        async def _(event: "viser.GuiEvent[viser.GuiSliderHandle[float]]") -> None:
            if event.client is not None:
                self._moved = time.monotonic()
                source.seek(float(self._place.value))

        @self._speed.on_click
        async def _(event: "viser.GuiEvent[viser.GuiButtonGroupHandle]") -> None:
            source.speed = _SPEEDS[str(event.target.value)]

    @property
    def stands(self) -> bool:
        """Whether nothing new is to be expected."""
        return self._source.paused or self._source.ended

    def write(self) -> tuple[str, str] | None:
        """Bring the slider up to date; a word and a sentence in place of the status, if any."""
        source = self._source
        if (goal := source.goal) is not None:
            return "Seeking", f"Reading on to {goal:.1f} s, now at {source.position:.1f} s."
        if time.monotonic() - self._moved > _HANDS_ON:
            self._place.value = min(source.position, self._place.max)  # type: ignore[misc]
        return ("Played back", self._caption) if self._caption else None

    def remove(self) -> None:
        """Take the controls off the page."""
        self._folder.remove()


class Rerun:
    """A recording that plays in a thread of its own, with the estimates that were made then.

    Parameters
    ----------
    path : Path

    Raises
    ------
    RecordingError
        If it cannot be read, or has no readings.
    """

    def __init__(self, path: Path) -> None:
        recording = open_recording(path)
        if not recording.reading_count:
            raise RecordingError(f"{path} has no readings")
        self.source = ReplaySource(recording, as_recorded=True)
        """Source of what is played; it stays behind its end."""
        self.source.stays = lambda: True
        self.newest: Moment | None = None
        """Moment that is shown of it."""
        self.failure = ""
        """Sentence about what has ended it."""
        self._thread = threading.Thread(target=self._run, name="smoskin-rerun", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        source = self.source
        try:
            while (reading := source.read()) is not None:
                if source.goal is None:
                    now = time.monotonic()
                    self.newest = Moment(reading, source.estimate, (), None, math.nan, now)
        except SmoskinError as error:
            self.failure = str(error)

    def close(self) -> None:
        """End the playing."""
        self.source.close()
        self._thread.join(_CLOSE_DEADLINE)
