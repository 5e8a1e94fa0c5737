"""Tessellates a surface: a folded sheet that lies on it, its flat pattern, and whether both hold.

Decides which files come out, and that no pattern is written of a sheet that fails a gate: nobody
should cut it.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from smoskin.arguments import typed
from smoskin.commands.tessellate.pages import fold_page, report_page
from smoskin.commands.tessellate.panels import Panelled, panels_for, thinner_plates
from smoskin.commands.tessellate.skin import skin_on
from smoskin.commands.tessellate.surfaces import named_surface
from smoskin.design.document import format_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, require
from smoskin.origami.surface.analytic import Plane
from smoskin.origami.surface.mesh import format_stl, halved
from smoskin.origami.tessellation import documents
from smoskin.origami.tessellation.survey import TooBentError
from smoskin.origami.tessellation.tessellate import Tessellation, tessellate
from smoskin.outputs import check_output, write_output
from smoskin.roles import Progress

if TYPE_CHECKING:
    from rich.table import Table

_ALWAYS: Final = ("validity.json", "report.html", "fold.html", "sheet.svg")
_SOUND: Final = ("sheet.fold", "pattern.fold", "sheet.obj", "sheet.stl", "pattern.svg")
"""Files of a sheet that passes every gate."""
_DESIGN: Final = "design.toml"
"""File of a sheet that a skin can be sensed on with."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TessellationReport:
    """What was made, and where it lies."""

    surface: str
    cells: tuple[int, int]
    made: Tessellation
    panels: Panelled
    """The panels that were chosen, and how a press folds its cell with them."""
    roughness: float
    """m: what a mesh departs from its chart; 0 for closed forms."""
    skin: SkinDesign | None
    """The design of a skin on this sheet."""
    without_skin: str
    """Why there is none; empty otherwise."""
    files: tuple[Path, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines."""
        made = self.made
        return {
            "surface": self.surface,
            "cells": list(self.cells),
            "holds": made.holds,
            "folds": made.folds,
            "gates": [gate.as_json() for gate in made.gates],
            "turned_deg": float(np.degrees(made.turn)),
            "panels_mm": 1e3 * self.panels.design.panels.thickness,
            "panels_reason": self.panels.reason,
            "fold_share": self.panels.fold_share,
            "planar_fold_share": self.panels.planar_fold_share,
            "mesh_roughness_mm": 1e3 * self.roughness,
            "advice": made.advice,
            "sensing": self.without_skin or _DESIGN,
            "files": [str(file) for file in self.files],
        }

    @property
    def sections(self) -> list[tuple[str, list[list[str]]]]:
        """Tables with their titles, the first row of each its head: gates, and how it folds."""
        made, panels = self.made, self.panels
        gates = [["gate", "value", "limit", "unit", "holds"]]
        for gate in made.gates:
            holds = "yes" if gate.holds else "NO"
            gates.append([gate.name, f"{gate.value:.4g}", f"{gate.limit:.4g}", gate.unit, holds])
        lowest = " and ".join(f"{value:.2g}" for value in made.rigidity)
        rows = [
            ["how it folds", "value"],
            ["folds by its creases alone", "yes" if made.folds else "no: it is locked"],
            ["lowest singular values", lowest],
            [
                "share of a press that folds its cell",
                f"{panels.fold_share:.3f}, planar {panels.planar_fold_share:.3f}",
            ],
            ["panels", panels.reason],
        ]
        if made.turn:
            rows.append(["turned to where it fits, deg", f"{np.degrees(made.turn):.3g}"])
        if made.folding is not None:
            twist = np.degrees(made.folding.twist)
            rows.append(["largest strain from flat to folded", f"{made.folding.strain:.2g}"])
            rows.append(["largest panel twist on the way, deg", f"{twist:.2g}"])
        longest = 1e3 * np.abs(made.lifts).max()
        rows.append(["columns longer or shorter by up to, mm", f"{longest:.2g}"])
        if self.roughness:
            rows.append(["mesh off its chart, mm rms", f"{1e3 * self.roughness:.3g}"])
        rows.append(["a skin on it", self.without_skin or f"{_DESIGN} may be sensed on"])
        return [(f"Sheet on {self.surface}", gates), ("What follows", rows)]

    def tables(self) -> "list[Table]":
        """The sections for a terminal."""
        from rich.table import Table

        shown = []
        for title, (head, *rows) in self.sections:
            table = Table(*head, title=title)
            for row in rows:
                table.add_row(*row)
            shown.append(table)
        return shown


@typed
def tessellate_surface(
    surface: str,
    design: SkinDesign,
    cells: tuple[int, int],
    out: Path,
    *,
    scale: float = 1.0,
    at: Sequence[float] = (0.0, 0.0, 0.0),
    along: Sequence[float] = (1.0, 0.0, 0.0),
    own_columns: bool = False,
    time_limit: float = 60.0,
    force: bool = False,
    progress: Progress | None = None,
) -> TessellationReport:
    """Tessellate a surface with a design's cells and write the sheet's files into a folder.

    On a plane, a cylinder or a cone, whose radii are those on which the bottom vertices lie, the
    design of a skin on the sheet is among them.

    Parameters
    ----------
    surface : str
        Such as ``cylinder:100``, lengths in mm, or the path of a mesh in mm.
    scale : float
        Factor on the panels' edges of the design's cell.
    at, along : sequence of float
        Point of a mesh in mm, and direction of the sheet's x: that of a limb's axis.
    own_columns : bool
        Whether every column may have its own height, so that a sheet folds on any surface.

    Raises
    ------
    ArgumentError
        If the surface is unknown, does not reach under the sheet, or is no surface.
    TooBentError
        If it is bent more tightly than such cells can follow; validity.json says by how much.
    FileError
        If files exist already and `force` is not given, or cannot be written.
    """
    _check(cells, scale, out, force=force)
    a, b = scale * design.cell.panel_a, scale * design.cell.panel_b
    cell = replace(design.cell, panel_a=a, panel_b=b)
    shape, roughness = named_surface(surface, cell, cells, at, along)
    plate = design.panels.thickness / 2
    try:
        made = tessellate(
            shape,
            cell,
            cells,
            plate=plate,
            thinner=thinner_plates(plate),
            column=design.columns.height,
            own_columns=own_columns,
            time_limit=time_limit,
            progress=progress,
        )
    except TooBentError as error:
        _write_refusal(error, surface, cells, out)
        raise
    panels = panels_for(design, made, tessellate(Plane(), cell, cells, refold=False))
    made = made.with_plate(panels.design.panels.thickness / 2)
    skin, without = skin_on(shape, surface, panels.design, cell, made)
    sound = (*_SOUND, *((_DESIGN,) if skin else ())) if made.holds else ()
    report = TessellationReport(
        surface=surface,
        cells=cells,
        made=made,
        panels=panels,
        roughness=roughness,
        skin=skin,
        without_skin=without,
        files=tuple(out / name for name in (*_ALWAYS, *sound)),
    )
    _write(report, out)
    return report


def _check(cells: tuple[int, int], scale: float, out: Path, *, force: bool) -> None:
    """Refuse sizes and folders that nothing can be made of."""
    if not (np.isfinite(scale) and scale > 0.0):
        raise ArgumentError(f"scale must be finite and > 0; got {scale}")
    if min(cells) < 1:
        raise ArgumentError(f"cells must be at least 1 1; got {cells[0]} {cells[1]}")
    require("drawing a sheet", "plots", "matplotlib")
    check_output(out, folder=True)
    for name in (*_ALWAYS, *_SOUND, _DESIGN):
        check_output(out / name, force=force)


def numbers(name: str, text: str) -> list[float]:
    """Numbers of a text such as 0,40,120."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise ArgumentError(
            f"{name} must be three numbers such as 0,40,120; got {text!r}"
        ) from error


def _write_refusal(error: TooBentError, surface: str, cells: tuple[int, int], out: Path) -> None:
    """Write what a surface that is refused asks too much of, and take away any older sheet."""
    for name in (*_ALWAYS, *_SOUND, _DESIGN):
        (out / name).unlink(missing_ok=True)
    refusal = {
        "holds": False,
        "gates": [error.gate.as_json()],
        "surface": surface,
        "cells": list(cells),
        "advice": str(error),
    }
    write_output(out / "validity.json", json.dumps(refusal, indent=1).encode())


def _write(report: TessellationReport, out: Path) -> None:
    """Write the files of a report, and take away those of an older one that no longer hold."""
    made = report.made
    title = f"{report.cells[0]} x {report.cells[1]} cells on {report.surface}"
    values = report.as_json()
    keys = [name for name in values if name not in ("holds", "folds", "gates", "advice", "files")]
    picture = _picture(made, title)
    verdict = f"This sheet must not be cut: {made.advice}." if made.advice else "Every gate holds."
    names = [file.name for file in report.files]
    contents: dict[str, bytes | str] = {
        "validity.json": documents.validity(made, **{name: values[name] for name in keys}),
        "report.html": report_page(title, verdict, report.sections, names, picture),
        "fold.html": fold_page(made, title),
        "sheet.svg": picture,
    }
    if made.holds:
        contents |= {
            "sheet.fold": documents.folded_form(made, title),
            "pattern.fold": documents.crease_pattern(made, title),
            "sheet.obj": documents.mesh_text(made, title),
            "sheet.stl": format_stl(made.sheet.vertices, halved(made.sheet.facets), title),
            "pattern.svg": documents.drawing(made, title),
        }
    if report.skin is not None:
        contents[_DESIGN] = format_design(report.skin)
    for name in (*_SOUND, _DESIGN):
        if name not in contents:
            (out / name).unlink(missing_ok=True)
    for name, content in contents.items():
        write_output(out / name, content.encode() if isinstance(content, str) else content)


def _picture(made: Tessellation, title: str) -> bytes:
    """The sheet, folded and flat, as SVG."""
    from smoskin.plots import draw_sheet

    stream = BytesIO()
    figure = draw_sheet(made.sheet, made.pattern, title)
    figure.savefig(stream, format="svg", metadata={"Date": None, "Title": title})
    return stream.getvalue()
