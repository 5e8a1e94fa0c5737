"""Parts of a skin's boards: their lands, what each pin is for, and which are magnetic.

Decides which packages are used. Lengths on boards are millimetres, as in data sheets and files of
boards; a part's own frame has x to the right and y up, seen from the side it is soldered on.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

Role = Literal["supply", "ground", "bus", "input", "output", "strap", "passive", "contact", "none"]
"""Purpose of a pin: `bus` is open-drain, `strap` sets an address bit, `none` stays unconnected."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pad:
    """A rectangular land, or a plated hole with a round one."""

    number: str
    """Pin that it belongs to; several pads may share one."""
    x: float
    """mm: middle."""
    y: float
    """mm: middle."""
    width: float
    """mm: extent along x."""
    height: float
    """mm: extent along y."""
    hole: float = 0.0
    """mm: diameter of its plated hole; 0 for a land on one face."""
    paste: bool = True
    """Whether solder paste is printed on it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A kind of part in its package."""

    name: str
    """Name of its footprint and symbol."""
    pads: tuple[Pad, ...]
    pins: Mapping[str, tuple[str, Role]]
    """Name and role of every pin, by its number."""
    body: tuple[float, float]
    """mm: extent of the courtyard along x and y, 0.1 mm round lands and body."""
    magnetic: str = ""
    """Magnetic material in it, such as a nickel barrier; empty where there is none."""
    paste_pads: tuple[Pad, ...] = ()
    """Openings of the paste stencil beside those of `pads`."""
    prefix: str = "U"
    """Letter of its references."""
    mark: tuple[tuple[float, float], ...] = ()
    """mm: corners of the printed line beside pin 1."""
    mounted: bool = True
    """Whether it is bought and placed; lands for a tail are copper alone."""


def _row(numbers: range, x: float, y: float, step: tuple[float, float], pad: Pad) -> list[Pad]:
    """Pads of one side of a package, from the first pin's place on."""
    return [
        Pad(
            number=str(number),
            x=x + i * step[0],
            y=y + i * step[1],
            width=pad.width,
            height=pad.height,
            hole=pad.hole,
            paste=pad.paste,
        )
        for i, number in enumerate(numbers)
    ]


_FLAT = Pad(number="", x=0, y=0, width=0.75, height=0.28)
_UPRIGHT = Pad(number="", x=0, y=0, width=0.28, height=0.75)
_OUT: Final = 1.475
"""mm: from the package's middle to the middle of a land of the QFN-16."""

MLX90393_PINS: Final[Mapping[str, tuple[str, Role]]] = MappingProxyType(
    {
        "1": ("INT", "none"),
        "2": ("SENB/CS", "input"),
        "3": ("SCL", "bus"),
        "4": ("NC", "none"),
        "5": ("SDA", "bus"),
        "6": ("MISO", "none"),
        "7": ("INT/TRG", "input"),
        "8": ("VDD_IO", "supply"),
        "9": ("NC", "none"),
        "10": ("NC", "none"),
        "11": ("A1", "strap"),
        "12": ("A0", "strap"),
        "13": ("VSS", "ground"),
        "14": ("NC", "none"),
        "15": ("VDD", "supply"),
        "16": ("NC", "none"),
        "17": ("EP", "ground"),
    }
)
"""Pins of the QFN-16, named as in the Melexis data sheet. Source: two libraries and a board in use,
all by others, which agree (tests/fabrication/boards). MISO and INT are driven by the
chip and not used over I2C. With pin 1 at the upper left and the numbers running counter-clockwise
the chip senses x to the right and y up."""

MLX90393: Final = Part(
    name="MLX90393_QFN-16_3x3mm_P0.5mm",
    pads=(
        *_row(range(1, 5), -_OUT, 0.75, (0.0, -0.5), _FLAT),
        *_row(range(5, 9), -0.75, -_OUT, (0.5, 0.0), _UPRIGHT),
        *_row(range(9, 13), _OUT, -0.75, (0.0, 0.5), _FLAT),
        *_row(range(13, 17), 0.75, _OUT, (-0.5, 0.0), _UPRIGHT),
        Pad(number="17", x=0.0, y=0.0, width=1.7, height=1.7, paste=False),
    ),
    paste_pads=tuple(
        Pad(number="", x=x, y=y, width=0.65, height=0.65) for x in (-0.4, 0.4) for y in (-0.4, 0.4)
    ),
    pins=MLX90393_PINS,
    body=(3.9, 3.9),
    mark=((-2.2, 1.3), (-2.2, 2.2), (-1.6, 2.2)),
)


def _two_lands(name: str, prefix: str, magnetic: str) -> Part:
    """A chip part of 1.6 x 0.8 mm."""
    return Part(
        name=name,
        pads=(
            Pad(number="1", x=-0.75, y=0.0, width=0.8, height=0.95),
            Pad(number="2", x=0.75, y=0.0, width=0.8, height=0.95),
        ),
        pins=MappingProxyType({"1": ("1", "passive"), "2": ("2", "passive")}),
        body=(2.5, 1.15),
        magnetic=magnetic,
        prefix=prefix,
    )


CAPACITOR: Final = _two_lands("C_0603_non-magnetic", "C", "")
"""For use beside a chip: tin over a copper barrier, or silver-palladium."""
PLAIN_CAPACITOR: Final = _two_lands("C_0603", "C", "nickel barrier")
RESISTOR: Final = _two_lands("R_0603", "R", "nickel barrier")

TAIL_PITCH: Final = 1.27
"""mm: between the lands of the tail."""
TAIL_NETS: Final = ("TRIG", "GND", "SDA", "+3V3", "SCL", "GND")
"""Nets of the tail's lands in their order; a supply or ground between any two signals."""
_FIRST_LAND: Final = ((-0.6, -3.95), (0.6, -3.95))
"""mm: printed beside the first land of all boards, so that no tail is soldered upside down."""
TAIL_LANDS: Final = Part(
    name="Tail_lands_6_P1.27mm",
    pads=tuple(
        Pad(number=str(j + 1), x=0.0, y=(j - 2.5) * TAIL_PITCH, width=2.0, height=0.8, paste=False)
        for j in range(len(TAIL_NETS))
    ),
    pins=MappingProxyType(
        {str(j + 1): (net, "contact") for j, net in enumerate(TAIL_NETS)}  # a lap joint
    ),
    body=(2.5, 7.7),
    mark=_FIRST_LAND,
    prefix="J",
    mounted=False,
)
"""Bare lands onto which the flat tail is soldered: no connector, so no steel and no nickel."""

TAIL_END: Final = Part(
    name="Tail_end_6_P1.27mm",
    pads=tuple(
        Pad(number=pad.number, x=0.0, y=pad.y, width=0.9, height=0.9, hole=0.5, paste=False)
        for pad in TAIL_LANDS.pads
    ),
    pins=TAIL_LANDS.pins,
    body=(1.4, 7.6),
    mark=_FIRST_LAND,
    prefix="J",
    mounted=False,
)
"""Plated holes at an end of the tail, through which solder reaches the lands below."""

_PICO_USED: Final[Mapping[str, tuple[str, Role]]] = MappingProxyType(
    {
        "6": ("GP4", "bus"),
        "7": ("GP5", "bus"),
        "9": ("GP6", "output"),
        "36": ("3V3(OUT)", "supply"),
        "38": ("GND", "ground"),
    }
)
PICO: Final = Part(
    name="Raspberry_Pi_Pico",
    pads=(
        *_row(
            range(1, 21),
            -8.89,
            24.13,
            (0.0, -2.54),
            Pad(number="", x=0, y=0, width=1.7, height=1.7, hole=1.02, paste=False),
        ),
        *_row(
            range(21, 41),
            8.89,
            -24.13,
            (0.0, 2.54),
            Pad(number="", x=0, y=0, width=1.7, height=1.7, hole=1.02, paste=False),
        ),
    ),
    pins=MappingProxyType(
        {str(k): _PICO_USED.get(str(k), (f"P{k}", "none")) for k in range(1, 41)}
    ),
    body=(21.5, 52.0),
    magnetic="steel and nickel of its connector and parts",
    prefix="A",
)
"""The microcontroller, an RP2040 module, on two rows of pins; it stands on the base."""
