"""The firmware in MicroPython's own interpreter: to the same bytes it answers with the same."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from chip_fake import FakeBus
from firmware_board import FOLDER, MachineBus, built
from smoskin.design.skin import HallSetting
from smoskin.hardware.wire.messages import BoardDecoder, Kind, command, set_command

NODE = Path(os.environ.get("SMOSKIN_NODE_MODULES", "node_modules")).absolute()
PACKAGE = "@micropython/micropython-webassembly-pyscript"
FAST = HallSetting(gain_selection=3, resolution=2, oversampling=0, digital_filter=2)

PROGRAM = """
import json, sys, time
sys.path.insert(0, "/")
import board

calls = json.load(open("/calls.json"))
place = 0

def hand(name):
    def call(*given):
        global place
        given = [list(each) if isinstance(each, (bytes, bytearray)) else each for each in given]
        asked, wanted, answer = calls[place]
        assert (name, given) == (asked, wanted), (place, name, given, asked, wanted)
        place += 1
        return bytes(answer) if isinstance(answer, list) else answer
    return call

class Bus:
    write = hand("writeto")
    fetch = hand("readfrom_into")

    def writeto(self, address, data, stop):
        Bus.write(address, data, stop)
        return len(data)

    def readfrom_into(self, address, buffer):
        answer = Bus.fetch(address, len(buffer))
        if answer is None:
            raise OSError(121)
        buffer[:] = answer

class Config:
    ADDRESSES = (0x0C, 0x0D, 0x0E)
    REGISTERS = (0x003C, 0x0000, 0x054D)
    RATE = 100.0
    SERIAL = "e6605481db"

hands = [hand(name) for name in ("write", "read", "ticks_us")]
own = board.Board(Config, Bus(), *hands, time.ticks_diff, hand("sleep_us"), hand("restart"))
own.start()
while place < len(calls):
    own.step()
print(sys.implementation.name, place)
"""


class Witness:
    """Everything that the board asks of its surroundings, and what it is answered."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, list, object]] = []

    def of(self, name: str, call):
        """The same call, noted down."""

        def noted(*given):
            answer = call(*given)
            logged = list(answer) if isinstance(answer, bytes | bytearray) else answer
            self.calls.append((name, [_plain(each) for each in given], logged))
            return answer

        return noted


class WitnessedBus(MachineBus):
    """A bus whose transfers are noted down; an answer that does not come is None."""

    def __init__(self, bus: FakeBus, witness: Witness) -> None:
        super().__init__(bus)
        self.calls = witness.calls

    def writeto(self, address: int, data: bytes, stop: bool = True) -> int:
        self.calls.append(("writeto", [address, _plain(data), stop], len(data)))
        return super().writeto(address, data, stop)

    def readfrom_into(self, address: int, buffer: bytearray) -> None:
        place = len(self.calls)
        self.calls.append(("readfrom_into", [address, len(buffer)], None))
        super().readfrom_into(address, buffer)
        self.calls[place] = (*self.calls[place][:2], list(buffer))


def _plain(value):
    return list(value) if isinstance(value, bytes | bytearray) else value


def witnessed(bus: FakeBus) -> tuple[list, BoardDecoder]:
    """A board's life on this side: chips fail, hosts command, noise comes, the ticks wrap."""
    witness, decoder = Witness(), BoardDecoder()
    pending = bytearray()

    def read() -> bytes:
        given = bytes(pending[:64])
        del pending[:64]
        return given

    bus.clock.now = (1 << 30) * 1e-6 - 0.1
    clock = bus.clock
    board = built(
        bus,
        write=witness.of("write", lambda data: decoder.feed(bytes(data)) and None),
        read=witness.of("read", read),
        ticks_us=witness.of("ticks_us", lambda: round(clock() * 1e6) % (1 << 30)),
        sleep_us=witness.of("sleep_us", lambda us: clock.sleep(us * 1e-6)),
        restart=witness.of("restart", lambda: None),
    )
    board.chips.bus = WitnessedBus(bus, witness)
    board.start()
    orders = {
        2: command(Kind.IDENTIFY),
        4: set_command(FAST, 250.0),
        20: set_command(FAST, 400.0),
        22: bytes(range(256)) * 3 + b"\0" + command(Kind.SET, bytes(10)),
        45: command(Kind.RESET),
    }
    for step in range(50):
        pending += orders.get(step, b"")
        if step == 8:
            bus.chips[0x0D].brown_out()
        if step == 12:
            bus.chips[0x0E].answering = False
        if step == 16:
            bus.chips[0x0E].answering = True
        board.step()
    return witness.calls, decoder


def in_micropython(calls: list) -> subprocess.CompletedProcess:
    """The board in MicroPython, answered as it was here."""
    if not shutil.which("node") or not (NODE / PACKAGE).is_dir():
        pytest.skip(f"npm install {PACKAGE}, and name its folder in SMOSKIN_NODE_MODULES")
    files = {f"{name}.py": (FOLDER / f"{name}.py").read_text() for name in _MODULES}
    given = json.dumps({"files": {**files, "calls.json": json.dumps(calls)}, "program": PROGRAM})
    script = Path(__file__).with_name("micropython.mjs")
    return subprocess.run(
        ["node", script, NODE], input=given, capture_output=True, text=True, timeout=60, check=False
    )


_MODULES = ("frames", "chips", "board")


def test_micropython_sends_and_asks_to_the_byte_what_is_sent_here(bus: FakeBus) -> None:
    calls, decoder = witnessed(bus)
    assert len(decoder.refusals) == 2
    assert decoder.identity["rate"] == "100"
    done = in_micropython(calls)
    assert done.stdout.split() == ["micropython", str(len(calls))], done.stderr


def test_a_byte_that_differs_is_noticed(bus: FakeBus) -> None:
    calls, _ = witnessed(bus)
    place = next(k for k, call in enumerate(calls) if call[0] == "write" and k > 500)
    calls[place][1][0][5] ^= 1
    done = in_micropython(calls)
    assert done.returncode != 0
    assert "AssertionError" in done.stderr
