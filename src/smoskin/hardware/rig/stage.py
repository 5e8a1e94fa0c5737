"""A stage whose controller speaks GRBL 1.1.

Decides that every move is a jog in machine coordinates, since a feed hold ends a jog for good
instead of keeping the rest of the move for later. Hides status reports and the numbers of alarms.

Source: grbl 1.1, doc/markdown/{commands,interface,jogging}.md.
"""

import re
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Final, final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.rig.line import TextLine, baud_of, place_of
from smoskin.hardware.rig.parts import Stage

_ANSWER: Final = 2.0
"""Seconds in which the controller answers; one that starts when its port opens takes over one."""
_STOPPING: Final = 1.0
"""Seconds after which a stage that was told to stop is reset."""
_REPORTING: Final = 0.3
"""Seconds after which a status report is asked for again."""
_LOOK: Final = 0.01
"""Seconds between two looks at a moving stage."""
_THERE: Final = 20e-6
"""Distance up to which a stage is where it was sent, m."""
_HOLD, _CANCEL, _RESUME, _RESET = b"!", b"\x85", b"~", b"\x18"
_ALARMS: Final[Mapping[str, str]] = {
    "1": "a limit switch was hit",
    "2": "the target was beyond its travel",
    "3": "it was reset in motion",
}
_ERRORS: Final[Mapping[str, str]] = {
    "8": "it is not idle",
    "9": "it is locked by an alarm",
    "15": "the target is beyond its travel",
}
_REPORT: Final = re.compile(r"<(\w+)(?::\d+)?((?:\|[^|<>]*)*)>")


@final
class GrblStage(Stage):
    """A stage of three axes on a serial port, its places those of the machine.

    A stage that is in alarm is refused: it is for its owner to free and to home it.

    Parameters
    ----------
    port : str
        Device such as ``/dev/ttyUSB0``, or ``usb:SERIAL``.
    baud : int

    Raises
    ------
    SourceError
        If the port cannot be opened, or no GRBL answers on it, or it is in alarm.
    MissingExtraError
        If pyserial is not installed.
    """

    @typed
    def __init__(self, port: str, *, baud: int = 115_200) -> None:
        self._line = TextLine("stage", port, baud)
        self._offset: Floats | None = None
        try:
            self.where()
        except BaseException:
            self._line.close()
            raise

    def where(self) -> Floats:
        """Place of the machine, shape (3,), m; raises as `Stage.where`."""
        return self._look()[1]

    @typed
    def move(self, target: Floats, speed: float, timeout: float) -> None:
        """Jog there and stand; raises as `Stage.move`."""
        if np.shape(target) != (3,) or not np.isfinite(target).all():
            raise ArgumentError(f"target must be three finite places; got {target}")
        if not 0.0 < speed < np.inf:
            raise ArgumentError(f"speed must be positive and finite; got {speed} m/s")
        end = time.monotonic() + timeout
        x, y, z = 1e3 * np.asarray(target)
        self._line.forget()
        self._be_idle()
        words = f"$J=G53 G90 G21 X{x:.4f} Y{y:.4f} Z{z:.4f} F{60e3 * speed:.2f}\n"
        self._line.send(words.encode())
        self._accept()
        while True:
            state, place = self._look()
            if state == "Idle":
                break
            if time.monotonic() > end:
                self.stop()
                raise SourceError(
                    f"the stage was not where it was sent within {timeout:.3g} s and was stopped: "
                    "is something in its way, or its highest rate ($110 to $112) low?"
                )
            time.sleep(_LOOK)
        if np.abs(place - target).max() > _THERE:
            raise SourceError(
                f"the stage was stopped on its way, {1e3 * np.abs(place - target).max():.2f} mm "
                "before the end"
            )

    def stop(self) -> None:
        """End the jog; raises as `Stage.stop`."""
        self._line.send(_HOLD + _CANCEL)

    def close(self) -> None:
        """Stop what moves and let go of the port."""
        with suppress(SourceError):
            self._line.send(_CANCEL)  # a hold would outlast the port
        self._line.close()

    def _be_idle(self) -> None:
        """Wait until an earlier stop is over, and reset a controller that goes on all the same."""
        end = time.monotonic() + _STOPPING
        while (state := self._look()[0]) != "Idle":
            if time.monotonic() > end:
                self._line.send(_RESET)
                raise SourceError(
                    f"the stage stayed in the state {state} and was reset: look what holds it, "
                    "home it ($H) and begin again"
                )
            if state == "Hold":
                self._line.send(_RESUME)  # the jog itself is gone
            time.sleep(_LOOK)

    def _accept(self) -> None:
        """Wait until the controller has taken a line."""
        end = time.monotonic() + _ANSWER
        while (line := self._line.line(max(end - time.monotonic(), 0.0))) != "ok":
            if line.startswith("error:"):
                code = line.removeprefix("error:")
                raise SourceError(
                    f"the stage refused a move: {_ERRORS.get(code, f'GRBL error {code}')}; look "
                    "at the origin, the plan and the stage's own travel"
                )
            _raise_alarm(line)

    def _look(self) -> tuple[str, Floats]:
        """State and place of the stage, from its next status report."""
        end = time.monotonic() + _ANSWER
        while time.monotonic() < end:
            self._line.send(b"?")
            while (line := self._line.heard(_REPORTING)) is not None:
                _raise_alarm(line)
                if line.startswith("<"):
                    if (place := self._place(line)) is not None:
                        return place
                    break
        raise self._line.silence(_ANSWER)

    def _place(self, line: str) -> tuple[str, Floats] | None:
        """State and place of a report; None where it tells none, or not yet by which offset."""
        report = _REPORT.fullmatch(line)
        if report is None:
            return None
        state, rest = report.groups()
        if state == "Alarm":
            raise SourceError(
                "the stage is in alarm and does not move: free the probe by hand, home the stage "
                "($H) and begin again"
            )
        fields = dict(part.partition(":")[::2] for part in rest.split("|")[1:])
        numbers = {}
        with suppress(ValueError):
            for name in fields.keys() & {"MPos", "WPos", "WCO"}:
                axes = [float(text) for text in fields[name].split(",")]
                if len(axes) >= 3 and np.isfinite(axes).all():
                    numbers[name] = 1e-3 * np.array(axes[:3])
        self._offset = numbers.get("WCO", self._offset)
        if "MPos" in numbers:
            return state, numbers["MPos"]
        if "WPos" in numbers and self._offset is not None:
            return state, numbers["WPos"] + self._offset
        return None


def _raise_alarm(line: str) -> None:
    """Raise where a line is an alarm."""
    if line.startswith("ALARM:"):
        code = line.removeprefix("ALARM:")
        raise SourceError(
            f"the stage is in alarm: {_ALARMS.get(code, f'GRBL alarm {code}')}; free the probe by "
            "hand, home the stage ($H) and begin again"
        )


def open_stage(url: str) -> GrblStage:
    """The stage of a URL such as ``serial:///dev/ttyUSB0``, with ``baud`` (115200) as an option.

    It raises as `GrblStage`, and an `ArgumentError` if the URL is none of a stage.
    """
    place, options = place_of("stage", url, {"baud": "115200"})
    return GrblStage(place, baud=baud_of("stage", options["baud"]))
