"""Circuits of boards: the chip's pins against other people's, addresses, and seeded faults."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from fabrication.boards.designs import CURVED, PLANAR, arranged, random_design
from smoskin.errors import DesignError
from smoskin.fabrication.boards import parts
from smoskin.fabrication.boards.circuit import (
    Circuit,
    Component,
    base_circuit,
    faults,
    skin_circuit,
    tail_circuit,
)

HEXAMOUSE = (
    "INT SENB/CS SCL/SCLK N/C SDA/MOSI MISO INT/TRIG VDD_IO N/C N/C A1 A0 VSS N/C VDD N/C EP"
)
"""hhhug000/HexaMouse at 4e84417, symbol of the MLX90393SLW-ABA-011-RE, pins 1 to 17."""
SAMACSYS = (
    "INT SENB/CS SCL/SCLK N/C SDA/MOSI MISO INT/TRIG VDD_IO N/C N/C A1 A0 VSS N/C VDD N/C GND"
)
"""SamacSys ECAD model of the same part, PADS library of 2024-04-24, pins 1 to 17."""
SENSOR_HEAD = "INT SENB/CS SCL/SCLK NC SDA/MOSI MISO INT/TRIG VDD_IO NC NC A1 A0 VSS NC VDD NC EP"
"""mlx90393_head of LoaDy588/cube_electronics at 3c8ce3f, later emlab-fi's, pins 1 to 17."""
ADAFRUIT = {
    "2": "SENB",
    "3": "SCL",
    "5": "SDA",
    "6": "MISO",
    "8": "3.3V",
    "11": "A1",
    "12": "A0",
    "13": "GND",
    "15": "3.3V",
}
"""adafruit/Adafruit-MLX90393-PCB at 1c5dead: nets of the chip's pads on its board."""
SAME = {"SCL/SCLK": "SCL", "SDA/MOSI": "SDA", "INT/TRIG": "INT/TRG", "N/C": "NC"}


@pytest.mark.parametrize("library", [HEXAMOUSE, SAMACSYS, SENSOR_HEAD])
def test_the_pins_are_those_of_other_libraries(library: str) -> None:
    theirs = [SAME.get(name, name) for name in library.split()]
    ours = [parts.MLX90393_PINS[str(k)][0] for k in range(1, 18)]
    assert [n for n in ours if n != "EP"] == [n for n in theirs if n not in ("EP", "GND")]
    assert parts.MLX90393_PINS["17"][1] == "ground"


def test_the_pins_are_wired_as_on_a_board_that_works() -> None:
    chip = skin_circuit(PLANAR).components[0]
    supplies = {"3.3V": "+3V3", "GND": "GND"}
    for pin, net in ADAFRUIT.items():
        if net in supplies:
            assert chip.nets[pin] == supplies[net]
        elif net in ("SCL", "SDA"):
            assert chip.nets[pin] == net
        elif net in ("A0", "A1"):
            assert parts.MLX90393_PINS[pin] == (net, "strap")
    assert chip.nets["2"] == "+3V3"
    assert "6" not in chip.nets


def test_the_lands_run_counter_clockwise_from_the_upper_left() -> None:
    pads = {pad.number: pad for pad in parts.MLX90393.pads}
    assert len(pads) == 17
    assert all(pads[str(k)].x < -1 for k in range(1, 5))
    assert all(pads[str(k)].y < -1 for k in range(5, 9))
    assert all(pads[str(k)].x > 1 for k in range(9, 13))
    assert all(pads[str(k)].y > 1 for k in range(13, 17))
    assert pads["1"].y == pads["12"].y == 0.75
    assert pads["5"].x == pads["16"].x == -0.75
    # The land pattern of easyeda2kicad's VQFN-16: rows 3.0 mm apart, 0.5 mm pitch.
    assert 2 * pads["9"].x == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize("design", [PLANAR, CURVED, *map(random_design, range(4))])
def test_every_circuit_keeps_the_rules(design: object) -> None:
    assert faults(skin_circuit(design)) == ()  # type: ignore[arg-type]
    assert faults(tail_circuit()) == ()
    assert faults(base_circuit()) == ()


def test_addresses_choose_order_codes_and_straps() -> None:
    design = arranged([(4, 4), (4, 2), (2, 4)], [0, 0, 0], addresses=(0x0C, 0x13, 0x1A))
    circuit = skin_circuit(design)
    chips = [c for c in circuit.components if c.part is parts.MLX90393]
    assert [chip.value[-6:-3] for chip in chips] == ["011", "012", "014"]
    assert [(chip.nets["11"], chip.nets["12"]) for chip in chips] == [
        ("GND", "GND"),
        ("+3V3", "+3V3"),
        ("+3V3", "GND"),
    ]
    assert faults(circuit) == ()


def test_an_address_that_no_chip_has_is_refused() -> None:
    design = arranged([(4, 4), (4, 2), (2, 4)], [0, 0, 0], addresses=(0x0C, 0x30, 0x0E))
    with pytest.raises(DesignError, match=r"'S2'\.address must lie in 0xc\.\.0x1b.* got 0x30"):
        skin_circuit(design)


def changed(reference: str, **nets: str | None) -> Callable[[Circuit], Circuit]:
    """A seeded fault: pins of a component, as p1, p2, on other nets, or on none."""

    def change(component: Component) -> Component:
        if component.reference != reference:
            return component
        new = dict(component.nets)
        for pin, net in nets.items():
            new.pop(pin[1:], None)
            if net is not None:
                new[pin[1:]] = net
        return replace(component, nets=new)

    return lambda c: replace(c, components=tuple(map(change, c.components)))


def without(*references: str) -> Callable[[Circuit], Circuit]:
    return lambda c: replace(
        c, components=tuple(x for x in c.components if x.reference not in references)
    )


SEEDED = {
    "swapped supply": (changed("U2", p13="+3V3", p15="GND"), "U2 pin 15 (VDD) must be on +3V3"),
    "no ground": (changed("U1", p13=None), "U1 pin 13 (VSS) must be on GND; got nothing"),
    "no I/O supply": (changed("U1", p8=None), "U1 pin 8 (VDD_IO) must be on +3V3"),
    "same address twice": (changed("U2", p12="GND"), "2 chips answer at the address 0xc"),
    "other address": (changed("U1", p11="+3V3", p12="+3V3"), "U1 answers at 0xf; it must be 0xc"),
    "floating strap": (changed("U3", p11=None), "U3 pin 11 (A1) floats"),
    "missing decoupling": (without("C3"), "U2 needs 2 capacitors"),
    "capacitor across the bus": (changed("C4", p2="SDA"), "U2 needs 2 capacitors"),
    "SPI chosen": (changed("U1", p2="GND"), "U1 pin 2 (SENB/CS) must be on +3V3 for I2C"),
    "no pull-up": (without("R2"), "SDA needs one pull-up"),
    "floating trigger": (changed("U2", p7=None), "U2 pin 7 (INT/TRG) floats"),
    "wired interrupt": (changed("U2", p1="TRIG"), "U2 pin 1 (INT) must stay unconnected"),
    "lonely net": (changed("J1", p5="SCL2"), "SCL2 ends at J1 pin 5 alone"),
    "unknown pin": (changed("R1", p3="GND"), "R1 has no pin 3"),
}


@pytest.mark.parametrize("name", SEEDED)
def test_seeded_faults_are_found(name: str) -> None:
    change, complaint = SEEDED[name]
    assert any(fault.startswith(complaint) for fault in faults(change(skin_circuit(PLANAR))))


def test_a_second_pull_up_and_a_weak_one_are_found() -> None:
    circuit = skin_circuit(PLANAR)
    first = next(c for c in circuit.components if c.reference == "R1")
    double = replace(circuit, components=(*circuit.components, replace(first, reference="R9")))
    assert any("got 4700 ohm, 4700 ohm" in fault for fault in faults(double))
    weak = tuple(replace(c, ohm=1e5) if c is first else c for c in circuit.components)
    assert any("got 100000 ohm" in fault for fault in faults(replace(circuit, components=weak)))


def test_a_microcontroller_on_the_floating_board_is_found() -> None:
    circuit = skin_circuit(PLANAR)
    pico = base_circuit().components[0]
    assert any(
        "must stand on the base" in fault
        for fault in faults(replace(circuit, components=(*circuit.components, pico)))
    )


def test_the_firmware_and_the_base_agree_on_pins() -> None:

    config = Path(__file__).parents[3] / "firmware" / "config.py"
    values: dict[str, object] = {}
    exec(config.read_text(encoding="utf-8"), values)
    pico = base_circuit().components[0]
    at = {parts.PICO.pins[pin][0]: net for pin, net in pico.nets.items()}
    assert at[f"GP{values['SDA']}"] == "SDA"
    assert at[f"GP{values['SCL']}"] == "SCL"
