"""A design to start from: the document of another one, each part with what it means.

Decides what a new design takes over; whether it can be built is checked before it is written.
"""

import re
from dataclasses import replace
from typing import Final

from smoskin.design.document import format_design
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError
from smoskin.feasibility import check_design, load_design, suited_to
from smoskin.magnetics.sector import VACUUM_PERMEABILITY

_PARTS: Final = {
    "name": "Name of the design; units stand in the names of the values.",
    "cells": "Cells of the folded sheet along x and y.",
    "[cell]": "The Miura-ori cell: its panels' edges and acute corner, half the zigzag's angle.",
    "[creases]": "The bare film between panels, about which they fold.",
    "[panels]": "The stiff plates on both faces of the film, taken as one.",
    "[columns]": "The rubber columns, one under each bottom vertex; height from board to sheet.",
    "[frame]": "The frame round the sheet, at each column of the rim.",
    "[board]": "The circuit board; the sensing height is that in the chip above its face.",
    "[shear_layer]": "The soft pillars that carry the board, so that a drag moves it.",
    "[[magnets]]": "A magnet of four sectors, on the sheet or the base, at a corner of the cells.",
    "[[halls]]": "A chip opposite its magnet; where its own x, y and z point in the skin's axes.",
    "[hall_setting]": "Registers of all MLX90393: GAIN_SEL, RES, OSR and DIG_FILT.",
    "[coefficients]": "What calibration finds for the paper's model; keep them to begin with.",
}


def new_design(
    name: str, base: str = "planar", cells: str | None = None, remanence: float | None = None
) -> str:
    """The commented TOML document of a new design of this name.

    Parameters
    ----------
    base : str
        Name or path of the design that it starts from.
    cells : str, optional
        Cells along x and y, such as ``6x8``; magnets move with them to the nearest corner.
    remanence : float, optional
        T: that of the magnets at hand, for which gaps and gain are chosen
        (`smoskin.feasibility.suited_to`).

    Raises
    ------
    ArgumentError
        If the cells are no two numbers, or the remanence is no permanent magnet's.
    DesignError
        If there is no such base, or the new design cannot be built or read by its chips.
    """
    old = load_design(base)
    design = replace(old, name=name, provenance={})
    if cells is not None:
        design = _resized(design, _size(cells))
    if remanence is not None:
        design = suited_to(design, remanence / VACUUM_PERMEABILITY)
    check_design(design)
    text = format_design(design)
    for line, meaning in _PARTS.items():
        head = re.escape(line) if line.startswith("[") else rf"{line} = .*"
        text = re.sub(rf"^({head})$", rf"# {meaning}\n\1", text, flags=re.M)
    title = f"# Begun from {old.name!r}. Check it by smoskin info, then make its response table:\n"
    return f"{title}# smoskin table FILE. What a value may be is said where it is wrong.\n{text}"


def _size(text: str) -> tuple[int, int]:
    """Cells along x and y of a text such as 6x8."""
    match = re.fullmatch(r"(\d{1,2})x(\d{1,2})", text)
    if match is None:
        raise ArgumentError(f"cells must be two numbers such as 6x8; got {text[:50]!r}")
    return int(match[1]), int(match[2])


def _resized(design: SkinDesign, cells: tuple[int, int]) -> SkinDesign:
    """The design of so many cells, its magnets at the nearest corner of the same share."""
    magnets = tuple(
        replace(
            magnet,
            corner=(
                round(magnet.corner[0] * cells[0] / design.cells[0]),
                round(magnet.corner[1] * cells[1] / design.cells[1]),
            ),
        )
        for magnet in design.magnets
    )
    return replace(design, cells=cells, magnets=magnets)
