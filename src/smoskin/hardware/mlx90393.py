"""Chips on one bus, read together.

Decides the order of commands: all chips are started, one conversion is waited for, all are read;
and what is done with a chip that is silent, late or has started again. Hides the status bytes.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, Literal, Protocol, final

from smoskin.arguments import typed
from smoskin.design.skin import HallSetting
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware import registers as chip
from smoskin.hardware.health import Finding, examine_readings
from smoskin.hardware.registers import Scan
from smoskin.magnetics import mlx90393

Mode = Literal["single", "burst"]

_LEAVING: Final = 1e-3
"""Time that a chip takes to leave a mode, s (data sheet, 15.3.1.2)."""
_STARTING: Final = 2e-3
"""Time that a chip takes to start again, s: 1.5 ms, and a third more."""
_RETRIES: Final = 3
"""Readings of a chip that is not ready, a twentieth of its conversion apart."""
_EXAMINED: Final = 32
"""Scans that an examination takes."""


class Bus(Protocol):
    """An I2C bus; every failure is an `OSError`."""

    def transfer(self, address: int, data: bytes, count: int) -> bytes:
        """Write these bytes to a 7-bit address and, after a repeated start, read so many back."""
        ...

    def close(self) -> None:
        """Let go of the bus."""
        ...


@final
class Chips:
    """MLX90393 of one setting, started together and read after one conversion.

    `begin` writes the setting to every chip and reads it back; `scan` measures once. A chip that
    starts again by itself, after a brown-out, is found by its status byte, or within 3 S scans by
    a register that is read back, and set anew; what it says meanwhile is marked.

    In the mode "burst" chips measure by themselves, each on its own oscillator, and a scan reads
    what is new: faster, but not at one moment.

    Parameters
    ----------
    bus : Bus
    addresses : sequence of int
        7-bit addresses of the S chips, in the order of every scan.
    setting : HallSetting
    mode : "single" or "burst"
    temperature_oversampling : int
        OSR2, 0..3.
    clock, sleep : callable
        Monotonic time, s, and a wait of so many seconds.

    Raises
    ------
    ArgumentError
        If there is no address, one is not in 0x08..0x77 or occurs twice, or the chip's filter has
        no time to settle (`smoskin.magnetics.mlx90393.settles`).
    """

    @typed
    def __init__(
        self,
        bus: Bus,
        addresses: Sequence[int],
        setting: HallSetting,
        *,
        mode: Mode = "single",
        temperature_oversampling: int = 0,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] = time.sleep,
    ) -> None:
        if not addresses or len(set(addresses)) < len(addresses):
            raise ArgumentError(f"addresses must be different ones; got {list(addresses)}")
        if not all(0x08 <= address <= 0x77 for address in addresses):
            raise ArgumentError(f"addresses must lie in 0x08..0x77; got {list(addresses)}")
        if not mlx90393.settles(setting):
            raise ArgumentError(
                "setting must leave the chip's filter time: oversampling + digital_filter must be "
                f"at least 2; got {setting.oversampling} + {setting.digital_filter}"
            )
        self.addresses = tuple(addresses)
        """7-bit addresses, in the order of every scan."""
        self.setting = setting
        """Setting of every chip."""
        self.mode = mode
        """Whether chips measure when they are told to, or all the time."""
        self.resets = 0
        """How many times a chip was found to have started again by itself."""
        self._bus = bus
        self._words = chip.register_words(setting, temperature_oversampling)
        self._clock, self._sleep = clock, sleep
        times = setting, temperature_oversampling
        self._typical = mlx90393.conversion_time(*times)
        self._worst = mlx90393.conversion_time(*times, worst=True)
        self._period = mlx90393.burst_period(*times, worst=True)
        self._due = 0.0
        self._checked = 0

    def begin(self) -> None:
        """Set every chip, read its registers back, and start the burst where that is the mode.

        It raises a `SourceError` that names every chip that does not answer or does not keep what
        is written to it.
        """
        problems = [finding for finding in map(self._set, self.addresses) if finding is not None]
        if problems:
            raise SourceError("; ".join(map(str, problems)))
        self._due = self._clock() + self._worst

    def end(self) -> None:
        """Let every chip that answers rest."""
        for address in self.addresses:
            self._status(address, chip.EXIT)

    def scan(self) -> Scan:
        """One measurement of every chip; a chip with nothing new or true to say is marked so."""
        started = [0] * len(self.addresses)
        if self.mode == "burst":
            self._wait_until(self._due)
            moment = self._clock()
            # The next measurement of the chip that is read first is over one period later.
            self._due = moment + self._period
        else:
            began = self._clock()
            started = [self._status(address, chip.START_SINGLE) for address in self.addresses]
            ended = self._clock()
            moment = (began + ended + self._typical) / 2
            self._wait_until(ended + self._worst)
        answers = [*map(self._measured, self.addresses, started)]
        if self.mode == "single":
            self._check_one(answers)
        for address, answer in zip(self.addresses, answers, strict=True):
            if answer[0] != chip.NO_ANSWER and answer[0] & chip.WAS_RESET:
                self.resets += 1
                self._set(address)
                self._due = self._clock() + self._worst
        return Scan(
            time=moment,
            status=[answer[0] for answer in answers],
            words=[
                [int.from_bytes(answer[k : k + 2], "big") for k in range(1, chip.MEASUREMENT, 2)]
                for answer in answers
            ],
        )

    def examine(self) -> tuple[Finding, ...]:
        """What is wrong with these chips, by themselves and by some scans of a skin at rest."""
        problems = [finding for finding in map(self._set, self.addresses) if finding is not None]
        silent = {finding.where for finding in problems}
        self._due = self._clock() + self._worst
        readings = [self.scan().reading(self.setting) for _ in range(_EXAMINED)]
        names = {f"chip {k + 1}": _where(a) for k, a in enumerate(self.addresses)}
        heard = [
            replace(finding, where=names[finding.where])
            for finding in examine_readings(readings, setting=self.setting)
        ]
        return (*problems, *(finding for finding in heard if finding.where not in silent))

    def _set(self, address: int) -> Finding | None:
        """Restart a chip and write its registers; what is wrong if that fails."""
        if self._status(address, chip.EXIT) == chip.NO_ANSWER:
            remedy = "Look at its supply, its wires and the order code, which gives the address."
            return Finding(where=_where(address), problem="It does not answer.", remedy=remedy)
        self._sleep(_LEAVING)
        self._status(address, chip.RESET)
        self._sleep(_STARTING)
        for number, word in enumerate(self._words):
            written = bytes([chip.WRITE_REGISTER, word >> 8, word & 0xFF, number << 2])
            self._ask(address, written, 1)
            if not self._keeps(address, number):
                problem = f"Its register {number} does not keep {word:#06x}."
                return Finding(where=_where(address), problem=problem, remedy=_REPLACE)
        if self.mode == "burst":
            self._status(address, chip.START_BURST)
        return None

    def _keeps(self, address: int, number: int) -> bool:
        """Whether a register still holds what was written to it."""
        answer = self._ask(address, bytes([chip.READ_REGISTER, number << 2]), 3)
        # Bits of register 1 beyond the burst rate and selection are the factory's.
        mask = 0x3FF if number == 1 else 0xFFFF
        kept = int.from_bytes(answer[1:], "big") & mask == self._words[number]
        return answer[0] & chip.ERROR == 0 and kept

    def _check_one(self, answers: list[bytes]) -> None:
        """Read one register of one chip back, another each time, and mark the chip if it is off."""
        place, number = divmod(self._checked, len(self._words))
        self._checked = (self._checked + 1) % (len(self.addresses) * len(self._words))
        status = answers[place][0]
        if status != chip.NO_ANSWER and not self._keeps(self.addresses[place], number):
            answers[place] = bytes([status | chip.WAS_RESET]) + answers[place][1:]

    def _measured(self, address: int, started: int) -> bytes:
        """A chip's answer to being read, its status byte saying what is wrong with it."""
        command = bytes([chip.READ_MEASUREMENT])
        answer = self._ask(address, command, chip.MEASUREMENT)
        for _ in range(_RETRIES):
            if answer[0] == chip.NO_ANSWER or not answer[0] & chip.ERROR or _reset(answer[0]):
                break
            self._sleep(self._period / 20)
            answer = self._ask(address, command, chip.MEASUREMENT)
        status = answer[0]
        if status == chip.NO_ANSWER or started == chip.NO_ANSWER:
            return bytes([chip.NO_ANSWER]) + answer[1:]
        # What was started with a loss of its registers, or has left the burst, has started again.
        left = self.mode == "burst" and not status & chip.IN_BURST
        if _reset(started) or left:
            status |= chip.WAS_RESET
        return bytes([status | started & chip.ERROR]) + answer[1:]

    def _status(self, address: int, command: int) -> int:
        """Status byte that a chip gives to a command of one byte."""
        return self._ask(address, bytes([command]), 1)[0]

    def _ask(self, address: int, data: bytes, count: int) -> bytes:
        """A chip's answer; ones where there is none."""
        silence = bytes([chip.NO_ANSWER]) * count
        try:
            answer = bytes(self._bus.transfer(address, data, count))
        except OSError:
            return silence
        return answer if len(answer) == count else silence

    def _wait_until(self, moment: float) -> None:
        while (left := moment - self._clock()) > 0.0:
            self._sleep(left)


_REPLACE: Final = "Solder it anew or replace it."


def _where(address: int) -> str:
    return f"chip {address:#04x}"


def _reset(status: int) -> bool:
    return status != chip.NO_ANSWER and bool(status & chip.WAS_RESET)


def present(bus: Bus) -> tuple[int, ...]:
    """Addresses at which an MLX90393 of any order code may answer, of those where one does."""
    answering = []
    for address in chip.ADDRESSES:
        try:
            status = bus.transfer(address, bytes([chip.NOTHING]), 1)
        except OSError:
            continue
        if status and status[0] != chip.NO_ANSWER:
            answering.append(address)
    return tuple(answering)
