"""The tolerance table of a skin: limits for drawings and checks, and the twin's made skins from it.

Decides what a workshop may miss; a part beyond its limit is thrown away, and the twin scatters
normally with a third of the limit.
"""

import math
from dataclasses import dataclass
from typing import Final

from smoskin.design.materials import ELASTOMERS
from smoskin.design.skin import SkinDesign
from smoskin.fabrication.workshop import LASER
from smoskin.magnetics import sector
from smoskin.mechanics.beam import beam
from smoskin.twin.manufacture import Tolerances

CUT: Final = 3.0
"""Limit over standard deviation."""
GAP: Final = 0.3e-3
"""m: limit of a magnet's place as assembled by hand, its gap among it."""
REMANENCE: Final = (0.4, 1.0)
"""T: range of bonded magnets; one is measured over one chip before the rest is built."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """A line of the table."""

    what: str
    limit: float
    unit: str
    """Unit of the limit; `1` for a share."""
    effect: str
    check: str
    field: str = ""
    """Field of `smoskin.twin.manufacture.Tolerances` that it is."""
    spread: float = 0.0
    """Standard deviation, the value of that field."""

    @property
    def text(self) -> str:
        """The limit as people read it."""
        if self.unit == "1":
            return f"± {100 * self.limit:.3g} %"
        shown = {"m": (1e3, "mm"), "rad": (180 / math.pi, "deg"), "T": (1e3, "mT")}
        factor, unit = shown.get(self.unit, (1.0, self.unit))
        return f"± {factor * self.limit:.3g} {unit}"


def _row(
    what: str,
    limit: float,
    unit: str,
    effect: str,
    check: str,
    field: str,
    spread: float | None = None,
) -> Tolerance:
    """A line of a table, its spread a third of the limit unless the field is of another unit."""
    return Tolerance(
        what=what,
        limit=limit,
        unit=unit,
        effect=effect,
        check=check,
        field=field,
        spread=(limit if spread is None else spread) / CUT,
    )


def tolerance_table(design: SkinDesign) -> tuple[Tolerance, ...]:
    """Limits of what is made, with what each does and how it is checked."""
    return (*_cast(design), *_cut(design), *_magnetic(design))


def _cast(design: SkinDesign) -> list[Tolerance]:
    """Limits of columns and rubber."""
    columns = design.columns
    modulus = ELASTOMERS[columns.material].shear_modulus
    usual = beam(columns.radius, columns.height, modulus).lateral
    thick, thin = (
        beam(columns.radius + miss, columns.height, modulus).lateral / usual - 1
        for miss in (LASER, -LASER)
    )
    height = f"lateral stiffness {300 * LASER / columns.height:.1f} %, taken up by the drip"
    radius = f"lateral stiffness {100 * thick:+.0f} / {100 * thin:+.0f} %"
    holes = "calliper on the mould's holes and on ten columns"
    weigh = "note batch and cure; press one column with a known weight"
    rubber = CUT * Tolerances().stiffness_variation
    force = "force, in proportion; calibration takes it up"
    return [
        _row(
            "radius of a column", LASER, "m", radius, holes, "column_stiffness", (thick - thin) / 2
        ),
        _row("height of a column", LASER, "m", height, "calliper on ten columns", "column_height"),
        _row("rubber's modulus", rubber, "1", force, weigh, "stiffness_variation"),
    ]


def _cut(design: SkinDesign) -> list[Tolerance]:
    """Limits of creases and frame."""
    gap, clearance = design.creases.gap, design.frame.clearance
    crease = f"crease stiffness {100 * LASER / gap:.0f} %; panels still do not touch"
    pin = f"pin of {1e3 * (clearance - LASER):.2g} mm goes round every rim column"
    stop = "where a rim column meets its stop"
    feeler = "coupon and feeler gauge"
    return [
        _row("gap of a crease", LASER, "m", crease, feeler, "crease_stiffness", LASER / gap),
        _row("clearance of the frame", LASER, "m", stop, pin, "frame_clearance", LASER / clearance),
    ]


def _magnetic(design: SkinDesign) -> list[Tolerance]:
    """Limits of magnets and chips."""
    place = f"field at rest, {100 * _steepness(design) * GAP:.0f} % along z"
    batch = f"field; from batch to batch it is {REMANENCE[0]:g} to {REMANENCE[1]:g} T"
    over = "each magnet over one chip at the design's gap; choose gap and gain, then a set"
    rest = "reading at rest against the last table; shims"
    tilt, turn = "a share of Bz in Bx and By", math.radians(3.0)
    return [
        _row("place of a magnet", GAP, "m", place, rest, "magnet_place"),
        _row("tilt of a magnet", turn, "rad", tilt, "Bx and By at rest", "magnet_tilt"),
        _row("remanence of a magnet among those chosen", 0.09, "1", batch, over, "remanence"),
        _row("place of a chip", LASER, "m", "as the magnet's", "placer's camera", "chip_place"),
    ]


def made_tolerances(design: SkinDesign) -> Tolerances:
    """The twin's tolerances of skins that keep the table; what it does not name is as usual."""
    return Tolerances(**{row.field: row.spread for row in tolerance_table(design) if row.field})


def _steepness(design: SkinDesign) -> float:
    """Relative change of the first chip's field with its gap, 1/m."""
    site = design.halls[0]
    magnet, step = design.magnet(site.magnet), 1e-5
    away = site.gap + magnet.height / 2
    low, high = sector.field(magnet, [[0.0, 0.0, away - step], [0.0, 0.0, away + step]])[:, 2]
    return abs(float((high - low) / (high + low))) / step
