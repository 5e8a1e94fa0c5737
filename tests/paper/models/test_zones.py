"""Zones of equal signs: Table S1 as printed, and what holds on every skin with two magnets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paper.models.zones import signal_matrix, zones
from skins import with_magnets
from smoskin.errors import ArgumentError
from smoskin.sensing.closed_form.location import unit_press


@st.composite
def skins(draw):
    """Cells and corners of the two magnets on the sheet."""
    cells = draw(st.tuples(st.integers(2, 9), st.integers(2, 9)))
    corner = st.tuples(st.integers(0, cells[0]), st.integers(0, cells[1]))
    return cells, draw(st.lists(corner, min_size=2, max_size=2))


def test_zones_of_the_reference_are_table_s1(planar):
    unit = unit_press(planar)
    regions = zones(unit)
    assert [zone.number for zone in regions] == list(range(1, 10))
    assert [(z.columns, z.rows) for z in regions[:4]] == [
        ((0, 1), (0, 1)), ((2, 3), (0, 1)), ((4, 5), (0, 1)), ((0, 1), (2, 3)),
    ]  # fmt: skip
    signs = ["".join("+" if s > 0 else "-" for s in zone.signs) for zone in regions]
    assert signs == ["----", "--+-", "+-+-", "-+--", "-++-", "+++-", "-+-+", "-+++", "++++"]
    assert regions[0].lines_x == pytest.approx([1.3248], abs=5e-5)
    for zone in regions:
        expected = unit[list(zone.columns), 0, 0, 0] / unit[list(zone.columns), 0, 1, 0]
        np.testing.assert_allclose(zone.ratios_x, expected)
        assert zone.lines_x == pytest.approx([expected.mean()])


@settings(max_examples=30)
@given(skin=skins())
def test_zones_hold_every_cell_once_and_their_lines_decide(planar, skin):
    cells, corners = skin
    unit = unit_press(with_magnets(planar, corners, cells))
    seen = np.zeros(cells, dtype=int)
    for zone in zones(unit):
        seen[np.ix_(zone.columns, zone.rows)] += 1
        assert len(zone.lines_x) <= len(zone.columns) - 1
        for n in zone.columns:
            assert tuple(signal_matrix(unit[n, zone.rows[0]]).ravel()) == zone.signs
    assert (seen == 1).all()


def test_a_load_lies_where_the_magnets_do_not_go():
    moved = np.array([[-1.0, 1.0], [1.0, 1.0]])
    assert signal_matrix(moved).tolist() == [[1, -1], [-1, -1]]


def test_wrong_use_is_named(planar):
    three = unit_press(with_magnets(planar, [(1, 1), (2, 2), (3, 3)]))
    with pytest.raises(ArgumentError, match=r"must have shape \(N, M, 2, 2\); got \(6, 6, 3, 2\)"):
        zones(three)
