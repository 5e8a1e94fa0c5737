"""The crease pattern in a browser's origami simulator, which others wrote."""

import json

import pytest

from origami_simulator import folds_to, open_simulator
from smoskin.origami.surface.analytic import Cone
from smoskin.origami.tessellation import documents
from smoskin.origami.tessellation.tessellate import tessellate


@pytest.mark.slow
@pytest.mark.browser
def test_it_folds_to_the_sheet_that_was_attached(planar):
    made = tessellate(Cone(0.06, 0.08, 0.15), planar.cell, (3, 3))
    pattern = json.loads(documents.crease_pattern(made, "a skin"))
    with open_simulator() as opened:
        opened.page.evaluate("fold => globals.pattern.setFoldData(fold)", pattern)
        assert folds_to(opened, made.sheet.vertices, 0.2e-3) < 0.5
