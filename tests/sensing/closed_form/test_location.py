"""Rules of location on every size of skin and placement of magnets."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skins import with_magnets
from smoskin.errors import ArgumentError
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.confidence import ambiguities
from smoskin.sensing.closed_form.location import (
    decide,
    divisions,
    ideal_rule,
    readout,
    unit_press,
)


@st.composite
def skins(draw, magnets=(1, 4)):
    """Cells and corners of the magnets on the sheet."""
    cells = draw(st.tuples(st.integers(2, 9), st.integers(2, 9)))
    corner = st.tuples(st.integers(0, cells[0]), st.integers(0, cells[1]))
    return cells, draw(st.lists(corner, min_size=magnets[0], max_size=magnets[1]))


def all_cells(cells):
    return np.stack(np.indices(cells), axis=-1)


def covered(ambiguous, cells):
    """Cells that a list of ambiguities speaks of."""
    named = np.zeros(cells, dtype=bool)
    for ambiguity in ambiguous:
        for n, m in ambiguity.pair:
            rows = {"x": (n, slice(None)), "y": (slice(None), m)}
            named[rows[ambiguity.axis]] = True
    return named


@settings(max_examples=40)
@given(skin=skins(), attenuation=st.floats(0.05, 1.0), factor=st.floats(1e-9, 1e3))
def test_every_cell_not_listed_is_found(planar, skin, attenuation, factor):
    cells, corners = skin
    design = with_magnets(planar, corners, cells)
    design = replace(
        design, coefficients=replace(design.coefficients, attenuation=(attenuation, attenuation))
    )
    unit = unit_press(design)
    # At a force past any that tells two cells apart, only those never told apart are left.
    never = ambiguities(design, force=1e9)
    located = (decide(ideal_rule(unit), factor * unit) == all_cells(cells)).all(axis=-1)
    assert (located | covered(never, cells)).all()
    for ambiguity in never:
        assert ambiguity.same_signs
        assert not ambiguity.ratio_gap > 2e-6 * (1 + ambiguity.ratios[0] ** 2)


@settings(max_examples=30)
@given(skin=skins(magnets=(2, 2)), seed=st.integers(0, 2**32 - 1))
def test_two_magnets_are_judged_by_signs_and_mean_ratios(planar, skin, seed):
    """The rule as the SI words it, written out: the zone by signs, the cell by the lines."""
    cells, corners = skin
    unit = unit_press(with_magnets(planar, corners, cells))
    seen = np.random.default_rng(seed).normal(size=(50, 2, 2))
    decided = decide(divisions(unit), seen)
    for moved, cell in zip(seen, decided, strict=True):
        for axis, along in enumerate((unit[:, 0, :, 0], unit[0, :, :, 1])):
            zone = np.flatnonzero((np.sign(along) == np.sign(moved[:, axis])).all(axis=1))
            if not len(zone):
                assert cell[axis] == -1
                continue
            ratio = along[zone, 0] / along[zone, 1]
            order = np.argsort(ratio)
            lines = (ratio[order][1:] + ratio[order][:-1]) / 2
            expected = zone[order][np.searchsorted(lines, moved[0, axis] / moved[1, axis])]
            same = along[cell[axis], 0] / along[cell[axis], 1]
            assert same == pytest.approx(along[expected, 0] / along[expected, 1], abs=1e-9)


@settings(max_examples=30)
@given(skin=skins(), seed=st.integers(0, 2**32 - 1))
def test_a_mirrored_sheet_gives_mirrored_answers(planar, skin, seed):
    cells, corners = skin
    unit = unit_press(with_magnets(planar, corners, cells))
    mirrored = unit_press(with_magnets(planar, [(cells[0] - p, q) for p, q in corners], cells))
    np.testing.assert_allclose(mirrored, unit[::-1] * (-1.0, 1.0), atol=1e-12)
    seen = unit.reshape(-1, len(corners), 2)
    seen = seen + np.random.default_rng(seed).normal(0, 0.01, seen.shape)
    decided = decide(ideal_rule(unit), seen)
    reflected = decide(ideal_rule(mirrored), seen * (-1.0, 1.0))
    # Of columns in one direction the first is named, whichever way round they are counted.
    columns = unit[:, 0, :, 0] / np.linalg.norm(unit[:, 0, :, 0], axis=-1, keepdims=True)
    back = np.where(reflected[:, 0] < 0, -1, cells[0] - 1 - reflected[:, 0])
    np.testing.assert_array_equal(back < 0, decided[:, 0] < 0)
    np.testing.assert_allclose(columns[back], columns[decided[:, 0]], atol=2e-6)
    np.testing.assert_array_equal(reflected[:, 1], decided[:, 1])


@pytest.mark.parametrize(
    "corners",
    [
        [(3, 3), (3, 3)],
        [(3, 3), (3, 3), (3, 3)],
        [(0, 0), (6, 6)],
        [(0, 0), (0, 0)],
        [(0, 3), (0, 3)],
        [(2, 2), (2, 4)],
        [(0, 0)],
        [(6, 3)],
    ],
)
def test_bad_placements_name_the_first_of_the_cells_they_confuse(planar, corners):
    design = with_magnets(planar, corners)
    unit = unit_press(design)
    decided = decide(ideal_rule(unit), unit).reshape(-1, 2)
    never = covered(ambiguities(design, force=1e9), (6, 6)).ravel()
    right = (decided == all_cells((6, 6)).reshape(-1, 2)).all(axis=-1)
    assert (right | never).all()
    for axis in range(2):
        assert (decided[:, axis] <= all_cells((6, 6)).reshape(-1, 2)[:, axis]).all()
        assert (decided[:, axis] >= 0).all()


def test_four_magnets_leave_no_cell_in_doubt_that_two_leave(planar):
    beside = with_magnets(planar, [(3, 3), (3, 3)])
    assert covered(ambiguities(beside), (6, 6)).all()
    assert ambiguities(with_magnets(planar, [(3, 3), (3, 3), (1, 5), (5, 1)])) == ()


def test_a_magnet_that_stands_still_still_names_its_column():
    """A displacement of zero belongs to its own line of the circle, on which it lies."""
    angles = np.radians([-180.0, -90.0, -45.0, 0.0, 30.0, 90.0])
    along = np.stack([np.sin(angles), np.cos(angles)], axis=-1)
    unit = np.zeros((6, 6, 2, 2))
    unit[..., 0] = along[:, None]
    unit[..., 1] = along
    rule = divisions(unit)
    for turn in np.radians([0.0, 3.0]):
        seen = np.stack([np.sin(angles + turn), np.cos(angles + turn)], axis=-1)
        moved = np.broadcast_to(seen[:, :, None], (6, 2, 2))
        np.testing.assert_array_equal(decide(rule, moved), np.stack([np.arange(6)] * 2, -1))


def test_half_a_turn_either_way_is_one_direction():
    def rule(half):
        angles = np.radians([half, -90.0, -45.0, 0.0, 30.0, 90.0])
        along = np.stack([np.sin(angles), np.cos(angles)], axis=-1)
        unit = np.zeros((6, 6, 2, 2))
        unit[..., 0], unit[..., 1] = along[:, None], along
        return divisions(unit)

    for left, right in zip(rule(-180.0), rule(180.0), strict=True):
        np.testing.assert_allclose(left, right, atol=1e-9)


@given(direction=st.floats(-np.pi, np.pi))
def test_the_circles_of_lines_close(planar, direction):
    rule = divisions(unit_press(planar))
    seen = np.array([[np.sin(direction)] * 2, [np.cos(direction)] * 2])
    turned = np.array([[np.sin(direction + 2 * np.pi)] * 2, [np.cos(direction + 2 * np.pi)] * 2])
    for moved in (seen, turned, seen * 7):
        n, m = decide(rule, moved)
        assert -1 <= n < 6
        assert -1 <= m < 6
    below, above = (np.array([[zero, zero], [-1.0, -1.0]]) for zero in (-0.0, 0.0))
    np.testing.assert_array_equal(decide(rule, below), decide(rule, above))


def test_signs_that_no_cell_gives_name_no_cell(planar):
    unit = unit_press(planar)
    # A load right of magnet 2 (x = 4 cells) yet left of magnet 3 (x = 2 cells) cannot be.
    impossible = np.array([[-1.0, 1.0], [1.0, 1.0]])
    assert decide(divisions(unit), impossible)[0] == -1


def test_readout_takes_the_drag_off(planar):
    calibration = Calibration.nominal(planar)
    rng = np.random.default_rng(0)
    drag, pressed = np.array([0.3, -0.2]), rng.normal(0, 1e-4, (2, 2))
    board = drag / calibration.board_stiffness
    sheet = drag / calibration.sheet_stiffness
    moved = np.zeros((3, 3))
    moved[0, :2] = board
    moved[1:, :2] = -(pressed + sheet)
    seen = moved.ravel() @ readout(planar, calibration)
    np.testing.assert_allclose(seen, [*pressed.ravel(), *drag], rtol=1e-12)


def test_wrong_use_is_named(planar):
    three = unit_press(with_magnets(planar, [(1, 1), (2, 2), (3, 3)]))
    with pytest.raises(ArgumentError, match=r"must have shape \(N, M, 2, 2\); got \(6, 6, 3, 2\)"):
        divisions(three)
    bare = replace(planar, halls=planar.halls[:1])
    with pytest.raises(ArgumentError, match="must have a chip under a magnet of the sheet"):
        unit_press(bare)
