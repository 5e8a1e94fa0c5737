"""A force gauge that is asked for its reading, as those of Mark-10 are.

Decides which units are forces and how fine a reading must be.

Source: Mark-10, user's guides of Series 4 and Series 5 digital force gauges, data communication:
``?`` asks for the reading, which comes as ``4.285 N``, compression positive; ``Z`` zeroes; lines
end with CR LF; what is not understood is answered with ``*10``.
"""

import re
from collections.abc import Mapping
from typing import Final, final

import numpy as np

from smoskin.arguments import typed
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.rig.line import TextLine, baud_of, place_of
from smoskin.hardware.rig.parts import Gauge

_ANSWER: Final = 1.0
"""Seconds in which a gauge answers."""
_COARSEST: Final = 10e-3
"""Largest step of a reading with which a skin can be touched off, N."""
_ZEROING: Final = 0.2
"""Seconds in which a gauge may say something of being zeroed."""
_TARES: Final = 8
"""Readings whose mean is no force."""
_STILL: Final = 30e-3
"""Range that those may have, N."""
_G: Final = 9.80665
_UNITS: Final[Mapping[str, float]] = {
    "N": 1.0,
    "mN": 1e-3,
    "kN": 1e3,
    "gF": 1e-3 * _G,
    "kgF": _G,
    "lbF": 0.45359237 * _G,
    "ozF": 0.45359237 * _G / 16,
}
_READING: Final = re.compile(r"([+-]?)\s*(\d{1,9})(?:\.(\d{0,9}))?\s*([A-Za-z]*)")


@final
class AsciiGauge(Gauge):
    """A force gauge on a serial port that answers ``?`` with a number and its unit.

    Parameters
    ----------
    port : str
        Device such as ``/dev/ttyUSB1``, or ``usb:SERIAL``.
    baud : int
    pressing : 1 or -1
        Sign that the gauge gives to a press.

    Raises
    ------
    ArgumentError
        If the sign is none.
    SourceError
        If the port cannot be opened, or no gauge answers that tells a fine force with its unit.
    MissingExtraError
        If pyserial is not installed.
    """

    @typed
    def __init__(self, port: str, *, baud: int = 115_200, pressing: int = 1) -> None:
        if pressing not in (1, -1):
            raise ArgumentError(f"pressing must be 1 or -1; got {pressing}")
        self._line = TextLine("gauge", port, baud)
        self._sign, self._offset = pressing, 0.0
        try:
            self.force()
        except BaseException:
            self._line.close()
            raise

    def force(self) -> float:
        """What the gauge feels, less what it felt when it was tared, N."""
        self._line.forget()
        self._line.send(b"?\r\n")
        return self._sign * newtons(self._line.line(_ANSWER)) - self._offset

    def tare(self) -> None:
        """Zero the gauge, and take the mean of what it still feels for no force."""
        # A gauge that zeroes by its key alone answers that it does not understand.
        self._line.send(b"Z\r\n")
        self._line.heard(_ZEROING)
        self._offset = 0.0
        self.force()
        felt = [self.force() for _ in range(_TARES)]
        if np.ptp(felt) > _STILL:
            raise SourceError(
                f"the gauge reads from {min(felt):.3f} to {max(felt):.3f} N while nothing touches: "
                "let it come to rest, keep vibrations away, or filter more"
            )
        self._offset = float(np.mean(felt))

    def close(self) -> None:
        """Let go of the port."""
        self._line.close()


def newtons(reply: str) -> float:
    """Force of a gauge's answer, N; a `SourceError` where it is no force, or a coarse one."""
    reading = _READING.fullmatch(reply)
    if reading is None:
        raise SourceError(
            f"the gauge answered {reply[:40]!r}, which is no reading: it must answer ? with a "
            "number and its unit"
        )
    sign, whole, part, unit = reading.groups()
    if unit not in _UNITS:
        raise SourceError(
            f"the gauge must tell its unit, one of {', '.join(_UNITS)}; got {reply[:40]!r}: set it "
            "to newtons, and its data format to number and unit"
        )
    step = 10.0 ** -len(part or "") * _UNITS[unit]
    if step > _COARSEST * (1 + 1e-9):
        raise SourceError(
            f"the gauge reads in steps of {1e3 * step:.3g} mN, which must be at most "
            f"{1e3 * _COARSEST:g} mN; got {reply[:40]!r}: set it to newtons, or take a finer one"
        )
    value = float(f"{whole}.{part or '0'}") * _UNITS[unit]
    return -value if sign == "-" else value


def open_gauge(url: str) -> AsciiGauge:
    """The gauge of a URL such as ``serial:///dev/ttyUSB1?pressing=negative``.

    Its options are ``baud`` (115200) and ``pressing``, the sign of a press (``positive``). It
    raises as `AsciiGauge`, and an `ArgumentError` if the URL is none of a gauge.
    """
    place, options = place_of("gauge", url, {"baud": "115200", "pressing": "positive"})
    signs = {"positive": 1, "negative": -1}
    if options["pressing"] not in signs:
        raise ArgumentError(f"pressing must be positive or negative; got {options['pressing']!r}")
    baud = baud_of("gauge", options["baud"])
    return AsciiGauge(place, baud=baud, pressing=signs[options["pressing"]])
