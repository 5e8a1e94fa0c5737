"""Places of the parts that a design leaves open."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.errors import DesignError
from smoskin.fabrication.layout import column_places, pillar_places
from smoskin.origami.geometry import geometry
from smoskin.origami.outline import board_box, frame_box


def test_the_board_holds_the_frame_and_the_frame_the_columns(planar):
    board, frame = board_box(planar), frame_box(planar)
    assert board.left < frame.left
    assert board.high > frame.high
    places, reach = column_places(planar), planar.columns.radius + planar.frame.clearance
    assert (places - reach > [frame.left, frame.low]).all()
    assert (places + reach < [frame.right, frame.high]).all()
    assert board.size == pytest.approx((0.1392, 0.18934), abs=1e-5)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 13, 20])
def test_pillars_are_as_many_as_designed_clear_of_the_base_s_magnet(planar, count):
    design = replace(planar, shear_layer=replace(planar.shear_layer, pillars=count))
    places = pillar_places(design)
    assert len(places) == count
    magnet = geometry(design).magnets[0, :2]
    room = design.magnets[0].radius + design.shear_layer.radius
    assert np.linalg.norm(places - magnet, axis=1).min() > room
    if count >= 8:
        assert places.mean(axis=0) == pytest.approx(geometry(design).extent / 2, abs=0.02)


def test_a_magnet_in_place_of_a_column_leaves_it_out(planar):
    magnets = (*planar.magnets[:2], replace(planar.magnets[2], driver="vertex"))
    design = replace(planar, magnets=magnets)
    assert len(column_places(design)) == len(column_places(planar)) - 1


def test_pillars_that_meet_are_refused(planar):
    many = replace(planar, shear_layer=replace(planar.shear_layer, pillars=800))
    with pytest.raises(DesignError, match=r"must stand 6.00 mm apart, their diameter; got \d"):
        pillar_places(many)
