"""Errata of the paper's Supporting Information, and what stays open, as entries and as rows.

The entries live in `errata.toml`; some open ones are filled with numbers computed here. The page
docs/errata.md is `page` of these entries, so that page, report and model agree.
"""

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any, NamedTuple

from paper.models.finite_press import exact_change
from paper.models.stiffness_terms import stiffness_terms
from paper.shared.rows import Row, table
from paper.shared.setting import Setting
from smoskin.design.skin import SkinDesign
from smoskin.magnetics.centripetal import amplitude
from smoskin.magnetics.sector import VACUUM_PERMEABILITY
from smoskin.mechanics.reduced.attenuation import cell_change
from smoskin.mechanics.reduced.stiffness import relative_stiffness_map
from smoskin.origami.cell import poisson_ratios
from smoskin.origami.sheet import build_sheet
from smoskin.sensing.closed_form.location import unit_press

_HEADER = """# Errata of the source

The source is the Supporting Information ("SI") of *Sandwich Miura-Ori Enabled Large Area, Super
Resolution Tactile Skin for Human-Machine Interactions*. Every equation was derived again from
explicit 3-D cells, symbolically and by finite differences. Where this page and the SI differ, the
code follows this page. Written by `docs/make_errata.py`; `python -m paper` lists the same entries.

Entries without a test are about wording. Tests without a file are in `tests/paper/test_errata.py`.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Erratum:
    """One entry of the errata."""

    number: str
    """E1, E2, ... where what holds is known; U1, U2, ... where it is not."""
    place: str
    """Place in the print."""
    printed: str
    """What is printed."""
    holds: str = ""
    """What holds; of an open one, what the model gives."""
    test: str = ""
    """The test that shows it; empty where it is about wording."""
    tried: str = ""
    """What was tried, of an open one."""

    @property
    def is_open(self) -> bool:
        """Whether the difference is unexplained."""
        return self.number.startswith("U")


class Evaluation(NamedTuple):
    """A printed form and the right one at the reference design."""

    quantity: str
    printed: float
    right: float


def errata(design: SkinDesign) -> tuple[Erratum, ...]:
    """All entries, open ones last, with the numbers of this design."""
    document = _document()
    numbers = _numbers(design)
    open_ones = [
        Erratum(**entry | {key: entry[key].format(**numbers) for key in ("holds", "tried")})
        for entry in document["unresolved"]
    ]
    return (*(Erratum(**entry) for entry in document["erratum"]), *open_ones)


def errata_rows(design: SkinDesign) -> list[Row]:
    """Every entry as a row of the report."""
    evaluated = evaluations(design)
    rows = []
    for entry in errata(design):
        why = entry.tried or (f"shown by {entry.test}" if entry.test else "wording")
        deviation = None
        if value := evaluated.get(entry.number):
            deviation = value.right / value.printed - 1
            numbers = f"{value.right:.6g} against {value.printed:.6g} as printed"
            why = f"{value.quantity}: {numbers}; {why}"
        row = Row(
            id=entry.number,
            place=entry.place,
            printed=entry.printed,
            computed=entry.holds,
            deviation=deviation,
            verdict="unresolved" if entry.is_open else "corrected",
            why=why,
        )
        rows.append(row)
    return rows


def evaluations(design: SkinDesign) -> dict[str, Evaluation]:
    """Printed and right forms of the entries that have numbers, at this design."""
    cell, (n, m), magnet = design.cell, design.cells, design.magnets[0]
    k_of_s4 = amplitude(magnet.remanence, math.pi / (2 * magnet.radius), magnet.height)
    kx, ky = 0.3, 0.1
    b_z = math.cos(kx) + math.cos(ky)
    square_x, square_y = math.sin(kx) ** 2, math.sin(ky) ** 2
    printed_strength = math.hypot(b_z - (b_z**2 + square_y + square_x) / (2 * b_z), square_y**0.5)
    growth = [float(change(cell, -1e-4).dl) * 1e3 for change in (cell_change, exact_change)]
    along_a = int(build_sheet(cell, design.cells).along_a.sum())
    near, far = relative_stiffness_map(cell, design.cells, (1.0, 1.0))[0, [0, -1]].tolist()
    ratio = (unit_press(design)[:2, 0, 0, 0] / unit_press(design)[:2, 0, 1, 0]).tolist()
    nu_12 = float(poisson_ratios(cell).nu_12)
    strength = "K e^(kz) over its true value at kx = 0.3, ky = 0.1"
    energy = "energy of four creases over k a dphi_1² + k b dphi_2²"
    return {
        "E1": Evaluation("nu_12", -(math.cos(cell.fold_angle) ** 2), nu_12),
        "E2": Evaluation("K of a magnet of the skin, T", k_of_s4 / VACUUM_PERMEABILITY, k_of_s4),
        "E3": Evaluation(strength, printed_strength, 1.0),
        "E4": Evaluation("dl for a press of 0.1 mm, mm", *growth),
        "E12": Evaluation(energy, 2.0, 1.0),
        "E14": Evaluation("a-creases", 2 * n * m + 2 * (n - 1) * (m - 1), along_a),
        "E26": Evaluation("stiffness of cell (1,6) over (1,1) at v_a = 1", 1.0, far / near),
        "U1": Evaluation("dividing line", 1.51, sum(ratio) / 2),
        "U2": Evaluation("U_2x/U_3x", 1 / (0.7313 / 0.6721), ratio[0]),
    }


def page(design: SkinDesign) -> str:
    """The whole of docs/errata.md."""
    entries = errata(design)
    closed = [
        (item.number, item.place, item.printed, item.holds, f"`{item.test}`" if item.test else "")
        for item in entries
        if not item.is_open
    ]
    open_ones = [
        (item.number, item.place, item.printed, item.holds, item.tried)
        for item in entries
        if item.is_open
    ]
    attempts = [(name, f"{line:.4f}") for name, line in dividing_lines().items()]
    head = ("no.", "place", "what is printed")
    return "\n".join(
        [
            _HEADER,
            *_markdown((*head, "what holds", "shown by"), closed),
            "\n## Unresolved\n",
            *_markdown((*head, "what this model gives", "what was tried"), open_ones),
            "\n### U1: every reading that was tried\n",
            *_markdown(("reading", "line"), attempts),
            "",
        ]
    )


def dividing_lines() -> dict[str, float]:
    """Every reading of the dividing line of U1 that was tried, the SI's own first."""
    lines: dict[str, float] = _document()["dividing_line"]
    return lines


def _document() -> dict[str, Any]:
    text = resources.files(__package__).joinpath("errata.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def _markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> list[str]:
    """A table, line by line."""
    rows = [f"| {' | '.join(line)} |".replace("|  |", "| |") for line in (head, *lines)]
    return [rows[0], "|" + "---|" * len(head), *rows[1:]]


def _numbers(design: SkinDesign) -> dict[str, object]:
    """Numbers of this design that the texts of open entries name."""
    moved, v = unit_press(design), design.coefficients.attenuation[0]
    ratio = moved[:3, 0, 0, 0] / moved[:3, 0, 1, 0]
    terms = stiffness_terms(design, design.coefficients.attenuation, panel_energy="bending")
    creases, panels = terms.creases / terms.columns, terms.panels / terms.columns
    cell = design.cell
    return {
        "ratio": ratio,
        "line": ratio[:2].mean(),
        "later": abs(ratio[1:]),
        "readings": len(dividing_lines()),
        "x": moved[0, 0, :, 0],
        "y": moved[0, 0, :, 1],
        "cell": (cell.panel_a * 1e3, cell.panel_b * 1e3),
        "angles": (math.degrees(cell.sector_angle), math.degrees(cell.fold_angle)),
        "v": v,
        "squared": (1 + v) ** 2,
        "creases": (creases.min(), creases.max()),
        "panels": (panels.min(), panels.max()),
        "thickness": design.panels.thickness * 1e3,
        "material": design.panels.material,
    }


if __name__ == "__main__":
    print(table(errata_rows(Setting().design)))
