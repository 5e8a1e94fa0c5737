"""The board on a microcontroller with MicroPython: an RP2040 or an ESP32-S3 with native USB."""

import gc
import select
import sys
import time
from binascii import hexlify

import config
import machine
import micropython
from board import Board


def main():
    """Run the board of `config` for ever."""
    micropython.kbd_intr(-1)  # frames may hold the byte of Ctrl-C
    if not config.SERIAL:
        config.SERIAL = hexlify(machine.unique_id()).decode()
    bus = machine.I2C(
        config.BUS, scl=machine.Pin(config.SCL), sda=machine.Pin(config.SDA), freq=400000
    )
    waiting = select.poll()
    waiting.register(sys.stdin, select.POLLIN)
    ready = select.poll()
    ready.register(sys.stdout, select.POLLOUT)

    def write(data):
        if ready.poll(0):  # a host that does not read must not hold the chips up
            sys.stdout.buffer.write(data)

    def read():
        data = bytearray()
        while len(data) < 64 and waiting.poll(0):
            data.extend(sys.stdin.buffer.read(1))
        return data

    board = Board(
        config, bus, write, read, time.ticks_us, time.ticks_diff, time.sleep_us, machine.reset
    )
    board.start()
    while True:
        board.step()
        gc.collect()


main()
