"""Guided cover panels in place of scales: free until pressed, stopped before they are driven."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import DesignError
from smoskin.fabrication.moulds import assembly
from smoskin.fabrication.moulds.covers import (
    PLAY,
    STROKE,
    bush_length,
    covers,
    guide,
    panel_size,
)
from smoskin.fabrication.moulds.files import printed_parts
from smoskin.fabrication.moulds.sheet import folded_panels
from smoskin.fabrication.moulds.solids import Part
from smoskin.fabrication.moulds.tools import tools
from smoskin.fabrication.pattern.flat import flat_sheet
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from solid_overlaps import overlaps

SHOP = Workshop(top="covers")


@pytest.mark.parametrize("name", ["planar", pytest.param("curved", marks=pytest.mark.slow)])
def test_covers_stand_in_their_guide_and_touch_nothing(name, request):
    design = request.getfixturevalue(name)
    over = assembly.top(design, SHOP)
    rim = [assembly.frame(design), *assembly.columns(design, SHOP)]
    parts = [*over, *rim, *folded_panels(design, flat_sheet(design, SHOP), SHOP)]
    assert len(over) == 37
    assert overlaps(parts) == {}
    lattice = over[0].solid
    assert len(lattice.decompose()) == 1
    for cover in over[1:]:
        assert cover.solid.min_gap(lattice, 2e-3) == pytest.approx(PLAY, abs=0.01e-3)
    assert lattice.min_gap(rim[0].solid, 1e-3) == pytest.approx(0.0, abs=2e-5)  # it stands on it


def test_a_cover_sinks_by_its_stroke_and_is_stopped_by_the_guide(planar):
    lattice, cover = guide(planar, SHOP).solid, covers(planar, SHOP)[14]
    low = cover.solid.translate((0.0, 0.0, -0.99 * STROKE))
    driven = cover.solid.translate((0.0, 0.0, -1.05 * STROKE))
    assert (low ^ lattice).volume() == 0.0
    assert (driven ^ lattice).volume() > 1e-12


def test_bars_do_not_bind_under_a_touch_on_a_corner(planar):
    """Friction of both ends of a bush under a force at the panel's corner is less than it."""
    arm = np.hypot(*panel_size(planar, SHOP)) / 2
    side = arm / bush_length(planar, SHOP)
    assert 2 * 0.2 * side <= 1.0 + 1e-12


def test_a_bundle_with_covers_has_them_and_no_mould_of_scales(planar):
    parts = {part.name: part for part in printed_parts(planar, SHOP)}
    assert (parts["cover"].quantity, parts["guide"].quantity) == (36, 1)
    names = {part.name for part in tools(planar, SHOP, flat_sheet(planar, SHOP))}
    assert "scale_mould" not in names
    low, high = np.array(parts["cover"].solid.bounding_box()).reshape(2, 3)
    assert low[2] == pytest.approx(0.0, abs=1e-9)
    # It is printed on its panel, the bar upward.
    cut = parts["cover"].solid.slice(0.1e-3).area()
    assert cut == pytest.approx(np.prod(panel_size(planar, SHOP)), rel=1e-6)
    assert high[2] > 8e-3


def test_cells_smaller_than_bushes_are_refused(planar):
    cell = replace(planar.cell, panel_a=5e-3, panel_b=4.6e-3)
    with pytest.raises(DesignError, match=r"0.80 mm between the bushes.*6.5 mm wide; got"):
        guide(replace(planar, cell=cell), SHOP)


@pytest.mark.slow
@pytest.mark.parametrize("cell", [(0, 0), (3, 2)])
def test_presses_of_1_n_move_covers_within_their_play(planar, cell):
    pytest.importorskip("jax")
    from smoskin.mechanics.sheet.touches import Covered
    from smoskin.twin.whole import Twin

    twin, skin = Twin(planar, seed=None, grip=Covered()), geometry(planar)
    press = [Contact(position=skin.tops[cell], force=(0.0, 0.0, -1.0))]
    vertices = twin.sheet_vertices(press)
    moved = (vertices - skin.sheet.vertices)[skin.sheet.loaded].reshape(-1, 3)
    assert np.hypot(moved[:, 0], moved[:, 1]).max() < PLAY
    assert 0.1e-3 < -moved[:, 2].min() < STROKE
    tops = [
        Part(name=part.name, title="", solid=part.solid.translate(tuple(by)))
        for part, by in zip(covers(planar, SHOP), moved.tolist(), strict=True)
    ]
    sheet = folded_panels(planar, flat_sheet(planar, SHOP), SHOP, vertices=vertices)
    assert overlaps([*tops, guide(planar, SHOP), *sheet]) == {}
