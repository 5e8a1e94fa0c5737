"""Words and bytes of the MLX90393: what is written to it, and what its answers mean.

Decides which answers may be believed. Hides how settings lie in registers and fields in words.
HALLCONF is 0xC, the compensation TCMP is off, and every scan asks for T, X, Y and Z.
"""

import functools
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from smoskin.arrays import Floats, Ints, assign, wholes
from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag, Reading

START_BURST: Final = 0x1F
"""Command: measure T, X, Y and Z again and again."""
START_SINGLE: Final = 0x3F
"""Command: measure T, X, Y and Z once."""
READ_MEASUREMENT: Final = 0x4F
"""Command: give the last measurement, which is lost by it."""
READ_REGISTER: Final = 0x50
"""Command: give a register; its number times 4 follows."""
WRITE_REGISTER: Final = 0x60
"""Command: take the word that follows, high byte first, into a register; number times 4 comes
last."""
EXIT: Final = 0x80
"""Command: measure no more."""
RESET: Final = 0xF0
"""Command: start again with the registers of power-on."""
NOTHING: Final = 0x00
"""Command: only tell the status."""

IN_BURST: Final = 0x80
"""Bit of the status byte: the chip measures again and again."""
IN_SINGLE: Final = 0x20
"""Bit of the status byte: the chip measures, or has measured, once."""
ERROR: Final = 0x10
"""Bit of the status byte: the command could not be done, as when there is no new measurement."""
WAS_RESET: Final = 0x04
"""Bit of the status byte: the chip has started again since the last command."""
NO_ANSWER: Final = 0xFF
"""Status byte of a chip that did not answer; an idle bus reads as ones."""

_NOTHING_TRUE: Final = WAS_RESET | ERROR
"""Bits of which a chip that measured sets none, and an idle bus both."""
MEASUREMENT: Final = 9
"""Bytes of the answer to READ_MEASUREMENT: the status and the words of T, X, Y and Z."""
ADDRESSES: Final = range(0x0C, 0x1C)
"""7-bit addresses at which chips of any order code answer."""
_ZERO: Final = (0x0000, 0x0000, 0x8000, 0x4000)
"""Word of no field at RES 0..3."""
_HALLCONF: Final = 0xC


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan:
    """One measurement of S chips as it came over the bus."""

    time: float
    """Middle of the measurement, s, on the clock of whoever read the chips."""
    status: Ints
    """(S,): status bytes."""
    words: Ints
    """(S, 4): words of T, X, Y and Z, unsigned; of no meaning where a chip did not measure."""

    def __init__(self, *, time: float, status: ArrayLike, words: ArrayLike) -> None:
        chips = np.shape(status)[0] if np.ndim(status) else 0
        marks = wholes("status", status, (chips,))
        values = wholes("words", np.reshape(words, (-1, 4)), (chips, 4))
        for name, array, most in (("status", marks, 0xFF), ("words", values, 0xFFFF)):
            if (array & ~most).any():
                raise ArgumentError(f"{name} must lie in 0..{most:#x}; got {array.tolist()!r:.100}")
        assign(self, time=float(time), status=marks, words=values)

    def reading(self, setting: HallSetting) -> Reading:
        """The reading of chips of this setting."""
        field, warmth, flags = self.values(setting)
        return Reading(time=self.time, field=field, temperature=warmth, flags=flags)

    def values(self, setting: HallSetting) -> tuple[Floats, Floats, Ints]:
        """Field (S, 3), T, temperature (S,), degC, and flags (S,) of chips of this setting.

        Numbers are NaN where a chip has nothing new and true to say.

        A chip that did not answer is `ChipFlag.MISSING`; one that had not measured anew is
        `ChipFlag.OLD`; one that has started again, and so has lost its setting, is
        `ChipFlag.INVALID`.
        """
        counts = counts_of(self.words[:, 1:], setting)
        field, warmth = mlx90393.tesla(counts, setting), mlx90393.degrees(self.words[:, 0])
        flags = mlx90393.railed(counts, setting) * int(ChipFlag.SATURATED)
        for chip, status in enumerate(self.status.tolist()):
            if status & _NOTHING_TRUE:
                field[chip], warmth[chip], flags[chip] = np.nan, np.nan, int(_why(status))
        return field, warmth, flags


def _why(status: int) -> ChipFlag:
    """Why a chip of this status byte has nothing new and true to say."""
    if status == NO_ANSWER:
        return ChipFlag.MISSING
    reset = ChipFlag.INVALID if status & WAS_RESET else ChipFlag.GOOD
    return reset | ChipFlag.OLD if status & ERROR else reset


def register_words(setting: HallSetting, temperature_oversampling: int = 0) -> tuple[int, int, int]:
    """Words of registers 0, 1 and 2 that hold a setting and the temperature's oversampling OSR2.

    It raises an `ArgumentError` if OSR2 is not in 0..3.

    Notes
    -----
    Source: Melexis MLX90393 data sheet, memory map.

    Examples
    --------
    >>> setting = HallSetting(gain_selection=3, resolution=2, oversampling=1, digital_filter=3)
    >>> [hex(word) for word in register_words(setting)]
    ['0x3c', '0x0', '0x54d']
    """
    if not 0 <= temperature_oversampling <= 3:
        raise ArgumentError(
            f"temperature_oversampling must lie in 0..3; got {temperature_oversampling}"
        )
    resolutions = setting.resolution * (1 << 5 | 1 << 7 | 1 << 9)
    return (
        setting.gain_selection << 4 | _HALLCONF,
        0,
        setting.oversampling
        | setting.digital_filter << 2
        | resolutions
        | temperature_oversampling << 11,
    )


@functools.lru_cache(maxsize=64)
def setting_of(words: tuple[int, int, int]) -> tuple[HallSetting, int]:
    """Setting and temperature oversampling OSR2 that these words of registers 0 to 2 hold.

    It raises an `ArgumentError` for words that this package never writes, such as axes of unlike
    resolution, by which fields would come out false.
    """
    first, second, third = words
    setting = HallSetting(
        gain_selection=first >> 4 & 7,
        resolution=third >> 5 & 3,
        oversampling=third & 3,
        digital_filter=third >> 2 & 7,
    )
    oversampling = third >> 11 & 3
    if register_words(setting, oversampling) != (first, second & ~0x3FF, third):
        raise ArgumentError(
            "words must be registers with HALLCONF 0xC, one resolution and no compensation; got "
            f"{first:#06x}, {second:#06x}, {third:#06x}"
        )
    return setting, oversampling


def counts_of(words: ArrayLike, setting: HallSetting) -> Ints:
    """Signed counts that unsigned words of X, Y and Z stand for, of any shape.

    Notes
    -----
    Source: Melexis MLX90393 data sheet: two's complement at RES 0 and 1, about 0x8000 at RES 2 and
    about 0x4000 at RES 3.

    Examples
    --------
    >>> setting = HallSetting(gain_selection=7, resolution=0, oversampling=0, digital_filter=2)
    >>> counts_of([0x0001, 0xFFFF, 0x8000], setting).tolist()
    [1, -1, -32768]
    """
    raw = np.asarray(words, dtype=np.int64)
    if setting.resolution < 2:
        return np.asarray((raw + 0x8000 & 0xFFFF) - 0x8000)
    return np.asarray(raw - _ZERO[setting.resolution])


def words_of(counts: ArrayLike, setting: HallSetting) -> Ints:
    """Unsigned words of X, Y and Z that stand for signed counts; the inverse of `counts_of`."""
    return np.asarray((np.asarray(counts, dtype=np.int64) + _ZERO[setting.resolution]) & 0xFFFF)
