"""Tessellates a surface: a folded sheet that lies on it, its flat pattern, and whether both hold.

Decides which files come out, and that no pattern is written of a sheet that fails a gate: nobody
should cut it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from smoskin.arguments import typed
from smoskin.commands.tessellate.surfaces import named_surface
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, require
from smoskin.mechanics.sheet.foldability import fold_shares
from smoskin.mechanics.sheet.lattice import springs_of
from smoskin.origami.surface.analytic import Plane
from smoskin.origami.tessellation import documents
from smoskin.origami.tessellation.tessellate import Tessellation, tessellate
from smoskin.outputs import check_output, write_output
from smoskin.roles import Progress

if TYPE_CHECKING:
    from rich.table import Table

_ALWAYS: Final = ("validity.json", "sheet.svg")
_SOUND: Final = ("sheet.fold", "pattern.fold", "sheet.obj", "pattern.svg")
"""Files of a sheet that passes every gate."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TessellationReport:
    """What was made, and where it lies."""

    surface: str
    cells: tuple[int, int]
    made: Tessellation
    fold_share: float
    """Mean share of a small press that folds the pressed cell."""
    planar_fold_share: float
    """The same of the planar sheet of the same cells."""
    roughness: float
    """m: what a mesh departs from its chart; 0 for closed forms."""
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
            "fold_share": self.fold_share,
            "planar_fold_share": self.planar_fold_share,
            "mesh_roughness_mm": 1e3 * self.roughness,
            "advice": made.advice,
            "files": [str(file) for file in self.files],
        }

    def tables(self) -> "list[Table]":
        """Gates, and how the sheet folds."""
        from rich.table import Table

        made = self.made
        gates = Table("gate", "value", "limit", "unit", "holds", title=f"Sheet on {self.surface}")
        for gate in made.gates:
            holds = "yes" if gate.holds else "NO"
            gates.add_row(gate.name, f"{gate.value:.4g}", f"{gate.limit:.4g}", gate.unit, holds)
        rows = Table("how it folds", "value", title="What follows")
        rows.add_row("folds by its creases alone", "yes" if made.folds else "no: it is locked")
        rows.add_row("lowest singular values", " and ".join(f"{v:.2g}" for v in made.rigidity))
        shares = f"{self.fold_share:.3f}, planar {self.planar_fold_share:.3f}"
        rows.add_row("share of a press that folds its cell", shares)
        if made.folding is not None:
            rows.add_row("largest strain from flat to folded", f"{made.folding.strain:.2g}")
            rows.add_row(
                "largest panel twist on the way, deg", f"{np.degrees(made.folding.twist):.2g}"
            )
        longest = 1e3 * np.abs(made.lifts).max()
        rows.add_row("columns longer or shorter by up to, mm", f"{longest:.2g}")
        if self.roughness:
            rows.add_row("mesh off its chart, mm rms", f"{1e3 * self.roughness:.3g}")
        return [gates, rows]


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
    DesignError
        If it is bent more tightly than a cell can follow.
    FileError
        If files exist already and `force` is not given, or cannot be written.
    """
    if not (np.isfinite(scale) and scale > 0.0):
        raise ArgumentError(f"scale must be finite and > 0; got {scale}")
    if min(cells) < 1:
        raise ArgumentError(f"cells must be at least 1 1; got {cells[0]} {cells[1]}")
    require("drawing a sheet", "plots", "matplotlib")
    check_output(out, folder=True)
    for name in (*_ALWAYS, *_SOUND):
        check_output(out / name, force=force)
    cell = replace(
        design.cell, panel_a=scale * design.cell.panel_a, panel_b=scale * design.cell.panel_b
    )
    shape, roughness = named_surface(surface, cell, cells, at, along)
    plate, column = design.panels.thickness / 2, design.columns.height
    arguments: dict[str, Any] = {"plate": plate, "column": column, "time_limit": time_limit}
    made = tessellate(shape, cell, cells, own_columns=own_columns, progress=progress, **arguments)
    planar = tessellate(Plane(), cell, cells, refold=False, **arguments)
    shares = [_share(sheet, design) for sheet in (made, planar)]
    report = TessellationReport(
        surface=surface,
        cells=cells,
        made=made,
        fold_share=shares[0],
        planar_fold_share=shares[1],
        roughness=roughness,
        files=tuple(out / name for name in (*_ALWAYS, *(_SOUND if made.holds else ()))),
    )
    _write(report, out)
    return report


def numbers(name: str, text: str) -> list[float]:
    """Numbers of a text such as 0,40,120."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise ArgumentError(
            f"{name} must be three numbers such as 0,40,120; got {text!r}"
        ) from error


def _share(made: Tessellation, design: SkinDesign) -> float:
    """Mean share of a small press that folds the pressed cell."""
    return float(fold_shares(made.sheet, made.normals, springs_of(design)).mean())


def _write(report: TessellationReport, out: Path) -> None:
    """Write the files of a report."""
    from smoskin.plots import draw_sheet, save_figure

    made = report.made
    title = f"{report.cells[0]} x {report.cells[1]} cells on {report.surface}"
    figures = {
        "surface": report.surface,
        "cells": list(report.cells),
        "fold_share": report.fold_share,
        "planar_fold_share": report.planar_fold_share,
        "mesh_roughness_mm": 1e3 * report.roughness,
    }
    texts = {"validity.json": documents.validity(made, **figures)}
    if made.holds:
        texts |= {
            "sheet.fold": documents.folded_form(made, title),
            "pattern.fold": documents.crease_pattern(made, title),
            "sheet.obj": documents.mesh_text(made, title),
            "pattern.svg": documents.drawing(made, title),
        }
    else:
        for name in _SOUND:
            (out / name).unlink(missing_ok=True)
    for name, text in texts.items():
        write_output(out / name, text.encode())
    figure = draw_sheet(made.sheet, made.pattern, title)
    save_figure(figure, out / "sheet.svg", metadata={"Date": None, "Title": title})
