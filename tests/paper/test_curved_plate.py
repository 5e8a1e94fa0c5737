"""Figure S12: what is touched, how errors are counted, and what is drawn."""

from dataclasses import replace

import numpy as np
import pytest

from smoskin.commands.score.errors import Answers

pytest.importorskip("jax")
pytest.importorskip("matplotlib")
from paper.beyond import curved_sheets
from paper.beyond.curved_sheets import SURFACES, attached
from paper.figure_s12 import COUNT, PRINTED, Touched, _errors, curved_rows, draw


@pytest.fixture
def sure():
    """Errors of 1 mm, 2 mm and 10 mN."""
    return Touched(
        world="hard",
        along=np.full(COUNT, 1e-3),
        around=np.full(COUNT, 2e-3),
        force=np.full(COUNT, 0.01),
        detected=1.0,
    )


def test_rows_hold_where_errors_are_not_larger_than_printed(sure):
    assert [row.verdict for row in curved_rows(sure)] == ["reproduced"] * 3
    assert [row.computed for row in curved_rows(sure)] == ["1.00 mm", "2.00 mm", "0.010 N"]
    worse = replace(sure, along=2.1 * sure.along, around=1.8 * sure.around)
    verdicts = [row.verdict for row in curved_rows(worse)]
    assert verdicts == ["unresolved", "reproduced", "reproduced"]


def test_a_touch_that_is_missed_counts_as_told_in_the_middle():
    truth = np.array([[0.01, 0.02, 0, 0, -0.5], [0.10, 0.15, 0, 0, -0.4]])
    error = np.array([[1e-3, -2e-3, 0, 0, 0.02], [np.nan] * 5])
    answers = Answers(
        extent=np.array([0.12, 0.16]),
        truth=truth,
        error=error,
        spread=np.zeros((2, 5, 5)),
        bound=np.zeros((2, 2)),
        count=np.array([1, 0]),
        idle=np.zeros(2, int),
    )
    counted = _errors("plain", answers)
    np.testing.assert_allclose(counted.along, [1e-3, 0.04])
    np.testing.assert_allclose(counted.around, [2e-3, 0.07])
    np.testing.assert_allclose(counted.force, [0.02, 0.4])
    assert counted.detected == 0.5


def test_every_touch_is_in_a_histogram_beside_the_printed_mean(sure):
    plate = draw(sure, sure)
    assert plate.name == "figure_s12"
    for axis, printed, scale in zip(
        plate.figure.axes, PRINTED.values(), (1e3, 1e3, 1.0), strict=True
    ):
        heights = [patch.get_height() for patch in axis.patches]
        assert sum(heights) == 2 * COUNT
        assert any(line.get_xdata()[0] == pytest.approx(scale * printed) for line in axis.lines)


def test_sheets_on_surfaces_are_drawn_with_what_folds(planar):
    sheets = {
        name: attached(planar, SURFACES[name], (2, 2)) for name in ("plane", "sphere, 200 mm")
    }
    plate = curved_sheets.draw(sheets)
    titles = [axis.get_title() for axis in plate.figure.axes]
    plane, sphere = (100 * each.share for each in sheets.values())
    assert titles == [f"plane: {plane:.0f} %", f"sphere, 200 mm: {sphere:.0f} %, locked"]
    assert f"{plane:.0f} to {plane:.0f} %. Orange" in plate.caption
    assert sphere < plane
