"""Frames of this package's own format in a stream of bytes, and back.

Decides where a frame begins and ends and which one is whole: consistent overhead byte stuffing
leaves zeros to stand between frames alone, so that a reader is in step again after the next zero;
a CRC-32 over the whole frame says whether a byte was changed. Hides both from what frames say.
"""

from dataclasses import dataclass
from struct import Struct
from typing import Final, final
from zlib import crc32

from smoskin.errors import ArgumentError

VERSION: Final = 1
"""Version of the format, first byte of every frame."""
LONGEST: Final = 512
"""Bytes of a stuffed frame, at most; more without a zero is noise."""
_HEAD: Final = Struct("<BBH")
_CHECK: Final = Struct("<I")
_SEQUENCES: Final = 1 << 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One frame, whole and unstuffed."""

    kind: int
    """Kind of what it says, 0..255."""
    sequence: int
    """Number of the frame, one more than that of the frame before, modulo 65536."""
    body: bytes
    """What it says."""


def stuffed(data: bytes) -> bytes:
    """The data without zeros: each is replaced by the distance to the next.

    Notes
    -----
    Source: S. Cheshire and M. Baker, Consistent Overhead Byte Stuffing, IEEE/ACM Transactions on
    Networking 7 (1999).

    Examples
    --------
    >>> stuffed(bytes([0x11, 0x22, 0x00, 0x33])).hex(" ")
    '03 11 22 02 33'
    """
    out = bytearray()
    for block in data.split(b"\0"):
        while len(block) >= 254:
            out += b"\xff" + block[:254]
            block = block[254:]
        out.append(len(block) + 1)
        out += block
    return bytes(out)


def unstuffed(data: bytes) -> bytes | None:
    """The data that was stuffed so; None where nothing is."""
    out, place = bytearray(), 0
    while place < len(data):
        code = data[place]
        block = data[place + 1 : place + code]
        if code == 0 or len(block) != code - 1 or 0 in block:
            return None
        place += code
        out += block
        if code < 0xFF and place < len(data):
            out.append(0)
    return bytes(out) if data else None


def encoded(frame: Frame) -> bytes:
    """The bytes of a frame, with the zero behind it.

    It raises an `ArgumentError` if kind or sequence do not fit or the frame is too long.
    """
    if not (0 <= frame.kind <= 0xFF and 0 <= frame.sequence < _SEQUENCES):
        raise ArgumentError(
            f"kind must lie in 0..255 and sequence in 0..65535; got {frame.kind}, {frame.sequence}"
        )
    plain = _HEAD.pack(VERSION, frame.kind, frame.sequence) + frame.body
    whole = stuffed(plain + _CHECK.pack(crc32(plain)))
    if len(whole) > LONGEST:
        raise ArgumentError(f"frame must have at most {LONGEST} bytes; got {len(whole)}")
    return whole + b"\0"


def decoded(data: bytes) -> Frame | None:
    """The frame that was stuffed so, without the zero; None if it is not whole or not ours."""
    plain = unstuffed(data)
    if plain is None or len(plain) < _HEAD.size + _CHECK.size:
        return None
    inside = plain[: -_CHECK.size]
    version, kind, sequence = _HEAD.unpack_from(inside)
    if version != VERSION or _CHECK.unpack(plain[-_CHECK.size :])[0] != crc32(inside):
        return None
    return Frame(kind=kind, sequence=sequence, body=inside[_HEAD.size :])


@final
class Framer:
    """Frames out of a stream that comes in pieces of any size."""

    def __init__(self) -> None:
        self.corrupt = 0
        """Stretches between zeros that are no frames; the one that is cut by the start counts."""
        self._rest = bytearray()
        self._skipping = False

    def forget(self) -> None:
        """Drop what has come of a frame; the counter goes on."""
        self._rest.clear()
        self._skipping = False

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete."""
        frames = []
        *ended, rest = data.split(b"\0")
        for piece in ended:
            whole = bytes(self._rest + piece)
            self._rest.clear()
            if self._skipping or not whole:
                self._skipping = False
                continue
            frame = decoded(whole) if len(whole) <= LONGEST else None
            if frame is None:
                self.corrupt += 1
            else:
                frames.append(frame)
        self._rest += rest
        if len(self._rest) > LONGEST:
            # Whatever this is, it counts once and is not kept.
            self.corrupt += not self._skipping
            self._skipping = True
            self._rest.clear()
        return frames
