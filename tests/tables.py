"""Answers of cells that theory gives, for tests of what is done with measured ones."""

from types import SimpleNamespace

import numpy as np

from smoskin.mechanics.reduced.stiffness import (
    board_stiffness,
    folding_correction_map,
    sheet_stiffness,
    stiffness_map,
)
from smoskin.sensing.closed_form.location import unit_press
from smoskin.sensing.closed_form.measured import CellAnswers


def ideal_answers(design, factor=1.0):
    """Answers of an ideal sheet by S25 to S27; factors (N, M, S, 3) make it another sheet's."""
    chips = len(design.halls)
    upper = np.array([design.magnet(site.magnet).mount == "sheet" for site in design.halls])
    motions = np.zeros((*design.cells, chips, 3, 3))
    stiffness = stiffness_map(design, design.coefficients)[..., None, None]
    press = np.zeros((*design.cells, chips, 3))
    press[:, :, upper, :2] = -unit_press(design) / stiffness
    motions[..., 0] = press * factor
    # Chips move with the board over a magnet of the base; a magnet of the sheet moves ahead.
    slide = np.where(upper, -1 / sheet_stiffness(design), 1 / board_stiffness(design))
    motions[..., 0, 1] = motions[..., 1, 2] = slide
    folding = folding_correction_map(design.cells, design.coefficients)
    return CellAnswers(motions.reshape(*design.cells, -1, 3), folding)


def solve_all(sheet, motions):
    """Touches of many motions at once; cell -1, force and confidence zero where none fits."""
    answers = [sheet.solve(motion) or ((-1, -1), np.zeros(3), 0.0, 0.0) for motion in motions]
    cell, force, confidence, _ = zip(*answers, strict=True)
    return SimpleNamespace(
        cell=np.array(cell), force=np.array(force), confidence=np.array(confidence)
    )
