"""What this package's boards and their hosts say to each other, frame by frame.

Decides the layout of readings, identities and commands; `docs/wire.md` states it for those who
write firmware. All numbers are little-endian.
"""

from dataclasses import dataclass
from enum import IntEnum
from struct import Struct, error
from typing import Final, final

from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError, DesignError
from smoskin.hardware.registers import Scan, register_words, setting_of
from smoskin.hardware.wire.framing import Frame, Framer, encoded
from smoskin.hardware.wire.packet import Decoder, Packet

MOST_CHIPS: Final = 16
"""Chips of a board, at most."""


class Kind(IntEnum):
    """Kinds of frames; those from the host have the highest bit."""

    READING = 0x01
    """One scan of all chips."""
    IDENTITY = 0x02
    """Lines ``name=value`` about the board."""
    REFUSAL = 0x03
    """Sentence that says why a command was not done."""
    IDENTIFY = 0x81
    """Ask for the identity."""
    SET = 0x82
    """Write registers 0, 1 and 2 of all chips and scan at this period."""
    RESET = 0x83
    """Start again, as after power-on."""


_READING: Final = Struct("<QHHHB")
"""Time, us; words of registers 0, 1 and 2; number of chips."""
_CHIP: Final = Struct("<BBHHHH")
"""Address, status byte, words of T, X, Y and Z."""
_SET: Final = Struct("<IHHH")
"""Period, us; words of registers 0, 1 and 2."""
_PERIODS: Final = (500, 10_000_000)
"""Shortest and longest period, us."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardScan:
    """A scan as a board sends it."""

    sequence: int
    """Number of the frame."""
    scan: Scan
    """Status bytes and words; its time is that of the board's clock, s, to a microsecond."""
    addresses: tuple[int, ...]
    """7-bit addresses of the chips."""
    setting: HallSetting
    """Setting that the chips hold."""


def reading_frame(board: BoardScan) -> bytes:
    """The bytes of a reading, with the zero behind it; `ArgumentError` of more than 16 chips."""
    chips = len(board.addresses)
    if not 0 < chips <= MOST_CHIPS or chips != len(board.scan.status):
        raise ArgumentError(f"addresses must be those of 1 to {MOST_CHIPS} chips; got {chips}")
    body = _READING.pack(round(board.scan.time * 1e6), *register_words(board.setting), chips)
    for address, status, words in zip(
        board.addresses, board.scan.status.tolist(), board.scan.words.tolist(), strict=True
    ):
        body += _CHIP.pack(address, status, *words)
    return encoded(Frame(kind=Kind.READING, sequence=board.sequence, body=body))


def read_reading(frame: Frame) -> BoardScan | None:
    """The scan of a frame; None if it is no reading, or not one that a board can send."""
    try:
        time, *words, chips = _READING.unpack_from(frame.body)
        rows = [*_CHIP.iter_unpack(frame.body[_READING.size :])]
        first, second, third = words
        setting, _ = setting_of((first, second, third))
    except (error, ArgumentError, DesignError):
        return None
    if frame.kind != Kind.READING or len(rows) != chips or not 0 < chips <= MOST_CHIPS:
        return None
    return BoardScan(
        sequence=frame.sequence,
        scan=Scan(time=time * 1e-6, status=[row[1] for row in rows], words=[r[2:] for r in rows]),
        addresses=tuple(row[0] for row in rows),
        setting=setting,
    )


def command(kind: Kind, body: bytes = b"", *, sequence: int = 0) -> bytes:
    """The bytes of a command to a board, between two zeros: it ends what was begun before."""
    return b"\0" + encoded(Frame(kind=kind, sequence=sequence, body=body))


def set_command(setting: HallSetting, rate: float) -> bytes:
    """The bytes that set a board's chips and its rate, Hz, from 0.1 to 2000."""
    period = round(1e6 / rate) if rate > 0.0 else 0
    least, most = _PERIODS
    if not least <= period <= most:
        raise ArgumentError(f"rate must be from 0.1 to 2000 Hz; got {rate}")
    return command(Kind.SET, _SET.pack(period, *register_words(setting)))


def read_set(frame: Frame) -> tuple[HallSetting, float] | None:
    """Setting and rate, Hz, that a command holds; None if `set_command` does not make such."""
    try:
        period, first, second, third = _SET.unpack(frame.body)
        setting, _ = setting_of((first, second, third))
    except (error, ArgumentError, DesignError):
        return None
    least, most = _PERIODS
    return (setting, 1e6 / period) if least <= period <= most else None


@final
class BoardDecoder(Decoder):
    """Readings of this package's boards; identities and refusals are kept beside."""

    format = "smoskin"
    sequences = 1 << 16

    def __init__(self) -> None:
        super().__init__()
        self.identity: dict[str, str] = {}
        """What the board has said of itself."""
        self.refusals: list[str] = []
        """Why commands were not done, the latest last; at most ten."""
        self._framer, self._strange = Framer(), 0

    @property
    def corrupt(self) -> int:
        """As `Decoder.corrupt`; whole frames that say nothing known count too."""
        return self._framer.corrupt + self._strange

    def forget(self) -> None:
        """As `Decoder.forget`."""
        super().forget()
        self._framer.forget()

    def feed(self, data: bytes) -> list[Packet]:
        """As `Decoder.feed`."""
        packets = []
        for frame in self._framer.feed(data):
            if frame.kind == Kind.IDENTITY:
                lines = frame.body.decode("utf-8", "replace").splitlines()
                self.identity = dict(line.split("=", 1) for line in lines if "=" in line)
            elif frame.kind == Kind.REFUSAL:
                sentence = frame.body.decode("utf-8", "replace")
                self.refusals = [*self.refusals, sentence][-10:]
            elif (board := read_reading(frame)) is None:
                self._strange += 1
            elif self._follows(board.sequence, board.scan.time):
                packets.append(_packet(board))
        return packets


def _packet(board: BoardScan) -> Packet:
    field, temperature, flags = board.scan.values(board.setting)
    return Packet(
        sequence=board.sequence,
        time=board.scan.time,
        field=field,
        temperature=temperature,
        flags=flags,
        addresses=board.addresses,
        setting=board.setting,
    )
