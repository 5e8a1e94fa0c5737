"""Circuits of a skin: which pin is on which net, and the rules that a working one keeps.

Decides addresses, decoupling, pull-ups and what runs through the tail. `faults` is the check of
the electrical rules.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from smoskin.design.skin import HallSite, SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.boards import parts
from smoskin.fabrication.boards.parts import Part

SUPPLY: Final = "+3V3"
GROUND: Final = "GND"
_ORDER_CODES: Final = {
    0x0C: "MLX90393SLW-ABA-011-RE",
    0x10: "MLX90393SLW-ABA-012-RE",
    0x14: "MLX90393SLW-ABA-013-RE",
    0x18: "MLX90393SLW-ABA-014-RE",
}
"""Order code by the lowest of its four addresses."""
_PULL_UP: Final = (1e3, 1e4)
"""Least and most pull-up of the bus, ohm: 3 mA that a chip can sink, and 300 ns into 30 pF."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """A part of a circuit with its pins' nets."""

    reference: str
    """Name on the board."""
    part: Part
    value: str
    """Value or order code, as the bill of materials names it."""
    nets: Mapping[str, str]
    """Net of each connected pin, by the pin's number."""
    address: int = 0
    """Address at which the firmware expects a chip; 0 for other parts."""
    serves: str = ""
    """Reference of the chip beside which it has to stand."""
    ohm: float = 0.0
    """Resistance, ohm; 0 for other parts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Circuit:
    """A board's parts and nets."""

    name: str
    floating: bool
    """Whether its board moves with the skin."""
    components: tuple[Component, ...]

    def pins(self) -> Iterator[tuple[Component, str, str]]:
        """Every connected pin: its component, number and net."""
        for component in self.components:
            for number, net in component.nets.items():
                yield component, number, net

    @property
    def nets(self) -> tuple[str, ...]:
        """Names of the nets, sorted."""
        return tuple(sorted({net for _, _, net in self.pins()}))


def skin_circuit(design: SkinDesign) -> Circuit:
    """Circuit of the floating board: the design's chips on one bus, and the tail's lands.

    Raises
    ------
    DesignError
        If no order code of the chip answers at an address.
    """
    components: list[Component] = []
    for k, site in enumerate(design.halls):
        components += _chip(k, site)
    many = len(design.halls)
    for k, (net, other, ohm) in enumerate(
        [("SCL", SUPPLY, 4700.0), ("SDA", SUPPLY, 4700.0), ("TRIG", GROUND, 100e3)]
    ):
        components.append(
            Component(
                reference=f"R{k + 1}",
                part=parts.RESISTOR,
                value=f"{ohm / 1e3:g} kohm",
                nets={"1": net, "2": other},
                ohm=ohm,
            )
        )
    components.append(
        Component(
            reference=f"C{2 * many + 1}",
            part=parts.PLAIN_CAPACITOR,
            value="1 uF X7R 10 V",
            nets={"1": SUPPLY, "2": GROUND},
        )
    )
    components.append(_lands("J1"))
    return Circuit(name="skin", floating=True, components=tuple(components))


def tail_circuit() -> Circuit:
    """Circuit of the tail: each line joins a land at the skin to one at the base."""
    ends = tuple(_lands(reference, parts.TAIL_END) for reference in ("J1", "J2"))
    return Circuit(name="tail", floating=True, components=ends)


def base_circuit() -> Circuit:
    """Circuit of the base's board: the microcontroller on the pins that the firmware names."""
    nets = {"6": "SDA", "7": "SCL", "9": "TRIG", "36": SUPPLY, "38": GROUND}
    pico = Component(reference="A1", part=parts.PICO, value="Raspberry Pi Pico (RP2040)", nets=nets)
    return Circuit(name="base", floating=False, components=(pico, _lands("J2")))


def _lands(reference: str, part: Part = parts.TAIL_LANDS) -> Component:
    nets = {str(j + 1): net for j, net in enumerate(parts.TAIL_NETS)}
    return Component(reference=reference, part=part, value="solder lands", nets=nets)


def _chip(k: int, site: HallSite) -> list[Component]:
    """A chip at its address and the two capacitors of its supply pins."""
    base = site.address & ~0b11
    if base not in _ORDER_CODES:
        raise DesignError(
            f"hall site {site.name!r}.address must lie in 0xc..0x1b, where the MLX90393 answers; "
            f"got {site.address:#x}"
        )
    low, high = (SUPPLY if site.address & bit else GROUND for bit in (1, 2))
    nets = {
        "2": SUPPLY,
        "3": "SCL",
        "5": "SDA",
        "7": "TRIG",
        "8": SUPPLY,
        "11": high,
        "12": low,
        "13": GROUND,
        "15": SUPPLY,
        "17": GROUND,
    }
    reference = f"U{k + 1}"
    chip = Component(
        reference=reference,
        part=parts.MLX90393,
        value=_ORDER_CODES[base],
        nets=nets,
        address=site.address,
    )
    capacitors = [
        Component(
            reference=f"C{2 * k + j}",
            part=parts.CAPACITOR,
            serves=reference,
            value="100 nF X7R 16 V, non-magnetic termination",
            nets={"1": SUPPLY, "2": GROUND},
        )
        for j in (1, 2)
    ]
    return [chip, *capacitors]


def faults(circuit: Circuit) -> tuple[str, ...]:
    """Broken electrical rules of a circuit, each in a sentence; none for one that works."""
    broken = [*_pin_faults(circuit), *_net_faults(circuit)]
    chips = [c for c in circuit.components if c.part is parts.MLX90393]
    for chip in chips:
        broken += _address_faults(chip)
        mine = [c for c in circuit.components if c.serves == chip.reference]
        steady = sum(set(c.nets.values()) == {SUPPLY, GROUND} for c in mine)
        needed = sum(role == "supply" for _, role in chip.part.pins.values())
        if steady < needed:
            broken.append(
                f"{chip.reference} needs {needed} capacitors from {SUPPLY} to {GROUND} beside it; "
                f"got {steady}"
            )
    answers = Counter(address for chip in chips if (address := _strapped(chip)) is not None)
    for address, many in sorted(answers.items()):
        if many > 1:
            broken.append(f"{many} chips answer at the address {address:#x}; it must be one")
    if circuit.floating and any(c.part is parts.PICO for c in circuit.components):
        broken.append("the microcontroller must stand on the base, not on the floating board")
    return tuple(broken)


def _pin_faults(circuit: Circuit) -> Iterator[str]:
    """Pins on the wrong net or on none."""
    wanted = {"supply": SUPPLY, "ground": GROUND}
    for component in circuit.components:
        for number, (name, role) in component.part.pins.items():
            net = component.nets.get(number)
            pin = f"{component.reference} pin {number} ({name})"
            if role in wanted and net != wanted[role]:
                yield f"{pin} must be on {wanted[role]}; got {net or 'nothing'}"
            elif role == "none" and net is not None:
                yield f"{pin} must stay unconnected; got {net}"
            elif role not in ("none", *wanted) and net is None:
                yield f"{pin} floats; it needs a net"
            elif name == "SENB/CS" and net != SUPPLY:
                yield f"{pin} must be on {SUPPLY} for I2C; got {net}"
        for number in set(component.nets) - set(component.part.pins):
            yield f"{component.reference} has no pin {number}"


def _net_faults(circuit: Circuit) -> Iterator[str]:
    """Nets that end nowhere, drive each other or lack their pull-up."""
    whole = any(c.part is parts.MLX90393 for c in circuit.components)
    for net in circuit.nets:
        pins = [(c, number) for c, number, other in circuit.pins() if other == net]
        roles = Counter(c.part.pins.get(number, ("", "none"))[1] for c, number in pins)
        if len(pins) < 2:
            component, number = pins[0]
            yield f"{net} ends at {component.reference} pin {number} alone"
        if roles["output"] > 1:
            yield f"{net} is driven by {roles['output']} outputs; it must be one"
        if whole and roles["bus"]:
            pulls = [c.ohm for c, _ in pins if c.ohm and set(c.nets.values()) == {net, SUPPLY}]
            if len(pulls) != 1 or not _PULL_UP[0] <= pulls[0] <= _PULL_UP[1]:
                got = ", ".join(f"{pull:g} ohm" for pull in pulls) or "none"
                yield f"{net} needs one pull-up of 1 to 10 kohm to {SUPPLY}; got {got}"


def _strapped(chip: Component) -> int | None:
    """Address at which a chip answers; None where a strap hangs in the air."""
    levels = [chip.nets.get(number) for number in ("11", "12")]
    bases = [base for base, code in _ORDER_CODES.items() if code == chip.value]
    if not bases or any(level not in (SUPPLY, GROUND) for level in levels):
        return None
    return bases[0] | (levels[0] == SUPPLY) << 1 | (levels[1] == SUPPLY)


def _address_faults(chip: Component) -> Iterator[str]:
    """Straps that give another address than the firmware's."""
    answer = _strapped(chip)
    if answer is None:
        yield f"{chip.reference} needs A1 and A0 on {SUPPLY} or {GROUND} and a known order code"
    elif answer != chip.address:
        yield f"{chip.reference} answers at {answer:#x}; it must be {chip.address:#x}"
