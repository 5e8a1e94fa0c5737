"""The board: scans its chips at a steady rate, sends readings and does what it is told."""

import struct

import chips as chip
import frames

FIRMWARE = "1"
SHORTEST_US = 500


class Board:
    """A board of chips, free of the hardware under it.

    `write` sends bytes, whole or not at all, and `read` gives those that have come; `ticks_us` is
    a clock that wraps and `ticks_diff` the difference of two of its times, as in MicroPython.
    """

    def __init__(self, config, bus, write, read, ticks_us, ticks_diff, sleep_us, restart):
        self.write = write
        self.read = read
        self.ticks_us = ticks_us
        self.ticks_diff = ticks_diff
        self.sleep_us = sleep_us
        self.restart = restart
        self.serial = config.SERIAL
        self.chips = chip.Chips(bus, config.ADDRESSES, config.REGISTERS, sleep_us)
        self.commands = frames.Commands()
        self.sequence = 0
        self.period_us = 0
        self.now_us = 0
        self.last_tick = ticks_us()
        self.set_rate(config.RATE)
        self.due_us = 0

    def start(self):
        """Set the chips and say who this is."""
        self.chips.set_all()
        self.identify()
        self.due_us = self.clock_us()

    def step(self):
        """Wait for the next scan, do it, send it, and do what has been commanded."""
        wait = self.due_us - self.clock_us()
        if wait > 0:
            self.sleep_us(wait)
        began = self.clock_us()
        # Scans that could not be made in time are left out, not made up for.
        self.due_us += self.period_us
        if self.due_us < began:
            self.due_us = began + self.period_us
        answers = self.chips.scan()
        middle = began + chip.conversion_us(self.chips.registers) // 2
        scanned = [(a, answers[place]) for place, a in enumerate(self.chips.addresses)]
        self.write(frames.reading(self.number(), middle, self.chips.registers, scanned))
        for kind, body in self.commands.feed(self.read()):
            self.obey(kind, body)

    def clock_us(self):
        """Time since the start, us; unlike the ticks it does not wrap."""
        tick = self.ticks_us()
        self.now_us += self.ticks_diff(tick, self.last_tick)
        self.last_tick = tick
        return self.now_us

    def number(self):
        """Number of the next frame."""
        self.sequence = (self.sequence + 1) & 0xFFFF
        return (self.sequence - 1) & 0xFFFF

    def set_rate(self, rate):
        """Scan so many times a second."""
        self.period_us = int(1000000 / rate)

    def obey(self, kind, body):
        """Do a command, or say why not."""
        if kind == frames.IDENTIFY:
            self.identify()
        elif kind == frames.RESET:
            self.restart()
        elif kind == frames.SET and len(body) == 10:
            self.set(*struct.unpack("<IHHH", body))
        else:
            self.refuse("the command is not known")

    def set(self, period_us, *registers):
        """Take another rate and other registers, if the chips can be read so."""
        if not chip.valid(registers):
            self.refuse("registers must hold HALLCONF 0xC, one resolution, OSR + filter >= 2")
            return
        least = max(chip.scan_us(registers, len(self.chips.addresses)), SHORTEST_US)
        if period_us < least:
            self.refuse("rate must be at most %d Hz at this setting" % (1000000 // least))
            return
        self.period_us = period_us
        if registers != self.chips.registers:
            self.chips.registers = registers
            self.chips.set_all()
        self.due_us = self.clock_us()

    def identify(self):
        """Send lines about the board."""
        lines = (
            "board=smoskin",
            "firmware=" + FIRMWARE,
            "serial=" + self.serial,
            "chips=" + " ".join("%02x" % address for address in self.chips.addresses),
            "rate=%g" % (1000000 / self.period_us),
        )
        body = "".join(line + "\n" for line in lines).encode()
        self.write(frames.frame(frames.IDENTITY, self.number(), body))

    def refuse(self, sentence):
        """Say why a command was not done."""
        self.write(frames.frame(frames.REFUSAL, self.number(), sentence.encode()))
