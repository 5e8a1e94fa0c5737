"""Files of the sheet's flat parts: drawings, stock, one PDF at 1:1, and origami documents."""

from smoskin.design.skin import SkinDesign
from smoskin.fabrication.artifact import Artifact
from smoskin.fabrication.drawing import dxf, pdf, svg
from smoskin.fabrication.pattern.coupon import coupon, rows_on_stock
from smoskin.fabrication.pattern.sheets import sheet_drawings
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import surface_of
from smoskin.origami.tessellation import documents
from smoskin.origami.tessellation.tessellate import tessellate


def pattern_files(design: SkinDesign, workshop: Workshop) -> list[Artifact]:
    """Every file of the sheet's flat parts.

    Raises
    ------
    DesignError
        If gaps leave no panels, or a part is larger than the stock.
    MissingExtraError
        If the DXF writer is not installed.
    """
    drawings = sheet_drawings(design, workshop)
    check = coupon(design, workshop)
    upper, lower, film, adhesive = drawings[:4]
    stock = rows_on_stock([check, upper, lower], workshop, design.panels.material)
    stock += rows_on_stock([film], workshop, "film")
    files = []
    for drawing in (*drawings, check, *stock):
        name = f"pattern/{drawing.name}"
        files.append(Artifact(path=f"{name}.dxf", kind="dxf", units="mm", content=dxf(drawing)))
        files.append(Artifact(path=f"{name}.svg", kind="svg", units="mm", content=svg(drawing)))
    pages = pdf((check, upper, lower, film, adhesive, *drawings[4:]), f"{design.name}: patterns")
    files.append(Artifact(path="pattern/patterns.pdf", kind="pdf", units="mm", content=pages))
    return files + fold_files(design, workshop)


def fold_files(design: SkinDesign, workshop: Workshop) -> list[Artifact]:
    """The sheet of ideal creases: flat, folded with frames of the way, and as a picture to fold."""
    made = tessellate(
        surface_of(design),
        design.cell,
        design.cells,
        plate=workshop.plate(design),
        column=design.columns.height,
    )
    title = f"{design.name} {design.content_hash[:12]}"
    texts = {
        "pattern.fold": documents.crease_pattern(made, title),
        "sheet.fold": documents.folded_form(made, title),
        "creases.svg": documents.drawing(made, title),
    }
    return [
        Artifact(
            path=f"pattern/{name}",
            kind="svg" if name.endswith("svg") else "fold",
            units="mm",
            content=text.encode(),
        )
        for name, text in texts.items()
    ]
