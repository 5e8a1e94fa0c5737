"""MLX90393 chips on one I2C bus: all are started, one conversion is waited for, all are read."""

# Commands, each for T, X, Y and Z (Melexis MLX90393 data sheet).
START, READ, READ_REGISTER, WRITE_REGISTER, EXIT, RESET = 0x3F, 0x4F, 0x50, 0x60, 0x80, 0xF0
# Bits of the status byte, and what stands for it where a chip does not answer.
ERROR, WAS_RESET, NO_ANSWER = 0x10, 0x04, 0xFF

BIT_US = 2.5  # on a bus of 400 kHz


def conversion_us(registers):
    """Longest time of a measurement of T, X, Y and Z, us, for the slowest oscillator."""
    third = registers[2]
    samples = (1 << (third & 3)) * (2 + (1 << (third >> 2 & 7)))
    measuring = 3 * (67 + 64 * samples) + 67 + (192 << (third >> 11 & 3))
    # A tenth for the oscillator, a fifth on the 680 us to wake and to end.
    return measuring * 11 // 10 + 816


def scan_us(registers, count):
    """Longest time of a scan of so many chips, us: start, convert, read, and check a register."""
    transfers = count * (9 * 4 + 3) + count * (9 * 12 + 3) + 9 * 7 + 3
    return conversion_us(registers) + int(transfers * BIT_US)


def valid(registers):
    """Whether the host can read fields of these registers, and the chip's filter settles."""
    first, second, third = registers
    resolutions = third >> 5 & 3, third >> 7 & 3, third >> 9 & 3
    return (
        first & ~0x70 == 0x0C
        and second == 0
        and third < 1 << 13
        and resolutions[0] == resolutions[1] == resolutions[2]
        and (third & 3) + (third >> 2 & 7) >= 2
    )


class Chips:
    """Chips by their addresses; the bus is one of MicroPython's `machine.I2C`."""

    def __init__(self, bus, addresses, registers, sleep_us):
        self.bus = bus
        self.addresses = addresses
        self.registers = registers
        self.sleep_us = sleep_us
        self.checked = 0
        self.answers = [bytearray(9) for _ in addresses]
        self.status = bytearray(1)
        self.word = bytearray(3)

    def ask(self, address, command, answer):
        """Send a command and fill the answer; ones where there is none."""
        try:
            self.bus.writeto(address, command, False)
            self.bus.readfrom_into(address, answer)
        except OSError:
            for k in range(len(answer)):
                answer[k] = NO_ANSWER
        return answer[0]

    def set_up(self, address):
        """Restart a chip and write its registers; whether it keeps them."""
        if self.ask(address, bytes((EXIT,)), self.status) == NO_ANSWER:
            return False
        self.sleep_us(1000)
        self.ask(address, bytes((RESET,)), self.status)
        self.sleep_us(2000)
        for number, word in enumerate(self.registers):
            command = bytes((WRITE_REGISTER, word >> 8, word & 0xFF, number << 2))
            self.ask(address, command, self.status)
        return all(self.keeps(address, number) for number in range(3))

    def set_all(self):
        """Addresses of the chips that do not answer or do not keep their registers."""
        return [address for address in self.addresses if not self.set_up(address)]

    def keeps(self, address, number):
        """Whether a register holds what was written to it."""
        status = self.ask(address, bytes((READ_REGISTER, number << 2)), self.word)
        mask = 0x3FF if number == 1 else 0xFFFF
        word = (self.word[1] << 8 | self.word[2]) & mask
        return not status & ERROR and word == self.registers[number]

    def scan(self):
        """Answers of all chips to being read, in their order; a chip that was lost is set anew."""
        start, read = bytes((START,)), bytes((READ,))
        started = [self.ask(address, start, self.status) for address in self.addresses]
        self.sleep_us(conversion_us(self.registers))
        for place, address in enumerate(self.addresses):
            answer = self.answers[place]
            self.ask(address, read, answer)
            if started[place] == NO_ANSWER:
                answer[0] = NO_ANSWER
            elif answer[0] != NO_ANSWER:
                # What was started without registers measured with those of power-on.
                answer[0] |= started[place] & (WAS_RESET | ERROR)
        self.check_one()
        for place, address in enumerate(self.addresses):
            status = self.answers[place][0]
            if status != NO_ANSWER and status & WAS_RESET:
                self.set_up(address)
        return self.answers

    def check_one(self):
        """Read one register of one chip back, another each time, and mark the chip if it is off."""
        place, number = divmod(self.checked, 3)
        self.checked = (self.checked + 1) % (3 * len(self.addresses))
        answer = self.answers[place]
        if answer[0] != NO_ANSWER and not self.keeps(self.addresses[place], number):
            answer[0] |= WAS_RESET
