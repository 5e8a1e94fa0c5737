"""What a workshop can do: its cutter, printer, adhesive and stock, and what it must not do.

Decides the clearances that all drawings and moulds share, and refuses processes that ruin a skin
or endanger who makes it.
"""

import os
from dataclasses import dataclass, fields
from typing import Final, Literal

from smoskin.arguments import typed
from smoskin.arrays import assign
from smoskin.design.skin import SkinDesign
from smoskin.documents import Form
from smoskin.errors import DesignError
from smoskin.origami.outline import SCALE_PAD
from smoskin.outputs import read_text

LASER: Final = 0.1e-3
"""m: limit of what laser-cut and moulded lengths may miss."""
PRESS_TEMPERATURE: Final = 320.0
"""degC: hot press of the SI's heat-proof sheets."""
MAGNET_TEMPERATURE: Final = 110.0
"""degC: oven in which magnets cure for an hour."""
_MELTS: Final = ("acrylic",)
"""Panels that decompose below the hot press's temperature."""
_LARGEST: Final = 2**16
"""Largest document that is read, bytes."""
_LIMITS: Final = {
    "kerf": (0.0, 1e-3),
    "adhesive": (0.0, 1e-3),
    "crease_clearance": (0.0, 1e-3),
    "bridge": (0.2e-3, 5e-3),
    "slot": (0.5e-3, 10e-3),
    "border": (5e-3, 50e-3),
    "pin": (1e-3, 10e-3),
    "corner_skip": (0.0, 10e-3),
    "perforation_pitch": (0.2e-3, 10e-3),
    "wall": (0.2e-3, 5e-3),
    "fit": (0.02e-3, 1e-3),
    "drip": (0.1e-3, 3e-3),
    "scale_pad": (0.2e-3, 5e-3),
}
"""Least and most of each length, m."""


@typed
@dataclass(frozen=True, slots=True, kw_only=True)
class Workshop:
    """Numbers of a workshop; each default is usual, none is printed in the paper.

    It raises a `DesignError` for numbers that no workshop has.
    """

    kerf: float = 0.15e-3
    """m: width of the laser's cut; measure it on the coupon."""
    adhesive: float = 0.05e-3
    """m: thickness of one layer of double-sided adhesive; none in the hot press."""
    crease_clearance: float = 0.1e-3
    """m: what the concave gap is wider than panels that just touch."""
    bond: Literal["adhesive", "hot press"] = "adhesive"
    """How panels are bonded to the film."""
    bend: Literal["even", "sharp"] = "even"
    """How the free film bends: evenly across its gap, as the mechanics take it, or in one line."""
    top: Literal["scales", "covers"] = "scales"
    """Scales on the top vertices, or the guided cover panels of SI Figure S16."""
    bridge: float = 1.0e-3
    """m: width of the bridges that hold panels in their carrier until they are bonded."""
    slot: float = 2.0e-3
    """m: width of the slot between the sheet's rim and its carrier."""
    border: float = 15e-3
    """m: width of the carrier round that slot."""
    pin: float = 3e-3
    """m: diameter of the registration pins."""
    perforation: float = 0.0
    """Share of a crease's length that is cut; the mechanics count a film without."""
    perforation_pitch: float = 2e-3
    """m: from one perforation to the next."""
    corner_skip: float = 2e-3
    """m: film left whole next to a vertex's hole."""
    stock: tuple[float, float] = (1.0, 0.6)
    """m: size of a sheet of stock."""
    wall: float = 0.8e-3
    """m: thinnest wall that the printer makes soundly."""
    fit: float = 0.15e-3
    """m: clearance on every side between parts that go into each other."""
    bed: tuple[float, float, float] = (0.25, 0.21, 0.20)
    """m: largest part that the printer makes."""
    drip: float = 0.8e-3
    """m: rubber dripped between a column and its vertex."""
    scale_pad: float = SCALE_PAD
    """m: thickness of a top scale."""

    def __post_init__(self) -> None:
        if self.bond == "hot press":
            assign(self, adhesive=0.0)
        for name, (least, most) in _LIMITS.items():
            if not least <= getattr(self, name) <= most:
                raise DesignError(
                    f"workshop.{name} must be from {1e3 * least:g} to {1e3 * most:g} mm; got "
                    f"{1e3 * getattr(self, name):g} mm"
                )
        if not 0.0 <= self.perforation <= 0.9:
            raise DesignError(
                f"workshop.perforation must lie in [0, 0.9]; got {self.perforation:g}"
            )
        for name in ("stock", "bed"):
            if not 0.05 <= min(getattr(self, name)) <= max(getattr(self, name)) <= 5.0:
                got = " x ".join(f"{1e3 * side:g}" for side in getattr(self, name))
                raise DesignError(f"workshop.{name} must be from 50 to 5000 mm a side; got {got}")

    def plate(self, design: SkinDesign) -> float:
        """Thickness on one face of the film, from its middle to the panel's outer face, m."""
        return design.creases.thickness / 2 + self.adhesive + design.panels.thickness / 2


_LENGTHS: Final = tuple(
    part.name
    for part in fields(Workshop)
    if part.name not in ("bond", "bend", "top", "perforation")
)
_FORM: Final = Form(units=dict.fromkeys(_LENGTHS, "mm"), error=DesignError)


def read_workshop(path: str | os.PathLike[str]) -> Workshop:
    """A workshop from a TOML document of the fields that differ, lengths as ``kerf_mm = 0.2``.

    Raises
    ------
    DesignError
        If the document is no such table, or has numbers that no workshop has.
    """
    try:
        return _FORM.record(Workshop, _FORM.parse_toml(read_text(path, _LARGEST, DesignError)))
    except DesignError as error:
        raise DesignError(f"{os.fspath(path)}: {error}") from error


def check_process(design: SkinDesign, workshop: Workshop) -> None:
    """Refuse what must not be done with a design's materials.

    Raises
    ------
    DesignError
        If panels would decompose in the hot press, or nothing would hold the rim's columns.
    """
    if design.columns.rim_share != 1.0:
        raise DesignError(
            "columns.rim_share must be 1: no part that is made holds the feet of the rim's "
            f"columns; got {design.columns.rim_share:g}"
        )
    if workshop.bond == "hot press" and design.panels.material in _MELTS:
        raise DesignError(
            f"panels.material must stand the hot press at {PRESS_TEMPERATURE:.0f} degC, as "
            f"polyimide does; got {design.panels.material}, which decomposes from 220 degC to "
            "flammable vapour"
        )
