"""Lists of a board's parts: the bill of materials, and where a machine places them."""

import csv
import io
from collections.abc import Iterable

import numpy as np

from smoskin.fabrication.boards import parts
from smoskin.fabrication.boards.check import MAGNETIC_DISTANCE
from smoskin.fabrication.boards.layout import Layout
from smoskin.fabrication.boards.rules import house_of


def _table(rows: Iterable[Iterable[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def bill_of_materials(layouts: Iterable[Layout]) -> str:
    """Parts and boards to buy as CSV text, with what may stand beside a chip."""
    rows: list[tuple[object, ...]] = [
        ("board", "references", "quantity", "value", "package", "magnetic", "remark")
    ]
    for layout in layouts:
        house = house_of(layout)
        extent = np.sort(np.ptp(layout.outline, axis=0))
        remark = house.source
        if np.any(extent > house.largest):
            remark += f"; larger than the house's {house.largest[0]:g} x {house.largest[1]:g} mm"
        value = f"board {extent[0]:.1f} x {extent[1]:.1f} x {layout.thickness:g} mm"
        rows.append((layout.name, "", 1, value, house.name, "no", remark))
        groups: dict[tuple[str, str], list[str]] = {}
        kinds = {}
        for component in (placed.component for placed in layout.placed):
            if component.part.mounted:
                key = component.value, component.part.name
                groups.setdefault(key, []).append(component.reference)
                kinds[key] = component.part
        for (value, package), references in groups.items():
            part = kinds[value, package]
            rows.append(
                (
                    layout.name,
                    " ".join(references),
                    len(references),
                    value,
                    package,
                    part.magnetic or "no",
                    _remark(part),
                )
            )
        if layout.holes:
            rows.append((layout.name, "", len(layout.holes), "screw M2", "nylon", "no", "no steel"))
        if layout.stiffeners:
            many = len(layout.stiffeners)
            rows.append((layout.name, "", many, "stiffener 0.2 mm", "FR-4", "no", "no steel"))
    return _table(rows)


def _remark(part: parts.Part) -> str:
    if part is parts.CAPACITOR:
        return "termination of tin over copper, or of silver-palladium: a nickel barrier disturbs"
    if part is parts.PICO:
        return "on the base, not on the floating board"
    if part.magnetic:
        return f"at least {MAGNETIC_DISTANCE:g} mm from every chip"
    return ""


def placements(layout: Layout) -> str:
    """Places of the mounted parts as CSV text, mm and degrees counter-clockwise from above."""
    rows: list[tuple[object, ...]] = [("Ref", "Val", "Package", "PosX", "PosY", "Rot", "Side")]
    for placed in layout.placed:
        component = placed.component
        if component.part.mounted:
            rows.append(
                (
                    component.reference,
                    component.value,
                    component.part.name,
                    f"{placed.x:.4f}",
                    f"{placed.y:.4f}",
                    f"{90 * (placed.turn % 4):.1f}",
                    "top" if placed.face == "F" else "bottom",
                )
            )
    return _table(rows)
