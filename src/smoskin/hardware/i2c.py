"""Chips on the computer's own I2C bus, as on a Raspberry Pi: a bus over smbus2, and its source.

Decides when chips are scanned. Hides the kernel's messages.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, final

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SourceError, require
from smoskin.hardware.budget import propose_setting, time_budget
from smoskin.hardware.mlx90393 import Bus, Chips, Mode
from smoskin.pace import Pace, require_between
from smoskin.records import Reading
from smoskin.roles import Source

_RATES: Final = (0.01, 1e4)
"""Least and most readings a second, Hz."""


@final
class SmbusBus:
    """A bus by its device file, such as ``/dev/i2c-1``, or an open object of smbus2's kind.

    Raises
    ------
    SourceError
        If the device cannot be opened.
    MissingExtraError
        If a path is given and smbus2 is not installed.
    """

    def __init__(self, device: Any) -> None:
        if isinstance(device, str):
            require("a bus by its device file", "hardware", "smbus2")
            from smbus2 import SMBus

            try:
                device = SMBus(device)
            except OSError as error:
                raise SourceError(
                    f"{device} cannot be opened: {error.strerror}; is I2C switched on, and may "
                    "you use it (group i2c)?"
                ) from error
        self._device = device

    def transfer(self, address: int, data: bytes, count: int) -> bytes:
        """As `Bus.transfer`."""
        from smbus2 import i2c_msg

        answer: Any = i2c_msg.read(address, count)
        self._device.i2c_rdwr(i2c_msg.write(address, data), answer)
        return bytes(list(answer))

    def close(self) -> None:
        """Close the device."""
        self._device.close()


@final
class ChipSource(Source):
    """The chips of a design on a bus that is the source's from here on, at a steady rate.

    Readings are timed from 0, at the middle of their conversions. As in `TwinSource`, readings that
    nobody asked for in time are never made.

    Parameters
    ----------
    design : SkinDesign
        Names addresses and setting of the chips.
    bus : Bus
    rate : float
        Readings a second, Hz.
    mode : "single" or "burst"
    pace : Pace, optional
        Clock by which the readings come.
    clock, sleep : callable
        Clock and wait of the driver (`Chips`), s.

    Raises
    ------
    ArgumentError
        If the chips cannot be read so fast at their setting; the message names one that can.
    SourceError
        If a chip does not answer or does not keep its setting.
    """

    @typed
    def __init__(
        self,
        design: SkinDesign,
        bus: Bus,
        *,
        rate: float = 100.0,
        mode: Mode = "single",
        pace: Pace | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] = time.sleep,
    ) -> None:
        require_between("rate", rate, *_RATES)
        budget = time_budget(design.hall_setting, len(design.halls), mode=mode)
        if budget.rate < rate:
            other = propose_setting(design, rate, mode=mode)
            raise ArgumentError(
                f"rate must be at most {math.floor(budget.rate)} Hz at the design's hall_setting; "
                f"got {rate:g} Hz, which oversampling {other.oversampling} and digital_filter "
                f"{other.digital_filter} allow"
            )
        self._design, self._bus = design, bus
        addresses = [site.address for site in design.halls]
        self._chips = Chips(
            bus, addresses, design.hall_setting, mode=mode, clock=clock, sleep=sleep
        )
        self._pace = Pace() if pace is None else pace
        self._period = 1.0 / rate
        self._using = threading.Lock()
        self._ended = False
        self._chips.begin()
        self._start = clock()

    @property
    def chips(self) -> int:
        """Number of chips in every reading."""
        return len(self._design.halls)

    @property
    def design(self) -> SkinDesign:
        """Design of the skin."""
        return self._design

    @property
    def design_hash(self) -> str:
        """Content hash of the skin's design."""
        return self._design.content_hash

    @property
    def resets(self) -> int:
        """How many times a chip was found to have started again by itself."""
        return self._chips.resets

    def read(self, timeout: float = 1.0) -> Reading | None:
        """The next reading, when its time has come; None when closed."""
        if not self._pace.wait(timeout):
            return None
        with self._using:
            if self._ended:
                return None
            scan = self._chips.scan()
        missed = int(self._pace.lateness / self._period)
        self._pace.advance((missed + 1) * self._period)
        reading = scan.reading(self._design.hall_setting)
        return replace(reading, time=reading.time - self._start)

    def close(self) -> None:
        """End the readings; a waiting `read` returns, the chips rest and the bus is let go of."""
        self._pace.close()
        with self._using:
            if not self._ended:
                self._ended = True
                self._chips.end()
                self._bus.close()
