"""Where magnets, chips and vertices stand, against the drawing; one object for everyone."""

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from smoskin.origami.geometry import Roll, geometry, middles_of_fields, places_to_the_rim


@pytest.mark.parametrize("skin", ["planar", "long_planar"])
def test_places_are_those_of_the_drawing(skin, request):
    design = request.getfixturevalue(skin)
    places, cell = geometry(design), geometry(design).cell
    columns, rows = design.cells
    assert_allclose(places.extent, [columns * cell.length, rows * cell.width], rtol=1e-15)
    assert places.tops.shape == (columns, rows, 2)
    for n, m in np.ndindex(columns, rows):
        assert_allclose(places.tops[n, m], [(n + 0.5) * cell.length, (m + 0.5) * cell.width])
    for magnet, place in zip(design.magnets, places.magnets, strict=True):
        p, q = magnet.corner
        assert_allclose(place[:2], [p * cell.length, q * cell.width], rtol=1e-15)


def test_a_magnet_of_the_sheet_hangs_above_its_chip_and_one_of_the_base_lies_below(planar):
    places, board = geometry(planar), planar.board
    faces = {"sheet": -planar.columns.height, "base": -planar.columns.height - board.thickness}
    mounts = set()
    for s, site in enumerate(planar.halls):
        magnet = planar.magnet(site.magnet)
        side = 1 if magnet.mount == "sheet" else -1
        mounts.add(magnet.mount)
        # From the board's face out: the sensing point, then the gap, then half the magnet.
        point = faces[magnet.mount] + side * board.sensing_height
        middle = point + side * (site.gap + magnet.height / 2)
        g = planar.magnets.index(magnet)
        assert places.chips[s, 2] == pytest.approx(point, rel=1e-12)
        assert places.magnets[g, 2] == pytest.approx(middle, rel=1e-12)
        assert_allclose(places.rest[s], [0.0, 0.0, point - middle], rtol=1e-12)
        assert_allclose(places.chips[s] - places.magnets[g], places.rest[s], atol=1e-15)
    assert mounts == {"sheet", "base"}


def test_a_magnet_that_no_chip_watches_lies_as_high_as_one_of_its_mount(planar):
    watched = planar.magnet(planar.halls[-1].magnet)
    extra = replace(watched, name="extra", corner=(1, 1))
    places = geometry(replace(planar, magnets=(*planar.magnets, extra)))
    assert places.magnets[-1, 2] == geometry(planar).magnets[planar.magnets.index(watched), 2]


def test_the_reference_skin_is_as_large_as_printed(planar):
    places = geometry(planar)
    assert_allclose(places.extent, [0.120, 0.160], atol=1e-6)
    assert_allclose(
        places.tops[[0, 5], [0, 5]], [[0.010, 0.16 / 12], [0.110, 1.76 / 12]], atol=1e-6
    )
    assert places.chips[0, 2] < -planar.columns.height < places.chips[1, 2] < 0.0


def test_it_is_computed_once_and_cannot_be_written_to(planar):
    places = geometry(planar)
    assert geometry(replace(planar, name=planar.name)) is places
    assert geometry(replace(planar, cells=(5, 6))) is not places
    arrays = [places.extent, places.tops, places.magnets, places.chips, places.rest]
    for array in [*arrays, *(getattr(places.sheet, field.name) for field in fields(places.sheet))]:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_grids_of_places():
    extent = np.array([0.12, 0.16])
    rim = places_to_the_rim(extent, (3, 2))
    assert_allclose(rim * 1e3, [[0, 0], [0, 160], [60, 0], [60, 160], [120, 0], [120, 160]])
    assert_array_equal(rim[:2, 0], 0.0)
    middles = middles_of_fields(extent, (2, 2))
    assert_allclose(middles * 1e3, [[30, 40], [30, 120], [90, 40], [90, 120]])


@pytest.mark.parametrize(
    ("curvature", "rise"),
    [(0.0, 0.0), (0.5, 0.0), (12.5, 0.0), (-10.0, 0.0), (12.5, 0.17), (9.0, -0.4)],
)
def test_developed_places_come_back_from_the_skins_frame(curvature, rise):
    roll = Roll(curvature=curvature, middle=0.08, along=0.02, rise=rise)
    rng = np.random.default_rng(4)
    places = rng.uniform([-0.1, -0.05, -0.02], [0.1, 0.2, 0.02], size=(50, 3))
    assert_allclose(roll.developed(roll.places(places)), places, atol=1e-12)
    step = 1e-6
    for k, axis in enumerate(np.moveaxis(roll.axes(places[:, 1]), -1, 0)):
        ends = [roll.places(places + side * step * np.eye(3)[k]) for side in (1, -1)]
        way = (ends[0] - ends[1]) / (2 * step)
        assert_allclose(way / np.linalg.norm(way, axis=1, keepdims=True), axis, atol=1e-9)


@pytest.mark.parametrize("rise", [0.0, 0.03, -0.2, 0.5])
@pytest.mark.parametrize("level", [0.0, -0.0135, 0.01])
def test_layers_are_laid_flat_without_stretch(rise, level):
    roll = Roll(curvature=1 / 0.08, middle=0.05, along=0.04, rise=rise)
    rng = np.random.default_rng(5)
    places = rng.uniform([0.0, -0.05], [0.08, 0.15], (60, 2))
    flat = roll.flat(places, level)
    assert_allclose(roll.from_flat(flat, level), places, atol=1e-15)

    def on_limb(developed):
        return roll.places(np.concatenate([developed, np.full((60, 1), level)], axis=1))

    for step in 1e-6 * np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -2.0]]):
        there, here = (
            np.linalg.norm(lay(places + step) - lay(places - step), axis=1)
            for lay in (on_limb, lambda at: roll.flat(at, level))
        )
        assert_allclose(here, there, rtol=1e-8)


@pytest.mark.parametrize("skin", ["planar", "curved", "small_cone"])
def test_chips_lie_as_their_flat_circuit_is_rolled(skin, request):
    """Parallel on it, and where the board's layout has them."""
    design = request.getfixturevalue(skin)
    places = geometry(design)
    roll, chips = places.roll, places.roll.developed(places.chips)
    for (x, y, level), axes in zip(chips, places.chip_axes, strict=True):
        middle = roll.flat([x, y], level)
        for k, step in enumerate(1e-6 * np.eye(2)):
            ends = [[*roll.from_flat(middle + side * step, level), level] for side in (-1, 1)]
            along = np.diff(roll.places(ends), axis=0)[0] / 2e-6
            assert_allclose(axes[:, k], along, atol=1e-8)
        assert_allclose(axes.T @ axes, np.eye(3), atol=1e-15)
        assert_allclose(axes[:, 2], roll.axes(y)[:, 2], atol=1e-15)
