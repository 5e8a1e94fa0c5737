"""Writes the report: rows as JSON, figures as SVG, and both as a web page and a PDF.

A later part of the package joins by adding its rows to `all_rows` and its figures to `_plates`;
what both need is computed once, as `Experiments`.
"""

import json
import os
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from paper.errata import errata_rows
from paper.experiments import Experiments, Progress, experiment, experiment_rows
from paper.golden import golden_rows
from paper.maps import poisson_map, sheet_magnets, stiffness_maps
from paper.models.magnetisation import MagnetisationLoop
from paper.page import html_page, summary
from paper.printed import (
    calibration_rows,
    location_rows,
    material_rows,
    poisson_rows,
    sheet_rows,
    stiffness_rows,
    touch_rows,
    zone_rows,
)
from paper.rows import Row
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, MissingExtraError
from smoskin.sensing.closed_form.location import unit_press, zones
from smoskin.sensing.response.table import ResponseTable

if TYPE_CHECKING:
    from paper.style import Plate


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What was written, and what it says."""

    rows: tuple[Row, ...]
    data: Path
    """report.json."""
    page: Path
    """report.html."""
    document: Path
    """report.pdf."""
    pages: int
    """Of the PDF."""
    figures: tuple[Path, ...]
    """SVG files."""

    @property
    def summary(self) -> str:
        """How many rows have which verdict, as a sentence."""
        return summary(self.rows)

    def as_json(self) -> dict[str, object]:
        """Plain values for machines: what report.json holds."""
        return {"rows": [asdict(row) for row in self.rows]}


def build_report(
    design: SkinDesign,
    out: str | os.PathLike[str],
    *,
    table: ResponseTable | None = None,
    progress: Progress | None = None,
) -> Report:
    """Compute every row and figure of the paper and write them to a folder.

    Files of an earlier report there are replaced; the same design gives the same bytes.

    Parameters
    ----------
    design : SkinDesign
        With the paper's 6 x 6 cells and two magnets on the sheet.
    out : path
        The folder; made if missing.
    table : ResponseTable, optional
        Of the design, by which estimators read; by default a small one is made.
    progress : callable, optional
        Called with what is being done and the share of the whole that is done.

    Raises
    ------
    ArgumentError
        If the design has another layout, or the folder cannot be written.
    ModelError
        If the table belongs to another design or lacks chips.
    MissingExtraError
        If Matplotlib, JAX or FElupe is not installed.
    """
    for module in ("matplotlib", "jax", "felupe"):
        if find_spec(module) is None:
            raise MissingExtraError("the report", "report")
    from paper.document import write_document

    report = progress or (lambda what, share: None)
    sheet_magnets(design)
    folder = _writable(Path(out))
    found = experiment(design, lambda what, share: report(what, 0.7 * share), table)
    report("rows", 0.7)
    rows = all_rows(design, found)
    report("figures", 0.75)
    plates = _plates(design, found)
    title = f"{design.name} ({design.content_hash[:12]})"
    figures = []
    for k, plate in enumerate(plates):
        report(plate.title, 0.8 + 0.05 * k / len(plates))
        figures.append(plate.write(folder))
    report("document", 0.85)
    document = folder / "report.pdf"
    pages = write_document(document, f"smoskin report: {title}", rows, plates)
    report("page", 0.95)
    shown = [
        (path, plate.title, plate.caption) for path, plate in zip(figures, plates, strict=True)
    ]
    page = folder / "report.html"
    page.write_text(html_page(title, rows, shown), encoding="utf-8")
    result = Report(
        rows=tuple(rows),
        data=folder / "report.json",
        page=page,
        document=document,
        pages=pages,
        figures=tuple(figures),
    )
    result.data.write_text(
        json.dumps(result.as_json(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    report("done", 1.0)
    return result


def all_rows(design: SkinDesign, found: Experiments) -> list[Row]:
    """Every row, in the order of the paper; errata last."""
    return [
        *poisson_rows(poisson_map(design)),
        *location_rows(design),
        *zone_rows(zones(unit_press(design))),
        *sheet_rows(design),
        *stiffness_rows(stiffness_maps(design)),
        *calibration_rows(design),
        *material_rows(),
        *touch_rows(design),
        *experiment_rows(found),
        *golden_rows(design),
        *errata_rows(design),
    ]


def _plates(design: SkinDesign, found: Experiments) -> "list[Plate]":
    """Every figure, in the order of the paper; then those that it does not have."""
    from paper.assumption_plate import assumption_plate
    from paper.bound_plate import bound_plate
    from paper.environment_plates import recovery_plate, warmth_plate
    from paper.figures import poisson_plate, stiffness_plate, zone_plate
    from paper.pairs_plate import pairs_plate
    from paper.shear_learning_plate import shear_learning_plate
    from paper.sheet_figure import crease_plate
    from paper.sheet_plates import cover_plate, press_plate
    from paper.soft_magnet_plate import soft_magnet_plate
    from paper.touches_plate import touches_plate

    return [
        poisson_plate(poisson_map(design)),
        zone_plate(zones(unit_press(design))),
        crease_plate(design.cell, design.cells),
        stiffness_plate(stiffness_maps(design)),
        recovery_plate(found.recovery),
        soft_magnet_plate(found.comparison, MagnetisationLoop()),
        shear_learning_plate(found.shear, found.jointly),
        warmth_plate(found.warmth),
        cover_plate(found.covers),
        press_plate(design, found.field),
        assumption_plate(found.assumptions),
        bound_plate(found.touches),
        touches_plate(found.curve),
        pairs_plate(found.pairs),
    ]


def _writable(folder: Path) -> Path:
    """The folder, made if missing and shown to take a file."""
    probe = folder / "report.json"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with probe.open("a", encoding="utf-8"):
            pass
    except OSError as error:
        raise ArgumentError(
            f"out must be a folder that can be written; got {str(folder)!r}: {error.strerror}"
        ) from error
    return folder
