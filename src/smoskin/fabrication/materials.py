"""The bill of materials: what a skin takes, how much of it, and what it weighs."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Final

from smoskin.design.materials import DENSITY
from smoskin.design.skin import SkinDesign
from smoskin.fabrication.layout import column_places
from smoskin.fabrication.moulds.sheet import scale
from smoskin.fabrication.moulds.solids import Part
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.pattern.sheets import carrier_size, panels
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.outline import board_box, circuit_thickness

_SPARE: Final = 1.3
"""Rubber that is mixed over what is cast: it stays in cups and syringes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """A line of the bill."""

    part: str
    quantity: float
    unit: str
    material: str
    mass_g: float
    """g: all of them, as built into the skin."""
    note: str = ""


def bill(design: SkinDesign, workshop: Workshop, printed: Sequence[Part] = ()) -> list[Item]:
    """What the skin takes with its printed parts, its electronics' small parts aside."""
    sheet = flat_sheet(design, workshop)
    width, height = (1e3 * side for side in carrier_size(sheet, workshop))
    blank = f"{width:.0f} x {height:.0f} mm each"
    plate = design.panels.thickness / 2
    areas = [panels(sheet, workshop, upper=upper).area for upper in (True, False)]
    film_area = _area(sheet.vertices[sheet.rim]) - len(sheet.inner) * math.pi * sheet.hole**2
    sheets = [
        Item(
            part=f"panel sheet, {1e3 * plate:g} mm",
            quantity=2,
            unit="pieces",
            material=design.panels.material,
            mass_g=_grams(sum(areas) * plate, design.panels.material),
            note=blank,
        ),
        Item(
            part=f"film, {1e6 * design.creases.thickness:g} um",
            quantity=1,
            unit="pieces",
            material=design.creases.material,
            mass_g=_grams(film_area * design.creases.thickness, design.creases.material),
            note=blank,
        ),
    ]
    if workshop.bond == "adhesive":
        volume = sum(areas) * workshop.adhesive
        sheets.append(
            Item(
                part=f"double-sided adhesive, {1e3 * workshop.adhesive:g} mm",
                quantity=2,
                unit="pieces",
                material="acrylate transfer tape",
                mass_g=_grams(volume, "adhesive"),
                note=blank,
            )
        )
    return [
        *sheets,
        *_rubber(design, workshop),
        *_magnets(design),
        *_electronics(design),
        *_printed(printed),
    ]


def bill_csv(items: list[Item]) -> bytes:
    """The bill as a table with a head, its masses summed in the last line."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    table.writerow([part.name for part in fields(Item)])
    for item in items:
        values = asdict(item) | {"quantity": f"{item.quantity:g}", "mass_g": f"{item.mass_g:.3f}"}
        table.writerow(values.values())
    total = sum(item.mass_g for item in items)
    table.writerow(["total", "", "", "", f"{total:.3f}", "as built into the skin"])
    return stream.getvalue().encode()


def _rubber(design: SkinDesign, workshop: Workshop) -> list[Item]:
    """Columns, pillars and scales."""
    columns, layer = design.columns, design.shear_layer
    count = len(column_places(design))
    volumes = {
        ("support column", count, columns.material): count
        * math.pi
        * columns.radius**2
        * columns.height,
        ("pillar of the shear layer", layer.pillars, layer.material): layer.pillars
        * math.pi
        * layer.radius**2
        * layer.height,
    }
    if workshop.top == "scales":
        count = design.cells[0] * design.cells[1]
        rows = [float(scale(design, workshop, row).volume()) for row in range(design.cells[0])]
        volumes["top scale", count, columns.material] = design.cells[1] * sum(rows)
    items = [
        Item(
            part=part,
            quantity=number,
            unit="pieces",
            material=material,
            mass_g=_grams(volume, "rubber"),
            note=f"mix {_SPARE * _grams(volume, 'rubber'):.0f} g",
        )
        for (part, number, material), volume in volumes.items()
    ]
    dripped = math.pi * columns.radius**2 * workshop.drip
    items[0] = Item(
        **asdict(items[0])
        | {
            "note": f"{items[0].note}; the uppermost {1e3 * workshop.drip:g} mm dripped, "
            f"{1e9 * dripped:.0f} mm3 a column"
        }
    )
    return items


def _printed(parts: Sequence[Part]) -> list[Item]:
    """Printed parts that stay in the skin."""
    return [
        Item(
            part=part.name,
            quantity=part.quantity,
            unit="pieces",
            material=f"{' or '.join(part.made_of[:3])}, printed solid",
            mass_g=_grams(part.quantity * float(part.solid.volume()), "print"),
            note=part.title,
        )
        for part in parts
    ]


def _magnets(design: SkinDesign) -> list[Item]:
    """Sectors of each size of magnet."""
    sizes: dict[tuple[float, float], list[str]] = {}
    for magnet in design.magnets:
        sizes.setdefault((magnet.radius, magnet.height), []).append(magnet.name)
    return [
        Item(
            part=f"magnet sector, radius {1e3 * radius:g} mm, {1e3 * height:g} mm high",
            quantity=4 * len(names),
            unit="pieces",
            material="bonded NdFeB",
            mass_g=_grams(len(names) * math.pi * radius**2 * height, "magnet"),
            note=f"four each of {', '.join(names)}; magnetised along the bisector",
        )
        for (radius, height), names in sizes.items()
    ] + [
        Item(
            part="shim disc, 0.1 and 0.2 mm",
            quantity=3 * len(design.magnets),
            unit="pieces",
            material="polyimide or brass",
            mass_g=0.0,
            note="under a magnet or its holder, as the first readings ask for",
        )
    ]


def _electronics(design: SkinDesign) -> list[Item]:
    """Board and chips."""
    size, thick = board_box(design).size, circuit_thickness(design)
    rigid = design.limb is None
    volume = size[0] * size[1] * thick
    return [
        Item(
            part="circuit board" if rigid else "flexible circuit",
            quantity=1,
            unit="pieces",
            material="FR-4" if rigid else "polyimide with copper",
            mass_g=_grams(volume, "board"),
            note=f"{1e3 * size[0]:.1f} x {1e3 * size[1]:.1f} mm, {1e3 * thick:g} mm",
        ),
        Item(
            part="MLX90393SLW-ABA-011, QFN-16",
            quantity=len(design.halls),
            unit="pieces",
            material="chip",
            mass_g=0.03 * len(design.halls),
            note="addresses "
            + ", ".join(f"{site.name} {site.address:#04x}" for site in design.halls),
        ),
    ]


def _grams(volume: float, material: str) -> float:
    """Mass of a volume, g."""
    return 1e3 * DENSITY[material] * volume


def _area(corners: object) -> float:
    """Area of a polygon, m2."""
    from shapely import Polygon

    return float(Polygon(corners).area)
