"""What the scene holds: rulers, marks, trail and parts, measured where they are drawn.

The scene is in centimetres. What the legend promises (50 mm a newton, the 95 % ellipse, creases
darkest at 0.2 mm) is measured on what is drawn.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from pages import PLANAR, SHEET, SKIN, TOUCH, TOUCHED, reading
from smoskin.mechanics.sheet.touches import FINGERTIP
from smoskin.records import Contact, Estimate, Status
from smoskin.service.page.markers import arrow, ellipse
from smoskin.service.page.scene import (
    CREASE,
    ESTIMATED,
    SUNK,
    TRUE,
    Moment,
    camera,
    creases,
)
from smoskin.service.page.view import View

LOW, HIGH = SHEET.vertices.min(axis=0) * 100, SHEET.vertices.max(axis=0) * 100
BASE = -PLANAR.columns.height * 100
PAPER = np.array((247, 226, 186))
NONE = np.zeros((0, 2))


@pytest.fixture
def scene():
    with View(PLANAR) as view:
        yield view._scene


def nodes(scene):
    """Everything drawn, by its name."""
    return scene._server.scene._handle_from_node_name


def draw(scene, estimate=TOUCHED, truth=(), vertices=None, magnified=1.0, opacity=1.0, trail=NONE):
    moment = Moment(reading(), estimate, tuple(truth), vertices, 0.0, 0.0)
    scene.draw(moment, magnified, opacity, trail)
    return nodes(scene)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_ruler_beside_the_skin_has_a_tick_every_10_mm_and_a_number_every_20(scene, axis):
    extent = SKIN.extent[axis] * 100
    drawn = nodes(scene)
    lines = drawn["/rulers/lines"].points
    np.testing.assert_allclose(lines[..., 2], BASE, atol=1e-6)  # as high as the board's top
    along = lines[np.abs(lines[:, 0, axis] - lines[:, 1, axis]) > 0.5]
    np.testing.assert_allclose(along[1:, 0], along[:-1, 1], atol=1e-5)  # piece by piece
    line = np.stack([along[0, 0], along[-1, 1]])
    np.testing.assert_allclose(line[:, axis], [0, extent], atol=1e-5)
    # It stands off the board, which reaches beyond the frame, by less than half a tick.
    beside = line[0, 1 - axis]
    assert beside == line[1, 1 - axis]
    edge = drawn["/board"].vertices[:, 1 - axis].min()
    assert edge - 0.5 < beside < edge - 0.2
    other = lines[np.abs(lines[:, 0, 1 - axis] - lines[:, 1, 1 - axis]) > 0.5][0, 0, axis]
    assert drawn["/board"].vertices[:, axis].min() - other == pytest.approx(edge - beside, abs=1e-5)
    ticks = lines[
        np.isclose(lines[:, 0, 1 - axis], beside) & (lines[:, 0, axis] == lines[:, 1, axis])
    ]
    at = np.arange(round(extent) + 1.0)  # both sides are whole centimetres
    np.testing.assert_allclose(np.sort(ticks[:, 0, axis]), at, atol=1e-5)
    length = beside - ticks[np.argsort(ticks[:, 0, axis]), 1, 1 - axis]
    assert (length > 0.1).all()
    assert 1.5 < length[::2].min() / length[1::2].max() < 2  # numbered ones are the longer ones
    name = "xy"[axis]
    numbers = {key: node for key, node in drawn.items() if key.startswith(f"/rulers/{name}")}
    title = numbers.pop(f"/rulers/{name}")
    assert {node.text: node.position[axis] for node in numbers.values()} == pytest.approx(
        {f"{10 * tick:.0f}": tick for tick in at[::2]}
    )
    # The title stands between two numbers next to the middle, further out than they are.
    assert title.text == f"{name}, mm"
    assert title.position[axis] % 2 == pytest.approx(1.0)
    assert abs(title.position[axis] - extent / 2) <= 1.01
    outwards = {round(beside - node.position[1 - axis], 6) for node in numbers.values()}
    assert len(outwards) == 1
    assert length.max() + 0.2 < outwards.pop() < beside - title.position[1 - axis] - 0.5 < 1.5


@pytest.mark.parametrize("force", [(0.0, 0.0, -1.0), (0.3, 0.0, -0.4), (0.1, -0.2, 0.2)])
@pytest.mark.parametrize("girth", [1.0, 0.7])
def test_an_arrow_is_50_mm_long_a_newton_and_has_a_head(force, girth):
    force = np.array(force)
    size = np.linalg.norm(force)
    vertices, _ = arrow(force, girth)
    along = vertices @ force / size
    # A press ends at the contact, a pull begins there.
    ends = (0.0, 5 * size) if force[2] > 0 else (-5 * size, 0.0)
    np.testing.assert_allclose((along.min(), along.max()), ends, atol=1e-9)
    off = np.linalg.norm(vertices - np.outer(along, force / size), axis=1)
    widest = along[np.isclose(off, off.max())]
    shaft = off[
        np.isclose(along, along[np.isclose(off, off.max())].min()) & (off < 0.9 * off.max())
    ]
    assert np.ptp(widest) < 1e-9
    assert 2 < off.max() / shaft.max() < 3
    assert off.max() == pytest.approx(0.34 * girth)
    # The head is as long as it is wide or longer, but at most half of the arrow.
    head = along.max() - widest[0]
    assert 2 * off.max() < head <= min(2.5 * off.max(), 2.5 * size) or head == pytest.approx(
        2.5 * size
    )


def test_the_ellipse_holds_95_percent():
    covariance = np.array([[4.0, 1.5], [1.5, 2.0]]) * 1e-6
    points = ellipse(covariance)
    np.testing.assert_array_equal(points[:-1, 1], points[1:, 0])  # closed
    np.testing.assert_allclose(points[-1, 1], points[0, 0], atol=1e-12)
    assert not points[..., 2].any()
    flat = points[:, 0, :2] / 100
    squared = np.einsum("pi,ij,pj->p", flat, np.linalg.inv(covariance), flat)
    np.testing.assert_allclose(squared, chi2.isf(0.05, 2), rtol=1e-4)
    assert len({tuple(place) for place in flat.round(9)}) == len(flat) >= 48


def test_a_touch_is_marked_where_it_is_and_the_truth_shows_round_it(scene):
    drawn = draw(scene, truth=[TOUCH])
    height = scene._height(TOUCH.position) * 100
    for name in ("/estimated/0", "/true/0"):
        place = drawn[name].position
        np.testing.assert_allclose(place[:2], TOUCH.position * 100)
        assert 0 < place[2] - height < 0.1  # over the sheet by less than a millimetre
        assert drawn[name].visible
    estimate, truth = (drawn[f"{name}/0/disc"] for name in ("/estimated", "/true"))
    # A disc is about a fingertip; that of the truth shows round the estimate's, its arrow within.
    assert estimate.radius == pytest.approx(FINGERTIP * 100, rel=0.25)
    assert 1.2 < truth.radius / estimate.radius < 1.5
    assert estimate.height == truth.height < 0.03
    assert (estimate.color, truth.color) == (ESTIMATED, TRUE)
    assert truth.opacity < 0.5 < estimate.opacity < 1
    thick = {
        name: np.ptp(drawn[f"{name}/0/arrow"].vertices, axis=0)[0]
        for name in ("/estimated", "/true")
    }
    assert thick["/true"] < thick["/estimated"]
    assert drawn["/estimated/0/arrow"].opacity is None
    assert drawn["/true/0/arrow"].opacity == truth.opacity
    # Only the estimate has a spread and a label, which stands over the arrow's tail.
    assert drawn["/estimated/0/ellipse"].visible
    assert not drawn["/true/0/ellipse"].visible
    label = drawn["/estimated/0/label"]
    assert label.visible
    assert label.text == f"F {np.linalg.norm(TOUCH.force):.2f} N"
    over = np.array(label.position) + 5 * TOUCH.force
    np.testing.assert_allclose(over[:2], 0, atol=1e-9)
    assert 0.2 < over[2] < 0.5
    assert not drawn["/true/0/label"].visible
    assert {drawn[f"{name}/0/arrow"].side for name in ("/true", "/estimated")} == {"double"}
    draw(scene, Estimate(time=0.0, status=Status.NO_CONTACT))
    assert not drawn["/estimated/0"].visible
    assert not drawn["/true/0"].visible


def test_marks_without_force_or_spread_are_discs_alone(scene):
    touch = Contact(position=TOUCH.position, force=(0.0, 0.0, 0.0))
    unknown = np.full((1, 5, 5), np.nan)
    drawn = draw(
        scene,
        Estimate(time=0.0, status=Status.CONTACT, contacts=(touch,), covariance=unknown),
    )
    assert drawn["/estimated/0"].visible
    assert not drawn["/estimated/0/arrow"].visible
    assert not drawn["/estimated/0/ellipse"].visible


def test_the_trail_pales_with_age(scene):
    assert not len(nodes(scene)["/trail"].points)
    places = np.linspace((0.02, 0.03), (0.08, 0.10), 20)
    dots = draw(scene, trail=places)["/trail"]
    np.testing.assert_allclose(dots.points[:, :2], places * 100, rtol=1e-3)
    heights = [scene._height(place) * 100 for place in places]
    assert (dots.points[:, 2] - heights > 0).all()
    colors = dots.colors.astype(int)
    np.testing.assert_array_equal(colors[-1], ESTIMATED)
    paled = (colors[0] - ESTIMATED) / (PAPER - ESTIMATED)
    assert ((paled > 0.5) & (paled < 0.95)).all()  # still seen on the paper
    assert (np.diff(colors, axis=0) < 0).all()
    assert not len(draw(scene)["/trail"].points)


@pytest.mark.parametrize("magnified", [1.0, 10.0])
def test_what_sinks_is_drawn_larger_than_life_with_what_hangs_on_it(scene, magnified):
    moved = np.zeros_like(SHEET.vertices)
    moved[:, 0], moved[:, 2] = 0.3e-3, -0.1e-3
    rest = {
        name: np.array(node.position) for name, node in nodes(scene).items() if "magnets" in name
    }
    drawn = draw(scene, vertices=SHEET.vertices + moved, magnified=magnified, opacity=0.6)
    step = np.array((0.03, 0.0, -0.01)) * magnified
    np.testing.assert_allclose(drawn["/sheet"].vertices, SHEET.vertices * 100 + step, atol=1e-5)
    assert drawn["/sheet"].opacity == 0.6
    for index, part in enumerate(PLANAR.magnets):
        moving = np.array(drawn[f"/magnets/{index}"].position) - rest[f"/magnets/{index}"]
        if part.mount == "sheet":
            # A hung magnet moves with the sheet, but for the height at which marks stand.
            np.testing.assert_allclose(moving[:2], step[:2], atol=1e-5)
            assert abs(moving[2] - step[2]) < 0.1
        else:
            assert not moving.any()
    lines = drawn["/creases"].points - drawn["/sheet"].vertices[creases(SHEET.facets)]
    assert np.abs(lines[..., :2]).max() < 1e-5
    assert 0 < lines[..., 2].min() <= lines[..., 2].max() < 0.05  # on the sheet, not in it


def test_creases_darken_until_they_sank_by_02_mm(scene):
    def color(depth):
        moved = SHEET.vertices - (0.0, 0.0, depth)
        colors = draw(scene, vertices=moved)["/creases"].colors
        assert (colors == colors[0, 0]).all()
        return colors[0, 0].astype(float)

    def linear(seen):
        return 255 * (np.array(seen) / 255) ** 2.2

    np.testing.assert_allclose(color(0.0), linear(CREASE), atol=1)
    np.testing.assert_allclose(color(0.1e-3), (linear(CREASE) + linear(SUNK)) / 2, atol=1)
    np.testing.assert_allclose(color(0.2e-3), linear(SUNK), atol=1)
    np.testing.assert_allclose(color(0.3e-3), linear(SUNK), atol=1)
    np.testing.assert_allclose(color(-0.3e-3), linear(CREASE), atol=1)


def test_the_board_and_its_chips_lie_under_the_sheet(scene):
    drawn = nodes(scene)
    board = drawn["/board"]
    low, high = board.vertices.min(axis=0), board.vertices.max(axis=0)
    # Past the outer columns: their radius, the frame's clearance, its wall of 3 mm, a rim of 2 mm.
    past = 100 * (PLANAR.columns.radius + PLANAR.frame.clearance) + 0.3 + 0.2
    feet = SHEET.vertices[SHEET.columns.ravel(), :2] * 100
    np.testing.assert_allclose(low, [*feet.min(axis=0) - past, BASE - 0.16], rtol=1e-5)
    np.testing.assert_allclose(high, [*feet.max(axis=0) + past, BASE], rtol=1e-5)
    for site, chip in zip(PLANAR.halls, SKIN.chips, strict=True):
        np.testing.assert_allclose(drawn[f"/chips/{site.name}"].position, chip * 100)
        assert drawn[f"/chips/{site.name}/label"].text == site.name
        assert drawn[f"/chips/{site.name}/label"].depth_test is False  # seen through the sheet
    for index, (part, where) in enumerate(zip(PLANAR.magnets, SKIN.magnets, strict=True)):
        magnet = drawn[f"/magnets/{index}"]
        np.testing.assert_allclose(magnet.position, where * 100)
        assert (magnet.radius, magnet.height) == (part.radius * 100, part.height * 100)
    assert drawn["/sheet"].side == "double"  # seen from below too


@pytest.mark.parametrize(("narrow", "size"), [(False, (1060, 900)), (True, (390, 600))])
def test_the_skin_fills_the_picture_and_stays_in_it(narrow, size):
    eye, target, field_of_view = camera(PLANAR, narrow=narrow)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    ray = SHEET.vertices - eye
    seen = np.stack([ray @ right, ray @ np.cross(right, ahead)], axis=1) / (ray @ ahead)[:, None]
    reach = np.tan(field_of_view / 2) * np.array((size[0] / size[1], 1.0))
    low, high = (seen / reach).min(axis=0), (seen / reach).max(axis=0)
    assert (np.abs([low, high]) < 1).all()
    assert (high - low).max() > 1.0  # of the 2 from edge to edge
    assert (np.abs(low + high) < 0.4).all()  # in the middle
