"""Lines of text to and from a serial port, each within its time.

Decides how long an instrument may be silent and how long a line may be.
"""

import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Final, final
from urllib.parse import parse_qsl

from smoskin.errors import ArgumentError, SourceError, require
from smoskin.hardware.serial import open_port
from smoskin.roles import Resource

_LOOK: Final = 0.02
"""Seconds for which one read of the port waits."""
_LONGEST: Final = 500
"""Characters that a line may have."""


@final
class TextLine(Resource):
    """An instrument on a serial port that speaks lines; `what` it is goes into the errors."""

    def __init__(self, what: str, place: str, baud: int) -> None:
        require(f"a {what} on a serial port", "hardware", "serial")
        self.what = what
        self.place = place
        self._port = open_port(place, baud, _LOOK)
        self._heard = b""
        self._writing = threading.Lock()

    def send(self, data: bytes) -> None:
        """Send these bytes; from any thread."""
        try:
            with self._writing:
                self._port.write(data)
        except (OSError, TypeError, ValueError) as error:
            raise self._gone() from error

    def line(self, timeout: float) -> str:
        """The next line that is not empty, without its end; `SourceError` if none comes in time."""
        line = self.heard(timeout)
        if line is None:
            raise self.silence(timeout)
        return line

    def heard(self, timeout: float) -> str | None:
        """The next line that is not empty, without its end; None if none comes in time."""
        end = time.monotonic() + timeout
        while True:
            text, newline, rest = self._heard.partition(b"\n")
            if newline:
                self._heard = rest
                if line := text.decode("ascii", "replace").strip():
                    return line
                continue
            if len(self._heard) > _LONGEST:
                raise SourceError(
                    f"{self.what} on {self.place} sends no lines: is its baud rate right?"
                )
            if time.monotonic() > end:
                return None
            try:
                self._heard += self._port.read(1)
                self._heard += self._port.read(self._port.in_waiting)
            except (OSError, TypeError, ValueError) as error:
                raise self._gone() from error

    def silence(self, timeout: float) -> SourceError:
        """The error of an instrument that has said nothing of use for so many seconds."""
        return SourceError(
            f"{self.what} on {self.place} has not answered within {timeout:g} s: is it on, is it "
            "the right port, and is its baud rate right?"
        )

    def forget(self) -> None:
        """Leave out what has come and was not asked for."""
        self._heard = b""
        try:
            self._port.reset_input_buffer()
        except (OSError, TypeError, ValueError) as error:
            raise self._gone() from error

    def close(self) -> None:
        """Let go of the port."""
        with suppress(OSError):
            self._port.close()

    def _gone(self) -> SourceError:
        return SourceError(f"{self.what} on {self.place} is gone: is its cable plugged in?")


def place_of(what: str, url: str, usual: Mapping[str, str]) -> tuple[str, dict[str, str]]:
    """Port and options of a URL such as ``serial:///dev/ttyUSB0?baud=9600``.

    An option that is not among the usual ones, or a URL of another kind, is an `ArgumentError`.
    """
    scheme, _, rest = url.partition("://")
    place, _, query = rest.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    if scheme != "serial" or not place or not options.keys() <= usual.keys():
        raise ArgumentError(
            f"{what} must be serial://PORT, with the options {', '.join(usual)}; got {url!r}"
        )
    return place, {**usual, **options}


def baud_of(what: str, text: str) -> int:
    """A baud rate, or an `ArgumentError` that says whose it is."""
    if not text.isascii() or not text.isdecimal() or not 300 <= int(text) <= 4_000_000:
        raise ArgumentError(f"baud of the {what} must be a rate from 300 to 4000000; got {text!r}")
    return int(text)
