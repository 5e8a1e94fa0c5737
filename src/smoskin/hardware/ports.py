"""Serial ports and buses of this computer: what there is, and what keeps one from being read.

Decides what counts as a hindrance. Hides where Linux tells it.
"""

import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from smoskin.errors import require
from smoskin.hardware.health import Finding

_LATENCY: Final = 2
"""Milliseconds that a USB bridge may hold bytes back."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A serial port that a board may be on."""

    device: str
    """Device file, such as ``/dev/ttyACM0``."""
    product: str
    """What the board calls itself; empty where it does not."""
    serial: str
    """USB serial number, by which ``serial://usb:SERIAL`` finds it; empty where it has none."""

    @property
    def url(self) -> str:
        """URL of the board, by its serial number where it has one."""
        return f"serial://usb:{self.serial}" if self.serial else f"serial://{self.device}"


def serial_ports() -> tuple[Port, ...]:
    """Ports with something plugged in; `MissingExtraError` without pyserial."""
    require("a list of serial ports", "hardware", "serial")
    from serial.tools import list_ports

    return ports_of(list_ports.comports())


def ports_of(listed: Iterable[Any]) -> tuple[Port, ...]:
    """The ports of pyserial's list that are on USB; the others are there without any board."""
    return tuple(
        Port(
            device=str(port.device),
            product=str(port.product or ""),
            serial=str(port.serial_number or ""),
        )
        for port in sorted(listed, key=lambda port: str(port.device))
        if port.vid is not None
    )


def buses(root: Path = Path("/dev")) -> tuple[str, ...]:
    """Device files of the computer's I2C buses."""
    return tuple(str(path) for path in sorted(root.glob("i2c-*")))


def hindrances(
    device: str, *, system: Path = Path("/sys"), processes: Path = Path("/proc")
) -> tuple[Finding, ...]:
    """What keeps a port from being read, or read soon, as far as the system tells."""
    findings = []
    where = f"port {device}"
    if not os.path.exists(device):
        return (
            Finding(
                where=where,
                problem="It is not there.",
                remedy="Plug the board in, by a cable that carries data: many only charge. A board "
                "that waits in its boot loader is a disk, not a port: press its reset.",
            ),
        )
    if not os.access(device, os.R_OK | os.W_OK):
        remedy = "Join the group dialout: sudo usermod -aG dialout $USER, then log in again."
        findings.append(Finding(where=where, problem="You may not read it.", remedy=remedy))
    latency = system / "class" / "tty" / Path(device).name / "device" / "latency_timer"
    with suppress(OSError, ValueError):
        held = int(latency.read_text())
        if held > _LATENCY:
            findings.append(
                Finding(
                    where=where,
                    problem=f"Its bridge holds bytes back for {held} ms.",
                    remedy=f"echo 1 | sudo tee {latency}",
                )
            )
    if any(_name(path) == "ModemManager" for path in processes.glob("[0-9]*/comm")):
        findings.append(
            Finding(
                where=where,
                problem="ModemManager runs, and talks to every new port for some seconds.",
                remedy="Wait half a minute, or: sudo systemctl stop ModemManager.",
            )
        )
    return tuple(findings)


def _name(path: Path) -> str:
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""
