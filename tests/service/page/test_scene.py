"""The picture: where a ray lands on the drawn sheet, and what is drawn of an estimate."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pages import PLANAR, SHEET, SKIN, pixels
from smoskin.records import Contact
from smoskin.service.page.scene import creases, pick, triangles
from smoskin.service.page.view import View

TRIANGLES = triangles(SHEET.facets)


def test_every_edge_of_the_sheet_is_one_crease() -> None:
    # Euler: V - E + F = 1 for a disc.
    assert len(SHEET.vertices) - len(creases(SHEET.facets)) + len(SHEET.facets) == 1


@given(
    triangle=st.integers(0, len(TRIANGLES) - 1),
    u=st.floats(0.05, 0.9),
    v=st.floats(0.05, 0.9),
    exaggeration=st.floats(0.0, 1.0),
)
def test_a_ray_through_a_point_of_the_sheet_lands_there(
    triangle: int, u: float, v: float, exaggeration: float
) -> None:
    x, y, z = SHEET.vertices.T
    dent = np.exp(-((x - 0.06) ** 2 + (y - 0.08) ** 2) / 0.02**2)
    drawn = np.stack([x, y, z - 3e-3 * exaggeration * dent], axis=-1)
    weights = np.array([1.0 - u, u * (1.0 - v), u * v])
    corners = TRIANGLES[triangle]
    above = weights @ drawn[corners] + (0.0, 0.0, 0.2)
    place = pick(PLANAR, drawn, above, (0.0, 0.0, -3.0))
    assert place is not None
    landed = weights @ SHEET.vertices[corners, :2]
    # The zigzag of the rim reaches beyond the sensing area, where its edge counts.
    np.testing.assert_allclose(place, np.clip(landed, 0.0, SKIN.extent), atol=1e-12)


@given(
    triangle=st.integers(0, len(TRIANGLES) - 1),
    u=st.floats(0.05, 0.9),
    v=st.floats(0.05, 0.9),
    slant=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
)
def test_a_slanted_ray_lands_where_it_meets_the_sheet(triangle, u, v, slant) -> None:
    # Flat: no panel hides another.
    drawn = SHEET.vertices * (1.0, 1.0, 0.0)
    corners = TRIANGLES[triangle]
    weights = np.array([1.0 - u, u * (1.0 - v), u * v])
    landed = weights @ drawn[corners]
    ray = np.array([*slant, 0.7])
    place = pick(PLANAR, drawn, landed + ray, -ray)
    assert place is not None
    np.testing.assert_allclose(place, np.clip(landed[:2], 0.0, SKIN.extent), atol=1e-9)


def test_of_two_panels_one_above_the_other_the_upper_one_is_hit() -> None:
    drawn = SHEET.vertices * (1.0, 1.0, 0.0)
    low, high = drawn[:, 0].min(), drawn[:, 0].max()
    # The right half is folded over the left one, 1 cm above it.
    over = drawn[:, 0] > (low + high) / 2
    drawn[over, 0], drawn[over, 2] = low + high - drawn[over, 0], 0.01
    flat = SHEET.vertices * (1.0, 1.0, 0.0)
    x, y = 0.25 * low + 0.75 * high + 2e-3, flat[:, 1].mean() + 3e-3
    mirrored = low + high - x
    upper = pick(PLANAR, drawn, (mirrored, y, 0.1), (0.0, 0.0, -1.0))
    lower = pick(PLANAR, drawn, (mirrored, y, -0.1), (0.0, 0.0, 1.0))
    np.testing.assert_allclose(upper, (x, y), atol=2e-3)
    np.testing.assert_allclose(lower, (mirrored, y), atol=2e-3)


def test_a_ray_along_the_sheet_lands_nowhere() -> None:
    flat = SHEET.vertices * (1.0, 1.0, 0.0)
    assert pick(PLANAR, flat, (-1.0, 0.08, 0.0), (1.0, 0.0, 0.0)) is None


def test_a_ray_past_the_sheet_or_away_from_it_lands_nowhere() -> None:
    assert pick(PLANAR, SHEET.vertices, (0.5, 0.5, 0.1), (0.0, 0.0, -1.0)) is None
    assert pick(PLANAR, SHEET.vertices, (0.06, 0.08, 0.1), (0.0, 0.0, 1.0)) is None


def test_a_press_on_the_rim_counts_inside_the_extent() -> None:
    top = float(SHEET.vertices[:, 1].max())
    assert top > SKIN.extent[1]
    place = pick(PLANAR, SHEET.vertices, (1e-3, top - 2e-3, 0.1), (0.0, 0.0, -1.0))
    assert place is not None
    np.testing.assert_allclose(place, (1e-3, SKIN.extent[1]))


def test_the_camera_sees_the_whole_sheet() -> None:
    columns, rows = pixels(SHEET.vertices, (0.0, 0.0, 700.0, 900.0)).T
    assert 0 < columns.min() < columns.max() < 700
    assert 0 < rows.min() < rows.max() < 900


def test_a_cell_is_outlined_where_the_estimate_is_one() -> None:
    with View(PLANAR) as view:
        cells = view._scene._cells
        shown = []
        for place in (SKIN.tops[3, 3], SKIN.tops[3, 3] + 1e-5):
            cells.show([Contact(position=place, force=(0.0, 0.0, -0.5))], lambda _: 5e-3)
            shown.append([outline.visible for outline in cells._outlines])
            np.testing.assert_allclose(
                cells._outlines[0].position, (*place * 100, 0.5 + 0.05), rtol=1e-6
            )
        assert shown == [[True, False], [False, False]]
        # A closed square round the cell, as large as one.
        lines = cells._outlines[0].points
        np.testing.assert_array_equal(lines[:, 1], np.roll(lines[:, 0], -1, axis=0))
        cell = SKIN.extent / PLANAR.cells * 100
        np.testing.assert_allclose(np.ptp(lines, axis=(0, 1)), (*cell, 0.0), atol=2e-3)
        np.testing.assert_allclose(lines.mean(axis=(0, 1)), 0.0, atol=1e-3)
