"""Ports and buses of a computer that is made of files."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from smoskin.hardware.ports import buses, hindrances, ports_of


def listed(device: str, **more) -> SimpleNamespace:
    usual = {"product": None, "serial_number": None, "vid": None}
    return SimpleNamespace(device=device, **(usual | more))


def test_ports_on_usb_are_listed_with_their_url() -> None:
    ports = ports_of(
        [
            listed("/dev/ttyUSB1", vid=0x0403),
            listed("/dev/ttyS0"),
            listed("/dev/ttyACM0", vid=0x2E8A, product="Board in FS mode", serial_number="E66"),
        ]
    )
    assert [port.device for port in ports] == ["/dev/ttyACM0", "/dev/ttyUSB1"]
    assert [port.url for port in ports] == ["serial://usb:E66", "serial:///dev/ttyUSB1"]
    assert ports[0].product == "Board in FS mode"


def test_buses_are_listed(tmp_path: Path) -> None:
    for name in ("i2c-1", "i2c-0", "ttyACM0"):
        (tmp_path / name).touch()
    assert buses(tmp_path) == (str(tmp_path / "i2c-0"), str(tmp_path / "i2c-1"))


@pytest.fixture
def computer(tmp_path: Path) -> SimpleNamespace:
    """A port without hindrances."""
    device = tmp_path / "dev" / "ttyUSB0"
    latency = tmp_path / "sys" / "class" / "tty" / "ttyUSB0" / "device" / "latency_timer"
    process = tmp_path / "proc" / "17" / "comm"
    for path, text in ((device, ""), (latency, "1\n"), (process, "bash\n")):
        path.parent.mkdir(parents=True)
        path.write_text(text)
    return SimpleNamespace(
        device=device,
        latency=latency,
        process=process,
        system=tmp_path / "sys",
        processes=tmp_path / "proc",
    )


def lines(computer: SimpleNamespace) -> list[str]:
    findings = hindrances(
        str(computer.device), system=computer.system, processes=computer.processes
    )
    return [str(finding) for finding in findings]


def test_a_free_port_has_no_hindrance(computer: SimpleNamespace) -> None:
    assert lines(computer) == []


def test_each_hindrance_is_told_with_what_to_do(computer: SimpleNamespace) -> None:
    computer.latency.write_text("16\n")
    computer.process.write_text("ModemManager\n")
    findings = lines(computer)
    assert "Its bridge holds bytes back for 16 ms. echo 1 | sudo tee" in findings[0]
    assert "ModemManager runs" in findings[1]
    computer.device.unlink()
    assert "It is not there. Plug the board in, by a cable that carries data" in lines(computer)[0]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_port_that_you_may_not_read_is_told(computer: SimpleNamespace) -> None:
    computer.device.chmod(0)
    assert "Join the group dialout" in lines(computer)[0]
