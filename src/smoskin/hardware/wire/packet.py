"""What every wire format comes to: one scan of a board's chips, and counters of what went wrong.

Decides how a gap in the numbers of frames is told from a board that has started again and from
bytes that came twice.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, get_args

from smoskin.arrays import Floats, Ints, assign, freeze, wholes
from smoskin.design.skin import HallSetting

Format: TypeAlias = Literal["smoskin", "anyskin", "eflesh"]
"""Wire format by its name, as sources' URLs give it."""
FORMATS: Final[tuple[Format, ...]] = get_args(Format)
_RESTART: Final = 1.0
"""Seconds by which a board's time must go back to be that of a new start."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Packet:
    """One scan of a board's C chips as its format gives it."""

    sequence: int | None
    """Number of the frame; None where the format has none."""
    time: float | None
    """Time on the board's clock, s; None where the format has none."""
    field: Floats
    """(C, 3), T, in each chip's own axes; NaN where a chip has nothing true to say."""
    temperature: Floats
    """(C,), degC; NaN where it is unknown."""
    flags: Ints
    """(C,), `ChipFlag`."""
    addresses: tuple[int, ...] = ()
    """7-bit addresses of the chips, where the format tells them."""
    setting: HallSetting | None = None
    """Setting of the chips, where the format tells it."""

    def __post_init__(self) -> None:
        chips = len(self.field)
        freeze(self, field=(chips, 3), temperature=(chips,))
        assign(self, flags=wholes("flags", self.flags, (chips,)))


class Decoder(ABC):
    """Packets out of a stream of bytes that comes in pieces of any size."""

    format: Format
    """Format of the frames."""
    sequences: int
    """Frames after which the numbers of frames begin again; 0 where frames have none."""

    def __init__(self) -> None:
        self.lost = 0
        """Frames that are missing by their numbers."""
        self.repeated = 0
        """Frames that came again, and were left out."""
        self.restarts = 0
        """Times that the board has started again."""
        self._last: tuple[int, float | None] | None = None

    @property
    @abstractmethod
    def corrupt(self) -> int:
        """Stretches of bytes that were no whole frame."""

    @abstractmethod
    def feed(self, data: bytes) -> list[Packet]:
        """The packets that these bytes complete, each once and in order."""

    def forget(self) -> None:
        """Begin a new stream, as after the board was unplugged; the counters go on."""
        self._last = None

    def _follows(self, sequence: int, time: float | None) -> bool:
        """Whether a frame is new; what is missing before it is counted."""
        if self._last is None:
            self._last = sequence, time
            return True
        before, then = self._last
        back = 0.0 if time is None or then is None else then - time
        if back >= _RESTART:
            self.restarts += 1
        else:
            step = (sequence - before) % self.sequences
            # Numbers tell order as long as no more than half of them is missing.
            if step == 0 or step > self.sequences // 2 or back > 0.0:
                self.repeated += 1
                return False
            self.lost += step - 1
        self._last = sequence, time
        return True
