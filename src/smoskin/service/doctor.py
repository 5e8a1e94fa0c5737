"""A source looked at for some seconds: what is wrong, and what to do.

Decides what is looked at and in which order: the port, whether anything comes, what it is, how
steadily, and what the chips say.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from smoskin.arguments import typed
from smoskin.design.skin import SkinDesign
from smoskin.errors import SmoskinError, SourceError
from smoskin.hardware.health import Finding, chip_names, examine_readings, interference
from smoskin.hardware.ports import buses, hindrances, serial_ports
from smoskin.hardware.serial import SerialSource, heard_on, recognised
from smoskin.records import Reading
from smoskin.roles import Source
from smoskin.service.source import open_source


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """What was looked at, and what is wrong with it."""

    looked: tuple[str, ...]
    """Lines about what there is and what came."""
    findings: tuple[Finding, ...]
    """What is wrong; empty where nothing was found."""

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines."""
        findings = [
            {"where": f.where, "problem": f.problem, "remedy": f.remedy} for f in self.findings
        ]
        return {"looked": list(self.looked), "findings": findings}

    def __str__(self) -> str:
        wrong = [f"! {finding}" for finding in self.findings] or ["Nothing is wrong."]
        return "\n".join([*self.looked, *wrong])


@typed
def look_around(*, seconds: float = 1.0) -> Diagnosis:
    """Ports and buses of this computer, with the URL that reads each board that sends already."""
    looked: list[str] = []
    findings: list[Finding] = []
    ports, wires = serial_ports(), buses()
    for port in ports:
        findings += hindrances(port.device)
        try:
            heard = heard_on(port.device, seconds)
        except SourceError as error:
            looked.append(f"{port.device}: {port.product or 'a port'}; {error}")
            continue
        formats = recognised(heard)
        speaks = f"smoskin run '{port.url}?format={formats[0]}'" if formats else _strange(heard)
        looked.append(f"{port.device}: {port.product or 'a port'}; {speaks}")
    looked += [f"{bus}: smoskin run i2c://{bus}" for bus in wires]
    if not ports and not wires:
        remedy = (
            "Plug a board in, by a cable that carries data, or try one without hardware: smoskin "
            "board --virtual planar."
        )
        problem = "No port has a board, and there is no I2C bus."
        findings.append(Finding(where="this computer", problem=problem, remedy=remedy))
    return Diagnosis(looked=tuple(looked), findings=tuple(findings))


@typed
def examine_source(
    url: str,
    *,
    design: SkinDesign | None = None,
    seconds: float = 5.0,
    moving: float = 0.0,
    say: Callable[[str], object] = lambda sentence: None,
) -> Diagnosis:
    """What is wrong with a source of readings, by some seconds of the untouched skin.

    With `moving` a robot is then moved for so many seconds, nothing touching; `say` is told when.
    The design is the source's own by default. What `open_source` refuses as no URL at all raises
    its `ArgumentError`; a source that cannot be opened or is silent is a finding.
    """
    kind, _, rest = url.partition(":")
    device = rest.removeprefix("//").partition("?")[0]
    findings = [*hindrances(device)] if kind == "serial" and device.startswith("/") else []
    say(f"Let nothing touch the skin for {seconds:g} s.")
    try:
        source = open_source(url)
    except SourceError as error:
        problem = Finding(where="source", problem=f"{error}.", remedy="See docs/boards.md.")
        return Diagnosis(looked=(f"{url} does not open.",), findings=(*findings, problem))
    with source:
        skin = design or source.design
        resting, silence = _taken(source, seconds)
        looked = [_steadiness(url, resting)]
        findings += [silence] if silence is not None else []
        findings += _line(source)
        if len(resting) >= 30:
            findings += examine_readings(resting, skin)
            if moving:
                say(f"Move the robot for {moving:g} s as it moves at work; touch nothing.")
                names = chip_names(source.chips, skin)
                findings += interference(resting, _taken(source, moving)[0], names)
    return Diagnosis(looked=tuple(looked), findings=tuple(findings))


def _taken(source: Source, seconds: float) -> tuple[list[Reading], Finding | None]:
    """Readings of so many seconds, and what ended them early."""
    readings: list[Reading] = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            reading = source.read(timeout=2.0)
        except SmoskinError as error:
            remedy = "See docs/boards.md."
            return readings, Finding(where="source", problem=f"{error}.", remedy=remedy)
        if reading is None:
            break
        readings.append(reading)
    return readings, None


def _steadiness(url: str, readings: list[Reading]) -> str:
    """How many readings came, and how steadily."""
    if len(readings) < 2:
        return f"{url}: {len(readings)} readings"
    steps = np.diff([reading.time for reading in readings])
    usual = float(np.median(steps))
    return (
        f"{url}: {len(readings)} readings of {len(readings[0].field)} chips at "
        f"{1 / max(usual, 1e-9):.0f} Hz, the longest pause {1e3 * steps.max():.0f} ms"
    )


def _line(source: Source) -> list[Finding]:
    """What the counters of a serial line tell."""
    if not isinstance(source, SerialSource):
        return []
    counters = source.counters
    findings = []
    # The frame that was cut by the start counts once.
    for count, what, remedy in (
        (counters.lost, "frames are missing", "Look for a loose plug, a long cable or a hub."),
        (counters.corrupt - 1, "stretches are no frames", "Compare baud, format and chips."),
        (counters.late, "frames came late", "Another program takes the computer's time."),
        (counters.restarts, "restarts of the board", "Its supply breaks down."),
    ):
        if count > 0.001 * max(counters.readings, 1):
            problem = f"{count} {what}, of {counters.readings} readings."
            findings.append(Finding(where="line", problem=problem, remedy=remedy))
    return findings


def _strange(heard: bytes) -> str:
    if not heard:
        return "silent: not a board, or not told to send"
    return f"{len(heard)} bytes of no format that is known"
