"""A design in words and numbers: what is built, why, and what follows from it."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, SupportsFloat

import numpy as np

from smoskin.design.document import design_values
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
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
from smoskin.units import SI_PER_SUFFIX, from_si

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

    def as_json(self) -> dict[str, Any]:
        """Plain values for machines."""
        return asdict(self)

    def tables(self) -> "list[Table]":
        """Two tables for people."""
        title = f"Design {self.name!r} ({self.content_hash[:12]})"
        return [
            _table(title, self.given, "where from"),
            _table("What follows", self.derived, "how"),
        ]


def describe(design: SkinDesign) -> DataSheet:
    """The data sheet of a design."""
    given = []
    for path, name, value in design_values(design):
        source = design.provenance.get(path)
        why = "" if source is None else ": ".join(filter(None, (source.origin, source.reason)))
        given.append(Row(part=path.rpartition(".")[0] or "skin", name=name, value=value, why=why))
    try:
        with np.errstate(divide="raise", over="raise", invalid="raise"):
            derived = (*_of_skin(design), *_of_chips(design))
    except ArithmeticError as error:
        raise DesignError(f"the design's values must suit each other; got {error}") from error
    return DataSheet(
        name=design.name, content_hash=design.content_hash, given=tuple(given), derived=derived
    )


def _rows(rows: Iterable[tuple[str, str, SupportsFloat | str, str]]) -> list[Row]:
    """Rows of values in SI: six digits of each in the unit that its name ends with."""
    made = []
    for part, name, value, why in rows:
        if not isinstance(value, str):
            units = [suffix for suffix in SI_PER_SUFFIX if name.endswith(f"_{suffix}")]
            number = from_si(float(value), max(units, key=len)) if units else float(value)
            value = float(f"{number:.6g}")
        made.append(Row(part=part, name=name, value=value, why=why))
    return made


def _of_skin(design: SkinDesign) -> list[Row]:
    """Derived rows of cell and skin."""
    cell, dihedral = geometry(design).cell, dihedral_angles(design.cell)
    nu = ", ".join(f"{float(ratio):.4f}" for ratio in poisson_ratios(design.cell))
    n, m = design.cells
    press = stiffness_map(design, design.coefficients)
    columns, sheet = column_stiffness(design), sheet_stiffness(design)
    rows: list[tuple[str, str, SupportsFloat | str, str]] = [
        ("cell", "length_mm", cell.length, "S1"),
        ("cell", "width_mm", cell.width, "S1"),
        ("cell", "height_mm", cell.height, "S1"),
        ("cell", "dihedral_a_deg", dihedral.at_a, "S13"),
        ("cell", "dihedral_b_deg", dihedral.at_b, "S14"),
        ("cell", "nu_12, nu_13, nu_23", nu, "S2"),
        ("skin", "length_mm", n * cell.length, "N l"),
        ("skin", "width_mm", m * cell.width, "M w"),
        ("skin", "columns", (2 * n + 1) * (m + 1), "one under each bottom vertex"),
        ("skin", "column_stiffness_N_per_mm", columns, "S21"),
        ("skin", "press_stiffness_least_N_per_mm", press.min(), "S22-S25"),
        ("skin", "press_stiffness_most_N_per_mm", press.max(), "S22-S25"),
        ("skin", "press_at_rated_force_mm", RATED_PRESS / press.min(), "S27"),
        ("skin", "sheet_stiffness_N_per_mm", sheet, "S21, all columns"),
        ("skin", "board_stiffness_N_per_mm", board_stiffness(design), "S26"),
    ]
    for number, pair in enumerate(ambiguities(design), 1):
        rows.append(("skin", f"ambiguity {number}", str(pair), "S12, at 0.5 N and 1 % error"))
    return _rows(rows)


def _of_chips(design: SkinDesign) -> list[Row]:
    """Derived rows of all chips, then of each."""
    setting = design.hall_setting
    full_scale, noise = mlx90393.full_scale(setting), mlx90393.noise(setting)
    rate = 1 / mlx90393.conversion_time(setting, 0)
    rows: list[tuple[str, str, SupportsFloat | str, str]] = [
        ("chips", "conversion_rate_Hz", rate, "of x, y, z and temperature"),
        ("chips", "range_xy_mT", full_scale[0], "gain and resolution"),
        ("chips", "range_z_mT", full_scale[2], "gain and resolution"),
        ("chips", "noise_xy_uT", noise[0], "gain, filter, oversampling"),
    ]
    stroke = f"{RATED_PRESS:g} N press and {RATED_SHEAR:g} N drag"
    for site in design.halls:
        seen = field_extent(design, site)
        part = f"chip {site.name} ({site.address:#04x})"
        used = 100 * (seen.largest / full_scale).max()
        rows += [
            (part, "rest_field_mT", np.linalg.norm(seen.rest), "exact field"),
            (part, "rated_stroke_mm", seen.stroke, stroke),
            (part, "range_used_percent", used, f"must stay below {100 * MARGIN:g}"),
        ]
    return _rows(rows)


def _table(title: str, rows: Sequence[Row], why: str) -> "Table":
    """Rows for people; a part is named once."""
    from rich.table import Table

    table = Table("part", "quantity", "value", why, title=title)
    before = ""
    for row in rows:
        value = f"{row.value:.6g}" if isinstance(row.value, float) else str(row.value)
        table.add_row("" if row.part == before else row.part, row.name, value, row.why)
        before = row.part
    return table
