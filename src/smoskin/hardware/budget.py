"""Time and range of chips: how fast a setting can be read, and which one suits a skin and a rate.

Decides what a reading spends its time on. Times are guaranteed ones: the slowest oscillator, a bus
of 400 kHz, and a driver that waits, as without the chips' interrupt lines it must.
"""

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np

from smoskin.arguments import typed
from smoskin.design.skin import HallSetting, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.feasibility import MARGIN, field_extent
from smoskin.hardware.mlx90393 import Mode
from smoskin.hardware.registers import MEASUREMENT
from smoskin.magnetics import mlx90393

_BUS: Final = 400e3
"""Clock of the bus, Hz: the fastest that the chip takes."""
_FRONT_END: Final = 50e-3
"""T: largest field that the chip's front end is specified for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """Time of one reading of all chips, s.

    Examples
    --------
    >>> planar = HallSetting(gain_selection=3, resolution=2, oversampling=1, digital_filter=3)
    >>> print(time_budget(planar, 3))
    start 0.29 ms, convert 5.55 ms, read 0.83 ms, check 0.17 ms: 146 Hz guaranteed
    """

    start: float
    """Time in which all chips are started."""
    convert: float
    """Time for which they are waited for."""
    read: float
    """Time in which all are read."""
    check: float
    """Time in which one register of one chip is read back."""

    @property
    def rate(self) -> float:
        """Readings a second that are guaranteed, Hz."""
        return 1.0 / (self.start + self.convert + self.read + self.check)

    def __str__(self) -> str:
        parts = ("start", "convert", "read", "check")
        times = [f"{part} {1e3 * getattr(self, part):.2f} ms" for part in parts]
        return f"{', '.join(times)}: {math.floor(self.rate)} Hz guaranteed"


@typed
def time_budget(
    setting: HallSetting,
    chips: int,
    *,
    mode: Mode = "single",
    temperature_oversampling: int = 0,
    bus: float = _BUS,
) -> Budget:
    """What a reading of so many chips spends its time on.

    In burst mode the chips measure while they are read, so that only what is left of a period has
    to be waited for. The bus has this clock, Hz; the program's own time is not counted.

    Notes
    -----
    Source: `smoskin.magnetics.mlx90393.conversion_time` and `burst_period`; nine bits a byte.
    """
    if chips < 1:
        raise ArgumentError(f"chips must be at least 1; got {chips}")
    if not 0.0 < bus <= _BUS:
        raise ArgumentError(f"bus must be above 0 and at most {_BUS:g} Hz; got {bus}")
    read = chips * _transfer_time(1, MEASUREMENT, bus)
    if mode == "burst":
        period = mlx90393.burst_period(setting, temperature_oversampling, worst=True)
        return Budget(start=0.0, convert=max(period - read, 0.0), read=read, check=0.0)
    return Budget(
        start=chips * _transfer_time(1, 1, bus),
        convert=mlx90393.conversion_time(setting, temperature_oversampling, worst=True),
        read=read,
        check=_transfer_time(2, 3, bus),
    )


@typed
def propose_setting(
    design: SkinDesign, rate: float, *, mode: Mode = "single", bus: float = _BUS
) -> HallSetting:
    """The setting of least noise, rounding included, that is fast enough and wide enough.

    It holds the rated stroke of every chip as designed with `smoskin.feasibility.MARGIN`, and stops
    at a rail instead of wrapping; made skins may need the next gains. The rate is in Hz.

    Raises
    ------
    ArgumentError
        If no setting is fast enough, saying which rate one allows, or none wide enough.

    Examples
    --------
    >>> from smoskin.feasibility import load_design
    >>> propose_setting(load_design("planar"), 200.0)
    HallSetting(gain_selection=5, resolution=2, oversampling=0, digital_filter=3)
    """
    if not rate > 0.0:
        raise ArgumentError(f"rate must be positive; got {rate} Hz")
    largest = np.max([field_extent(design, site).largest for site in design.halls], axis=0)
    wide = [
        setting
        for gain, resolution in product(range(8), (2, 3))
        for setting in [replace(design.hall_setting, gain_selection=gain, resolution=resolution)]
        if (largest <= MARGIN * mlx90393.full_scale(setting)).all() and largest.max() <= _FRONT_END
    ]
    if not wide:
        raise ArgumentError(
            f"design must have fields that a chip can read, at most {_FRONT_END * 1e3:g} mT; got "
            f"{largest.max() * 1e3:.1f} mT over the rated stroke"
        )
    fast = {
        (over, smooth): budget.rate
        for over, smooth in product(range(4), range(8))
        for setting in [replace(wide[0], oversampling=over, digital_filter=smooth)]
        for budget in [time_budget(setting, len(design.halls), mode=mode, bus=bus)]
        if mlx90393.settles(setting)
    }
    enough = [pair for pair, possible in fast.items() if possible >= rate]
    if not enough:
        raise ArgumentError(
            f"rate must be at most {math.floor(max(fast.values()))} Hz for {len(design.halls)} "
            f"chips in {mode} mode; got {rate:g} Hz"
        )
    settings = [
        replace(setting, oversampling=over, digital_filter=smooth)
        for setting in wide
        for over, smooth in enough
    ]
    return min(settings, key=_noise)


def _noise(setting: HallSetting) -> float:
    """Noise and rounding of a reading of x, y and z, squares summed."""
    step = mlx90393.sensitivity(setting)
    return float((mlx90393.noise(setting) ** 2 + step**2 / 12).sum())


def _transfer_time(written: int, read: int, bus: float) -> float:
    """Time of a write and the read after it, each with its address, s."""
    return (9 * (2 + written + read) + 3) / bus
