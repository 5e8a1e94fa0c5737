"""Frames of the wire format: docs/wire.md, in what MicroPython and CPython share."""

import struct
from binascii import crc32

VERSION = 1
READING, IDENTITY, REFUSAL = 0x01, 0x02, 0x03
IDENTIFY, SET, RESET = 0x81, 0x82, 0x83
LONGEST = 512


def stuff(data):
    """The data without zeros, and the zero that ends it (COBS)."""
    out = bytearray()
    for block in bytes(data).split(b"\0"):
        while len(block) >= 254:
            out.append(255)
            out.extend(block[:254])
            block = block[254:]
        out.append(len(block) + 1)
        out.extend(block)
    out.append(0)
    return out


def unstuff(data):
    """The data that was stuffed so, without the zero; None if it was not."""
    out = bytearray()
    place = 0
    while place < len(data):
        code = data[place]
        block = data[place + 1 : place + code]
        if code == 0 or len(block) != code - 1:
            return None
        place += code
        out.extend(block)
        if code < 255 and place < len(data):
            out.append(0)
    return out


def frame(kind, sequence, body):
    """The bytes of a frame, with the zero behind it."""
    plain = struct.pack("<BBH", VERSION, kind, sequence & 0xFFFF) + body
    return stuff(plain + struct.pack("<I", crc32(plain) & 0xFFFFFFFF))


def reading(sequence, time_us, registers, chips):
    """The frame of a scan; chips are (address, answer of nine bytes)."""
    body = struct.pack("<QHHHB", time_us, registers[0], registers[1], registers[2], len(chips))
    for address, answer in chips:
        # The chip sends high bytes first.
        status, t, x, y, z = struct.unpack(">BHHHH", answer)
        body += struct.pack("<BBHHHH", address, status, t, x, y, z)
    return frame(READING, sequence, body)


class Commands:
    """Commands out of the bytes that a host sends."""

    def __init__(self):
        self.rest = bytearray()

    def feed(self, data):
        """The (kind, body) of the commands that these bytes complete."""
        commands = []
        for byte in data:
            if byte:
                if len(self.rest) <= LONGEST:
                    self.rest.append(byte)
                continue
            plain = unstuff(self.rest) if 0 < len(self.rest) <= LONGEST else None
            self.rest = bytearray()
            if plain is None or len(plain) < 8 or plain[0] != VERSION:
                continue
            if crc32(plain[:-4]) & 0xFFFFFFFF == struct.unpack("<I", plain[-4:])[0]:
                commands.append((plain[1], bytes(plain[4:-4])))
        return commands
