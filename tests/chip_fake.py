"""MLX90393 chips, byte for byte, on a clock of their own: what drivers and firmware are run on.

Written from the data sheet (rev 011) and independent of the package's driver: registers, commands
and status bits are stated again here.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

HALL = 0xC
DEFAULTS = {0x00: 0x007C, 0x01: 0x0000, 0x02: 0x0000, 0x24: 0xB668}
BURST, SINGLE, ERROR, RESET = 0x80, 0x20, 0x10, 0x04


@dataclass
class Clock:
    """Time that passes only where something waits for it or uses the bus, s."""

    now: float = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0
        self.now += seconds


@dataclass
class FakeChip:
    """One chip.

    `field` gives counts of RES 0 at gain 1x of x, y, z at a time, `word` that of temperature.
    """

    clock: Callable[[], float]
    field: Callable[[float], tuple[int, int, int]] = lambda time: (1000, -2000, 3000)
    word: Callable[[float], int] = lambda time: 46244
    oscillator: float = 1.0
    """Duration of its conversions over the nominal one: 0.9 to 1.1."""
    waking: float = 1.0
    """Duration of its starting and ending over the nominal one: 0.8 to 1.2."""
    stuck: int = 0
    """Bits of register 0 that read as one."""
    answering: bool = True
    registers: dict[int, int] = dataclasses.field(default_factory=lambda: dict(DEFAULTS))
    mode: int = 0
    was_reset: bool = True
    began: float = 0.0
    axes: int = 0
    taken: int = 0
    """Burst measurements that are over and were taken or passed over."""
    ready: float | None = None
    reads: list[float] = dataclasses.field(default_factory=list)
    """Times of the measurements that were given away."""

    def brown_out(self) -> None:
        """Lose the supply for a moment."""
        self.registers = dict(DEFAULTS)
        self.mode, self.ready, self.was_reset = 0, None, True

    def transfer(self, data: bytes, count: int) -> bytes:
        """Answer: always acknowledged, valid or not."""
        if not self.answering:
            raise OSError(121, "Remote I/O error")
        error, payload = self._do(data)
        status = self.mode | ERROR * error | RESET * self.was_reset
        self.was_reset = data[0] == 0xF0 and not error
        # The bits that tell the answer's length have no meaning after commands without one; a
        # driver by others waits there for a byte that is not zero.
        status |= (len(payload) - 2) // 2 & 3 if payload else 3
        return (bytes([status]) + payload + b"\xff" * count)[:count]

    def _do(self, data: bytes) -> tuple[bool, bytes]:
        command, burst = data[0], self.mode == BURST
        if command == 0x00:
            return False, b""
        if command == 0x80:
            self.mode, self.ready = 0, None
            return False, b""
        if command == 0xF0:
            if self.mode:
                return True, b""
            self.brown_out()
            return False, b""
        if command >> 4 == 0x5 and len(data) == 2 and not burst:
            number = data[1] >> 2
            word = self.registers.get(number, 0) | (self.stuck if number == 0 else 0)
            return False, word.to_bytes(2, "big")
        if command >> 4 == 0x6 and len(data) == 4 and not burst:
            self.registers[data[3] >> 2] = data[1] << 8 | data[2]
            return False, b""
        if command >> 4 in (1, 3) and command & 0xF and not burst:
            self.mode = BURST if command >> 4 == 1 else SINGLE
            self.axes = command & 0xF
            self.began, self.taken = self.clock(), 0
            self.ready = self.began + self.conversion if self.mode == SINGLE else None
            return False, b""
        if command >> 4 == 0x4 and command & 0xF:
            return self._measured(command & 0xF)
        return True, b""

    def _measured(self, axes: int) -> tuple[bool, bytes]:
        """The measurement that is ready, once."""
        if self.mode == BURST:
            over = int((self.clock() - self.began - self.first) / self.period + 1)
            over = max(over, 0) if self.clock() >= self.began + self.first else 0
            if over <= self.taken or axes & ~self.axes:
                return True, b""
            self.taken = over
            return False, self._words(self.began + self.first + (over - 1) * self.period, axes)
        waiting = self.ready is None or self.clock() < self.ready
        if self.mode != SINGLE or waiting or axes & ~self.axes:
            return True, b""
        moment, self.ready = self.ready, None
        return False, self._words(moment, axes)

    def _words(self, moment: float, axes: int) -> bytes:
        self.reads.append(moment)
        third = self.registers[2]
        gain = (5, 4, 3, 2.5, 2, 5 / 3, 4 / 3, 1)[self.registers[0] >> 4 & 7]
        # A filter without the time to settle reads falsely.
        false = 0 if (third & 3) + (third >> 2 & 7) >= 2 else 12345
        words = [self.word(moment)] if axes & 1 else []
        for place, value in enumerate(self.field(moment)):
            if not axes >> place + 1 & 1:
                continue
            resolution = third >> 5 + 2 * place & 3
            full = max(-86476, min(86475, round(value / gain) + false))
            words.append((full >> resolution) + (0, 0, 0x8000, 0x4000)[resolution] & 0xFFFF)
        return b"".join(word.to_bytes(2, "big") for word in words)

    @property
    def _conversions(self) -> float:
        third, axes = self.registers[2], self.axes
        magnetic = 67e-6 + 64e-6 * 2 ** (third & 3) * (2 + 2 ** (third >> 2 & 7))
        warm = 67e-6 + 192e-6 * 2 ** (third >> 11 & 3)
        return bin(axes >> 1).count("1") * magnetic + (axes & 1) * warm

    @property
    def conversion(self) -> float:
        """Time of a single measurement, s."""
        return self.oscillator * self._conversions + self.waking * 680e-6

    @property
    def first(self) -> float:
        """Time from the start of a burst to its first measurement, s."""
        return self.conversion

    @property
    def period(self) -> float:
        """Time between measurements of a burst, s."""
        pause = 20e-3 * (self.registers[1] & 0x3F)
        return self.oscillator * (self._conversions + 231e-6 + pause)


@dataclass
class FakeBus:
    """Chips on a bus of 400 kHz, which takes its time."""

    clock: Clock
    chips: dict[int, FakeChip]
    bit: float = 2.5e-6
    log: list[tuple[int, bytes]] = dataclasses.field(default_factory=list)
    closed: bool = False

    def close(self) -> None:
        self.closed = True

    def transfer(self, address: int, data: bytes, count: int) -> bytes:
        # Address and data, repeated start, address and answer; nine bits each.
        self.clock.sleep(self.bit * (9 * (2 + len(data) + count) + 3))
        self.log.append((address, bytes(data)))
        if address not in self.chips:
            raise OSError(6, "No such device or address")
        return self.chips[address].transfer(bytes(data), count)


class BlinkaBus:
    """The bus as CircuitPython programs see it; a write and the read after it are one transfer."""

    def __init__(self, bus: FakeBus) -> None:
        self.bus = bus
        self.written = b""

    def try_lock(self) -> bool:
        return True

    def unlock(self) -> None:
        pass

    def scan(self) -> list[int]:
        return sorted(self.bus.chips)

    def writeto(self, address: int, data: bytes, *, start: int = 0, end: int | None = None) -> None:
        self.written = bytes(data)[start:end]
        if self.written:
            self.answer = self.bus.transfer(address, self.written, 16)
        elif address not in self.bus.chips:
            raise OSError(6, "No such device or address")

    def readfrom_into(
        self, address: int, buffer: bytearray, *, start: int = 0, end: int | None = None
    ) -> None:
        size = len(buffer[start:end])
        if not self.written:
            # Probing for a device reads without a command.
            buffer[start : start + size] = bytes(size)
            return
        buffer[start : start + size] = self.answer[:size]

    def writeto_then_readfrom(
        self,
        address: int,
        out: bytes,
        into: bytearray,
        *,
        out_start: int = 0,
        out_end: int | None = None,
        in_start: int = 0,
        in_end: int | None = None,
    ) -> None:
        size = len(into[in_start:in_end])
        into[in_start : in_start + size] = self.bus.transfer(
            address, bytes(out)[out_start:out_end], size
        )
