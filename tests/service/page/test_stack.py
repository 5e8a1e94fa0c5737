"""What a skin is stacked of: frame, scales, and how its parts are lifted off each other."""

import numpy as np
import pytest

from pages import PLANAR, SHEET, SKIN, TOUCH, TOUCHED, reading
from smoskin.feasibility import load_design
from smoskin.origami.geometry import geometry

pytest.importorskip("viser")
from smoskin.service.page.scene import Moment
from smoskin.service.page.stack import LEVELS, Scales, frame
from smoskin.service.page.view import View

ORDER = ("/board", "/frame", "/columns", "/magnets", "/sheet", "/scales")


def volume(places, faces):
    """Volume inside closed triangles, by the divergence theorem; its sign is their sense's."""
    a, b, c = np.moveaxis(places[faces], 1, 0)
    return abs(np.einsum("ti,ti->t", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_the_frame_goes_round_the_outer_columns_as_high_as_it_holds_them(name):
    design = load_design(name)
    skin = geometry(design)
    places, _ = frame(design)
    around = skin.roll.developed(places)
    foot = -design.columns.height
    heights = [foot, foot + design.frame.held_height]
    np.testing.assert_allclose(np.unique(around[:, 2].round(7)), heights, atol=1e-7)
    columns = skin.developed[skin.sheet.columns.ravel(), :2]
    reach = design.columns.radius + design.frame.clearance
    inner = columns.min(axis=0) - reach, columns.max(axis=0) + reach
    # No part of the wall is nearer to the columns than its clearance, none farther than 3 mm more.
    outside = np.maximum(inner[0] - around[:, :2], around[:, :2] - inner[1])
    assert outside.max(axis=1).min() > -1e-9
    assert outside.max() == pytest.approx(3e-3)


def test_a_flat_frame_has_the_volume_of_its_wall():
    places, faces = frame(PLANAR)
    low, high = places.min(axis=0), places.max(axis=0)
    outer, inner = high[:2] - low[:2], high[:2] - low[:2] - 6e-3
    wall = (outer.prod() - inner.prod()) * PLANAR.frame.held_height
    middle = (low + high) / 2
    parts = [faces[k : k + len(faces) // 4] for k in range(0, len(faces), len(faces) // 4)]
    assert sum(volume(places - middle, part) for part in parts) == pytest.approx(wall)


@pytest.mark.parametrize("name", ["planar", "curved"])
def test_a_scale_lies_over_each_cell_and_goes_along_with_its_top(name):
    design = load_design(name)
    skin = geometry(design)
    scales = Scales(design)
    rest = scales.places(skin.sheet.vertices).reshape(-1, 8, 3)
    tops = skin.sheet.vertices[skin.sheet.loaded.ravel()]
    assert len(rest) == np.prod(design.cells)
    normals = skin.axes[skin.sheet.loaded.ravel()][..., 2]
    over = np.einsum("tbi,ti->tb", rest - tops[:, None], normals)
    assert over.min() > 0.5e-3  # clear of the ridges
    assert set(scales.triangles.ravel()) == set(range(8 * len(rest)))
    moved = skin.sheet.vertices.copy()
    moved[skin.sheet.loaded[2, 1]] += (1e-3, 0.0, -2e-3)
    shift = scales.places(moved).reshape(-1, 8, 3) - rest
    pressed = np.ravel_multi_index((2, 1), design.cells)
    np.testing.assert_allclose(shift[pressed], np.tile((1e-3, 0.0, -2e-3), (8, 1)), atol=1e-12)
    assert not np.delete(shift, pressed, axis=0).any()


def test_taken_apart_the_parts_stand_over_each_other_in_their_order_with_words():
    with View(PLANAR) as view:
        scene, drawn = view._scene, view._server.scene._handle_from_node_name
        cover = drawn["/scales"]
        assert not cover.visible
        assert not any(drawn[f"/words/{part}"].visible for part in LEVELS)
        scene.spread(0.0, True)
        assert cover.visible
        scene.spread(1.0, False)
        heights = [drawn[name].position[2] for name in ORDER]
        assert np.diff(heights).min() > 1.0  # cm
        assert cover.visible
        assert drawn["/chips"].position[2] == drawn["/rulers"].position[2] == heights[0]
        assert drawn["/estimated"].position[2] == drawn["/creases"].position[2] == heights[4]
        words = [drawn[f"/words/{part}"] for part in LEVELS]
        assert all(word.visible for word in words)
        assert (np.diff([word.position[2] for word in words]) > 0.5).all()
        based = next(k for k, part in enumerate(PLANAR.magnets) if part.mount == "base")
        at = drawn[f"/magnets/{based}"].position[2] + heights[3]
        assert at < heights[0] + 100 * SKIN.magnets[based, 2]
        # A pointer meets the sheet where it is drawn.
        cell = SKIN.tops[3, 2]
        lifted = np.array([*cell, SHEET.vertices[:, 2].max() + heights[4] / 100 + 0.1]) * 100
        np.testing.assert_allclose(scene.place_under(lifted, (0.0, 0.0, -1.0)), cell, atol=1e-3)
        scene.draw(Moment(reading(), TOUCHED, (TOUCH,), None, 0.0, 0.0), 1.0, 1.0, np.zeros((0, 2)))
        scene.spread(0.0, False)
        assert not np.any([drawn[name].position for name in ORDER])
        assert not cover.visible
