"""The page's controls of a recording that is played: pause, place and speed.

Decides how long a hand on the slider is left alone, and what is said while the place that was
sought is not reached. Hides the viewer's widgets.
"""

import math
import time
from typing import TYPE_CHECKING, Final

from smoskin.service.replay import ReplaySource

if TYPE_CHECKING:
    import viser

_SPEEDS: Final = {"¼ ×": 0.25, "1 ×": 1.0, "4 ×": 4.0}
_HANDS_ON: Final = 0.7
"""s for which the slider stays where somebody has put it."""


class Player:
    """A folder of controls of what is played."""

    def __init__(self, server: "viser.ViserServer", source: ReplaySource) -> None:
        self._source = source
        self._moved = -math.inf
        gui, duration = server.gui, max(source.recording.duration, 1e-3)
        step = 10.0 ** math.floor(math.log10(duration) - 2)
        with gui.add_folder("Recording"):
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
        """Bring the slider up to date; a word and a sentence while a place is sought."""
        source = self._source
        if (goal := source.goal) is not None:
            return "Seeking", f"Reading on to {goal:.1f} s, now at {source.position:.1f} s."
        if time.monotonic() - self._moved > _HANDS_ON:
            self._place.value = min(source.position, self._place.max)  # type: ignore[misc]
        return None
