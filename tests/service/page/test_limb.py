"""A skin on a limb as the page draws it."""

import numpy as np
import pytest

from smoskin.design.document import read_design
from smoskin.origami.geometry import geometry
from smoskin.records import Contact

pytest.importorskip("viser")
from smoskin.service.page.markers import attitude
from smoskin.service.page.scene import pick
from smoskin.service.page.stack import BOARD_DRAWN, board
from smoskin.service.page.view import View

CURVED = read_design("curved")
SKIN = geometry(CURVED)
AXIS = np.array([0.0, SKIN.extent[1] / 2, -CURVED.limb.skin_radius])


def test_the_board_is_a_shell_round_the_limb():
    places, faces = board(CURVED)
    radii = np.linalg.norm((places - AXIS)[:, 1:], axis=1)
    top = CURVED.limb.skin_radius - CURVED.columns.height
    np.testing.assert_allclose(np.unique(radii.round(9)), [top - BOARD_DRAWN, top])
    assert set(faces.ravel()) == set(range(len(places)))


def test_a_ray_along_the_normal_finds_the_place_it_comes_from():
    for place in ([0.05, 0.02], [0.1, 0.15]):
        inward = SKIN.roll.axes(place[1])[:, 2]
        start = SKIN.roll.places([*place, 0.05])
        picked = pick(CURVED, SKIN.sheet.vertices, start, -inward)
        np.testing.assert_allclose(picked, place, atol=3e-3)  # a sheet's ridges are not its mean


def test_marks_stand_on_the_limb_and_point_inwards():
    with View(CURVED) as view:
        scene = view._scene
        touch = Contact(position=(0.05, 0.02), force=(0.0, 0.0, -0.5))
        scene._mark("/true", [touch], np.full((1, 2, 2), np.nan))
        mark = scene._markers["/true"][0]._root
    radius = np.linalg.norm(np.array(mark.position)[1:] / 100 - AXIS[1:])
    height = radius - CURVED.limb.skin_radius
    assert 0.8 * SKIN.cell.height < height < 1.2 * SKIN.cell.height + 1e-3
    w, x, y, z = mark.wxyz
    turn = 2 * np.arctan2(x, w)
    assert (y, z) == (0, 0)
    assert turn == pytest.approx(-(0.02 - SKIN.extent[1] / 2) / CURVED.limb.skin_radius)
    assert attitude(np.eye(3)) == (1.0, 0.0, 0.0, 0.0)
