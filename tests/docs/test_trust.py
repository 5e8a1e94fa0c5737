"""The page on what figures are worth shows them as measured, for every effect that there is."""

import json
import runpy
from pathlib import Path

MAKE = Path(__file__).parents[2] / "docs" / "make_trust.py"


def test_the_page_shows_the_figures_as_they_are():
    made = runpy.run_path(str(MAKE))
    figures = json.loads(made["FIGURES"].read_text())
    text = made["PAGE"].read_text(encoding="utf-8")
    assert made["page"](text, figures) == text, "run python docs/make_trust.py"
    assert made["PLOT"].exists()


def test_every_effect_has_a_row():
    from smoskin.twin.world.worlds import EFFECTS

    made = runpy.run_path(str(MAKE))
    assert set(EFFECTS) | {"plain", "hard"} <= set(made["TOLD"])
    assert set(EFFECTS) | {"plain", "hard"} <= set(json.loads(made["FIGURES"].read_text()))
