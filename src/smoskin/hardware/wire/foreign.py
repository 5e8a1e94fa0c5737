"""Frames of boards by others: ReSkin, AnySkin and eFlesh, which send floats in microtesla.

They have no checksum worth the name, so a frame counts only where its values are whole counts of
one of the chip's steps, as everything is that an MLX90393 says: no other bytes are. Decides from
that the gain and resolution, which such frames do not tell, and where a field has wrapped.
"""

from abc import abstractmethod
from functools import reduce
from operator import xor
from struct import Struct
from typing import ClassVar, Final, NamedTuple, final

import numpy as np

from smoskin.arrays import Bools, Floats, Ints
from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError
from smoskin.hardware.wire.packet import Decoder, Packet
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag

_MICROTESLA: Final = 1e-6
_EXACT: Final = 3e-4
"""Counts by which a value may be off a whole one, plus `_ROUNDED` of its size."""
_ROUNDED: Final = 5e-7
"""Relative error of a value that was computed by three operations in single precision."""
_SAME: Final = 2e-4
"""degC by which a temperature may be off the word's, whose step is 0.022 degC."""
_WARM: Final = (-50.0, 150.0)
"""Temperatures, degC, that a chip can report."""
_PATIENCE: Final = 3
"""Frames in a row that fit no step of those before, after which these are forgotten."""
_SETTLED: Final = 8
"""Frames from which the step is believed."""


class Step(NamedTuple):
    """Microtesla a count, which several settings may share."""

    lateral: float
    """uT a count in x and y."""
    axial: float
    """uT a count in z."""
    pairs: tuple[tuple[int, int], ...]
    """(GAIN_SEL, RES) of the settings that have it."""


def _steps() -> tuple[Step, ...]:
    """The distinct steps of the chip's 32 gains and resolutions, the finest first."""
    steps: dict[float, Step] = {}
    for gain in range(8):
        for resolution in range(4):
            step = mlx90393.sensitivity(_setting(gain, resolution)) / _MICROTESLA
            key = round(float(step[0]), 9)
            pairs = steps[key].pairs if key in steps else ()
            steps[key] = Step(float(step[0]), float(step[2]), (*pairs, (gain, resolution)))
    return tuple(steps[key] for key in sorted(steps))


def _setting(gain: int, resolution: int) -> HallSetting:
    return HallSetting(gain_selection=gain, resolution=resolution, oversampling=0, digital_filter=2)


STEPS: Final = _steps()
"""The chip's distinct steps, the finest first."""
_SIZES: Final = np.array([[step.lateral, step.lateral, step.axial] for step in STEPS])


def whole(values: Floats) -> Bools:
    """Whether the values of chips, (C, 3), uT, are whole counts of each step, shape (K, C).

    Nothing at all, three zeros, is what a chip that failed says, and no count; nor is more than 16
    bits hold.
    """
    with np.errstate(all="ignore"):
        counts = values / _SIZES[:, None, :]
        off = np.abs(counts - np.rint(counts))
        fits = (off <= _EXACT + _ROUNDED * np.abs(counts)) & (np.abs(counts) < 1 << 16)
        # A value far below a step is no count either, however near to zero it is.
        fits &= (values == 0.0) | (np.abs(counts) > 0.5)
    return np.asarray(fits.all(axis=-1) & (values != 0.0).any(axis=-1))


def _warm(temperature: Floats) -> Bools:
    """Whether temperatures (C,), degC, are words of the chip."""
    nearest = mlx90393.degrees(mlx90393.temperature_counts(temperature))
    least, most = _WARM
    exact = np.abs(temperature - nearest) <= _SAME
    return np.asarray(exact & (temperature > least) & (temperature < most))


class _Fit:
    """The step that all frames so far are whole counts of."""

    def __init__(self) -> None:
        self._possible = np.ones(len(STEPS), dtype=bool)
        self._frames = self._misfits = 0

    @property
    def step(self) -> Step | None:
        """The coarsest step that fits; None until there are frames enough."""
        if self._frames < _SETTLED:
            return None
        return STEPS[int(np.flatnonzero(self._possible)[-1])]

    def good(self, fits: Bools) -> Bools | None:
        """Which chips, (C,), of a frame are whole, by `whole` (K, C); None if it is no frame."""
        many = fits.sum(axis=1)
        enough = self._possible & (2 * many > fits.shape[1])
        if not enough.any():
            self._misfits += 1
            if self._misfits >= _PATIENCE:
                self._possible[:] = True
                self._frames = self._misfits = 0
            return None
        self._frames, self._misfits = self._frames + 1, 0
        best = enough & (many == many[enough].max())
        if self._frames < _SETTLED:
            self._possible = best
        elif self._frames == _SETTLED:
            # From here on one changed bit cannot make another step of it.
            self._possible = np.arange(len(STEPS)) == np.flatnonzero(best)[-1]
        return np.asarray(fits[np.flatnonzero(best)[-1]])


class _FloatDecoder(Decoder):
    """Frames of one length of floats in microtesla, which are found by a mark."""

    mark: ClassVar[bytes]
    """Bytes that every frame has."""
    mark_place: ClassVar[int]
    """Their place, from the frame's end if negative."""
    overhead: ClassVar[int]
    """Bytes of a frame besides those of its chips."""
    row: ClassVar[int]
    """Floats of a chip: three of the field, with or without the temperature before them."""

    def __init__(self, chips: int = 5) -> None:
        super().__init__()
        if not 1 <= chips <= 64:
            raise ArgumentError(f"chips must lie in 1..64; got {chips}")
        self._chips = chips
        self._corrupt = 0
        self._length = self.overhead + 4 * self.row * chips
        self._floats = Struct(f"<{self.row * chips}f")
        self.forget()

    @property
    def corrupt(self) -> int:
        """As `Decoder.corrupt`."""
        return self._corrupt

    @property
    def settings(self) -> tuple[tuple[int, int], ...]:
        """(GAIN_SEL, RES) that the chips may have; none until eight frames have come."""
        step = self._fit.step
        return () if step is None else step.pairs

    def forget(self) -> None:
        """As `Decoder.forget`."""
        super().forget()
        self._rest = bytearray()
        self._astray = False
        self._fit, self._before = _Fit(), np.full((self._chips, 3), np.nan)
        self._wrapped = np.zeros((self._chips, 3), dtype=np.int64)

    def feed(self, data: bytes) -> list[Packet]:
        """As `Decoder.feed`."""
        self._rest += data
        packets: list[Packet] = []
        offset = self.mark_place % self._length
        start, search = 0, offset
        while (place := self._rest.find(self.mark, search)) >= 0:
            begin = place - offset
            if len(self._rest) < begin + self._length:
                break
            frame = bytes(self._rest[begin : begin + self._length])
            packet = self._packet(frame) if self._sound(frame) else None
            if packet is None:
                search = place + 1
                continue
            self._skip(begin - start)
            self._astray = False
            start = begin + self._length
            search = start + offset
            if packet.sequence is None or self._follows(packet.sequence, None):
                packets.append(packet)
        # What is left may hold the beginning of a frame.
        keep = max(start, len(self._rest) - self._length + 1)
        self._skip(keep - start)
        del self._rest[:keep]
        return packets

    def _skip(self, count: int) -> None:
        """Count a stretch of bytes that are left out, once however it comes in pieces."""
        if count and not self._astray:
            self._astray = True
            self._corrupt += 1

    def _packet(self, frame: bytes) -> Packet | None:
        """The packet of a frame with its mark; None if its values are not a chip's."""
        values = np.array(self._floats.unpack(self._inside(frame))).reshape(-1, self.row)
        field, fits = values[:, -3:], whole(values[:, -3:])
        temperature = np.full(self._chips, np.nan)
        if self.row > 3:
            temperature = values[:, 0]
            fits &= _warm(temperature)
        good = self._fit.good(fits)
        if good is None:
            return None
        flags = np.where(good, int(ChipFlag.GOOD), int(ChipFlag.MISSING))
        flags = flags | self._ended(np.where(good[:, None], field, np.nan))
        return Packet(
            sequence=self._sequence(frame),
            time=None,
            field=np.where(good[:, None], field * _MICROTESLA, np.nan),
            temperature=np.where(good, temperature, np.nan),
            flags=flags,
        )

    def _ended(self, field: Floats) -> Ints:
        """Flags of chips, (C,), whose field, (C, 3), uT, has come to the end of its range."""
        step = self._fit.step
        if step is None:
            return np.zeros(self._chips, dtype=np.int64)
        sizes = np.array([step.lateral, step.lateral, step.axial])
        jump = np.nan_to_num((field - self._before) / sizes)
        self._before = np.where(np.isnan(field), self._before, field)
        flags = np.zeros(self._chips, dtype=np.int64)
        resolutions = {resolution for _, resolution in step.pairs}
        if resolutions & {0, 1}:
            self._wrapped -= np.rint(jump / (1 << 16)).astype(np.int64)
            flags |= np.where(self._wrapped.any(axis=-1), int(ChipFlag.WRAPPED), 0)
        if resolutions & {2, 3}:
            pair = max(step.pairs, key=lambda pair: pair[1])
            railed = mlx90393.railed(np.nan_to_num(field / sizes), _setting(*pair))
            flags |= np.where(railed, int(ChipFlag.SATURATED), 0)
        return flags

    def _sound(self, frame: bytes) -> bool:
        """Whether a frame is whole as far as its own check tells."""
        return True

    @abstractmethod
    def _inside(self, frame: bytes) -> bytes:
        """The bytes of the floats."""

    def _sequence(self, frame: bytes) -> int | None:
        """Number of the frame, if it has one."""
        return None


@final
class AnySkinDecoder(_FloatDecoder):
    """Frames of ReSkin and AnySkin boards, 16 bytes a chip and 2.

    Each chip gives its temperature, degC, and its field, uT, as four little-endian floats; CR LF
    ends the frame and may occur inside it. Source: `5X_binary_burst_stream` of the ReSkin
    firmware.
    """

    format = "anyskin"
    sequences = 0
    mark = b"\r\n"
    mark_place = -2
    overhead = 2
    row = 4

    def _inside(self, frame: bytes) -> bytes:
        return frame[:-2]


@final
class EfleshDecoder(_FloatDecoder):
    """Frames of eFlesh boards, 12 bytes a chip and 4.

    AA 55 and a number of one byte come first, then the chips' fields, uT, as three little-endian
    floats, then the exclusive or of all bytes after AA 55. Source: the eflesh-touch firmware.
    """

    format = "eflesh"
    sequences = 1 << 8
    mark = b"\xaa\x55"
    mark_place = 0
    overhead = 4
    row = 3

    def _inside(self, frame: bytes) -> bytes:
        return frame[3:-1]

    def _sound(self, frame: bytes) -> bool:
        return not reduce(xor, frame[2:], 0)

    def _sequence(self, frame: bytes) -> int | None:
        return frame[2]


def anyskin_frame(field: Floats, temperature: Floats) -> bytes:
    """The bytes of one scan of C chips as an AnySkin board sends it: (C, 3), T, and (C,), degC."""
    rows = np.column_stack([temperature, np.asarray(field) / _MICROTESLA])
    return rows.astype("<f4").tobytes() + b"\r\n"


def eflesh_frame(field: Floats, sequence: int) -> bytes:
    """The bytes of one scan of C chips as an eFlesh board sends it: (C, 3), T."""
    inside = bytes([sequence % 256]) + (np.asarray(field) / _MICROTESLA).astype("<f4").tobytes()
    return b"\xaa\x55" + inside + bytes([reduce(xor, inside, 0)])
