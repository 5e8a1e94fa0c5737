"""The firmware's own modules, on simulated chips instead of a microcontroller."""

import os
import sys
import threading
import time
import tty
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

from chip_fake import Clock, FakeBus, FakeChip

FOLDER = Path(__file__).parents[1] / "firmware"
sys.path.insert(0, str(FOLDER))

import board as firmware  # noqa: E402
import chips  # noqa: E402
import config  # noqa: E402
import frames  # noqa: E402

__all__ = ["FOLDER", "FirmwareOnPort", "MachineBus", "built", "chips", "config", "frames"]

_TICKS = 1 << 30


class MachineBus:
    """The bus as `machine.I2C` gives it."""

    def __init__(self, bus: FakeBus) -> None:
        self.bus = bus

    def writeto(self, address: int, data: bytes, stop: bool = True) -> int:
        assert not stop, "a stop between command and answer would end the command"
        self.written = bytes(data)
        return len(data)

    def readfrom_into(self, address: int, buffer: bytearray) -> None:
        buffer[:] = self.bus.transfer(address, self.written, len(buffer))


def built(bus: FakeBus, *, rate: float = 100.0, registers=None, **hands) -> firmware.Board:
    """A board on a fake clock, whose ticks wrap as MicroPython's do."""
    clock = bus.clock
    settings = SimpleNamespace(
        ADDRESSES=config.ADDRESSES,
        REGISTERS=registers or config.REGISTERS,
        RATE=rate,
        SERIAL="e6605481db",
    )
    usual = {
        "write": lambda data: None,
        "read": lambda: b"",
        "ticks_us": lambda: round(clock() * 1e6) % _TICKS,
        "ticks_diff": lambda new, old: (new - old + _TICKS // 2) % _TICKS - _TICKS // 2,
        "sleep_us": lambda us: clock.sleep(us * 1e-6),
        "restart": lambda: None,
    }
    return firmware.Board(settings, MachineBus(bus), **(usual | hands))


class FirmwareOnPort:
    """The firmware in real time on a pseudo-terminal."""

    def __init__(self, rate: float) -> None:
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.port = os.ttyname(self.slave)
        self._ended = threading.Event()
        real = {address: FakeChip(time.monotonic) for address in config.ADDRESSES}
        self.board = built(
            FakeBus(Clock(), real, bit=0.0),
            rate=rate,
            write=self._write,
            read=self._read,
            ticks_us=lambda: time.monotonic_ns() // 1000 % _TICKS,
            sleep_us=lambda us: self._ended.wait(us * 1e-6),
        )
        self._begun = False

    def step(self) -> bool:
        """Send the next reading; False once closed."""
        if not self._begun:
            self._begun = True
            self.board.start()
        if not self._ended.is_set():
            self.board.step()
        return not self._ended.is_set()

    def close(self) -> None:
        if not self._ended.is_set():
            self._ended.set()
            os.close(self.master)
            os.close(self.slave)

    def _write(self, data: bytes) -> None:
        with suppress(OSError):
            if not self._ended.is_set():
                os.write(self.master, data)

    def _read(self) -> bytes:
        try:
            return os.read(self.master, 64)
        except OSError:
            return b""
