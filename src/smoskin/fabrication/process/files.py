"""Files of the process sheet."""

import json

from smoskin.design.skin import SkinDesign
from smoskin.fabrication.artifact import Artifact
from smoskin.fabrication.materials import Item
from smoskin.fabrication.moulds.assembly import whole_skin
from smoskin.fabrication.moulds.files import Solids
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.pattern.sheets import sheet_drawings
from smoskin.fabrication.process.page import Sheet, html, pdf_sheet
from smoskin.fabrication.process.readings import first_readings, suited_magnets
from smoskin.fabrication.process.steps import steps_of
from smoskin.fabrication.process.tolerances import tolerance_table
from smoskin.fabrication.process.view import LARGEST, view
from smoskin.fabrication.workshop import Workshop


def process_files(
    design: SkinDesign, workshop: Workshop, solids: Solids, items: list[Item]
) -> list[Artifact]:
    """The process sheet for browser and bench, the skin to take apart, and the first readings."""
    flat = flat_sheet(design, workshop)
    parts = whole_skin(design, flat, workshop)
    sheet = Sheet(
        design=design,
        steps=steps_of(design, workshop, flat, sheet_drawings(design, workshop), solids, parts),
        items=tuple(items),
        tools=solids.tools,
        tolerances=tolerance_table(design),
        readings=first_readings(design),
        suited=suited_magnets(design),
    )
    expected = {
        reading.chip: {
            "address": reading.address,
            "designed_mT": (1e3 * reading.designed).round(3).tolist(),
            "low_mT": (1e3 * reading.low).round(3).tolist(),
            "high_mT": (1e3 * reading.high).round(3).tolist(),
            "full_scale_mT": (1e3 * reading.full_scale).round(3).tolist(),
        }
        for reading in sheet.readings
    }
    readings = (json.dumps(expected, indent=1) + "\n").encode()
    shown = []
    if design.cells[0] * design.cells[1] <= LARGEST:
        sunk = [magnet.name for magnet in design.magnets if magnet.mount == "base"]
        page = view(parts, f"{design.name} {design.content_hash[:12]}", sunk)
        shown.append(Artifact(path="assembly.html", kind="html", units="mm", content=page))
    return [
        *shown,
        Artifact(path="process.html", kind="html", units="mm", content=html(sheet)),
        Artifact(path="process.pdf", kind="pdf", units="mm", content=pdf_sheet(sheet)),
        Artifact(path="first_readings.json", kind="json", units="mT", content=readings),
    ]
