"""A design in words and numbers: what is built, why, and what follows from it."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, SupportsFloat

import numpy as np

from smoskin.design.document import design_values
from smoskin.design.skin import SkinDesign
from smoskin.feasibility import MARGIN, RATED_PRESS, RATED_SHEAR, field_extent
from smoskin.magnetics import mlx90393
from smoskin.mechanics.reduced.stiffness import (
    board_stiffness,
    column_stiffness,
    sheet_stiffness,
    stiffness_map,
)
from smoskin.origami.cell import dihedral_angles, poisson_ratios
from smoskin.origami.geometry import geometry
from smoskin.sensing.closed_form.confidence import ambiguities
from smoskin.units import from_si

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One number or word of the sheet."""

    part: str
    name: str
    """With its unit, as in the design's document."""
    value: float | int | str
    why: str
    """Provenance of a given value, or the formula of a derived one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSheet:
    """A design's data sheet."""

    name: str
    content_hash: str
    given: tuple[Row, ...]
    """What is built."""
    derived: tuple[Row, ...]
    """What follows."""

    def as_json(self) -> dict[str, object]:
        """Plain values for machines."""
        return {
            "name": self.name,
            "content_hash": self.content_hash,
            "given": [_plain(row) for row in self.given],
            "derived": [_plain(row) for row in self.derived],
        }

    def tables(self) -> "list[Table]":
        """Two tables for people."""
        from rich.table import Table

        tables = []
        for title, rows, why in (
            (f"Design {self.name!r} ({self.content_hash[:12]})", self.given, "where from"),
            ("What follows", self.derived, "how"),
        ):
            table = Table("part", "quantity", "value", why, title=title)
            before = ""
            for row in rows:
                table.add_row("" if row.part == before else row.part, row.name,
                              _text(row.value), row.why)  # fmt: skip
                before = row.part
            tables.append(table)
        return tables


def describe(design: SkinDesign) -> DataSheet:
    """The data sheet of a design."""
    given = []
    for path, name, value in design_values(design):
        known = design.provenance.get(path)
        why = (
            ""
            if known is None
            else f"{known.origin}: {known.reason}"
            if known.reason
            else known.origin
        )
        given.append(Row(part=path.rpartition(".")[0] or "skin", name=name, value=value, why=why))
    return DataSheet(
        name=design.name,
        content_hash=design.content_hash,
        given=tuple(given),
        derived=(*_of_skin(design), *_of_chips(design)),
    )


def _row(part: str, name: str, value: float | str, why: str) -> Row:
    """A row with six digits of its value."""
    if isinstance(value, str):
        return Row(part=part, name=name, value=value, why=why)
    return Row(part=part, name=name, value=float(f"{value:.6g}"), why=why)


def _written(part: str, name: str, suffix: str, value: SupportsFloat, why: str) -> Row:
    """A row in the unit that its name ends with, of a value in SI."""
    return _row(part, f"{name}_{suffix}", float(from_si(float(value), suffix)), why)


def _of_skin(design: SkinDesign) -> list[Row]:
    """Derived rows of cell and skin."""
    extent, nu, dihedral = (
        geometry(design).cell,
        poisson_ratios(design.cell),
        dihedral_angles(design.cell),
    )
    n, m = design.cells
    stiffness = stiffness_map(design, design.coefficients)
    rows = [
        _written("cell", "length", "mm", extent.length, "S1"),
        _written("cell", "width", "mm", extent.width, "S1"),
        _written("cell", "height", "mm", extent.height, "S1"),
        _written("cell", "dihedral_a", "deg", dihedral.at_a, "S13"),
        _written("cell", "dihedral_b", "deg", dihedral.at_b, "S14"),
        _row("cell", "nu_12, nu_13, nu_23", ", ".join(f"{float(x):.4f}" for x in nu), "S2"),
        _written("skin", "length", "mm", n * extent.length, "N l"),
        _written("skin", "width", "mm", m * extent.width, "M w"),
        _row("skin", "columns", (2 * n + 1) * (m + 1), "one under each bottom vertex"),
        _written("skin", "column_stiffness", "N_per_mm", column_stiffness(design), "S21"),
        _written("skin", "press_stiffness_least", "N_per_mm", stiffness.min(), "S22-S25"),
        _written("skin", "press_stiffness_most", "N_per_mm", stiffness.max(), "S22-S25"),
        _written("skin", "press_at_rated_force", "mm", RATED_PRESS / stiffness.min(), "S27"),
        _written(
            "skin", "sheet_stiffness", "N_per_mm", sheet_stiffness(design), "columns and frame"
        ),
        _written("skin", "board_stiffness", "N_per_mm", board_stiffness(design), "S26"),
    ]
    for number, pair in enumerate(ambiguities(design), 1):
        rows.append(_row("skin", f"ambiguity {number}", str(pair), "S12, at 0.5 N and 1 % error"))
    return rows


def _of_chips(design: SkinDesign) -> list[Row]:
    """Derived rows of all chips, then of each."""
    setting = design.hall_setting
    full_scale = mlx90393.full_scale(setting)
    rate = 1 / mlx90393.conversion_time(setting)
    rows = [
        _row("chips", "conversion_rate_Hz", rate, "of x, y, z at this filter and oversampling"),
        _written("chips", "range_xy", "mT", full_scale[0], "gain and resolution"),
        _written("chips", "range_z", "mT", full_scale[2], "gain and resolution"),
        _written(
            "chips", "noise_xy", "uT", mlx90393.noise(setting)[0], "gain, filter, oversampling"
        ),
    ]
    for site in design.halls:
        seen = field_extent(design, site)
        part = f"chip {site.name} ({site.address:#04x})"
        used = float((seen.largest / full_scale).max())
        rows += [
            _written(part, "rest_field", "mT", float(np.linalg.norm(seen.rest)), "exact field"),
            _written(
                part,
                "rated_stroke",
                "mm",
                seen.stroke,
                f"{RATED_PRESS:g} N press and {RATED_SHEAR:g} N drag",
            ),
            _row(part, "range_used_percent", 100 * used, f"must stay below {100 * MARGIN:g}"),
        ]
    return rows


def _plain(row: Row) -> dict[str, object]:
    return {"part": row.part, "name": row.name, "value": row.value, "why": row.why}


def _text(value: float | int | str) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else str(value)
    return str(value)
