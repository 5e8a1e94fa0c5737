"""The doctor on boards that are well, ill, silent, or another's."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from boards import Line, Readings, sending
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, SourceError
from smoskin.hardware.health import Finding
from smoskin.records import Reading
from smoskin.service import doctor
from smoskin.service.doctor import examine_source, look_around
from smoskin.service.source import TwinSource
from smoskin.twin.reduced import ReducedTwin

pytest.importorskip("serial")


def test_a_sound_board_is_called_so(planar: SkinDesign) -> None:
    with sending(TwinSource(ReducedTwin(planar), rate=400.0)) as port:
        diagnosis = examine_source(f"serial://{port}", seconds=0.5)
    faults = [f for f in diagnosis.findings if f.where not in ("line", f"port {port}")]
    assert faults == []
    assert re.search(r"\d+ readings of 3 chips at \d+ Hz, the longest", diagnosis.looked[0])


def test_a_board_of_another_format_is_told_its_format(planar: SkinDesign) -> None:
    with sending(TwinSource(ReducedTwin(planar), rate=400.0), "anyskin") as port:
        diagnosis = examine_source(f"serial://{port}", seconds=0.5)
    sentences = [str(f) for f in diagnosis.findings if f.where == "source"]
    assert "use format=anyskin&chips=3" in sentences[0]


def test_a_chip_that_is_missing_is_named(planar: SkinDesign) -> None:
    twin = ReducedTwin(planar)
    rest = twin.motion()

    class Spoilt(TwinSource):  # type: ignore[misc]
        def read(self, timeout: float = 1.0) -> Reading | None:
            reading = super().read(timeout)
            if reading is None:
                return None
            sound = twin.sense(rest)
            return Reading(
                time=reading.time, field=sound.field, temperature=sound.temperature, flags=[0, 1, 0]
            )

    with sending(Spoilt(twin, rate=400.0)) as port:
        diagnosis = examine_source(f"serial://{port}", seconds=0.5)
    sentences = [str(f) for f in diagnosis.findings if f.where.startswith("chip")]
    assert sentences == [
        "chip S2: It does not answer, every time. Look at its supply, its wires and "
        "pull-ups, and the order code, which gives the address."
    ]


def test_a_silent_port_and_one_that_is_not_there_are_findings(planar: SkinDesign) -> None:
    with Line() as line:
        diagnosis = examine_source(f"serial://{line.port}", seconds=1.0)
    assert any("is open and silent" in str(finding) for finding in diagnosis.findings)
    diagnosis = examine_source("serial:///dev/ttyNone7", seconds=1.0)
    text = " ".join(map(str, diagnosis.findings))
    assert "by a cable that carries data" in text
    assert "cannot be opened" in text
    with pytest.raises(ArgumentError, match="url must be"):
        examine_source("morse:7")


def test_a_robot_may_move_meanwhile(planar: SkinDesign) -> None:
    messages: list[str] = []
    diagnosis = examine_source(
        "twin://planar?mechanics=reduced&creep=no&rate=400",
        seconds=0.5,
        moving=0.5,
        say=messages.append,
    )
    assert diagnosis.findings == ()
    assert str(diagnosis).endswith("Nothing is wrong.")
    assert messages[1].startswith("Move the robot for 0.5 s")


def test_what_there_is_is_listed_with_what_reads_it(
    planar: SkinDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    twin = ReducedTwin(planar)
    with sending(TwinSource(twin, rate=400.0), "anyskin") as port, Line() as silent:
        ports = [
            SimpleNamespace(device=port, product="QT Py", url=f"serial://{port}"),
            SimpleNamespace(device=silent.port, product="", url=f"serial://{silent.port}"),
        ]
        monkeypatch.setattr(doctor, "serial_ports", lambda: ports)
        monkeypatch.setattr(doctor, "hindrances", lambda device: ())
        monkeypatch.setattr(doctor, "buses", lambda: ("/dev/i2c-1",))
        diagnosis = look_around(seconds=0.5)
    assert diagnosis.looked == (
        f"{port}: QT Py; smoskin run 'serial://{port}?format=anyskin&chips=3'",
        f"{silent.port}: a port; silent: not a board, or not told to send",
        "/dev/i2c-1: smoskin run i2c:///dev/i2c-1",
    )
    monkeypatch.setattr(doctor, "serial_ports", list)
    monkeypatch.setattr(doctor, "buses", lambda: ())
    assert "smoskin board --virtual planar" in str(look_around())
    assert look_around().as_json()["findings"][0]["where"] == "this computer"
    assert np.isfinite(twin.read().field).all()
    assert Readings(planar, []).read() is None


def test_a_port_that_cannot_be_read_is_listed_and_the_others_are_looked_at(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def heard(device: str, seconds: float) -> bytes:
        assert seconds == 1.0
        if device == "/dev/a":
            raise SourceError("it is taken")
        return b"xyz"

    ports = [
        SimpleNamespace(device=f"/dev/{name}", product=product, url=f"serial:///dev/{name}")
        for name, product in (("a", ""), ("b", "QT Py"))
    ]
    hindrance = Finding(where="/dev/a", problem="You may not read it.", remedy="Ask.")
    monkeypatch.setattr(doctor, "serial_ports", lambda: ports)
    monkeypatch.setattr(
        doctor, "hindrances", lambda device: (hindrance,) if device == "/dev/a" else ()
    )
    monkeypatch.setattr(doctor, "heard_on", heard)
    monkeypatch.setattr(doctor, "recognised", lambda heard: ())
    monkeypatch.setattr(doctor, "buses", lambda: ())
    diagnosis = look_around()
    assert diagnosis.looked == (
        "/dev/a: a port; it is taken",
        "/dev/b: QT Py; 3 bytes of no format that is known",
    )
    assert diagnosis.findings == (hindrance,)
