"""Boards on a serial port, of this package's format or by others.

Decides when a port is opened again, what a reading's time is, and what is said of a port from which
nothing useful comes. Hides the thread that reads, so that no byte waits for whoever is slow.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SourceError, require
from smoskin.hardware.clock import BoardClock
from smoskin.hardware.wire.foreign import AnySkinDecoder, EfleshDecoder
from smoskin.hardware.wire.messages import BoardDecoder, Kind, command, set_command
from smoskin.hardware.wire.packet import FORMATS, Decoder, Packet
from smoskin.records import ChipFlag, Reading
from smoskin.roles import Source

_BAUD: Final = 115_200
"""Usual baud rate; ports over USB take any."""
_OWN_BAUD: Final[Mapping[str, int]] = {"eflesh": 921_600}
"""Usual baud rate of formats that have another."""
_LATE: Final = 20e-3
"""Seconds behind the least delayed frames from which a frame is late."""
_KEPT: Final = 10_000
"""Readings that wait for whoever reads, if nobody says otherwise; older ones are dropped."""
_LOOK: Final = 0.1
"""Seconds after which the reading thread looks whether it is to end."""
_AGAIN: Final = 0.25
"""Seconds between attempts to open a port that is gone."""
_SETTING: Final = 2.0
"""Seconds in which a board that is told a setting takes it."""
_HEARD: Final = 4096
"""Bytes that are kept to tell which format they are of."""
_USB: Final = "usb:"


@dataclass(frozen=True, slots=True, kw_only=True)
class LineCounters:
    """What has come over a line so far."""

    readings: int
    """Readings that were made."""
    lost: int
    """Frames that are missing by their numbers."""
    corrupt: int
    """Stretches of bytes that were no whole frame; the one cut by the start counts."""
    repeated: int
    """Frames that came again, and were left out."""
    late: int
    """Frames that came more than 20 ms later than the quickest."""
    dropped: int
    """Readings that nobody asked for in time."""
    restarts: int
    """Times that the board has started again."""
    reconnections: int
    """Times that the port was gone and opened again."""


@final
class SerialSource(Source):
    """Readings of a board on a serial port.

    Times are the host's, s, from 0 when the source was opened; a board that tells its own has them
    mapped (`BoardClock`), any other is timed by arrival. A port that vanishes is opened again as
    soon as it is back: for `patience` seconds `read` waits for that.

    Parameters
    ----------
    port : str
        Device such as ``/dev/ttyACM0``, or ``usb:SERIAL``, the board of this USB serial number.
    format : "smoskin", "anyskin" or "eflesh"
    design : SkinDesign, optional
        Design of the skin; needed where the format is this package's own, whose readings come in
        the order of its chips.
    chips : int, optional
        Chips of a board of another format; those of the design, or five, by default.
    rate : float, optional
        Readings a second to ask of a board of this package's own format, Hz.
    baud : int, optional
        Baud rate; the format's usual one by default.
    patience : float
        Seconds for which a port that is gone is waited for.

    Raises
    ------
    ArgumentError
        If the format is unknown, or design and chips do not suit it.
    SourceError
        If the port cannot be opened.
    MissingExtraError
        If pyserial is not installed.
    """

    @typed
    def __init__(
        self,
        port: str,
        *,
        format: str = "smoskin",
        design: SkinDesign | None = None,
        chips: int | None = None,
        rate: float | None = None,
        baud: int | None = None,
        patience: float = 10.0,
    ) -> None:
        if format not in FORMATS:
            raise ArgumentError(f"format must be one of {', '.join(FORMATS)}; got {format!r}")
        if format == "smoskin" and design is None:
            raise ArgumentError("design must be given for a board of the format smoskin")
        planned = None if design is None else len(design.halls)
        if chips is not None and planned is not None and chips != planned:
            raise ArgumentError(f"chips must be the design's {planned}; got {chips}")
        if not patience >= 0.0:
            raise ArgumentError(f"patience must be >= 0 s; got {patience}")
        require("a board on a serial port", "hardware", "serial")
        self._chips = chips or planned or 5
        self._design, self._place, self._patience = design, port, patience
        self._baud = _OWN_BAUD.get(format, _BAUD) if baud is None else baud
        self._greeting, self._asks = b"", rate is not None
        if format == "smoskin" and design is not None:
            self._greeting = command(Kind.IDENTIFY)
            if rate is not None:
                self._greeting += set_command(design.hall_setting, rate)
        self.decoder = decoder_of(format, self._chips)
        """Decoder of the line, with its counters and what the board has said of itself."""
        self._clock = BoardClock()
        self.room = _KEPT
        """Readings that may wait; who wants the newest rather than all of them allows fewer."""
        self._ready: deque[Reading] = deque()
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._heard = bytearray()
        self._readings = self._late = self._dropped = self._reconnections = 0
        self._fault: SourceError | None = None
        self._here = True
        self._start = time.monotonic()
        self._arrived = self._last_time = 0.0
        self._greeted = 0.0
        self._port = self._opened()
        self._thread = threading.Thread(target=self._listen, name=f"smoskin {port}", daemon=True)
        self._thread.start()

    @property
    def chips(self) -> int:
        """Number of chips in every reading."""
        return self._chips

    @property
    def design(self) -> SkinDesign | None:
        """Design of the skin, if it is known."""
        return self._design

    @property
    def design_hash(self) -> str | None:
        """Content hash of the skin's design, if it is known."""
        return None if self._design is None else self._design.content_hash

    @property
    def drift(self) -> float:
        """How much faster the host's clock runs than the board's, s a second."""
        return self._clock.drift

    @property
    def counters(self) -> LineCounters:
        """What has come over the line so far."""
        decoder = self.decoder
        return LineCounters(
            readings=self._readings,
            lost=decoder.lost,
            corrupt=decoder.corrupt,
            repeated=decoder.repeated,
            late=self._late,
            dropped=self._dropped,
            restarts=decoder.restarts,
            reconnections=self._reconnections,
        )

    def read(self, timeout: float = 1.0) -> Reading | None:
        """The next reading, as soon as it is there; None when closed."""
        start = time.monotonic()
        with self._changed:
            while not self._ready:
                if self._closing.is_set():
                    return None
                if self._fault is not None:
                    raise self._fault
                waited = time.monotonic() - start
                allowed = timeout if self._here else max(timeout, self._patience)
                if waited >= allowed:
                    raise SourceError(f"no reading within {timeout} s; {self._silence()}")
                self._changed.wait(min(allowed - waited, _LOOK))
            return None if self._closing.is_set() else self._ready.popleft()

    def close(self) -> None:
        """End the readings and let go of the port; a waiting `read` returns."""
        self._closing.set()
        with self._changed:
            self._changed.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join(2.0)

    def _opened(self) -> Any:
        """The port, open, with what is to be said to the board sent."""
        port = open_port(self._place, self._baud, _LOOK)
        try:
            port.write(self._greeting)
            self._greeted = time.monotonic() - self._start
        except OSError as error:
            port.close()
            raise SourceError(f"{self._place} takes no command: {_reason(error)}") from error
        return port

    def _listen(self) -> None:
        """Read until closed, opening the port again when it is gone."""
        try:
            while not self._closing.is_set():
                try:
                    data = self._port.read(1)
                    data += self._port.read(self._port.in_waiting)
                except (OSError, TypeError, ValueError):
                    self._reopen()
                    continue
                if data:
                    self._take(data, time.monotonic() - self._start)
        except SourceError as error:
            with self._changed:
                self._fault = error
                self._changed.notify_all()
        finally:
            self._port.close()

    def _reopen(self) -> None:
        """Wait until the port is back, and open it."""
        self._here = False
        self._port.close()
        while not self._closing.wait(_AGAIN):
            try:
                self._port = self._opened()
            except SourceError:
                continue
            self._reconnections += 1
            self.decoder.forget()
            self._clock.forget()
            self._here = True
            return

    def _take(self, data: bytes, arrival: float) -> None:
        """Make readings of bytes that came at this time."""
        self._heard = (self._heard + data)[-_HEARD:]
        restarts = self.decoder.restarts
        packets = [each for each in self.decoder.feed(data) if self._suits(each, arrival)]
        if self.decoder.restarts != restarts:
            self._clock.forget()
        readings = []
        for number, packet in enumerate(packets, 1):
            if packet.time is None:
                # What came together was measured one after the other.
                moment = self._arrived + (arrival - self._arrived) * number / len(packets)
            else:
                moment = self._clock.host_time(packet.time, arrival)
                self._late += arrival - moment > _LATE
            self._last_time = max(moment, self._last_time + 1e-6) if self._readings else moment
            self._readings += 1
            readings.append(self._reading(packet, self._last_time))
        if packets:
            self._arrived = arrival
            with self._changed:
                self._ready.extend(readings)
                while len(self._ready) > self.room:
                    self._ready.popleft()
                    self._dropped += 1
                self._changed.notify_all()

    def _suits(self, packet: Packet, arrival: float) -> bool:
        """Whether the chips have the design's setting; a board that was told it needs a while."""
        if packet.setting is None or self._design is None:
            return True
        if packet.setting == self._design.hall_setting:
            return True
        if self._asks and arrival - self._greeted < _SETTING:
            return False
        raise SourceError(
            f"{self._place} must have its chips at the setting of the design; it has "
            f"{packet.setting}; a rate, as in ?rate=100, makes it take the design's"
        )

    def _reading(self, packet: Packet, moment: float) -> Reading:
        """The reading of a packet, its chips in the order of the design."""
        order: Any = slice(None)
        if packet.addresses and self._design is not None:
            wanted = [site.address for site in self._design.halls]
            if sorted(wanted) != sorted(packet.addresses):
                raise SourceError(
                    f"{self._place} must have chips at {_hex(wanted)}, as the design has; it has "
                    f"{_hex(packet.addresses)}"
                )
            order = [packet.addresses.index(address) for address in wanted]
        return Reading(
            time=moment,
            field=packet.field[order],
            temperature=packet.temperature[order],
            flags=np.asarray(packet.flags)[order],
        )

    def _silence(self) -> str:
        """Why there may be no reading, as a sentence."""
        if not self._here:
            return f"{self._place} is gone: is the board plugged in?"
        if not self._heard:
            return (
                f"{self._place} is open and silent: is it the right port, and has the board been "
                "told to send?"
            )
        formats = [name for name in recognised(bytes(self._heard)) if name != self.decoder.format]
        if formats:
            return f"the board speaks the format {formats[0]}: use format={formats[0]}"
        return (
            f"{len(self._heard)} bytes came and none is of the format {self.decoder.format}: is "
            "baud right, and the number of chips?"
        )


def decoder_of(format: str, chips: int) -> Decoder:
    """A decoder of a format by its name, for so many chips where the format does not tell."""
    makers: dict[str, Callable[[], Decoder]] = {
        "smoskin": BoardDecoder,
        "anyskin": lambda: AnySkinDecoder(chips),
        "eflesh": lambda: EfleshDecoder(chips),
    }
    return makers[format]()


def recognised(data: bytes) -> tuple[str, ...]:
    """Formats of which these bytes hold frames, boards by others having one to ten chips.

    A name with a number, such as ``anyskin&chips=4``, is that of a board of other than five chips.
    """
    names = []
    for format in FORMATS:
        best = max(range(1, 11), key=lambda chips: (_good(format, chips, data), chips == 5))
        if _good(format, best, data) > 1:
            usual = best == 5 or format == "smoskin"
            names.append(format if usual else f"{format}&chips={best}")
    return tuple(names)


def _good(format: str, chips: int, data: bytes) -> int:
    """How many chips have something true to say in all frames that these bytes hold."""
    packets = decoder_of(format, chips).feed(data)
    return sum(int((packet.flags & int(ChipFlag.MISSING) == 0).sum()) for packet in packets)


def heard_on(device: str, seconds: float) -> bytes:
    """Bytes that come from a port in so many seconds, after it is asked who it is.

    It raises a `SourceError` that says what keeps the port from being opened.
    """
    import serial

    try:
        with serial.Serial(device, _BAUD, timeout=seconds, write_timeout=1.0) as port:
            port.write(command(Kind.IDENTIFY))
            return bytes(port.read(_HEARD))
    except (OSError, ValueError) as error:
        raise SourceError(f"it cannot be opened: {_reason(error)}") from error


def open_port(place: str, baud: int, timeout: float) -> Any:
    """A serial port, for this process alone, whose reads wait for so many seconds.

    The place is a device or ``usb:SERIAL``. It raises a `SourceError` that says what keeps the port
    from being opened.
    """
    import serial

    device = device_of(place)
    try:
        port = serial.Serial(device, baud, timeout=timeout, write_timeout=1.0, exclusive=True)
    except (OSError, ValueError) as error:
        raise SourceError(f"{place} cannot be opened: {_reason(error)}") from error
    # Only some drivers hold bytes back, and can be told not to.
    with suppress(AttributeError, OSError, ValueError):
        port.set_low_latency_mode(True)
    return port


def device_of(place: str) -> str:
    """Device of a port's name, looked up among the USB ports where it is ``usb:SERIAL``.

    It raises a `SourceError` that lists what is there if no port has this serial number.
    """
    if not place.startswith(_USB):
        return place
    from serial.tools import list_ports

    ports = {port.serial_number: port.device for port in list_ports.comports()}
    serial = place.removeprefix(_USB)
    if serial not in ports:
        known = ", ".join(sorted(filter(None, ports))) or "none"
        raise SourceError(f"no board of USB serial {serial!r} is plugged in; there are: {known}")
    return str(ports[serial])


def _reason(error: Exception) -> str:
    """What the system says of a port, and what to do."""
    reason = str(getattr(error, "strerror", None) or error)
    text = reason.lower()
    if "permission" in text:
        return f"{reason}; join the group dialout (sudo usermod -aG dialout $USER) and log in again"
    if "busy" in text or "exclusively lock" in text or "unavailable" in text:
        return f"{reason}; another program reads it, or ModemManager tries it: wait, or stop that"
    if "no such file" in text:
        return f"{reason}; is the board plugged in, by a cable that carries data?"
    return reason


def _hex(addresses: Any) -> str:
    return " ".join(f"{address:#04x}" for address in addresses)
