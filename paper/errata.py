"""Where the paper's Supporting Information is wrong or open, as entries and as rows.

The entries live in `errata.toml`; what stands open is filled with numbers computed here. The
page docs/errata.md is `page` of these entries, so that page, report and model agree.
"""

import math
import tomllib
from dataclasses import dataclass
from importlib import resources
from typing import NamedTuple

import numpy as np

from paper.dividing import PRINTED, RATIO, attempts, attenuation_needed
from paper.models.stiffness_terms import stiffness_terms
from paper.rows import Row
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
code follows this page. Written by `docs/make_errata.py`; `smoskin report` lists the same entries.

Entries without a test are about wording. Tests without a file are in `tests/paper/test_errata.py`.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Erratum:
    """One entry of the errata."""

    number: str
    """E1, E2, ... where what holds is known; U1, U2, ... where it is not."""
    place: str
    printed: str
    """What is printed."""
    holds: str
    """What holds; of an open one, what the model gives."""
    test: str
    """What shows it; empty where it is about wording."""
    tried: str
    """Of an open one: what was tried."""

    @property
    def is_open(self) -> bool:
        """Whether the difference is unexplained."""
        return self.number.startswith("U")


class Evaluation(NamedTuple):
    """A printed form and the right one at the reference design."""

    number: str
    """Of the erratum."""
    quantity: str
    printed: float
    right: float


def errata(design: SkinDesign) -> tuple[Erratum, ...]:
    """All entries, open ones last, with the numbers of this design."""
    text = resources.files(__package__).joinpath("errata.toml").read_text(encoding="utf-8")
    document = tomllib.loads(text)
    closed = [
        Erratum(
            number=one["number"],
            place=one["place"],
            printed=one["printed"],
            holds=one["holds"],
            test=one.get("test", ""),
            tried="",
        )
        for one in document["erratum"]
    ]
    unresolved = document["unresolved"]
    # What the whole sheet answers takes long to compute, and stands in the file.
    answers = (
        _dividing_line(design), _labels(design), _dimensions(design), _panels(design),
        *((one["holds"], one["tried"]) for one in unresolved if "holds" in one),
    )  # fmt: skip
    still_open = [
        Erratum(
            number=one["number"],
            place=one["place"],
            printed=one["printed"],
            holds=holds,
            test=one.get("test", "tests/paper/test_golden_numbers.py"),
            tried=tried,
        )
        for one, (holds, tried) in zip(document["unresolved"], answers, strict=True)
    ]
    return (*closed, *still_open)


def errata_rows(design: SkinDesign) -> list[Row]:
    """Every entry as a row of the report."""
    evaluated = {one.number: one for one in evaluations(design)}
    rows = []
    for one in errata(design):
        why = one.tried or (f"shown by {one.test}" if one.test else "wording")
        deviation = None
        if one.number in evaluated:
            value = evaluated[one.number]
            deviation = value.right / value.printed - 1
            why = (
                f"{value.quantity}: {value.right:.6g} against {value.printed:.6g} as printed; {why}"
            )
        rows.append(
            Row(
                id=one.number,
                place=one.place,
                printed=one.printed,
                computed=one.holds,
                deviation=deviation,
                verdict="unresolved" if one.is_open else "corrected",
                why=why,
            )
        )
    return rows


def evaluations(design: SkinDesign) -> tuple[Evaluation, ...]:
    """Printed and right forms of the entries that have numbers, at this design."""
    cell, (n, m) = design.cell, design.cells
    phi, press = cell.fold_angle, -1e-4
    k = math.pi / (2 * design.magnets[0].radius)
    right_amplitude = amplitude(design.magnets[0].remanence, k, design.magnets[0].height)
    phase_x, phase_y = 0.3, 0.1
    b_z = math.cos(phase_x) + math.cos(phase_y)
    square_x, square_y = math.sin(phase_x) ** 2, math.sin(phase_y) ** 2
    printed_strength = math.hypot(b_z - (b_z**2 + square_y + square_x) / (2 * b_z), square_y**0.5)
    sheet = build_sheet(cell, design.cells)
    near, far = relative_stiffness_map(cell, design.cells, (1.0, 1.0))[0, [0, -1]].tolist()
    ratio = unit_press(design)[:2, 0, 0, 0] / unit_press(design)[:2, 0, 1, 0]
    return (
        Evaluation("E1", "nu_12", -(math.cos(phi) ** 2), float(poisson_ratios(cell).nu_12)),
        Evaluation(
            "E2",
            "K of a magnet of the skin, T",
            right_amplitude / VACUUM_PERMEABILITY,
            right_amplitude,
        ),
        Evaluation(
            "E3", "K e^(kz) over its true value at kx = 0.3, ky = 0.1", printed_strength, 1.0
        ),
        Evaluation(
            "E4",
            "dl for a press of 0.1 mm, mm",
            float(cell_change(cell, press).dl) * 1e3,
            float(cell_change(cell, press, "exact").dl) * 1e3,
        ),
        Evaluation("E12", "energy of four creases over k a dphi_1² + k b dphi_2²", 2.0, 1.0),
        Evaluation(
            "E14", "a-creases", 2 * n * m + 2 * (n - 1) * (m - 1), int(np.sum(sheet.along_a))
        ),
        Evaluation("E26", "stiffness of cell (1,6) over (1,1) at v_a = 1", 1.0, far / near),
        Evaluation("U1", "dividing line", PRINTED, float(ratio.mean())),
        Evaluation("U2", "U_2x/U_3x", 1 / RATIO, float(ratio[0])),
    )


def page(design: SkinDesign) -> str:
    """The whole of docs/errata.md."""
    entries = errata(design)
    lines = [
        _HEADER,
        "| no. | place | what is printed | what holds | shown by |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {one.number} | {one.place} | {one.printed} | {one.holds} | "
        + (f"`{one.test}` |" if one.test else "|")
        for one in entries
        if not one.is_open
    ]
    lines += [
        "",
        "## Unresolved",
        "",
        "| no. | place | what is printed | what this model gives | what was tried |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {one.number} | {one.place} | {one.printed} | {one.holds} | {one.tried} |"
        for one in entries
        if one.is_open
    ]
    lines += [
        "",
        "### U1: every reading that was tried",
        "",
        "| reading | line |",
        "|---|---|",
        *(f"| {one.how} | {one.line:.4f} |" for one in attempts(design)),
    ]
    return "\n".join(lines) + "\n"


def _dividing_line(design: SkinDesign) -> tuple[str, str]:
    """U1: what the model gives, and what was tried."""
    moved = unit_press(design)
    ratio = moved[:3, 0, 0, 0] / moved[:3, 0, 1, 0]
    v = design.coefficients.attenuation[0]
    return (
        f"({ratio[0]:.4f} + {ratio[1]:.4f}) / 2 = {ratio[:2].mean():.4f}",
        f"{len(attempts(design))} readings, all on the errata page, two of them over many "
        "places of the magnets: other means, folds, kinematics, labels and places. One rounds to "
        "1.51: the mean of the magnitudes for cells (2,1) and (3,1), "
        f"({abs(ratio[1]):.4f} + {abs(ratio[2]):.4f}) / 2 = (1 + v_a)² = {(1 + v) ** 2:.4f}. Those "
        "two cells lie in zones 1 and 2, which signs tell apart already, so it may be an index off "
        "by one, or chance. The SI's own rule would need "
        f"v_a = {attenuation_needed(design):.4f}, which contradicts the four displacements",
    )


def _labels(design: SkinDesign) -> tuple[str, str]:
    """U2: what the model gives, and what was tried."""
    x, y = unit_press(design)[0, 0].T
    return (
        f"{x[0]:.4f}/{x[1]:.4f} and {y[0]:.4f}/{y[1]:.4f}: the inverse of both",
        "with magnet 2 where Table S1 needs it (x = 4 cells, y = 2 cells) the labels 2 and 3 stand "
        "swapped in the text. Its own dividing line of 1.51 says so too: as printed, U_2x/U_3x "
        "lies below 1 for both cells, and no such line could part them",
    )


def _dimensions(design: SkinDesign) -> tuple[str, str]:
    """U3: what the model takes, and why."""
    cell, v = design.cell, design.coefficients.attenuation[0]
    return (
        f"a = {cell.panel_a * 1e3:.4f} mm, b = {cell.panel_b * 1e3:.4f} mm, "
        f"alpha = {math.degrees(cell.sector_angle):.4f}°, "
        f"phi = {math.degrees(cell.fold_angle):.4f}°, v_a = {v:.6f}",
        "the one cell that gives 20 x 26.667 mm and the four displacements; six numbers fix these "
        "five, and the sixth agrees. Marked `inferred` in `planar.toml`",
    )


def _panels(design: SkinDesign) -> tuple[str, str]:
    """U4: what the model gives, and what was tried."""
    terms = stiffness_terms(design, design.coefficients.attenuation, panel_energy="bending")
    columns = terms.columns
    creases, panels = terms.creases / columns, terms.panels / columns
    v = design.coefficients.attenuation[0]
    return (
        f"K_C / K_B = {creases.min():.2f} to {creases.max():.2f}; K_p / K_B = {panels.min():.0f} "
        f"to {panels.max():.0f} by panel bending alone at v_a = {v:.4f}",
        "K_p was derived from the misfit of neighbouring fold states, for plates of "
        f"{design.panels.thickness * 1e3:g} mm {design.panels.material}: it is zero for a rigid "
        "sheet (v_a = 1) and falls with the cube of the thickness, below a tenth of K_B under "
        "about 0.15 mm. A whole sheet of such plates would not attenuate as S10 says with "
        "v_a = 0.23, so v_a stands for compliance that the reduced model does not have. As in the "
        "SI, the force law keeps K_B alone, and v_s takes up the rest",
    )
