"""The firmware on a computer: the same chips, byte for byte, and the same wire as the package."""

import ast
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from chip_fake import FakeBus
from firmware_board import FOLDER, built, chips, config, frames
from smoskin.design.skin import HallSetting, SkinDesign
from smoskin.hardware.budget import time_budget
from smoskin.hardware.registers import register_words, setting_of
from smoskin.hardware.wire.framing import Frame, encoded, stuffed
from smoskin.hardware.wire.messages import BoardDecoder, Kind, command, set_command
from smoskin.magnetics import mlx90393
from smoskin.records import ChipFlag

FAST = HallSetting(gain_selection=3, resolution=2, oversampling=0, digital_filter=2)
PLANAR = HallSetting(gain_selection=3, resolution=2, oversampling=1, digital_filter=3)


class Host:
    """Whoever listens to the board and commands it."""

    def __init__(self) -> None:
        self.decoder = BoardDecoder()
        self.packets = []
        self.pending = bytearray()

    def write(self, data: bytes) -> None:
        self.packets += self.decoder.feed(bytes(data))

    def read(self) -> bytes:
        given, self.pending = bytes(self.pending[:64]), self.pending[64:]
        return given


@pytest.fixture
def host() -> Host:
    return Host()


def run(board, count: int) -> None:
    for _ in range(count):
        board.step()


def test_the_configuration_is_the_planar_design(planar: SkinDesign) -> None:
    assert tuple(site.address for site in planar.halls) == config.ADDRESSES
    assert register_words(planar.hall_setting) == config.REGISTERS


@given(st.binary(max_size=600))
def test_both_stuff_alike(data: bytes) -> None:
    wire = frames.stuff(data)
    assert bytes(wire) == stuffed(data) + b"\0"
    assert frames.unstuff(wire[:-1]) == data


@given(st.integers(0, 255), st.integers(0, 65535), st.binary(max_size=400))
def test_both_make_the_same_frames(kind: int, sequence: int, body: bytes) -> None:
    ours = encoded(Frame(kind=kind, sequence=sequence, body=body))
    assert bytes(frames.frame(kind, sequence, body)) == ours
    assert frames.Commands().feed(b"\x05noise\0" + ours) == [(kind, body)]


@given(st.binary(max_size=3000))
def test_noise_commands_nothing(noise: bytes) -> None:
    commands = frames.Commands()
    assert commands.feed(noise) == []
    assert len(commands.rest) <= 513
    assert commands.feed(b"\0" + command(Kind.IDENTIFY)) == [(Kind.IDENTIFY, b"")]


def test_time_budgets_agree() -> None:
    for over, smooth, count in itertools.product(range(4), range(8), (1, 3, 16)):
        setting = HallSetting(
            gain_selection=0, resolution=0, oversampling=over, digital_filter=smooth
        )
        budget = time_budget(setting, count)
        assert chips.scan_us(register_words(setting), count) == pytest.approx(
            1e6 / budget.rate, abs=3
        )


def test_registers_that_the_host_refuses_are_refused() -> None:
    good = register_words(PLANAR)
    for place, bit in itertools.product(range(3), range(16)):
        words = list(good)
        words[place] ^= 1 << bit
        try:
            setting, _ = setting_of(tuple(words))
            readable = words[1] == 0 and mlx90393.settles(setting)
        except ValueError:
            readable = False
        assert chips.valid(tuple(words)) == readable, (place, bit)


@pytest.mark.parametrize(
    ("oscillator", "count"),
    [(0.9, 600), (1.0, 600), (1.1, 600), pytest.param(1.1, 12_000, marks=pytest.mark.slow)],
)
def test_a_minute_at_200_hz_loses_nothing(
    bus: FakeBus, host: Host, oscillator: float, count: int
) -> None:
    for chip, own in zip(bus.chips.values(), (oscillator, 1.0, 2 - oscillator), strict=True):
        chip.oscillator, chip.waking = own, 1 + 2 * (own - 1)
    board = built(bus, rate=200.0, registers=register_words(FAST), write=host.write, read=host.read)
    board.start()
    run(board, count)
    assert len(host.packets) == count
    assert host.decoder.lost == host.decoder.corrupt == host.decoder.repeated == 0
    assert not any(packet.flags.any() for packet in host.packets)
    assert_allclose(np.diff([packet.time for packet in host.packets]), 5e-3, atol=2e-6)
    field = np.array([150e-6, -300e-6, 726e-6])
    assert_allclose(host.packets[-1].field, np.tile(field, (3, 1)), atol=2.5e-6)


def test_the_clock_goes_on_where_the_ticks_wrap(bus: FakeBus, host: Host) -> None:
    bus.clock.now = (1 << 30) * 1e-6 - 0.5
    board = built(bus, write=host.write)
    board.start()
    run(board, 200)
    assert_allclose(np.diff([packet.time for packet in host.packets]), 0.01, atol=2e-6)


def test_a_board_says_who_it_is(bus: FakeBus, host: Host) -> None:
    board = built(bus, write=host.write, read=host.read)
    board.start()
    known = {"board": "smoskin", "serial": "e6605481db", "chips": "0c 0d 0e", "rate": "100"}
    assert host.decoder.identity == {**known, "firmware": "1"}
    host.decoder.identity.clear()
    host.pending += command(Kind.IDENTIFY)
    run(board, 1)
    assert host.decoder.identity["rate"] == "100"
    assert host.decoder.lost == 0


def test_rate_and_setting_are_changed_by_command(bus: FakeBus, host: Host) -> None:
    board = built(bus, write=host.write, read=host.read)
    board.start()
    run(board, 5)
    host.pending += set_command(FAST, 250.0)
    run(board, 50)
    times = np.array([packet.time for packet in host.packets])
    assert_allclose(np.diff(times[8:]), 4e-3, atol=2e-6)
    assert {chip.registers[2] for chip in bus.chips.values()} == {register_words(FAST)[2]}
    assert not any(packet.flags.any() for packet in host.packets)
    assert host.decoder.refusals == []


@pytest.mark.parametrize(
    ("order", "why"),
    [
        (set_command(PLANAR, 200.0), "rate must be at most 146 Hz at this setting"),
        (command(Kind.SET, bytes(10)), "registers must hold HALLCONF 0xC"),
        (command(Kind.SET, bytes(9)), "the command is not known"),
        (command(Kind.READING), "the command is not known"),
    ],
)
def test_what_cannot_be_done_is_refused(bus: FakeBus, host: Host, order: bytes, why: str) -> None:
    board = built(bus, write=host.write, read=host.read)
    board.start()
    host.pending += order
    run(board, 20)
    assert len(host.decoder.refusals) == 1
    assert host.decoder.refusals[0].startswith(why)
    assert_allclose(np.diff([packet.time for packet in host.packets]), 0.01, atol=2e-6)


def test_a_board_starts_again_by_command(bus: FakeBus, host: Host) -> None:
    restarts = []
    board = built(
        bus, write=host.write, read=host.read, restart=lambda: restarts.append(bus.clock())
    )
    board.start()
    host.pending += command(Kind.RESET)
    run(board, 2)
    assert len(restarts) == 1


def test_a_chip_that_loses_its_supply_is_marked_and_set_anew(bus: FakeBus, host: Host) -> None:
    board = built(bus, write=host.write)
    board.start()
    run(board, 3)
    bus.chips[0x0D].brown_out()
    run(board, 3)
    flags = [packet.flags.tolist() for packet in host.packets]
    invalid = int(ChipFlag.INVALID)
    assert flags == [[0, 0, 0]] * 3 + [[0, invalid, 0]] + [[0, 0, 0]] * 2
    assert np.isnan(host.packets[3].field[1]).all()


def test_a_register_that_changes_in_silence_is_found(bus: FakeBus, host: Host) -> None:
    board = built(bus, write=host.write)
    board.start()
    bus.chips[0x0E].registers[2] ^= 1 << 2
    run(board, 12)
    flags = np.array([packet.flags for packet in host.packets])
    assert np.count_nonzero(flags[:, 2] & int(ChipFlag.INVALID)) == 1
    assert_array_equal(flags[-2:], 0)


def test_a_chip_that_is_not_there_is_missing(bus: FakeBus, host: Host) -> None:
    del bus.chips[0x0C]
    board = built(bus, write=host.write)
    board.start()
    run(board, 3)
    assert_array_equal(host.packets[-1].flags, [ChipFlag.MISSING, 0, 0])


def test_a_slow_chip_is_old_not_false(bus: FakeBus, host: Host) -> None:
    bus.chips[0x0E].oscillator = 1.5
    board = built(bus, write=host.write)
    board.start()
    run(board, 3)
    assert_array_equal(host.packets[-1].flags, [0, 0, ChipFlag.OLD])


def test_files_keep_to_what_micropython_has() -> None:
    """No annotations, dataclasses or matching; only modules that a board has."""
    known = {"struct", "binascii", "gc", "sys", "time", "machine", "micropython", "select"}
    own = {path.stem for path in FOLDER.glob("*.py")}
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            assert not isinstance(node, ast.AnnAssign | ast.Match | ast.NamedExpr), path.name
            if isinstance(node, ast.Import):
                assert {alias.name for alias in node.names} <= known | own, path.name
            if isinstance(node, ast.ImportFrom):
                assert node.module in known | own, path.name
            if isinstance(node, ast.FunctionDef):
                assert node.returns is None, path.name
