"""Pictures show what they are given, where it is, in millimetres."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse

from smoskin.errors import ArgumentError
from smoskin.origami.pattern import CreasePattern, broken_rules
from smoskin.plots import draw_map, draw_pattern, draw_readings, draw_skin, draw_touches
from smoskin.records import Contact, Estimate, Reading, Status


@pytest.fixture
def axes():
    return Figure().add_subplot()


def test_a_skin_has_its_magnets_where_they_are(planar, axes):
    draw_skin(planar, axes)
    middles = [patch.center for patch in axes.patches if isinstance(patch, Circle)]
    corners = [magnet.corner for magnet in planar.magnets]
    np.testing.assert_allclose(middles, np.array(corners) * [20.0, 160 / 6], atol=1e-3)


def test_the_region_of_a_touch_holds_ninety_per_cent(planar, axes):
    covariance = np.zeros((1, 5, 5))
    covariance[0, :2, :2] = [[4e-6, 1.5e-6], [1.5e-6, 1e-6]]
    touch = Contact(position=(0.03, 0.05), force=(0.0, 0.0, -1.0))
    draw_touches(
        axes,
        Estimate(time=0.0, status=Status.CONTACT, contacts=(touch,), covariance=covariance),
    )
    (region,) = [patch for patch in axes.patches if isinstance(patch, Ellipse)]
    rng = np.random.default_rng(0)
    drawn = 1e3 * rng.multivariate_normal(touch.position, covariance[0, :2, :2], 20_000)
    turn = np.radians(region.angle)
    along = (drawn - region.center) @ [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    inside = np.hypot(along[:, 0] / region.width, along[:, 1] / region.height) < 0.5
    assert abs(inside.mean() - 0.9) < 0.01


def test_drags_are_arrows_along_the_drag(planar, axes):
    draw_touches(axes, [Contact(position=(0.03, 0.05), force=(0.5, 0.0, -1.0))])
    (arrow,) = axes.texts
    assert arrow.xyann == pytest.approx((30.0, 50.0))
    assert arrow.xy == pytest.approx((40.0, 50.0))


def test_a_pattern_rings_the_vertices_that_break_a_rule_and_says_which():
    places = np.array([[0.0, 0.0], [1, 0], [0, 1], [-1, 0], [0, -1]])
    edges = [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]]
    pattern = CreasePattern(vertices=places, edges=edges, assignments=tuple("MVMVBBBB"))
    (axes,) = draw_pattern(pattern, broken_rules(pattern), "cross").axes
    (ring,) = axes.lines
    assert (ring.get_xdata(), ring.get_ydata()) == ([0.0], [0.0])
    assert [text.get_text() for text in axes.texts] == ["0"]
    assert axes.get_xlabel() == "0  Maekawa: 2 mountains and 2 valleys, which are not two apart"
    assert [len(lines.get_segments()) for lines in axes.collections] == [2, 2, 4]
    (whole,) = draw_pattern(pattern, (), "cross").axes
    assert (len(whole.lines), whole.get_xlabel()) == (0, "")


def test_a_map_shows_values_from_rim_to_rim(planar, axes):
    values = np.arange(12.0).reshape(3, 4)
    draw_map(planar, values, axes, label="error (mm)")
    (image,) = axes.images
    left, right, low, high = image.get_extent()
    # The outermost values lie on the rim: half a step of the grid stands beyond it.
    assert (left, right) == pytest.approx((-30.0, 150.0), abs=1e-3)
    assert (low, high) == pytest.approx((-160 / 6, 160 + 160 / 6), abs=1e-3)
    np.testing.assert_array_equal(image.get_array(), values.T)


def test_a_value_a_cell_fills_the_cells(planar, axes):
    draw_map(planar, np.zeros(planar.cells), axes)
    assert axes.images[0].get_extent() == pytest.approx((0.0, 120.0, 0.0, 160.0), abs=1e-3)


def test_readings_are_shown_in_microtesla_from_the_first(axes):
    readings = [Reading(time=t, field=np.full((2, 3), 1e-3 + 1e-6 * t)) for t in (0.0, 1.0, 2.0)]
    draw_readings(readings, axes)
    assert len(axes.lines) == 6
    np.testing.assert_allclose(axes.lines[0].get_ydata(), [0.0, 1.0, 2.0], atol=1e-9)


def test_a_map_needs_a_grid(planar, axes):
    with pytest.raises(ArgumentError, match="values must have shape"):
        draw_map(planar, np.zeros(5), axes)
