"""Errors of an exam: what counts how, in which region, and how much area is good."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.commands.score.errors import Answers, tally, together
from smoskin.commands.score.report import PlaceMap, grid_places, regions

EXTENT = np.array([0.12, 0.16])
SPREAD = np.diag([1e-3, 2e-3, 0.02, 0.03, 0.05]) ** 2


def judged(count, seed=0, missed=()):
    """Touches of half a newton whose errors are as large as their covariance says."""
    rng = np.random.default_rng(seed)
    truth = np.zeros((count, 5))
    truth[:, :2] = rng.uniform(0, EXTENT, (count, 2))
    truth[:, 2:] = 0.3, -0.4, -0.5
    error = rng.multivariate_normal(np.zeros(5), SPREAD, (count, 1))[:, 0]
    numbers = np.ones(count, dtype=np.int64)
    error[list(missed)], numbers[list(missed)] = np.nan, 0
    return Answers(
        extent=EXTENT,
        truth=truth,
        error=error,
        spread=np.broadcast_to(SPREAD, (count, 5, 5)),
        bound=np.full((count, 2), np.nan),
        count=numbers,
        idle=np.zeros(count, dtype=np.int64),
    )


def test_errors_of_the_stated_size_are_held_as_often_as_stated():
    marks = judged(4000)
    for axes in ((0, 1), (2, 3), (4,)):
        sure = np.sort(marks.confidence(axes))
        # Kolmogorov's distance from even, at one chance in a thousand.
        assert np.abs(sure - (np.arange(4000) + 0.5) / 4000).max() < 1.95 / np.sqrt(4000)
    figures = tally("all", marks)
    assert figures.held.place == pytest.approx(0.9, abs=0.02)
    assert figures.held.drag == pytest.approx(0.9, abs=0.02)
    assert figures.location.rms == pytest.approx(np.hypot(1e-3, 2e-3), rel=0.05)
    assert figures.force_size == pytest.approx(0.05 * np.sqrt(2 / np.pi), rel=0.05)
    assert figures.force == pytest.approx(figures.force_size / 0.5)
    assert figures.drag == pytest.approx(figures.drag_size / 0.5)


def test_a_missed_touch_counts_as_one_in_the_middle_without_force():
    whole = judged(50, missed=(3, 7))
    missed = whole.where(~whole.detected)
    assert len(missed.truth) == 2
    assert missed.distance == pytest.approx(np.hypot(*(missed.truth[:, :2] - [0.06, 0.08]).T))
    figures = tally("missed", missed)
    assert (figures.detected, figures.force, figures.drag) == (
        0.0,
        pytest.approx(1.0),
        pytest.approx(1.0),
    )
    assert figures.held == (0.0, 0.0, 0.0)
    assert tally("whole", whole).detected == pytest.approx(0.96)
    assert (
        tally("whole", whole).location.mean
        > tally("good", whole.where(whole.detected)).location.mean
    )


def test_straight_touches_state_nothing_of_drags_and_have_none():
    answers = judged(20)
    answers.truth[..., 2:4] = answers.error[..., 2:4] = 0.0
    straight = SPREAD * np.outer([1, 1, 0, 0, 1], [1, 1, 0, 0, 1])
    marks = replace(answers, spread=np.broadcast_to(straight, (20, 5, 5)))
    assert (marks.confidence((2, 3)) == 1.0).all()
    figures = tally("straight", marks)
    assert (figures.drag, figures.held.drag) == (None, None)
    assert figures.held.place > 0.5


def test_the_ratio_to_the_bound_is_taken_where_it_is_below_5_mm():
    answers = judged(1000)
    bound = np.full((1000, 2), [np.hypot(1e-3, 2e-3), 5e-3])
    bound[::2] = 10e-3
    figures = tally("half", replace(answers, bound=bound))
    assert figures.near.share == 0.5
    assert figures.near.noise == pytest.approx(1.0, rel=0.1)
    assert figures.near.known is None
    assert tally("none", answers).near is None


def test_regions_part_the_skin(planar):
    places = np.array([[0.005, 0.08], [0.06, 0.158], [0.0401, 0.1065], [0.03, 0.08]])
    parted = regions(planar, places)
    assert sum(rows.astype(int) for rows in parted.values()).tolist() == [1, 1, 1, 1]
    assert parted["rim"].tolist() == [True, True, False, False]
    corners = {magnet.corner for magnet in planar.magnets}
    middles = np.array([[0.02 * p, 0.0266666 * q] for p, q in corners])
    assert regions(planar, middles)["over magnets"].all()


def test_area_counts_rims_by_half_and_corners_by_a_quarter():
    error = np.full((3, 3), 2e-3)
    error[0] = 1e-3
    shown = PlaceMap(extent=EXTENT, location=error, force=error * 10)
    assert shown.area(1.2e-3, 0.05) == pytest.approx(0.25)
    assert shown.area(1.2e-3, 0.005) == 0.0
    error[1:] = np.nan
    assert shown.area(1.2e-3, 0.05) == 1.0


def test_every_place_of_a_grid_is_found_again():
    lines = np.linspace(0, 0.12, 25), np.linspace(0, 0.16, 33)
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    assert (grid_places(grid, EXTENT, (25, 33)) == np.arange(25 * 33)).all()
    answers = judged(2)
    assert np.array_equal(
        together([answers, answers]).truth, np.concatenate([answers.truth, answers.truth])
    )


def test_a_force_that_is_not_told_counts_as_none():
    whole = judged(50)
    whole.error[..., 2:] = np.nan
    figures = tally("place alone", whole)
    assert figures.detected == 1.0
    assert figures.location.mean < 3e-3
    assert (figures.force, figures.drag) == (pytest.approx(1.0), pytest.approx(1.0))
    assert (figures.held.force, figures.held.drag) == (0.0, 0.0)
    assert figures.held.place > 0.8
