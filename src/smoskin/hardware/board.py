"""A board without hardware: any source's readings, sent as a board sends them.

Decides what a board answers to commands. Hides the pseudo-terminal, which programs open as they
would a serial port.
"""

import os
import select
import threading
import time
from typing import final

import numpy as np

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.hardware.registers import ERROR, IN_SINGLE, NO_ANSWER, Scan, words_of
from smoskin.hardware.wire.foreign import anyskin_frame, eflesh_frame
from smoskin.hardware.wire.framing import Frame, Framer, encoded
from smoskin.hardware.wire.messages import BoardScan, Kind, read_set, reading_frame
from smoskin.hardware.wire.packet import FORMATS
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag, Reading
from smoskin.roles import Resource, Source


def scan_of(reading: Reading, design: SkinDesign, at: float) -> Scan:
    """The words that chips of a design would have sent for a reading, at a time, s."""
    setting = design.hall_setting
    known = np.asarray(np.isfinite(reading.field).all(axis=-1))
    field = np.where(known[:, None], reading.field, 0.0)
    words = np.column_stack(
        [
            mlx90393.temperature_counts(reading.temperature),
            words_of(np.rint(field / mlx90393.sensitivity(setting)), setting),
        ]
    )
    missing = (reading.flags & int(ChipFlag.MISSING)) != 0
    status = np.where(missing, NO_ANSWER, np.where(known, IN_SINGLE | 3, IN_SINGLE | ERROR))
    return Scan(time=at, status=status, words=words)


@final
class VirtualBoard(Resource):
    """A source's readings on a pseudo-terminal, byte for byte as a board sends them.

    What nobody reads is dropped, as a board does. A board of this package's own format answers
    commands; the pace and the setting are the source's, and a command to change them is refused.

    Parameters
    ----------
    source : Source
        Readings with a design; the board closes it.
    format : "smoskin", "anyskin" or "eflesh"

    Raises
    ------
    ArgumentError
        If the format is unknown or the source has no design.
    """

    @typed
    def __init__(self, source: Source, *, format: str = "smoskin") -> None:
        design = source.design
        if format not in FORMATS:
            raise ArgumentError(f"format must be one of {', '.join(FORMATS)}; got {format!r}")
        if design is None:
            raise ArgumentError("source must know the design of its skin; got one without")
        import tty

        self._source, self._design, self._format = source, design, format
        self._master, far_end = os.openpty()
        tty.setraw(far_end)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(far_end)
        """Name of the port that programs open."""
        # Nobody but they holds the far end, so that it is known whether one does.
        os.close(far_end)
        self._far_end = select.poll()
        self._far_end.register(self._master, 0)
        self.sent = 0
        """Frames that were sent."""
        self.dropped = 0
        """Frames that nobody read in time."""
        self._framer = Framer()
        self._sequence = 0
        self._ended = False
        self._using = threading.Lock()
        self._start = time.monotonic()

    @property
    def watched(self) -> bool:
        """Whether a program has the port open; False once closed."""
        with self._using:
            return not self._ended and not self._far_end.poll(0)

    def restart(self, source: Source) -> None:
        """Close the source and go on with another one's readings of the same design."""
        self._source.close()
        self._source = source

    def step(self) -> bool:
        """Send the next reading and do what was commanded; False when the source has ended."""
        reading = self._source.read()
        if reading is None:
            return False
        with self._using:
            if self._ended:
                return False
            self._obey()
            at = time.monotonic() - self._start
            if self._format == "anyskin":
                self._send(anyskin_frame(reading.field, reading.temperature))
            elif self._format == "eflesh":
                self._send(eflesh_frame(reading.field, self._next()))
            else:
                self._send(
                    reading_frame(
                        BoardScan(
                            sequence=self._next(),
                            scan=scan_of(reading, self._design, at),
                            addresses=tuple(site.address for site in self._design.halls),
                            setting=self._design.hall_setting,
                        )
                    )
                )
        return True

    def close(self) -> None:
        """End the source and hang up."""
        self._source.close()
        with self._using:
            if not self._ended:
                self._ended = True
                os.close(self._master)

    def _next(self) -> int:
        number = self._sequence
        self._sequence = (number + 1) % (1 << 16)
        return number

    def _send(self, data: bytes) -> None:
        """Send a frame whole or not at all."""
        try:
            written = os.write(self._master, data)
        except OSError:
            self.dropped += 1
            return
        self.sent += written == len(data)
        self.dropped += written != len(data)

    def _obey(self) -> None:
        """Do what has been commanded."""
        try:
            data = os.read(self._master, 4096)
        except OSError:
            return
        if self._format != "smoskin":
            return
        for frame in self._framer.feed(data):
            if frame.kind == Kind.RESET:
                self._sequence, self._start = 0, time.monotonic()
                self._identify()
            elif frame.kind == Kind.IDENTIFY:
                self._identify()
            elif frame.kind == Kind.SET:
                self._refuse_unless_same(frame)

    def _identify(self) -> None:
        lines = {
            "board": "smoskin",
            "firmware": "virtual",
            "serial": f"virtual-{self._design.content_hash[:12]}",
            "chips": " ".join(f"{site.address:02x}" for site in self._design.halls),
        }
        body = "".join(f"{name}={value}\n" for name, value in lines.items()).encode()
        self._send(encoded(Frame(kind=Kind.IDENTITY, sequence=self._next(), body=body)))

    def _refuse_unless_same(self, frame: Frame) -> None:
        wanted = read_set(frame)
        if wanted is not None and wanted[0] == self._design.hall_setting:
            return
        reason = b"a virtual board has the setting of its design"
        self._send(encoded(Frame(kind=Kind.REFUSAL, sequence=self._next(), body=reason)))
